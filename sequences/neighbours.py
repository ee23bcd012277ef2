"""The neighbours of a sequence: what happens otherwise in one phase or at one event of its motion.

A sequence is taken as its phases, each with the event that begins it, so that contacts and friction
stay what they are in all other phases, whatever words that needs.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from dmoc.guess.folded import Folded
from dmoc.guess.transfer import Piece
from dmoc.mechanics.contact_mode import Course, Event, Mode
from dmoc.mechanics.contacts import NOWHERE, RAIL, Contacts
from dmoc.mechanics.sequence_words import word_between
from dmoc.mechanics.touch import Touch
from dmoc.motion.friction import STATES, sticks

Words = tuple[str, ...]
# Steps of a phase that is cut in three, at least.
FEWEST = 6


@dataclass(frozen=True)
class EventPhase:
    """A phase with the event that begins it, its motion and the impulse of the event."""

    event: Event
    mode: Mode
    piece: Piece
    impulse: float = 0.0


def neighbours(touch: Touch, motion: Folded, surfaces: Sequence[int]) -> dict[Words, Folded | None]:
    """Neighbours, and the motion that each has from this one: with one event less, other friction
    in a phase, another course of a hit; with a phase in which one contact is open that is closed
    before and after it, or one of some surfaces is closed that is open.  With one hit more beside
    one of its own, one less, and two exchanged, it has none."""
    contacts, phases = touch.contacts, _phases(touch, motion)
    own, hits = (
        words_and_motion(contacts, phases)[0],
        [words_and_motion(contacts, other)[0] for other in _hits(phases)],
    )
    ways = dict[Words, Folded | None].fromkeys(hits)
    for other in (
        *_less(phases),
        *_rubbing(phases, contacts),
        *_touching(phases, surfaces, contacts),
    ):
        words, way = words_and_motion(contacts, other)
        ways.setdefault(words, way)
    ways.pop(own, None)
    return ways


def shorter(touch: Touch, motion: Folded) -> dict[Words, Folded]:
    """Sequences with one event less, with their motions."""
    return dict(words_and_motion(touch.contacts, other) for other in _less(_phases(touch, motion)))


def lifting(touch: Touch, motion: Folded) -> dict[Words, Folded]:
    """Sequences in which a closed contact lifts while another one lands, as a rocking block does,
    with their motions."""
    contacts, phases, ways = touch.contacts, _phases(touch, motion), dict[Words, Folded]()
    for i, (before, after) in enumerate(pairwise(phases), 1):
        staying = {*before.mode.closed} & {*after.mode.closed}
        if staying == {*after.mode.closed}:
            continue
        for j in sorted(staying):
            opened = [replace(p, mode=p.mode.opening(j, contacts)) for p in phases[i:]]
            words, way = words_and_motion(contacts, [*phases[:i], *opened])
            ways[words] = way
    return ways


def words_and_motion(contacts: Contacts, phases: Sequence[EventPhase]) -> tuple[Words, Folded]:
    """The words of phases, and their motion; those between which nothing happens are one."""
    words, names, impulses = list[str](), list[str](), list[float]()
    pieces = [phases[0].piece]
    for before, after in pairwise(phases):
        word, hit = word_between(contacts, before.mode, after.mode, after.event), after.event.hit
        if word:
            words.append(word)
            names.append("" if hit == NOWHERE else contacts.surfaces[hit])
            pieces.append(after.piece)
            impulses.append(after.impulse)
        else:
            pieces[-1] = pieces[-1].followed_by(after.piece)
    return tuple(words), Folded(tuple(names), tuple(pieces), tuple(impulses))


def _phases(touch: Touch, motion: Folded) -> list[EventPhase]:
    """Events keep what is hit, and how, and switches; that a contact lands is in the modes, and by
    which course it came to slide or stick is left to the program."""
    hits = [
        Event(e.hit, course=e.course) if e.hit != NOWHERE else Event(switch=e.switch)
        for e in touch.events
    ]
    parts = zip([Event(), *hits], touch.modes, motion.pieces, (0.0, *motion.impulses), strict=True)
    return [EventPhase(*part) for part in parts]


def _hits(phases: list[EventPhase]) -> Iterator[list[EventPhase]]:
    """Phases with one hit of a surface, at which nothing else changes, left out or repeated; or
    with two exchanged."""
    plain = [False] + [b.event.hit != NOWHERE and a.mode == b.mode for a, b in pairwise(phases)]
    for i, phase in enumerate(phases):
        if plain[i]:
            yield [*phases[:i], *phases[i + 1 :]]
            yield [*phases[: i + 1], phase, *phases[i + 1 :]]
            if plain[i + 1 : i + 2] == [True]:
                yield [*phases[:i], phases[i + 1], phase, *phases[i + 2 :]]


def _less(phases: list[EventPhase]) -> Iterator[list[EventPhase]]:
    """Without one of the events and the phase that it begins."""
    for i in range(1, len(phases)):
        longer = replace(phases[i - 1], piece=phases[i - 1].piece.followed_by(phases[i].piece))
        yield [*phases[: i - 1], longer, *phases[i + 1 :]]


def _rubbing(phases: list[EventPhase], contacts: Contacts) -> Iterator[list[EventPhase]]:
    """Phases with other friction after an event, of one contact or of all, or with another course
    of a hit from the same sliding."""
    for i, phase in enumerate(phases[1:], 1):
        fixed = {k for pair in contacts.rolling for k in pair}
        rubbing = [k for k in phase.mode.rubbing if k not in fixed]
        at_surfaces = [k for k in rubbing if contacts.supports[k] != RAIL]
        ways = [{k: s} for s in STATES for k in rubbing]
        ways += [dict.fromkeys(at_surfaces, s) for s in STATES]
        for way in ways:
            yield _with(phases, i, replace(phase, mode=phase.mode.with_friction(way)))
        for course in _other_courses(phase.event, contacts):
            yield _with(phases, i, replace(phase, event=replace(phase.event, course=course)))


def _other_courses(event: Event, contacts: Contacts) -> list[Course]:
    if event.course is None or contacts.surfaces[event.hit] not in contacts.rough:
        return []
    if contacts.said_of(contacts.surfaces[event.hit]).whole:
        ways = Course.of_hits(contacts, contacts.surfaces[event.hit])
        return [course for course in ways if course != event.course]
    s, late = event.course.first, contacts.surfaces[event.hit] not in contacts.plastic
    return [] if sticks(s) else [Course(s), *Course.stopping(s, late)]


def other_returns(touch: Touch, words: Sequence[str]) -> Iterator[tuple[str, ...]]:
    """Words in which one hit that sticks or slides as a whole goes another way."""
    for i, event in enumerate(touch.events):
        if event.course is None or event.hit == NOWHERE:
            continue
        name = touch.contacts.surfaces[event.hit]
        if touch.contacts.said_of(name).whole:
            for course in _other_courses(event, touch.contacts):
                other = words[i].replace(f"{name}:{event.course}", f"{name}:{course}")
                yield (*words[:i], other, *words[i + 1 :])


def _touching(
    phases: list[EventPhase], surfaces: Sequence[int], contacts: Contacts
) -> Iterator[list[EventPhase]]:
    """Phases with one more in the middle of another, in which a surface is open, or closed, that is
    not before and after it."""
    for i, phase in enumerate(phases):
        if len(phase.piece.t) <= FEWEST:
            continue
        first, middle, last = _in_three(phase.piece)
        for j in surfaces:
            other = phase.mode.opening if j in phase.mode.closed else phase.mode.closing
            between = EventPhase(Event(), other(j, contacts), middle)
            after = EventPhase(Event(), phase.mode, last)
            yield [*phases[:i], replace(phase, piece=first), between, after, *phases[i + 1 :]]


def _with(phases: list[EventPhase], i: int, other: EventPhase) -> list[EventPhase]:
    return [*phases[:i], other, *phases[i + 1 :]]


def _in_three(piece: Piece) -> list[Piece]:
    third = (len(piece.t) - 1) // 3
    parts = (slice(third + 1), slice(third, -third), slice(-third - 1, None))
    return [replace(piece, t=piece.t[p], q=piece.q[p], v=piece.v[p], forces={}) for p in parts]
