"""Minima of a coarse mesh on a finer one, checked, the best first."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import field, replace
from typing import TYPE_CHECKING

import numpy as np

from dmoc.base.deadline import Deadline
from dmoc.base.records import record
from dmoc.base.tolerances import SAME
from dmoc.guess.transfer import pieces_of, unknowns_along
from dmoc.problem.problem import Problem
from dmoc.problem.ranges import MOST_STEPS
from dmoc.program.extraction import trajectory
from dmoc.program.scaling import scale_of
from dmoc.results.solution import Solution
from dmoc.solvers.outcome import Options, Status
from dmoc.solving.attempts import Attempt, LocalSolver
from dmoc.solving.checked_solution import checked, solution_of
from dmoc.solving.mesh_steps import finer
from dmoc.solving.methods import COMPILED_METHOD
from dmoc.solving.multistart.minima import Basin, cost_of, joined
from dmoc.solving.programs import Programs

if TYPE_CHECKING:
    from dmoc.solving.multistart.effort import Effort

# Steps of a phase on the mesh where minima are ranked.
RANKING = 100
# A minimum that is not confirmed is looked at on a mesh so many times finer.
FINER = 4
# Iterations of a refinement.
REFINING = 300


@record(frozen=True, eq=False)
class Ranked:
    """A minimum on the ranking mesh and as starts have met it, its solution, and its cost where the
    simulation confirms it: there, or on a finer mesh."""

    minimum: Basin
    coarse: Basin
    solution: Solution
    cost: float

    def rank(self) -> tuple[float, ...]:
        """Confirmed minima first, those whose collisions all have an effect before others, by
        cost."""
        grazes = self.solution.status is Status.GRAZES
        return np.isinf(self.cost), grazes, self.cost, self.solution.cost


@record(frozen=True, eq=False)
class Refinements:
    """Minima of a coarse mesh on the ranking mesh of a problem, each solved once."""

    problem: Problem
    solved: dict[int, tuple[Attempt, Attempt]] = field(default_factory=dict)  # by id of the first

    def of(self, coarse: Basin, options: Options) -> Attempt:
        pair = self.solved.get(id(coarse.attempt))
        if pair is not None:
            return pair[1]
        attempt = _refined(_mesh(self.problem, coarse), coarse.attempt, options)
        if attempt.status is Status.SOLVED:
            self.solved[id(coarse.attempt)] = coarse.attempt, attempt
        return attempt

    def ways(self, coarse: Basin, options: Options) -> Iterator[Attempt]:
        """Its other ways there, each solved when it is asked for."""
        for way in coarse.ways:
            yield _refined(_mesh(self.problem, coarse), way, options)

    def merged(self, minima: Sequence[Basin], options: Options) -> list[Basin]:
        """The distinct ones, the cheapest first: several may become one."""
        distinct = list[Basin]()
        for coarse in minima:
            attempt = self.of(coarse, options)
            if attempt.status is Status.SOLVED:
                distinct = joined(distinct, coarse.on_mesh_of(attempt))
        return distinct


def ranked(
    refinements: Refinements,
    minima: Sequence[Basin],
    effort: Effort,
    options: Options,
    deadline: Deadline,
) -> tuple[list[Ranked], list[Basin]]:
    """Minima on the ranking mesh, the best first, and those of the coarse mesh that were not
    refined or could not be.  After the deadline, which comes before that of the options, no further
    one is begun."""
    refined, left = list[Ranked](), list[Basin]()
    for k, coarse in enumerate(minima):
        confirmed = [r.solution.cost for r in refined if r.solution.minimum]
        passed = bool(confirmed) and coarse.cost > min(confirmed) and k >= effort.refined
        seeks = effort.settles and passed and _seeks_effect(refined, minima[k:])
        full = len(refined) >= effort.most_refined
        # The first one is refined however late it is: starts that nothing comes of are no use.
        late = k > 0 and deadline.passed
        if (passed and not seeks) or full or late:
            left += minima[k:]
            break
        if seeks and coarse.grazes:
            left.append(coarse)
            continue
        attempt = refinements.of(coarse, options)
        if attempt.status is not Status.SOLVED:
            left.append(coarse)
            continue
        new = coarse.on_mesh_of(attempt)
        same = next((i for i, r in enumerate(refined) if r.minimum.same(new)), None)
        if same is not None:
            r = refined[same]
            refined[same] = replace(r, minimum=r.minimum.met_by(coarse))
            continue
        s = solution_of(attempt, COMPILED_METHOD.name, {})
        if effort.verifies:
            new, s = _confirmed(new, checked(s), refinements.ways(coarse, options))
        refined.append(Ranked(new, coarse, s, s.cost if s.minimum else np.inf))
    good = [r for r in refined if r.solution.minimum]
    if effort.settles and good:
        best = min(good, key=Ranked.rank)
        refined = [_settled(r, best, options) for r in refined]
    elif effort.settles:
        refined = _until_confirmed(sorted(refined, key=Ranked.rank), options, deadline)
    return sorted(refined, key=Ranked.rank), left


def _seeks_effect(refined: Sequence[Ranked], left: Sequence[Basin]) -> bool:
    """Whether a collision of all minima that were refined has no effect, and there are others."""
    none = not any(r.solution.status is Status.SOLVED for r in refined)
    return none and not all(basin.grazes for basin in left)


def _confirmed(
    minimum: Basin, solution: Solution, ways: Iterator[Attempt]
) -> tuple[Basin, Solution]:
    """A minimum with its solution; where the simulation contradicts it, along the first other way
    of the same cost that it confirms."""
    if solution.minimum:
        return minimum, solution
    for attempt in ways:
        if attempt.status is Status.SOLVED and Basin.of(attempt).same(minimum):
            other = checked(solution_of(attempt, COMPILED_METHOD.name, {}))
            if other.minimum:
                return replace(minimum, attempt=attempt), other
    return minimum, solution


def _mesh(problem: Problem, coarse: Basin) -> Problem:
    """The mesh where a minimum is ranked, which is no coarser than its own: that of the problem, at
    most; where that is left open, without more steps for phases that have shrunk."""
    pairs = zip(problem.phase_steps, coarse.problem.phase_steps, strict=True)
    steps = [min(n, max(RANKING, own)) for n, own in pairs]
    if problem.steps is None:
        steps = finer(coarse.durations.tolist(), coarse.problem.phase_steps, steps)
    return problem.meshed(steps)


def _settled(r: Ranked, best: Ranked, options: Options) -> Ranked:
    """A minimum that the simulation contradicts, with its cost on a finer mesh if it is confirmed
    there: then the mesh is too coarse, and it is a minimum. It is no better one if the best that is
    confirmed costs no more on either mesh, as motions do that switch in other steps."""
    if r.solution.minimum:
        return r
    fine = _on_finer(r, options)
    if fine is None:
        return r
    cost = cost_of(fine)
    if cost < best.cost <= r.solution.cost:
        other = _on(fine.nlp.problem, best.minimum.attempt, options)
        solved = other.status is Status.SOLVED
        if solved and Basin.of(other).at_most(Basin.of(fine)):
            return r
    return replace(r, cost=cost)


def _until_confirmed(
    contradicted: Sequence[Ranked], options: Options, deadline: Deadline
) -> list[Ranked]:
    """Minima that the simulation contradicts, one after the other with its cost on a finer mesh
    until one is confirmed there."""
    settled = list(contradicted)
    for i, r in enumerate(contradicted):
        fine = None if i and deadline.passed else _on_finer(r, options)
        if fine is not None:
            settled[i] = replace(r, cost=cost_of(fine))
            break
    return settled


def _on_finer(r: Ranked, options: Options) -> Attempt | None:
    """A minimum on a finer mesh, if it is confirmed there."""
    mesh = r.minimum.problem
    fine = mesh.meshed([min(FINER * n, MOST_STEPS) for n in mesh.phase_steps])
    attempt = _on(fine, r.minimum.attempt, options)
    if attempt.status is not Status.SOLVED:
        return None
    confirmed = checked(solution_of(attempt, COMPILED_METHOD.name, {})).minimum
    return attempt if confirmed else None


def _refined(mesh: Problem, coarse: Attempt, options: Options) -> Attempt:
    """Solve on a finer mesh from a motion on a coarse one; where that leads nowhere, once more by
    way of the meshes between."""
    few = replace(options, iterations=min(options.iterations, REFINING))
    attempt = _on(mesh, coarse, few)
    while attempt.status is not Status.SOLVED:
        pairs = zip(coarse.nlp.problem.phase_steps, mesh.phase_steps, strict=True)
        between = mesh.meshed([min(2 * n, most) for n, most in pairs])
        if between.phase_steps == mesh.phase_steps:
            return attempt
        step = _on(between, coarse, few)
        if step.status is not Status.SOLVED:
            return attempt
        coarse, attempt = step, _on(mesh, step, few)
    return attempt


def _on(mesh: Problem, coarse: Attempt, options: Options) -> Attempt:
    """Solve on a mesh from a motion on another one."""
    motion = trajectory(coarse.nlp, coarse.outcome.x, whole=False)
    impulses = [c.impulse for c in motion.collisions]
    x = unknowns_along(mesh, pieces_of(motion), impulses)
    scale, before = scale_of(mesh, x, True), coarse.nlp.scale
    if (scale.q < SAME * before.q).all():  # it stands still: rounding errors measure nothing
        scale = replace(before, h=scale.h)
    programs = Programs(mesh, scale)
    nlp = programs.program()
    attempt = LocalSolver.compiled(programs).minimum(nlp, nlp.scaled(x), options)
    if attempt.status is Status.INTERRUPTED:
        raise KeyboardInterrupt
    return attempt
