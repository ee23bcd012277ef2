"""An initial guess from boundary values, collision positions and the equations of motion (Kern & Gross 2018, issues #1 and #2).

As many coordinates as there are inputs are *prescribed* by cubic splines that match the boundary values and the collision positions.  The
accelerations of the others follow from the rows of the equations of motion that no input enters, the inputs from the other rows.
The matrix that gives those accelerations can become singular (cart-pendulum: at alpha = k pi, where cart accelerations exert no torque on
the pendulum).  Inside a window around such a point nothing is prescribed: the motion is free, the other coordinates are unaccelerated.
The final time is varied until the inputs keep their bounds.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.algebra import least_squares
from dmoc.nlp.layout import Layout
from dmoc.nlp.problem import Boundary, Problem, midpoints
from dmoc.nlp.scaling import scale_of
from dmoc.nlp.surfaces import crossings, gap_to, onto_surface
from dmoc.nlp.transcription import Transcription
from dmoc.nlp.transfer import on_finer

# Smallest singular value, relative to the rows and with inertia scaled to one, below which controllability counts as lost.
WINDOW = 0.15
# Ratio of successive final times; how many steps a motion gets while they are compared, and a phase at least.
TIME_RATIO = 1.2
COARSE_STEPS = 80
FEWEST_STEPS = 8
# Violation of the discrete equations, relative to the momenta, above which a guess that obeys the equations of motion has drifted off its goal.
DRIFTED = 30.0
# Speed, in reaches of the coordinates per final time, above which a motion counts as growing without bound.
RUNAWAY = 1e6
# Where neither the problem nor its dynamics say anything about the final time, a search for the cheapest begins here and goes so many decades at most;
# and the largest time that is tried, relative to what is known.
NO_TIME, MOST_DECADES, AROUND = 1.0, 24, 10.0
# Steps of a phase that a guess is marched with; finer meshes interpolate it.
MOST_MARCHED = 400
# Shares of a reach to which distances of contact points count as equal.
EQUALLY_FAR = 1e-6
# Share of the latest final time below which a guess that takes all the time is a further start.
MUCH_SHORTER = 0.5
# A plastic impact has no mirror image: coefficient of restitution that the plan assumes at least.
SOFTEST_MIRROR = 0.3
# Share of the final time that a phase gets at least.
SHORTEST_SHARE = 0.04


@dataclass(frozen=True)
class Guess:
    """Unknowns of the nonlinear program, and how they were found.

    Attributes
    ----------
    x : array of shape (n,)
        In the order of :class:`~dmoc.nlp.layout.Layout`.
    final_time : float
        The final time that was chosen, in seconds.
    prescribed : tuple of str
        Coordinates that follow splines.
    free_steps : int
        Steps inside a window of lost controllability.
    input_excess : float
        Largest violation of an input bound, relative to the bound's range; 0 where they are kept.
    """

    x: Array
    final_time: float
    prescribed: tuple[str, ...]
    free_steps: int
    input_excess: float


@dataclass(frozen=True)
class Plan:
    """Via points of all coordinates: positions (phases + 1, nq), velocities before each via point, and durations."""

    positions: Array
    velocities: Array
    durations: Array


@dataclass(frozen=True)
class Motion:
    """A sampled motion: q (total + 1, nq), inputs (total, nu), impulses, velocities before and after the collisions (collisions, nq), steps in
    windows, velocities at both ends, cost."""

    q: Array
    u: Array
    lam: Array
    v_a: Array
    v_c: Array
    free_steps: int
    v_B: Array
    v_E: Array
    cost: float


def initial_guesses(problem: Problem, deadline: float = np.inf) -> tuple[Guess, ...]:
    """Return guesses for all unknowns of ``problem``, the better one first.

    The final times that are tried keep the problem's bounds; among those that keep the bounds of the inputs the one of least cost is taken, and if
    there is none, the one that violates them least.  After the ``deadline``, a time of ``time.perf_counter``, no further one is tried.
    Phases of very many steps are marched with fewer and interpolated.
    """
    if max(problem.phase_steps) > MOST_MARCHED:
        few = problem.but(steps=[min(n, MOST_MARCHED) for n in problem.phase_steps])
        return tuple(replace(g, x=on_finer(problem, few, g.x)) for g in initial_guesses(few, deadline))
    with np.errstate(all="ignore"):
        return _guesses(problem, deadline)


def _guesses(problem: Problem, deadline: float) -> tuple[Guess, ...]:
    prescribed = _prescribed(problem)
    few = max(COARSE_STEPS // problem.phases, FEWEST_STEPS)
    coarse = problem.but(steps=[min(n, few) for n in problem.phase_steps])
    best: tuple[float, float, float] | None = None
    for final_time in _final_times(problem):
        if time.perf_counter() > deadline:
            break
        motion = _march(coarse, _plan(coarse, prescribed, final_time), prescribed)
        if motion is None:
            continue
        excess = _excess(coarse, motion.u)
        rank = (max(excess, 1e-3), motion.cost, final_time)
        if best is None or rank < best:
            best = rank
    final_time = float(best[2] if best else _final_times(problem)[-1])
    # An underactuated motion may drift far from the goal; then splines for all coordinates, which ignore the rows without
    # inputs, violate the discrete equations less.
    guesses = []
    choices = [(choice, final_time, False) for choice in dict.fromkeys((prescribed, tuple(range(problem.nq))))]
    latest = problem.final_time_bounds[1]
    if np.isfinite(latest) and final_time < MUCH_SHORTER * latest:  # a hurried guess says little about what there is time for
        choices.append((choices[-1][0], latest, False))
    if problem.sequence:
        choices.append((prescribed, final_time, True))
    for choice, length, even in choices:
        if time.perf_counter() > deadline:
            break
        plan = _plan(problem, choice, length, even)
        motion = _march(problem, plan, choice)
        if motion is not None:
            x = _unknowns(problem, plan, motion)
            guesses.append(Guess(x, length, _names(problem, choice), motion.free_steps, _excess(problem, motion.u)))
    if not guesses:
        plan = _plan(problem, prescribed, final_time)
        motion = _resting(problem, plan)
        guesses.append(Guess(_unknowns(problem, plan, motion), final_time, (), 0, 0.0))
    nlp = Transcription(problem, scale_of(problem, guesses[-1].x))
    errors = [float(np.abs(nlp.equality(np.clip(nlp.scaled(g.x), nlp.lower, nlp.upper))).max()) for g in guesses]
    drifted = errors[0] > DRIFTED and min(errors[1:], default=np.inf) < errors[0]
    return tuple(guesses[1:] + guesses[:1] if drifted else guesses)


def _names(problem: Problem, choice: tuple[int, ...]) -> tuple[str, ...]:
    return tuple(problem.kernels.coordinates[i] for i in choice)


# Choices -------------------------------------------------------------------------------------------------------------


def _final_times(problem: Problem) -> list[float]:
    """Final times to try, within the bounds of the final time and of the durations."""
    low, high = problem.final_time_bounds
    durations = problem.duration_bounds.sum(axis=0)
    low, high = max(low, durations[0]), min(high, durations[1])
    if low == high:
        return [low]
    natural = _natural_time(problem)
    top = high if np.isfinite(high) else AROUND * max(natural, low)
    bottom = max(low, top / 50)
    count = int(np.ceil(np.log(top / bottom) / np.log(TIME_RATIO))) + 1
    return list(np.geomspace(bottom, top, max(count, 2)))


def _natural_time(problem: Problem) -> float:
    """Time that the reaches take at the speeds of the start, at the forces at rest, or at full input."""
    reach = problem.reach
    q = problem.start_position
    boundary = problem.start_bounds
    v = _end_velocity(problem, boundary, q, np.zeros(problem.nq))
    box = problem.input_bounds
    full = [np.where(np.isfinite(side), side, 0.0) for side in box.T]
    times = [reach[i] / abs(v[i]) for i in range(problem.nq) if v[i] != 0]
    for u in (np.zeros(problem.nu), *full):
        a = np.abs(problem.model.acceleration(q, u=u))
        times += [float(np.sqrt(2 * reach[i] / a[i])) for i in range(problem.nq) if np.isfinite(a[i]) and a[i] > 0]
    return float(np.median(times)) if times else _cheapest_decade(problem)


def _cheapest_decade(problem: Problem) -> float:
    """The final time, by powers of ten, whose motion along splines costs least: all that a cost of time and effort says."""
    coarse, every = problem.but(steps=FEWEST_STEPS), tuple(range(problem.nq))

    def cost(final_time: float) -> float:
        motion = _march(coarse, _plan(coarse, every, final_time), every)
        return np.inf if motion is None or not np.isfinite(motion.cost) else motion.cost

    at, least = NO_TIME, cost(NO_TIME)
    for ratio in (10.0, 0.1):
        for _ in range(MOST_DECADES):
            further = cost(at * ratio)
            if not further < least:
                break
            at, least = at * ratio, further
    return at


def _prescribed(problem: Problem) -> tuple[int, ...]:
    """Choose nu coordinates: those that surfaces and goal say most about, as long as the others can follow from them."""
    nq, nu = problem.nq, problem.nu
    if nu == 0 or nu >= nq:
        return tuple(range(nq))
    surfaces = problem.kernels.manifest["surface_coordinates"]
    goal = problem.goal_bounds.position
    said = [sum(i in surfaces[s] for s in problem.sequence) + bool(goal[i, 0] == goal[i, 1]) for i in range(nq)]
    order = sorted(range(nq), key=lambda i: (-said[i], i))
    points = _via_positions(problem, _final_times(problem)[-1])
    for choice in itertools.combinations(order, nu):
        if any(_Dynamics(problem, q, np.zeros(nq), 0.0).reach(choice) > WINDOW for q in points):
            return tuple(sorted(choice))
    return tuple(range(nq))


def _via_positions(problem: Problem, final_time: float) -> Array:
    """Positions at the start, at the collisions and at the goal, shape (phases + 1, nq); the collisions are spread over the time."""
    start = problem.start_position
    goal = midpoints(problem.goal_bounds.position, start)
    share = np.linspace(0.0, 1.0, problem.phases + 1)[:, None]
    points = (1 - share) * start + share * goal
    for i, surface in enumerate(problem.sequence):
        points[i + 1] = contact_point(problem, points[i + 1], points[i], surface, float(share[i + 1, 0]) * final_time)
    return points


def contact_point(problem: Problem, q: Array, before: Array, surface: str, t: float) -> Array:
    """A point of the surface near q; of several that are equally near the one nearest to the point before.  q itself where none is found.

    A surface of one coordinate is met at its first root on either side of q.
    """
    found = crossings(problem, q, surface, t) or [p for p in [onto_surface(problem, q, surface, t)] if p is not None]

    def far(p: Array) -> tuple[float, float]:
        away, back = (float(np.linalg.norm((p - other) / problem.reach)) for other in (q, before))
        return round(away / EQUALLY_FAR), back

    return min(found, key=far, default=q)


def _plan(problem: Problem, prescribed: tuple[int, ...], final_time: float, even: bool = False) -> Plan:
    """Durations in proportion to the distances, or even ones, and velocities that continue smoothly in the mirror image behind each surface."""
    points = _via_positions(problem, final_time)
    legs = np.diff(points, axis=0)
    inertia = problem.model.mass(points[0])[np.ix_(prescribed, prescribed)]
    lengths = np.sqrt(np.einsum("ki,ij,kj->k", legs[:, list(prescribed)], inertia, legs[:, list(prescribed)]))
    # Between two collisions with one surface the motion leaves and returns: such a phase gets an average share.
    flights = lengths <= 1e-6 * lengths.sum()
    lengths = np.where(flights, lengths.sum() / max((~flights).sum(), 1) or 1.0, lengths)
    shares = np.ones(len(lengths)) if even else np.maximum(lengths / lengths.sum(), SHORTEST_SHARE)
    durations = np.clip(final_time * shares / shares.sum(), *problem.duration_bounds.T)
    velocities = np.zeros_like(points)
    velocities[0] = _end_velocity(problem, problem.start_bounds, points[0], np.zeros(problem.nq))
    slowest = lengths.sum() / final_time / 2
    for i, surface in enumerate(problem.sequence):
        _, slope, _ = gap_to(problem, points[i + 1], surface, float(durations[: i + 1].sum()))
        e = max(_coefficient(problem, surface), SOFTEST_MIRROR)
        before, after = legs[i] / durations[i], legs[i + 1] / durations[i + 1]
        response, square = problem.model.impulse_response(points[i + 1], slope)
        mirrored = after - (1 + 1 / e) * (slope @ after) / square * response if square > 0 else after
        velocity = (durations[i + 1] * before + durations[i] * mirrored) / (durations[i] + durations[i + 1])
        if square > 0:  # arrive with some speed, or there is no collision
            normal = slope @ velocity / np.sqrt(square)
            velocity += (max(normal, slowest) - normal) * response / np.sqrt(square)
        velocities[i + 1] = velocity
    natural = 1.5 * legs[-1] / durations[-1] - 0.5 * velocities[-2] if problem.phases == 1 else legs[-1] / durations[-1]
    velocities[-1] = _end_velocity(problem, problem.goal_bounds, points[-1], natural)
    return Plan(points, velocities, durations)


def _end_velocity(problem: Problem, boundary: Boundary, q: Array, default: Array) -> Array:
    """Velocity at an end: what the bounds fix, as velocity or as momentum, else the default."""
    if np.isfinite(boundary.momentum).all():
        return problem.model.velocity(q, midpoints(boundary.momentum, np.zeros(problem.nq)))
    return midpoints(boundary.velocity, np.where(np.isfinite(boundary.momentum).any(axis=1), 0.0, default))


# Motion --------------------------------------------------------------------------------------------------------------


class _Dynamics:
    """Equations of motion M q'' = F + B u at one state and time, with the rows that no input enters."""

    def __init__(self, problem: Problem, q: Array, v: Array, t: float) -> None:
        self.mass, self.force = problem.model.equations(q, v, t=t)
        self.inputs = problem.model.input_matrix(q, v, t=t)
        self.rest, self.inverse = _rows_of_inputs(self.inputs.tobytes(), problem.inertia.tobytes(), *self.inputs.shape)

    def reach(self, prescribed: tuple[int, ...]) -> float:
        """Smallest singular value of the matrix that gives the other accelerations, relative to its rows; 1 if there are no others."""
        _, others = _shares(len(self.force), prescribed, False)
        if not others:
            return 1.0
        scale = 1 / np.sqrt(self.mass.diagonal())
        rows = self.rest @ (self.mass * scale)
        rows /= np.sqrt((rows * rows).sum(axis=1, keepdims=True))
        if len(others) == len(rows) == 1:
            return abs(float(rows[0, others[0]]))
        return float(np.linalg.svd(rows[:, others], compute_uv=False)[-1]) if np.isfinite(rows).all() else 0.0

    def accelerations(self, prescribed: tuple[int, ...], wanted: Array, free: bool) -> Array:
        """Return q'': the prescribed ones as wanted and the others from the rows without inputs, or the reverse in free motion."""
        given, found = _shares(len(self.force), prescribed, free)
        a = np.zeros(len(self.force))
        if not free:
            a[given] = wanted[given]
        if found:
            right = self.rest @ (self.force - self.mass[:, given] @ a[given])
            a[found] = _least_squares(self.rest @ self.mass[:, found], right)
        return a

    def drive(self, a: Array) -> Array:
        """Return the inputs that come closest to the accelerations a."""
        return np.asarray(self.inverse @ (self.mass @ a - self.force))


@lru_cache(maxsize=64)
def _shares(nq: int, prescribed: tuple[int, ...], free: bool) -> tuple[list[int], list[int]]:
    """Coordinates whose accelerations are given, the prescribed ones or, in free motion, the others, and those found from them."""
    sides = ([i for i in range(nq) if i in prescribed], [i for i in range(nq) if i not in prescribed])
    return sides[::-1] if free else sides


@lru_cache(maxsize=64)
def _rows_of_inputs(inputs: bytes, inertia: bytes, nq: int, nu: int) -> tuple[Array, Array]:
    """A basis of the rows that no input enters, orthonormal where forces count by the roots of the inertias, and the inverse of B by least
    squares in the same measure; B is the same in most states."""
    root = np.sqrt(np.frombuffer(inertia))
    B = np.frombuffer(inputs).reshape(nq, nu) / root[:, None]
    if not (nu and np.isfinite(B).all()):
        return np.diag(1 / root), np.zeros((nu, nq))
    size = np.linalg.norm(B, axis=0)
    size = np.where(size > 0, size, 1.0)
    rest = np.linalg.svd(B / size, full_matrices=True)[0][:, nu:].T
    return rest / root, np.asarray(np.linalg.pinv(B / size) / size[:, None] / root)


def _least_squares(A: Array, b: Array) -> Array:
    if A.shape == (1, 1) and A[0, 0] != 0:
        return np.asarray(b / A[0, 0])
    return least_squares(A, b)


def _march(problem: Problem, plan: Plan, prescribed: tuple[int, ...]) -> Motion | None:
    """Follow a plan by the explicit midpoint rule; None where the motion grows without bound."""
    q, v = plan.positions[0].copy(), plan.velocities[0].copy()
    nodes, inputs, lam, v_a, v_c, free_steps = [q.copy()], [], [], [], [], 0
    v_B, cost, begin, s = v.copy(), 0.0, 0.0, list(prescribed)
    fastest = RUNAWAY * np.maximum(problem.reach, np.abs(plan.positions).max(axis=0)) / plan.durations.sum()
    for i, steps in enumerate(problem.phase_steps):
        h = plan.durations[i] / steps
        target = (plan.positions[i + 1], plan.velocities[i + 1])
        was_free, since, spline = False, 0, _Spline(q, v, *target, plan.durations[i])
        for k in range(steps):
            here = _Dynamics(problem, q, v, begin + k * h)
            free = here.reach(prescribed) < WINDOW
            if was_free and not free:
                since, spline = k, _Spline(q, v, *target, plan.durations[i] - k * h)
            was_free = free
            t = (k - since) * h
            a = here.accelerations(prescribed, spline.acceleration(t), free)
            middle = _Dynamics(problem, q + h / 2 * v, v + h / 2 * a, begin + (k + 0.5) * h)
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
    return Motion(
        np.array(nodes), np.array(inputs).reshape(len(inputs), problem.nu), np.array(lam), before, after, free_steps, v_B, v, cost
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


def _coefficient(problem: Problem, surface: str) -> float:
    return float(problem.restitution_values[problem.kernels.surfaces.index(surface)])


def reflected(problem: Problem, q: Array, v: Array, surface: str, t: float) -> tuple[Array, float]:
    """Velocity after an impact, and its impulse lam = (1 + e) (n.v + dg/dt) / (n M^-1 n) with n = grad g."""
    _, normal, moving = gap_to(problem, q, surface, t)
    response, inertia = problem.model.impulse_response(q, normal, t)
    approach = float(normal @ v) + moving
    impulse = max((1 + _coefficient(problem, surface)) * approach / inertia, 0.0) if inertia > 0 else 0.0
    return v - impulse * response, impulse


def _resting(problem: Problem, plan: Plan) -> Motion:
    """Straight lines between the via points: the last resort."""
    pieces = [
        a + np.linspace(0, 1, n + 1)[:-1, None] * (b - a)
        for a, b, n in zip(plan.positions, plan.positions[1:], problem.phase_steps, strict=False)
    ]
    q = np.vstack([*pieces, plan.positions[-1:]])
    u = np.tile(midpoints(problem.input_bounds, np.zeros(problem.nu)), (len(q) - 1, 1))
    return Motion(
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


def _excess(problem: Problem, u: Array) -> float:
    """Largest violation of an input bound relative to the bound's range."""
    low, high = problem.input_bounds.T
    over = np.maximum(np.maximum(low - u, u - high), 0.0)
    sizes = [np.where(np.isfinite(limit), np.abs(limit), 0.0) for limit in (low, high)]
    scale = np.where(np.isfinite(high - low) & (high > low), high - low, np.maximum(*sizes))
    return float((over / np.where(scale > 0, scale, 1.0)).max(initial=0.0))


