"""Minima of one mesh, each with the number of starts that have led to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dmoc.base.records import record
from dmoc.base.tolerances import SAME_COST
from dmoc.codegen.kernels import Array
from dmoc.problem.problem import Problem
from dmoc.results.solution import Minimum
from dmoc.solvers.outcome import UNREFINED, Status
from dmoc.solving.attempts import Attempt

# Relative differences of durations that belong to the same minimum, beside that of costs.
SAME_TIMES = 1e-3
# Places, relative to their sizes, that differ by more belong to another motion; so many of those
# that cost the same are kept.
SAME_PLACES, MOST_WAYS = 1e-3, 4


@record(frozen=True, eq=False)
class Basin:
    """Starts that led to the same minimum: the attempt and the name of the first one, its cost and
    durations in units, how many they are, how many of them were not beside a minimum, and those of
    them that cost the same along other ways, as on both sides of an obstacle and through it."""

    attempt: Attempt
    cost: float
    durations: Array
    starts: int = 1
    first: str = ""
    far: int = 1
    ways: tuple[Attempt, ...] = ()

    @classmethod
    def of(cls, attempt: Attempt, first: str = "", far: bool = True) -> Basin:
        nlp, x = attempt.nlp, attempt.outcome.x
        durations = nlp.layout.durations(nlp.physical(x))
        return cls(attempt, cost_of(attempt), durations, 1, first, int(far))

    @property
    def problem(self) -> Problem:
        """The problem on the mesh of the minimum."""
        return self.attempt.nlp.problem

    @property
    def unrefined(self) -> Minimum:
        """What is known of it from its own mesh alone."""
        return Minimum(self.cost, self.starts, UNREFINED, self.problem.phase_steps)

    @property
    def grazes(self) -> bool:
        """Whether a collision of the minimum has no effect."""
        return bool(self.attempt.nlp.laws.impact.grazing.any())

    @property
    def motion(self) -> Array:
        """Unknowns of its minimum, shape (n,), in units of the problem."""
        return self.attempt.nlp.physical(self.attempt.outcome.x)

    def met_by(self, other: Basin) -> Basin:
        """The same minimum with the starts of another one beside its own."""
        return replace(self, starts=self.starts + other.starts, far=self.far + other.far)

    def on_mesh_of(self, attempt: Attempt) -> Basin:
        """The same minimum on another mesh, where ``attempt`` has found it."""
        return replace(Basin.of(attempt, self.first), starts=self.starts, far=self.far)

    def beside(self, other: Attempt) -> Basin:
        """The same minimum with another way of the same cost, if it is a new one."""
        ways = (self.attempt, *self.ways)
        is_new = len(self.ways) < MOST_WAYS and not any(_same_places(way, other) for way in ways)
        return replace(self, ways=(*self.ways, other)) if is_new else self

    def costs_as(self, other: Basin) -> bool:
        """Whether both cost the same, compared with the size of the cost."""
        return self.at_most(other) and other.at_most(self)

    def at_most(self, other: Basin, share: float = SAME_COST) -> bool:
        """Whether the minimum costs the same as another one or less, within a share of the cost's
        size."""
        size = max(abs(self.cost), self.attempt.nlp.scale.cost)
        return self.cost - other.cost <= share * size

    def same(self, other: Basin) -> bool:
        """Whether both are the same minimum."""
        near = SAME_TIMES * float(self.durations.sum())
        times = bool((np.abs(self.durations - other.durations) <= near).all())
        return self.costs_as(other) and times


def cost_of(attempt: Attempt) -> float:
    return attempt.nlp.cost(attempt.outcome.x) * attempt.nlp.scale.cost


def _same_places(one: Attempt, other: Attempt) -> bool:
    """Whether two motions on the same mesh are where the other one is."""
    lay, scale = one.nlp.layout, one.nlp.scale
    q, p = (a.nlp.physical(a.outcome.x)[lay.index_q] for a in (one, other))
    return bool((np.abs(q - p) <= SAME_PLACES * scale.q).all())


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
            met = basin.met_by(new).beside(new.attempt)
            return [*minima[:i], met, *minima[i + 1 :]]
    # Of equal costs the first one that was met comes first, whatever their last digits.
    place = next((i for i, basin in enumerate(minima) if not basin.at_most(new)), len(minima))
    return [*minima[:place], new, *minima[place:]]
