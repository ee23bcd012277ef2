"""The way that a guess takes: points at the start, the collisions and the goal, velocities
there, and durations between them."""

from __future__ import annotations

import numpy as np

from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.mechanics.contacts import NOWHERE
from dmoc.problem.contacts import event_point
from dmoc.problem.problem import Problem
from dmoc.problem.ranges import Boundary, midpoints

# A plastic impact has no mirror image: coefficient of restitution that the plan assumes at least.
SOFTEST_MIRROR = 0.3
# Share of the final time that a phase gets at least.
SHORTEST_SHARE = 0.04


@record(frozen=True, eq=False)
class Waypoints:
    """A plan: via points of all coordinates, as positions (phases + 1, nq), velocities before each
    via point, and durations; of several plans with an axis before."""

    positions: Array
    velocities: Array
    durations: Array

    def __getitem__(self, which: int | None) -> Waypoints:
        """One of several plans; with None, this plan as the only one of several."""
        return Waypoints(self.positions[which], self.velocities[which], self.durations[which])


@record(frozen=True, eq=False)
class Normal:
    """A surface at a via point: the gradient of its gap, the change M^-1 n of the velocity by a
    unit impulse along it, n . M^-1 n, and the coefficient of restitution of its mirror; zeros where
    nothing is hit."""

    slope: Array
    response: Array
    square: float
    e: float


@record(frozen=True, eq=False)
class Route:
    """What plans have in common: points at the start, the collisions and the goal, shape (phases +
    1, nq), the mass matrix and the velocity at the start, the velocity at the goal if momenta fix
    it, the surfaces at the collisions, the length of the reach, and whether the last point is that
    of the last event.

    Where a surface of the sequence moves, points depend on the final time: a route is that of one,
    and there are no ``normals``.
    """

    points: Array
    mass: Array
    start: Array
    goal: Array | None
    normals: tuple[Normal, ...] | None
    reach: float
    ends_with_event: bool


def route_of(problem: Problem, final_time: float) -> Route:
    """The collisions are spread over the time."""
    goal = problem.goal_position
    last = problem.ends_with_event
    share = np.append(np.linspace(0.0, 1.0, problem.phases + 1 - last), np.ones(int(last)))
    points = (1 - share[:, None]) * problem.start_position + share[:, None] * goal
    for i in range(problem.phases - 1):
        t = float(share[i + 1]) * final_time
        points[i + 1] = event_point(problem, points[i + 1], points[i], i, t)
    if last:
        points[-1] = points[-2]
    start = end_velocity(problem, problem.start_bounds, points[0], np.zeros(problem.nq))
    normals = None
    if not any(event.hit in problem.model.moving for event in problem.touch.events):
        normals = tuple(_normal(problem, q, i, 0.0) for i, q in enumerate(points[1:-1]))
    end = _by_momentum(problem, problem.goal_bounds, points[-1])
    mass = problem.model.mass(points[0])
    reach = float(np.sqrt(problem.reach @ mass @ problem.reach))
    return Route(points, mass, start, end, normals, reach, last)


def _normal(problem: Problem, q: Array, collision: int, t: float) -> Normal:
    j = problem.touch.events[collision].hit
    if j == NOWHERE:
        return Normal(np.zeros(problem.nq), np.zeros(problem.nq), 0.0, 1.0)
    slope = problem.model.gap_slopes(q, t)[j, :-1]
    e = float(problem.restitution_values[j])
    e = 1.0 if np.isnan(e) else max(e, SOFTEST_MIRROR)  # of a speed that is not planned yet
    return Normal(slope, *problem.model.impulse_response(q, slope), e)


@record(frozen=True, eq=False)
class Shares:
    """The legs of a route, shape (phases, nq), the length of all together, measured by the masses,
    and the shares of the phases in the time."""

    legs: Array
    whole: float
    times: Array


