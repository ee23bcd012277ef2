"""Bounds that contacts would leave no interior: they give way."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.projection import near_surface
from dmoc.problem.design import by_design
from dmoc.problem.problem import Problem
from dmoc.program.blocks import Index
from dmoc.program.layout import Layout
from dmoc.program.scale import Scale
from dmoc.program.stacked import Stacked

# A bound that lies on a surface gives way by this share of the coordinate's size.
GIVES_WAY = 1e-3


def give_way(
    problem: Problem | Stacked, box: Array, scale: Scale, places: Iterable[tuple[Index, int]]
) -> None:
    """Move bounds of a coordinate that a surface holds where they are; ``places`` are coordinates,
    shape (n, nq), and their surfaces."""
    model = problem.model
    few = [(at, j) for at, j in places if len(model.surface_coordinates[j]) == 1]
    few = [(at, j) for at, j in few if j not in model.moving]
    if isinstance(problem, Problem):
        _give_way(problem, box, scale.q, few)
        return
    for one, own, q in zip(problem.each, box, scale.q, strict=True):
        _give_way(one, own, q, few)


def _give_way(
    problem: Problem, box: Array, size_q: Array, places: Sequence[tuple[Index, int]]
) -> None:
    chosen = by_design(problem, "surface") if places else ()
    for coordinates, surface in places:
        if chosen[surface]:
            continue
        j = int(problem.model.surface_coordinates[surface][0])
        unknowns = coordinates[:, j]
        unknowns = unknowns[box[unknowns, 0] < box[unknowns, 1]]
        for side, sign in enumerate((-1.0, 1.0)):
            for limit in sorted(set(box[unknowns, side].tolist())):
                q = np.zeros(problem.nq)
                q[j] = limit
                if np.isfinite(limit) and near_surface(problem.model, q, surface, 0.0):
                    way = sign * GIVES_WAY * max(abs(limit), size_q[j])
                    box[unknowns[box[unknowns, side] == limit], side] = limit + way


def bound_once(problem: Problem, lay: Layout, box: Array) -> None:
    """Bound the coordinates along which contacts stick once a phase, in ``box``, shape (n, 2): one
    node has the bounds of all. Where the coordinate is fixed at a node, no other one has any."""
    if problem.explicit_time:
        return
    on = problem.model.tangent_coordinates
    for i, mode in enumerate(lay.touch.modes):
        places = lay.index_places[lay.places_of_phase(i)]
        for tangent in mode.sticking:
            if len(on[tangent]) != 1 or not lay.touch.contacts.in_place[tangent]:
                continue
            j = int(on[tangent][0])
            unknowns = places[:, j]
            fixed = box[unknowns, 0] == box[unknowns, 1]
            usual = (box[unknowns] == problem.coordinate_bounds[j]).all(axis=1) & ~fixed
            usual[0] &= fixed.any()
            box[unknowns[usual]] = (-np.inf, np.inf)
