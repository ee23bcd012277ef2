"""The way of a search through its tree: nodes as the strategy has them, doubtful ones on finer
meshes, within the budgets."""

from __future__ import annotations

import sqlite3
import time
from collections.abc import Callable
from dataclasses import dataclass

from dmoc.base.deadline import Deadline
from dmoc.sequences.nodes import Node
from dmoc.sequences.pool import Workers
from dmoc.sequences.tree import Tree
from dmoc.solving.workforce import NoMoreWork

# Shares of a search's time: after the first one doubtful nodes are looked at on finer meshes, after
# the second one the best is stated once more.
WALKED, REFINED = 0.75, 0.95
INTERRUPTED = "the search was interrupted"


@dataclass(frozen=True)
class Progress:
    """How far a search is: counts of verdicts, nodes known to come, the best so far, seconds."""

    counts: dict[str, int]
    waiting: int
    best: Node | None
    seconds: float

    def __str__(self) -> str:
        counts = "  ".join(f"{n} {verdict}" for verdict, n in self.counts.items())
        best = "none yet" if self.best is None else f"{self.best.cost:.6g} ({self.best.name})"
        return f"{counts}  waiting {self.waiting}  {self.seconds:.0f} s  best {best}"


def walked(tree: Tree, workers: Workers, deadline: Deadline, begin: float) -> tuple[str, str]:
    """Look at nodes until there are no more, and at doubtful ones on finer meshes; return what
    stopped it before that, and what broke it off."""
    settings, stopped = tree.settings, ""
    looked, refined = (deadline.share(share) for share in (WALKED, REFINED))

    def tell() -> None:
        if settings.progress is not None:
            spent = time.perf_counter() - begin
            settings.progress(Progress(tree.counts(), tree.waiting, tree.best(), spent))

    try:
        for until in (looked, refined):
            stopped, count = "", -1
            while not stopped and count < tree.count:  # the best of finer meshes has neighbours too
                count = tree.count
                stopped = _looked_at(tree, workers, until, refined, tell)
                for _ in tree.refine(workers, refined):
                    tell()
            if not stopped:
                break
    except KeyboardInterrupt:
        return INTERRUPTED, ""
    except NoMoreWork as error:
        return str(error), str(error)
    except sqlite3.Error as error:
        broken = f"journal {settings.journal} could not be written ({error})"
        return broken, broken
    return stopped, ""


def _looked_at(
    tree: Tree, workers: Workers, until: Deadline, last: Deadline, tell: Callable[[], None]
) -> str:
    """Look at nodes until there are no more, or a deadline; none takes longer than to the last
    one.  Return what stopped it."""
    seconds, most = tree.settings.seconds, tree.settings.max_nodes
    for round_ in tree.rounds():
        for _ in tree.solve(round_, workers, last):
            tell()
            if until.passed:
                break
        if until.passed and tree.waiting:
            return f"the time of {seconds:g} s was used up"
        if most is not None and tree.count >= most and tree.waiting:
            return f"the limit of {most} nodes was reached"
    return ""
