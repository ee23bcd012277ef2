"""Words of a sequence, and the modes that follow from them."""

from __future__ import annotations

import pytest

from dmoc.errors import ProblemError
from dmoc.mechanics.modes import Contacts, event_of, mode_of, modes_along, words_after

FEET = Contacts(("left", "right", "wall"), ("left", "right", "rail"))


def along(contacts: list[str], *words: str) -> list[str]:
    events = [event_of(word, FEET) for word in words]
    return [str(mode) for mode in modes_along(mode_of(contacts, FEET), events, FEET)]


def test_contacts_land_stay_and_leave() -> None:
    assert along(["left"], "+right -left", "wall", "+left:slip-", "-right") == [
        "left:stick rail:stick",
        "right:stick rail:stick",
        "right:stick rail:stick",
        "left:slip- right:stick rail:stick",
        "left:slip- rail:stick",
    ]


def test_friction_lasts_until_it_changes_and_ends_with_its_contact() -> None:
    assert along(["left:slip+", "rail:slip-"], "left:stick", "-left rail:stick", "+left") == [
        "left:slip+ rail:slip-",
        "left:stick rail:slip-",
        "rail:stick",
        "left:stick rail:stick",
    ]


@pytest.mark.parametrize(
    ("contacts", "words", "told"),
    [
        ([], ["-left"], "left leaves, but is not closed"),
        (["left"], ["+left"], "left is closed already"),
        (["left"], ["left"], "left is closed already"),
        ([], ["left:slip+"], "left changes its friction, but is not closed"),
        ([], ["+left -left"], "names 'left' twice"),
        ([], ["wall left"], "hits wall and left at once"),
        ([], ["wall +left"], "hits wall and left at once"),
        ([], ["wall:stick"], "unknown tangent 'wall:stick'"),
        ([], ["+wall:slip+"], "expected stick, slip+ or slip-"),
        ([], ["left:fast"], "expected stick, slip+ or slip-"),
        ([], [" "], "unknown surface"),
        ([], ["+foot"], "unknown surface '+foot'"),
        (["foot"], [], "unknown contact 'foot'"),
        (["left", "left"], [], "names 'left' twice"),
        (["wall:slip+"], [], "a contact with friction"),
    ],
)
def test_what_cannot_be_is_a_sentence(contacts: list[str], words: list[str], told: str) -> None:
    with pytest.raises(ProblemError) as found:
        along(contacts, *words)
    assert told in str(found.value) and "\n" not in str(found.value)


def test_words_after_a_mode_are_those_that_are_possible() -> None:
    mode = mode_of(["left"], FEET)
    words = list(words_after(mode, FEET, FEET.surfaces))
    for word in words:
        modes_along(mode, [event_of(word, FEET)], FEET)
    assert {"wall", "wall rail:slip+", "+right", "+right:slip- -left", "-left", "left:slip+"} <= {
        *words
    }
    assert "right" not in words  # a hit with friction has no law
    assert not {"left", "+left", "-right", "right:stick"} & {*words}
    assert len(words) == len(set(words))
