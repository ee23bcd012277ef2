"""Problems like another one, one without a sequence, whose contacts are left open, among them; and
what follows from a problem, made once."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from copy import copy
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from dmoc.base.errors import ProblemError
from dmoc.base.signatures import check_argument
from dmoc.mechanics.contact_mode import FREE, Event
from dmoc.mechanics.touch import Open, Touch

if TYPE_CHECKING:
    from dmoc.problem.problem import Problem

T = TypeVar("T")
MADE = "_made"  # the attribute in which a problem keeps what follows from it


def unread(problem: Problem, changes: Mapping[str, Any]) -> Problem:
    """The same problem with some fields replaced by values that are not read."""
    names = [item.name for item in fields(problem)]
    for name in changes:
        check_argument(name, names, type(problem).__name__, ProblemError)
    return like(problem, vars(problem).keys() - names, **changes)


def like(problem: Problem, without: Collection[str] = (), **changes: Any) -> Problem:
    """The same problem with some attributes replaced without checks; it keeps all that was derived
    from the other one, except the attributes ``without``."""
    other = copy(problem)
    for name in without:
        vars(other).pop(name, None)
    vars(other).update(changes)
    return other


def kept(problem: Problem) -> dict[str, Any]:
    """The attributes of a problem but for what follows from it, which copies leave behind."""
    return {name: value for name, value in vars(problem).items() if name != MADE}


def once(problem: Problem, make: Callable[[Problem], T]) -> T:
    """The result of a function of a problem, made once."""
    made: dict[Any, Any] = vars(problem).setdefault(MADE, {})
    if make not in made:
        made[make] = make(problem)
    result: T = made[make]
    return result


def relaxed(
    problem: Problem, left_open: Open, hits: Sequence[str], steps: int, eps: float
) -> Problem:
    """The same problem without a sequence: what may touch is left open, in phases of so many steps
    between hits of some surfaces, which may be none, and complementarity is relaxed by ``eps``
    (:mod:`dmoc.program.laws.complementarity`).  What is said of forces is left out."""
    contacts = problem.touch.contacts
    events = tuple(Event(contacts.surface_numbers[name]) for name in hits)
    touch = Touch(contacts, (FREE,) * (len(hits) + 1), events, left_open)
    fields = {
        "sequence": tuple(hits), "steps": steps, "controls": "constant", "via": None,
        "contacts": (), "durations": None, "minimal_times": False,
    }  # fmt: skip
    other = like(
        unread(problem, fields), touch=touch, open_hits={}, by_rates=True, relaxation=eps,
        models=problem.models,
    )  # fmt: skip
    pushed = [bool(row.get("forces")) for row in problem.kernels.quantity_rows]
    if any(pushed):
        said = other.quantity_ranges
        bounds, start, goal = problem.quantity_bounds.copy(), said.start.copy(), said.goal.copy()
        for rows in (bounds, start, goal):
            rows[pushed] = -np.inf, np.inf
        ranges = replace(said, start=start, goal=goal)
        other = like(other, quantity_bounds=bounds, quantity_ranges=ranges)
    return other
