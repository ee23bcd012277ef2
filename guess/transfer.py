"""Unknowns along a motion that is already known, on another mesh or in another discretisation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from dmoc.base.discretisation import FORMS
from dmoc.codegen.kernels import Array
from dmoc.guess.hits import through_hits, with_hidden
from dmoc.motion.trajectory import Trajectory
from dmoc.problem.problem import Problem
from dmoc.program.layout import Layout
from dmoc.program.reactions import node_shares

# How far inside of its step an input at a node counts where inputs may jump there, as a share of
# the step.
INSIDE = 1e-6


@dataclass(frozen=True)
class Piece:
    """A phase to follow: times t of positions q and velocities v, times t_u of inputs u, and the
    forces of its reactions by their kind."""

    t: Array
    q: Array
    v: Array
    t_u: Array
    u: Array
    forces: Mapping[str, Array] = field(default_factory=dict)

    def followed_by(self, other: Piece) -> Piece:
        """Two pieces between which nothing happens as one, without forces."""
        t, q, v = (
            np.concatenate([mine, theirs[1:]])
            for mine, theirs in ((self.t, other.t), (self.q, other.q), (self.v, other.v))
        )
        t_u, u = np.concatenate([self.t_u, other.t_u]), np.concatenate([self.u, other.u])
        return Piece(t, q, v, t_u, u)

    def positions(self, t: Array) -> Array:
        """The cubics through the nodes, with their velocities, at times of shape (n,)."""
        k = np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, len(self.t) - 2)
        h = (self.t[k + 1] - self.t[k])[:, None]
        s = (t - self.t[k])[:, None] / h
        q_k, q_kp1, v_k, v_kp1 = self.q[k], self.q[k + 1], self.v[k], self.v[k + 1]
        bent = (1 - s) * (h * v_k + q_k - q_kp1) + s * (q_kp1 - q_k - h * v_kp1)
        return np.asarray(q_k + s * (q_kp1 - q_k) + s * (1 - s) * bent)


def pieces_of(trajectory: Trajectory) -> list[Piece]:
    return [
        Piece(p.t, p.q, p.v, times_of_inputs(trajectory.controls, p.t), p.u, p.forces)
        for p in trajectory.phases
    ]


def equally_long(pieces: Sequence[Piece]) -> list[Piece]:
    """The same way in the same time, in phases that take equally long."""
    begin = pieces[0].t[0]
    length = (pieces[-1].t[-1] - begin) / len(pieces)
    stretched = []
    for i, piece in enumerate(pieces):
        pace = np.ptp(piece.t) / length
        t, t_u = (begin + i * length + (at - piece.t[0]) / pace for at in (piece.t, piece.t_u))
        stretched.append(replace(piece, t=t, v=pace * piece.v, t_u=t_u))
    return stretched


def unknowns_along(problem: Problem, pieces: Sequence[Piece], impulses: Sequence[float]) -> Array:
    """Return x along the pieces, one for each phase of the problem: positions by cubic, inputs
    by linear interpolation."""
    lay = Layout.of(problem)
    x = np.zeros(lay.size)
    nodes, inside, inputs, times = [], [], [], []
    for piece, steps in zip(pieces, lay.steps, strict=True):
        t = np.linspace(piece.t[0], piece.t[-1], steps + 1)
        nodes.append(piece.positions(t))
        within = lay.scheme.within(t[:-1], t[1:])
        inside.append(piece.positions(within.ravel()).reshape(steps, -1))
        times.append(t)
        at = times_of_inputs(lay.form.name, t)
        columns = [np.interp(at, piece.t_u, u) for u in piece.u.T]
        inputs.append(np.stack(columns, axis=1) if columns else np.zeros((len(at), 0)))
    x[lay.index_h] = [(p.t[-1] - p.t[0]) / n for p, n in zip(pieces, lay.steps, strict=True)]
    x[lay.index_q] = np.vstack([*(part[:-1] for part in nodes), nodes[-1][-1:]])
    x[lay.index_u] = np.vstack(inputs)
    x[lay.impact.lam] = impulses
    x[lay.impact.v_a] = np.array([p.v[-1] for p in pieces[:-1]]).reshape(-1, lay.nq)
    x[lay.impact.v_c] = np.array([p.v[0] for p in pieces[1:]]).reshape(-1, lay.nq)
    if lay.timed:
        x[lay.index_t] = np.concatenate([*(part[:-1] for part in times), times[-1][-1:]])
    x[lay.index_q_i] = np.vstack(inside)
    _push(lay, pieces, x)
    ends = (
        (pieces[0], 0, lay.index_p_B, lay.index_v_B),
        (pieces[-1], -1, lay.index_p_E, lay.index_v_E),
    )
    for piece, k, index_p, index_v in ends:
        x[index_p] = problem.model.momentum(piece.q[k], piece.v[k], piece.t[k])
        if len(index_v):
            x[index_v] = piece.v[k]
    return with_hidden(problem, lay, through_hits(problem, lay, x))


def _push(lay: Layout, pieces: Sequence[Piece], x: Array) -> None:
    """Impulses of reactions from the forces of the pieces; where a piece has none of the phase's
    they stay zero."""
    for i, (piece, n) in enumerate(zip(pieces, lay.steps, strict=True)):
        weight, share = x[lay.index_h[i]] * node_shares(n), np.linspace(0, 1, n + 1)
        for reaction in lay.reactions(i):
            forces = piece.forces.get(reaction.kind)
            if forces is None or forces.shape[1:] != (len(reaction.columns),):
                continue
            at = np.linspace(0, 1, len(forces))
            for unknowns, force in zip(reaction.unknowns.T, forces.T, strict=True):
                x[unknowns] = weight * np.interp(share, at, force)


def on_mesh(problem: Problem, other: Problem, x: Array) -> Array:
    """Unknowns of a problem from those x of the same problem with other steps."""
    lay = Layout.of(other)
    t, q, h = lay.times(x), x[lay.index_q], x[lay.index_h]
    pieces = []
    for i in range(lay.phases):
        first, last = int(lay.ends[i]), int(lay.ends[i + 1])
        nodes, at = np.ascontiguousarray(q[first : last + 1]), t[first : last + 1]
        v = np.gradient(nodes, h[i], axis=0)
        rows = slice(lay.row_u_k[first], lay.row_u_kp1[last - 1] + 1)
        times = times_of_inputs(lay.form.name, at)
        pieces.append(Piece(at, nodes, v, times, x[lay.index_u][rows], _forces(lay, x, i)))
    for index, side, k in ((lay.impact.v_a, pieces[:-1], -1), (lay.impact.v_c, pieces[1:], 0)):
        for velocity, piece in zip(x[index], side, strict=True):
            piece.v[k] = velocity
    return unknowns_along(problem, pieces, list(x[lay.impact.lam]))


def _forces(lay: Layout, x: Array, i: int) -> dict[str, Array]:
    """Forces of the reactions of phase i, by their kind."""
    weight = x[lay.index_h[i]] * node_shares(lay.steps[i])[:, None]
    return {r.kind: r.impulses(x) / weight for r in lay.reactions(i)}


def times_of_inputs(controls: str, t: Array) -> Array:
    """Times of the rows of u; where inputs may jump at the nodes, a little inside of the steps."""
    form, steps = FORMS[controls], np.diff(t)
    times, at = form.times(t), form.starts(len(steps))
    if form.jumps:
        times[at] += INSIDE * steps
        times[at + form.width] -= INSIDE * steps
    return times
