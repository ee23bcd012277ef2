"""The words of what can happen in a mode: what a search tries next."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations

from dmoc.base.errors import ProblemError
from dmoc.mechanics.contact_mode import Course, Event, Mode, names_of
from dmoc.mechanics.contacts import NOWHERE, Contacts
from dmoc.mechanics.sequence_words import is_open, touch_along
from dmoc.mechanics.touch import Touch
from dmoc.motion.friction import FRICTION, SLIDING, rubbing_word, sticks, turned
from dmoc.motion.trajectory import OFF


def courses_of(name: str, contacts: Contacts) -> list[str]:
    """The words of all ways through a hit of one surface."""
    return [f"{name}:{course}" for course in Course.of_hits(contacts, name)]


def words_after(mode: Mode, contacts: Contacts, surfaces: Sequence[str]) -> Iterator[str]:
    """Words of what can happen in a mode to some surfaces and to what rubs: hits and landings of
    open surfaces, also those at which a rail changes its friction, hits at which a closed contact
    slides back, and landings at which another contact leaves; contacts that leave, and
    that slip off an end; changes of friction; and what two contacts, as the corners of a box, can
    only do together."""
    (closed, rubbing), surfaces = names_of(contacts, mode), contacts.grasped(surfaces)
    closed, pairs = contacts.grasped(closed), {n for pair in contacts.pairs for n in pair}
    rubbing = {name: s for name, s in rubbing.items() if name not in pairs}
    open_ones = [s for s in surfaces if s not in closed]
    turns = list(_turns(rubbing))
    of_rails = [turn for turn in turns if turn.split(":")[0] in contacts.rails]
    landing_states = ("", *(rubbing_word("", s) for s in SLIDING))
    impacts = [word for name in open_ones for word in _hits(name, mode, contacts)]
    landings = [
        f"+{name}{state}"
        for name in open_ones
        for state in (landing_states if name in {*contacts.rubbing} - pairs else ("",))
    ]
    for word in (*impacts, *landings):
        yield word
        yield from (f"{word} {turn}" for turn in of_rails)
    slides = [(name, s) for name, s in rubbing.items() if name in closed and not sticks(s)]
    for word in impacts:
        yield from (f"{word} {rubbing_word(name, turned(s))}" for name, s in slides)
    for landing in landings:
        yield from (f"{landing} -{other}" for other in closed if other in surfaces)
    leaving = [f"-{name}" for name in closed if name in surfaces]
    slipping = [f"{OFF}{name}" for name in closed if name in surfaces and name in contacts.ended]
    yield from (*leaving, *slipping, *turns)
    yield from _together(leaving, {name: s for name, s in rubbing.items() if name in closed})
    for state in landing_states:
        both = [n for n in open_ones if not state or n in {*contacts.tangents} - pairs]
        yield from (f"+{a}{state} +{b}{state}" for a, b in combinations(both, 2))


def _together(leaving: Sequence[str], rubbing: Mapping[str, int]) -> Iterator[str]:
    """Words in which all contacts leave at once, or all that rub change their friction to the same
    one."""
    ways = [leaving]
    for word, state in FRICTION.items():
        ways.append([f"{name}:{word}" for name, other in rubbing.items() if other != state])
    yield from (" ".join(way) for way in ways if len(way) > 1)


def _hits(name: str, mode: Mode, contacts: Contacts) -> list[str]:
    """Words for a hit of an open surface.  A hit with friction while something is closed is left to
    the words of the user."""
    if name in contacts.grip_names:
        return []
    if name not in contacts.rough:
        return [name]
    return [] if mode.closed else courses_of(name, contacts)


def possible_after(mode: Mode, words: Sequence[str], contacts: Contacts) -> Iterator[str]:
    """Those of some words that can happen in a mode, and change it or are an impact or a switch; a
    hit with friction whose course is not said stands for all of them."""
    for word in words:
        try:
            touch = touch_along(mode, [word], contacts)
        except ProblemError:
            continue
        (event,), (_, after) = touch.events, touch.modes
        if is_open(event, contacts):
            yield from _with_courses(word, event, contacts)
        elif event.impact or event.switch != NOWHERE or after != mode:
            yield word


def open_hits(touch: Touch, words: Sequence[str]) -> dict[int, list[str]]:
    """Hits with friction whose course is not said, by their places among words, and the words that
    say it."""
    events = zip(words, touch.events, strict=True)
    return {
        i: _with_courses(word, event, touch.contacts)
        for i, (word, event) in enumerate(events)
        if is_open(event, touch.contacts)
    }


def _with_courses(word: str, event: Event, contacts: Contacts) -> list[str]:
    """A word in which the hit takes each of its courses."""
    hit = contacts.surfaces[event.hit]
    rest = [part for part in word.split() if part != hit]
    return [" ".join([way, *rest]) for way in courses_of(hit, contacts)]


def _turns(rubbing: Mapping[str, int]) -> Iterator[str]:
    """Changes of friction in a mode."""
    for name, state in rubbing.items():
        yield from (f"{name}:{word}" for word, other in FRICTION.items() if other != state)
