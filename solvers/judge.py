"""What is said of the point where a method has ended: one judge for all methods, one set of
tolerances."""

from __future__ import annotations

import numpy as np

from dmoc.program.transcription import Transcription
from dmoc.solvers.kkt import LEAST_COST, residuals, rounding
from dmoc.solvers.outcome import Duals, Ending, Options, Outcome, Residuals, Status

# A larger violation, relative to the sizes of the constraints, where a method gets no further
# counts as infeasible, a smaller one as feasible.
INFEASIBLE = 1e-6
# On fine meshes rounding errors end a solve before it is sharp.  A point with these residuals
# counts as solved there: the cost is wrong by the square of the optimality only.
ROUNDED_OPTIMALITY, ROUNDED_VIOLATION = 1e-5, 1e-9
# A row that is violated by at most so many of its rounding errors counts as kept.
ROUNDINGS = 2.0
# What the method alone knows, and what a point that meets no tolerance cannot tell.
LIMITS = (Status.ITERATION_LIMIT, Status.TIME_LIMIT)


def meets(left: Residuals, options: Options) -> bool:
    """Whether residuals are those of a solution."""
    return left.optimality <= options.optimality and left.violation <= options.violation


def rounded(left: Residuals) -> bool:
    """Whether residuals are those of a solution up to rounding errors."""
    return left.optimality <= ROUNDED_OPTIMALITY and left.violation <= ROUNDED_VIOLATION


def verdict(word: Status, left: Residuals, options: Options) -> Status:
    """The status that the residuals of a point tell; the method's word counts for interruptions and
    limits."""
    if word is Status.INTERRUPTED:  # who has interrupted wants to know, whatever the point is worth
        return word
    if meets(left, options):
        return Status.SOLVED
    if word in LIMITS:
        return word
    # Beyond the numbers nothing is.
    finite = np.isfinite(left.optimality) and np.isfinite(left.violation)
    return Status.INFEASIBLE if finite and left.violation > INFEASIBLE else Status.STALLED


def judged(nlp: Transcription, ending: Ending, options: Options) -> Outcome:
    """The ending of a method with the residuals that it leaves and the status that they tell."""
    duals, left = ending.duals, residuals(nlp, ending.x, ending.duals)
    if abs(nlp.cost(ending.x)) <= LEAST_COST:
        duals, left = min(((duals, left), _without_duals(nlp, ending)), key=_optimality)
    status = verdict(ending.status, _beyond_rounding(nlp, ending, left, options), options)
    detail = ending.detail or f"optimality {left.optimality:.1e}, violation {left.violation:.1e}"
    if status is Status.SOLVED:
        detail = ""
    return Outcome(status, detail, ending.x, duals, ending.iterations, left)


def _beyond_rounding(
    nlp: Transcription, ending: Ending, left: Residuals, options: Options
) -> Residuals:
    """Residuals in which rows count as kept that are violated by rounding errors alone."""
    if not options.violation < left.violation <= ROUNDED_VIOLATION:
        return left
    wrong = np.concatenate([np.abs(nlp.equality(ending.x)), -nlp.inequality(ending.x)])
    kept = wrong <= ROUNDINGS * rounding(nlp, ending.x)
    outside = np.maximum(nlp.lower - ending.x, ending.x - nlp.upper).max(initial=0.0)
    worst = max(wrong[~kept].max(initial=0.0), outside)
    return Residuals(left.optimality, float(worst))


def _without_duals(nlp: Transcription, ending: Ending) -> tuple[Duals, Residuals]:
    """The point with multipliers of zero, which are those of a minimum where the cost does not
    change: those that a method ends with are what its barrier has left there, over a cost that is
    next to none."""
    none = Duals.none(nlp.n_eq, nlp.n_in, nlp.n)
    return none, residuals(nlp, ending.x, none)


def _optimality(point: tuple[Duals, Residuals]) -> float:
    return point[1].optimality
