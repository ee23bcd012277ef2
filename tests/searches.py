"""Searches of the problems that come with dmoc."""

from __future__ import annotations

import json
import sqlite3
import sys
from contextlib import closing
from pathlib import Path
from typing import Any

import dmoc
from dmoc.models.registry import find
from dmoc.sequences.search import SearchResult


def shipped(name: str, **changes: Any) -> dmoc.Problem:
    """A problem that comes with dmoc."""
    reference = find(name)
    return dmoc.Problem(reference.kernels(), **{**reference.defaults, **changes})


def unnamed(name: str, **changes: Any) -> dmoc.Problem:
    """The same without its sequence."""
    return shipped(name, **{"sequence": (), **changes})


def outline(result: SearchResult) -> list[tuple[Any, ...]]:
    return [
        (n.sequence, n.verdict, n.cost, n.phases, n.minima, tuple(n.starts)) for n in result.nodes
    ]


def command(*arguments: str) -> list[str]:
    """`dmoc search` over the 21 sequences of at most two collisions."""
    options = ["--steps", "16", "--max-collisions", "2", *arguments]
    return [sys.executable, "-m", "dmoc", "search", "puck_table", *options]


def suicidal(journal: Path, nodes: int, workers: int = 1) -> list[str]:
    """A process with the same search that kills itself after so many nodes, without tidying up."""
    program = f"""
import os, signal, dmoc
from dmoc.models.registry import find
def stop(p):
    if sum(p.counts.values()) == {nodes}:
        os.kill(os.getpid(), signal.SIGKILL)
reference = find("puck_table")
problem = dmoc.Problem(reference.kernels(), **{{**reference.defaults, "steps": 16}})
dmoc.search(problem, 2, workers={workers}, journal={str(journal)!r}, progress=stop)
"""
    return [sys.executable, "-c", program]


def seconds_of(journal: Path) -> dict[tuple[str, ...], float]:
    """Time of each node in a journal, which may not be there yet or be written to just now."""
    if not journal.exists():
        return {}
    try:
        with closing(sqlite3.connect(journal)) as database:
            rows = [json.loads(r) for (r,) in database.execute("SELECT summary FROM nodes")]
    except sqlite3.DatabaseError:
        return {}
    return {tuple(r["sequence"]): r["seconds"] for r in rows}
