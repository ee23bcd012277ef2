"""What touches in the phases of a problem, and what follows of it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.contact_mode import FREE
from dmoc.mechanics.model_values import restitution_row
from dmoc.mechanics.possible_words import open_hits
from dmoc.mechanics.redundancy import Redundancy, redundancy
from dmoc.mechanics.sequence_words import mode_of, touch_along, words_along
from dmoc.mechanics.touch import Touch
from dmoc.problem.reach import latest_time

if TYPE_CHECKING:
    from dmoc.problem.problem import Problem


def restitution_values_of(problem: Problem) -> Array:
    """Coefficient of restitution of each surface, shape (nc,); not a number where the law of the
    model says it."""
    return restitution_row(problem.kernels, problem.restitution)


def touch_of(problem: Problem) -> Touch:
    """What is in contact in each phase, and what happens between the phases."""
    model = problem.model
    names = model.contacts
    plastic = names.named(np.flatnonzero(problem.restitution_values == 0))
    rough, tangential = names.named(model.rough), names.named(model.tangential)
    contacts = replace(names, plastic=plastic, rough=rough, tangential=tangential)
    return touch_along(mode_of(problem.contacts, contacts), problem.sequence, contacts)


def words_of(problem: Problem) -> tuple[str, ...]:
    """The events in words that are the same for the same event; those of a motion are, too."""
    return words_along(problem.touch)


def open_hits_of(problem: Problem) -> dict[int, list[str]]:
    """Hits with friction whose course is not said, by their places in the sequence, and the words
    that say it."""
    return open_hits(problem.touch, problem.sequence)


def redundant_of(problem: Problem) -> tuple[Redundancy, ...]:
    """What follows of the conditions of each phase."""
    model, modes, latest = problem.model, problem.touch.modes, latest_time(problem)
    start, reach = problem.start_position, problem.reach
    return tuple(
        redundancy(model, mode, start, reach, latest, before.closed)
        for before, mode in zip((FREE, *modes), modes, strict=False)
    )
