"""Who touches whom by numbers, each the place of a surface or tangent in the model: the mode that
holds in a phase, and the event at an instant between two."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import replace

from dmoc.base.records import value_class
from dmoc.mechanics.contacts import NOWHERE, RAIL, Contacts
from dmoc.motion.friction import FRICTION, SLIDING, SLIP, STICK, after_stop, friction_word, sticks
from dmoc.motion.trajectory import mode_word

LATE = "late"


@value_class(frozen=True)
class Mode:
    """Closed surfaces, tangents that stick, and tangents that slide with their signs."""

    closed: tuple[int, ...] = ()
    sticking: tuple[int, ...] = ()
    sliding: tuple[tuple[int, int], ...] = ()

    @classmethod
    def of(cls, closed: Iterable[int], rubbing: Mapping[int, int]) -> Mode:
        """The mode of closed surfaces and of the friction of tangents, in the model's order."""
        return cls.in_order(sorted(closed), sorted(rubbing.items()))

    @classmethod
    def in_order(cls, closed: Iterable[int], states: Iterable[tuple[int, int]]) -> Mode:
        """The mode of closed surfaces and of tangents with their friction, in the order given."""
        states = tuple(states)
        still = tuple(k for k, s in states if sticks(s))
        return cls(tuple(closed), still, tuple((k, s) for k, s in states if not sticks(s)))

    @property
    def rubbing(self) -> dict[int, int]:
        """States of friction of the tangents that rub, in the model's order."""
        states = [*((k, STICK) for k in self.sticking), *self.sliding]
        return dict(sorted(states))

    @property
    def free(self) -> bool:
        """Whether nothing touches."""
        return not (self.closed or self.sticking or self.sliding)

    def among(self, closed: Iterable[int], chosen: Callable[[int], bool]) -> Mode:
        """Closed surfaces, in their order, with those of its tangents that are chosen."""
        sticking = tuple(k for k in self.sticking if chosen(k))
        return Mode(tuple(closed), sticking, tuple((k, s) for k, s in self.sliding if chosen(k)))

    def opening(self, j: int, contacts: Contacts) -> Mode:
        """The same mode with surface j open, where nothing rubs then."""
        left = {k: s for k, s in self.rubbing.items() if contacts.supports[k] != j}
        return Mode.of({*self.closed} - {j}, left)

    def closing(self, j: int, contacts: Contacts) -> Mode:
        """The same mode with surface j closed, where what rubs sticks."""
        still = dict.fromkeys(contacts.rubs_on(j), STICK)
        return Mode.of({*self.closed, j}, self.rubbing | still)

    def with_friction(self, changed: dict[int, int]) -> Mode:
        """The same mode with other states of some tangents."""
        return Mode.of(self.closed, self.rubbing | changed)

    def stopping(self, stopped: Collection[int]) -> Mode:
        """The same mode where some tangents do not slide any more, but stick."""
        left = self.among(self.closed, lambda k: k not in stopped)
        return replace(left, sticking=(*left.sticking, *stopped))


FREE = Mode()


def mode_by_names(contacts: Contacts, closed: Iterable[str], rubbing: Mapping[str, int]) -> Mode:
    """The mode of surfaces and tangents by their names, in the order that these have; what rubs
    at an open surface has no part in it."""
    on = tuple(contacts.surface_numbers[name] for name in closed)
    states = [(contacts.tangent_numbers[name], s) for name, s in rubbing.items()]
    states = [(k, s) for k, s in states if contacts.supports[k] in (RAIL, *on)]
    return Mode.in_order(on, states)


def names_of(contacts: Contacts, mode: Mode) -> tuple[tuple[str, ...], dict[str, int]]:
    """Names of the closed surfaces, and the friction of the tangents that rub by name."""
    rubbing = {contacts.tangents[k]: s for k, s in mode.rubbing.items()}
    return contacts.named(mode.closed), rubbing


def mode_in_words(contacts: Contacts, mode: Mode) -> str:
    """A mode as "left:stick rail:slip+"; "free" where nothing touches."""
    closed, rubbing = names_of(contacts, mode)
    return mode_word(contacts.grasped(closed), contacts.said(rubbing))


def without_rails(supports: tuple[int, ...], mode: Mode) -> Mode:
    """A mode as it is during an impact, in which rails have no part."""
    return mode.among(mode.closed, lambda k: supports[k] != RAIL)


@value_class(frozen=True)
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

    @classmethod
    def stopping(cls, first: int, may_be_late: bool) -> list[Course]:
        """Courses that begin to slide in one direction and stop."""
        late = (False, True) if may_be_late else (False,)
        return [cls(first, then, at) for then in after_stop(first) for at in late]

    @classmethod
    def of_hits(cls, contacts: Contacts, name: str) -> list[Course]:
        """All ways through a hit of a surface; that it sticks from the beginning is a limit of two
        others, but where a hit sticks or slides as a whole."""
        law = contacts.said_of(name)
        sliding = [cls(SLIP)] if law.in_space else [cls(s) for s in SLIDING]
        if law.whole:
            return [*sliding, cls(STICK)]
        late = name not in contacts.plastic
        stops = [c for s in SLIDING if name in contacts.rough for c in cls.stopping(s, late)]
        return [*sliding, *sorted(stops, key=lambda course: course.late)]

    @property
    def last(self) -> int:
        """Friction at the end of the impact."""
        return self.first if self.then is None else self.then

    @property
    def sticks(self) -> bool:
        """Whether the contact sticks at any time."""
        return sticks(self.first) or sticks(self.last)

    def __str__(self) -> str:
        words = [friction_word(s) for s in (self.first, self.then) if s is not None]
        return ":".join([*words, LATE] if self.late else words)


# How friction may act in an impact, in words; "" for nothing to tell.
COURSES = ("", *FRICTION, *(str(c) for s in SLIDING for c in Course.stopping(s, True)))


@value_class(frozen=True)
class Event:
    """What happens between two phases.

    Attributes
    ----------
    hit : int
        The surface that is hit and released, or NOWHERE.
    lands, leaves : tuples of int
        Surfaces, in the order of the model.
    friction : tuple of pairs of int
        Tangents and their friction from here on, where the word of the event says it.
    course : Course or None
        How friction acts in the impact, where the word says it: of a hit, or of a landing during
        which sliding stops.
    switch : int
        The crossing function that vanishes, or NOWHERE; then nothing else happens.
    off : tuple of int
        Surfaces of those that leave whose contact slips off an end, in the order of the model.
    """

    hit: int = NOWHERE
    lands: tuple[int, ...] = ()
    leaves: tuple[int, ...] = ()
    friction: tuple[tuple[int, int], ...] = ()
    course: Course | None = None
    switch: int = NOWHERE
    off: tuple[int, ...] = ()

    @property
    def surface(self) -> int:
        """The surface that is hit, or the first one that lands; NOWHERE without an impact."""
        return self.lands[0] if self.lands else self.hit

    @property
    def impact(self) -> bool:
        """Whether something is hit or lands."""
        return self.surface != NOWHERE
