"""The words of a sequence: modes of phases and the events between them, read and written.

A mode says which contacts are closed in a phase and how friction acts in it.  The words::

    wall            is hit and released (Newton's law with the surface's restitution)
    wall:slip+      the same with friction: slides all along while tau grows; also wall:slip-
    wall:stick      sticks from the beginning
    wall:slip+:stick, wall:slip+:slip-
                    begins to slide in the first way, stops during compression and sticks, or turns
    wall:slip+:stick:late, wall:slip+:slip-:late
                    the same, but it stops during restitution
    wall:slip       slides all along, where the tangent has two directions; also wall:stick
    +foot           lands plastically and stays closed; it sticks if the model gives it friction
    +foot:slip+     lands sliding, in the direction in which tau grows; slip- in the other one
    +foot:slip+:stick, +foot:slip+:slip-
                    begins to slide in the first way, and stops or turns while it lands
    -foot           leaves
    ~table          slips off an end of a surface that has ends, and leaves so
    +hand, -hand    a grip closes, in all its places at once, and lets go
    foot:slip+      changes its friction; also foot:slip-, foot:stick
    +right -left    several at one event, separated by blanks
    gate            an expression of the model vanishes while it grows (its switch ``gate``)

A tangent that belongs to no surface, a rail, rubs in every phase.  An open surface can only be hit,
a closed one only change its friction, so that "foot:slip+" is the one or the other.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import pairwise

from dmoc.base.arguments import check_known, shown
from dmoc.base.errors import ProblemError
from dmoc.mechanics.contact_mode import LATE, Course, Event, Mode
from dmoc.mechanics.contacts import NOWHERE, RAIL, Contacts
from dmoc.mechanics.touch import Touch, friction_changes
from dmoc.motion.friction import (
    FRICTION,
    IN_SPACE,
    STICK,
    STICKING,
    friction_word,
    rubbing_word,
    sticks,
    turned,
)
from dmoc.motion.trajectory import OFF, SIGNS, event_word

IN_SEQUENCE = "in the sequence"


def event_of(word: str, contacts: Contacts, closed: Collection[int] = ()) -> Event:
    """Read one word of a sequence, at which some surfaces are closed before.

    Raises
    ------
    ProblemError
        If a name is unknown, is said twice, or a friction is none.
    """
    hits, lands, leaves, off, seen = (list[str]() for _ in range(5))
    friction, courses = dict[str, int](), dict[str, Course]()
    numbers = contacts.surface_numbers
    if (switch := _switch_in(word, contacts)) is not None:
        return Event(switch=switch)
    for part in word.split():
        sign, rest = (part[0], part[1:]) if part[0] in SIGNS else ("", part)
        name, colon, course_words = rest.partition(":")
        if name in seen:
            raise ProblemError(f"{shown(word)} in the sequence names {name!r} twice: say it once.")
        seen.append(name)
        tangents = tuple(contacts.tangents[k] for k in contacts.lines)
        names = contacts.grasped(contacts.surfaces) if sign or not colon else tangents
        if name not in names:
            plain = contacts.switches if not (sign or colon) else ()
            kinds = ["surface", *["grip"] * bool(contacts.grips), *["switch"] * bool(plain)]
            what = "tangent" if colon and not sign else " or ".join(kinds)
            check_known(part, (*names, *plain), what, IN_SEQUENCE)
        if sign == OFF and name not in contacts.ended:
            raise ProblemError(
                f"{part!r} in the sequence slips off an end of {name!r}, which has none: say "
                f"'-{name}', or where the surface is with `within` of the model."
            )
        if name in contacts.grip_names:
            if colon or not sign:
                raise ProblemError(
                    f"{part!r} in the sequence: {name} is a grip, which is not hit and does not "
                    f"rub; say '+{name}' where it closes and '-{name}' where it lets go."
                )
            (lands if sign == "+" else leaves).extend(contacts.places(name))
            continue
        is_hit = not sign and name in numbers and numbers[name] not in closed
        if colon:
            if name in contacts.frictionless:
                raise ProblemError(
                    f"{part!r} in the sequence: {name} has tangential restitution and no friction, "
                    f"so that there is no way to say; say {sign + name!r}, or give it friction."
                )
            if name in dict(contacts.pairs):
                course = _course_in_space(part, name, course_words, is_hit, contacts)
            else:
                rubs = name in contacts.tangents and sign in ("", "+")
                course = _course(part, course_words, rubs)
            if is_hit or course.then is not None:
                _check_course(part, name, course, (is_hit, sign == "+"), contacts)
                courses[name] = course
            if not is_hit:
                friction[name] = course.last
        {"": hits if is_hit or not colon else [], "+": lands}.get(sign, leaves).append(name)
        if sign == OFF:
            off.append(name)
    if not seen:
        check_known(word, contacts.grasped(contacts.surfaces), "surface", IN_SEQUENCE)
    if len(hits) > 1 or (hits and lands):
        raise ProblemError(
            f"{word!r} in the sequence hits {' and '.join([*hits, *lands])} at once, whose outcome "
            "is not known to be unique: expected one surface that is hit, or contacts that land "
            "together."
        )
    if courses and len(lands) > 1:
        raise ProblemError(
            f"{word!r} in the sequence: when sliding stops depends on the order in which the "
            f"impulses grow, and {' and '.join(lands)} land at once; say where they slide or stick "
            "in the end alone."
        )
    return Event(
        numbers[hits[0]] if hits else NOWHERE,
        tuple(sorted(numbers[name] for name in lands)),
        tuple(sorted(numbers[name] for name in leaves)),
        tuple((contacts.tangent_numbers[name], state) for name, state in friction.items()),
        next(iter(courses.values()), None),
        off=tuple(sorted(numbers[name] for name in off)),
    )


def _switch_in(word: str, contacts: Contacts) -> int | None:
    """The number of a switch that is a word by itself; None for a word without one."""
    for part in word.split():
        name = part[part.startswith(SIGNS) :].partition(":")[0]
        if name in contacts.switches:
            if part != name:
                raise ProblemError(
                    f"{part!r} in the sequence: {name} is a switch, which nothing lands on and "
                    f"nothing rubs at; say {name!r}."
                )
            if word.split() != [name]:
                raise ProblemError(
                    f"{word!r} in the sequence has the switch {name!r} beside something else: what "
                    "happens at once is in no order, so say two events, of which the phase between "
                    "them may be short."
                )
            return contacts.switches.index(name)
    return None


def slides_in_space(name: str) -> str:
    """What does not last of a contact with two tangential directions."""
    return (
        f"the tangent of {name!r} has two directions, and sliding that lasts may turn in them; let "
        "it stick, give it enough friction to, or give its tangent one direction"
    )


def _course_in_space(part: str, name: str, word: str, is_hit: bool, contacts: Contacts) -> Course:
    """Read how a contact with two tangential directions is hit, or that it sticks."""
    if not is_hit and word != STICKING:
        raise ProblemError(f"{part!r} in the sequence: {slides_in_space(name)}.")
    if word not in IN_SPACE:
        raise ProblemError(
            f"{part!r} in the sequence: the tangent of {name!r} has two directions, and the one in "
            f"which it slides is part of the motion; say '{name}:slip' or '{name}:stick'."
        )
    if name not in contacts.rough:
        raise ProblemError(
            f"{part!r} in the sequence: the friction of {name!r} is 0, so that there is no way to "
            f"say; say {name!r}, or give it friction."
        )
    return Course(IN_SPACE[word])


def _course(part: str, course_words: str, rubs: bool) -> Course:
    """Read what a part of a word says after its first colon."""
    first, *more = course_words.split(":")
    late = more[1:] == [LATE]
    turns = not more or (
        first != STICKING and more[0] in FRICTION and more[0] != first and (late or not more[1:])
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
    law = contacts.said_of(name)
    if is_hit and law.whole and course.then is not None:
        raise ProblemError(
            f"{part!r} in the sequence: by {law.name} a hit sticks or slides as a whole; say "
            f"'{name}:stick', '{name}:slip+' or '{name}:slip-'."
        )
    if course.sticks and name not in contacts.rough:
        raise ProblemError(
            f"{part!r} in the sequence sticks, but the friction of {name!r} is 0: nothing would "
            "hold it; say how it slides, or give it friction."
        )


def mode_of(parts: Sequence[str], contacts: Contacts) -> Mode:
    """Read what is closed at the start; what rubs sticks unless it is said to slide.

    Raises
    ------
    ProblemError
        If a name is unknown or a friction is none.
    """
    closed, friction = list[str](), dict[str, int]()
    for text in parts:
        name, colon, state = text.partition(":")
        among = contacts.grasped(contacts.surfaces)
        check_known(name, (*among, *contacts.rails), "contact", "in contacts")
        if name in dict(contacts.pairs) and colon and state != STICKING:
            raise ProblemError(f"{text!r} in contacts: {slides_in_space(name)}.")
        if colon and (state not in FRICTION or name not in contacts.rubbing):
            raise ProblemError(
                f"{text!r} in contacts: expected a contact with friction and stick, slip+ or slip-."
            )
        if name in closed or name in friction:
            raise ProblemError(f"contacts names {name!r} twice: say it once.")
        if name in among:
            closed.append(name)
        if colon:
            friction[name] = FRICTION[state]
    on = [contacts.surface_numbers[place] for name in closed for place in contacts.places(name)]
    return _mode(
        on, {contacts.tangent_numbers[name]: state for name, state in friction.items()}, contacts
    )


def parts_of(mode: Mode, contacts: Contacts) -> list[str]:
    """A mode as the contacts of a problem name it: closed surfaces, and what slides."""
    rubbing, parts = mode.rubbing, list[str]()
    for k in contacts.lines:
        name, j = contacts.tangents[k], contacts.supports[k]
        if j not in mode.closed and j != RAIL:
            continue
        slides = not sticks(rubbing.get(k, STICK))
        word = rubbing_word(name, rubbing[k]) if slides else name
        if ":" in word or word not in contacts.rails:
            parts.append(word)
    closed = contacts.grasped(contacts.named(mode.closed))
    return [*(s for s in closed if s not in contacts.tangents), *parts]


def _mode(closed: Collection[int], friction: Mapping[int, int], contacts: Contacts) -> Mode:
    """The mode in which what rubs has some friction, and sticks where none is said."""
    numbers = [contacts.tangent_numbers[name] for name in contacts.rubbing]
    rubs = [k for k in numbers if contacts.supports[k] in (RAIL, *closed)]
    return Mode.of(closed, {k: friction.get(k, STICK) for k in rubs})


def touch_along(start: Mode, words: Iterable[str], contacts: Contacts) -> Touch:
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
        opening = contacts.named(j for j in event.leaves if j not in before.closed)
        for name in contacts.grasped(opening):
            grip = name in contacts.grip_names
            leaves, land = ("lets go", "close") if grip else ("leaves", "land")
            raise ProblemError(
                f"{at}: {name} {leaves}, but is not closed then: {land} it before ('+{name}'), or "
                f"close it at the start (contacts=[{name!r}])."
            )
        closing = contacts.named(j for j in before.closed if j in (event.hit, *event.lands))
        for name in contacts.grasped(closing):
            go = "go" if name in contacts.grip_names else "leave"
            raise ProblemError(f"{at}: {name} is closed already: let it {go} before ('-{name}').")
        closed = {*before.closed, *event.lands} - {*event.leaves}
        left = {k for k, j in enumerate(contacts.supports) if j in event.leaves}
        friction = {k: s for k, s in before.rubbing.items() if k not in left}
        after = _mode(closed, friction | dict(event.friction), contacts)
        if event.course is not None or is_open(event, contacts):
            _check_holding(at, event, (before, after), contacts)
        for name in contacts.named(j for j in (event.hit,) if j != NOWHERE and after.closed):
            if (law := contacts.said_of(name)).alone:
                raise ProblemError(
                    f"{at}: hits of {name} obey {law.name}, a law of one contact, and "
                    f"{' and '.join(contacts.named(after.closed))} stays closed: let it leave "
                    "before, or give the hit another law of impact."
                )
        events.append(event)
        modes.append(after)
    return Touch(contacts, tuple(modes), tuple(events))


def _check_holding(at: str, event: Event, modes: tuple[Mode, Mode], contacts: Contacts) -> None:
    """Refuse contacts with friction that stop sliding, or turn, where another one has a course."""
    before, after = (mode.rubbing for mode in modes)
    for name in (contacts.tangents[k] for k, _ in contacts.rolling if k in after):
        if contacts.surface_numbers[name] != event.surface:
            raise ProblemError(
                f"{at}: {contacts.surfaces[event.surface]} has a course of friction while {name} "
                "rolls, whose friction has two directions: let one of them leave before."
            )
    for k, s in modes[0].sliding:
        j = contacts.supports[k]
        if j in (RAIL, event.surface) or k not in after or after[k] == before[k]:
            continue
        name, (hit,) = contacts.surfaces[j], contacts.named([event.surface])
        if name in contacts.rough:
            how = "turns" if after[k] == turned(s) else "stops sliding"
            raise ProblemError(
                f"{at}: {name} {how} while {hit} {'lands' if event.lands else 'is hit'} with "
                f"friction in a course of its own, and which of the two changes first is not said: "
                f"let {name} stick before, slide on as {friction_word(s)}, or leave."
            )


def is_open(event: Event, contacts: Contacts) -> bool:
    """Whether an event is a hit with friction whose course is not said."""
    hit = event.hit != NOWHERE and contacts.surfaces[event.hit] in contacts.rough
    return hit and event.course is None


def words_along(touch: Touch) -> tuple[str, ...]:
    """Each event in words that are the same for the same event, as those of a motion are."""
    return tuple(
        word_between(touch.contacts, *pair, event)
        for event, pair in zip(touch.events, pairwise(touch.modes), strict=True)
    )


def word_between(contacts: Contacts, before: Mode, after: Mode, event: Event | None = None) -> str:
    """The word for an event between two modes, with what an event hits and lands; empty where
    nothing happens."""
    event = event or Event()
    if event.switch != NOWHERE:
        return contacts.switches[event.switch]
    hit = contacts.surfaces[event.hit] if event.hit != NOWHERE else ""
    leaves = contacts.named(j for j in before.closed if j not in after.closed)
    lands = contacts.named(j for j in after.closed if j not in before.closed or j in event.lands)
    rubs = {contacts.tangents[k]: s for k, s in friction_changes(before, after).items()}
    if not (hit or lands or leaves or rubs):
        return ""
    own = contacts.grasped(lands), contacts.grasped(leaves)
    return event_word(
        hit, *own, contacts.said(rubs), str(event.course or ""), contacts.named(event.off)
    )
