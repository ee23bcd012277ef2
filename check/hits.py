"""The planned hits of a motion, and the quantities of hits there, within bounds and below peaks."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from dmoc.base.records import record
from dmoc.check.checked_motion import Motion
from dmoc.check.findings import infinite_where_none, largest
from dmoc.check.path_limits import ALMOST_NOTHING, Excess
from dmoc.codegen.kernels import Array


@record(frozen=True, eq=False)
class PlannedHits:
    """The surfaces that each event hits or lands; places, velocities before and after, impulses of
    all surfaces and times of the events, as :meth:`Model.hit_terms` takes them."""

    surfaces: tuple[tuple[int, ...], ...]
    states: tuple[Array, Array, Array, Array, Array]

    def usual(self, motion: Motion) -> tuple[Array, Array, Array, Array, Array]:
        """Hits with the sizes of velocities and the largest of the impulses."""
        q, v_a, _, lam, t = self.states
        v_a = np.tile(motion.sizes.v, (len(v_a), 1))
        return q, v_a, -v_a / 2, np.full_like(lam, lam.max(initial=0.0)), t


def planned_hits(motion: Motion) -> PlannedHits:
    """The events of a motion as hits."""
    model, trajectory = motion.model, motion.trajectory
    numbers, both = model.surface_numbers, list(pairwise(trajectory.phases))
    lam, hit = np.zeros((len(both), model.nc)), []
    for row, c in zip(lam, trajectory.collisions, strict=True):
        struck = (c.surface, *(name for name in c.lands if name != c.surface)) if c.surface else ()
        hit.append(tuple(numbers[name] for name in struck))
        for name, impulse in {**dict.fromkeys(struck[:1], c.impulse), **c.impulses}.items():
            row[numbers[name]] = impulse
    rows = [(before.q[-1], before.v[-1], after.v[0]) for before, after in both]
    q, v_a, v_c = np.moveaxis(np.array(rows).reshape(len(both), 3, model.nq), 1, 0)
    t = np.array([c.time for c in trajectory.collisions])
    return PlannedHits(tuple(hit), (q.copy(), v_a.copy(), v_c.copy(), lam, t))


def hit_peaks(motion: Motion) -> tuple[Array, dict[float, str]]:
    """The peaks of quantities of hits, and errors of those that the motion says, relative to the
    larger of both, with sentences."""
    model, claims = motion.model, motion.trajectory.totals
    names = model.peak_names[len(model.peaks_of) :]
    if not names:
        return np.zeros(0), {}
    if not motion.trajectory.collisions:
        return np.zeros(len(names)), {}
    hits = planned_hits(motion)
    there = model.hits_of_quantities(hits.surfaces)
    at_events = motion.models.along(np.arange(len(there)))
    peaks = model.hit_peaks(at_events.hit_quantities(*hits.states), there)
    usual = model.hit_peaks(at_events.hit_quantities(*hits.usual(motion)), there)
    errors = dict[float, str]()
    for name, value, size in zip(names, infinite_where_none(peaks).tolist(), usual, strict=True):
        claim = claims.get(name, value)
        size = max(abs(value), abs(claim), ALMOST_NOTHING * abs(float(np.nan_to_num(size))))
        error = abs(claim - value) / size if size else 0.0
        errors[largest(error)] = f"{name} is {value:.6g} at the hits, not {claim:.6g}"
    return peaks, errors


def hit_excesses(motion: Motion) -> Iterator[Excess]:
    """Bounds of quantities of hits that are exceeded."""
    model, limits = motion.model, motion.trajectory.limits
    names = [name for name in model.kernels.hit_quantities if name in limits]
    if not (names and motion.trajectory.collisions):
        return
    hits = planned_hits(motion)
    there = model.hits_of_quantities(hits.surfaces)
    values = motion.models.along(np.arange(len(there))).hit_quantities(*hits.states)
    for name in names:
        j, (low, high) = model.kernels.hit_quantities.index(name), limits[name]
        for i in np.flatnonzero(there[:, j]).tolist():
            value = float(values[i, j])
            bound = low if low - value > value - high else high
            share = largest(max(low - value, value - high) / (abs(value) + abs(bound) or 1.0))
            if share > 0:
                what, time = f"the bound of {name} ({value:.6g})", float(hits.states[-1][i])
                yield Excess(share, share, what, time)
