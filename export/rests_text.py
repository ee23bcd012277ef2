"""The programs of the rests of a motion, and what dmoc_planner.c reads of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from dmoc.base.errors import ProblemError
from dmoc.export.constants import Constants, initial, literal
from dmoc.export.motion_text import has_rest
from dmoc.export.numbers import numbers_of
from dmoc.export.program_text import CarriedProgram
from dmoc.mechanics.contacts import NOWHERE
from dmoc.planning.planner import Planner
from dmoc.solvers.kkt_layout import kkt_layout
from dmoc.solvers.outcome import Status

# Doubles that a planner has, without its solver and its arrays.
OF_PLANNER = 32


def carried_rests(name: str, planner: Planner) -> tuple[list[CarriedProgram], list[float]]:
    """The rests from each phase on, of which the first is the whole motion, and when they begin."""
    if (planner.problem.touch.switches != NOWHERE).any():
        raise ProblemError(
            "a planner in C does not see when a switch is passed, which the sequence has: plan "
            "with dmoc.Planner, or generate the solver without a planner."
        )
    if any(event.off for event in planner.problem.touch.events):
        raise ProblemError(
            "a planner in C does not see when a contact slips off an end, as the sequence says: "
            "plan with dmoc.Planner, or generate the solver without a planner."
        )
    rests, begins = list[CarriedProgram](), list[float]()
    for i, (begin, nlp, x, ended) in enumerate(planner.rests()):
        if ended.status is not Status.SOLVED:
            raise ProblemError(
                f"the rest of the motion from phase {i} on has no solution to begin with "
                f"({ended.status.sentence}): take other steps."
            )
        own = f"{name}_rest_{i}" if i else name
        layout, numbers = kkt_layout(nlp), numbers_of(nlp)
        if not has_rest(nlp, numbers):
            raise ProblemError(
                f"the rest of the motion from phase {i} on depends on its start or its times in "
                "ways that a planner in C cannot follow: plan with dmoc.Planner."
            )
        reach = planner.problem.reach
        rests.append(CarriedProgram(own, nlp, layout, numbers, ended.x, ended.duals, x, reach))
        begins.append(begin)
    return rests, begins


def rests_facts(rests: Sequence[CarriedProgram], begins: Sequence[float], planner: Planner) -> Any:
    """Facts about the rests of a motion for rests.c and the header."""
    c, rows = Constants(), list[str]()
    for r, begin in zip(rests, begins, strict=True):
        rows.append(initial(f"&{r.name}_problem", literal(begin)))
    events = c.array("int", planner.problem.touch.surfaces)
    motion = initial(planner.problem.phases, len(rows), int(not planner.shrinks), events, "rests")
    return {"lines": c.lines, "rows": rows, "motion": motion, "names": [r.name for r in rests[1:]]}


def planner_doubles(rests: Sequence[CarriedProgram], solvers: Sequence[int]) -> int:
    """Doubles that a planner takes, of solvers that take so many."""
    kept = max(2 * r.nlp.n + r.nlp.n_eq + r.nlp.n_in for r in rests)
    numbers = max(len(r.numbers.taken) for r in rests)
    return OF_PLANNER + 2 * kept + numbers + 2 * rests[0].nlp.layout.nq + max(solvers)
