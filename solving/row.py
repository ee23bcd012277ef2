"""What a batch keeps of one problem."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from dmoc.results.solution import Solution


@dataclass(frozen=True)
class Row:
    """What a batch keeps of one problem, the one of a number."""

    number: int
    status: str
    message: str
    cost: float = np.nan
    final_time: float = np.nan
    collisions: tuple[str, ...] = ()
    times: tuple[float, ...] = ()
    impulses: tuple[float, ...] = ()
    iterations: int = 0
    check: str = ""
    design: Mapping[str, float] = field(default_factory=dict)
    seconds: float = 0.0
    solution: Solution | None = None


def row_of(number: int, s: Solution, seconds: float, keep: bool) -> Row:
    """What is kept of a problem with its solution."""
    # travels without the kernels, which the caller has
    bare = replace(s, kernels=None) if keep else None
    ended = Row(
        number, str(s.status), s.message, iterations=s.iterations, seconds=seconds, solution=bare
    )
    if not s.converged:
        return ended
    check = s.verification
    return replace(
        ended,
        cost=s.cost,
        final_time=s.final_time,
        collisions=tuple(c.word for c in s.collisions),
        times=tuple(c.time for c in s.collisions),
        impulses=tuple(c.impulse for c in s.collisions),
        check="" if check is None else "passed" if check.passed else "failed",
        design=dict(s.design),
    )
