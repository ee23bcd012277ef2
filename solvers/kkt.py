"""Residuals of the optimality conditions, computed in one place for all drivers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.nlp.labels import unknown_names
from dmoc.nlp.transcription import Transcription

# Multipliers of this size and smaller leave the residuals unscaled (Waechter & Biegler 2006, section 2.1).
SCALE_FROM = 100.0
# Distance to a bound, relative to its size, at which it counts as active.
ACTIVE = 1e-8


@dataclass(frozen=True)
class Residuals:
    """Optimality: scaled stationarity and complementarity. Violation: largest |c|, -d or excess over a bound."""

    optimality: float
    violation: float


def residuals(nlp: Transcription, x: Array, y: Array, w: Array) -> Residuals:
    """Return the residuals of L = f + y . c - w . d with bounds on x.

    Stationarity of an unknown at its bound counts only if it points into the feasible set.
    """
    slope = nlp.cost_gradient(x) + nlp.equality_jacobian(x).T @ y - nlp.inequality_jacobian(x).T @ w
    size = np.maximum(1.0, np.abs(x))
    fixed = nlp.lower == nlp.upper
    at_lower = x - nlp.lower <= ACTIVE * size
    at_upper = nlp.upper - x <= ACTIVE * size
    free = np.where(fixed | (at_lower & (slope > 0)) | (at_upper & (slope < 0)), 0.0, slope)
    d = nlp.inequality(x)
    # Steepness matters in proportion to how far an unknown can usefully move.
    reach = np.where(np.isin(np.arange(nlp.n), nlp.layout.index_h), np.abs(x), 1.0)
    complementarity = float(np.abs(w * d).max(initial=0.0))
    scale = max(SCALE_FROM, float(np.abs(np.concatenate([y, w])).mean()) if len(y) + len(w) else 0.0) / SCALE_FROM
    return Residuals(max(float(np.abs(free * reach).max(initial=0.0)), complementarity) / scale, violation(nlp, x))


def violation(nlp: Transcription, x: Array) -> float:
    """Largest violation of any constraint or bound."""
    parts = [np.abs(nlp.equality(x)), -nlp.inequality(x), nlp.lower - x, x - nlp.upper]
    worst = max(float(p.max(initial=0.0)) for p in parts)
    return worst if np.isfinite(worst) else np.inf


def worst_constraints(nlp: Transcription, x: Array, most: int = 3) -> list[str]:
    """Name the most violated constraints with their violations, one for each kind."""
    c, d = np.abs(nlp.equality(x)), -nlp.inequality(x)
    found = []
    for blocks, values in ((nlp.equalities, c), (nlp.inequalities, d)):
        for block in blocks:
            if len(block.rows) and values[block.rows].max() > 0:
                i = int(np.argmax(values[block.rows]))
                found.append((float(values[block.rows[i]]), block.labels[i]))
    excess = np.maximum(nlp.lower - x, x - nlp.upper)
    names = unknown_names(nlp.problem, nlp.layout)
    i = int(np.argmax(excess))
    if excess[i] > 0:
        found.append((float(excess[i]), f"bound of {names[i]}"))
    found.sort(reverse=True)
    return [f"{label} by {value:.3g}" for value, label in found[:most]]
