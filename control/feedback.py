"""Feedback along a motion: its gains, its motion extended past each event, and as tables."""

from __future__ import annotations

import io
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dmoc.base.arguments import array, check_known, is_number, number, positive, shown, whole
from dmoc.base.errors import SimulationError
from dmoc.base.files import write_whole
from dmoc.base.names import velocity_name
from dmoc.base.signatures import public
from dmoc.base.table import Cell, Shown, Table
from dmoc.check.checked_motion import Motion, put
from dmoc.codegen.kernels import Array
from dmoc.control.controller import BEYOND, Measured, digest_of
from dmoc.control.linearisation import (
    PARTS,
    LinearPhase,
    input_sizes,
    input_slopes,
    inputs_at,
    linear_phase,
    projection,
    saltation,
    state_sizes,
    states_after,
)
from dmoc.control.riccati import Weights, backward_sweep, gains, hamiltonian, periodic_sweep
from dmoc.control.stability import back
from dmoc.mechanics.model_values import by_name
from dmoc.motion.trajectory import Collision, Trajectory
from dmoc.simulation.flow import Steps

ASYMMETRIC = 1e-9  # of the largest entry of a weight
Weight = float | Mapping[Any, float] | ArrayLike


@dataclass(frozen=True, eq=False)
class Guide:
    """What a feedback follows in a phase, m nodes, the events at both ends passed by.

    Attributes
    ----------
    begin, end : float
        Planned times of the events at both ends; the nodes begin before and end after them.
    t : array of shape (m,)
    y : array of shape (m, 2 nq)
        Coordinates and velocities: between nodes cubics with these slopes, and their rates.
    u : array of shape (m, nu)
        Inputs of the motion, constant from each node to the next.
    K : array of shape (m, nu, 2 nq)
        Gains, linear between nodes, and constant before the phase and after it.
    """

    begin: float
    end: float
    t: Array
    y: Array
    u: Array
    K: Array


