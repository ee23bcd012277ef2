"""Modes of phases and the events between them, from the words of a sequence.

A mode says which contacts are closed in a phase and how friction acts in it.  The words::

    wall            is hit and released (Newton's law with the surface's restitution)
    wall:slip+      the same with friction: slides all along while tau grows; also wall:slip-
    wall:stick      sticks from the beginning
    wall:slip+:stick, wall:slip+:slip-
                    begins to slide in the first way, stops during compression and sticks, or turns
    wall:slip+:stick:late, wall:slip+:slip-:late
                    the same, but it stops during restitution
    +foot           lands plastically and stays closed; it sticks if the model gives it friction
    +foot:slip+     lands sliding, in the direction in which tau grows; slip- in the other one
    +foot:slip+:stick, +foot:slip+:slip-
                    begins to slide in the first way, and stops or turns while it lands
    -foot           leaves
    foot:slip+      changes its friction; also foot:slip-, foot:stick
    +right -left    several at one event, separated by blanks

A tangent that belongs to no surface, a rail, rubs in every phase.  An open surface can only be hit,
a closed one only change its friction, so that "foot:slip+" is the one or the other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from dmoc.base.arguments import check_known, shown
from dmoc.base.errors import ProblemError
from dmoc.motion.trajectory import FRICTION_WORDS, event_word, mode_word

STICK = 0
LATE = "late"
FRICTION = {word: state for state, word in FRICTION_WORDS.items()}
IN_SEQUENCE = "in the sequence"


@dataclass(frozen=True)
class Contacts:
    """What can touch in a model: its surfaces, and its tangents, of which those that are named like
    a surface belong to it and the others are rails; surfaces without restitution, and those whose
    tangent has friction."""

    surfaces: tuple[str, ...]
    tangents: tuple[str, ...]
    plastic: tuple[str, ...] = ()
    rough: tuple[str, ...] = ()

    @property
    def rails(self) -> tuple[str, ...]:
        return tuple(t for t in self.tangents if t not in self.surfaces)


@dataclass(frozen=True)
class PhaseMode:
    """Surfaces that are closed in a phase, in the order of the model, and the friction of the
    tangents that rub in it: 0 sticks, +1 and -1 slide."""

    closed: tuple[str, ...] = ()
    rubbing: Mapping[str, int] = field(default_factory=dict)

    @property
    def free(self) -> bool:
        """Whether nothing touches."""
        return not (self.closed or self.rubbing)

    @property
    def sticking(self) -> tuple[str, ...]:
        return tuple(t for t, s in self.rubbing.items() if s == STICK)

    def __str__(self) -> str:
        return mode_word(self.closed, self.rubbing)


@dataclass(frozen=True)
class Course:
    """How friction acts in the course of an impact.

    Attributes
    ----------
    first : int
        Direction in which the contact slides at the beginning; 0 where it sticks all along.
    then : int or None
        Friction after sliding has stopped, 0 or the other direction; None if it goes on.
    late : bool
        It stops during restitution, not during compression.
    """

    first: int
    then: int | None = None
    late: bool = False

    @property
    def last(self) -> int:
        """Friction at the end of the impact."""
        return self.first if self.then is None else self.then

    def __str__(self) -> str:
        words = [FRICTION_WORDS[s] for s in (self.first, self.then) if s is not None]
        return ":".join([*words, LATE] if self.late else words)


@dataclass(frozen=True)
class Event:
    """What happens between two phases.

    Attributes
    ----------
    word : str
    hit : str
        The surface that is hit and released; empty where none is.
    lands, leaves : tuples of str
    friction : mapping of str to int
        Friction of tangents from here on, where the word says it.
    course : Course or None
        How friction acts in the impact, where the word says it: of a hit, or of a landing during
        which sliding stops.
    """

    word: str
    hit: str = ""
    lands: tuple[str, ...] = ()
    leaves: tuple[str, ...] = ()
    friction: Mapping[str, int] = field(default_factory=dict)
    course: Course | None = None

    @property
    def surface(self) -> str:
        """The surface that is hit, or the first one that lands; empty where there is no impact."""
        return self.hit or (self.lands[0] if self.lands else "")


def event_of(word: str, contacts: Contacts, closed: Sequence[str] = ()) -> Event:
    """Read one word of a sequence, at which some surfaces are closed before.

    Raises
    ------
    ProblemError
        If a name is unknown, is said twice, or a friction is none.
    """
    hits: list[str] = []
    lands: list[str] = []
    leaves: list[str] = []
    friction: dict[str, int] = {}
    courses: dict[str, Course] = {}
    seen: list[str] = []
    for part in word.split():
        sign, rest = (part[0], part[1:]) if part[0] in "+-" else ("", part)
        name, colon, said = rest.partition(":")
        if name in seen:
            raise ProblemError(f"{shown(word)} in the sequence names {name!r} twice: say it once.")
        seen.append(name)
        names = contacts.surfaces if sign or not colon else contacts.tangents
        if name not in names:
            check_known(part, names, "tangent" if colon and not sign else "surface", IN_SEQUENCE)
        is_hit = not sign and name in contacts.surfaces and name not in closed
        if colon:
            course = _course(part, said, name in contacts.tangents and sign != "-")
            if is_hit or course.then is not None:
                _check_course(part, name, course, (is_hit, sign == "+"), contacts)
                courses[name] = course
            if not is_hit:
                friction[name] = course.last
        {"": hits if is_hit or not colon else [], "+": lands, "-": leaves}[sign].append(name)
    if not seen:
        check_known(word, contacts.surfaces, "surface", IN_SEQUENCE)
    if len(hits) > 1 or (hits and lands):
        raise ProblemError(
            f"{word!r} in the sequence hits {' and '.join([*hits, *lands])} at once: expected one "
            "surface that is hit, or contacts that land together."
        )
    if courses and len(lands) > 1:
        raise ProblemError(
            f"{word!r} in the sequence: sliding that stops during an impact is known for one "
            f"contact alone, and {' and '.join(lands)} land at once; say where they slide or stick "
            "in the end alone."
        )
    order = contacts.surfaces.index
    landing = tuple(sorted(lands, key=order))
    return Event(
        word,
        "".join(hits),
        landing,
        tuple(sorted(leaves, key=order)),
        friction,
        next(iter(courses.values()), None),
    )


def _course(part: str, said: str, rubs: bool) -> Course:
    """Read what a part of a word says after its first colon."""
    first, *more = said.split(":")
    late = more[1:] == [LATE]
    turns = not more or (
        first != "stick" and more[0] in FRICTION and more[0] != first and (late or not more[1:])
    )
    if not rubs or first not in FRICTION or not turns:
        raise ProblemError(
            f"{part!r} in the sequence: expected stick, slip+ or slip- after the colon, of a "
            "contact that lands, is hit or has friction, as '+foot:slip-' or 'foot:stick'; of an "
            "impact also what follows when it stops, as 'wall:slip+:stick' or "
            "'wall:slip+:slip-:late'."
        )
    return Course(FRICTION[first], FRICTION[more[0]] if more else None, late)


def _check_course(
    part: str, name: str, course: Course, how: tuple[bool, bool], contacts: Contacts
) -> None:
    """Refuse a course that no impact on a surface takes, which is hit or lands."""
    is_hit, lands = how
    if not is_hit and not lands:
        raise ProblemError(
            f"{part!r} in the sequence: {name} is closed or a rail, which changes its friction "
            "once at an event; say stick, slip+ or slip-."
        )
    if course.late and (lands or name in contacts.plastic):
        raise ProblemError(
            f"{part!r} in the sequence stops during a restitution, which there is none of: a "
            "landing and a hit with restitution 0 are compression alone; leave out ':late'."
        )
    if STICK in (course.first, course.then) and name not in contacts.rough:
        raise ProblemError(
            f"{part!r} in the sequence sticks, but the friction of {name!r} is 0: nothing would "
            "hold it; say how it slides, or give it friction."
        )


def mode_of(parts: Sequence[str], contacts: Contacts) -> PhaseMode:
    """Read what is closed at the start; what rubs sticks unless it is said to slide.

    Raises
    ------
    ProblemError
        If a name is unknown or a friction is none.
    """
    closed: list[str] = []
    said: dict[str, int] = {}
    for text in parts:
        name, colon, state = text.partition(":")
        check_known(name, (*contacts.surfaces, *contacts.rails), "contact", "in contacts")
        if colon and (state not in FRICTION or name not in contacts.tangents):
            raise ProblemError(
                f"{text!r} in contacts: expected a contact with friction and stick, slip+ or slip-."
            )
        if name in closed or name in said:
            raise ProblemError(f"contacts names {name!r} twice: say it once.")
        if name in contacts.surfaces:
            closed.append(name)
        if colon:
            said[name] = FRICTION[state]
    return _mode(closed, said, contacts)


def _mode(closed: Sequence[str], friction: Mapping[str, int], contacts: Contacts) -> PhaseMode:
    rubs = [t for t in contacts.tangents if t in closed or t not in contacts.surfaces]
    return PhaseMode(
        tuple(s for s in contacts.surfaces if s in closed),
        {t: friction.get(t, STICK) for t in rubs},
    )


def along(
    start: PhaseMode, words: Sequence[str], contacts: Contacts
) -> tuple[tuple[Event, ...], tuple[PhaseMode, ...]]:
    """The events that words say from a mode on, and the modes of all phases.

    Raises
    ------
    ProblemError
        If a word is none, or an event needs a contact that is open, or closes one that is closed.
    """
    events, modes = list[Event](), [start]
    for i, word in enumerate(words):
        before = modes[-1]
        event, at = event_of(word, contacts, before.closed), f"event {i + 1} ({word})"
        for name in event.leaves:
            if name not in before.closed:
                raise ProblemError(
                    f"{at}: {name} leaves, but is not closed then: land it before ('+{name}'), or "
                    f"close it at the start (contacts=[{name!r}])."
                )
        for name in (*event.lands, *([event.hit] if event.hit else [])):
            if name in before.closed:
                raise ProblemError(
                    f"{at}: {name} is closed already: let it leave before ('-{name}')."
                )
        closed = [s for s in before.closed if s not in event.leaves] + list(event.lands)
        rubs = event.course is not None or is_open(event, contacts)
        if rubs and set(closed) - {event.surface}:
            raise ProblemError(_several(at, event, closed))
        friction = {t: s for t, s in before.rubbing.items() if t not in event.leaves}
        events.append(event)
        modes.append(_mode(closed, friction | dict(event.friction), contacts))
    return tuple(events), tuple(modes)


def _several(at: str, event: Event, closed: Sequence[str]) -> str:
    others = " and ".join(name for name in closed if name != event.surface)
    return (
        f"{at}: {others} is closed while {event.surface} is hit with friction, whose law is known "
        "for one contact alone: let the others leave before."
    )


def is_open(event: Event, contacts: Contacts) -> bool:
    """Whether an event is a hit with friction whose course is not said."""
    return event.course is None and event.hit in contacts.rough


def changes(before: PhaseMode, after: PhaseMode) -> dict[str, int]:
    """Friction of the tangents that rub otherwise in the later mode."""
    return {t: s for t, s in after.rubbing.items() if before.rubbing.get(t) != s}


def words_along(modes: Sequence[PhaseMode], events: Sequence[Event]) -> tuple[str, ...]:
    """Each event in words that are the same for the same event, as those of a motion are."""
    return tuple(
        word_between(*pair, event) for event, pair in zip(events, pairwise(modes), strict=True)
    )


def word_between(before: PhaseMode, after: PhaseMode, event: Event | None = None) -> str:
    """The word for an event between two modes, with what an event hits and lands; empty where
    nothing happens."""
    hit, lands = ("", ()) if event is None else (event.hit, event.lands)
    leaves = tuple(name for name in before.closed if name not in after.closed)
    lands = tuple(name for name in after.closed if name not in before.closed or name in lands)
    course = "" if event is None or event.course is None else str(event.course)
    rubs = changes(before, after)
    if not (hit or lands or leaves or rubs):
        return ""
    return event_word(hit, lands, leaves, rubs, course)
