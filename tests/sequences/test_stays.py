"""The stays of a surface among the modes of steps."""

from __future__ import annotations

import pytest

from dmoc.mechanics.contact_mode import Mode
from dmoc.sequences.relaxed_motion import _stays


@pytest.mark.parametrize(
    ("closed", "stays"),
    [
        ("", []), ("0", []), ("000", []), ("1", [(0, 1)]), ("111", [(0, 3)]), ("0110", [(1, 3)]),
        ("1001", [(0, 1), (3, 4)]), ("01011", [(1, 2), (3, 5)]),
    ],
)  # fmt: skip
def test_a_surface_stays_closed_from_its_first_step_to_its_last(
    closed: str, stays: list[tuple[int, int]]
) -> None:
    modes = [Mode((0, 2) if c == "1" else (0,)) for c in closed]
    assert _stays(modes, 2) == stays
    assert _stays(modes, 0) == ([(0, len(modes))] if modes else []) and _stays(modes, 1) == []
