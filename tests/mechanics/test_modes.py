"""Words of a sequence, and the modes that follow from them."""

from __future__ import annotations

import pytest

from dmoc.base.errors import ProblemError
from dmoc.mechanics import sequence_words
from dmoc.mechanics.contact_mode import COURSES, Course, mode_in_words
from dmoc.mechanics.contacts import NOWHERE, Contacts
from dmoc.mechanics.possible_words import courses_of, possible_after, words_after
from dmoc.mechanics.sequence_words import event_of, mode_of, words_along

FEET = Contacts(("left", "right", "wall"), ("left", "right", "rail"), (), ("left", "right"))


def along(contacts: list[str], *words: str) -> list[str]:
    touch = sequence_words.touch_along(mode_of(contacts, FEET), words, FEET)
    return [mode_in_words(FEET, mode) for mode in touch.modes]


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


def test_words_after_a_mode_are_those_that_are_possible() -> None:
    mode = mode_of(["left"], FEET)
    words = list(words_after(mode, FEET, FEET.surfaces))
    for word in words:
        sequence_words.touch_along(mode, [word], FEET)
    assert {"wall", "wall rail:slip+", "+right", "+right:slip- -left", "-left", "left:slip+"} <= {
        *words
    }
    assert not {"right", "right:slip+"} & {*words}  # tried where words name them
    assert not {"left", "+left", "-right", "right:stick"} & {*words}
    assert len(words) == len(set(words))


def test_what_two_contacts_can_only_do_together_is_possible_too() -> None:
    words = {*words_after(mode_of(["left", "right:slip+"], FEET), FEET, FEET.surfaces)}
    assert {"-left -right", "left:slip- right:slip-"} <= words
    assert not {"left:slip+ right:slip+", "left:stick right:stick"} & words  # one turns alone
    free = {*words_after(mode_of([], FEET), FEET, FEET.surfaces)}
    assert {"+left +right", "+left:slip+ +right:slip+", "+right +wall"} <= free
    assert "+right:slip+ +wall:slip+" not in free  # nothing rubs at the wall


def test_a_contact_that_slides_may_slide_back_after_a_hit() -> None:
    sliding = mode_of(["left:slip+"], FEET)
    assert "wall left:slip-" in list(words_after(sliding, FEET, FEET.surfaces))
    sticking = mode_of(["left"], FEET)
    assert "wall left:slip-" not in list(words_after(sticking, FEET, FEET.surfaces))


def test_a_word_of_an_open_surface_is_a_hit_and_of_a_closed_one_changes_its_friction() -> None:
    words = ["left:slip+", "+left", "left:slip+"]
    hit, _, change = sequence_words.touch_along(mode_of([], FEET), words, FEET).events
    assert hit.hit == 0 and hit.course == Course(1) and not hit.friction
    assert change.hit == NOWHERE and change.course is None and change.friction == ((0, 1),)
    assert along([], *words) == [
        "rail:stick", "rail:stick", "left:stick rail:stick", "left:slip+ rail:stick",
    ]  # fmt: skip


def test_courses_are_read_and_said_in_the_same_words() -> None:
    for course in COURSES[1:]:
        touch = sequence_words.touch_along(mode_of([], FEET), [f"left:{course}"], FEET)
        assert str(touch.events[0].course) == course
        assert words_along(touch) == (f"left:{course}",)
    for word, friction in (("+left:slip+:slip-", "slip-"), ("+left:slip-:stick", "stick")):
        touch = sequence_words.touch_along(mode_of([], FEET), [word], FEET)
        assert mode_in_words(FEET, touch.modes[1]) == f"left:{friction} rail:stick"
        assert words_along(touch) == (word,)


def test_a_hit_without_its_course_stands_for_all_that_are_possible() -> None:
    every = set(courses_of("left", FEET))
    assert len(every) == 10 and every | {"left:stick"} == {f"left:{c}" for c in COURSES[1:]}
    assert set(possible_after(mode_of([], FEET), ["left"], FEET)) == every
    assert every < set(words_after(mode_of([], FEET), FEET, FEET.surfaces))
    assert set(possible_after(mode_of(["right"], FEET), ["left"], FEET)) == every
    sliding = mode_of(["right:slip+"], FEET)
    assert set(possible_after(sliding, ["left"], FEET)) == every
    assert list(possible_after(sliding, ["left right:stick"], FEET)) == []
    plastic = Contacts(FEET.surfaces, FEET.tangents, ("left",), FEET.rough)
    assert set(courses_of("left", plastic)) == {c for c in every if not c.endswith(":late")}
    with pytest.raises(ProblemError, match="leave out ':late'"):
        event_of("left:slip+:stick:late", plastic)
    smooth = Contacts(FEET.surfaces, FEET.tangents)
    assert courses_of("left", smooth) == ["left:slip+", "left:slip-"]
    assert "left" in list(words_after(mode_of([], smooth), smooth, smooth.surfaces))
    with pytest.raises(ProblemError, match="the friction of 'left' is 0"):
        event_of("left:slip+:stick", smooth)
