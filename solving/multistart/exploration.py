"""Many starts on a coarse mesh, and the minima they lead to, ranked on a finer one.

Only local minima are found from any start (Kern & Gross 2018, "only local minima found").  What
many starts find is as good as their number: no better minimum was met, which is no proof that there
is none.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from dmoc.base.deadline import Deadline
from dmoc.base.records import record
from dmoc.check.verdict import PASSING
from dmoc.codegen.kernels import Array
from dmoc.guess.transfer import on_mesh
from dmoc.problem.problem import Problem
from dmoc.results.solution import Minimum, Solution
from dmoc.solvers.outcome import Options
from dmoc.solving.multistart.effort import Effort, met_by_cost, unseen_share
from dmoc.solving.multistart.minima import Basin
from dmoc.solving.multistart.ranking import Ranked, Refinements, ranked
from dmoc.solving.multistart.rounds import Rounds, Start

# Steps of a phase on the coarse mesh.  With 12, motions with many collisions mislead, and their
# refinement takes longer than is saved.
COARSE = 24
# Of steps that are held, with nodes inside, which have about three times the unknowns of others.
COARSE_HELD = 12
# Steps of a phase on the finest mesh that motions start on.
FINEST = 4 * COARSE
# Share of the time that starts have, and the larger one where none has led to a motion: what is
# left then is for the refinement of the first one that does, or for what conflicts.
STARTING, SEEKING = 0.5, 0.9


@record(frozen=True, eq=False)
class Exploration:
    """The minima to which starts have led, and how they ended."""

    ranked: tuple[Ranked, ...]  # on the ranking mesh, the best first: confirmed ones before others
    coarse: tuple[Basin, ...]  # that were not refined, or could not be
    starts: tuple[Start, ...]
    unseen: float | None = None  # the estimated share of further starts that meet other minima
    late: bool = False  # the time was used up before any start led to a motion
    rounds: Rounds | None = None  # that may go on
    end: float = 0.0  # of its starts, on the performance counter

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
        others = [basin.unrefined for basin in self.coarse]
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
    to a motion. ``points`` are further ones by name, unknowns of the problem on its coarse mesh,
    shape (n,). Where all minima go through what path constraints forbid, between the nodes of any
    mesh, they are looked for on a finer one. An interrupted solve raises KeyboardInterrupt."""
    options = replace(options, progress=None)
    shares = (STARTING, SEEKING) if effort.share is None else (effort.share, effort.share)
    starting, seeking = map(options.deadline.share, shares)
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
    """The exploration of starts on a coarse mesh, with the times that they have."""
    starting, seeking = latest
    within = replace(options, deadline=starting)
    rounds = Rounds.begun(Refinements(problem), coarse, effort, within, seeking, points)
    return _run(rounds, options)


def _run(rounds: Rounds, options: Options) -> Exploration:
    """Rounds as far as they go, and what they have led to."""
    rounds.run()
    minima, starting, end = rounds.minima, rounds.options.deadline, time.perf_counter()
    late = not minima and rounds.seeking.passed
    unseen = unseen_share(met_by_cost(minima)[:, 0]) if minima else None
    refined, left = ranked(rounds.refinements, minima, rounds.effort, options, starting)
    return Exploration(tuple(refined), tuple(left), tuple(rounds.starts), unseen, late, rounds, end)


def continued(before: Exploration, options: Options, until: Deadline) -> Exploration | None:
    """An exploration with further starts until a moment; None where those that were tried are
    enough."""
    rounds = before.rounds
    if rounds is None or not rounds.unfinished:
        return None
    rounds.options, rounds.seeking = replace(rounds.options, deadline=until), until
    with np.errstate(all="ignore"):
        return _run(rounds, replace(options, progress=None))


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