# Unknowns ------------------------------------------------------------------------------------------------------------


def _unknowns(problem: Problem, plan: Plan, motion: Motion) -> Array:
    lay = Layout.of(problem)
    x = np.zeros(lay.size)
    x[lay.index_h] = plan.durations / np.array(problem.phase_steps)
    x[lay.index_q] = motion.q
    u = _to_nodes(motion.u, problem.phase_steps) if lay.form.shared else motion.u[lay.step_of_input]
    x[lay.index_u] = np.clip(u, *problem.input_bounds.T)
    x[lay.index_lam], x[lay.index_v_a], x[lay.index_v_c] = motion.lam, motion.v_a, motion.v_c
    times = lay.times(x)
    x[lay.index_t] = times[: len(lay.index_t)]
    inside = lay.scheme.within(motion.q[:-1], motion.q[1:])
    x[lay.index_q_i] = inside.reshape(lay.total, -1)
    for node, index_p, index_v, v in (
        (0, lay.index_p_B, lay.index_v_B, motion.v_B),
        (-1, lay.index_p_E, lay.index_v_E, motion.v_E),
    ):
        x[index_p] = problem.model.momentum(motion.q[node], v, times[node])
        if len(index_v):
            x[index_v] = v
    return x


def _to_nodes(u: Array, phase_steps: tuple[int, ...]) -> Array:
    """Inputs at the nodes of each phase from inputs in the steps: the mean of both neighbours."""
    return np.vstack(list(_phase_nodes(u, phase_steps)))


def _phase_nodes(u: Array, phase_steps: tuple[int, ...]) -> Iterator[Array]:
    start = 0
    for n in phase_steps:
        part = u[start : start + n]
        yield np.vstack([part[:1], (part[:-1] + part[1:]) / 2, part[-1:]])
        start += n
