"""What the fixed values of a problem settle of its contacts, and what of them follows from others:
rows that hold whatever the unknowns are, which would depend on others, are left out of the program.

A row that its fixed values contradict is none of them: it stays, and no motion satisfies it.  Both
follow from the residuals of a row with its fixed values and any others: at random positions,
velocities and times, of what sticks also where the other conditions hold.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import fields, replace
from typing import Any, NamedTuple, TypeVar

import numpy as np

from dmoc.base.names import momentum_name, velocity_name
from dmoc.base.records import record
from dmoc.base.tolerances import KEPT
from dmoc.codegen.kernels import Array
from dmoc.mechanics.model import Model
from dmoc.mechanics.redundancy import redundancy
from dmoc.mechanics.touch import Touch
from dmoc.problem.derived import once
from dmoc.problem.design import samples
from dmoc.problem.problem import Problem
from dmoc.problem.reach import gap_sizes, latest_time, rate_sizes
from dmoc.program.blocks import Bools, Index
from dmoc.program.layout import Layout

# So many states say whether a row holds for all.
SAMPLES = 4
Values = tuple[Array, Array]  # with their sizes
T = TypeVar("T")
NO_INDEX: Index = np.zeros(0, dtype=np.intp)


@record(frozen=True, eq=False)
class States:
    """States of one node, those that are fixed and any others: rows of positions and velocities,
    and times."""

    q: Array
    v: Array
    t: Array


@record(frozen=True, eq=False)
class Settled:
    """Rows of contacts that hold by themselves.

    Attributes
    ----------
    places : array of bool, shape (phases + 1, nc)
        Gaps at the start, at the events and at the end.
    stuck : array of bool, shape (phases, nt)
        What sticks in a phase at whose end its place is fixed, and was before: its last row.
    rates, slides : arrays of bool, shapes (2, nc) and (2, nt)
        Rates of gaps and sliding velocities at the start and at the end of the motion, these
        within the directions in which they slide there.
    closed, sticks : arrays of bool, shapes (phases, nc) and (phases, nt)
        What is closed or sticks in a phase by its other conditions.
    stops : array of bool, shape (phases, nt)
        What stops sliding with a phase where others do.
    """

    places: Bools
    stuck: Bools
    rates: Bools
    slides: Bools
    closed: Bools
    sticks: Bools
    stops: Bools

    @classmethod
    def nothing(cls, lay: Layout) -> Settled:
        names, phases = lay.touch.contacts, lay.phases
        nc, nt = len(names.surfaces), len(names.tangents)
        ends = (phases + 1, nc), (phases, nt), (2, nc), (2, nt)
        shapes = *ends, (phases, nc), (phases, nt), (phases, nt)
        return cls(*(np.zeros(shape, dtype=bool) for shape in shapes))


def settled(problem: Problem, lay: Layout, limits: tuple[Array, Array]) -> Settled:
    """Find the rows of contacts that hold by the values that ``limits`` fix, lower and upper bounds
    of shape (n,), whatever the design."""

    def find() -> Settled:
        of_samples = [_settled(p, lay, limits) for p in samples(problem)]
        values = [[getattr(s, f.name) for f in fields(Settled)] for s in of_samples]
        return Settled(*map(np.logical_and.reduce, zip(*values, strict=True)))

    return _once(problem, limits, (settled, lay), find)


def _once(problem: Problem, limits: tuple[Array, Array], key: Hashable, find: Callable[[], T]) -> T:
    """What is found of a problem whose ``limits`` fix some values, once for these and a key: one
    solve makes several programs of it."""
    (low, high), every = limits, once(problem, _nothing)
    at = key, np.where(low == high, low, np.nan).tobytes()
    if at not in every:
        every[at] = find()
    found: T = every[at]
    return found


def _nothing(problem: Problem) -> dict[Hashable, Any]:
    """What is known of a problem before anything is found."""
    return {}


def _settled(problem: Problem, lay: Layout, limits: tuple[Array, Array]) -> Settled:
    touch = lay.touch
    nodes = [_states(problem, lay, limits, i) for i in range(lay.phases + 1)]
    ends = (nodes[0], nodes[-1])
    places = np.array([_vanish(*_gaps(problem, at)) for at in nodes])
    rates = np.array([_vanish(*_gap_rates(problem, at)) for at in ends])
    slides = np.array([_keep(problem, touch, e, at) for e, at in zip((0, -1), ends, strict=True)])
    stuck = _stuck([_tangents(problem, at) for at in nodes], touch.sticks)
    if problem.relations:
        back, end = _returned(problem, *ends), ends[1]
        closed, sticks = touch.is_closed[[0, -1]], touch.sticks[[0, -1]]
        if lay.ends_with_event:  # its surface has rows at the end, whatever there is at the start
            closed[0] = sticks[0] = True
        for rows, values, last in (
            (places, _gaps, closed), (rates, _gap_rates, closed), (slides, _slide_rates, sticks),
        ):  # fmt: skip
            _relate(rows, _alike(values(problem, back), values(problem, end)), last)
        same = _alike(_tangents(problem, back), _tangents(problem, end)).diagonal()
        stuck[lay.stepped - 1] |= same & touch.sticks.all(axis=0)
    stuck &= touch.contacts.in_place  # rates along steps depend on all of these
    if floating := list(touch.contacts.floating):
        kept = _stuck([_gaps(problem, at) for at in nodes], touch.is_closed)
        places[0, floating], places[1:, floating] = True, kept[:, floating]
    if lay.ends_with_event:  # it has the place of the end
        places[-2] |= places[-1]
    return Settled(places, stuck, rates, slides, *_redundant(problem, touch))


def _redundant(problem: Problem, touch: Touch) -> tuple[Bools, Bools, Bools]:
    """Closed surfaces and sticking tangents of each phase that follow from its other conditions,
    and tangents that stop at its end with others; shapes (phases, nc), (phases, nt) and (phases,
    nt)."""
    closed, sticks = np.zeros_like(touch.is_closed), np.zeros_like(touch.sticks)
    for i, follows in enumerate(problem.redundant):
        closed[i, list(follows.closed)] = sticks[i, list(follows.sticking)] = True
    stops = np.zeros_like(sticks)
    for i in np.flatnonzero(touch.stops.sum(axis=1) > 1).tolist():
        stopped = np.flatnonzero(touch.stops[i]).tolist()
        mode = touch.modes[i]
        still = replace(mode, sticking=(*mode.sticking, *stopped))
        given = problem.start_position, problem.reach, latest_time(problem)
        follows = redundancy(problem.model, still, *given)
        stops[i, list(follows.sticking)] = True
    return closed, sticks, stops & touch.stops


class JointsSettled(NamedTuple):
    """Rows of constraints of a model that hold by themselves.

    Attributes
    ----------
    places : array of bool, shape (phases + 1, nj)
        Places at the start and at the end of each phase.
    rates : array of bool, shape (2, nj)
        Rates at the start and at the end of the motion.
    follows : array of bool, shape (phases, nj)
        Constraints that follow from others.
    """

    places: Bools
    rates: Bools
    follows: Bools


def joints_settled(problem: Problem, lay: Layout, limits: tuple[Array, Array]) -> JointsSettled:
    """Find the rows of constraints that hold by the values that ``limits`` fix, lower and upper
    bounds of shape (n,), whatever the design."""

    def find() -> JointsSettled:
        of_samples = [_joints_settled(p, lay, limits) for p in samples(problem)]
        places, rates = (np.logical_and.reduce(part) for part in zip(*of_samples, strict=True))
        return JointsSettled(places, rates, following_joints(problem))

    return _once(problem, limits, (joints_settled, lay), find)


def following_joints(problem: Problem) -> Bools:
    """Constraints that follow from others in each phase, shape (phases, nj)."""
    follows = np.zeros((len(problem.redundant), problem.model.nj), dtype=bool)
    for i, redundant in enumerate(problem.redundant if problem.model.nj > 1 else ()):
        follows[i, list(redundant.joints)] = True
    return follows


def _joints_settled(
    problem: Problem, lay: Layout, limits: tuple[Array, Array]
) -> tuple[Bools, Bools]:
    nodes = [_states(problem, lay, limits, i) for i in range(lay.phases + 1)]
    ends = (nodes[0], nodes[-1])
    places = np.array([_vanish(*_joints(problem, at)) for at in nodes])
    places[1:] &= problem.model.joints_in_place  # rates along steps depend on all of these
    rates = np.array([_vanish(*_joint_rates(problem, at)) for at in ends])
    if problem.relations:
        back, every = _returned(problem, *ends), np.ones_like(rates)
        for rows, values in ((places, _joints), (rates, _joint_rates)):
            _relate(rows, _alike(values(problem, back), values(problem, ends[1])), every)
        places[-1] &= problem.model.joints_in_place
    if lay.ends_with_event:
        places[-2] |= places[-1]
    return places, rates


def _states(problem: Problem, lay: Layout, limits: tuple[Array, Array], i: int) -> States:
    """States at the start (0), at an event, or at the end."""
    rng, first, last = np.random.default_rng(i), i == 0, i == lay.phases
    early, late = problem.final_time_bounds[0], latest_time(problem)
    t = np.zeros(SAMPLES) if first else rng.uniform(early if last else 0.0, late, SAMPLES)

    def drawn(index: Index, middle: Array | float, size: Array) -> Array:
        others = middle + size * rng.standard_normal((SAMPLES, problem.nq))
        fixed = limits[0][index] == limits[1][index]
        return np.asarray(np.where(fixed, limits[0][index], others))

    q = drawn(lay.index_q[lay.ends[i]], problem.start_position, problem.reach)
    at_end = (lay.index_p_B, lay.index_v_B) if first else (lay.index_p_E, lay.index_v_E)
    p, v = at_end if first or last else (NO_INDEX, NO_INDEX)
    if len(p) and (limits[0][p] == limits[1][p]).all():
        model = problem.models[0 if first else -1]
        return States(q, model.velocity(q, np.tile(limits[0][p], (SAMPLES, 1)), t), t)
    fast = problem.reach / late
    return States(q, drawn(v, 0.0, fast) if len(v) else fast * rng.standard_normal(q.shape), t)


def gaps_returned(
    problem: Problem, lay: Layout, limits: tuple[Array, Array], determined: Bools
) -> Bools:
    """Gaps at the start and at the end, shape (2, nc), that periodic states make those of the other
    end which are ``determined``, by a contact or by fixed values, whatever the design."""

    def find() -> Bools:
        of_samples = [_gaps_returned(p, lay, limits, determined) for p in samples(problem)]
        return np.asarray(np.logical_and.reduce(of_samples))

    return _once(problem, limits, (gaps_returned, lay, determined.tobytes()), find)


def _gaps_returned(
    problem: Problem, lay: Layout, limits: tuple[Array, Array], determined: Bools
) -> Bools:
    end = _states(problem, lay, limits, lay.phases)
    back = _returned(problem, _states(problem, lay, limits, 0), end)
    (starts, start_sizes), (ends, end_sizes) = _gaps(problem, back), _gaps(problem, end)
    off = np.abs(starts[:, :, None] - ends[:, None, :])
    same = (off <= KEPT * np.maximum(start_sizes[:, :, None], end_sizes[:, None, :])).all(axis=0)
    return np.array([(same & determined[1]).any(axis=1), (same.T & determined[0]).any(axis=1)])


def _returned(problem: Problem, start: States, end: States) -> States:
    """The states at the start that end as ``end``; what is not periodic is that of ``start``."""
    model, names = problem.models[0], problem.kernels.coordinates
    quantities = problem.kernels.quantities
    fixed = [r for r in problem.relations if r.fixed and not {r.end, *r.starts} & {*quantities}]
    if not fixed:
        return start
    begun, ended = _by_name(model, start), _by_name(problem.models[-1], end)
    of = list(dict.fromkeys(name for r in fixed for name in r.starts))
    factors = np.array([[dict(r.terms).get(name, 0.0) for name in of] for r in fixed])
    wanted = np.transpose([ended[r.end] - r.low for r in fixed])
    before = np.transpose([begun[name] for name in of])
    moved = before + (wanted - before @ factors.T) @ np.linalg.pinv(factors).T
    begun = dict(zip(of, moved.T, strict=True))
    q = np.transpose([begun.get(n, x) for n, x in zip(names, start.q.T, strict=True)])
    v = np.transpose(
        [begun.get(velocity_name(n), x) for n, x in zip(names, start.v.T, strict=True)]
    )
    if any(momentum_name(n) in begun for n in names):
        p = model.momentum(q, v, start.t).T
        p = np.transpose([begun.get(momentum_name(n), x) for n, x in zip(names, p, strict=True)])
        v = model.velocity(q, p, start.t)
    return States(q, v, start.t)


def _by_name(model: Model, at: States) -> dict[str, Array]:
    """Samples of all states by name, shape (samples,) each."""
    names, momenta = model.kernels.coordinates, model.momentum(at.q, at.v, at.t)
    values: dict[str, Array] = {}
    for naming, columns in ((str, at.q), (velocity_name, at.v), (momentum_name, momenta)):
        values |= dict(zip(map(naming, names), columns.T, strict=True))
    return values


def _relate(rows: Bools, alike: Bools, act: Bools) -> None:
    """Settle one of two rows at both ends that periodic states make one, in place. It is that of
    the end where fixed values settle that of the start, else that of the start. ``rows`` and
    ``act`` have a row for each end, ``alike`` the shape (start, end)."""
    fixed = rows[0] & act[0]
    rows[0] |= (alike & act[1]).any(axis=1)
    rows[-1] |= (alike & fixed[:, None]).any(axis=0)


def _stuck(nodes: list[Values], sticks: Bools) -> Bools:
    """What sticks in a phase at whose end its place is fixed, and was fixed before: its values at
    the ends of phases, (samples, n) each, and phases in which it ``sticks``, (phases, n); shape
    (phases, n)."""
    values, sizes = zip(*nodes, strict=True)
    stuck = np.zeros_like(sticks)
    for j in range(sticks.shape[1]):
        before = -1
        for i, x in enumerate(values):
            if i and not sticks[i - 1, j]:
                before = -1
            bound = KEPT * np.maximum(sizes[i], sizes[before])[:, j]
            if not (np.abs(x[:, j] - x[0, j]) <= bound).all():
                continue  # it is not fixed here
            if before >= 0:
                stuck[i - 1, j] = (np.abs(x[:, j] - values[before][:, j]) <= bound).all()
            before = i
    return stuck


# Values with their sizes --------------------------------------------------------------------------


def _gaps(problem: Problem, at: States) -> Values:
    return problem.model.gaps(at.q, at.t), gap_sizes(problem, at.q, at.t)


def _tangents(problem: Problem, at: States) -> Values:
    slopes = problem.model.tangent_slopes(at.q, at.t)
    along = np.abs(np.column_stack([np.maximum(np.abs(at.q), problem.reach), at.t]))
    return problem.model.tangents(at.q, at.t), (np.abs(slopes) @ along[..., None])[..., 0]


def _gap_rates(problem: Problem, at: States) -> Values:
    slopes = problem.model.gap_slopes(at.q, at.t)
    return problem.model.gap_rates(at.q, at.v, at.t), rate_sizes(problem, slopes, at.v)


def _slide_rates(problem: Problem, at: States) -> Values:
    slopes = problem.model.tangent_slopes(at.q, at.t)
    return problem.model.slide_rates(at.q, at.v, at.t), rate_sizes(problem, slopes, at.v)


def _joints(problem: Problem, at: States) -> Values:
    return problem.model.joints(at.q, at.t), problem.model.joint_sizes(at.q, at.t)


def _joint_rates(problem: Problem, at: States) -> Values:
    slopes = problem.model.joint_slopes(at.q, at.t)
    return problem.model.joint_rates(at.q, at.v, at.t), rate_sizes(problem, slopes, at.v)


def _vanish(values: Array, sizes: Array) -> Bools:
    """Columns that are zero in all samples."""
    return np.asarray((np.abs(values) <= KEPT * sizes).all(axis=0))


def _keep(problem: Problem, touch: Touch, phase: int, at: States) -> Bools:
    """Tangents that move in all samples as a phase says."""
    rates, sizes = _slide_rates(problem, at)
    return np.asarray((touch.astray(phase, rates) <= KEPT * sizes).all(axis=0))


def _alike(starts: Values, ends: Values) -> Bools:
    """Pairs of values at the start and at the end that are the same up to their sign, shape (start,
    end)."""
    off = np.abs(np.abs(starts[0])[:, :, None] - np.abs(ends[0])[:, None, :])
    bound = KEPT * np.maximum(starts[1][:, :, None], ends[1][:, None, :])
    return np.asarray((off <= bound).all(axis=0))
