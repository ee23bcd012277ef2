"""Problems without a sequence, whose contacts are left open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields

from dmoc.mechanics.contact_mode import FREE, Event
from dmoc.mechanics.touch import Open, Touch
from dmoc.problem.problem import Problem


def relaxed(
    problem: Problem, left_open: Open, hits: Sequence[str], steps: int, eps: float
) -> Problem:
    """The same problem without a sequence: what may touch is left open, in phases of so many steps
    between hits of some surfaces, which may be none, and complementarity is relaxed by ``eps``
    (:mod:`dmoc.program.laws.complementarity`)."""
    contacts = problem.touch.contacts
    events = tuple(Event(contacts.surface_numbers[name]) for name in hits)
    touch = Touch(contacts, (FREE,) * (len(hits) + 1), events, left_open)
    other = object.__new__(Problem)
    other.__dict__.update(
        {f.name: getattr(problem, f.name) for f in fields(problem)},
        sequence=tuple(hits), steps=steps, controls="constant", via=None, contacts=(),
        durations=None, minimal_times=False, touch=touch, open_hits={}, by_rates=True,
        relaxation=eps, model=problem.model,
    )  # fmt: skip
    return other
