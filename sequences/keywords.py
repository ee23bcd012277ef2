"""The keywords of :func:`dmoc.search`, each stated once; the command line has those with a
help."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Any

from dmoc.base.options import elsewhere, option
from dmoc.solving.keywords import METHOD_OF_MANY, MOST_COUNT, MOST_WORKERS, SEED, WORKERS
from dmoc.solving.methods import METHODS

STRATEGIES = ("tree", "best-first", "beam", "propose", "both")
# Those that begin with the sequences of relaxed motions.
PROPOSING = ("propose", "both")
STARTS = 4  # random ones of a node at most, on a coarse mesh
DEEPEST = 12  # the tree grows with the power of the depth
TIME = "expected a positive time, or None"


@dataclass(frozen=True)
class SearchKeywords:
    """The keywords of :func:`dmoc.search`."""

    max_collisions: int = elsewhere(
        3, "whole", "Most collisions of a sequence.", least=0, most=DEEPEST
    )
    surfaces: Sequence[str] | None = option(
        None, "names", "Surfaces that may be hit, as left,right; all by default.", of="surfaces"
    )
    events: Sequence[str] | None = option(
        None,
        "names",
        "Events that may happen, as '+right -left,rail:slip+' (see --sequence of dmoc solve); "
        "by default all hits, and with contacts that last all that is possible.",
        of="words of a sequence",
    )
    strategy: str = elsewhere(
        "tree",
        "choice",
        "All sequences, the most promising first, the best of each depth, those that relaxed "
        "motions propose, or these first and then all.",
        choices=STRATEGIES,
    )
    beam: int = elsewhere(
        4,
        "whole",
        "Sequences of a depth whose children are looked at, with --strategy beam.",
        least=1,
        most=MOST_COUNT,
    )
    starts: int = option(
        STARTS,
        "whole",
        "Random starts of each sequence beside the automatic ones.",
        least=0,
        most=MOST_COUNT,
    )
    seed: int = option(0, "whole", SEED, least=0, most=MOST_COUNT)
    method: str | None = option(None, "choice", METHOD_OF_MANY, choices=METHODS)
    workers: int = elsewhere(1, "whole", WORKERS, least=1, most=MOST_WORKERS)
    executor: Executor | None = elsewhere(None, "executor")
    seconds: float | None = elsewhere(None, "positive", "Time budget of the search.", expected=TIME)
    node_seconds: float | None = elsewhere(
        None,
        "positive",
        "Time limit of one sequence; it is tried once more.  None by default.",
        expected=TIME,
    )
    max_nodes: int | None = elsewhere(
        None, "whole", "Budget of sequences.", least=1, most=MOST_COUNT
    )
    shortest_phase: float | None = option(
        None,
        "number",
        "Shortest duration of a phase beside an impact in seconds; a hundredth of the largest "
        "final time by default.",
    )
    journal: str | os.PathLike[str] | None = elsewhere(
        None, "path", "Keep finished sequences in this file (SQLite)."
    )
    prove: bool = elsewhere(
        False, "flag", "Prove what no sequence can cost less than, where motions are linear."
    )
    resume: bool = elsewhere(False, "flag", "Go on with the sequences of --journal.")
    progress: Any = elsewhere(None)
