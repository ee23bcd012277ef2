"""How far a motion exceeds the limits of its velocities, quantities and totals, and those that path
constraints set to velocities and inputs."""

from __future__ import annotations

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.problem.problem import Problem
from dmoc.program.implied_values import quantity_inputs
from dmoc.program.iterate import Iterate


def is_limited(problem: Problem) -> bool:
    """Whether there are such limits beside those of the inputs."""
    return bool(problem.limits or problem.kernels.integrals or len(_limiting_rows(problem)))


def largest_excess(at: Iterate) -> float:
    """Largest excess of a velocity, a quantity, a total or a path constraint of a motion over its
    limit, relative to both."""
    problem, totals = at.problem, at.x[at.lay.index_totals]
    values, boxes = [at.rates, totals], [problem.velocity_bounds, problem.total_bounds]
    if problem.kernels.quantities:
        z = at.model.path(quantity_inputs(at), "quantity")
        values.append(z.reshape(-1, problem.model.nz))
        boxes.append(problem.quantity_bounds)
    most = _path_excess(at)
    for value, (low, high) in zip(values, (box.T for box in boxes), strict=True):
        over = np.maximum(low - value, value - high)
        limit = np.where(low - value > value - high, low, high)
        size = np.abs(value) + np.abs(np.where(np.isfinite(limit), limit, 0.0))
        most = max(most, _largest(over, size))
    return most


def _path_excess(at: Iterate) -> float:
    """Excess of the path constraints on velocities or inputs, beside their values at rest without
    inputs: those of |u| <= 5 are |u| and 5."""
    rows = _limiting_rows(at.problem)
    if not rows:
        return 0.0
    q_k, q_kp1, u_k, u_kp1, h, t_k, _ = at.steps
    q, u, t = (q_k + q_kp1) / 2, (u_k + u_kp1) / 2, (t_k + h / 2)[:, 0]
    kept = at.model.path_at(q, at.rates, u, t)[:, rows]
    idle = at.model.path_at(q, np.zeros_like(q), np.zeros_like(u), t)[:, rows]
    return _largest(-kept, np.abs(kept - idle) + np.abs(idle))


def _limiting_rows(problem: Problem) -> list[int]:
    """Path constraints that contain velocities or inputs."""
    rows = problem.kernels.manifest.path_limits
    return [i for i, row in enumerate(rows) if row["velocities"] or row["inputs"]]


def _largest(over: Array, size: Array) -> float:
    return float((over / np.where(size > 0, size, 1.0)).max(initial=0.0))