def shares_of(route: Route, prescribed: tuple[int, ...], even: bool) -> Shares:
    """Shares in proportion to the distances of some coordinates, or even ones."""
    points = route.points
    chosen = np.zeros(points.shape[1])
    chosen[list(prescribed)] = 1.0
    legs = points[1:] - points[:-1]
    ways = legs * chosen
    lengths = np.sqrt((ways @ route.mass * ways).sum(axis=1))
    whole = float(lengths.sum())
    # Between two collisions with one surface the motion leaves and returns: such a phase gets an
    # average share.
    flights = lengths <= 1e-6 * whole
    flights[len(lengths) - route.ends_with_event :] = False
    average = whole / max(len(flights) - flights.sum(), 1)
    lengths = np.where(flights, average or route.reach or 1.0, lengths)
    whole = float(lengths.sum())
    shares = np.ones(len(lengths)) if even else np.maximum(lengths / whole, SHORTEST_SHARE)
    shares[len(lengths) - route.ends_with_event :] = 0.0
    return Shares(legs, whole, shares / shares.sum())


def plans_of(problem: Problem, route: Route, shares: Shares, final_times: Array) -> Waypoints:
    """Plans for some final times: durations by shares of the time, and velocities that continue
    smoothly in the mirror image behind each surface."""
    points, count = route.points, len(final_times)
    durations = np.clip(final_times[:, None] * shares.times, *problem.duration_bounds.T)
    speeds = shares.legs / np.where(durations > 0, durations, 1.0)[:, :, None]
    velocities = np.zeros((count, *points.shape))
    velocities[:, 0] = route.start
    slowest = shares.whole / final_times / 2
    for i in range(len(points) - 2):
        normal = (
            _normal(problem, points[i + 1], i, float(durations[0, : i + 1].sum()))
            if route.normals is None
            else route.normals[i]
        )
        beside = slice(i, i + 2)
        velocities[:, i + 1] = _through(normal, speeds[:, beside], durations[:, beside], slowest)
    if route.goal is None:
        last = speeds[:, -1]
        natural = 1.5 * last - 0.5 * velocities[:, -2] if problem.phases == 1 else last
        velocities[:, -1] = _by_velocity(problem.goal_bounds, natural)
    else:
        velocities[:, -1] = route.goal
    return Waypoints(np.broadcast_to(points, velocities.shape), velocities, durations)


def _through(normal: Normal, speeds: Array, durations: Array, slowest: Array) -> Array:
    """Velocities before a collision, from the mean velocities of the phases before and after it,
    shape (count, 2, nq), and their durations: their mean in the mirror image behind the surface,
    arriving not too slowly."""
    n, response, square = normal.slope, normal.response, normal.square
    before, after = speeds[:, 0], speeds[:, 1]
    if square > 0:
        after = after - (1 + 1 / normal.e) * (after @ n / square)[:, None] * response
    # The way to an event that ends the motion says its velocity alone.
    goes_on = durations[:, 1:] > 0
    share = np.where(goes_on, durations[:, :1], 0.0)
    share /= np.where(goes_on, durations.sum(axis=1, keepdims=True), 1.0)
    velocity = (1 - share) * before + share * after
    if square > 0:  # arrive with some speed, or there is no collision
        root = np.sqrt(square)
        arrival = velocity @ n / root
        velocity = velocity + (np.maximum(arrival, slowest) - arrival)[:, None] * response / root
    return np.asarray(velocity)


def end_velocity(problem: Problem, boundary: Boundary, q: Array, default: Array) -> Array:
    """Velocity at an end: what the bounds fix, as velocity or as momentum, else the default."""
    fixed = _by_momentum(problem, boundary, q)
    return _by_velocity(boundary, default) if fixed is None else fixed


def _by_momentum(problem: Problem, boundary: Boundary, q: Array) -> Array | None:
    if not np.isfinite(boundary.momentum).all():
        return None
    model = problem.models[-1 if boundary is problem.goal_bounds else 0]
    return model.velocity(q, midpoints(boundary.momentum, np.zeros(problem.nq)))


def _by_velocity(boundary: Boundary, default: Array) -> Array:
    by_momentum = np.isfinite(boundary.momentum).any(axis=1)
    return midpoints(boundary.velocity, np.where(by_momentum, 0.0, default))
