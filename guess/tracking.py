"""What is found along a plan: a motion that follows it (:mod:`dmoc.guess.tracker`), or straight
lines."""

from __future__ import annotations

import itertools
from typing import TypeAlias

import numpy as np

from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.guess.inverse_dynamics import inputs_for
from dmoc.guess.tracker import WINDOW, Marcher
from dmoc.guess.waypoints import Route, Waypoints, plans_of, route_of, shares_of
from dmoc.problem.problem import Problem
from dmoc.problem.ranges import midpoints

# Coordinates that follow splines.
Choice: TypeAlias = tuple[int, ...]


@record(frozen=True, eq=False)
class March:
    """A sampled motion: q (total + 1, nq), inputs (total, nu), impulses, velocities before and
    after the collisions (collisions, nq), steps in windows, velocities at both ends, and the
    largest violation of an input bound, relative to the bound's range."""

    q: Array
    u: Array
    lam: Array
    v_a: Array
    v_c: Array
    free_steps: int
    v_B: Array
    v_E: Array
    excess: float


@record(frozen=True, eq=False)
class Tracker:
    """Makes plans of a problem, and marches along them; ``still`` is the route of all plans, if
    there is one."""

    problem: Problem
    marcher: Marcher
    still: Route | None

    @classmethod
    def of(cls, problem: Problem) -> Tracker:
        route = route_of(problem, 0.0)
        return cls(problem, Marcher(problem), None if route.normals is None else route)

    def plan(self, choice: Choice, final_time: float, even: bool = False) -> Waypoints:
        return self._plans(self._route(final_time), choice, np.array([final_time]), even)[0]

    def trials(
        self, choice: Choice, final_times: Array, steps: tuple[int, ...]
    ) -> tuple[Array, Array]:
        """Excesses of the inputs and costs of motions with some final times; excesses that are no
        numbers where they grow without bound."""
        if self.still is not None:
            plans = self._plans(self.still, choice, final_times)
            return self.marcher.trials(plans, steps, choice)
        each = [self.plan(choice, float(t))[None] for t in final_times]
        results = [self.marcher.trials(plan, steps, choice) for plan in each]
        excess, cost = (np.concatenate(part) for part in zip(*results, strict=True))
        return excess, cost

    def march(self, plan: Waypoints, choice: Choice, steps: tuple[int, ...]) -> March | None:
        """Follow a plan by the explicit midpoint rule; None where the motion grows without
        bound."""
        motion = self.marcher.motion(plan, steps, choice)
        if motion is None:
            return None
        q, u, a, lam, v_a, v_c, end = motion
        start, free, excess = plan.velocities[0], self.marcher.free_steps, self.marcher.excess
        if self.around_other_inputs:
            u, excess = self._inputs(plan, steps, q, a)
        return March(q, u, lam, v_a, v_c, free, start, end, excess)

    @property
    def around_other_inputs(self) -> bool:
        """Whether forces are looked at around other inputs than zero: then the excesses and costs
        of trials, which take them for linear, are rough."""
        return bool(self.problem.operating_inputs.any())

    def _inputs(
        self, plan: Waypoints, steps: tuple[int, ...], q: Array, a: Array
    ) -> tuple[Array, float]:
        """Inputs of steps with some accelerations, within their bounds, and their excess: what they
        miss of the accelerations, relative to both."""
        h = np.repeat(plan.durations / np.maximum(steps, 1), steps)
        middle, rates = (q[:-1] + q[1:]) / 2, np.diff(q, axis=0) / h[:, None]
        t = np.cumsum(h) - h / 2
        model = self.problem.models.along(np.repeat(np.arange(len(steps)), steps))
        u = inputs_for(self.problem, model, middle, rates, a, t)
        reached = model.acceleration(middle, rates, u, t)
        reach = self.problem.reach
        missing = (np.abs(reached - a) / reach).max(initial=0.0)
        size = (np.abs(reached) / reach).max(initial=0.0) + (np.abs(a) / reach).max(initial=0.0)
        return u, float(missing / (size or 1.0))

    def prescribed(self, final_time: float) -> Choice:
        """Choose nu coordinates: those that surfaces and goal say most about, as long as the others
        can follow from them at one of the via points."""
        problem, nq, nu = self.problem, self.problem.nq, self.problem.nu
        if nu == 0 or nu >= nq:
            return tuple(range(nq))
        goal, on = (
            problem.goal_bounds.position,
            [problem.model.coordinates_at(event) for event in problem.touch.events],
        )
        said = [sum(i in at for at in on) + bool(goal[i, 0] == goal[i, 1]) for i in range(nq)]
        order = sorted(range(nq), key=lambda i: (-said[i], i))
        points = self._route(final_time).points
        for choice in itertools.combinations(order, nu):
            if any(self.marcher.control(q, choice) > WINDOW for q in points):
                return tuple(sorted(choice))
        return tuple(range(nq))

    def _plans(
        self, route: Route, choice: Choice, final_times: Array, even: bool = False
    ) -> Waypoints:
        return plans_of(self.problem, route, shares_of(route, choice, even), final_times)

    def _route(self, final_time: float) -> Route:
        return route_of(self.problem, final_time) if self.still is None else self.still


def reflected(
    problem: Problem, q: Array, v: Array, surface: int, t: float, *, lands: bool = False
) -> tuple[Array, float]:
    """Velocity after an impact, and its impulse lam = (1 + e) (n.v + dg/dt) / (n M^-1 n) with n
    = grad g; e = 0 where the surface ``lands``."""
    *slope, moving = problem.model.gap_slopes(q, t)[surface]
    normal = np.array(slope)
    response, inertia = problem.model.impulse_response(q, normal, t)
    approach = float(normal @ v) + moving
    own = problem.model.coefficients(problem.restitution_values, q, v, t)
    e = 0.0 if lands else float(own[surface])
    impulse = max((1 + e) * approach / inertia, 0.0) if inertia > 0 else 0.0
    return v - impulse * response, impulse


def resting(problem: Problem, plan: Waypoints) -> March:
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
        0.0,
    )
