"""Residuals of the optimality conditions, computed in one place for all drivers; what goes over all
unknowns and rows is compiled (residuals.pxi)."""

from __future__ import annotations

from math import inf, isfinite

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.program.transcription import Transcription
from dmoc.solvers.compiled import left_by_barrier, left_over, missed_by
from dmoc.solvers.outcome import Duals, Residuals

# Multipliers of this size and smaller leave the residuals unscaled (Waechter & Biegler 2006,
# section 2.1).
SCALE_FROM = 100.0
# Distance to a bound, relative to its size, at which it counts as active.
ACTIVE = 1e-8
# A scaled cost below it counts as this much where residuals are compared with the cost: one that
# vanishes sets no measure.
LEAST_COST = 1e-2
MOST_NAMED = 3  # of the constraints that are violated most


def cost_size(nlp: Transcription, x: Array) -> float:
    """Size of the cost at x, shape (n,), with which residuals are compared."""
    return max(abs(nlp.cost(x)), LEAST_COST)


def duality_gap(nlp: Transcription, x: Array, duals: Duals) -> float:
    """Sum at x, shape (n,), of the products of inequalities and bounds with their multipliers, in
    units of the cost: about what a barrier has left of it. Those that hold nothing, whose distance
    is larger than their multiplier, are left out: what they take is of second order in the barrier,
    however many they are."""
    left = left_by_barrier(x, nlp.lower, nlp.upper, duals.z, nlp.inequality(x), duals.w)
    return nlp.scale.cost * left


def residuals(nlp: Transcription, x: Array, duals: Duals) -> Residuals:
    """Return the residuals of L = f + y . c - w . d - z . x at x, shape (n,), with bounds on x."""
    slope = nlp.lagrangian_gradient(x, duals.y, duals.w)
    # Steepness matters in proportion to how far an unknown can usefully move.
    reach = np.ones(nlp.n)
    reach[nlp.layout.index_h] = np.abs(x[nlp.layout.index_h])
    of_rows = nlp.equality(x), duals.y, nlp.inequality(x), duals.w
    worst, mean = left_over(slope, reach, x, nlp.lower, nlp.upper, duals.z, *of_rows)
    worst /= max(SCALE_FROM, mean) / SCALE_FROM * cost_size(nlp, x)
    return Residuals(worst if isfinite(worst) else inf, violation(nlp, x))


def with_bounds(nlp: Transcription, x: Array, y: Array, w: Array) -> Duals:
    """Complete the multipliers of a method that has none for bounds: the slope at a bound, where
    it points out of the feasible set."""
    slope = nlp.lagrangian_gradient(x, y, w)
    size = np.maximum(1.0, np.abs(x))
    with np.errstate(invalid="ignore"):
        active = ((x - nlp.lower <= ACTIVE * size) & (slope > 0)) | (
            (nlp.upper - x <= ACTIVE * size) & (slope < 0)
        )
    return Duals(y, w, np.where(active, slope, 0.0))


def violation(nlp: Transcription, x: Array) -> float:
    """Largest violation of any constraint or bound at x, shape (n,), relative to their sizes."""
    x = np.ascontiguousarray(x)
    return missed_by(x, nlp.lower, nlp.upper, nlp.equality(x), nlp.inequality(x))


def rounding(nlp: Transcription, x: Array) -> Array:
    """A rounding error of each row at x, shape (n,), by its terms of first order, relative to its
    size; shape (n_eq + n_in,)."""
    terms = [abs(slopes) @ np.abs(x)
             for slopes in (nlp.equality_jacobian(x), nlp.inequality_jacobian(x))]  # fmt: skip
    return np.asarray(np.finfo(float).eps * np.concatenate(terms))


def worst_constraints(nlp: Transcription, x: Array) -> list[str]:
    """Name the most violated constraints with their violations, one for each kind."""
    violated = np.concatenate([np.abs(nlp.equality(x)), -nlp.inequality(x)])
    worst = []
    for block in (*nlp.equalities, *nlp.inequalities):
        values = violated[block.numbers]
        if values.max(initial=0.0) > 0:
            i = int(np.argmax(values))
            worst.append((float(values[i]), block.name_of(i)))
    excess = np.maximum(nlp.lower - x, x - nlp.upper)
    i = int(np.argmax(excess))
    if excess[i] > 0:
        worst.append((float(excess[i]), f"bound of {nlp.layout.names()[i]}"))
    worst.sort(reverse=True)
    return [f"{label} by {value:.3g}" for value, label in worst[:MOST_NAMED]]
