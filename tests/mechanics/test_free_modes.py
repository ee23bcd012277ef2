"""A mode is free where nothing is closed and nothing rubs."""

from __future__ import annotations

import pytest

from dmoc.mechanics.contact_mode import FREE, Mode


@pytest.mark.parametrize(
    "mode", [Mode((0,)), Mode((), (0,)), Mode((), (), ((0, 1),)), Mode((0,), (0,), ((1, -1),))]
)
def test_what_is_closed_sticks_or_slides_is_not_free(mode: Mode) -> None:
    assert not mode.free and FREE.free
