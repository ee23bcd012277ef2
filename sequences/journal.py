"""Finished nodes on disk (SQLite): a search that was stopped at any moment goes on where it was."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType

from dmoc.base.arguments import place
from dmoc.base.errors import SearchError, SolutionFileError
from dmoc.results.schema import Refused
from dmoc.sequences.nodes import Node

FORMAT = "4"
TABLES = {
    "about": "CREATE TABLE about (name TEXT PRIMARY KEY, value TEXT)",
    "nodes": "CREATE TABLE nodes (sequence TEXT PRIMARY KEY, summary TEXT, solution BLOB)",
}


class Journal:
    """Finished nodes of one search, told from others by a digest of problem and settings.

    A file that is no journal, is damaged, belongs to another search, exists where none shall be
    resumed, or cannot be written is refused, and left as it was.
    """

    def __init__(self, path: str | os.PathLike[str], identity: str, resume: bool) -> None:
        self.path = Path(path)
        self.name = place(self.path)  # in messages
        try:
            filled = self._opened(resume)
            try:
                (self._check if filled else self._make)(identity)
            except BaseException:
                self.close()
                raise
        except (OSError, sqlite3.Error) as error:
            raise SearchError(
                f"{self.name} cannot be used as a journal ({error}): name another file."
            ) from None

    def _opened(self, resume: bool) -> bool:
        """Open the file; whether there is something in it, which a search that was killed at once
        leaves empty."""
        exists = self.path.exists()
        filled = exists and self.path.stat().st_size > 0
        if exists and not self.path.is_file():
            raise SearchError(f"journal {self.name} is a folder or a device: name another file.")
        if filled and not resume:
            raise SearchError(f"journal {self.name} exists: resume it, or name another file.")
        if resume and not exists:
            raise SearchError(
                f"journal {self.name} does not exist: nothing can be resumed from it."
            )
        self.database = sqlite3.connect(self.path, isolation_level=None)
        return filled

    def _make(self, identity: str) -> None:
        """Make all tables at once: a journal is complete or empty."""
        self.database.execute("BEGIN IMMEDIATE")
        for table in TABLES.values():
            self.database.execute(table)
        self.database.executemany(
            "INSERT INTO about VALUES (?, ?)", [("format", FORMAT), ("identity", identity)]
        )
        self.database.execute("COMMIT")

    def _check(self, identity: str) -> None:
        """Look at everything before anything is written."""
        expected: set[tuple[str, str, str | None]] = {
            ("table", name, sql) for name, sql in TABLES.items()
        }
        expected |= {("index", f"sqlite_autoindex_{name}_1", None) for name in TABLES}
        if set(self.database.execute("SELECT type, name, sql FROM sqlite_master")) != expected:
            raise SearchError(f"{self.name} is the database of something else: name another file.")
        if list(self.database.execute("PRAGMA quick_check(1)")) != [("ok",)]:
            raise SearchError(f"journal {self.name} is damaged: start anew with another file.")
        if set(self.database.execute("SELECT name, value FROM about")) != {
            ("format", FORMAT),
            ("identity", identity),
        }:
            raise SearchError(
                f"journal {self.name} belongs to another problem or to other settings: name "
                "another file."
            )

    def finished(self) -> Mapping[tuple[str, ...], Node]:
        try:
            rows = self.database.execute("SELECT sequence, summary, solution FROM nodes")
            nodes = [Node.from_row(*row) for row in rows]
        except (sqlite3.Error, Refused, SolutionFileError):
            raise SearchError(
                f"journal {self.name} is damaged: start anew with another file."
            ) from None
        return {n.sequence: n for n in nodes}

    def add(self, node: Node) -> None:
        self.database.execute("INSERT OR REPLACE INTO nodes VALUES (?, ?, ?)", node.to_row())

    def close(self) -> None:
        self.database.close()

    def __enter__(self) -> Journal:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
