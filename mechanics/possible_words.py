"""The words of what can happen in a mode: what a search tries next."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from dmoc.base.errors import ProblemError
from dmoc.mechanics.modes import FRICTION, STICK, Contacts, Course, PhaseMode, along, is_open
from dmoc.motion.trajectory import FRICTION_WORDS


def courses_of(name: str, contacts: Contacts) -> list[str]:
    """The words of all ways through a hit of one surface; that it sticks from the beginning is a
    limit of two others."""
    courses = [Course(s) for s in (1, -1)]
    if name in contacts.rough:
        courses += [Course(s, then) for s in (1, -1) for then in (STICK, -s)]
        if name not in contacts.plastic:
            courses += [replace(course, late=True) for course in courses[2:]]
    return [f"{name}:{course}" for course in courses]


def words_after(mode: PhaseMode, contacts: Contacts, surfaces: Sequence[str]) -> Iterator[str]:
    """Words of what can happen in a mode to some surfaces and to what rubs: hits and landings of
    open surfaces, also those at which a rail changes its friction, hits at which a closed contact
    slides back, and landings at which another contact leaves; contacts that leave; changes of
    friction."""
    open_ones = [s for s in surfaces if s not in mode.closed]
    turns = list(_turns(mode))
    of_rails = [turn for turn in turns if turn.split(":")[0] in contacts.rails]
    impacts = [word for name in open_ones for word in _hits(name, mode, contacts)]
    landings = [
        f"+{name}{state}"
        for name in open_ones
        for state in (("", ":slip+", ":slip-") if name in contacts.tangents else ("",))
    ]
    for word in (*impacts, *landings):
        yield word
        yield from (f"{word} {turn}" for turn in of_rails)
    for word in impacts:
        yield from (f"{word} {name}:{FRICTION_WORDS[-s]}" for name, s in _slide(mode))
    for landing in landings:
        yield from (f"{landing} -{other}" for other in mode.closed if other in surfaces)
    yield from (f"-{name}" for name in mode.closed if name in surfaces)
    yield from turns


def _hits(name: str, mode: PhaseMode, contacts: Contacts) -> list[str]:
    """Words for a hit of an open surface; one with friction has a law only where nothing else is
    closed."""
    if name not in contacts.rough:
        return [name]
    return [] if mode.closed else courses_of(name, contacts)


def possible_after(mode: PhaseMode, words: Sequence[str], contacts: Contacts) -> Iterator[str]:
    """Those of some words that can happen in a mode, and change it or are an impact; a hit with
    friction whose course is not said stands for all of them."""
    for word in words:
        try:
            (event,), (_, after) = along(mode, [word], contacts)
        except ProblemError:
            continue
        if is_open(event, contacts):
            rest = [part for part in word.split() if part != event.hit]
            hits = _hits(event.hit, mode, contacts)
            yield from (" ".join([hit, *rest]) for hit in hits)
        elif event.surface or after != mode:
            yield word


def _slide(mode: PhaseMode) -> list[tuple[str, int]]:
    """Closed contacts that slide, and their directions."""
    return [(name, s) for name, s in mode.rubbing.items() if name in mode.closed and s != STICK]


def _turns(mode: PhaseMode) -> Iterator[str]:
    """Changes of friction in a mode."""
    for name, state in mode.rubbing.items():
        yield from (f"{name}:{word}" for word, other in FRICTION.items() if other != state)
