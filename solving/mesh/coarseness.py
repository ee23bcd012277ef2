"""What the mesh that a problem states makes of the cost: one finer mesh is looked at."""

from __future__ import annotations

from dataclasses import replace

from dmoc.problem.ranges import MOST_STEPS
from dmoc.program.layout import Layout
from dmoc.results.notes import Topic
from dmoc.results.solution import Minimum, Solution, saying
from dmoc.solving.case import Case
from dmoc.solving.mesh.confirmation import MOST_UNKNOWNS, in_words
from dmoc.solving.mesh.error import changes

# The finer mesh has so many times the steps; a cost that differs by a larger share is told.
FINER, DIFFERS = 2, 0.1
# Its iterations and its share of the time that is left: most motions take some ten iterations, and
# what takes more would cost as much as many starts.
ITERATIONS, SHARE = 100, 0.5


def telling_coarseness(answer: Solution, case: Case) -> Solution:
    """The answer on steps that are given; where its motion leads to a cost on a mesh twice as fine
    that differs by more than a tenth, with a note on it.

    One that is confirmed and comes from several starts is looked at, unless the coarse mesh of
    these says the same: steps twice as small change a cost at least as much as those after them.
    """
    problem, request = case.problem, case.request
    asked = request.verify and answer.starts and request.tolerance is None
    if not (asked and answer.minimum) or _converged(answer, case.coarse):
        return answer
    steps = [FINER * n for n in answer.steps]
    if max(steps) > MOST_STEPS:
        return answer
    fine = problem.meshed(steps)
    if Layout.of(fine).size > MOST_UNKNOWNS:
        return answer
    options = case.of_mesh.options
    most = min(options.iterations, ITERATIONS)
    limits = case.of_mesh.within(iterations=most, deadline=options.deadline.share(SHARE))
    finer = replace(case, of_mesh=limits).along(fine, answer)
    if not finer.minimum or changes(answer, finer).cost <= DIFFERS:
        return answer
    costs = f"it costs {finer.cost:.6g} with {in_words(finer.steps)} instead of {answer.cost:.6g}"
    advice = "more steps, or none stated, bring the cost nearer to that of the continuous motion"
    return saying(answer, f"{costs}: {advice}", Topic.STEPS)


def _converged(answer: Solution, coarse: Minimum | None) -> bool:
    """Whether a mesh with at most half of the steps has the cost of the answer."""
    if coarse is None or len(coarse.steps) != len(answer.steps):
        return False
    coarser = all(FINER * few <= n for few, n in zip(coarse.steps, answer.steps, strict=True))
    return coarser and abs(coarse.cost - answer.cost) <= DIFFERS * abs(answer.cost)
