"""Sizes of a problem's quantities, read off a first motion, so that no result depends on units.

Solvers and judges see unknowns divided by their sizes, constraints divided by theirs, and the cost
divided by its own.  Each size follows from others of the same kind, never from a number of ours, so
that a problem stated in other units has the same scaled program.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any, TypeVar, cast

import numpy as np

from dmoc.base.records import record
from dmoc.base.tolerances import BALANCED, ROUNDING
from dmoc.codegen.kernels import Array
from dmoc.problem.problem import Problem
from dmoc.program.force_unknowns import sizes as pushing
from dmoc.program.implied_values import lifted, quantity_inputs
from dmoc.program.iterate import Iterate
from dmoc.program.layout import Layout
from dmoc.program.path_sizes import finite, path_sizes
from dmoc.program.scale import SINGLE, Scale
from dmoc.program.stacked import Stacked
from dmoc.program.structure_cache import MEMORY, MOST_REMEMBERED
from dmoc.program.totals import hit_quantities, of_hits, peaks_at, totals_at

# What hardly moves counts by this share of what it could do with the kinetic energy that others
# have.
STILL = 0.1
# Inputs below this share of what balances the forces that there are say nothing of their size.
FAINT = 1e-2
# Share of the slopes and curvatures of a cost, over the sizes of the unknowns, that its size is at
# least.
FLAT = 1e-3
# Share of its range that the size of a design parameter is at least.
NARROW = 1e-2
# Scaled cost of a first motion, and of a minimum, which costs less: what constraints of size 1 are
# weighed against in merit functions and barriers.
FIRST_COST, MINIMUM_COST = 100.0, 10.0


T = TypeVar("T", "Reached", Scale)


@record(frozen=True, eq=False)
class Reached:
    """What a motion reaches and what the model makes of it, whatever its problem bounds: the time,
    largest values and ranges of coordinates, of rates, momenta, forces, inertias and inputs,
    the kinetic energy, the largest derivatives of the generalised forces by the inputs (nq, nu), of
    gaps, tangents and joints by (q, t), of crossing functions by (q, v, t), the cost, and its
    slopes and curvatures in each step."""

    time: float
    q: Array
    range: Array
    rate: Array
    p: Array
    force: Array
    inertia: Array
    kinetic: float
    u: Array
    by_input: Array
    gap: Array
    tangent: Array
    joint: Array
    crossing: Array
    within: Array
    cost: float
    cost_slopes: Array
    cost_curvatures: Array
    end_slopes: Array


def _reached(at: Iterate) -> Reached:
    """Sizes that a motion reaches; those of recent motions are kept."""
    problem, lay = at.problem, at.lay
    kernels, par = problem.kernels, problem.parameter_values
    few = lay.is_shared and lay.size <= MOST_REMEMBERED
    key = (lay, *kernels.identity, par.tobytes(), at.x.tobytes()) if few else None
    return MEMORY.reached.of(key, lambda: _measured(at))


def _measured(at: Iterate) -> Reached:
    problem, model, models = at.problem, at.model, at.problem.models
    q, t, rates = at.q, at.t, at.rates
    middle, now = (q[:-1] + q[1:]) / 2, (t[:-1] + t[1:]) / 2
    mass, F = model.equations(middle, rates, t=now)
    kinetic = finite(np.einsum("ki,kij,kj->k", rates, mass, rates) / 2, 0.0).max(initial=0.0)
    places = (
        slopes(q, t)
        for slopes in (
            models[0].gap_slopes, models[0].tangent_slopes, models[0].joint_slopes,
            models[0].within_slopes,
        )
    )  # fmt: skip
    gap, tangent, joint, within = (np.abs(finite(slopes, 0.0)).max(axis=0) for slopes in places)
    by_input = np.abs(model.input_matrix(middle, rates, t=now)).max(axis=0) if problem.nu else None
    return Reached(
        float(at.lay.durations(at.x).sum()),
        np.abs(q).max(axis=0),
        np.ptp(q, axis=0),
        np.abs(rates).max(axis=0),
        finite(np.abs(model.momentum(middle, rates, now)).max(axis=0), 0.0),
        finite(np.abs(F).max(axis=0), 0.0),
        finite(np.abs(np.diagonal(mass, axis1=1, axis2=2)).max(axis=0), 1.0),
        float(kinetic),
        np.abs(at.x[at.lay.index_u]).max(axis=0, initial=0.0),
        np.zeros((problem.nq, 0)) if by_input is None else by_input,
        gap,
        tangent,
        joint,
        np.abs(finite(model.crossing_slopes(middle, rates, now), 0.0)).max(axis=0),
        within,
        cost_of(at),
        np.abs(model.step_cost_slopes(at.steps)),
        np.abs(model.step_cost_curvatures(at.steps)),
        np.abs(models[-1].terminal_cost_slopes(*at.end(-1))),
    )


def scale_of(problem: Problem, x: Array, minimum: bool = False) -> Scale:
    """Read sizes off the unknowns x, shape (n,), of a motion, a first one or a minimum: ranges,
    velocities, momenta, inputs, gaps; the cost with its slopes and curvatures."""
    at = Iterate.of(problem, x)
    problem, lay, model = at.problem, at.lay, at.problem.model
    with np.errstate(all="ignore"):
        scale, local = _with_cost(at, _reached(at), minimum)
        whole: Any = {name: float(getattr(scale, name)) for name in SINGLE}
        scale = replace(scale, **whole)
        of_motion = scale.path, scale.quantity, scale.totals, scale.hit_quantity
        if not any(sizes.size for sizes in of_motion):
            return scale
        sized = _sized(at, scale)
        path = path_sizes(at, (at.steps, sized), local, "path")
        pushed = np.tile(pushing(scale)[: model.ny], (lay.total, lay.scheme.points))
        local = np.hstack([local, pushed])
        inputs = quantity_inputs(at), [*sized, *[pushed] * bool(lay.force.count)]
        quantity = path_sizes(at, inputs, local, "quantity")
        totals = _totals(at, (at.steps, sized))
        of_steps, at_hits = ([j for j, _ in of] for of in (model.peaks_of, model.hit_peaks_of))
        peaks = np.concatenate([quantity[of_steps], scale.hit_quantity[at_hits]])
        return replace(scale, path=path, quantity=quantity, peaks=peaks, totals=totals)


def scale_of_rows(problems: Stacked, lay: Layout, x: Array, minimum: bool) -> Scale:
    """The sizes of R problems of one form, each off its own unknowns x, shape (R, n), as
    :func:`scale_of` reads them, with a leading axis for the problems: of motions that are free
    between hits."""
    rows = list(zip(problems.each, x, strict=True))
    if problems.kernels.manifest.path_rows:  # looks along each motion
        return _stacked([scale_of(problem, own, minimum) for problem, own in rows])
    with np.errstate(all="ignore"):
        every = [Iterate(lay.problem_at(problem, own), lay, own) for problem, own in rows]
        reached = [_reached(at) for at in every]
        of_all = reached[0]
        if not all(one is of_all for one in reached):
            of_all = _stacked(reached)
        designed = cast(Problem, Stacked([at.problem for at in every]))
        return _with_cost(Iterate(designed, lay, x), of_all, minimum)[0]


def _stacked(every: Sequence[T]) -> T:
    """Records of one kind as one, whose arrays have a leading axis for them."""
    kind: Any = type(every[0])
    made: T = kind(*(np.array([getattr(one, f.name) for one in every]) for f in fields(kind)))
    return made


def _with_cost(at: Iterate, reached: Reached, minimum: bool) -> tuple[Scale, Array]:
    """The sizes of what moves and pushes, and of the cost; and those of the unknowns of all steps,
    shape (..., total, size)."""
    scale = _of_motion(at, reached, minimum)
    if isinstance(at.problem, Stacked):
        scale = scale.spread(len(at.problem.each))
    sizes = at.lay.sizes(scale)
    local = _local(at.lay, sizes)
    cost: Any = _cost(at, reached, (sizes, local, scale.v))
    return replace(scale, cost=cost / (MINIMUM_COST if minimum else FIRST_COST)), local


def _of_motion(at: Iterate, reached: Reached, minimum: bool) -> Scale:
    """The sizes of what moves and pushes; those of the cost, constraints and totals are 1."""
    problem, lay = at.problem, at.lay
    time, force, inertia = np.asarray(reached.time)[..., None], reached.force, reached.inertia
    size_q = _ranges(problem, reached)
    size_v = np.maximum(reached.rate, size_q / time)
    size_p = np.maximum(reached.p, inertia * size_q / time)
    forces = size_p / time, np.maximum(size_p / time, 0.0 if minimum else force)
    size_u = _inputs(problem, reached, forces)
    moving, energy = (size_q, size_v, time), _product(size_p[..., None, :], size_v) / 2
    gap, rate = _places(reached.gap, moving)
    _, slide = _places(reached.tangent, moving)
    _, joint_rate = _places(reached.joint, moving)
    by_state = np.concatenate([size_q, size_v], axis=-1)
    by_rate = np.concatenate([size_v, size_v / time], axis=-1)
    single: tuple[Any, Any, Any] = time[..., 0], np.ones_like(time[..., 0]), energy[..., 0]
    return Scale(
        *single, size_q, size_v, size_p, size_u, gap, rate, energy / rate, slide,
        energy / slide, np.ones(len(problem.kernels.manifest.path_rows)),
        np.ones(problem.model.nz), np.ones(lay.index_totals.size), np.ones(lay.index_peaks.size),
        _hidden(at, (*moving, size_u)), at.x[..., lay.index_h], joint_rate,
        energy / joint_rate, _places(reached.crossing, (by_state, by_rate, time))[0],
        _hit_quantities(at), _designs(problem), *_places(reached.within, moving),
    )  # fmt: skip


def _hit_quantities(at: Iterate) -> Array:
    """Sizes of the quantities of hits: of those of a motion, or of what bounds them."""
    if not at.problem.kernels.manifest.hit_quantities:
        return np.zeros(0)
    values, there = hit_quantities(at)
    bounds = at.problem.hit_quantity_bounds
    size = np.abs(np.where(there, finite(values, 0.0), 0.0)).max(axis=0, initial=0.0)
    bounded = np.where(np.isfinite(bounds), np.abs(bounds), 0.0).max(axis=1, initial=0.0)
    size = np.maximum(size, bounded)
    return np.where(size > 0, size, 1.0)


def _totals(at: Iterate, steps: tuple[list[Array], list[Array]]) -> Array:
    """Sizes of the totals: of what bounds them, or of what all steps add to them without their
    signs, with the hits of a motion, in it and in one whose velocities and inputs are of their
    sizes."""
    both, bounds = (lifted(at, step) for step in steps), at.problem.total_bounds
    parts = [np.abs(finite(at.model.integrals(s), 0.0)).sum(axis=0) for s in both]
    hits = np.abs(finite(of_hits(at), 0.0)).sum(axis=0)
    np.add.at(parts[0], at.model.hit_sums[:, 0], hits)
    bounds = np.where(np.isfinite(bounds), np.abs(bounds), 0.0)
    size = np.maximum(np.max(parts, axis=0), bounds.max(axis=1, initial=0.0))
    return np.where(size > 0, size, 1.0)


def _sized(at: Iterate, scale: Scale) -> list[Array]:
    """Steps that begin as those of a motion do, with velocities and inputs of their sizes."""
    q, _, u, _, h, t, *_ = at.steps
    u, end = u.copy(), q + h * scale.v
    u[:] = scale.u
    return [q, end, u, u, h, t, at.lay.scheme.within(q, end).reshape(at.lay.total, -1)]


def _designs(problem: Problem) -> Array:
    """Sizes of the design parameters: of their values, at least of a share of their ranges."""
    if not problem.design:
        return np.zeros(0)
    with np.errstate(invalid="ignore"):
        width = np.ptp(problem.design_bounds, axis=-1)
    values = np.abs(problem.design_values)
    size = np.maximum(values, np.where(np.isfinite(width), NARROW * width, 0.0))
    return np.where(size > 0, size, 1.0)


def _ranges(problem: Problem, reached: Reached) -> Array:
    """Ranges of the coordinates; one that hardly moves by its share of the energy or of its speed
    at an end, and where nothing moves by what there is to go by."""
    time, inertia, force = np.asarray(reached.time)[..., None], reached.inertia, reached.force
    kinetic = np.asarray(reached.kinetic)[..., None]
    fast = np.maximum(np.sqrt(2 * kinetic / inertia), problem.end_speeds)
    spread = np.maximum(reached.range, STILL * time * fast)
    box = problem.coordinate_bounds
    bounded = np.isfinite(box)
    width = np.where(bounded.all(axis=-1), np.ptp(np.where(bounded, box, 0.0), axis=-1), 0.0)
    # A motion that stands still but for what solvers leave is no measure of anything.
    way = force * time**2 / inertia
    # One whose forces balance counts by its share of what those of the others do.
    way = np.maximum(way, STILL * np.sqrt((inertia * way**2).max(axis=-1, keepdims=True) / inertia))
    least = np.maximum(ROUNDING * problem.reach, BALANCED * way)
    spread = np.where(spread > least, spread, 0.0)
    unsaid, place = problem.unsaid * problem.reach, reached.q
    place = np.where(place > ROUNDING * problem.reach, place, 0.0)
    for other in (unsaid, place, width, way):
        spread = np.where(spread > 0, spread, other)
    return np.where(spread > 0, spread, 1.0)


def _inputs(problem: Problem, reached: Reached, forces: tuple[Array, Array]) -> Array:
    """Sizes of the inputs: of their values and of what changes a momentum by its size, or, where
    that is next to nothing beside it, of what balances the larger ``forces`` that there are; at
    most their bounds."""
    if not problem.nu:
        return np.zeros(0)
    acts = reached.by_input > 0
    reach = np.where(acts, reached.by_input, 1.0)
    needed, balancing = (
        finite(np.where(acts, force[..., None] / reach, np.inf).min(axis=-2), 0.0)
        for force in forces
    )
    size = np.maximum(reached.u, needed)
    size = np.where(size > FAINT * balancing, size, balancing)
    box = problem.input_bounds
    limit = np.abs(box).max(axis=-1)
    size = np.where(np.isfinite(limit) & (limit > 0), np.minimum(size, limit), size)
    return np.where(size > 0, size, 1.0)


def _hidden(at: Iterate, sizes: tuple[Array, Array, Array, Array]) -> Array:
    """Sizes of the hidden unknowns: of their values, and of what moves them."""
    if not at.problem.model.ns:
        return np.zeros(0)
    q, t, v, u, model = at.q, at.t, at.rates, at.steps[2], at.model
    q, t = (q[:-1] + q[1:]) / 2, (t[:-1] + t[1:]) / 2
    size_q, size_v, time, size_u = sizes
    values = finite(np.abs(model.hidden(q, v, u, t)), 0.0).max(axis=0)
    slopes = np.abs(finite(model.hidden_slopes(q, v, u, t), 0.0)).max(axis=0)
    size = np.maximum(values, slopes @ np.concatenate([size_q, size_v, size_u, time]))
    return np.where(size > 0, size, 1.0)


def _places(slope: Array, sizes: tuple[Array, Array, Array]) -> tuple[Array, Array]:
    """Sizes of gaps or tangents and of their rates, from their largest slopes along a motion: how
    far coordinates, velocities and a time of their sizes move them; or of crossing functions, by
    states and their rates."""
    if not slope.shape[-2]:
        return np.zeros(0), np.zeros(0)
    size_q, size_v, time = sizes
    by_q, by_t = slope[..., :-1], slope[..., -1]
    place, rate = _product(by_q, size_q) + by_t * time, _product(by_q, size_v) + by_t
    return np.where(place > 0, place, 1.0), np.where(rate > 0, rate, 1.0)


def _product(A: Array, x: Array) -> Array:
    """A x of matrices (..., m, n) and vectors (..., n)."""
    return np.asarray((A @ x[..., None])[..., 0])


def cost_of(at: Iterate) -> float:
    """The cost of a motion, with the objective."""
    models, step = at.problem.models, lifted(at, at.steps)
    start, end = at.end(0), at.end(-1)
    shared = totals_at(at), peaks_at(at)
    value = at.model.step_costs(step[:7]).sum() + at.model.lifted_costs(step).sum()
    value += models[-1].terminal_cost(*end)
    return float(value + models[0].objective(*shared, start[:2], end[:2]))


def _cost(at: Iterate, reached: Reached, of: tuple[Array, Array, Array]) -> Array:
    """Size of the cost: its value, at least a small share of what its slopes and curvatures make
    of the sizes ``of`` the unknowns, of those of each step, and of the velocities."""
    sizes, local, speeds = of
    rows = *local.shape[:-2], -1
    slope = (reached.cost_slopes * local).reshape(rows).sum(axis=-1)
    bend = (reached.cost_curvatures * local**2).reshape(rows).sum(axis=-1) / 2
    if at.problem.model.ns:
        every = np.hstack([local, sizes[at.lay.hidden_of_kernels]])
        slope += np.abs(at.model.lifted_cost_slopes(lifted(at, at.steps)) * every).sum()
    time = np.broadcast_to(reached.time, speeds.shape[:-1])[..., None]
    around = np.concatenate([sizes[..., at.lay.index_q[-1]], speeds, time], axis=-1)
    flat = FLAT * (slope + (reached.end_slopes * around).sum(axis=-1) + bend)
    size = np.maximum(np.abs(reached.cost), np.where(np.isfinite(flat), flat, 0.0))
    return np.where(np.isfinite(size) & (size > 0), size, 1.0)


def _local(lay: Layout, sizes: Array) -> Array:
    """Sizes of the unknowns of all steps."""
    return np.where(lay.index_step < 0, 0.0, sizes.take(lay.index_step, axis=-1))
