"""Who touches whom along a motion, as masks of phases and events."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

import dmoc
from dmoc.mechanics.contact_mode import Event, Mode, mode_by_names, names_of
from dmoc.mechanics.contacts import NOWHERE, RAIL, Contacts
from dmoc.mechanics.sequence_words import mode_of, touch_along
from dmoc.mechanics.touch import Touch

FEET = Contacts(("left", "right", "wall"), ("rail", "right", "left"), (), ("left", "right"))


def test_what_words_say_in_numbers() -> None:
    """Left stands, right lands beside it, left leaves while the wall is hit, right turns."""
    words = ["+right:slip+", "wall -left rail:slip-", "right:slip-"]
    touch = touch_along(mode_of(["left:slip-"], FEET), words, FEET)
    assert FEET.supports == (RAIL, 1, 0)
    assert touch.events == (
        Event(lands=(1,), friction=((1, 1),)),
        Event(hit=2, leaves=(0,), friction=((0, -1),)),
        Event(friction=((1, -1),)),
    )
    assert [event.surface for event in touch.events] == [1, 2, NOWHERE]
    assert touch.modes == (
        Mode((0,), (0,), ((2, -1),)),
        Mode((0, 1), (0,), ((1, 1), (2, -1))),
        Mode((1,), (), ((0, -1), (1, 1))),
        Mode((1,), (), ((0, -1), (1, -1))),
    )
    for mode in touch.modes:
        assert (
            mode_by_names(FEET, *names_of(FEET, mode)) == mode == Mode.of(mode.closed, mode.rubbing)
        )


def test_sliding_velocities_are_off_where_they_stick_or_turn() -> None:
    """Of the rail and the left foot, which stick, and the right one, which slides back."""
    touch = touch_along(mode_of(["left", "right:slip-"], FEET), [], FEET)
    rates = np.array([[0.1, 0.2, -0.3], [-0.1, -0.2, 0.3]])
    np.testing.assert_array_equal(touch.astray(0, rates), [[0.1, 0.2, 0.3], [0.1, -0.2, 0.3]])


def test_contacts_open_and_close_in_a_mode() -> None:
    mode = mode_of(["left:slip-", "rail:slip+"], FEET)
    both = mode.closing(1, FEET)
    assert both == mode_of(["left:slip-", "right", "rail:slip+"], FEET)
    assert both.opening(1, FEET) == mode
    assert mode.closing(2, FEET) == Mode((0, 2), (), mode.sliding)
    assert both.with_friction({1: -1}) == mode_of(["left:slip-", "right:slip-", "rail:slip+"], FEET)


def test_masks_have_a_row_for_each_phase_or_event() -> None:
    words = ["+right:slip+", "wall right:slip-", "-right"]
    touch = touch_along(mode_of(["left"], FEET), words, FEET)
    expected = {
        "is_closed": ["L..", "LR.", "LR.", "L.."],
        "signs": ["...", ".+.", ".-.", "..."],
        "rubs": ["r.l", "rrl", "rrl", "r.l"],
        "slides": ["...", ".r.", ".r.", "..."],
        "sticks": ["r.l", "r.l", "r.l", "r.l"],
        "impacts": ["i", "i", "."],
        "beside": ["L..", "LR.", "..."],
        "rubs_in_impact": [".rl", ".rl", "..."],
        "turns": ["...", ".t.", "..."],
        "passes": ["...", "...", "..."],
    }
    for name, rows in expected.items():
        values = np.array([[".+-".find(c) if c in "+-" else c != "." for c in row] for row in rows])
        mask = getattr(touch, name).reshape(values.shape)
        np.testing.assert_array_equal(mask, np.where(values == 2, -1, values), name)
    hit = touch_along(mode_of([], FEET), ["left:slip+:stick"], FEET)
    np.testing.assert_array_equal(hit.passes, [[False, False, True]])
    assert not hit.rubs_in_impact.any() and not hit.free  # the rail rubs


def test_motions_that_touch_alike_are_equal() -> None:
    contacts = Contacts(("wall",), ())
    assert touch_along(Mode(), ["wall"], contacts) == Touch(contacts, (Mode(), Mode()), (Event(0),))
    assert touch_along(Mode(), ["wall"], contacts).free


def test_names_become_numbers_in_one_place() -> None:
    """Mode, event and everything behind them know surfaces and tangents by their numbers."""
    root = Path(next(iter(dmoc.__path__))).resolve()
    sources = [p for end in ("py", "pyx", "pxi") for p in root.glob(f"*/**/*.{end}")]
    pattern = re.compile(r"(surfaces|tangents)\.index\(")
    assert len(sources) > 200
    assert [str(p) for p in sources if pattern.search(p.read_text())] == []
