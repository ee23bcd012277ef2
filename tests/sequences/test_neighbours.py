"""Neighbours of a sequence: in which phases and at which events they differ, and their motions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from dmoc.base.deadline import ENDLESS
from dmoc.guess.folded import Folded
from dmoc.guess.transfer import Piece
from dmoc.mechanics.contacts import Contacts
from dmoc.mechanics.sequence_words import mode_of, touch_along
from dmoc.sequences.neighbours import lifting, neighbours
from dmoc.sequences.traversal import walked

FOOT = Contacts(("foot", "wall"), ("foot",), (), ("foot",))
WALLS = Contacts(("a", "b"), ())
BOX = Contacts(("bl", "br", "tr"), ("bl", "br", "tr"), (), ("bl", "br", "tr"))
BALL = Contacts(("floor",), ("floor",), (), ("floor",))


def motion(events: int) -> Folded:
    """One second a phase, at positions that are the times."""
    pieces = []
    for i in range(events + 1):
        t = np.linspace(i, i + 1, 10)
        pieces.append(Piece(t, t[:, None], np.ones((10, 1)), t, np.zeros((10, 1))))
    return Folded(("",) * events, tuple(pieces), tuple(float(i + 1) for i in range(events)))


def beside(
    contacts: Contacts, start: Sequence[str], *words: str, surfaces: Sequence[int] = ()
) -> dict[tuple[str, ...], Folded | None]:
    touch = touch_along(mode_of(start, contacts), words, contacts)
    return neighbours(touch, motion(len(words)), surfaces)


def test_plain_hits_are_left_out_repeated_and_exchanged() -> None:
    ways = beside(WALLS, [], "a", "b")
    assert set(ways) == {("b",), ("a",), ("a", "a", "b"), ("a", "b", "b"), ("b", "a")}
    assert set(ways.values()) == {None}
    assert set(beside(WALLS, [], "a", "a")) == {("a",), ("a", "a", "a")}


def test_an_event_less_leaves_the_contacts_of_all_other_phases_as_they_are() -> None:
    ways = beside(FOOT, ["foot"], "foot:slip+", "-foot", "+foot")
    assert ("-foot", "+foot") in ways
    assert ("foot:slip+", "foot:stick") in ways  # no flight
    assert ("foot:slip+", "-foot") in ways
    way = ways["foot:slip+", "foot:stick"]
    assert way is not None and [np.ptp(p.t) for p in way.pieces] == [1, 2, 1]
    assert way.impulses == (1.0, 3.0)
    alone = beside(FOOT, ["foot"], "-foot", "+foot")[()]
    assert alone is not None and [np.ptp(p.t) for p in alone.pieces] == [3]


def test_what_is_closed_lifts_while_something_lands() -> None:
    """As one corner of a box that tips over does; what has left before does not."""
    words = "-bl", "+tr:slip+ br:slip+", "-tr"
    touch = touch_along(mode_of(["bl", "br"], BOX), words, BOX)
    (sequence,) = ways = lifting(touch, motion(3))
    assert sequence == ("-bl", "+tr:slip+ -br", "-tr")
    assert [float(np.ptp(p.t)) for p in ways[sequence].pieces] == [1, 1, 1, 1]


def test_friction_is_exchanged_in_every_phase_but_the_first() -> None:
    ways = beside(FOOT, ["foot"], "foot:slip+", "foot:stick")
    assert {("foot:slip-", "foot:stick"), ("foot:slip+", "foot:slip-")} <= set(ways)
    assert ("foot:slip+",) in ways and ("foot:slip-",) not in ways
    box = Contacts(("left", "right"), ("left", "right"), (), ("left", "right"))
    both = beside(box, ["left", "right"], "left:slip+ right:slip+")
    assert ("left:slip- right:slip-",) in both and ("left:slip- right:slip+",) in both


def test_a_foot_hops_and_touches_in_the_middle_of_a_phase() -> None:
    ways = beside(FOOT, ["foot"], "-foot", surfaces=[0])
    assert ("-foot", "+foot", "-foot") in ways  # in its stance; in its flight it is the same
    sliding = beside(FOOT, ["foot:slip+"], "-foot", surfaces=[0])
    assert ("-foot", "+foot:slip+", "-foot") in sliding
    assert ("-foot", "+foot", "-foot") in sliding
    way = sliding["-foot", "+foot:slip+", "-foot"]
    assert way is not None and [round(float(np.ptp(p.t)), 9) for p in way.pieces] == [
        *[round(1 / 3, 9)] * 3, 1,
    ]  # fmt: skip
    assert not any("wall" in word for words in ways for word in words)
    assert ("+wall", "-wall", "-foot") in beside(FOOT, ["foot"], "-foot", surfaces=[0, 1])


def test_a_hit_with_friction_takes_its_other_courses_from_the_same_sliding() -> None:
    words = {word for words in beside(BALL, [], "floor:slip-:stick") for word in words}
    assert words >= {"floor:slip-", "floor:slip-:slip+", "floor:slip-:stick:late"}
    assert not any(word.startswith("floor:slip+") for word in words)


def test_a_best_that_finer_meshes_confirm_has_neighbours_too() -> None:
    """The tree of which nothing else is confirmed goes on where refining has confirmed one."""

    class Refined:
        settings = type("", (), {"progress": None, "seconds": None, "max_nodes": None})()
        waiting = 0

        def __init__(self) -> None:
            self.count, self.confirmed, self.looked_at = 0, False, list[str]()

        def rounds(self) -> Iterator[list[str]]:
            yield from [["proposal"]] * (not self.count)
            yield from [["neighbour"]] * (self.confirmed and "neighbour" not in self.looked_at)

        def solve(self, names: list[str], *_: object) -> Iterator[None]:
            self.looked_at += names
            self.count += len(names)
            yield None

        def refine(self, *_: object) -> Iterator[None]:
            self.confirmed = True
            yield None

    tree: Any = Refined()
    assert walked(tree, lambda *_: iter(()), ENDLESS, 0.0) == ("", "")
    assert tree.looked_at == ["proposal", "neighbour"]
