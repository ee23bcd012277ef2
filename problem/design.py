"""Parameters of the model that the solver chooses: their ranges, and the values to begin with."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dmoc.base.arguments import Range, interval, is_row
from dmoc.base.errors import ProblemError
from dmoc.codegen.kernels import Array
from dmoc.mechanics.model_values import by_name, parameter_rows
from dmoc.problem.derived import like

if TYPE_CHECKING:
    from dmoc.problem.problem import Problem
    from dmoc.problem.ranges import Boundary

# Random values of a design with which what holds at all of them holds for all: so many.
SAMPLES = 3
# What depends on the values of design parameters, beside these.
OF_DESIGN = {
    "parameter_values", "models", "model", "redundant", "start_position", "goal_position",
    "inertia", "reach", "spread", "end_speeds",
}  # fmt: skip


def design_of(values: Any) -> dict[str, Any]:
    """The design as it was passed, by name."""
    named = by_name(values, "design")
    for name, value in named.items():
        _range(name, value)
    return named


def check_design(problem: Problem) -> None:
    """Refuse a design that something else of the problem says or needs as a number."""
    for name in problem.design:
        if name in problem.parameters:
            raise ProblemError(
                f"parameter {name} is given in parameters and in design: give it once; a design "
                "of one number keeps it."
            )
    change = any(is_row(value) for value in problem.parameters.values())
    if problem.minimal_times and (problem.design or change):
        what = "a design" if problem.design else "parameters that change by phase"
        raise ProblemError(
            f"minimal_times are estimated at fixed parameters: leave them out with {what}."
        )


def _range(name: str, value: Any) -> Range:
    low, high = interval(value, f"design of {name}")
    if low == np.inf or high == -np.inf:
        raise ProblemError(f"design of {name} = ({low:g}, {high:g}): expected finite values.")
    return low, high


def design_bounds_of(problem: Problem) -> Array:
    """Bounds of the design parameters, shape (number, 2)."""
    ranges = [_range(name, value) for name, value in problem.design.items()]
    return np.array(ranges, dtype=float).reshape(len(ranges), 2)


def first_design(problem: Problem) -> Array:
    """Values to begin with: the model's own within their ranges, else the middles of these, else
    what they have nearest to the model's own; shape (number,)."""
    own, values = problem.kernels.parameters, list[float]()
    for name, (low, high) in zip(problem.design, problem.design_bounds, strict=True):
        value = own[name]
        if value is not None and low <= value <= high:
            values.append(value)
        elif np.isfinite([low, high]).all():
            values.append(float(low / 2 + high / 2))
        elif value is None:
            raise ProblemError(
                f"design of {name}: the model has no value of it to begin with, and its range no "
                "middle: give both bounds, or the model a value."
            )
        else:
            values.append(float(np.clip(value, low, high)))
    return np.array(values)


def parameter_values_of(problem: Problem) -> Array:
    """Parameter values in the model's order, those of its design among them, shape (1, npar), or
    with a row for each phase (phases, npar) where some change."""
    chosen = dict(zip(problem.design, problem.design_values.tolist(), strict=True))
    stated = {**chosen, **problem.parameters}
    return parameter_rows(problem.kernels, stated, problem.phases, ProblemError)


def at_bounds(problem: Problem) -> dict[str, Problem]:
    """The same problem with each design parameter at each of its finite bounds, the others as they
    are, in words."""
    ends = {}
    for i, (name, bounds) in enumerate(zip(problem.design, problem.design_bounds, strict=True)):
        for bound in bounds[np.isfinite(bounds)].tolist():
            values = problem.design_values.copy()
            values[i] = bound
            ends[f" where {name} = {bound:g}, a bound of its design"] = designed(problem, values)
    return ends


def drawn(problem: Problem, rng: np.random.Generator) -> Array:
    """Random values of a design, shape (number,): within bounds on both sides evenly, else around
    where a solve begins, by its size."""
    low, high = problem.design_bounds.T
    begin, share = first_design(problem), rng.random(len(low))
    with np.errstate(invalid="ignore"):
        between = low + share * (high - low)
        around = begin * 4 ** (2 * share - 1) + (begin == 0) * (2 * share - 1)
    inside = np.isfinite(low) & np.isfinite(high)
    return np.asarray(np.where(inside, between, np.clip(around, low, high)))


def samples(problem: Problem) -> tuple[Problem, ...]:
    """The same problem at random values of its design; itself where it has none."""
    if not problem.design:
        return (problem,)
    draws = [np.random.default_rng(k) for k in range(SAMPLES)]
    return tuple(designed(problem, drawn(problem, rng)) for rng in draws)


def designed(problem: Problem, values: Array) -> Problem:
    """The same problem, whose model has some values of its design parameters, shape (number,)."""
    if not problem.design or np.array_equal(values, problem.design_values):
        return problem
    return like(problem, OF_DESIGN, design_values=np.array(values, dtype=float))


def designed_as(problem: Problem, parameters: Mapping[str, Any]) -> Problem:
    """The same problem with its design as near to parameters by name as its ranges allow."""
    pairs = zip(problem.design, problem.design_values, strict=True)
    values = [parameters.get(*own) for own in pairs]
    return designed(problem, np.clip(values, *problem.design_bounds.T))


def by_design(problem: Problem, kernel: str) -> NDArray[np.bool_]:
    """Mask of the results of a kernel that depend on the design, shape (results,)."""
    return problem.kernels.depends(kernel, list(problem.design))


def unchosen(problem: Problem, mu: Array, kernel: str) -> Array:
    """Coefficients of friction of a kernel; not a number where they are chosen."""
    chosen = by_design(problem, kernel if problem.kernels.has(kernel) else "bearing")
    return np.where(chosen, np.nan, mu) if len(chosen) else mu


def moves_by_design(problem: Problem, boundary: Boundary) -> bool:
    """Whether the velocity at an end depends on the design, of a momentum that is given."""
    given = boundary.momentum[np.isfinite(boundary.momentum)]
    return bool(given.any() and by_design(problem, "momentum").any())
