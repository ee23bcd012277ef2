"""Finished nodes on disk (SQLite): a search that was stopped at any moment goes on where it was."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType

from dmoc.errors import SearchError, SolutionFileError
from dmoc.sequences.nodes import Node

FORMAT = "1"


class Journal:
    """Finished nodes of one search.

    Parameters
    ----------
    path : path
    identity : str
        Digest of problem and settings; a journal of another identity is refused.
    resume : bool
        Go on with the nodes of an existing journal; without it an existing journal is an error, so that nothing is lost.

    Raises
    ------
    SearchError
        If the file is no journal, belongs to another problem, exists without ``resume``, or cannot be written.
    """

    def __init__(self, path: str | os.PathLike[str], identity: str, resume: bool) -> None:
        self.path = Path(path)
        exists = self.path.exists() and self.path.stat().st_size > 0  # a search that was killed at once leaves an empty file
        if exists and not resume:
            raise SearchError(f"journal {self.path} exists: resume it, or name another file.")
        if resume and not self.path.exists():
            raise SearchError(f"journal {self.path} does not exist: nothing can be resumed from it.")
        try:
            self.database = sqlite3.connect(self.path, isolation_level=None)
            tables = {name for (name,) in self.database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
            if tables and tables != {"about", "nodes"}:
                raise SearchError(f"{self.path} is the database of something else: name another file.")
            if not tables:
                # All at once: a journal is complete or empty.
                self.database.execute("BEGIN IMMEDIATE")
                self.database.execute("CREATE TABLE about (name TEXT PRIMARY KEY, value TEXT)")
                self.database.execute("CREATE TABLE nodes (sequence TEXT PRIMARY KEY, summary TEXT, solution BLOB)")
                self.database.executemany("INSERT INTO about VALUES (?, ?)", [("format", FORMAT), ("identity", identity)])
                self.database.execute("COMMIT")
            known = dict(self.database.execute("SELECT name, value FROM about"))
        except sqlite3.Error as error:
            raise SearchError(f"{self.path} cannot be used as a journal ({error}): name another file.") from None
        if known.get("format") != FORMAT or known.get("identity") != identity:
            self.close()
            raise SearchError(f"journal {self.path} belongs to another problem or to other settings: name another file.")

    def finished(self) -> Mapping[tuple[str, ...], Node]:
        try:
            rows = self.database.execute("SELECT summary, solution FROM nodes").fetchall()
            nodes = [Node.from_row(summary, data) for summary, data in rows]
        except (sqlite3.Error, ValueError, KeyError, SolutionFileError):
            raise SearchError(f"journal {self.path} is damaged: start anew with another file.") from None
        return {n.sequence: n for n in nodes}

    def add(self, node: Node) -> None:
        self.database.execute("INSERT OR REPLACE INTO nodes VALUES (?, ?, ?)", node.to_row())

    def close(self) -> None:
        self.database.close()

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()
