"""The integrals, the cost and the peaks of a motion, along the paths that are integrated from each
node: what the motion says of them, and the bounds of integrals."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import isnan

import numpy as np

from dmoc.base.records import record
from dmoc.check.checked_motion import Motion
from dmoc.check.findings import Findings, infinite_where_none
from dmoc.check.hits import hit_peaks, planned_hits
from dmoc.check.integrated_steps import IntegratedSteps, basis_at
from dmoc.check.limit_functions import Bools, LimitFunctions
from dmoc.check.path_limits import ALMOST_NOTHING, Excess, counted
from dmoc.check.quadrature import Integrals, Integrands, Place, integrals_along, joined, together
from dmoc.codegen.kernels import Array

# Change of totals and peaks, in their sizes, that shows how much of an objective they make.
NUDGE = 1e-3
# What positions may be off by and still pass, in their sizes, and the share of the steps in which
# integrands are no larger than what counts: a peak makes no error of its own small.
PLACED, MOST = 0.01, 0.9
# The middle of a step.
HALF = np.array([0.5])
HALF_BASIS = basis_at(HALF)
# Errors below this share of the magnitude need no look at how little that is, and those below the
# other one no explanation.
SMALL, CLEAR = 1e-6, 1e-3
INTEGRAL, COST, PEAK = "error of an integral", "error of the cost", "error of a peak"


@record(frozen=True, eq=False)
class _Totals:
    """The integrals of a motion and, if it says one, behind them its cost: what they are called,
    along the paths and as the motion says them, the sizes that errors are relative to, and the
    errors."""

    names: tuple[str, ...]
    along: Integrals
    values: Array
    claims: Array
    sizes: Array
    errors: Array


def integral_errors(
    motion: Motion, courses: Sequence[IntegratedSteps], peaks: Array
) -> tuple[Findings, tuple[Excess, ...]]:
    """The errors of the integrals and of the cost that the motion says, relative to those of the
    magnitudes, and the excesses of bounds of integrals, relative to value and bound, at least to
    the same.  ``peaks`` are those along the paths."""
    count = len(motion.model.kernels.integrals)
    if not (count or _has_cost(motion)):
        return Findings({INTEGRAL: 0.0, COST: 0.0}), ()
    totals = _totals(motion, courses, peaks)
    measured, origins, errors = {}, {}, totals.errors.tolist()
    for name, part in ((INTEGRAL, errors[:count]), (COST, errors[count:])):
        measured[name] = worst = max(part, default=0.0)
        if CLEAR < worst < np.inf:
            origins[name] = _explained(motion, totals, errors.index(worst))
    sentences, excesses = _contradictions(motion, totals), _excesses(motion, totals)
    return Findings(measured, tuple(sentences), origins), tuple(excesses)


def _has_cost(motion: Motion) -> bool:
    """Whether the motion says what it costs: a simulation does not."""
    return not isnan(motion.trajectory.cost)


def _totals(motion: Motion, courses: Sequence[IntegratedSteps], peaks: Array) -> _Totals:
    """The integrals and the cost of a motion."""
    model, trajectory = motion.model, motion.trajectory
    names, has_cost = tuple(model.kernels.integrals), _has_cost(motion)
    parts = [(part, [joined(own)]) for part, own in motion.by_values(courses) if own]
    along = together([integrals_along(own, _integrands(part)) for part, own in parts])
    values, sizes = along.values.copy(), along.sizes.copy()
    if len(model.hit_sums) and trajectory.collisions:
        of_hits = _of_hits(motion)
        np.add.at(values, model.hit_sums[:, 0], of_hits.sum(axis=0))
        np.add.at(sizes, model.hit_sums[:, 0], np.abs(of_hits).sum(axis=0))
        usual = np.nan_to_num(_of_hits(motion, usual=True), posinf=0.0, neginf=0.0)
        least = ALMOST_NOTHING * np.abs(usual)
        np.maximum.at(sizes, model.hit_sums[:, 0], least.max(axis=0, initial=0.0))
    claims = [trajectory.totals.get(n, float(v)) for n, v in zip(names, values, strict=False)]
    if has_cost:
        claims.append(trajectory.cost)
        of_integrals = values[: len(names)], sizes[: len(names)]
        rest, size = _beside_running_cost(motion, of_integrals, peaks)
        values[-1] += rest
        sizes[-1] += size
    off = np.abs(values - claims) + along.left
    if trajectory.limits or not (off <= SMALL * sizes).all():
        for part, (own,) in parts:
            sizes = _at_least(sizes, part, own, _integrands(part))
    sizes = np.where(sizes > 0, sizes, 1.0)
    errors = np.where(along.undefined | along.has_pole, np.inf, infinite_where_none(off / sizes))
    what = (*map(repr, names), "the cost")
    return _Totals(what, along, values, np.array(claims), sizes, errors)


def _integrands(motion: Motion) -> Integrands:
    """The integrands of the integrals and, if it says one, behind them that of the cost."""
    model, has_cost = motion.model, _has_cost(motion)

    def integrands(*state: Array) -> Array:
        if not has_cost:
            return model.integrands(*state)
        cost = model.running_cost(*state)[:, None]
        return np.hstack([model.integrands(*state), cost]) if model.kernels.integrals else cost

    return integrands


def _of_hits(motion: Motion, usual: bool = False) -> Array:
    """What the planned hits add to the integrals, or usual ones would, shape (events, terms)."""
    model = motion.model
    hits = planned_hits(motion)
    states = hits.usual(motion) if usual else hits.states
    at_events = motion.models.along(np.arange(len(hits.surfaces)))
    return np.where(model.counting(hits.surfaces), at_events.hit_terms(*states), 0.0)


def _beside_running_cost(
    motion: Motion, integrals: tuple[Array, Array], peaks: Array
) -> tuple[float, float]:
    """What the end and the objective, by values and sizes of integrals and by peaks, add to the
    cost, and the size of that."""
    model, first, last = motion.model, motion.trajectory.phases[0], motion.trajectory.phases[-1]
    if not (model.has_objective or model.has_terminal_cost):
        return 0.0, 0.0
    start, end = (first.q[:1], first.v[:1]), (last.q[-1:], last.v[-1:])
    terminal = float(motion.models[-1].terminal_cost(*end, last.t[-1:])[0])
    values, sizes = (
        np.append(np.append(part, motion.sizes.time)[: len(model.totals_of)], of_peaks)
        for part, of_peaks in zip(integrals, (peaks, np.abs(peaks)), strict=True)
    )

    def objective(row: Array) -> float:
        totals, highest = np.split(row, [len(model.totals_of)])
        return model.objective(totals, highest, start, end)

    value = objective(values)
    moved = [abs(objective(values + NUDGE * way) - value) / NUDGE for way in np.diag(sizes)]
    return terminal + value, abs(terminal) + abs(value) + sum(moved)


def _at_least(
    of_values: Array, motion: Motion, course: IntegratedSteps, integrands: Integrands
) -> Array:
    """Sizes of integrals, shape (number,), not below those of rounding errors and of errors of
    positions that pass: a share of those over the whole time of motions whose velocities and inputs
    are of their sizes, and what positions beside the own ones make."""
    sizes, (q, v, u, t) = motion.sizes, (part[0] for part in course.along(HALF, HALF_BASIS))
    used = np.abs(u).max(axis=0, initial=0.0)
    needed = np.where(np.isfinite(motion.needed_inputs), motion.needed_inputs, 0.0)
    fast, strong = np.tile(sizes.v, (len(q), 1)), np.tile(np.maximum(used, needed), (len(q), 1))
    off = PLACED * sizes.q
    states = (q, q, q + off, q - off), (fast, v, v, v), (strong, u, u, u), (t, t, t, t)
    values = integrands(*(np.concatenate(rows) for rows in states))
    usual, own, *beside = values.reshape(4, len(q), -1)
    looks = np.abs([ALMOST_NOTHING * usual, *(look - own for look in beside)])
    looks = np.where(np.isfinite(looks), looks, 0.0)
    if (sizes.time * looks.max(axis=(0, 1)) <= of_values).all():
        return of_values
    least = sizes.time * np.quantile(looks, MOST, axis=1).max(axis=0)
    return np.asarray(np.maximum(of_values, least))


def _explained(motion: Motion, totals: _Totals, j: int) -> str:
    """What an integral is along the paths, and where it is hardest to know."""
    place = totals.along.hardest(j)
    return (
        f"{totals.names[j]} is {totals.values[j]:.6g} along the motion, not {totals.claims[j]:.6g},"
        f" with an integrand of {place.value:.3g} {_where(motion, place)}"
    )


def _contradictions(motion: Motion, totals: _Totals) -> Iterator[str]:
    """Integrands that are no number somewhere, or have a pole."""
    along = totals.along
    for j in np.flatnonzero(along.undefined | along.has_pole).tolist():
        what = "is not a number" if along.undefined[j] else "has a pole"
        yield (
            f"the integrand of {totals.names[j]} {what} {_where(motion, along.hardest(j))}: keep "
            "the motion away from there by a path constraint"
        )


def _where(motion: Motion, place: Place) -> str:
    """A place in words."""
    names = motion.trajectory.coordinates
    values = ", ".join(f"{n} = {x:.4g}" for n, x in zip(names, place.q, strict=True))
    return f"at {place.t:.4g} s, {values}"


def _excesses(motion: Motion, totals: _Totals) -> Iterator[Excess]:
    """Bounds of integrals that are exceeded."""
    numbers = (part.tolist() for part in (totals.values, totals.sizes))
    for name, value, size in zip(motion.model.kernels.integrals, *numbers, strict=False):
        low, high = motion.trajectory.limits.get(name, (-np.inf, np.inf))
        bound = low if low - value > value - high else high
        excess = max(low - value, value - high) / max(size, abs(value) + abs(bound))
        if excess > 0:
            what = f"the bound of {name} ({value:.6g})"
            yield Excess(excess, excess, what, motion.trajectory.final_time)


def peak_errors(motion: Motion, courses: Sequence[IntegratedSteps]) -> tuple[Array, Findings]:
    """The peaks of quantities, and the errors of those that the motion says, relative to the
    largest magnitude.  Between quadrature points, where quantities vary more, they count as path
    constraints do."""
    model, totals = motion.model, motion.trajectory.totals
    at_hits, of_hits = hit_peaks(motion)
    if not model.peaks_of:
        return at_hits, _findings(of_hits)
    parts = [_visited(*part) for part in motion.by_values(courses)]
    values, at_points, after = (np.concatenate(part) for part in list(zip(*parts, strict=True))[:3])
    moved, rows = np.max([part[3] for part in parts], axis=0), model.kernels.quantity_rows
    peaks, errors = np.zeros(len(model.peaks_of)), dict[float, str]()
    for k, ((j, both), name) in enumerate(zip(model.peaks_of, model.peak_names, strict=False)):
        z, counts = values[:, j], counted(motion, [rows[j]], at_points, after)[:, 0]
        row = infinite_where_none(np.abs(z) if both else z)
        peaks[k] = row[counts == 1].max()
        claim = totals.get(name, float(peaks[k]))
        above = float((counts * (row - claim))[counts > 0].max())
        size = max(np.abs(z).max(), abs(claim), ALMOST_NOTHING * moved[j])
        error = max(claim - peaks[k], above) / (size or 1.0)
        errors[float(error)] = f"{name} is {peaks[k]:.6g} along the motion, not {claim:.6g}"
    return np.append(peaks, at_hits), _findings(errors | of_hits)


def _visited(
    motion: Motion, courses: Sequence[IntegratedSteps]
) -> tuple[Array, Bools, Bools, Array]:
    """Quantities (n, nz) at the states that a motion visits, which of these are quadrature points
    and which come after an event that ends it, and what sizes of all that a state consists of move
    quantities by, shape (nz,)."""
    functions, model = LimitFunctions.of(motion), motion.model
    states, at_points, after = functions.visited(courses)
    slopes = np.abs(model.quantity_slopes(*functions.split(states)))
    moved = np.nan_to_num(slopes @ functions.sizes(states), posinf=0.0).max(axis=0)
    return model.quantities(*functions.split(states)), at_points, after, moved


def _findings(errors: dict[float, str]) -> Findings:
    """The largest of the errors, with its sentence."""
    worst = max(errors, default=0.0)
    return Findings({PEAK: worst}, (), {PEAK: errors[worst]} if errors else {})
