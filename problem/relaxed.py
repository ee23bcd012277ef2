"""Problems without a sequence, whose contacts are left open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dmoc.mechanics.contact_mode import FREE, Event
from dmoc.mechanics.touch import Open, Touch
from dmoc.problem.derived import like, unread
from dmoc.problem.problem import Problem


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
        model=problem.model,
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
