"""What is said of an answer beside its cause, as data, of which messages are made."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from enum import StrEnum
from typing import NamedTuple


class Topic(StrEnum):
    """What a note is about."""

    CONFLICT = "conflict"  # what is missed where there is no feasible point
    STEPS = "steps"  # of a mesh that is too coarse
    OPEN = "open"  # what a minimum does not determine
    DRIFT = "drift"  # what finer and finer meshes do not resolve
    PROPOSAL = "proposal"  # contacts that another sequence would have
    OTHER = "other"


class Note(NamedTuple):
    """A sentence on a topic, and what separates it from what stands before it."""

    topic: Topic
    text: str
    after: str = "; "


def message_of(cause: str, notes: Iterable[Note], without: Collection[Topic] = ()) -> str:
    """A message: the cause, and the notes but for those on some topics."""
    return cause + "".join(n.after + n.text for n in notes if n.topic not in without)


def with_note(notes: tuple[Note, ...], note: Note) -> tuple[Note, ...]:
    """Notes with one in the place of that on its topic, or behind the others."""
    if not any(n.topic is note.topic for n in notes):
        return (*notes, note)
    return tuple(note if n.topic is note.topic else n for n in notes)
