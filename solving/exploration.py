"""Many starts on a coarse mesh, and the minima they lead to, ranked on a finer one.

Only local minima are found from any start (Kern & Gross 2018, "only local minima found").  What
many starts find is as good as their number: no better minimum was met, which is no proof that there
is none.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.nlp.guess import initial_guesses, natural_time
from dmoc.nlp.march import Planner
from dmoc.nlp.motions import random_motions
from dmoc.nlp.problem import Problem
from dmoc.nlp.readout import trajectory
from dmoc.nlp.scaling import scale_of
from dmoc.nlp.transfer import pieces_of, unknowns_along
from dmoc.solution import Minimum, Solution
from dmoc.solvers.outcome import Options, Status
from dmoc.solving.attempts import Attempt, Minimise, minimised
from dmoc.solving.methods import METHODS
from dmoc.solving.program import Programs
from dmoc.solving.result import checked, solution_of

COMPILED_METHOD = METHODS["ipm"]
# Random starts, beside the automatic guesses, where their number is not given: the first ones; all
# of them, where those do not agree; and more, where none of these has led to a motion.
FIRST, ALL, MORE = 16, 100, 300
# Share of the starts that agree on the best minimum where no more are needed.
AGREEING = 0.75
# Steps of a phase of the coarse mesh: so many in all phases, but a phase gets enough to bend; and
# of the mesh on which minima are ranked.
COARSE, FEWEST, RANKING = 48, 12, 100
COARSEST = 24
# Iterations of a start: few that take more end in a minimum, hardly ever in a good one.
ITERATIONS = 100
# Relative differences of costs and of durations that belong to the same minimum.
SAME_COST, SAME_TIMES = 1e-5, 1e-3
# Minima that are refined at least, and at most, where cheaper coarse ones are left.
REFINED, MOST_REFINED = 4, 16
# Limits of inputs are widened by the first factor and tightened by the others where nothing else
# has helped, with so many starts, of which so many minima are followed.
WIDER = (4.0, 2.8, 2.0, 1.6, 1.3, 1.12, 1.0)
WIDE_STARTS, FOLLOWED = 32, 8


@dataclass(frozen=True)
class Exploration:
    """What the starts have led to.

    Attributes
    ----------
    ranked : tuple of Solution
        Minima on the ranking mesh, the best first: confirmed ones before others.
    found : tuple of int
        How many starts have led to each.
    coarse : tuple of Minimum
        Minima that were not refined.
    starts : int
    """

    ranked: tuple[Solution, ...]
    found: tuple[int, ...]
    coarse: tuple[Minimum, ...]
    starts: int

    def told(self, best: int) -> str:
        """What the answer is among the minima, in a sentence."""
        if best >= len(self.ranked):
            return f"none of {self.starts} starts on a coarse mesh led to a motion"
        count = len(self.ranked) + len(self.coarse)
        found = f"{self.found[best]} of {self.starts} starts led to it"
        if count == 1:
            return f"{found}, none to another one"
        return f"{found}, others to {count - 1} other{'s' if count > 2 else ''}"

    def others(self, best: int) -> tuple[Minimum, ...]:
        """The minima other than the answer, the cheapest first."""
        refined = [
            Minimum(s.cost, n, s.status, tuple(p.steps for p in s.phases))
            for i, (s, n) in enumerate(zip(self.ranked, self.found, strict=True))
            if i != best
        ]
        return tuple(sorted((*refined, *self.coarse), key=lambda m: m.cost))


@dataclass(frozen=True)
class _Class:
    """Attempts that ended in the same minimum: the first one, how many, its cost in units."""

    attempt: Attempt
    cost: float
    durations: Array
    found: int = 1

    @classmethod
    def of(cls, attempt: Attempt) -> _Class:
        nlp, x = attempt.nlp, attempt.outcome.x
        h = nlp.physical(x)[nlp.layout.index_h]
        return cls(attempt, nlp.cost(x) * nlp.scale.cost, h * np.array(nlp.layout.steps))

    def same(self, other: _Class, size: float) -> bool:
        """Whether both are the same minimum, with costs that are compared with a size."""
        near = SAME_TIMES * float(self.durations.sum())
        costs = abs(self.cost - other.cost) <= SAME_COST * max(abs(self.cost), size)
        return costs and bool((np.abs(self.durations - other.durations) <= near).all())


def explored(
    problem: Problem, starts: int | None, seed: int, options: Options, verify: bool
) -> Exploration:
    """Look for minima from many starts.

    Parameters
    ----------
    problem : Problem
        With compiled kernels.
    starts : int or None
        All starts, the automatic guesses among them; None for as many as it seems to take.
    seed : int
    options : Options
        Tolerances of the minima, and limits: half of its seconds are used.
    verify : bool
        Whether minima are checked by simulation before they are ranked.

    Raises
    ------
    KeyboardInterrupt
        If a solve is interrupted.
    """
    seconds = np.inf if options.seconds is None else options.seconds / 2
    deadline = time.perf_counter() + seconds
    minima, tried = _minima(problem, starts, seed, options, deadline)
    ranked, left = _ranked(problem, minima, options, verify, deadline)
    coarse = tuple(Minimum(c.cost, c.found, None, c.attempt.nlp.problem.phase_steps) for c in left)
    return Exploration(tuple(s for s, _ in ranked), tuple(n for _, n in ranked), coarse, tried)


# On the coarse mesh -------------------------------------------------------------------------------


def _minima(
    problem: Problem, starts: int | None, seed: int, options: Options, deadline: float
) -> tuple[list[_Class], int]:
    """Distinct minima on the coarse mesh, the cheapest first, and the number of starts."""
    coarse = problem.but(steps=_coarse_steps(problem))
    guesses = [g.x for g in initial_guesses(coarse, deadline)]
    programs = Programs(coarse, scale_of(coarse, guesses[0]))
    natural = natural_time(Planner.of(coarse))
    few = replace(options, iterations=min(options.iterations, ITERATIONS), progress=None)
    if starts is None:
        ends = [FIRST, ALL, MORE]
    else:
        ends = [max(starts - len(guesses), 0)]
        guesses = guesses[:starts]
    classes, tried = _gathered([], _solved(programs, guesses, few, deadline)), len(guesses)
    begin = 0
    for end in ends:
        x = random_motions(coarse, natural, range(begin, end), seed)
        before = tried
        for attempt in _solved(programs, x, few, deadline):
            classes = _gathered(classes, [attempt])
            tried += 1
        begin = end
        enough = bool(classes) and (end >= ALL or classes[0].found >= AGREEING * tried)
        if enough or tried - before < len(x):
            break
    if not classes and starts is None:
        classes = _continued(coarse, natural, seed, few, deadline)
    return classes, tried


def _coarse_steps(problem: Problem) -> list[int]:
    few = min(COARSEST, max(COARSE // problem.phases, FEWEST))
    return [min(n, few) for n in problem.phase_steps]


def _solved(
    programs: Programs, points: Iterable[Array], options: Options, deadline: float
) -> Iterable[Attempt]:
    """Attempts from some points in units of the problem, as long as there is time."""
    nlp = programs.program()
    minimise = _compiled()
    for x in points:
        left = deadline - time.perf_counter()
        if left <= 0:
            return
        limited = options if np.isinf(left) else replace(options, seconds=left)
        attempt = minimised(programs, nlp, nlp.scaled(x), limited, minimise)
        if attempt.outcome.status is Status.INTERRUPTED:
            raise KeyboardInterrupt
        yield attempt


def _compiled() -> Minimise:
    driver = COMPILED_METHOD.minimise()
    return lambda nlp, x, options: driver(nlp, x, options, None)


def _gathered(classes: list[_Class], attempts: Iterable[Attempt]) -> list[_Class]:
    """The distinct minima, the cheapest first, with some attempts more."""
    for attempt in attempts:
        if attempt.outcome.status is not Status.SOLVED:
            continue
        found = _Class.of(attempt)
        size = attempt.nlp.scale.cost
        for i, known in enumerate(classes):
            if known.same(found, size):
                classes[i] = replace(known, found=known.found + 1)
                break
        else:
            classes = sorted([*classes, found], key=lambda c: c.cost)
    return classes


def _continued(
    coarse: Problem, natural: float, seed: int, options: Options, deadline: float
) -> list[_Class]:
    """Minima that are left when wide limits of the inputs are tightened step by step."""
    if not np.isfinite(coarse.input_bounds).any():
        return []
    wide = _widened(coarse, WIDER[0])
    guesses = [g.x for g in initial_guesses(wide, deadline)]
    x = random_motions(wide, natural, range(WIDE_STARTS), seed)
    scale = scale_of(wide, guesses[0])
    classes = _gathered([], _solved(Programs(wide, scale), [*guesses, *x], options, deadline))
    for factor in WIDER[1:]:
        points = [c.attempt.nlp.physical(c.attempt.outcome.x) for c in classes[:FOLLOWED]]
        programs = Programs(_widened(coarse, factor), scale)
        classes = _gathered([], _solved(programs, points, options, deadline))
    return classes


def _widened(problem: Problem, factor: float) -> Problem:
    """The problem with wider limits of its inputs."""
    low, high = problem.input_bounds.T
    sizes = [np.where(np.isfinite(limit), np.abs(limit), 0.0) for limit in (low, high)]
    width = np.where(np.isfinite(high - low), (high - low) / 2, np.maximum(*sizes))
    more = (factor - 1) * width
    names = problem.kernels.inputs
    boxes = dict(zip(names, zip(low - more, high + more, strict=True), strict=True))
    return problem.but(bounds={**problem.bounds, **boxes})


# On the mesh where they are ranked ----------------------------------------------------------------


def _ranked(
    problem: Problem,
    minima: Sequence[_Class],
    options: Options,
    verify: bool,
    deadline: float,
) -> tuple[list[tuple[Solution, int]], Sequence[_Class]]:
    """Solutions from the minima with the number of starts, the best first, and the minima that were
    not refined."""
    mesh = problem.but(steps=[min(n, RANKING) for n in problem.phase_steps])
    refined: list[tuple[_Class, Solution, int]] = []
    for k, coarse in enumerate(minima):
        confirmed = [s.cost for _, s, _ in refined if s.minimum]
        passed = bool(confirmed) and coarse.cost > min(confirmed) and k >= REFINED
        if passed or k >= MOST_REFINED or time.perf_counter() > deadline:
            return _sorted(refined), minima[k:]
        attempt = _refined(mesh, coarse.attempt, options)
        if attempt.outcome.status is not Status.SOLVED:
            continue
        new = _Class.of(attempt)
        for i, (known, s, n) in enumerate(refined):
            if known.same(new, attempt.nlp.scale.cost):
                refined[i] = known, s, n + coarse.found
                break
        else:
            s = solution_of(attempt, COMPILED_METHOD.name, {})
            refined.append((new, checked(s) if verify else s, coarse.found))
    return _sorted(refined), []


def _sorted(refined: Sequence[tuple[_Class, Solution, int]]) -> list[tuple[Solution, int]]:
    """Confirmed minima first, those whose collisions all have an effect before others, by cost."""
    pairs = [(s, n) for _, s, n in refined]
    return sorted(pairs, key=lambda p: (not p[0].minimum, p[0].status is Status.GRAZES, p[0].cost))


def _refined(mesh: Problem, coarse: Attempt, options: Options) -> Attempt:
    """Solve on a finer mesh from a motion on a coarse one."""
    motion = trajectory(coarse.nlp, coarse.outcome.x)
    impulses = [c.impulse for c in motion.collisions]
    x = unknowns_along(mesh, pieces_of(motion), impulses)
    programs = Programs(mesh, scale_of(mesh, x, True))
    nlp = programs.program()
    few = replace(options, progress=None)
    attempt = minimised(programs, nlp, nlp.scaled(x), few, _compiled())
    if attempt.outcome.status is Status.INTERRUPTED:
        raise KeyboardInterrupt
    return attempt
