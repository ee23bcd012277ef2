"""An initial guess from boundary values, collision positions and the equations of motion (Kern &
Gross 2018, issues #1 and #2).

As many coordinates as there are inputs are *prescribed* by cubic splines that match the boundary
values and the collision positions.  The accelerations of the others follow from the rows of the
equations of motion that no input enters, the inputs from the other rows. The matrix that gives
those accelerations can become singular (cart-pendulum: at alpha = k pi, where cart accelerations
exert no torque on the pendulum).  Inside a window around such a point nothing is prescribed: the
motion is free, the other coordinates are unaccelerated. The final time is varied until the inputs
keep their bounds.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from dmoc.base.deadline import ENDLESS, Deadline
from dmoc.base.records import record
from dmoc.base.tolerances import BALANCED, SAME
from dmoc.codegen.kernels import Array
from dmoc.guess.contacts import standing
from dmoc.guess.hits import completed
from dmoc.guess.inverse_dynamics import acting
from dmoc.guess.limit_excess import is_limited, largest_excess
from dmoc.guess.tracking import Choice, March, Tracker, resting
from dmoc.guess.transfer import on_mesh
from dmoc.guess.waypoints import Waypoints, end_velocity
from dmoc.problem.problem import Problem
from dmoc.program.iterate import Iterate
from dmoc.program.layout import Layout
from dmoc.program.scaling import cost_of, scale_of
from dmoc.program.transcription import Transcription

# Ratio of successive final times; how many steps a motion gets while they are compared, and a phase
# at least.
TIME_RATIO = 1.2
COARSE_STEPS = 80
FEWEST_STEPS = 8
# Excess of an input, relative to the range of its bounds, that counts as keeping them.
WITHIN = 1e-3
# Violation of the discrete equations, relative to the momenta, above which a guess that obeys the
# equations of motion has drifted off its goal.
DRIFTED = 30.0
# Where neither the problem nor its dynamics say anything about the final time, a search for the
# cheapest begins here and goes so many decades at most; and the largest time that is tried,
# relative to what is known.
NO_TIME, MOST_DECADES, AROUND = 1.0, 24, 10.0
# Steps of a phase that a guess is marched with; finer meshes interpolate it.
MOST_MARCHED = 400
# Share of the latest final time below which a guess that takes all the time is a further start.
MUCH_SHORTER = 0.5


@record(frozen=True, eq=False)
class Guess:
    """Unknowns of the nonlinear program, and how they were found."""

    x: Array
    final_time: float  # that was chosen, in seconds
    prescribed: tuple[str, ...]  # coordinates that follow splines
    free_steps: int  # inside a window of lost controllability
    input_excess: float  # over a bound, relative to its range


def initial_guesses(problem: Problem, deadline: Deadline = ENDLESS) -> tuple[Guess, ...]:
    """Return guesses for all unknowns of ``problem``, the better one first.

    The final times that are tried keep the problem's bounds; among those that keep the bounds of
    the inputs the one of least cost is taken, and if there is none, the one that violates them
    least.  After the deadline no further one is tried.  Phases of very many steps are marched with
    fewer and interpolated.
    """
    if max(problem.phase_steps) > MOST_MARCHED:
        few = problem.meshed([min(n, MOST_MARCHED) for n in problem.phase_steps])
        guesses = initial_guesses(few, deadline)
        return tuple(replace(g, x=on_mesh(problem, few, g.x)) for g in guesses)
    with np.errstate(all="ignore"):
        if problem.held:
            x = standing(problem, natural_time(problem))
            lay = Layout.of(problem)
            return (Guess(x, float(lay.durations(x).sum()), (), 0, 0.0),)
        return _guesses(problem, deadline)


def _guesses(problem: Problem, deadline: Deadline) -> tuple[Guess, ...]:
    tracker = Tracker.of(problem)
    times = _final_times(tracker)
    prescribed = tracker.prescribed(float(times[-1]))
    final_time = _best_time(tracker, prescribed, times, deadline)
    guesses = []
    for choice, length, even in _choices(problem, prescribed, final_time):
        if deadline.passed:
            break
        plan = tracker.plan(choice, length, even)
        motion = tracker.march(plan, choice, problem.phase_steps)
        if motion is not None:
            names = tuple(problem.kernels.coordinates[i] for i in choice)
            x = _unknowns(problem, plan, motion)
            guesses.append(Guess(x, length, names, motion.free_steps, motion.excess))
    if not guesses:
        plan = tracker.plan(prescribed, final_time)
        x = _unknowns(problem, plan, resting(problem, plan))
        guesses.append(Guess(x, final_time, (), 0, 0.0))
    return _without_drift(problem, guesses)


def _best_time(tracker: Tracker, prescribed: Choice, times: Array, deadline: Deadline) -> float:
    """The final time whose motion keeps the bounds of the inputs at the least cost, or violates
    them least."""
    few = max(COARSE_STEPS // tracker.problem.phases, FEWEST_STEPS)
    steps = tuple(min(n, few) for n in tracker.problem.phase_steps)
    results = zip(*_trials(tracker, prescribed, times, steps, deadline), times, strict=True)
    ranks = [(max(excess, WITHIN), cost, t) for excess, cost, t in results if not np.isnan(excess)]
    return float(min(ranks)[2] if ranks else times[-1])


def _trials(
    tracker: Tracker, choice: Choice, times: Array, steps: tuple[int, ...], deadline: Deadline
) -> tuple[Array, Array]:
    """Excesses and costs of motions along splines in some steps, with the objective and the bounds
    of velocities and quantities that the problem has; excesses that are no numbers where a motion
    grows without bound or the deadline has passed."""
    problem = tracker.problem
    beyond_marcher = is_limited(problem) or problem.model.has_objective
    beyond_marcher |= tracker.around_other_inputs
    if not (beyond_marcher or deadline.passed):
        return tracker.trials(choice, times, steps)
    excess, cost = np.full((2, len(times)), np.nan)
    coarse = problem.meshed(steps)
    for i, final_time in enumerate(times):
        if deadline.passed:
            break
        plan = tracker.plan(choice, float(final_time))
        motion = tracker.march(plan, choice, steps)
        if motion is not None:
            at = Iterate.of(coarse, _unknowns(coarse, plan, motion))
            excess[i] = max(motion.excess, largest_excess(at))
            cost[i] = cost_of(at)
    return excess, cost


def _choices(
    problem: Problem, prescribed: Choice, final_time: float
) -> Iterator[tuple[Choice, float, bool]]:
    """Prescribed coordinates, final time, and whether the phases take equally long."""
    every = tuple(range(problem.nq))
    yield prescribed, final_time, False
    # An underactuated motion may drift far from the goal; then splines for all coordinates, which
    # ignore the rows without inputs, violate the discrete equations less.
    if every != prescribed:
        yield every, final_time, False
    latest = problem.final_time_bounds[1]
    # A hurried guess says little about what there is time for.
    if np.isfinite(latest) and final_time < MUCH_SHORTER * latest:
        yield every, latest, False
    if problem.sequence:
        yield prescribed, final_time, True


def _without_drift(problem: Problem, guesses: list[Guess]) -> tuple[Guess, ...]:
    """The guesses, the first one last if it has drifted off its goal and another one has not."""
    end = Layout.of(problem).index_q[-1]
    if len(guesses) > 1 and _misses_goal(problem, guesses[0].x[end]):
        nlp = Transcription(problem, scale_of(problem, guesses[-1].x))
        errors = [
            float(np.abs(nlp.equality(np.clip(nlp.scaled(g.x), nlp.lower, nlp.upper))).max())
            for g in guesses
        ]
        if errors[0] > DRIFTED and min(errors[1:]) < errors[0]:
            return tuple(guesses[1:] + guesses[:1])
    return tuple(guesses)


def _misses_goal(problem: Problem, q: Array) -> bool:
    """Whether a last position is out of its bounds by more than rounding."""
    low, high = problem.goal_bounds.position.T
    return bool((np.maximum(low - q, q - high) > SAME * problem.reach).any())


# Choices ------------------------------------------------------------------------------------------


def _final_times(tracker: Tracker) -> Array:
    """Final times to try, within the bounds of the final time and of the durations."""
    problem = tracker.problem
    low, high = problem.final_time_bounds
    durations = problem.duration_bounds.sum(axis=0)
    low, high = max(low, durations[0]), min(high, durations[1])
    if low == high:
        return np.array([low])
    top = high if np.isfinite(high) else AROUND * max(natural_time(problem), low)
    bottom = max(low, top / 50)
    count = int(np.ceil(np.log(top / bottom) / np.log(TIME_RATIO))) + 1
    return np.geomspace(bottom, top, max(count, 2))


def natural_time(problem: Problem) -> float:
    """Time that the reaches take at the speeds of the start, at the forces at rest, or at full
    input."""
    expected = expected_time(problem)
    if expected is not None:
        return expected
    return NO_TIME if problem.held else _cheapest_decade(Tracker.of(problem))


def expected_time(problem: Problem) -> float | None:
    """The time in seconds that the statement of a problem tells, if it does."""
    reach = problem.reach
    q = problem.start_position
    boundary = problem.start_bounds
    v = end_velocity(problem, boundary, q, np.zeros(problem.nq))
    box = problem.input_bounds
    full = [np.where(np.isfinite(side), side, 0.0) for side in box.T]
    times = [reach[i] / abs(v[i]) for i in range(problem.nq) if v[i] != 0]
    for u in (np.zeros(problem.nu), *full):
        a = np.abs(problem.model.acceleration(q, u=u)) / reach
        least = BALANCED * np.where(np.isfinite(a), a, 0.0).max()  # what rounding leaves of none
        times += [float(np.sqrt(2 / rate)) for rate in a if np.isfinite(rate) and rate > least]
    if not times:
        return None
    ordered, middle = np.sort(times), len(times) // 2
    return float((ordered[middle] + ordered[~middle]) / 2)  # np.median loads masked arrays


def _cheapest_decade(tracker: Tracker) -> float:
    """The final time, by powers of ten, whose motion along splines keeps its bounds best and costs
    least: all that a cost of time and effort says."""
    every = tuple(range(tracker.problem.nq))
    steps = tuple(min(n, FEWEST_STEPS) for n in tracker.problem.phase_steps)

    def cost(final_time: float) -> tuple[float, float]:
        excess, cost = _trials(tracker, every, np.array([final_time]), steps, ENDLESS)
        if np.isnan(excess[0]) or not np.isfinite(cost[0]):
            return np.inf, np.inf
        return max(excess[0], WITHIN), cost[0]

    at, least = NO_TIME, cost(NO_TIME)
    for ratio in (10.0, 0.1):
        for _ in range(MOST_DECADES):
            further = cost(at * ratio)
            if not further < least:
                break
            at, least = at * ratio, further
    return at


# Unknowns -----------------------------------------------------------------------------------------


def _unknowns(problem: Problem, plan: Waypoints, motion: March) -> Array:
    lay = Layout.of(problem)
    x = lay.zeros(problem)
    x[lay.index_h] = lay.step_sizes(plan.durations)
    x[lay.index_q] = motion.q
    u = _to_nodes(motion.u, problem.phase_steps) if lay.form.shared else motion.u[lay.step_of_input]
    x[lay.index_u] = np.clip(u, *problem.input_bounds.T)
    x[lay.impact.lam], x[lay.impact.v_a], x[lay.impact.v_c] = motion.lam, motion.v_a, motion.v_c
    times = lay.times(x)
    x[lay.index_t] = times[: len(lay.index_t)]
    if np.ptp(motion.q, axis=0).any():  # standing still takes no inputs
        x = acting(problem, x)
    inside = lay.scheme.within(motion.q[:-1], motion.q[1:])
    x[lay.index_q_i] = inside.reshape(lay.total, -1)
    for node, index_p, index_v, v in (
        (0, lay.index_p_B, lay.index_v_B, motion.v_B),
        (-1, lay.index_p_E, lay.index_v_E, motion.v_E),
    ):
        x[index_p] = problem.models[node].momentum(motion.q[node], v, times[node])
        if len(index_v):
            x[index_v] = v
    return completed(Iterate.of(problem, x))


def _to_nodes(u: Array, phase_steps: tuple[int, ...]) -> Array:
    """Inputs at the nodes of each phase from inputs in the steps: the mean of both neighbours."""
    return np.vstack(list(_phase_nodes(u, phase_steps)))


def _phase_nodes(u: Array, phase_steps: tuple[int, ...]) -> Iterator[Array]:
    start = 0
    for n in phase_steps:
        part = u[start : start + n]
        yield np.vstack([part[:1], (part[:-1] + part[1:]) / 2, part[-1:]])
        start += n
