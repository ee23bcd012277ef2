"""What every method takes and returns: options, statuses with sentences, iterations, ending,
outcome."""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from dmoc.base.deadline import ENDLESS, Deadline
from dmoc.base.records import record, value_class
from dmoc.base.tolerances import ITERATIONS, OPTIMALITY, VIOLATION
from dmoc.codegen.kernels import Array


class Status(enum.StrEnum):
    """How a solve ended, or what the check made of it; ``sentence`` says what happened and what
    helps."""

    SOLVED = "solved"
    GRAZES = "grazes"  # solved, but a collision has no effect
    NOT_VERIFIED = "not_verified"  # solved, and the check contradicts it
    STATIONARY = "stationary"  # the conditions of first order hold, those of second order do not
    INFEASIBLE = "infeasible"
    ITERATION_LIMIT = "iteration_limit"
    TIME_LIMIT = "time_limit"
    STALLED = "stalled"
    INTERRUPTED = "interrupted"

    @property
    def sentence(self) -> str:
        return SENTENCES[self]


SENTENCES = {
    Status.SOLVED: "a local minimum was found",
    Status.GRAZES: "a local minimum was found",
    Status.NOT_VERIFIED: "a local minimum was found",
    Status.STATIONARY: "a stationary point was found that is no minimum: motions beside it "
    "cost less",
    Status.INFEASIBLE: "no feasible motion was found",
    Status.ITERATION_LIMIT: "the iteration limit was reached: raise it, or start from a better "
    "guess",
    Status.TIME_LIMIT: "the time limit was reached: raise it, or start from a better guess",
    Status.STALLED: "no further progress was possible before optimality: try another guess or "
    "other steps",
    Status.INTERRUPTED: "the solve was interrupted: the best iterate so far is kept",
}
# A local minimum that nothing contradicts; any local minimum of the program; no feasible point or
# no minimum, whatever the limits.
MINIMA = (Status.SOLVED, Status.GRAZES)
CONVERGED = (*MINIMA, Status.NOT_VERIFIED)
NOWHERE = (Status.INFEASIBLE, Status.STALLED)
UNREFINED = "coarse"  # of a minimum that is known from a coarse mesh alone, in place of a status


@value_class(frozen=True)
class Iteration:
    """One line of progress."""

    number: int
    cost: float
    violation: float

    def __str__(self) -> str:
        return f"iteration {self.number}  cost {self.cost:.6g}  violation {self.violation:.1e}"


@value_class(frozen=True)
class Options:
    """Limits and tolerances of a solve."""

    optimality: float = OPTIMALITY  # of stationarity and complementarity, relative to the cost
    violation: float = VIOLATION  # of a constraint or bound, relative to its size
    iterations: int = ITERATIONS
    deadline: Deadline = ENDLESS
    progress: Callable[[Iteration], object] | None = None  # called after every iteration

    def after(self, iterations: int) -> Options:
        """The options that are left after some iterations, which are counted on."""
        left, tell = max(self.iterations - iterations, 1), self.progress
        if left == self.iterations and not iterations:
            return self
        if tell is None or not iterations:
            return replace(self, iterations=left)

        def counted(i: Iteration) -> None:
            tell(replace(i, number=i.number + iterations))

        return replace(self, iterations=left, progress=counted)


@record(frozen=True, eq=False)
class Duals:
    """Multipliers in L = f + y . c - w . d - z . x: w >= 0, and z >= 0 at a lower bound, <= 0 at an
    upper one.

    The program and the compiled methods know rows (c | d) and one vector for them, with
    L = f + ``rows`` . (c | d) - z . x.
    """

    y: Array
    w: Array
    z: Array

    @classmethod
    def none(cls, n_eq: int, n_in: int, n: int, *programs: int) -> Duals:
        """Multipliers of zero, shapes (..., n_eq), (..., n_in) and (..., n) of so many programs."""
        return cls(*(np.zeros((*programs, size)) for size in (n_eq, n_in, n)))

    @classmethod
    def of_rows(cls, n_eq: int, rows: Array, z: Array) -> Duals:
        """Multipliers from those of the rows (c | d), shape (n_eq + n_in,), of which the first n_eq
        are equations, and z, shape (n,)."""
        return cls(rows[:n_eq], np.maximum(-rows[n_eq:], 0.0), z)

    @property
    def rows(self) -> Array:
        """Multipliers of the rows (c | d), shape (n_eq + n_in,)."""
        return np.concatenate([self.y, -self.w])


@value_class(frozen=True)
class Residuals:
    """Optimality: stationarity and complementarity relative to the cost.  Violation: largest |c|,
    -d or excess over a bound, relative to the size of the constraint or unknown."""

    optimality: float
    violation: float


@record(frozen=True, eq=False)
class Ending:
    """The end of a method: its own status, a detail for the message, unknowns x, shape (n,),
    multipliers and the number of iterations."""

    status: Status
    detail: str
    x: Array
    duals: Duals
    iterations: int


@record(frozen=True, eq=False)
class Outcome:
    """An ending as it is judged, whatever the method: see :mod:`dmoc.solvers.judge`."""

    status: Status
    detail: str
    x: Array
    duals: Duals
    iterations: int
    left: Residuals
