"""Rounds of starts on a coarse mesh, and the minima that they lead to: random motions, and motions
beside the minima that were met before; where no start leads to one, motions within limits of the
inputs by way of wider ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dmoc.base.deadline import Deadline
from dmoc.base.records import value_class
from dmoc.codegen.kernels import Array
from dmoc.guess.automatic import initial_guesses, natural_time
from dmoc.guess.neighbours import neighbours
from dmoc.guess.random_motions import random_motions
from dmoc.problem.problem import Problem
from dmoc.program.scaling import scale_of
from dmoc.solvers.outcome import Options, Status
from dmoc.solving.attempts import Attempt
from dmoc.solving.multistart.effort import Effort
from dmoc.solving.multistart.minima import Basin, cost_of, gathered, joined
from dmoc.solving.multistart.parallel import attempts_from, free_threads
from dmoc.solving.multistart.ranking import RANKING, Refinements
from dmoc.solving.programs import Programs

# The coarse mesh is taken twice as fine, up to the ranking mesh, while the cost of its best minimum
# changes by more than such a part there: what coarse steps miss makes minima of its own.
MISSED = 0.05
# Iterations of a start, where one that takes more never led to the best minimum; and where contacts
# last or constraints hold: gaits take long.
USUAL, LASTING = 60, 300
ANY = 10**9  # more starts than there is time for
# Starts that were given up are so few, of all of a round, that further ones would take longer than
# what is left of them.
FEW = 0.25
# Waves beside minima get smaller by a factor where less than such a share of their solves end.
FEW_END, NARROWER = 0.6, 0.5
# Limits of inputs are widened by the first factor and tightened by the others, with so many starts,
# of which so many minima are followed.
WIDER = (4.0, 2.8, 2.0, 1.6, 1.3, 1.12, 1.0)
WIDE_STARTS, FOLLOWED = 32, 8


@value_class(frozen=True)
class Start:
    """One start: its name, how it ended, its cost on the coarse mesh where solved."""

    name: str
    status: Status
    cost: float | None


@dataclass
class Rounds:
    """Rounds of starts on a coarse mesh, and the distinct minima they have led to, the cheapest
    first; where there is none yet, further starts are tried until a later deadline."""

    refinements: Refinements
    effort: Effort
    options: Options
    seeking: Deadline
    coarse: Problem
    guesses: list[Array]
    natural: float
    programs: Programs
    named: dict[str, Array]  # starts that are not random
    given: tuple[str, ...]  # those of them that are tried to the end
    minima: list[Basin]
    starts: list[Start]
    random: int = 0  # motions of each kind so far
    beside: int = 0
    amplitude: float = 1.0  # of the waves beside minima
    unbeaten: int = 0  # starts since the best minimum was met first
    unfinished: bool = False  # there was no time for all starts

    @classmethod
    def begun(
        cls,
        refinements: Refinements,
        coarse: Problem,
        effort: Effort,
        options: Options,
        seeking: Deadline,
        points: Mapping[str, Array],
    ) -> Rounds:
        problem = refinements.problem
        # On a coarse mesh the energies of a long and of a short step tell little of the rates:
        # minima would live on what they miss, and be far from those of a finer mesh.
        if coarse.phase_steps != problem.phase_steps:
            coarse = coarse.in_rates()
        room = effort.guesses if effort.total is None else effort.total - len(points)
        guesses = [g.x for g in initial_guesses(coarse, options.deadline)][:room]
        named = {**points, **{f"automatic {i + 1}": x for i, x in enumerate(guesses)}}
        most = effort.iterations or (LASTING if problem.held else USUAL)
        few = replace(options, iterations=min(options.iterations, most))
        programs = Programs(coarse, scale_of(coarse, next(iter(named.values()))))
        natural = natural_time(coarse)
        return cls(
            refinements, effort, few, seeking, coarse, guesses, natural, programs, named,
            tuple(points), [], [],
        )  # fmt: skip

    def run(self) -> None:
        """Try starts until there are enough, or no time for more."""
        effort, self.unfinished = self.effort, False
        while self._round(*self._next()):
            enough = effort.suffices(self.minima, len(self.starts), self.unbeaten)
            if enough or not any(self._next()):
                break
            self._refine_mesh()
        else:
            self.unfinished = True
        if not self.minima and effort.widens:
            later = replace(self.options, deadline=self.seeking)
            self.minima = tightened(self.coarse, self.natural, effort.seed, later)

    def _next(self) -> tuple[int, int]:
        """Numbers of random starts of the next round, and of starts beside the minima."""
        effort = self.effort
        if effort.total is None:
            most = ANY if effort.lasts and self.minima else effort.most
            left = max(most - self.random - self.beside, 0)
        else:
            left = max(effort.total - len(self.named) - len(self.starts), 0)
        if not self.starts:  # of a number that is given, half at least
            first = effort.first if effort.total is None else max(effort.first, left // 2)
            return min(first, left), 0
        beside = min(effort.beside if self.minima else 0, left)
        # the first round has had random starts only; those that lead nowhere have no neighbours
        random = effort.random if self.beside else 0 if beside else effort.random + effort.beside
        return min(random, left - beside), beside

    def _round(self, random: int, beside: int) -> bool:
        """Try some random starts and some beside the minima, after those that are named; whether
        there was time for all."""
        named, seed = self.named, self.effort.seed
        numbers = range(self.random, self.random + random)
        kinds = self.effort.kinds
        x = random_motions(self.coarse, self.guesses, self.natural, numbers, seed, kinds)
        named |= {f"random {k + 1}": x_k for k, x_k in zip(numbers, x, strict=True)}
        if beside:
            at = range(self.beside, self.beside + beside)
            motions = [basin.motion for basin in self.minima]
            around = neighbours(self.coarse, motions, at, seed, self.amplitude)
            named |= {f"neighbour {k + 1}": x_k for k, x_k in zip(at, around, strict=True)}
        self.random, self.beside, self.named = numbers.stop, self.beside + beside, {}
        latest = self.options.deadline if self.minima else self.seeking
        hurried = [name not in self.given for name in named]
        points, met = list(named.values()), bool(self.minima)
        attempts = _attempts(self.programs, points, self.options, latest, hurried, met)
        for place, (name, attempt) in enumerate(zip(named, attempts, strict=False)):
            self.starts.append(_start(name, attempt))
            best = self.minima[0] if self.minima else None
            ended = attempt.status is Status.SOLVED
            if ended:
                far = place < len(named) - beside
                self.minima = joined(self.minima, Basin.of(attempt, name, far))
            better = ended and not (best and best.at_most(self.minima[0]))
            self.unbeaten = 0 if better else self.unbeaten + 1
        led = sum(a.status is Status.SOLVED for a in attempts[len(named) - beside :])
        if len(attempts) == len(named) and led < FEW_END * beside:
            self.amplitude *= NARROWER
        if not self.minima and len(x):  # the first guess may be so small beside motions that exist
            self.programs = Programs(self.coarse, scale_of(self.coarse, x[-1]))
        return len(attempts) == len(named)

    def _refine_mesh(self) -> None:
        """Go on with twice as many steps where the best minimum costs something else on the mesh
        where it is ranked."""
        most = [min(n, RANKING) for n in self.refinements.problem.phase_steps]
        steps = [min(2 * n, m) for n, m in zip(self.coarse.phase_steps, most, strict=True)]
        if not self.minima or tuple(steps) == self.coarse.phase_steps:
            return
        best = self.minima[0]
        fine = self.refinements.of(best, self.options)
        if fine.status is Status.SOLVED:
            there = Basin.of(fine)
            if best.at_most(there, MISSED) and there.at_most(best, MISSED):
                return
        finer = self.coarse.meshed(steps)
        minima = Refinements(finer).merged(self.minima, self.options)
        if minima:
            self.coarse, self.minima, self.unbeaten = finer, minima, 0
            self.programs = Programs(finer, minima[0].attempt.nlp.scale)
            self.guesses = [g.x for g in initial_guesses(finer, self.options.deadline)]


def _attempts(
    programs: Programs,
    points: Sequence[Array],
    options: Options,
    latest: Deadline,
    hurried: Sequence[bool],
    met: bool,
) -> list[Attempt]:
    """Attempts from some points in their order, as many as there is time for; until a later
    deadline those that follow, as long as none is solved.  As long as no minimum was met before,
    those in a hurry that were given up are tried to the end where none is solved, or where all
    others lead to one minimum."""
    attempts = attempts_from(programs, points, options, hurried)
    again = [k for k, attempt in enumerate(attempts) if _given_up(attempt, options)]
    if again and not met and (not _lead_on(attempts) or _agree(attempts, len(again))):
        ends = attempts_from(programs, [points[k] for k in again], options)
        for k, end in zip(again, ends, strict=False):
            attempts[k] = end
    later, at_once = replace(options, deadline=latest), free_threads()
    while len(attempts) < len(points) and not latest.passed:
        if _lead_on(attempts):
            break
        some = points[len(attempts) : len(attempts) + at_once]
        attempts += attempts_from(programs, some, later)
    return attempts


def _lead_on(attempts: Sequence[Attempt]) -> bool:
    """Whether one of some attempts is solved."""
    return any(attempt.status is Status.SOLVED for attempt in attempts)


def _agree(attempts: Sequence[Attempt], given_up: int) -> bool:
    """Whether all attempts lead to one minimum, but for a few that were given up."""
    if given_up > FEW * len(attempts):
        return False
    minima = gathered([], attempts)
    return len(minima) == 1 and minima[0].starts == len(attempts) - given_up


def _given_up(attempt: Attempt, options: Options) -> bool:
    """Whether an attempt has ended before its limit of iterations, as at it."""
    outcome = attempt.outcome
    return attempt.status is Status.ITERATION_LIMIT and outcome.iterations < options.iterations


def _start(name: str, attempt: Attempt) -> Start:
    solved = attempt.status is Status.SOLVED
    return Start(name, attempt.status, cost_of(attempt) if solved else None)


def tightened(coarse: Problem, natural: float, seed: int, options: Options) -> list[Basin]:
    """Minima that are left when wide limits of the inputs are tightened step by step."""
    if not np.isfinite(coarse.input_bounds).any():
        return []
    wide = _widened(coarse, WIDER[0])
    points = [g.x for g in initial_guesses(wide, options.deadline)]
    scale = scale_of(wide, points[0])
    points += list(random_motions(wide, points, natural, range(WIDE_STARTS), seed))
    minima = list[Basin]()
    for factor in WIDER:
        narrower = _widened(coarse, factor)
        minima = gathered([], attempts_from(Programs(narrower, scale), points, options))
        points = [b.motion for b in minima[:FOLLOWED]]
        if not points:
            break
    return minima


def _widened(problem: Problem, factor: float) -> Problem:
    """The problem with wider limits of its inputs."""
    low, high = problem.input_bounds.T
    sizes = [np.where(np.isfinite(limit), np.abs(limit), 0.0) for limit in (low, high)]
    width = np.where(np.isfinite(high - low), (high - low) / 2, np.maximum(*sizes))
    more = (factor - 1) * width
    names = problem.kernels.inputs
    boxes = dict(zip(names, zip(low - more, high + more, strict=True), strict=True))
    return problem.but(bounds={**problem.bounds, **boxes})
