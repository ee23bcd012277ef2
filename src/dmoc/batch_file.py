"""What the file of a batch holds, column by column, and how it is written and read."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from dmoc.archive import Archive, pack
from dmoc.batch import CHECKS, STATUSES, Batch
from dmoc.errors import OutputError, SolutionFileError
from dmoc.schema import (
    LARGEST_TEXT,
    Choice,
    Context,
    Kind,
    Listed,
    Mapped,
    Name,
    Number,
    Put,
    Record,
    Refused,
    Stored,
    Text,
    dumped,
    plain,
    said,
)

FORMAT = 1


@dataclass(frozen=True)
class Repeated:
    """Texts of a column: those there are, and for each row the number of its own."""

    kind: Kind

    def write(self, value: Any, where: str, put: Put) -> dict[str, Any]:
        numbers = {text: i for i, text in enumerate(dict.fromkeys(value))}
        at = np.array([numbers[text] for text in value], dtype=float)
        return {
            "texts": Listed(self.kind).write(numbers, f"{where}.texts", put),
            "at": Stored("n").write(at, f"{where}.at", put),
        }

    def read(self, given: Any, where: str, context: Context) -> tuple[str, ...]:
        found = Record(dict, {"texts": Listed(self.kind), "at": Stored("n")}).read(
            given, where, context
        )
        texts, at = found["texts"], found["at"]
        context.check("n", len(at), where)
        if not np.isin(at, np.arange(len(texts))).all():
            raise Refused(f"{where} has a row without a text")
        return tuple(texts[int(i)] for i in at)


def _wrong(batch: Batch) -> str | None:
    """What of a batch does not fit together."""
    n = len(batch)
    columns = [batch.cost, batch.final_time, batch.collision_times, batch.impulses]
    columns += [batch.iterations, batch.seconds, *batch.given.values()]
    if {len(column) for column in columns} - {n}:
        return "its columns have different lengths"
    if not (batch.iterations == np.floor(np.abs(batch.iterations))).all():
        return "a number of iterations is no whole number"
    return None


# One line for each field; n rows, and the most collisions c of any.
BATCH = Record(
    Batch,
    {
        "given": Mapped(Stored("n", special=True), names=Text()),
        "status": Repeated(Choice(STATUSES)),
        "message": Repeated(Text()),
        "cost": Stored("n", special=True),
        "final_time": Stored("n", special=True),
        "collisions": Repeated(Text()),
        "collision_times": Stored("n", "c", special=True),
        "impulses": Stored("n", "c", special=True),
        "iterations": Stored("n"),
        "check": Repeated(Choice(CHECKS)),
        "seconds": Stored("n", special=True),
        "method": Name(),
        "total_seconds": Number(),
    },
    _wrong,
)
FILE = Record(dict, {"batch_format": Choice((FORMAT,)), "batch": BATCH})


def content_of(batch: Batch) -> bytes:
    """Return the content of a file.

    Raises
    ------
    OutputError
        If the messages are more than it can hold.
    """
    arrays: dict[str, Any] = {}
    text = dumped(FILE, {"batch_format": FORMAT, "batch": batch}, arrays.__setitem__)
    if len(text) > LARGEST_TEXT:
        raise OutputError(
            f"the batch has {len(text)} characters of messages, a file holds {LARGEST_TEXT}: write "
            "it with to_csv."
        )
    return pack(text, arrays)


def batch_in(content: bytes, name: str) -> Batch:
    """Read a batch from the content of a file that errors call ``name``."""
    try:
        archive = Archive(content)
        header = plain(archive.text())
        version = header.get("batch_format") if isinstance(header, dict) else None
        if isinstance(version, int) and version != FORMAT:
            raise SolutionFileError(
                f"{name} has format {said(version)}, expected {FORMAT}: solve the problems again."
            )
        batch: Batch = FILE.read(header, "", Context(archive.array))["batch"]
        archive.close()
    except Refused as error:
        raise SolutionFileError(
            f"{name} is damaged or no file of a batch ({error}): write it again with Batch.save."
        ) from None
    return batch