@public(SimulationError)
@dataclass(frozen=True, eq=False)
class Feedback(Shown):
    """Result of :func:`dmoc.feedback`: inputs u = u_ref(t) - K(t) (y - y_ref(t)) of each phase,
    within their bounds.

    Attributes
    ----------
    states, inputs : tuples of str
        Names of what y = (q | v) and u hold.
    phases : tuple of Guide
    events : tuple of Collision
        What is planned at the end of each phase but the last.
    bounds : array of shape (nu, 2)
    Q, R : arrays of shape (2 nq, 2 nq), (nu, nu)
    P : array of shape (2 nq, 2 nq)
        At the start: a deviation dy costs dy^T P dy; of a periodic motion over all periods, but
        over one alone what the inputs do not reach and what does not die away.
    motion : str
        Digest of the motion.
    """

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    phases: tuple[Guide, ...]
    events: tuple[Collision, ...]
    bounds: Array
    Q: Array
    R: Array
    P: Array
    motion: str

    def __repr__(self) -> str:
        return f"<Feedback of {len(self.phases)} phases, {self.phases[-1].end:.6g} s>"

    def at(self, phase: int, t: float) -> tuple[Array, Array, Array]:
        """The state (2 nq,), the inputs (nu,) and the gains (nu, 2 nq) of a phase at a time; before
        its first node and after its last one those of the node.

        Raises
        ------
        SimulationError
            If there is no such phase.
        """
        guide = self.phases[whole(phase, "phase", 0, len(self.phases) - 1, SimulationError)]
        return follow(guide, number(t, "t", SimulationError))

    def begin(self) -> Feedback:
        """The feedback itself: it keeps nothing of a motion."""
        return self

    def fits(self, motion: Trajectory) -> bool:
        """Whether the feedback is made for a motion."""
        return self.motion == digest_of(motion)

    def span(self, phase: int) -> tuple[float, float]:
        """When a phase is planned to begin and to end."""
        return self.phases[phase].begin, self.phases[phase].end

    def steer(self, phase: int, t: float, h: float, measured: Measured | None) -> Array:
        """The inputs of the motion in the middle of the h seconds from t on, and what the gains at
        t make of the deviation that was measured."""
        guide = self.phases[phase]
        u = follow(guide, t + h / 2)[1]
        if measured is None:
            return u
        reference = follow(self.phases[measured.phase], measured.time)[0]
        return np.asarray(u - follow(guide, t)[2] @ (measured.y - reference))

    def to_arrays(self) -> dict[str, Array]:
        """The tables as plain arrays, the rows of all phases one after the other: ``phase`` (m,),
        ``t`` (m,), ``y`` (m, 2 nq), ``u`` (m, nu), ``K`` (m, nu, 2 nq), and ``begin`` and ``end``
        of the phases."""
        numbers = [np.full(len(g.t), float(i)) for i, g in enumerate(self.phases)]
        parts = {
            name: np.concatenate([getattr(g, name) for g in self.phases])
            for name in ("t", "y", "u", "K")
        }
        ends = {n: np.array([getattr(g, n) for g in self.phases]) for n in ("begin", "end")}
        return {"phase": np.concatenate(numbers), **parts, **ends}

    def to_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write the tables as comma-separated values with all digits: a row for each node of each
        phase, with time, phase, state, inputs, and the gains ``K[u,x]``.

        Raises
        ------
        OutputError
            If the file cannot be written.
        """
        return write_whole(path, self.csv().encode())

    def csv(self) -> str:
        """The text that :meth:`to_csv` writes."""
        stream, rows = io.StringIO(), self.to_arrays()
        names = ["t", "phase", *self.states, *self.inputs]
        names += [f"K[{u};{x}]" for u in self.inputs for x in self.states]
        m = len(rows["t"])
        columns = [rows["t"], rows["phase"], rows["y"], rows["u"], rows["K"].reshape(m, -1)]
        stream.write(",".join(names) + "\n")
        for row in np.column_stack(columns):
            entries = (f"{x:.17g}" for x in row)
            stream.write(",".join(entries) + "\n")
        return stream.getvalue()

    def summary(self) -> Table:
        """What ``print`` and notebooks show."""
        return Table(tuple(_rows(self)), ("phase", "from", "to", "ends with", "largest gains"))


def _rows(f: Feedback) -> Iterator[tuple[Cell, ...]]:
    words = [*(c.word for c in f.events), ""]
    for i, (guide, word) in enumerate(zip(f.phases, words, strict=False)):
        largest = np.abs(guide.K).max(axis=0)
        largest_gains = ", ".join(
            f"{u} {x} {largest[a, b]:.4g}"
            for a, u in enumerate(f.inputs)
            for b, x in enumerate(f.states)
        )
        yield f"{i + 1}", f"{guide.begin:.4g} s", f"{guide.end:.4g} s", word, largest_gains


def follow(guide: Guide, t: float) -> tuple[Array, Array, Array]:
    """State, inputs and gains of a phase at a time, shapes (2 nq,), (nu,) and (nu, 2 nq)."""
    t = min(max(t, guide.t[0]), guide.t[-1])
    k = min(int(np.searchsorted(guide.t, t, side="right")) - 1, len(guide.t) - 2)
    h = guide.t[k + 1] - guide.t[k]
    x = (t - guide.t[k]) / h
    (q0, v0), (q1, v1) = guide.y[k : k + 2].reshape(2, 2, -1)
    rest, bend = q1 - q0 - h * v0, h * (v1 - v0)
    square, cube = 3 * rest - bend, bend - 2 * rest
    q = q0 + x * (h * v0 + x * (square + x * cube))
    v = v0 + x * (2 * square + 3 * x * cube) / h
    return np.concatenate([q, v]), guide.u[k], (1 - x) * guide.K[k] + x * guide.K[k + 1]


@np.errstate(all="ignore")  # what is not finite is told as that
def feedback_along(
    motion: Motion, periodic: Mapping[str, Mapping[str, float]], Q: Weight | None, R: Weight | None
) -> Feedback:
    """The feedback of a motion; what is given, is said in :func:`dmoc.feedback`."""
    trajectory, sizes, of_inputs = motion.trajectory, state_sizes(motion), input_sizes(motion)
    names = motion.model.kernels.coordinates
    states, inputs = (*names, *map(velocity_name, names)), tuple(trajectory.inputs)
    if not inputs:
        raise SimulationError(
            f"the model {trajectory.model!r} has no inputs: there is nothing to feed back; its "
            "stability is solution.stability()."
        )
    q = weight_matrix(Q, "Q", states, np.diag(1 / sizes**2))
    r = weight_matrix(R, "R", inputs, np.diag(1 / of_inputs**2), definite=True)
    w = Weights(q * sizes * sizes[:, None], r * of_inputs * of_inputs[:, None], sizes, of_inputs)
    phases = [linear_phase(motion, i) for i in range(motion.stepped)]
    jumps = [
        saltation(motion, i, inputs_at(motion, i)) / sizes[:, None] * sizes
        for i in range(len(trajectory.collisions))
    ]
    hamiltonians = [hamiltonian(s, w) for s in phases]
    if periodic:
        again = _again(motion, phases, jumps, periodic)
        P_along = periodic_sweep(hamiltonians, jumps, again, phases, w)
    else:
        P_along = backward_sweep(hamiltonians, jumps, trajectory.final_time * w.Q)
    guides = tuple(
        _guide(motion, i, s, p, w) for i, (s, p) in enumerate(zip(phases, P_along, strict=True))
    )
    if not all(np.isfinite(guide.K).all() for guide in guides):
        raise SimulationError(
            "the gains are not finite: give weights Q and R that are nearer to the sizes of the "
            "motion, which None stands for."
        )
    events = tuple(trajectory.collisions[: len(guides) - 1])
    bounds = np.array(trajectory.input_bounds)
    P0 = P_along[0][0] / sizes / sizes[:, None]
    digest = digest_of(trajectory)
    return Feedback(states, inputs, guides, events, bounds, q, r, P0, digest)


def _again(
    motion: Motion,
    phases: Sequence[LinearPhase],
    jumps: Sequence[Array],
    periodic: Mapping[str, Mapping[str, float]],
) -> Array:
    """The deviation at the start of a period by that at the end of the one before, in sizes."""
    sizes = state_sizes(motion)
    whole_motion = np.eye(len(sizes))
    for i, s in enumerate(phases):
        for transition in s.transitions():
            whole_motion = transition @ whole_motion
        if i < len(jumps):
            whole_motion = jumps[i] * sizes[:, None] / sizes @ whole_motion
    again = back(motion, whole_motion, periodic)
    if isinstance(again, str):
        raise SimulationError(
            f"{again.replace('no multipliers', 'no gains that repeat')}: state each of them in "
            "`periodic`, or leave it out, for gains over one period."
        )
    return again / sizes[:, None] * sizes


def _guide(motion: Motion, i: int, s: LinearPhase, P: Array, w: Weights) -> Guide:
    """The motion of a phase with its gains, extended past its events."""
    phase, mode = motion.trajectory.phases[i], motion.modes[i]
    u = np.vstack([s.u, motion.steps[i].u1[-1:]])
    B = input_slopes(motion, mode, s.y, u, s.t)
    K = gains(B, P, projection(motion, mode, s.y, s.t), w)
    early, late = (beyond(motion, i, s, side) for side in (-1, 1))
    counts = len(early[0]), len(late[0])
    pieces = early, (s.t, s.y), late
    first, last = motion.steps[i].u0[:1], motion.steps[i].u1[-1:]
    return Guide(
        float(phase.t[0]),
        float(phase.t[-1]),
        np.concatenate([t for t, _ in pieces]),
        np.vstack([y for _, y in pieces]),
        np.vstack([np.repeat(first, counts[0], axis=0), u, np.repeat(last, counts[1], axis=0)]),
        np.concatenate(
            [np.repeat(K[:1], counts[0], axis=0), K, np.repeat(K[-1:], counts[1], axis=0)]
        ),
    )


def beyond(motion: Motion, i: int, s: LinearPhase, side: int) -> tuple[Array, Array]:
    """Times and states of a phase before its begin (side -1) or after its end (1), in its mode and
    with the inputs there, as far as they are finite."""
    mode, k = motion.modes[i], 0 if side < 0 else -1
    h = side * BEYOND * motion.trajectory.phases[i].duration
    u = motion.steps[i].u0[:1] if side < 0 else motion.steps[i].u1[-1:]
    steps = Steps(s.t[[k]], np.array([h]), u, u)
    count = max(PARTS, round(BEYOND * len(s.h)))
    places = np.arange(1, count + 1) / count
    start = put(motion, mode, s.y[[k]], s.t[[k]])
    y = states_after(motion, mode, start, steps, places)[0]
    good = int(np.argmin(np.append(np.isfinite(y).all(axis=1), False)))
    t, y = s.t[k] + places[:good] * h, y[:good]
    return (t, y) if side > 0 else (t[::-1], y[::-1])


# Weights ------------------------------------------------------------------------------------------


def weight_matrix(
    value: Weight | None, name: str, names: Sequence[str], default: Array, definite: bool = False
) -> Array:
    """Read a weight: a factor of the default, entries of a diagonal by name, or a matrix."""
    n, kind = len(names), "positive" if definite else "not negative"
    if value is None:
        return default
    if is_number(value):
        expected = f"expected a positive factor, numbers by name, or a matrix ({n}, {n})"
        return positive(value, name, expected, SimulationError) * default
    if isinstance(value, Mapping):
        diagonal = by_name(value, name, SimulationError)
        for key in diagonal:
            check_known(key, names, "input" if definite else "state", f"in {name}", SimulationError)
        entries = [number(diagonal.get(x, 0.0), f"{name}[{x!r}]", SimulationError) for x in names]
        for x, entry in zip(names, entries, strict=True):
            if entry < 0 or (definite and not entry):
                raise SimulationError(
                    f"{name}[{x!r}] = {entry:g}: expected a number that is {kind}."
                )
        return np.diag(entries)
    matrix = array(value)
    if matrix is None or matrix.shape != (n, n) or not np.isfinite(matrix).all():
        raise SimulationError(
            f"{name} = {shown(value)}: expected a positive factor, numbers by name, or a matrix of "
            f"finite numbers of shape ({n}, {n}) ({', '.join(names)})."
        )
    size = np.abs(matrix).max()
    if np.abs(matrix - matrix.T).max() > ASYMMETRIC * size:
        raise SimulationError(f"{name} is not symmetric: expected a symmetric matrix.")
    root = np.sqrt(np.diag(default))
    scaled = matrix / root / root[:, None]
    largest = float(np.abs(scaled).max())
    least = float(np.linalg.eigvalsh(scaled)[0]) if np.isfinite(largest) else np.nan
    if not (least > 0 if definite else least >= -ASYMMETRIC * largest):
        raise SimulationError(
            f"{name} has the eigenvalue {least:.3g} in sizes of the motion: expected a matrix with "
            f"eigenvalues that are {kind}."
        )
    return (matrix + matrix.T) / 2
