"""What a proof has left to do, in a file: a proof of the same problem goes on there."""

from __future__ import annotations

import hashlib
import io
import os

import numpy as np

from dmoc.base.arguments import path
from dmoc.base.errors import ProblemError
from dmoc.base.files import write_whole
from dmoc.proving.branch import Branch
from dmoc.proving.linear import LinearProblem

FORMAT = 5


def digest(linear: LinearProblem, limit: float, gap: float) -> str:
    """A digest of all that a bound follows from."""
    numbers = hashlib.sha256()
    for phase in linear.phases:
        for part in vars(phase).values():
            numbers.update(np.asarray(part, dtype=float).tobytes())
    rows = [part for event in linear.events for part in vars(event).values()]
    for of in (*rows, linear.goal_zero, linear.goal_most, linear.goal_cost, linear.goal_when):
        for part in vars(of).values():
            numbers.update(np.asarray(part).tobytes())
    for part in vars(linear.shifts).values():
        numbers.update(np.asarray(part, dtype=float).tobytes())
    ends = linear.soft, linear.start, linear.tie, linear.durations, linear.final_time, (limit, gap)
    for part in ends:
        numbers.update(np.asarray(part, dtype=float).tobytes())
    return numbers.hexdigest()


def written(file: str | os.PathLike[str] | None, branch: Branch, known: str) -> None:
    """Keep what is left to do."""
    if file is None:
        return
    content = io.BytesIO()
    arrays = {"format": np.array(FORMAT), "digest": np.array(known), **branch.state()}
    np.savez_compressed(content, allow_pickle=False, **arrays)
    write_whole(path(file, "journal"), content.getvalue())


def continued(file: str | os.PathLike[str] | None, branch: Branch, known: str) -> None:
    """Go on where the file has stopped, if there is one; refuse one of another proof."""
    if file is None or not path(file, "journal").exists():
        return
    named = path(file, "journal")
    try:
        with np.load(named, allow_pickle=False) as data:
            format_, of = int(data["format"]), str(data["digest"])
            state = {name: data[name] for name in branch.state()}
    except Exception:
        raise ProblemError(
            f"journal = {str(named)!r} is no journal of a proof: give another path, or delete it."
        ) from None
    if format_ != FORMAT or of != known:
        raise ProblemError(
            f"journal = {str(named)!r} is that of another proof: give another path, or delete it."
        )
    branch.restore(**state)
