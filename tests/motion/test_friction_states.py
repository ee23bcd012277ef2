"""The states of friction and their words."""

from __future__ import annotations

import numpy as np
import pytest

from dmoc.motion.friction import (
    FRICTION,
    SLIDING,
    STATES,
    after_stop,
    friction_word,
    rubbing_word,
    sliding_against,
    sliding_with,
    states_of,
    sticks,
    turned,
)


def test_every_state_has_a_word_of_its_own() -> None:
    assert {FRICTION[friction_word(state)] for state in STATES} == {*STATES}
    assert len(FRICTION) == len(STATES) == len(SLIDING) + 1
    assert rubbing_word("left", FRICTION["slip-"]) == "left:slip-"


@pytest.mark.parametrize("state", SLIDING)
def test_sliding_sticks_or_turns_when_it_stops(state: int) -> None:
    held, back = after_stop(state)
    assert sticks(held) and not sticks(state)
    assert back == turned(state) != state == turned(back)


def test_what_slides_follows_from_its_velocity_and_its_force() -> None:
    assert friction_word(sliding_with(0.3)) == "slip+"
    assert friction_word(sliding_against(0.3)) == "slip-"
    states = states_of(np.array([0.3, -0.3, 0.1, 0.2]), np.array([0.2, 0.2, 0.2, 0.2]))
    assert [friction_word(state) for state in states] == ["slip+", "slip-", "stick", "stick"]
