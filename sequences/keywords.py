"""The keywords of :func:`dmoc.search`, each stated once; the command line has those with a
help."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any

from dmoc.base.options import option
from dmoc.solving.keywords import METHOD_OF_MANY, MOST_COUNT, MOST_WORKERS, SEED, WORKERS
from dmoc.solving.methods import METHODS

STRATEGIES = ("exhaustive", "best-first", "beam")
STARTS = 4  # random ones of a node at most, on a coarse mesh
DEEPEST = 12  # the tree grows with the power of the depth
TIME = "expected a positive time, or None"
# An option that says which nodes are looked at, when or where, and not what the answer of one is.
elsewhere = partial(option, decides=False)


@dataclass(frozen=True)
class SearchKeywords:
    """The keywords of :func:`dmoc.search`."""

    max_collisions: Annotated[
        int, elsewhere("whole", "Most collisions of a sequence.", least=0, most=DEEPEST)
    ] = 3
    surfaces: Annotated[
        Sequence[str] | None,
        option("names", "Surfaces that may be hit, as left,right; all by default.", of="surfaces"),
    ] = None
    events: Annotated[
        Sequence[str] | None,
        option(
            "names",
            "Events that may happen, as '+right -left,rail:slip+' (see --sequence of dmoc solve); "
            "by default all hits, and with contacts that last all that is possible.",
            of="words of a sequence",
        ),
    ] = None
    strategy: Annotated[
        str,
        elsewhere(
            "choice",
            "All sequences, the most promising first, or the best of each depth.",
            choices=STRATEGIES,
        ),
    ] = "exhaustive"
    beam: Annotated[
        int,
        elsewhere(
            "whole",
            "Sequences of a depth whose children are looked at, with --strategy beam.",
            least=1,
            most=MOST_COUNT,
        ),
    ] = 4
    starts: Annotated[
        int,
        option(
            "whole",
            "Random starts of each sequence beside the automatic ones.",
            least=0,
            most=MOST_COUNT,
        ),
    ] = STARTS
    seed: Annotated[int, option("whole", SEED, least=0, most=MOST_COUNT)] = 0
    method: Annotated[str | None, option("choice", METHOD_OF_MANY, choices=METHODS)] = None
    workers: Annotated[int, elsewhere("whole", WORKERS, least=1, most=MOST_WORKERS)] = 1
    executor: Annotated[Executor | None, elsewhere("executor")] = None
    seconds: Annotated[
        float | None, elsewhere("positive", "Time budget of the search.", expected=TIME)
    ] = None
    node_seconds: Annotated[
        float | None,
        elsewhere(
            "positive",
            "Time limit of one sequence; it is tried once more.  None by default.",
            expected=TIME,
        ),
    ] = None
    max_nodes: Annotated[
        int | None, elsewhere("whole", "Budget of sequences.", least=1, most=MOST_COUNT)
    ] = None
    shortest_phase: Annotated[
        float | None,
        option(
            "number",
            "Shortest duration of a phase in seconds; a hundredth of the largest final time by "
            "default.",
        ),
    ] = None
    journal: Annotated[
        str | os.PathLike[str] | None,
        elsewhere("path", "Keep finished sequences in this file (SQLite)."),
    ] = None
    resume: Annotated[bool, elsewhere("flag", "Go on with the sequences of --journal.")] = False
    progress: Annotated[Any, elsewhere()] = None
