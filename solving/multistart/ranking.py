"""Minima of a coarse mesh on a finer one, checked, the best first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from dmoc.base.deadline import Deadline
from dmoc.guess.transfer import pieces_of, unknowns_along
from dmoc.problem.problem import MOST_STEPS, Problem
from dmoc.program.extraction import trajectory
from dmoc.program.scaling import scale_of
from dmoc.results.solution import Solution
from dmoc.solvers.outcome import Options, Status
from dmoc.solving.attempts import Attempt, minimum
from dmoc.solving.checked_solution import checked, solution_of
from dmoc.solving.mesh_steps import finer
from dmoc.solving.multistart.minima import Basin, joined
from dmoc.solving.multistart.parallel import COMPILED_METHOD, compiled
from dmoc.solving.programs import Programs

if TYPE_CHECKING:
    from dmoc.solving.multistart.exploration import Effort

# Steps of a phase on the mesh where minima are ranked.
RANKING = 100
# A minimum that is not confirmed is looked at on a mesh so many times finer.
FINER = 4
# Of the sizes of a start: a minimum that moves less stands still, but for rounding errors, which
# are no measure of anything.
STILL = 1e-9
# Iterations of a refinement.
REFINING = 300


def ranked(
    problem: Problem,
    minima: Sequence[Basin],
    wanted: tuple[Effort, bool],
    options: Options,
    deadline: Deadline,
) -> tuple[list[tuple[Solution, int]], Sequence[Basin]]:
    """Solutions from the minima with the number of starts, the best first, and the minima that were
    not refined or could not be; ``wanted`` says how many to refine and whether to check them.
    After the deadline, which comes before that of the options, no further one is begun."""
    effort, verify = wanted
    refined: list[_Ranked] = []
    lost: list[Basin] = []
    rest: Sequence[Basin] = []
    for k, coarse in enumerate(minima):
        confirmed = [r.solution.cost for r in refined if r.solution.minimum]
        passed = bool(confirmed) and coarse.cost > min(confirmed) and k >= effort.refined
        full = len(refined) >= effort.most_refined
        # The first one is refined however late it is: starts that nothing comes of are no use.
        late = k > 0 and deadline.passed
        if passed or full or late:
            rest = minima[k:]
            break
        attempt = _refined(_mesh(problem, coarse), coarse.attempt, options, effort.by_rates)
        if attempt.outcome.status is not Status.SOLVED:
            lost.append(coarse)
            continue
        new = Basin.of(attempt)
        for i, known in enumerate(refined):
            if known.minimum.same(new):
                refined[i] = replace(known, found=known.found + coarse.found)
                break
        else:
            s = solution_of(attempt, COMPILED_METHOD.name, {})
            s = checked(s) if verify else s
            refined.append(_Ranked(new, s, coarse.found, s.cost if s.minimum else np.inf))
    good = [r for r in refined if r.solution.minimum]
    if effort.settles and good:
        best = min(good, key=_Ranked.rank)
        refined = [_settled(r, best, options, effort.by_rates) for r in refined]
    refined.sort(key=_Ranked.rank)
    return [(r.solution, r.found) for r in refined], [*lost, *rest]


def merged(
    problem: Problem, minima: Sequence[Basin], options: Options, by_rates: bool
) -> list[Basin]:
    """Minima of a coarse mesh on the ranking mesh, the cheapest first: several may become one."""
    classes: list[Basin] = []
    for coarse in minima:
        attempt = _refined(_mesh(problem, coarse), coarse.attempt, options, by_rates)
        if attempt.outcome.status is Status.SOLVED:
            classes = joined(classes, replace(Basin.of(attempt), found=coarse.found))
    return classes


def _mesh(problem: Problem, coarse: Basin) -> Problem:
    """The mesh where a minimum is ranked: that of the problem, at most; where that is left open,
    without more steps for phases that have shrunk."""
    steps = [min(n, RANKING) for n in problem.phase_steps]
    if problem.steps is None:
        known = coarse.attempt.nlp.problem.phase_steps
        steps = finer(coarse.durations.tolist(), known, steps)
    return problem.meshed(steps)


@dataclass(frozen=True)
class _Ranked:
    """A minimum on the ranking mesh, its solution, how many starts led to it, and its cost where
    the simulation confirms it."""

    minimum: Basin
    solution: Solution
    found: int
    cost: float

    def rank(self) -> tuple[float, ...]:
        """Confirmed minima first, those whose collisions all have an effect before others, by
        cost."""
        grazes = self.solution.status is Status.GRAZES
        return np.isinf(self.cost), grazes, self.cost, self.solution.cost


def _settled(r: _Ranked, best: _Ranked, options: Options, by_rates: bool) -> _Ranked:
    """Where the simulation contradicts a minimum, its cost on a finer mesh if it is confirmed
    there: then the mesh is too coarse, and not the minimum none.  It is no better one if the best
    that is confirmed costs no more on either mesh, as motions do that switch in other steps."""
    if r.solution.minimum:
        return r
    mesh = r.minimum.attempt.nlp.problem
    fine = mesh.meshed([min(FINER * n, MOST_STEPS) for n in mesh.phase_steps])
    attempt = _on(fine, r.minimum.attempt, options, by_rates)
    if attempt.outcome.status is not Status.SOLVED:
        return r
    s = checked(solution_of(attempt, COMPILED_METHOD.name, {}))
    if not s.minimum:
        return r
    if s.cost < best.cost <= r.solution.cost:
        other = _on(fine, best.minimum.attempt, options, by_rates)
        solved = other.outcome.status is Status.SOLVED
        if solved and Basin.of(other).at_most(Basin.of(attempt)):
            return r
    return replace(r, cost=s.cost)


def _refined(mesh: Problem, coarse: Attempt, options: Options, by_rates: bool) -> Attempt:
    """Solve on a finer mesh from a motion on a coarse one; where that leads nowhere, once more by
    way of the meshes between."""
    few = replace(options, iterations=min(options.iterations, REFINING))
    attempt = _on(mesh, coarse, few, by_rates)
    while attempt.outcome.status is not Status.SOLVED:
        pairs = zip(coarse.nlp.problem.phase_steps, mesh.phase_steps, strict=True)
        between = mesh.meshed([min(2 * n, most) for n, most in pairs])
        if between.phase_steps == mesh.phase_steps:
            return attempt
        step = _on(between, coarse, few, by_rates)
        if step.outcome.status is not Status.SOLVED:
            return attempt
        coarse, attempt = step, _on(mesh, step, few, by_rates)
    return attempt


def _on(mesh: Problem, coarse: Attempt, options: Options, by_rates: bool) -> Attempt:
    """Solve on a mesh from a motion on another one."""
    motion = trajectory(coarse.nlp, coarse.outcome.x)
    impulses = [c.impulse for c in motion.collisions]
    x = unknowns_along(mesh, pieces_of(motion), impulses)
    scale, known = scale_of(mesh, x, True), coarse.nlp.scale
    if (scale.q < STILL * known.q).all():
        scale = replace(known, h=scale.h)
    programs = Programs(mesh, scale, by_rates)
    nlp = programs.program()
    attempt = minimum(programs, nlp, nlp.scaled(x), options, compiled())
    if attempt.outcome.status is Status.INTERRUPTED:
        raise KeyboardInterrupt
    return attempt
