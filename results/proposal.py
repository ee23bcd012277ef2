"""What to try instead of the sequence of a motion whose contacts stay at the edges of their modes:
plain data, which read as text."""

from __future__ import annotations

from dmoc.base.records import value_class
from dmoc.motion.friction import FRICTION, STICKING

# What a contact does where it is open and where it is closed; the other words are of friction.
OPEN, CLOSED = "open", "closed"
CONTACT_STATES = (OPEN, CLOSED, *FRICTION)


@value_class(frozen=True)
class Stay:
    """A part of a phase in which a contact stays at the edge of its mode: at rest where it should
    slide, at the limit of its friction where it sticks, or without a force where it is closed.

    Attributes
    ----------
    phase : int
    contact : str
        A surface, or a tangent that rubs.
    begin, end : float
        Times in seconds.
    mode, cheaper : str
        What the contact does in the phase, and what would cost less there: "stick", "slip+",
        "slip-", "closed" or "open".
    """

    phase: int
    contact: str
    begin: float
    end: float
    mode: str
    cheaper: str

    def __str__(self) -> str:
        does, better = "sticks at the limit of its friction", "sliding"
        if self.cheaper == OPEN:
            does, better = "does not press", "leaving"
        elif self.cheaper == STICKING:
            does, better = "is at rest", "sticking"
        return (
            f"{self.contact} ({self.mode} in phase {self.phase}) {does} from {self.begin:.4g} to "
            f"{self.end:.4g} s, where {better} would cost less"
        )


@value_class(frozen=True)
class Proposal:
    """A sequence that may cost less than that of a motion; as text, why, and the words to try.

    Attributes
    ----------
    stays : tuple of Stay
        Where contacts of the motion stay at the edges of their modes.
    sequence : tuple of str
        The words with the modes that would cost less.
    times : tuple of float
        When these events would be in the motion as it is, in seconds: a start for the sequence.
    contacts : tuple of str or None
        What is closed at the start, where it is something else than in the motion.
    """

    stays: tuple[Stay, ...]
    sequence: tuple[str, ...]
    times: tuple[float, ...]
    contacts: tuple[str, ...] | None = None

    def __str__(self) -> str:
        start = "" if self.contacts is None else f"contacts={list(self.contacts)}, "
        return f"{'; '.join(map(str, self.stays))}: try {start}sequence={list(self.sequence)}"
