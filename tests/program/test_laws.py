"""The laws of a program: what each of them numbers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from contact_problems import against_wall_on_floor, pushers, rimless
from hit_problems import back

import dmoc
from dmoc.motion.friction import STICK
from dmoc.program.laws.law import Law
from dmoc.program.laws.tangential import returned
from dmoc.program.transcription import Transcription


@pytest.mark.parametrize(
    ("mu", "tangential", "friction"),
    [(1.0, -4 / 7, STICK), (0.39, -4 / 7, STICK), (0.36, -0.54, 1), (0.2, -0.3, 1)],
)
def test_a_hit_that_returns_sticks_up_to_its_cone_of_friction(
    mu: float, tangential: float, friction: int
) -> None:
    """A disc that meets a floor at rates -1 and 2 with e = 1/2, e_t = 0: impulses 3/2 and -4/7,
    which friction of 8/21 holds."""
    hit = returned(np.array([-1.0, 2.0]), np.diag([1.0, 3.5]), mu, 0.5, 0.0)
    assert hit.impulses == pytest.approx([1.5, tangential]) and hit.friction == friction


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
