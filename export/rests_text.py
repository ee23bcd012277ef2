"""The programs of the rests of a motion, and what dmoc_planner.c reads of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from dmoc.base.errors import ProblemError
from dmoc.export.constants import Constants, initial, literal
from dmoc.export.motion_text import has_rest
from dmoc.export.numbers import numbers_of
from dmoc.export.program_text import CarriedProgram
from dmoc.mechanics.contact_mode import Event
from dmoc.mechanics.contacts import NOWHERE
from dmoc.mechanics.touch import Touch
from dmoc.planning.planner import Planner
from dmoc.solvers.kkt_layout import kkt_layout
from dmoc.solvers.outcome import Status

# Kinds of events, as dmoc_planner.h has them.
OF_GAP, OF_GRIP, OF_SWITCH, OF_END = range(4)
# Doubles that a planner has, without its solver and its arrays.
OF_PLANNER = 32


def carried_rests(name: str, planner: Planner) -> tuple[list[CarriedProgram], list[float]]:
    """The rests from each phase on, of which the first is the whole motion, and when they begin."""
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
    events = zip(*map(_seen, *_events(planner.problem.touch)), strict=True)
    seen = [c.array("int", np.array(part, dtype=np.intp)) for part in events] or ["NULL"] * 2
    motion = initial(planner.problem.phases, len(rows), int(not planner.shrinks), *seen, "rests")
    return {"lines": c.lines, "rows": rows, "motion": motion, "names": [r.name for r in rests[1:]]}


def _events(touch: Touch) -> tuple[Sequence[Event], Sequence[int], Sequence[bool]]:
    """The events of a motion, what each hits or lands, and whether that is a grip."""
    surfaces = touch.surfaces.tolist()
    return touch.events, surfaces, [j != NOWHERE and bool(touch.contacts.pull[j]) for j in surfaces]


def _seen(event: Event, surface: int, grips: bool) -> tuple[int, int]:
    """The number and the kind, as dmoc_planner.h has them, of what tells that an event is over."""
    if event.switch != NOWHERE:
        return event.switch, OF_SWITCH
    if event.off:
        return event.off[0], OF_END
    return surface, OF_GRIP if grips else OF_GAP


def planner_doubles(rests: Sequence[CarriedProgram], solvers: Sequence[int]) -> int:
    """Doubles that a planner takes, of solvers that take so many."""
    kept = max(2 * r.nlp.n + r.nlp.n_eq + r.nlp.n_in for r in rests)
    numbers = max(len(r.numbers.taken) for r in rests)
    return OF_PLANNER + 2 * kept + numbers + 2 * rests[0].nlp.layout.nq + max(solvers)
