"""A problem whose free motion is linear, as numbers: what proofs are made of.

For given durations the program of such a problem is a convex quadratic one. A phase of N steps of
the size h has the rows of its steps, in the step's start q_k, in what follows from it, a = (q_i,
q_kp1), and in its inputs u, multiplied by h::

    h (r_i, r_minus + p_k) = 0,   h r_plus = h p_kp1,   rows (P_0 + h P_1 + h^2 P_2) (q_k, a, u, 1)

since kinetic energy gives 1/h, gyroscopic forces and dampers 1, springs and inputs h. Its cost is
h (u R u/2 + c u + c_0). In a mode the coordinates are q = origin + Z y, and the rows are multiplied
by a matrix under which the forces of its contacts vanish; the state is z = (y, p).  Where closed
contacts move, the coordinates are q = origin + Z y + moved s(t).  The shifts s at the nodes of a
step, in the order of time, stand behind its inputs, and drive it as these do.

What contacts ask of the steps of a phase are rows (S_0 + h S_1 + h^2 S_2) (q_k, h p_k, a, u, s, 1).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.program.blocks import Bools, Index

# The last number of a condition, what it is: it holds in each of its steps, or in sum.
IN_EACH, IN_SUM = 0, 2
# A value that a mode decides, in the coordinates of the mode.
DECIDED = 1e-12


@record(frozen=True, eq=False)
class LinearPhase:
    """The steps of a phase; ``P`` has the shape (3, na + r, r + na + nb + ns + 1), where ns are the
    shifts that it ``drives``, their numbers, at nodes in ``places`` from 0 to 1; ``R`` (nb, nb),
    bounds of the inputs (nb,), and ``paths`` y + ``moves`` s <= ``most`` holds at the ends of the
    steps from number ``since`` on and, where it is one ``within`` them, inside, shapes (rows, r),
    (rows, shifts) and (rows,).  ``S``, shape (m, 3, 2 r + na + nb + ns + 1), are rows of a step,
    and ``conditions``, shape (conditions, 5), one of them with one of the next step, or -1, whose
    sum is not positive, in which steps, from the first one to the last; where a fifth number is 1,
    it vanishes, where it is ``IN_SUM``, that is the sum of the row over these steps.  The last
    ``squares`` of the inputs stand for positions and velocities, which cost about ``heavy``; the
    row of number ``cost``, if it is not negative, is added to what each step costs."""

    steps: int
    P: Array
    R: Array
    c: Array
    c_0: float
    lower: Array
    upper: Array
    paths: Array
    most: Array
    since: Array
    moves: Array
    within: Array
    places: Array
    drives: Index
    S: Array
    conditions: Array
    squares: int = 0
    heavy: float = 0.0
    cost: int = -1

    @property
    def size(self) -> int:
        """Number r of coordinates y."""
        return int(self.paths.shape[1])


@record(frozen=True, eq=False)
class Shifts:
    """Functions of the time: places, speeds and, where it takes them, accelerations of what moves.
    They are ``operations``, which of them and on which earlier ones, shape (n, 3), with bounds of
    those that are constants, shape (n, 2); ``results`` are the numbers of those that are shifts."""

    operations: Index
    constants: Array
    results: Index


@record(frozen=True, eq=False)
class Rows:
    """Functions A z + b + shifted s(t) of the state z before an event at the time t, where s are
    shifts of surfaces, shapes (m, 2 r), (m,) and (m, shifts)."""

    A: Array
    b: Array
    shifted: Array

    @classmethod
    def stacked(cls, rows: list[Rows], size: int, shifts: int) -> Rows:
        none = cls(np.zeros((0, size)), np.zeros(0), np.zeros((0, shifts)))
        parts = zip(*((r.A, r.b, r.shifted) for r in (none, *rows)), strict=True)
        return cls(*map(np.concatenate, parts))

    @property
    def is_decided(self) -> bool:
        """Whether they vanish whatever the state and the time are."""
        return bool(max(np.abs(p).max(initial=0.0) for p in vars(self).values()) <= DECIDED)

    @property
    def of_state(self) -> Bools:
        """Which of them depend on the state, shape (m,)."""
        return np.asarray(np.abs(self.A).max(axis=1, initial=0.0) > DECIDED)

    @property
    def is_constant(self) -> bool:
        """Whether they are the same whatever the state and the time are."""
        parts = self.A, self.shifted
        return bool(max(np.abs(part).max(initial=0.0) for part in parts) <= DECIDED)

    def __getitem__(self, which: Bools) -> Rows:
        return Rows(self.A[which], self.b[which], self.shifted[which])


@record(frozen=True, eq=False)
class Times:
    """Functions b + shifted s(t) of the time alone, shapes (m,) and (m, shifts), that ``vanish``,
    where this is 1 and not 0, shape (m,), or are not positive."""

    b: Array
    shifted: Array
    vanish: Array

    @classmethod
    def among(cls, zero: Rows, most: Rows, which: tuple[Bools, Bools]) -> Times:
        """Those of some rows that vanish and some that are not positive, masks of shape (m,)."""
        pairs = zip((zero, most), which, strict=True)
        own = [(rows.b[here], rows.shifted[here]) for rows, here in pairs]
        vanish = np.concatenate([np.full(len(b), float(not i)) for i, (b, _) in enumerate(own)])
        b, shifted = map(np.concatenate, zip(*own, strict=True))
        return cls(b, shifted, vanish)

    def beside(self, other: Times) -> Times:
        """These and others."""
        parts = zip(vars(self).values(), vars(other).values(), strict=True)
        return Times(*map(np.concatenate, parts))


@record(frozen=True, eq=False)
class LinearEvent:
    """The state after an event as function of that before it, functions that vanish there, those
    that are not positive, and those of the time alone."""

    after: Rows
    zero: Rows
    most: Rows
    when: Times


@record(frozen=True, eq=False)
class LinearProblem:
    """Phases that have steps, the events between them, the state at the start, its middle and what
    any shares from -1 to 1 add to it, shape (1 + spreads, 2 r), what vanishes at the end and is not
    positive there, and what the start adds to both beside its middle, shape (rows, 2 r), ranges of
    durations, shape (phases, 2), and of the final time. The end costs the row ``goal_cost`` beside,
    if there is one, and of its time alone ``goal_when`` is asked. Of what vanishes at the end, a
    row w that is ``soft``, 1 and not 0, costs w^2/2 instead; ``left_out`` are the conditions that
    bounds leave out."""

    phases: tuple[LinearPhase, ...]
    events: tuple[LinearEvent, ...]
    start: Array
    tie: Array
    goal_zero: Rows
    goal_most: Rows
    goal_cost: Rows
    goal_when: Times
    soft: Array
    durations: Array
    final_time: tuple[float, float]
    shifts: Shifts
    sizes: Array  # typical of the coordinates
    inertia: Array  # the diagonal of M
    left_out: tuple[str, ...]

    @property
    def without_sums(self) -> LinearProblem:
        """The problem without the conditions that follow from others in sum."""
        kept = (phase.conditions[:, 4] != IN_SUM for phase in self.phases)
        phases = (
            replace(phase, conditions=phase.conditions[own])
            for phase, own in zip(self.phases, kept, strict=True)
        )
        return replace(self, phases=tuple(phases))

    @property
    def definitions(self) -> int:
        """Conditions that vanish in all steps."""
        return sum(phase.squares * phase.steps for phase in self.phases)

    def force(self, seconds: float) -> float:
        """A force that moves the coordinates by their sizes in some time."""
        return float((self.inertia * self.sizes).max() / seconds**2)


def through(rows: Rows, after: Rows) -> Rows:
    """Functions of the state after an event as those of the state before it."""
    A, b, shifted = (rows.A @ part for part in (after.A, after.b, after.shifted))
    return Rows(A, b + rows.b, shifted + rows.shifted)
