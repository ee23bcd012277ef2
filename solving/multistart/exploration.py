"""Many starts on a coarse mesh, and the minima they lead to, ranked on a finer one.

Only local minima are found from any start (Kern & Gross 2018, "only local minima found").  What
many starts find is as good as their number: no better minimum was met, which is no proof that there
is none.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dmoc.base.deadline import Deadline
from dmoc.base.records import record
from dmoc.check.verdict import PASSING
from dmoc.codegen.kernels import Array
from dmoc.guess.automatic import initial_guesses, natural_time
from dmoc.guess.random_motions import random_motions
from dmoc.guess.transfer import on_mesh
from dmoc.problem.problem import Problem
from dmoc.program.scaling import scale_of
from dmoc.results.solution import Minimum, Solution
from dmoc.solvers.outcome import UNREFINED, Options, Status
from dmoc.solving.attempts import Attempt
from dmoc.solving.multistart.minima import Basin, cost_of, gathered
from dmoc.solving.multistart.parallel import attempts_from, free_threads
from dmoc.solving.multistart.ranking import Ranked, Refinements, ranked
from dmoc.solving.programs import Programs

# Steps of a phase on the coarse mesh.  With 12, motions with many collisions mislead, and their
# refinement takes longer than is saved.
COARSE = 24
# Of steps that are held, with nodes inside, which have about three times the unknowns of others.
COARSE_HELD = 12
# Steps of a phase on the finest mesh that motions start on.
FINEST = 4 * COARSE
# So many minima of a coarse mesh at most are refined to see whether they are the same one, before
# more starts are tried.
FEW = 3
# Iterations of a start, where one that takes more never led to the best minimum; and where contacts
# last or constraints hold: gaits take long.
USUAL, LASTING = 60, 300
# Limits of inputs are widened by the first factor and tightened by the others where nothing else
# has helped, with so many starts, of which so many minima are followed.
WIDER = (4.0, 2.8, 2.0, 1.6, 1.3, 1.12, 1.0)
WIDE_STARTS, FOLLOWED = 32, 8
# Starts that are made before the clock is looked at, where a number of them is given.
TOGETHER = 400
# Share of the time that starts have, and the larger one where none has led to a motion: what is
# left then is for the refinement of the first one that does, or for what conflicts.
STARTING, SEEKING = 0.5, 0.9


@dataclass(frozen=True)
class Effort:
    """How many starts are tried, and what is done with what they find."""

    # Random starts: so many at first, the most where those do not agree on a minimum, more where
    # these have not met the best minimum often enough to think that there is none much rarer.
    first: int = 16
    most: int = 100
    more: int = 300
    often: int = 5
    # Share of the starts with a minimum that lead to the best one, and share of all starts, where
    # no more are needed.
    agreeing: float = 0.75
    leading: float = 0.4
    # Minima that are refined at least, and at most, where cheaper coarse ones are left.
    refined: int = 4
    most_refined: int = 16
    settles: bool = True  # minima that are not confirmed are looked at on a finer mesh
    widens: bool = True  # limits of inputs, to tighten them, where no start leads to a motion
    iterations: int | None = None  # of a start; by default as many as it seems to take
    guesses: int | None = None  # automatic ones that are tried at most
    total: int | None = None  # all starts, where their number is given
    seed: int = 0
    verifies: bool = True  # minima are checked by simulation before they are ranked

    @classmethod
    def of(cls, starts: int | None, seed: int, verifies: bool = True) -> Effort:
        """As many starts as it seems to take, or a given number."""
        return cls(widens=starts is None, total=starts, seed=seed, verifies=verifies)

    def agree(self, minima: Sequence[Basin], starts: int) -> bool:
        """Whether so many of the starts, and of those with a minimum, have met the best one."""
        best = _met_best(minima)
        share = self.agreeing * sum(basin.starts for basin in minima)
        return best > 0 and best >= max(share, self.leading * starts)


@dataclass(frozen=True)
class Start:
    """One start: its name, how it ended, its cost on the coarse mesh where solved."""

    name: str
    status: Status
    cost: float | None


@record(frozen=True, eq=False)
class Exploration:
    """What the starts have led to."""

    ranked: tuple[Ranked, ...]  # on the ranking mesh, the best first: confirmed ones before others
    coarse: tuple[Basin, ...]  # that were not refined, or could not be
    starts: tuple[Start, ...]
    late: bool = False  # the time was used up before any start led to a motion

    @property
    def breaks_through(self) -> bool:
        """Whether the simulation contradicts all minima, on finer meshes too, and the best one
        because it breaks a path constraint."""
        checks = [r.solution.verification for r in self.ranked if np.isinf(r.cost)]
        if not checks or len(checks) < len(self.ranked) or checks[0] is None:
            return False
        return checks[0].path_excess > PASSING["excess of a path constraint"]

    @property
    def solutions(self) -> tuple[Solution, ...]:
        return tuple(r.solution for r in self.ranked)

    def others(self, best: int) -> tuple[Minimum, ...]:
        """The minima other than the answer, the cheapest first."""
        others = [Minimum(c.cost, c.starts, UNREFINED, c.problem.phase_steps) for c in self.coarse]
        for i, r in enumerate(self.ranked):
            if i != best:
                s = r.solution
                others.append(Minimum(s.cost, r.minimum.starts, s.status, s.steps))
        return tuple(sorted(others, key=lambda m: m.cost))


def explored(
    problem: Problem,
    effort: Effort,
    options: Options,
    points: Mapping[str, Array] | None = None,
) -> Exploration:
    """Look for minima from many starts, which have half of the time, and more as long as none leads
    to a motion; ``points`` are further ones by name, unknowns of the problem on its coarse mesh.
    Where all minima go through what path constraints forbid, between the nodes of any mesh, they
    are looked for on a finer one.  An interrupted solve raises KeyboardInterrupt."""
    options = replace(options, progress=None)
    starting, seeking = (options.deadline.share(share) for share in (STARTING, SEEKING))
    mesh, points = coarse_of(problem), points or {}
    with np.errstate(all="ignore"):
        exploration = _explored(problem, mesh, effort, options, (starting, seeking), points)
        while effort.settles and exploration.breaks_through and not starting.passed:
            coarse, steps = mesh, _finer(problem, mesh)
            if not steps:
                break
            mesh = problem.meshed(steps)
            points = {name: on_mesh(mesh, coarse, x) for name, x in points.items()}
            if problem.steps is None:
                more = zip(problem.phase_steps, steps, strict=True)
                ranking = problem.meshed([max(n, own) for n, own in more])
            else:
                ranking = problem
            finer = _explored(ranking, mesh, effort, options, (starting, seeking), points)
            exploration = finer if finer.ranked else exploration
    return exploration


def _explored(
    problem: Problem,
    coarse: Problem,
    effort: Effort,
    options: Options,
    latest: tuple[Deadline, Deadline],
    points: Mapping[str, Array],
) -> Exploration:
    """What starts on a coarse mesh lead to, with the times that they have."""
    refinements, (starting, seeking) = Refinements(problem), latest
    within = replace(options, deadline=starting)
    minima, starts = _minima(refinements, coarse, effort, within, seeking, points)
    late = not minima and seeking.passed
    refined, left = ranked(refinements, minima, effort, options, starting)
    return Exploration(tuple(refined), tuple(left), tuple(starts), late)


def _finer(problem: Problem, coarse: Problem) -> list[int]:
    """Steps of the phases of the next mesh to start on; none where there is none."""
    steps = [2 * n for n in coarse.phase_steps]
    if problem.steps is not None:
        steps = [min(n, own) for n, own in zip(steps, problem.phase_steps, strict=True)]
    return steps if coarse.phase_steps != tuple(steps) and max(steps) <= FINEST else []


def coarse_of(problem: Problem) -> Problem:
    """The problem on the mesh of the exploration."""
    most = COARSE_HELD if problem.held and problem.scheme.inside else COARSE
    return problem.meshed([min(n, most) for n in problem.phase_steps])


# On the coarse mesh -------------------------------------------------------------------------------


def _minima(
    refinements: Refinements,
    coarse: Problem,
    effort: Effort,
    options: Options,
    seeking: Deadline,
    points: Mapping[str, Array],
) -> tuple[list[Basin], list[Start]]:
    """Distinct minima on the coarse mesh, the cheapest first, and the starts; where there is none
    yet, further starts are tried until a later deadline."""
    problem = refinements.problem
    # On a coarse mesh the energies of a long and of a short step tell little of the rates: minima
    # would live on what they miss, and be far from those of a finer mesh.
    if coarse.phase_steps != problem.phase_steps:
        coarse = coarse.in_rates()
    room = effort.guesses if effort.total is None else effort.total - len(points)
    guesses = [g.x for g in initial_guesses(coarse, options.deadline)][:room]
    natural = natural_time(coarse)
    most = effort.iterations or (LASTING if problem.held else USUAL)
    few = replace(options, iterations=min(options.iterations, most))
    named = {**points, **{f"automatic {i + 1}": x for i, x in enumerate(guesses)}}
    scale = scale_of(coarse, next(iter(named.values())))
    programs = Programs(coarse, scale)
    minima, starts = list[Basin](), list[Start]()
    begin, ends = 0, [effort.first, effort.most, effort.more]
    if effort.total is not None:
        last = max(effort.total - len(named), 0)
        ends = [*range(TOGETHER, last, TOGETHER), last]
    for end in ends:
        numbers = range(begin, max(end, begin))
        x = random_motions(coarse, guesses, natural, numbers, effort.seed)
        named |= {f"random {k + 1}": x_k for k, x_k in zip(numbers, x, strict=True)}
        latest = few.deadline if minima else seeking
        attempts = _attempts(programs, list(named.values()), few, latest)
        starts += [_start(name, a) for name, a in zip(named, attempts, strict=False)]
        minima = gathered(minima, attempts)
        late = len(attempts) < len(named)
        if late or _enough(refinements, effort, minima, (len(starts), end), few):
            break
        if not minima and len(x):  # the first guess may be so small beside motions that exist
            programs = Programs(coarse, scale_of(coarse, x[-1]))
        named, begin = {}, numbers.stop
    if not minima and effort.widens:
        minima = _tightened(coarse, natural, effort.seed, replace(few, deadline=seeking))
    return minima, starts


def _attempts(
    programs: Programs, points: Sequence[Array], options: Options, latest: Deadline
) -> list[Attempt]:
    """Attempts from some points in their order, as many as there is time for; until a later
    deadline those that follow, as long as none is solved."""
    attempts = attempts_from(programs, points, options)
    later, at_once = replace(options, deadline=latest), free_threads()
    while len(attempts) < len(points) and not latest.passed:
        if any(attempt.status is Status.SOLVED for attempt in attempts):
            break
        some = points[len(attempts) : len(attempts) + at_once]
        attempts += attempts_from(programs, some, later)
    return attempts


def _enough(
    refinements: Refinements,
    effort: Effort,
    minima: Sequence[Basin],
    tried: tuple[int, int],
    options: Options,
) -> bool:
    """Whether no more starts are needed after those that were tried, in all and random ones."""
    if effort.total is not None:
        return False
    starts, random = tried
    agreed = effort.agree(minima, starts)
    if not agreed and 0 < random == effort.first and 1 < len(minima) <= FEW:
        agreed = effort.agree(refinements.merged(minima, options), starts)
    met = _met_best(minima) >= effort.often
    return (met and random >= effort.most) or (agreed and random >= effort.first)


def _met_best(minima: Sequence[Basin]) -> int:
    """Starts that have met the least cost, whatever the durations: where a motion may wait, many
    minima cost the same."""
    return sum(basin.starts for basin in minima if basin.costs_as(minima[0]))


def _start(name: str, attempt: Attempt) -> Start:
    solved = attempt.status is Status.SOLVED
    return Start(name, attempt.status, cost_of(attempt) if solved else None)


def _tightened(coarse: Problem, natural: float, seed: int, options: Options) -> list[Basin]:
    """Minima that are left when wide limits of the inputs are tightened step by step."""
    if not np.isfinite(coarse.input_bounds).any():
        return []
    wide = _widened(coarse, WIDER[0])
    points = [g.x for g in initial_guesses(wide, options.deadline)]
    scale = scale_of(wide, points[0])
    points += list(random_motions(wide, points, natural, range(WIDE_STARTS), seed))
    minima = list[Basin]()
    for factor in WIDER:
        tightened = _widened(coarse, factor)
        minima = gathered([], attempts_from(Programs(tightened, scale), points, options))
        points = [b.attempt.nlp.physical(b.attempt.outcome.x) for b in minima[:FOLLOWED]]
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
