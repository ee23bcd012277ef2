"""Gaps of a problem's surfaces at a point, and the point of a surface that is near another one."""

from __future__ import annotations

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.nlp.problem import Problem


def onto_surface(problem: Problem, q: Array, surface: str, t: float = 0.0) -> Array:
    """Move a point onto g = 0 at time t by Newton steps along the gradient."""
    q = q.copy()
    for _ in range(30):
        gap, slope, _ = gap_to(problem, q, surface, t)
        square = slope @ slope
        if abs(gap) < 1e-12 or square == 0:
            break
        q -= gap / square * slope
    return q


def gap_to(problem: Problem, q: Array, surface: str, t: float) -> tuple[float, Array, float]:
    """Gap to a surface, its gradient, and its partial derivative with respect to the time."""
    kernels, par, now = problem.kernels, problem.parameter_values, np.array([[t]])
    j = kernels.surfaces.index(surface)
    rows, columns = kernels.pattern("surface_jac", "g_D_q")
    slope = np.zeros(problem.nq + 1)
    values = kernels.call("surface_jac", q[None], now, par)[0][0]
    slope[columns[rows == j]] = values[rows == j]
    return float(kernels.call("surface", q[None], now, par)[0][0, j]), slope[:-1], float(slope[-1])
