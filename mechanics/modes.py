"""Modes of phases and the events between them, from the words of a sequence.

A mode says which contacts are closed in a phase and how friction acts in it.  The words::

    wall            is hit and released (Newton's law with the surface's restitution)
    +foot           lands plastically and stays closed; it sticks if the model gives it friction
    +foot:slip+     lands sliding, in the direction in which tau grows; slip- in the other one
    -foot           leaves
    foot:slip+      changes its friction; also foot:slip-, foot:stick
    +right -left    several at one event, separated by blanks

A tangent that belongs to no surface, a rail, rubs in every phase.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from dmoc.arguments import check_known, shown
from dmoc.errors import ProblemError
from dmoc.trajectory import FRICTION_WORDS, event_word, mode_word

STICK = 0
FRICTION = {word: state for state, word in FRICTION_WORDS.items()}
IN_SEQUENCE = "in the sequence"


@dataclass(frozen=True)
class Contacts:
    """What can touch in a model: its surfaces, and its tangents, of which those that are named like
    a surface belong to it and the others are rails."""

    surfaces: tuple[str, ...]
    tangents: tuple[str, ...]

    @property
    def rails(self) -> tuple[str, ...]:
        return tuple(t for t in self.tangents if t not in self.surfaces)


@dataclass(frozen=True)
class Mode:
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
    """

    word: str
    hit: str = ""
    lands: tuple[str, ...] = ()
    leaves: tuple[str, ...] = ()
    friction: Mapping[str, int] = field(default_factory=dict)

    @property
    def surface(self) -> str:
        """The surface that is hit, or the first one that lands; empty where there is no impact."""
        return self.hit or (self.lands[0] if self.lands else "")


def event_of(word: str, contacts: Contacts) -> Event:
    """Read one word of a sequence.

    Raises
    ------
    ProblemError
        If a name is unknown, is said twice, or a friction is none.
    """
    hits: list[str] = []
    lands: list[str] = []
    leaves: list[str] = []
    friction: dict[str, int] = {}
    seen: list[str] = []
    for part in word.split():
        sign, rest = (part[0], part[1:]) if part[0] in "+-" else ("", part)
        name, colon, state = rest.partition(":")
        if name in seen:
            raise ProblemError(f"{shown(word)} in the sequence names {name!r} twice: say it once.")
        seen.append(name)
        known = contacts.surfaces if sign or not colon else contacts.tangents
        if name not in known:
            check_known(part, known, "tangent" if colon and not sign else "surface", IN_SEQUENCE)
        if colon:
            if sign == "-" or state not in FRICTION or name not in contacts.tangents:
                raise ProblemError(
                    f"{part!r} in the sequence: expected stick, slip+ or slip- after the colon, of "
                    "a contact that lands or has friction, as '+foot:slip-' or 'foot:stick'."
                )
            friction[name] = FRICTION[state]
        {"": hits if not colon else [], "+": lands, "-": leaves}[sign].append(name)
    if not seen:
        check_known(word, contacts.surfaces, "surface", IN_SEQUENCE)
    if len(hits) > 1 or (hits and lands):
        raise ProblemError(
            f"{word!r} in the sequence hits {' and '.join([*hits, *lands])} at once: expected one "
            "surface that is hit, or contacts that land together."
        )
    order = contacts.surfaces.index
    landing = tuple(sorted(lands, key=order))
    return Event(word, "".join(hits), landing, tuple(sorted(leaves, key=order)), friction)


def mode_of(given: Sequence[str], contacts: Contacts) -> Mode:
    """Read what is closed at the start; what rubs sticks unless it is said to slide.

    Raises
    ------
    ProblemError
        If a name is unknown or a friction is none.
    """
    closed: list[str] = []
    said: dict[str, int] = {}
    for text in given:
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


def _mode(closed: Sequence[str], friction: Mapping[str, int], contacts: Contacts) -> Mode:
    rubs = [t for t in contacts.tangents if t in closed or t not in contacts.surfaces]
    return Mode(
        tuple(s for s in contacts.surfaces if s in closed),
        {t: friction.get(t, STICK) for t in rubs},
    )


def modes_along(start: Mode, events: Sequence[Event], contacts: Contacts) -> tuple[Mode, ...]:
    """The modes of all phases.

    Raises
    ------
    ProblemError
        If an event needs a contact that is open, or closes one that is closed.
    """
    modes = [start]
    for i, event in enumerate(events):
        before = modes[-1]
        at = f"event {i + 1} ({event.word})"
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
        friction = {t: s for t, s in before.rubbing.items() if t not in event.leaves}
        for name in event.friction:
            if name in contacts.surfaces and name not in closed:
                raise ProblemError(
                    f"{at}: {name} changes its friction, but is not closed then: land it before "
                    f"('+{name}'), or close it at the start (contacts=[{name!r}])."
                )
        modes.append(_mode(closed, friction | dict(event.friction), contacts))
    return tuple(modes)


def words_after(mode: Mode, contacts: Contacts, surfaces: Sequence[str]) -> Iterator[str]:
    """Words of what can happen in a mode to some surfaces and to what rubs: hits and landings of
    open surfaces, also those at which a rail changes its friction, and landings at which another
    contact leaves; contacts that leave; changes of friction."""
    is_open = [s for s in surfaces if s not in mode.closed]
    turns = list(_turns(mode))
    of_rails = [turn for turn in turns if turn.split(":")[0] in contacts.rails]
    impacts = [name for name in is_open if name not in contacts.tangents]  # else there is no law
    landings = [
        f"+{name}{state}"
        for name in is_open
        for state in (("", ":slip+", ":slip-") if name in contacts.tangents else ("",))
    ]
    for word in (*impacts, *landings):
        yield word
        yield from (f"{word} {turn}" for turn in of_rails)
    for landing in landings:
        yield from (f"{landing} -{other}" for other in mode.closed if other in surfaces)
    yield from (f"-{name}" for name in mode.closed if name in surfaces)
    yield from turns


def possible_after(mode: Mode, words: Sequence[str], contacts: Contacts) -> Iterator[str]:
    """Those of some words that can happen in a mode, and change it or are an impact."""
    for word in words:
        event = event_of(word, contacts)
        try:
            after = modes_along(mode, [event], contacts)[-1]
        except ProblemError:
            continue
        if event.surface or after != mode:
            yield word


def _turns(mode: Mode) -> Iterator[str]:
    """Changes of friction in a mode."""
    for name, state in mode.rubbing.items():
        yield from (f"{name}:{word}" for word, other in FRICTION.items() if other != state)


def changes(before: Mode, after: Mode) -> dict[str, int]:
    """Friction of the tangents that rub otherwise in the later mode."""
    return {t: s for t, s in after.rubbing.items() if before.rubbing.get(t) != s}


def words_along(modes: Sequence[Mode], events: Sequence[Event]) -> tuple[str, ...]:
    """Each event in words that are the same for the same event, as those of a motion are."""
    return tuple(
        event_word(event.hit, event.lands, event.leaves, changes(*pair))
        for event, pair in zip(events, pairwise(modes), strict=True)
    )
