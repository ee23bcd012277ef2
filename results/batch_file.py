"""What the file of a batch holds, column by column."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from dmoc.results.batch import CHECKS, STATUSES, Batch
from dmoc.results.result_file import ResultFile
from dmoc.results.schema import (
    LARGEST_TEXT,
    Choice,
    Context,
    FieldKind,
    Listed,
    Mapped,
    Name,
    Number,
    Put,
    Record,
    Refused,
    Stored,
    Text,
)

FORMAT = 2


@dataclass(frozen=True)
class Repeated:
    """Texts of a column: those there are, and for each row the number of its own."""

    kind: FieldKind

    def write(self, value: Any, where: str, put: Put) -> dict[str, Any]:
        numbers = {text: i for i, text in enumerate(dict.fromkeys(value))}
        at = np.array([numbers[text] for text in value], dtype=float)
        return {
            "texts": Listed(self.kind).write(numbers, f"{where}.texts", put),
            "at": Stored("n").write(at, f"{where}.at", put),
        }

    def read(self, data: Any, where: str, context: Context) -> tuple[str, ...]:
        parts = Record(dict, {"texts": Listed(self.kind), "at": Stored("n")}).read(
            data, where, context
        )
        texts, at = parts["texts"], parts["at"]
        context.check("n", len(at), where)
        if not np.isin(at, np.arange(len(texts))).all():
            raise Refused(f"{where} has a row without a text")
        return tuple(texts[int(i)] for i in at)


def _wrong(batch: Batch) -> str | None:
    """A sentence about columns of a batch that do not fit together."""
    n = len(batch)
    columns = [batch.cost, batch.final_time, batch.collision_times, batch.impulses]
    columns += [batch.iterations, batch.seconds, *batch.varied.values(), *batch.design.values()]
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
        "design": Mapped(Stored("n", special=True), names=Name()),
    },
    _wrong,
    {"given": "varied"},
)


FILE = ResultFile(
    "batch",
    BATCH,
    "batch_format",
    FORMAT,
    "file of a batch",
    "solve the problems again",
    "Batch.save",
    foreign={
        "solution": "the file of a solution: read it with dmoc.Solution.load, or give one that "
        "Batch.save has written"
    },
    excess=lambda _, length: (
        f"the batch has {length} characters of messages, a file holds {LARGEST_TEXT}: write it "
        "with to_csv."
    ),
)
