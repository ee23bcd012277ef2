"""Minima of one mesh, each with the number of starts that have led to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.solvers.outcome import Status
from dmoc.solving.attempts import Attempt

# Relative differences of costs and of durations that belong to the same minimum.
SAME_COST, SAME_TIMES = 1e-5, 1e-3


@dataclass(frozen=True)
class Basin:
    """Attempts that ended in the same minimum: the first one, how many, its cost in units."""

    attempt: Attempt
    cost: float
    durations: Array
    found: int = 1

    @classmethod
    def of(cls, attempt: Attempt) -> Basin:
        nlp, x = attempt.nlp, attempt.outcome.x
        h = nlp.physical(x)[nlp.layout.index_h]
        return cls(attempt, cost_of(attempt), h * np.array(nlp.layout.steps))

    def costs_as(self, other: Basin) -> bool:
        """Whether both cost the same, compared with the size of the cost."""
        return self.at_most(other) and other.at_most(self)

    def at_most(self, other: Basin) -> bool:
        """Whether it costs the same as another one or less."""
        size = max(abs(self.cost), self.attempt.nlp.scale.cost)
        return self.cost - other.cost <= SAME_COST * size

    def same(self, other: Basin) -> bool:
        """Whether both are the same minimum."""
        near = SAME_TIMES * float(self.durations.sum())
        times = bool((np.abs(self.durations - other.durations) <= near).all())
        return self.costs_as(other) and times


def cost_of(attempt: Attempt) -> float:
    return attempt.nlp.cost(attempt.outcome.x) * attempt.nlp.scale.cost


def gathered(classes: list[Basin], attempts: Sequence[Attempt]) -> list[Basin]:
    """The distinct minima, the cheapest first, with some attempts more."""
    for attempt in attempts:
        if attempt.outcome.status is Status.SOLVED:
            classes = joined(classes, Basin.of(attempt))
    return classes


def joined(classes: list[Basin], found: Basin) -> list[Basin]:
    """The distinct minima, the cheapest first, with one more and those who found it."""
    for i, known in enumerate(classes):
        if known.same(found):
            more = replace(known, found=known.found + found.found)
            return [*classes[:i], more, *classes[i + 1 :]]
    return sorted([*classes, found], key=lambda c: c.cost)
