"""The table of the constraints (c | d), c = 0 and d >= 0, numbered once: names, sizes, terms and
linear parts.

Equalities, node by node along the whole chain of steps::

    momentum    r_plus(k-1) + r_minus(k) - lam grad g(q_c) = 0; + p_B at the start, - p_E at the end
    inside      r_i(k) = 0                     in each step with nodes inside
    time        t_kp1 - t_k - h = 0            in each step, where the model depends on the time
    arrival, departure, energy, contact        at each collision: the law of impact
    velocity    p_B - dL/dv(q_0, v_B) = 0, p_E - dL/dv(q_N, v_E) = 0    where velocities are needed
    final time  t_E - value = 0                                   where it is fixed
    periodic    state at the end - state at the start - difference = 0
    goal        unknown - value = 0                               where goals are rows

Inequalities: gaps -g(q_k) at every node and inside the steps, path constraints
(:mod:`dmoc.program.laws.path`), bounds of the final time, goals and differences of periodic states
that are ranges, and approach and separation of the law of impact.  Contacts that last add the rows
of :mod:`dmoc.program.laws.contact`, impacts with friction those of :mod:`dmoc.program.laws.hit`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property, lru_cache

import numpy as np

from dmoc.base.names import momentum_name
from dmoc.codegen.kernels import Array
from dmoc.problem.problem import Problem, Relation
from dmoc.program.blocks import NOWHERE, Block, Bools, Index, Numbering
from dmoc.program.laws.contact import ContactLaw
from dmoc.program.laws.hit import HitLaw
from dmoc.program.laws.impact import ImpactLaw
from dmoc.program.laws.path import PathLaw
from dmoc.program.layout import SHARED, Layout
from dmoc.program.terms import COST, Places, Term


@dataclass(frozen=True)
class Goal:
    """A value of the goal that is a constraint: the unknown, its range and its name."""

    unknown: int
    low: float
    high: float
    name: str


@dataclass(frozen=True)
class LinearRow:
    """A row that is linear in x: sum of factors * x[unknowns], and a constant."""

    row: int
    unknowns: Index
    factors: Array
    constant: float


@dataclass(frozen=True, eq=False)
class Equalities:
    """Rows c."""

    momentum: Block
    inside: Block
    time: Block
    arrival: Block
    departure: Block
    energy: Block
    contact: Block
    start_velocity: Block
    goal_velocity: Block
    final_time: Block
    periodic: Block
    goal: Block
    closed: Block
    stuck: Block
    sliding: Block
    at_rest: Block
    stopped: Block
    lands: Block
    stays: Block
    sticks: Block
    slides: Block
    within: Block
    restitution: Block
    halts: Block
    slips: Block


@dataclass(frozen=True, eq=False)
class Inequalities:
    """Rows d; gaps have the shapes (nodes, nc) and (nodes inside steps, nc), path constraints
    (steps, points * nr), (nodes, nr), (steps, 2 nr) and (2 phases, nr)."""

    gap: Block
    gap_inside: Block
    path: Block
    path_at_nodes: Block
    path_at_ends_of_steps: Block
    path_at_ends: Block
    earliest: Block
    latest: Block
    goal: Block
    approach: Block
    separation: Block
    periodic: Block
    cone: Block
    cone_of_impact: Block
    direction: Block
    direction_at_ends: Block
    direction_of_impact: Block
    share: Block
    bears: Block
    heads: Block

    @property
    def paths(self) -> tuple[Block, ...]:
        """Blocks of path constraints."""
        return self.path, self.path_at_nodes, self.path_at_ends_of_steps, self.path_at_ends


@dataclass(frozen=True, eq=False)
class Rows:
    """All rows, and what the linear ones say; ``goals`` are those of ``c.goal``, ``limits``
    (goal, sign, value) those of ``d.goal``."""

    c: Equalities
    d: Inequalities
    goals: tuple[Goal, ...]
    limits: tuple[tuple[Goal, float, float], ...]

    @cached_property
    def equalities(self) -> list[Block]:
        return [getattr(self.c, f.name) for f in fields(self.c)]

    @cached_property
    def inequalities(self) -> list[Block]:
        return [getattr(self.d, f.name) for f in fields(self.d)]

    @property
    def contacts(self) -> list[Block]:
        """Blocks of contacts that last, and of impacts with friction."""
        c, d = self.c, self.d
        equalities = [c.closed, c.stuck, c.sliding, c.at_rest, c.stopped]
        events = [c.lands, c.stays, c.sticks, c.slides, c.restitution, c.halts, c.slips]
        cones, ways = [d.cone, d.cone_of_impact], [d.direction, d.direction_at_ends]
        hits = [d.direction_of_impact, d.share, d.bears, d.heads]
        return [*equalities, *events, *cones, *ways, *hits]

    @cached_property
    def n_eq(self) -> int:
        return sum(b.count for b in self.equalities)

    @cached_property
    def n_in(self) -> int:
        return sum(b.count for b in self.inequalities)


def rows_of(
    problem: Problem,
    lay: Layout,
    laws: tuple[ImpactLaw, ContactLaw, HitLaw],
    path: PathLaw,
    free_ends: tuple[Bools, Bools],
    goals: Sequence[Goal],
) -> Rows:
    """The rows of a problem.

    ``free_ends`` tells which coordinates of the first and of the last node are not fixed, ``goals``
    are those that are constraints instead of bounds.
    """
    block = Numbering()
    fixed = tuple(g for g in goals if g.low == g.high)
    c = _equalities(problem, lay, laws, fixed, block)
    limits = tuple((g, 1.0, g.low) for g in goals if -np.inf < g.low < g.high)
    limits += tuple((g, -1.0, g.high) for g in goals if g.low < g.high < np.inf)
    d = _inequalities(problem, lay, laws, path, free_ends, limits, block)
    return Rows(c, d, fixed, limits)


def _equalities(
    problem: Problem,
    lay: Layout,
    laws: tuple[ImpactLaw, ContactLaw, HitLaw],
    goals: tuple[Goal, ...],
    block: Numbering,
) -> Equalities:
    names, total, nq = problem.kernels.coordinates, lay.total, lay.nq
    low, high = problem.final_time_bounds
    states = lay.states(names)
    p = [momentum_name(q) for q in names]
    relations = [r for r in problem.relations if r.fixed]
    ends = np.array([states[r.end][1] for r in relations], dtype=np.intp)
    wanted = np.array([g.unknown for g in goals], dtype=np.intp)
    return Equalities(
        block(
            "momentum",
            (total + 1, nq),
            lambda k, i: f"momentum of {names[i]} at node {k}",
            lambda s: s.p,
        ),
        block(
            "inside",
            (total, lay.inside * nq),
            lambda k, i: f"equation of motion of {names[i % nq]} in step {k}",
            lambda s: np.tile(s.p, lay.inside),
        ),
        block("time", (total * lay.timed,), lambda k: f"time of node {k + 1}", lambda s: s.time),
        *laws[0].equations(problem, block),
        block(
            "start velocity",
            lay.index_v_B.shape,
            lambda i: f"{p[i]} at the start",
            lambda s: s.p[: len(lay.index_v_B)],
        ),
        block(
            "goal velocity",
            lay.index_v_E.shape,
            lambda i: f"{p[i]} at the goal",
            lambda s: s.p[: len(lay.index_v_E)],
        ),
        block(
            "final time", (int(low == high),), lambda _: f"final time = {low:g} s", lambda s: s.time
        ),
        block(
            "periodic",
            (len(ends),),
            lambda i: f"periodic {relations[i].end}",
            lambda s: lay.units(s)[ends],
        ),
        block(
            "goal",
            (len(goals),),
            lambda i: f"goal of {goals[i].name}",
            lambda s: lay.units(s)[wanted],
        ),
        *(_untouched(lay)[0] if _is_untouched(lay) else _contact_equations(laws[1:], block)),
    )


def _inequalities(
    problem: Problem, lay: Layout, laws: tuple[ImpactLaw, ContactLaw, HitLaw], path: PathLaw,
    free_ends: tuple[Bools, Bools], limits: tuple[tuple[Goal, float, float], ...], block: Numbering,
) -> Inequalities:  # fmt: skip
    kernels, total, inside = problem.kernels, lay.total, lay.inside
    surfaces = kernels.surfaces
    low, high = problem.final_time_bounds
    bounded = np.array([g.unknown for g, _, _ in limits], dtype=np.intp)
    moving = np.isin(surfaces, kernels.manifest["moving_surfaces"])
    within = np.tile(~moving, (total * inside, 1))

    ranges = ranged(problem)
    states = lay.states(kernels.coordinates)
    turning = np.array([states[r.end][1] for r, _, _ in ranges], dtype=np.intp)

    def limit(i: int) -> str:
        goal, sign, value = limits[i]
        return f"goal of {goal.name} {'>=' if sign > 0 else '<='} {value:g}"

    nodes, steps = np.arange(total + 1), np.arange(total)
    return Inequalities(
        block(
            "gap",
            _gaps(problem, lay, free_ends),
            lambda k, j: f"gap to {surfaces[j]} at node {k}",
            lambda s: s.gap,
            nodes,
        ),
        block(
            "gap inside",
            within,
            lambda k, j: f"gap to {surfaces[j]} inside step {k // inside}",
            lambda s: s.gap,
            np.repeat(steps, inside),
        ),
        *path.inequalities(block),
        block(
            "final time >=",
            (int(0 < low < high),),
            lambda _: f"final time >= {low:g} s",
            lambda s: s.time,
        ),
        block(
            "final time <=",
            (int(low < high < np.inf),),
            lambda _: f"final time <= {high:g} s",
            lambda s: s.time,
        ),
        block("goal", (len(limits),), limit, lambda s: lay.units(s)[bounded]),
        *laws[0].inequalities(problem, lay, block),
        block(
            "periodic >=",
            (len(ranges),),
            lambda i: (
                f"periodic {ranges[i][0].end} {'>=' if ranges[i][1] > 0 else '<='} {ranges[i][2]:g}"
            ),
            lambda s: lay.units(s)[turning],
        ),
        *(_untouched(lay)[1] if _is_untouched(lay) else _contact_inequalities(laws[1:], block)),
    )


def _is_untouched(lay: Layout) -> bool:
    """Whether no contact lasts and no impact has friction."""
    return lay.touch.free and not lay.touch.passages


@lru_cache(maxsize=SHARED)
def _untouched(lay: Layout) -> tuple[tuple[Block, ...], tuple[Block, ...]]:
    """Blocks of contacts where there are none: they have no members, so that all programs of a
    layout share them."""
    mu = np.zeros(len(lay.touch.tangents))
    e = np.zeros(len(lay.surfaces))
    laws = (ContactLaw.of_none(lay, mu), HitLaw(lay, (), mu, e, np.zeros(len(e), dtype=bool)))
    block = Numbering()
    return _contact_equations(laws, block), _contact_inequalities(laws, block)


def _contact_equations(laws: tuple[ContactLaw, HitLaw], block: Numbering) -> tuple[Block, ...]:
    return *laws[0].equations(block), *laws[1].equations(block)


def _contact_inequalities(laws: tuple[ContactLaw, HitLaw], block: Numbering) -> tuple[Block, ...]:
    return *laws[0].inequalities(block), *laws[1].inequalities(block)


def ranged(problem: Problem) -> list[tuple[Relation, float, float]]:
    """Relations between the end and the start that are ranges: each with a side and its bound."""
    wide = [r for r in problem.relations if not r.fixed]
    found = [(r, 1.0, r.low) for r in wide if r.low > -np.inf]
    return found + [(r, -1.0, r.high) for r in wide if r.high < np.inf]


def _gaps(problem: Problem, lay: Layout, free_ends: tuple[Bools, Bools]) -> Bools:
    """Nodes and surfaces whose gap is a constraint.

    Contacts of collisions and those that last hold with equality.  At a fixed end the gap is known
    and was checked: a constraint that cannot move would have no interior.
    """
    manifest, surfaces = problem.kernels.manifest, problem.kernels.surfaces
    keep = np.ones((lay.total + 1, len(surfaces)), dtype=bool)
    hits = lay.surfaces != NOWHERE
    keep[lay.collision_nodes[hits], lay.surfaces[hits]] = False
    keep[:, [surfaces.index(name) for name in problem.ignored]] = False
    for i, closed in enumerate(lay.touch.closed):
        keep[lay.ends[i] : lay.ends[i + 1] + 1, list(closed)] = False
    for node, lands in zip(lay.collision_nodes, lay.touch.landings, strict=True):
        keep[node, list(lands)] = False
    for node, free in zip((0, -1), free_ends, strict=True):
        for j, surface in enumerate(surfaces):
            moves = node == -1 and surface in manifest["moving_surfaces"]
            keep[node, j] &= moves or bool(free[manifest["surface_coordinates"][surface]].any())
    return keep


def terms(
    problem: Problem, lay: Layout, rows: Rows, laws: tuple[ImpactLaw, ContactLaw, HitLaw],
    path: PathLaw,
) -> list[Term]:  # fmt: skip
    """All terms of the cost and of the rows that are not linear; those that enter nothing are
    left out."""
    c, d = rows.c, rows.d
    places = Places(lay, lay.size + rows.n_eq + rows.n_in + 1, len(problem.kernels.surfaces))
    q, none, nodes = lay.index_q, np.full((1, 1), places.zero), np.arange(lay.total + 1)
    step, momentum = places.step(np.arange(lay.total)), c.momentum.index
    cost = np.full((lay.total, 1), COST)
    by_name = {b.name: b.index for b in (*rows.equalities, *rows.inequalities)}
    found = [
        Term("step", step, (momentum[:-1], momentum[1:], cost, c.inside.index)),
        *laws[0].terms(lay, places, momentum, by_name.__getitem__),
        *laws[1].terms(places, by_name, momentum),
        *laws[2].terms(places, by_name, momentum),
        Term("surface", (q, places.times(nodes)), (d.gap.index,), -1.0),
        Term("surface", (lay.index_q_i.reshape(-1, lay.nq), none), (d.gap_inside.index,), -1.0),
        *path.terms(places, d.paths),
    ]
    for block, node, v in (
        (c.start_velocity, 0, lay.index_v_B),
        (c.goal_velocity, lay.total, lay.index_v_E),
    ):
        if block.count:
            found.append(
                Term(
                    "momentum",
                    (q[[node]], v[None], places.times(nodes[[node]])),
                    (block.index[None],),
                    -1.0,
                )
            )
    v_E = lay.index_v_E if len(lay.index_v_E) else np.full(lay.nq, NOWHERE)
    end = (q[-1:], places.known(v_E[None]), places.known(lay.time_columns[-1:]))
    found.append(Term("terminal_cost", end, (cost[:1],)))
    return [t for t in found if problem.kernels.has(t.kernel) and t.enters]


def linear_rows(problem: Problem, lay: Layout, rows: Rows) -> list[LinearRow]:
    """The rows that are linear in x, or have a linear part."""
    c, d, (low, high) = rows.c, rows.d, problem.final_time_bounds
    steps, one = np.array(lay.steps, dtype=float), np.ones(1)
    found = [
        LinearRow(r, lay.index_h, steps, -low) for r in (*c.final_time.numbers, *d.earliest.numbers)
    ]
    found += [LinearRow(r, lay.index_h, -steps, high) for r in d.latest.numbers]
    states = lay.states(problem.kernels.coordinates)
    relations = [r for r in problem.relations if r.fixed]
    sides = [*((r, 1.0, r.low) for r in relations), *ranged(problem)]
    numbers = np.concatenate([c.periodic.numbers, d.periodic.numbers])
    for row, (r, sign, value) in zip(numbers, sides, strict=True):
        between = np.array([states[r.start][0], states[r.end][1]])
        found.append(LinearRow(row, between, sign * np.array([-1.0, 1.0]), -sign * value))
    for r, g in zip(c.goal.numbers, rows.goals, strict=True):
        found.append(LinearRow(r, np.array([g.unknown]), one, -g.low))
    for r, (g, sign, value) in zip(d.goal.numbers, rows.limits, strict=True):
        found.append(LinearRow(r, np.array([g.unknown]), sign * one, -sign * value))
    return found


def unit_entries(lay: Layout, rows: Rows) -> list[tuple[Index, Index, float]]:
    """Rows, unknowns and factor of the linear parts that come one to a row: boundary momenta and
    the clock."""
    c, momentum = rows.c, rows.c.momentum.index
    t = c.time.numbers
    steps = lay.phase_of_step[: len(t)]
    return [
        (momentum[0], lay.index_p_B, 1.0),
        (momentum[-1], lay.index_p_E, -1.0),
        (c.start_velocity.numbers, lay.index_p_B[: c.start_velocity.count], 1.0),
        (c.goal_velocity.numbers, lay.index_p_E[: c.goal_velocity.count], 1.0),
        (t, lay.index_t[1:], 1.0),
        (t, lay.index_t[:-1], -1.0),
        (t, lay.index_h[steps], -1.0),
    ]
