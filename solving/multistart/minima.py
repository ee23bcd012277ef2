"""Minima of one mesh, each with the number of starts that have led to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dmoc.base.records import record
from dmoc.base.tolerances import SAME_COST
from dmoc.codegen.kernels import Array
from dmoc.problem.problem import Problem
from dmoc.solvers.outcome import Status
from dmoc.solving.attempts import Attempt

# Relative differences of durations that belong to the same minimum, beside that of costs.
SAME_TIMES = 1e-3


@record(frozen=True, eq=False)
class Basin:
    """Starts that led to the same minimum: the attempt of the first one, its cost and durations in
    units, and how many they are."""

    attempt: Attempt
    cost: float
    durations: Array
    starts: int = 1

    @classmethod
    def of(cls, attempt: Attempt) -> Basin:
        nlp, x = attempt.nlp, attempt.outcome.x
        return cls(attempt, cost_of(attempt), nlp.layout.durations(nlp.physical(x)))

    @property
    def problem(self) -> Problem:
        """The problem on the mesh of the minimum."""
        return self.attempt.nlp.problem

    def met_by(self, starts: int) -> Basin:
        """The same with more starts."""
        return replace(self, starts=self.starts + starts)

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


def gathered(minima: list[Basin], attempts: Sequence[Attempt]) -> list[Basin]:
    """The distinct minima, the cheapest first, with some attempts more."""
    for attempt in attempts:
        if attempt.status is Status.SOLVED:
            minima = joined(minima, Basin.of(attempt))
    return minima


def joined(minima: list[Basin], new: Basin) -> list[Basin]:
    """The distinct minima, the cheapest first, with one more and the starts that led to it."""
    for i, basin in enumerate(minima):
        if basin.same(new):
            return [*minima[:i], basin.met_by(new.starts), *minima[i + 1 :]]
    return sorted([*minima, new], key=lambda basin: basin.cost)
