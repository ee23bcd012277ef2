"""Random smooth motions through the collisions of a problem, many at once, to start from.

A motion has durations, points at the start, the collisions and the goal, velocities there that obey
the law of impact, and between them cubics with a few waves on top.  There are five kinds in turn.
*Straight* ones have lines instead of cubics, and no inputs; the lines meet at any places, and not
on the surfaces, as far away as light links swing.  Where there are no hits, they have one bump of a
coordinate in a phase, up or down, or none.  *Shaken* ones are an automatic guess with waves, other
durations and less of its inputs.  *Driven* ones know nothing but the statement: they have waves
s (1 - s) sin(m pi s) in each phase, which leave the points on their surfaces, and the inputs of the
equations of motion by least squares, within their bounds; *idle* ones are the same without inputs;
*loose* ones have waves sin(m pi s) over the whole time, which leave the surfaces, and no inputs
either.  No kind is best for all problems.
Motion k of a seed is the same whichever others are asked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.guess.contacts import all_in_contact
from dmoc.guess.inverse_dynamics import acting, inputs_for
from dmoc.guess.neighbours import WAVES, shaken
from dmoc.guess.waypoints import end_velocity
from dmoc.mechanics.algebra import solved
from dmoc.mechanics.attitudes import bulge, on_sphere
from dmoc.mechanics.contacts import NOWHERE
from dmoc.mechanics.projection import onto
from dmoc.problem.contacts import onto_switch
from dmoc.problem.design import designed, drawn
from dmoc.problem.problem import Problem
from dmoc.problem.quantities import onto_quantities
from dmoc.problem.ranges import midpoints
from dmoc.problem.reach import enter_linearly
from dmoc.program.layout import Layout

# Largest ratio of the longest and the shortest final time that is tried where bounds leave it open.
TIMES = 10.0
# Spread of the logarithm of the shares of time of the phases: some are short, of straight ones
# fewer.
SHARES, EVENER = 1.3, 0.8
# Distances of points from the straight way, and amplitudes of waves, in reaches of the coordinates:
# each motion has its own size between the two, evenly by its logarithm (loose and straight ones are
# larger), and its own number of waves.  On pendulums, carts and an acrobot smaller ones find
# nothing new, larger ones hardly anything.
SMALLEST, LOOSEST, LARGEST = 0.05, 0.3, 1.6
# Kinds of motions, and those of the numbers in turn.  On arms of two and three links straight ones
# have met the rarest minima, where they are half of all more often than where they are fewer:
# places that are put on the surfaces lead to few of them.
STRAIGHT, SHAKEN, IDLE, LOOSE, DRIVEN = range(5)
IN_TURN = (SHAKEN, STRAIGHT, DRIVEN, STRAIGHT, IDLE, STRAIGHT, LOOSE, STRAIGHT)
# Those of few motions, and of motions that begin relaxed programs.
FEW_IN_TURN = (SHAKEN, IDLE, LOOSE, DRIVEN)
# Spread of the logarithm of the durations of a shaken motion.
SHAKE = 0.7
# What a seed of inputs has behind the number of its motion.
INPUTS = 1
# Speed towards a surface that a motion has at least, relative to that of its straight way.
APPROACH = 0.3


def random_motions(
    problem: Problem,
    guesses: Sequence[Array],
    natural: float,
    numbers: range,
    seed: int = 0,
    in_turn: Sequence[int] = IN_TURN,
) -> Array:
    """Unknowns of the random motions with the given numbers, shape (len(numbers), n), of kinds in
    turn.

    ``guesses`` are unknowns that are shaken, shape (n,) each; ``natural`` is a final time in
    seconds around which motions are made where the problem does not bound it.
    """
    if not numbers:
        return np.zeros((0, Layout.of(problem).size))
    if problem.design:  # each motion has its own
        draws = [drawn(problem, np.random.default_rng([seed, k])) for k in numbers]
        return np.vstack(
            [
                _random_motions(
                    designed(problem, own), guesses, natural, range(k, k + 1), seed, in_turn
                )
                for k, own in zip(numbers, draws, strict=True)
            ]
        )
    return _random_motions(problem, guesses, natural, numbers, seed, in_turn)


def _random_motions(
    problem: Problem,
    guesses: Sequence[Array],
    natural: float,
    numbers: range,
    seed: int,
    in_turn: Sequence[int],
) -> Array:
    lay = Layout.of(problem)
    x = np.empty((len(numbers), lay.size))
    kinds = kinds_of(numbers, in_turn)
    is_shaken = (kinds == SHAKEN) & bool(guesses)
    with np.errstate(all="ignore"):
        for i in np.flatnonzero(is_shaken):
            k = numbers[i]
            guess = guesses[k // len(in_turn) % len(guesses)]
            x[i] = _shaken(problem, lay, guess, np.random.default_rng([seed, k]))
        others = [numbers[i] for i in np.flatnonzero(~is_shaken)]
        if others:
            some = _Drawn.of(problem, natural, others, kinds[~is_shaken], seed)
            x[~is_shaken] = _unknowns(problem, lay, some)
        if not enter_linearly(problem):
            rngs = (np.random.default_rng([seed, k, INPUTS]) for k in numbers)
            x = np.array([acting(problem, row, r) for row, r in zip(x, rngs, strict=True)])
        return all_in_contact(problem, x)


def kinds_of(numbers: Sequence[int], in_turn: Sequence[int] = IN_TURN) -> NDArray[np.intp]:
    """The kinds of the motions with the given numbers, shape (numbers,)."""
    kinds: NDArray[np.intp] = np.array(in_turn, np.intp)[np.array(numbers, int) % len(in_turn)]
    return kinds


def _shaken(problem: Problem, lay: Layout, guess: Array, rng: np.random.Generator) -> Array:
    """A guess with waves, other durations and less of its inputs."""
    size = SMALLEST * (LARGEST / SMALLEST) ** rng.random()
    sizes, spreads = np.array([size]), np.array([SHAKE])
    x: Array = shaken(problem, lay, guess[None], [rng], sizes, spreads)[0]
    x[lay.index_design] = problem.design_values
    x[lay.index_u] *= rng.uniform(-1, 1)
    return x


@record(frozen=True, eq=False)
class _Drawn:
    """Durations (count, phases); points (count, phases + 1, nq); velocities after and before them,
    at both ends of each phase (count, phases, nq); waves of the phases (count, phases, WAVES, nq)
    and of the whole time (count, WAVES, nq); impulses (count, collisions); whether there are inputs
    (count,), and whether it is straight."""

    durations: Array
    points: Array
    v_first: Array
    v_last: Array
    waves: Array
    whole: Array
    lam: Array
    driven: NDArray[np.bool_]
    straight: NDArray[np.bool_]

    @classmethod
    def of(
        cls,
        problem: Problem,
        natural: float,
        numbers: Sequence[int],
        kind: NDArray[np.intp],
        seed: int,
    ) -> _Drawn:
        draws = [np.random.default_rng([seed, k]) for k in numbers]
        phases, nq = problem.phases, problem.nq
        uniform = np.array([r.random(3 + 2 * nq) for r in draws])
        normal = np.array([r.standard_normal((phases + 1, nq)) for r in draws])
        shares = np.array([r.standard_normal(phases) for r in draws])
        waves = np.array([r.standard_normal((phases, WAVES, nq)) for r in draws])
        straight, loose = kind == STRAIGHT, kind == LOOSE
        smallest = np.where(straight | loose, LOOSEST, SMALLEST)
        size = smallest * (LARGEST / smallest) ** uniform[:, 1]
        shares *= np.where(straight, EVENER, SHARES)[:, None]
        durations = _durations(problem, natural, uniform[:, 0], shares)
        spread = size[:, None] * np.where(straight[:, None], problem.spread, problem.reach)
        away = normal * spread[:, None]
        points = _points(problem, durations, uniform[:, 3:], away, ~straight)
        waves = waves * (problem.reach * size[:, None])[:, None, None, :]
        waves /= np.arange(1, WAVES + 1)[:, None]
        waves *= (np.arange(WAVES) <= WAVES * uniform[:, 2, None])[:, None, :, None]
        waves[straight] = 0.0
        waves[straight, :, 0] = _bumps(problem, draws, spread)[straight]
        whole = np.where(loose[:, None, None], waves[:, 0], 0.0)
        waves[loose] = 0.0
        legs = np.diff(points, axis=1) / np.where(durations > 0, durations, 1.0)[:, :, None]
        v_first, v_last, lam = _velocities(problem, durations, points, legs)
        return cls(durations, points, v_first, v_last, waves, whole, lam, kind == DRIVEN, straight)

    def of_rows(self, rows: NDArray[np.bool_]) -> _Drawn:
        """The motions of a mask of shape (count,)."""
        return _Drawn(*(getattr(self, f.name)[rows] for f in fields(self)))


def _bumps(problem: Problem, draws: Sequence[np.random.Generator], spread: Array) -> Array:
    """Bumps up and down of the coordinates in the phases, or none, shape (count, phases, nq); none
    where there are places of hits."""
    shape = (problem.phases, problem.nq)
    if any(event.impact for event in problem.touch.events):
        return np.zeros((len(draws), *shape))
    signs = np.array([r.integers(-1, 2, shape) for r in draws])
    return np.asarray(signs * spread[:, None])


def _durations(problem: Problem, natural: float, uniform: Array, shares: Array) -> Array:
    """Final times between their bounds, evenly by the logarithm, split into random shares; none for
    a last phase without steps."""
    if problem.ends_with_event:
        every = _durations_of(
            problem, natural, uniform, shares[:, :-1], problem.duration_bounds[:-1]
        )
        return np.hstack([every, np.zeros((len(every), 1))])
    return _durations_of(problem, natural, uniform, shares, problem.duration_bounds)


def _durations_of(
    problem: Problem, natural: float, uniform: Array, shares: Array, each: Array
) -> Array:
    """Durations of phases with bounds ``each``, shape (phases, 2), of shape (count, phases)."""
    low, high = problem.final_time_bounds
    low, high = max(low, each[:, 0].sum()), min(high, each[:, 1].sum())
    high = high if np.isfinite(high) else max(TIMES**0.5 * natural, low * TIMES)
    low = max(low, high / TIMES**2 if high < natural else min(natural, high) / TIMES)
    total = low * (high / low) ** np.sqrt(uniform) if high > low else np.full(len(uniform), high)
    parts = np.exp(shares - shares.mean(axis=1, keepdims=True))
    durations = np.clip(total[:, None] * parts / parts.sum(axis=1, keepdims=True), *each.T)
    return np.asarray(durations)


def _points(
    problem: Problem,
    durations: Array,
    uniform: Array,
    away: Array,
    on: NDArray[np.bool_],
) -> Array:
    """Points at the start and the goal within their bounds, and between them beside the straight
    way, those of some motions on the surfaces."""
    nq = problem.nq
    ends: list[Array] = []
    for k, end, share in ((0, "start", uniform[:, :nq]), (-1, "goal", uniform[:, nq:])):
        low, high = getattr(problem, f"{end}_bounds").position.T
        bounded = np.isfinite(low) & np.isfinite(high)
        inside = np.where(bounded, low, 0.0) + share * np.where(bounded, high - low, 0.0)
        free = ends[0] if ends else problem.start_position
        # A far bound of one side holds nothing.
        drawn = np.where(bounded, inside, np.clip(free + away[:, k], low, high))
        ends.append(onto_quantities(problem, end, drawn))
    part = np.cumsum(durations, axis=1) / durations.sum(axis=1, keepdims=True)
    part = np.hstack([np.zeros((len(part), 1)), part])[:, :, None]
    a, b = (on_sphere(problem.kernels, end)[:, None] for end in ends)
    points = (1 - part) * a + part * b + bulge(problem.kernels, a, b, part)
    times = np.cumsum(durations, axis=1)
    for i, event in enumerate(problem.touch.events):
        if event.switch != NOWHERE:
            points[:, i + 1] += away[:, i + 1]
            rates = (ends[1] - ends[0]) / times[:, -1:]
            state = points[on, i + 1], rates[on], times[on, i]
            if on.any():
                points[on, i + 1] = onto_switch(problem, *state, event.switch)
        if not event.impact:
            continue
        j = event.surface
        points[:, i + 1] += away[:, i + 1]
        if on.any():
            points[on, i + 1] = _onto(problem, points[on, i + 1], times[on, i], j)
    if problem.ends_with_event:
        points[:, -1] = points[:, -2]
    return points


def _onto(problem: Problem, q: Array, t: Array, j: int) -> Array:
    """Points of a surface near rows of points, by steps along the gradient in reaches."""

    def conditions(q: Array) -> tuple[Array, Array]:
        return problem.model.gaps(q, t)[:, [j]], problem.model.gap_slopes(q, t)[:, [j], :-1]

    return onto(conditions, q, problem.reach, longest=1.0)


def _velocities(
    problem: Problem, durations: Array, points: Array, legs: Array
) -> tuple[Array, Array, Array]:
    """Velocities at the start and at the end of every phase, shape (count, phases, nq) each, and
    impulses, shape (count, phases - 1). They are given at the ends of the motion; before a
    collision they are the mean of the ways before and after it in the mirror, after it those of the
    law of impact."""
    count, phases, nq = legs.shape
    v_first, v_last = np.empty_like(legs), np.empty_like(legs)
    lam = np.zeros((count, phases - 1))
    v_first[:, 0] = end_velocity(
        problem, problem.start_bounds, problem.start_position, np.zeros(nq)
    )
    default = end_velocity(
        problem, problem.goal_bounds, midpoints(problem.goal_bounds.position, np.zeros(nq)),
        np.full(nq, np.nan),
    )  # fmt: skip
    v_last[:, -1] = np.where(np.isnan(default), legs[:, -1], default)
    times = np.cumsum(durations, axis=1)
    for i, event in enumerate(problem.touch.events):
        if not event.impact:
            v_last[:, i] = v_first[:, i + 1] = (legs[:, i] + legs[:, i + 1]) / 2
            continue
        j = event.surface
        q, t = points[:, i + 1], times[:, i]
        slope = problem.model.gap_slopes(q, t)[:, j]
        n, moving = slope[:, :-1], slope[:, -1]
        response = solved(problem.model.mass(q, t), n)
        inertia = (n * response).sum(axis=1)
        inertia = np.where(inertia > 0, inertia, np.inf)[:, None]
        after = (n * legs[:, i + 1]).sum(axis=1, keepdims=True)
        mirrored = legs[:, i + 1] - 2 * after / inertia * response
        v = (legs[:, i] + mirrored) / 2 if durations[0, i + 1] else legs[:, i]
        rate = (n * v).sum(axis=1) + moving
        least = APPROACH * np.abs(n * legs[:, i]).sum(axis=1)
        v = v + (np.maximum(rate, least) - rate)[:, None] / inertia * response
        rate = np.maximum(rate, least)
        e = problem.model.coefficients(problem.restitution_values, q, v, t)[:, j]
        lam[:, i] = (1 + (e if event.hit == j else 0.0)) * rate / inertia[:, 0]
        v_last[:, i], v_first[:, i + 1] = v, v - lam[:, i, None] * response
    if problem.ends_with_event:
        v_last[:, -1] = v_first[:, -1]
    return v_first, v_last, lam


def _along(drawn: _Drawn, i: int, s: Array, order: int = 0) -> Array:
    """Positions of phase i at shares s of it, without the waves of the whole time, and so many of
    their derivatives by time, shape (order + 1, count, len(s), nq)."""
    T = drawn.durations[:, i, None, None]
    q0, q1 = drawn.points[:, i, None], drawn.points[:, i + 1, None]
    rates = drawn.v_first[:, i, None] * T, drawn.v_last[:, i, None] * T
    d0, d1 = (np.where(drawn.straight[:, None, None], q1 - q0, rate) for rate in rates)
    cubic = [q0, d0, 3 * (q1 - q0) - 2 * d0 - d1, 2 * (q0 - q1) + d0 + d1]
    parts = np.concatenate([*cubic, 4 * drawn.waves[:, i]], axis=1)
    m = np.pi * np.arange(1, WAVES + 1)
    s = s[:, None]
    sin, cos = np.sin(s * m), np.cos(s * m)
    bump, slope, one, none = s * (1 - s), 1 - 2 * s, np.ones_like(s), np.zeros_like(s)
    shapes = [
        [one, s, s**2, s**3, bump * sin],
        [none, one, 2 * s, 3 * s**2, slope * sin + bump * m * cos],
        [none, none, 2 * one, 6 * s, -2 * sin + 2 * slope * m * cos - bump * m * m * sin],
    ]
    return np.stack([np.hstack(shapes[k]) @ parts / T**k for k in range(order + 1)])


def _everywhere(drawn: _Drawn, times: Array) -> Array:
    """The waves of the whole time at times, shape (count, len(times), nq)."""
    m = np.pi * np.arange(1, WAVES + 1)
    shares = times / drawn.durations.sum(axis=1, keepdims=True)
    return np.asarray(np.sin(shares[:, :, None] * m) @ drawn.whole)


def _unknowns(problem: Problem, lay: Layout, drawn: _Drawn) -> Array:
    count, degree = len(drawn.durations), lay.scheme.degree
    x = np.tile(lay.zeros(problem), (count, 1))
    x[:, lay.index_h] = lay.step_sizes(drawn.durations)
    begin = np.cumsum(np.hstack([np.zeros((count, 1)), drawn.durations]), axis=1)
    inside = np.sort(lay.scheme.nodes)[:-1]
    for i, n in enumerate(lay.steps[: lay.stepped]):
        shares = np.append((np.arange(n)[:, None] + inside) / n, 1.0)
        t = begin[:, i, None] + drawn.durations[:, i, None] * shares
        at = lay.index_places[lay.places_of_phase(i)]
        a, b = drawn.points[:, i, None], drawn.points[:, i + 1, None]
        arc = bulge(problem.kernels, a, b, shares[None, :, None])
        x[:, at] = _along(drawn, i, shares)[0] + _everywhere(drawn, t) + arc
        if lay.timed:
            x[:, lay.index_t[lay.ends[i] : lay.ends[i + 1] + 1]] = t[:, ::degree]
    x[:, lay.index_u] = _inputs(problem, lay, drawn, begin)
    x[:, lay.impact.lam] = drawn.lam
    x[:, lay.impact.v_a], x[:, lay.impact.v_c] = drawn.v_last[:, :-1], drawn.v_first[:, 1:]
    for k, v, index_p, index_v in (
        (0, drawn.v_first[:, 0], lay.index_p_B, lay.index_v_B),
        (-1, drawn.v_last[:, -1], lay.index_p_E, lay.index_v_E),
    ):
        x[:, index_p] = problem.models[k].momentum(drawn.points[:, k], v, begin[:, k])
        if len(index_v):
            x[:, index_v] = v
    return x


def _inputs(problem: Problem, lay: Layout, drawn: _Drawn, begin: Array) -> Array:
    """Inputs in the rows of their form; of driven motions those that come closest to the
    accelerations in the middle of the step of each row."""
    nu, steps = problem.nu, lay.step_of_input
    u = np.zeros((len(drawn.durations), len(steps), nu))
    driven = drawn.of_rows(drawn.driven)
    if nu and drawn.driven.any():
        inputs = []
        for i, n in enumerate(lay.steps[: lay.stepped]):
            middle = (np.arange(n) + 0.5) / n
            q, v, a = _along(driven, i, middle, 2).reshape(3, -1, lay.nq)
            t = begin[drawn.driven, i, None] + driven.durations[:, i, None] * middle
            own = inputs_for(problem, problem.models[i], q, v, a, t.reshape(-1))
            inputs.append(own.reshape(-1, n, nu))
        u[drawn.driven] = np.concatenate(inputs, axis=1)[:, steps]
    return np.clip(u, *problem.input_bounds.T)
