"""Where a motion lies on a surface, held there by its inputs: a simulation may enter it by a
little."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from dmoc.base.records import value_class
from dmoc.codegen.kernels import Array
from dmoc.motion.trajectory import Trajectory
from dmoc.simulation.sizes import Nodes, Sizes, gap_sizes

# Largest gap g > 0 that counts as none, relative to how far the motion's ranges move the gap.
PENETRATION = 0.002
# A node within the first share of the gap's size lies on the surface.  So many in a row slide along
# it, or so many within the second share, as chords of a curved surface do.  A motion that slides
# may enter the surface between its nodes as far as penetration may be, one that grazes it less far:
# it would bounce, with 1 % of its speed where a throw is that deep.
ON_ARC, LASTING = 1e-4, 3
ON_CHORD, CHORDS = 3e-4, 5
GRAZED = 1e-4


@value_class(frozen=True)
class Arc:
    """A time in which a motion lies on a surface, and how far a simulation may enter it."""

    surface: int
    begin: float
    end: float
    depth: float


def arcs_of(trajectory: Trajectory, nodes: Nodes, sizes: Sizes) -> list[Arc]:
    """Arcs of a motion on surfaces without a planned collision."""
    arcs, model = list[Arc](), nodes.model
    near, chords = (nodes.gaps >= -share * sizes.gap for share in (ON_ARC, ON_CHORD))
    arcs += _round_ends(trajectory, nodes, sizes)
    if not chords.any():
        return arcs
    hits = [
        (model.surface_numbers[c.surface], c.time)
        for c in trajectory.collisions
        if c.surface and not c.grazes
    ]
    for i, phase in enumerate(trajectory.phases):
        if not phase.steps:
            continue
        own, h = nodes.of_phase(i), phase.step_size
        # What happens after the end is nobody's business.
        ends = near[own] & (phase.t >= sizes.time - h / 2)[:, None]
        slides = _in_rows(near[own], LASTING) | _in_rows(chords[own], CHORDS) | ends
        on = near[own] | slides
        on[:, [model.surface_numbers[name] for name in phase.closed]] = False
        for k, j in zip(*np.nonzero(on), strict=True):
            t = float(phase.t[k])
            if not any(surface == j and abs(t - at) <= 2.5 * h for surface, at in hits):
                depth = PENETRATION if slides[k, j] else GRAZED
                size = gap_sizes(nodes.gap_slopes[own][k], sizes)[j]
                arcs.append(Arc(int(j), t - h, t + h, depth * float(size)))
    return arcs


def _in_rows(on: NDArray[np.bool_], least: int) -> NDArray[np.bool_]:
    """Nodes (n, nc) that are among so many in a row which are all on."""
    among, count = np.zeros_like(on), len(on) - least + 1
    whole = (
        np.logical_and.reduce([on[i : i + count] for i in range(least)]) if count > 0 else on[:0]
    )
    for i in range(least):
        among[i : i + len(whole)] |= whole
    return among


def _round_ends(trajectory: Trajectory, nodes: Nodes, sizes: Sizes) -> Iterator[Arc]:
    """Steps in which a free motion comes round the end of a surface that its nodes do not enter."""
    if not nodes.model.ends:
        return
    there, names = nodes.model.within(nodes.q, nodes.t) >= 0, nodes.model.kernels.surfaces
    touched = {(n, c.time) for c in trajectory.collisions for n in (c.surface, *c.lands, *c.leaves)}
    for i, phase in enumerate(trajectory.phases):
        own = nodes.of_phase(i)
        for k, j in zip(*np.nonzero(there[own][1:] != there[own][:-1]), strict=True):
            begin, end = map(float, phase.t[k : k + 2])
            if names[j] not in phase.closed and not touched & {(names[j], begin), (names[j], end)}:
                size = gap_sizes(nodes.gap_slopes[own][k], sizes)[j]
                yield Arc(int(j), begin, end, PENETRATION * float(size))


def allowance(
    arcs: Sequence[Arc], surfaces: int, ignored: Sequence[int]
) -> Callable[[Array], Array]:
    """How far simulations may enter surfaces, a function of times (n,) with values (n, surfaces):
    where the motion itself lies on one, without a force of its own, and without end where they are
    ignored."""
    bounds = np.array(sorted({time for arc in arcs for time in (arc.begin, arc.end)}), dtype=float)
    between = np.zeros((len(bounds) + 1, surfaces))  # before, between and after the bounds
    for arc in arcs:
        first, last = np.searchsorted(bounds, (arc.begin, arc.end))
        own = between[first + 1 : last + 1, arc.surface]
        np.maximum(own, arc.depth, out=own)
    between[:, list(ignored)] = np.inf

    def allowed(t: Array) -> Array:
        if not arcs:
            return between.repeat(len(t), axis=0)
        return np.maximum(
            between[bounds.searchsorted(t, "left")], between[bounds.searchsorted(t, "right")]
        )

    return allowed
