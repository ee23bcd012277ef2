"""Bounds of the integrals of a model at the goal."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dmoc.base.arguments import Range, interval, shown
from dmoc.base.errors import ProblemError
from dmoc.codegen.kernels import Array

if TYPE_CHECKING:
    from dmoc.problem.problem import Problem


def total_bounds_of(problem: Problem) -> Array:
    """Bounds of the totals, shape (number, 2); one on the side from which nothing holds what stands
    in the place of kinks is refused."""
    senses = problem.kernels.manifest.senses
    bounds = []
    for name in problem.model.totals_of:
        stated = problem.goal.get(name)
        low, high = interval(stated, f"goal of {name}")
        sense = senses.get(name, 0)
        if (sense > 0 and low > -np.inf) or (sense < 0 and high < np.inf):
            wanted, least = (
                ("(None, upper)", "too large") if sense > 0 else ("(lower, None)", "too small")
            )
            raise ProblemError(
                f"goal of {name} = {shown(stated)}: expected {wanted}, because its integrand has "
                f"kinks, in whose place stand unknowns that may be {least}."
            )
        bounds.append((low, high))
    return np.array(bounds, dtype=float).reshape(-1, 2)


def total_limits_of(problem: Problem) -> dict[str, Range]:
    """Bounds of the integrals that have some, by name."""
    named = zip(problem.model.totals_of, problem.total_bounds.tolist(), strict=True)
    return {name: (low, high) for name, (low, high) in named if low > -np.inf or high < np.inf}


def held_integrals(problem: Problem) -> set[str]:
    """What holds unknowns in the place of kinks: the cost, which has no name, and integrals that
    are bounded or priced."""
    priced = problem.kernels.manifest.priced
    return {"", *problem.total_limits, *priced}
