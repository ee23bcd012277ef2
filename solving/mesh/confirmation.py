"""How many steps it takes until the check confirms a motion that it contradicts on its mesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import ceil, log
from typing import TYPE_CHECKING

from dmoc.problem.ranges import MOST_STEPS
from dmoc.program.layout import Layout
from dmoc.results.notes import Note, Topic, with_note
from dmoc.results.solution import Solution
from dmoc.solvers.outcome import Status
from dmoc.solving.case import Case
from dmoc.solving.mesh.error import SLOWEST_ORDER

if TYPE_CHECKING:
    from dmoc.check.check import Verification

# More steps than errors of the order ask for, because they fall irregularly where inputs switch
# between nodes; at most so many times as many, beyond which errors on coarse meshes tell nothing.
MARGIN, MOST = 1.2, 10.0
# Meshes that are tried, and the unknowns of the finest one, which shall cost some seconds at most.
TRIED, MOST_UNKNOWNS = 3, 30_000


def passing_steps(check: Verification, steps: Sequence[int], order: float) -> list[int]:
    """The steps of the phases with which errors that fall as the step size to an order would pass
    the check, with a margin; twice as many where no error exceeds its limit."""
    excess = check.excess
    more = excess ** (1 / order) if excess > 1 else 2.0 / MARGIN
    factor = min(MARGIN * more, MOST)
    return [ceil(factor * n) for n in steps]


def naming_steps(answer: Solution, case: Case) -> Solution:
    """The answer; where the check contradicts it on the only mesh, its message says which one it
    confirms.

    Meshes are solved from the motion before: the first one by the order of the discretisation,
    others by the order that the errors have shown.
    """
    problem, request = case.problem, case.request
    contradicted = answer.status is Status.NOT_VERIFIED and answer.verification is not None
    if not (contradicted and request.names_steps) or request.tolerance is not None:
        return answer
    tried, order, coarse = list[Solution](), float(problem.order), answer
    while len(tried) < TRIED and coarse.verification is not None:
        steps = passing_steps(coarse.verification, coarse.steps, order)
        if max(steps) > MOST_STEPS:
            break
        fine = problem.meshed(steps)
        if Layout.of(fine).size > MOST_UNKNOWNS:
            break
        s = case.along(fine, coarse, verify=True)
        if s.minimum:
            advice = f"take {in_words(s.steps)}, with which it is confirmed and costs {s.cost:.6g}"
            return _telling(answer, advice)
        if s.verification is None:  # not solved there, or not in time
            break
        tried.append(s)
        order = min(max(_order(coarse, s), SLOWEST_ORDER), problem.order)
        coarse = s
    if not tried:
        return answer
    return _telling(answer, f"{' or '.join(in_words(s.steps) for s in tried)} are not enough")


def _telling(answer: Solution, advice: str) -> Solution:
    """The answer with advice on its steps in the place of the check's."""
    general = any(note.topic is Topic.STEPS for note in answer.notes)
    note = Note(Topic.STEPS, advice, ", " if general else ": ")
    return replace(answer, notes=with_note(answer.notes, note))


def _order(coarse: Solution, fine: Solution) -> float:
    """The order with which the largest error has fallen."""
    before, after = coarse.verification, fine.verification
    if before is None or after is None or not 0 < after.excess < before.excess:
        return SLOWEST_ORDER
    return log(before.excess / after.excess) / log(max(fine.steps) / max(coarse.steps))


def in_words(steps: Sequence[int]) -> str:
    if len(set(steps)) == 1:
        return f"{steps[0]} steps" + (" a phase" if len(steps) > 1 else "")
    return f"{list(steps)} steps"
