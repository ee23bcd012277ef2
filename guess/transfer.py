"""Unknowns along a motion that is already known, on another mesh or in another discretisation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from typing import Any

import numpy as np

from dmoc.base.discretisation import FORMS
from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.guess.hits import completed
from dmoc.motion.trajectory import Trajectory
from dmoc.problem.design import designed_as
from dmoc.problem.problem import Problem
from dmoc.program.blocks import NOWHERE
from dmoc.program.iterate import Iterate
from dmoc.program.layout import Layout

# How far inside of its step an input at a node counts where inputs may jump there, as a share of
# the step.
INSIDE = 1e-6


@record(frozen=True, eq=False)
class Piece:
    """A phase to follow: times t of positions q and velocities v, times t_u of inputs u, the forces
    of its reactions by their kind, with their times, and parameters of its model."""

    t: Array
    q: Array
    v: Array
    t_u: Array
    u: Array
    forces: Mapping[str, tuple[Array, Array]] = field(default_factory=dict)
    parameters: Mapping[str, Any] = field(default_factory=dict)

    def followed_by(self, other: Piece) -> Piece:
        """Two pieces between which nothing happens as one, without forces."""
        t, q, v = (
            np.concatenate([mine, theirs[1:]])
            for mine, theirs in ((self.t, other.t), (self.q, other.q), (self.v, other.v))
        )
        t_u, u = np.concatenate([self.t_u, other.t_u]), np.concatenate([self.u, other.u])
        return Piece(t, q, v, t_u, u, parameters=self.parameters)

    def with_node(self, k: int) -> Piece:
        """The same piece with one node more, in the middle of step k."""
        at = self.t[k : k + 2].mean()
        v = (self.q[k + 1] - self.q[k]) / (self.t[k + 1] - self.t[k])
        more = (self.t, at), (self.q, self.positions(at[None])), (self.v, v)
        t, q, v = (np.insert(rows, k + 1, row, axis=0) for rows, row in more)
        return replace(self, t=t, q=q, v=v)

    @property
    def first(self) -> Piece:
        """A piece that is the first node alone."""
        rows = (self.t, self.q, self.v)
        t, q, v = (part[:1] for part in rows)
        return Piece(t, q, v, self.t_u[:0], self.u[:0], parameters=self.parameters)

    def positions(self, t: Array) -> Array:
        """The cubics through the nodes, with their velocities, at times of shape (n,)."""
        if len(self.t) == 1:
            return np.repeat(self.q, len(t), axis=0)
        k = np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, len(self.t) - 2)
        h = (self.t[k + 1] - self.t[k])[:, None]
        s = (t - self.t[k])[:, None] / h
        q_k, q_kp1, v_k, v_kp1 = self.q[k], self.q[k + 1], self.v[k], self.v[k + 1]
        bent = (1 - s) * (h * v_k + q_k - q_kp1) + s * (q_kp1 - q_k - h * v_kp1)
        return np.asarray(q_k + s * (q_kp1 - q_k) + s * (1 - s) * bent)


def pieces_of(trajectory: Trajectory) -> list[Piece]:
    return [
        Piece(
            p.t,
            p.q,
            p.v,
            times_of_inputs(trajectory.controls, p.t),
            p.u,
            p.forces,
            trajectory.parameters,
        )
        for p in trajectory.phases
    ]


def equally_long(pieces: Sequence[Piece]) -> list[Piece]:
    """The same motion in the same time, in phases that take equally long."""
    begin = pieces[0].t[0]
    length = (pieces[-1].t[-1] - begin) / len(pieces)
    stretched = []
    for i, piece in enumerate(pieces):
        pace = np.ptp(piece.t) / length
        shift = begin + i * length - piece.t[0] / pace
        t, t_u = (shift + at / pace for at in (piece.t, piece.t_u))
        forces = {kind: (shift + at / pace, rows) for kind, (at, rows) in piece.forces.items()}
        stretched.append(replace(piece, t=t, v=pace * piece.v, t_u=t_u, forces=forces))
    return stretched


def unknowns_along(problem: Problem, pieces: Sequence[Piece], impulses: Sequence[float]) -> Array:
    """Return x, shape (n,), along the pieces, one for each phase of the problem: positions by
    cubic, inputs by linear interpolation."""
    lay, problem = Layout.of(problem), designed_as(problem, pieces[0].parameters)
    if lay.ends_with_event:
        pieces = [*pieces[:-1], pieces[-1].first]
    x = lay.zeros(problem)
    nodes, inside, inputs, rates = [], [], [], []
    for piece, steps in zip(pieces, lay.steps, strict=True):
        t = np.linspace(piece.t[0], piece.t[-1], steps + 1)
        nodes.append(piece.positions(t))
        within = lay.scheme.within(t[:-1], t[1:])
        inside.append(piece.positions(within.ravel()).reshape(steps, lay.inside * lay.nq))
        rates.append(np.stack([np.interp(t, piece.t, v) for v in piece.v.T], axis=1))
        at = times_of_inputs(lay.form.name, t)
        columns = [np.interp(at, piece.t_u, u) for u in piece.u.T] if steps else []
        inputs.append(np.stack(columns, axis=1) if columns else np.zeros((len(at), lay.nu)))
    x[lay.index_h] = lay.step_sizes(np.array([p.t[-1] - p.t[0] for p in pieces]))
    x[lay.index_q] = np.vstack([*(part[:-1] for part in nodes), nodes[-1][-1:]])
    x[lay.index_u] = np.vstack(inputs)
    x[lay.impact.lam] = impulses
    x[lay.impact.v_a] = np.array([p.v[-1] for p in pieces[:-1]]).reshape(-1, lay.nq)
    x[lay.impact.v_c] = np.array([p.v[0] for p in pieces[1:]]).reshape(-1, lay.nq)
    x[lay.index_q_i] = np.vstack(inside)
    passed = lay.index_w[:, 0] != NOWHERE
    w = np.vstack([*(part[:-1] for part in rates), rates[-1][-1:]])
    x[lay.index_w[passed]] = w[passed]
    lay.put_times(x)
    _push(lay, pieces, x)
    ends = (
        (pieces[0], 0, lay.index_p_B, lay.index_v_B),
        (pieces[-1], -1, lay.index_p_E, lay.index_v_E),
    )
    for piece, k, index_p, index_v in ends:
        x[index_p] = problem.models[k].momentum(piece.q[k], piece.v[k], piece.t[k])
        if len(index_v):
            x[index_v] = piece.v[k]
    return completed(Iterate.of(problem, x))


def _push(lay: Layout, pieces: Sequence[Piece], x: Array) -> None:
    """Impulses of reactions from the forces of the pieces; where a piece has none of the phase's
    they stay zero."""
    for i, piece in enumerate(pieces[: lay.stepped]):
        weight = x[lay.index_h[i]] * lay.stations.share[lay.stations.rows(i)]
        share = station_shares(lay, i)
        for reaction in lay.reactions(i):
            t, forces = piece.forces.get(reaction.kind, (piece.t, np.zeros((0, 0))))
            if forces.shape[1:] != (len(reaction.columns),):
                continue
            at = (t - piece.t[0]) / np.ptp(piece.t)
            for unknowns, force in zip(reaction.unknowns.T, forces.T, strict=True):
                x[unknowns] = weight * np.interp(share, at, force)


def station_shares(lay: Layout, i: int) -> Array:
    """Shares of phase i at which its stations are, those at nodes that two steps have a little
    inside of their steps."""
    at, n = lay.stations, lay.steps[i]
    rows = at.rows(i)
    numbers = np.sort(lay.scheme.nodes)[at.place[rows] % lay.scheme.degree]
    share = (at.place[rows] // lay.scheme.degree - lay.ends[i] + numbers) / n
    if at.own:
        share += INSIDE / n * (1.0 * at.begins[rows] - at.ends[rows])
    return np.asarray(share)


def on_mesh(problem: Problem, other: Problem, x: Array) -> Array:
    """Unknowns of a problem from those x, shape (n,), of the same problem with other steps."""
    lay = Layout.of(other)
    design = dict(zip(other.design, x[lay.index_design].tolist(), strict=True))
    t, q, h = lay.times(x), x[lay.index_q], x[lay.index_h]
    pieces = []
    for i in range(lay.stepped):
        first, last = int(lay.ends[i]), int(lay.ends[i + 1])
        nodes, at = np.ascontiguousarray(q[first : last + 1]), t[first : last + 1]
        v = np.gradient(nodes, h[i], axis=0)
        rows = slice(lay.row_u_k[first], lay.row_u_kp1[last - 1] + 1)
        times = times_of_inputs(lay.form.name, at)
        u = x[lay.index_u][rows]
        pieces.append(Piece(at, nodes, v, times, u, _forces(lay, x, i), design))
    if lay.ends_with_event:
        end = np.zeros((0, lay.nu))
        pieces.append(Piece(t[-1:], q[-1:], q[-1:].copy(), t[:0], end, parameters=design))
    for index, side, k in ((lay.impact.v_a, pieces[:-1], -1), (lay.impact.v_c, pieces[1:], 0)):
        for velocity, piece in zip(x[index], side, strict=True):
            piece.v[k] = velocity
    return unknowns_along(problem, pieces, list(x[lay.impact.lam]))


def _forces(lay: Layout, x: Array, i: int) -> dict[str, tuple[Array, Array]]:
    """Forces of the reactions of phase i, by their kind, and their times."""
    h = x[lay.index_h[i]]
    weight = h * lay.stations.share[lay.stations.rows(i)][:, None]
    t = lay.times(x)[lay.ends[i]] + h * lay.steps[i] * station_shares(lay, i)
    return {r.kind: (t, r.impulses(x) / weight) for r in lay.reactions(i)}


def times_of_inputs(controls: str, t: Array) -> Array:
    """Times of the rows of u in a phase with nodes at t, shape (N + 1,); shape (rows,). Where
    inputs may jump at the nodes, they lie a little inside of the steps."""
    form, steps = FORMS[controls], np.diff(t)
    times, at = form.times(t), form.starts(len(steps))
    if form.jumps:
        times[at] += INSIDE * steps
        times[at + form.width] -= INSIDE * steps
    return times
