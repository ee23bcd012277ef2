"""A motion along a plan: prescribed coordinates on cubic splines, the others by their equations
of motion, step by step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.nlp.plan import Plan
from dmoc.nlp.problem import Problem, midpoints
from dmoc.nlp.windows import WINDOW, Dynamics

# Speed, in reaches of the coordinates per final time, above which a motion counts as growing
# without bound.
RUNAWAY = 1e6


@dataclass(frozen=True)
class March:
    """A sampled motion: q (total + 1, nq), inputs (total, nu), impulses, velocities before and
    after the collisions (collisions, nq), steps in windows, velocities at both ends, cost."""

    q: Array
    u: Array
    lam: Array
    v_a: Array
    v_c: Array
    free_steps: int
    v_B: Array
    v_E: Array
    cost: float


def march(problem: Problem, plan: Plan, prescribed: tuple[int, ...]) -> March | None:
    """Follow a plan by the explicit midpoint rule; None where the motion grows without bound."""
    q, v = plan.positions[0].copy(), plan.velocities[0].copy()
    nodes, inputs, lam, v_a, v_c, free_steps = [q.copy()], [], [], [], [], 0
    v_B, cost, begin, s = v.copy(), 0.0, 0.0, list(prescribed)
    fastest = (
        RUNAWAY
        * np.maximum(problem.reach, np.abs(plan.positions).max(axis=0))
        / plan.durations.sum()
    )
    for i, steps in enumerate(problem.phase_steps):
        h = plan.durations[i] / steps
        target = (plan.positions[i + 1], plan.velocities[i + 1])
        was_free, since, spline = False, 0, _Spline(q, v, *target, plan.durations[i])
        for k in range(steps):
            here = Dynamics(problem, q, v, begin + k * h)
            free = here.reach(prescribed) < WINDOW
            if was_free and not free:
                since, spline = k, _Spline(q, v, *target, plan.durations[i] - k * h)
            was_free = free
            t = (k - since) * h
            a = here.accelerations(prescribed, spline.acceleration(t), free)
            middle = Dynamics(problem, q + h / 2 * v, v + h / 2 * a, begin + (k + 0.5) * h)
            a = middle.accelerations(prescribed, spline.acceleration(t + h / 2), free)
            inputs.append(middle.drive(a))
            q, v = q + h * v + h * h / 2 * a, v + h * a
            if not free:  # stay on the spline: sums of steps drift
                q[s], v[s] = spline.position(t + h)[s], spline.velocity(t + h)[s]
            if not (np.isfinite(q).all() and (np.abs(v) < fastest).all()):
                return None
            free_steps += free
            nodes.append(q)
        u = np.clip(np.array(inputs[-steps:]).reshape(steps, problem.nu), *problem.input_bounds.T)
        at = np.array(nodes[-steps:])
        times = begin + h * (np.arange(steps) + 0.5)
        cost += h * float(problem.model.running_cost(at, None, u, times).sum())
        begin += plan.durations[i]
        if i < len(problem.sequence):
            v_a.append(v)
            v, impulse = reflected(problem, q, v, problem.sequence[i], begin)
            v_c.append(v)
            lam.append(impulse)
    before, after = (np.array(found).reshape(len(lam), problem.nq) for found in (v_a, v_c))
    return March(
        np.array(nodes),
        np.array(inputs).reshape(len(inputs), problem.nu),
        np.array(lam),
        before,
        after,
        free_steps,
        v_B,
        v,
        cost,
    )


class _Spline:
    """Cubic from (q, v) to (q1, v1) in a time T."""

    def __init__(self, q: Array, v: Array, q1: Array, v1: Array, duration: float) -> None:
        self.q, self.v = q.copy(), v.copy()
        T = duration if duration > 0 else 1.0
        self.c2 = (3 * (q1 - q) / T - 2 * v - v1) / T
        self.c3 = (2 * (q - q1) / T + v + v1) / T**2

    def position(self, t: float) -> Array:
        return self.q + t * (self.v + t * (self.c2 + t * self.c3))

    def velocity(self, t: float) -> Array:
        return self.v + t * (2 * self.c2 + 3 * t * self.c3)

    def acceleration(self, t: float) -> Array:
        return 2 * self.c2 + 6 * t * self.c3


def reflected(problem: Problem, q: Array, v: Array, surface: str, t: float) -> tuple[Array, float]:
    """Velocity after an impact, and its impulse lam = (1 + e) (n.v + dg/dt) / (n M^-1 n) with n
    = grad g."""
    j = problem.kernels.surfaces.index(surface)
    *slope, moving = problem.model.gap_slopes(q, t)[j]
    normal = np.array(slope)
    response, inertia = problem.model.impulse_response(q, normal, t)
    approach = float(normal @ v) + moving
    impulse = (
        max((1 + float(problem.restitution_values[j])) * approach / inertia, 0.0)
        if inertia > 0
        else 0.0
    )
    return v - impulse * response, impulse


def resting(problem: Problem, plan: Plan) -> March:
    """Straight lines between the via points: the last resort."""
    pieces = [
        a + np.linspace(0, 1, n + 1)[:-1, None] * (b - a)
        for a, b, n in zip(plan.positions, plan.positions[1:], problem.phase_steps, strict=False)
    ]
    q = np.vstack([*pieces, plan.positions[-1:]])
    u = np.tile(midpoints(problem.input_bounds, np.zeros(problem.nu)), (len(q) - 1, 1))
    return March(
        q,
        u,
        np.zeros(len(problem.sequence)),
        plan.velocities[1:-1],
        plan.velocities[1:-1],
        0,
        plan.velocities[0],
        plan.velocities[-1],
        np.inf,
    )


def excess_of(problem: Problem, u: Array) -> float:
    """Largest violation of an input bound relative to the bound's range."""
    low, high = problem.input_bounds.T
    over = np.maximum(np.maximum(low - u, u - high), 0.0)
    sizes = [np.where(np.isfinite(limit), np.abs(limit), 0.0) for limit in (low, high)]
    scale = np.where(np.isfinite(high - low) & (high > low), high - low, np.maximum(*sizes))
    return float((over / np.where(scale > 0, scale, 1.0)).max(initial=0.0))
