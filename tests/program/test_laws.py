"""The laws of a program: what each of them numbers."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from contact_problems import against_wall_on_floor, pushers, rimless
from hit_problems import back

import dmoc
from dmoc.program.laws.law import Law
from dmoc.program.transcription import Transcription


def counts(law: Law) -> dict[str, int]:
    """Rows of a law by their names."""
    return {b.name: b.count for b in vars(law).values() if hasattr(b, "missed")}


@pytest.mark.slow
@pytest.mark.parametrize(
    "stated",
    [
        lambda: against_wall_on_floor(4, 0.2),
        lambda: pushers(4),
        lambda: rimless(4),
        lambda: back(sequence=["floor:stick"]),
    ],
)
def test_every_row_belongs_to_one_law(stated: Callable[[], dmoc.Problem]) -> None:
    laws = Transcription(stated()).laws
    held = [b for law in laws for b in vars(law).values() if hasattr(b, "missed")]
    assert {*map(id, held)} == {*map(id, (*laws.equalities, *laws.inequalities))}


def test_contacts_push_by_one_law_and_rub_by_another() -> None:
    """A block slides on a floor in two phases of 10 steps, with a hit of the wall between them."""
    laws = Transcription(against_wall_on_floor(10, 0.25)).laws
    contact, friction, sliding = map(counts, (laws.contact, laws.friction, laws.sliding))
    assert contact == {"closed": 2 * 10, "at rest": 2, "lands": 0, "stays": 1, "opens": 0}
    rows = {name: count for name, count in friction.items() if count}
    assert rows == {"sliding": 2 * 11, "slides": 1}
    rows = {name: count for name, count in sliding.items() if count}
    assert rows == {"direction": 2 * 10, "direction of an impact": 2}
