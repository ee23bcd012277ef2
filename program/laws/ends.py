"""The law of both ends: what a problem says of the final time, of periodic states and of its goal.

::

    velocity    p_B - dL/dv(q_0, v_B) = 0, p_E - dL/dv(q_N, v_E) = 0    where velocities are needed,
                                                        the latter not of a motion that ends with an
                                                        event, which says it (impact.py)
    final time  t_E - value = 0, t_E - lower >= 0, upper - t_E >= 0
    periodic    state at the end - sum of factors * states at the start - difference = 0, or
                within a range
    goal        unknown - value = 0, or within a range                  where goals are rows
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from dmoc.base.names import momentum_name, unit_of
from dmoc.base.records import record, value_class
from dmoc.codegen.kernels import Array
from dmoc.problem.problem import Problem
from dmoc.problem.relations import Relation
from dmoc.program.blocks import (
    GOAL,
    LAW,
    NOWHERE,
    Block,
    Entries,
    Index,
    Missed,
    Numbering,
    seconds,
)
from dmoc.program.laws.law import Law
from dmoc.program.layout import Layout
from dmoc.program.scale import Scale
from dmoc.program.stacked import Stacked
from dmoc.program.terms import Places, Term

if TYPE_CHECKING:
    from dmoc.program.laws.laws import Laws


@value_class(frozen=True)
class Goal:
    """A value of the goal that is a constraint: the unknown, its range and its name."""

    unknown: int
    low: float
    high: float
    name: str


@record(frozen=True, eq=False)
class Line:
    """A row that is linear in x: sum of factors * x[unknowns], and a constant."""

    row: int
    unknowns: Index
    factors: Array
    constant: float


@dataclass(eq=False, repr=False)
class EndsLaw(Law):
    """Both ends of a motion; ``goals`` are values of the goal that are constraints instead of
    bounds."""

    problem: Problem
    lay: Layout
    goals: tuple[Goal, ...]
    start_velocity: Block = field(init=False)
    goal_velocity: Block = field(init=False)
    final_time: Block = field(init=False)
    periodic: Block = field(init=False)
    goal: Block = field(init=False)
    earliest: Block = field(init=False)
    latest: Block = field(init=False)
    goal_range: Block = field(init=False)
    periodic_range: Block = field(init=False)

    def says_the_same(self, problem: Problem) -> bool:
        """Whether another problem has the same numbers for both ends."""
        mine = self.problem.final_time_bounds, self.problem.relations
        return mine == (problem.final_time_bounds, problem.relations)

    @property
    def fixed_goals(self) -> list[Goal]:
        """Goals of ``goal``."""
        return [g for g in self.goals if g.low == g.high]

    @property
    def limits(self) -> list[tuple[Goal, float, float]]:
        """Goals of ``goal_range``, with a side and its bound."""
        wide = [g for g in self.goals if g.low < g.high]
        low = [(g, 1.0, g.low) for g in wide if g.low > -np.inf]
        return low + [(g, -1.0, g.high) for g in wide if g.high < np.inf]

    @property
    def relations(self) -> list[Relation]:
        """Relations between the end and the start of ``periodic``."""
        return [r for r, _, _ in _fixed(self.problem)]

    @property
    def ranges(self) -> list[tuple[Relation, float, float]]:
        """Relations of ``periodic_range``, each with a side and its bound."""
        return _wide(self.problem)

    def equations(self, block: Numbering) -> None:
        lay, relations, goals = self.lay, self.relations, self.fixed_goals
        low, high = self.problem.final_time_bounds
        names = self.problem.kernels.coordinates
        p = [momentum_name(q) for q in names]
        units = self.problem.kernels.manifest.units
        wanted = np.array([g.unknown for g in goals], dtype=np.intp)

        def fits(end: str) -> Missed:
            return Missed(
                LAW,
                lambda i: f"the momentum of {names[i]} at the {end} does not fit the velocity",
                lambda i: unit_of(p[i], units),
                apart=0,
            )

        def misses(i: int) -> str:
            r = relations[i]
            alone = r.terms == ((r.end, 1.0),)
            whose = "its value" if alone else f"the value of {r.source}"
            return f"{r.end} at the end misses {whose} at the start"

        self.start_velocity = block(
            "start velocity",
            lay.index_v_B.shape,
            lambda i: f"{p[i]} at the start",
            lambda s: s.p[..., : len(lay.index_v_B)],
            missed=fits("start"),
        )
        self.goal_velocity = block(
            "goal velocity",
            (0 if lay.ends_with_event else len(lay.index_v_E),),
            lambda i: f"{p[i]} at the goal",
            lambda s: s.p[..., : len(lay.index_v_E)],
            missed=fits("goal"),
        )
        self.final_time = block(
            "final time",
            (int(low == high),),
            lambda _: f"final time = {low:g} s",
            lambda s: s.time,
            missed=Missed(words=lambda _: "the final time is missed", unit=seconds),
        )
        self.periodic = block(
            "periodic",
            (len(relations),),
            lambda i: f"periodic {relations[i].end}",
            lambda s: self._sizes(s, relations),
            missed=Missed(GOAL, misses, lambda i: unit_of(relations[i].end, units), apart=0),
        )
        self.goal = block(
            "goal",
            (len(goals),),
            lambda i: f"goal of {goals[i].name}",
            lambda s: lay.sizes(s)[wanted],
            missed=self._goal_missed(goals),
        )

    def inequalities(self, block: Numbering) -> None:
        lay, limits, ranges = self.lay, self.limits, self.ranges
        low, high = self.problem.final_time_bounds
        bounded = np.array([g.unknown for g, _, _ in limits], dtype=np.intp)

        def within(name: str, sign: float, value: float) -> str:
            return f"{name} {'>=' if sign > 0 else '<='} {value:g}"

        self.earliest = block(
            "final time >=",
            (int(0 < low < high),),
            lambda _: f"final time >= {low:g} s",
            lambda s: s.time,
            missed=Missed(unit=seconds),
        )
        self.latest = block(
            "final time <=",
            (int(low < high < np.inf),),
            lambda _: f"final time <= {high:g} s",
            lambda s: s.time,
            missed=Missed(unit=seconds),
        )
        self.goal_range = block(
            "goal >=",
            (len(limits),),
            lambda i: within(f"goal of {limits[i][0].name}", *limits[i][1:]),
            lambda s: lay.sizes(s)[bounded],
            missed=self._goal_missed([goal for goal, _, _ in limits]),
        )
        self.periodic_range = block(
            "periodic >=",
            (len(ranges),),
            lambda i: within(f"periodic {ranges[i][0].end}", *ranges[i][1:]),
            lambda s: self._sizes(s, [r for r, _, _ in ranges]),
        )

    def _goal_missed(self, goals: Sequence[Goal]) -> Missed:
        units = self.problem.kernels.manifest.units
        return Missed(
            GOAL,
            lambda i: f"the goal of {goals[i].name} is missed",
            lambda i: unit_of(goals[i].name, units),
            apart=0,
        )

    def _sizes(self, scale: Scale, relations: list[Relation]) -> Array:
        """Sizes of what ends, states or quantities."""
        kernels = self.problem.kernels
        states, of_unknowns = self.lay.states(kernels.coordinates), self.lay.sizes(scale)
        sizes = {name: of_unknowns[..., at[1]] for name, at in states.items()}
        of_quantities = np.moveaxis(scale.quantity, -1, 0)
        sizes |= dict(zip(kernels.quantities, of_quantities, strict=True))
        every = [sizes[r.end] for r in relations]
        return np.stack(every, axis=-1) if every else np.zeros((*np.shape(scale.time), 0))

    @property
    def _related(self) -> Iterator[tuple[int, Relation, float, float]]:
        """Rows of relations, with a side and its value."""
        related = *_fixed(self.problem), *_wide(self.problem)
        for row, (r, sign, value) in zip(self._of_relations, related, strict=True):
            yield row, r, sign, value

    @property
    def _of_relations(self) -> list[int]:
        """Rows of relations."""
        return [*self.periodic.numbers.tolist(), *self.periodic_range.numbers.tolist()]

    def terms(self, places: Places, laws: Laws) -> list[Term]:
        lay = self.lay
        momenta = [
            Term(
                "momentum",
                (lay.index_q[[node]], v[None], places.times(np.array([node]))),
                (block.index[None],),
                -1.0,
            )
            for block, node, v in (
                (self.start_velocity, 0, lay.index_v_B),
                (self.goal_velocity, lay.total, lay.index_v_E),
            )
            if block.count
        ]
        return [*momenta, *self._quantities(places)]

    def _quantities(self, places: Places) -> Iterator[Term]:
        """Quantities at both ends that relations have."""
        names = self.problem.kernels.quantities
        for row, r, sign, _ in self._related:
            for name, last, factor in (*((n, False, -f) for n, f in r.terms), (r.end, True, 1.0)):
                if name in names:
                    rows = np.full((1, len(names)), NOWHERE)
                    rows[0, names.index(name)] = row
                    at = places.quantities_at_end(last)
                    yield Term("quantity_point", at, (rows,), sign * factor)

    def constants_of(self, problems: Stacked) -> dict[int, Array]:
        """The constants of rows that other problems with the same kinds of bounds have, by their
        rows."""
        low, high = problems.final_time_bounds
        first = *self.final_time.numbers.tolist(), *self.earliest.numbers.tolist()
        constants = dict.fromkeys(first, -low)
        constants |= dict.fromkeys(self.latest.numbers.tolist(), high)
        related = [(*_fixed(problem), *_wide(problem)) for problem in problems.each]
        values = np.array([[-sign * value for _, sign, value in own] for own in related])
        return constants | dict(zip(self._of_relations, values.T, strict=True))

    def _lines(self) -> Iterator[Line]:
        lay, (low, high), one = self.lay, self.problem.final_time_bounds, np.ones(1)
        steps = np.array(lay.steps[: lay.stepped], dtype=float)
        for r in (*self.final_time.numbers, *self.earliest.numbers):
            yield Line(r, lay.index_h, steps, -low)
        for r in self.latest.numbers:
            yield Line(r, lay.index_h, -steps, high)
        states = lay.states(self.problem.kernels.coordinates)
        for row, r, sign, value in self._related:
            ends = [*((name, 0, -factor) for name, factor in r.terms), (r.end, 1, 1.0)]
            own = [(states[name][k], factor) for name, k, factor in ends if name in states]
            between, factors = (np.array([part[i] for part in own]) for i in range(2))
            yield Line(row, between.astype(np.intp), sign * factors, -sign * value)
        wanted = [*((g, 1.0, g.low) for g in self.fixed_goals), *self.limits]
        numbers = np.concatenate([self.goal.numbers, self.goal_range.numbers])
        for row, (g, sign, value) in zip(numbers, wanted, strict=True):
            yield Line(row, np.array([g.unknown]), sign * one, -sign * value)

    def entries(self, laws: Laws) -> list[Entries]:
        lay = self.lay
        entries = [
            (block.numbers, p[: block.count], np.ones(block.count))
            for block, p in (
                (self.start_velocity, lay.index_p_B),
                (self.goal_velocity, lay.index_p_E),
            )
        ]
        return entries + [
            (np.full(len(line.unknowns), line.row), line.unknowns, line.factors)
            for line in self._lines()
        ]

    def constants(self) -> Iterator[tuple[int, float]]:
        return ((line.row, line.constant) for line in self._lines())


def _fixed(problem: Problem) -> list[tuple[Relation, float, float]]:
    """Relations with a difference, each with a side and its value."""
    return [(r, 1.0, r.low) for r in problem.relations if r.fixed]


def _wide(problem: Problem) -> list[tuple[Relation, float, float]]:
    """Relations within a range, each with a side and its bound."""
    wide = [r for r in problem.relations if not r.fixed]
    low = [(r, 1.0, r.low) for r in wide if r.low > -np.inf]
    return low + [(r, -1.0, r.high) for r in wide if r.high < np.inf]
