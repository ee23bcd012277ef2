"""The states of friction and their words: a tangent sticks, or slides in a direction.

A state is 0 where the tangent sticks, 1 or -1 where it slides with that sign of tau'.  What a state
makes of a motion, its mode and the conditions of this know (:mod:`dmoc.mechanics.conditions`).  A
hit of a contact with two tangential directions slides in one that is part of the motion.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

STICK = 0
STICKING = "stick"
FRICTION = {STICKING: STICK, "slip+": 1, "slip-": -1}  # states by their words
STATES = (1, STICK, -1)  # from one direction to the other
SLIDING = tuple(state for state in STATES if state != STICK)
# Hits of contacts with two tangential directions.
SLIP = 2
IN_SPACE = {STICKING: STICK, "slip": SLIP}
_WORDS = {state: word for word, state in (FRICTION | IN_SPACE).items()}


def friction_word(state: int) -> str:
    """The word of a state in sequences."""
    return _WORDS[state]


def rubbing_word(name: str, state: int) -> str:
    """A contact with its state, as "left:stick"."""
    return f"{name}:{friction_word(state)}"


def sticks(state: int) -> bool:
    """Whether a tangent in this state does not slide."""
    return state == STICK


def turned(state: int) -> int:
    """Sliding in the other direction."""
    return -state


def after_stop(state: int) -> tuple[int, int]:
    """States that may follow where sliding stops: it sticks where friction holds it, else it
    turns."""
    return STICK, turned(state)


def sliding_with(rate: float) -> int:
    """The state of a tangent with a sliding velocity, or that another state would give this."""
    return int(np.sign(rate))


def sliding_against(force: float) -> int:
    """The state of a tangent whose friction force is at its limit."""
    return -sliding_with(force)


def states_of(rates: NDArray[np.float64], least: NDArray[np.float64]) -> NDArray[np.intp]:
    """The states of friction of tangents with rates of shape (...), which stick where these are not
    above the ``least``, of the same shape."""
    return np.where(np.abs(rates) > least, np.sign(rates), STICK).astype(np.intp)
