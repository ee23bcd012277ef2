"""The error of a solution on a mesh, estimated from the meshes before it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from dmoc.base.records import record
from dmoc.base.tolerances import TINY
from dmoc.program.bound_kinds import ALONG_THE_WAY
from dmoc.results.solution import Mesh, Solution

# The error of a mesh falls by this factor at least when the steps are halved, also where inputs
# switch between steps.
SLOWEST_ORDER = 1.0
# The order that counts on where limits hold inputs or the motion.
LIMITED_ORDER = 2
# A cost below this share of its size, as that of a motion that needs no input, is next to none:
# errors are compared with the share.
LITTLE = 1e-3


@record(frozen=True, eq=False)
class Errors:
    """Relative errors, or changes, of the cost, and of what moves: durations, positions, design."""

    cost: float
    motion: float

    @property
    def largest(self) -> float:
        return max(self.cost, self.motion)


UNKNOWN = Errors(np.inf, np.inf)


def estimates(solved: Sequence[Solution], before: Errors, order: int) -> Errors:
    """Estimated errors of the last solution, from those ``before`` of the mesh before; infinite for
    the first mesh."""
    if len(solved) < 2:
        return UNKNOWN
    pairs = list(pairwise(solved[-3:]))
    *earlier, last = (changes(a, b) for a, b in pairs)
    ratios = [_ratio(a, b) for a, b in pairs]
    limited = _limited(solved[-1])
    order = min(order, LIMITED_ORDER) if limited else order

    def of(name: str) -> float:
        previous = getattr(earlier[0], name) if earlier else None
        fastest = getattr(before, name) / ratios[-1] ** order if limited else np.inf
        left = _left(getattr(last, name), previous, ratios, order)
        return max(left, fastest) if np.isfinite(fastest) else left

    return Errors(max(of("cost"), barrier(solved[-1])), of("motion"))


def _left(last: float, before: float | None, ratios: Sequence[int], order: int) -> float:
    """The error that a last change, after another one, leaves.  Two meshes show no order: half of
    the discretisation's is assumed."""
    exponent = order / 2
    if before is not None:
        exponent = _order(before / max(last, TINY), ratios[0], ratios[-1], order)
    return float(last / (ratios[-1] ** exponent - 1))


def barrier(s: Solution) -> float:
    """Cost that the solver's barrier has left, relative to the cost."""
    return s.duality_gap / max(abs(s.cost), _little(s))


def _little(s: Solution) -> float:
    """A cost that is next to none."""
    return LITTLE * s.scale.get("cost", 1.0)


def _limited(s: Solution) -> bool:
    """Whether limits hold inputs or the motion along the way, and not only the times."""
    return any(b.kind in ALONG_THE_WAY for b in s.active_bounds)


def _order(quotient: float, first: float, second: float, order: int) -> float:
    """The order p that two successive changes with a quotient show, (first^p - 1) second^p /
    (second^p - 1), by bisection."""
    low, high = SLOWEST_ORDER, float(order)

    def predicted(p: float) -> float:
        return float((first**p - 1) * second**p / (second**p - 1))

    if quotient >= predicted(high):
        return high
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (middle, high) if predicted(middle) < quotient else (low, middle)
    return low


def _ratios(coarse: Solution, fine: Solution) -> list[int]:
    """Steps of each phase on the fine mesh for one on the coarse one."""
    pairs = zip(coarse.phases, fine.phases, strict=True)
    return [b.steps // a.steps if a.steps else 1 for a, b in pairs]


def _ratio(coarse: Solution, fine: Solution) -> int:
    """The largest ratio of steps among the phases that are refined."""
    return max(_ratios(coarse, fine))


def changes(coarse: Solution, fine: Solution) -> Errors:
    """Relative difference of the cost, and the largest one of durations, of positions at common
    nodes, and of the design in its sizes."""
    cost = abs(fine.cost - coarse.cost) / max(abs(fine.cost), _little(fine))
    pairs = list(zip(coarse.phases, fine.phases, strict=True))
    duration = max(abs(b.duration - a.duration) for a, b in pairs) / fine.final_time
    spread = np.ptp(np.vstack([p.q for p in fine.phases]), axis=0)
    size = np.maximum(
        spread, 1e-6 * np.array([fine.scale.get(name, 1.0) for name in fine.trajectory.coordinates])
    )
    place = max(
        float((np.abs(b.q[::step] - a.q) / size).max(initial=0.0))
        for (a, b), step in zip(pairs, _ratios(coarse, fine), strict=True)
    )
    design = [
        abs(x - coarse.design[name]) / fine.scale.get(name, 1.0) for name, x in fine.design.items()
    ]
    return Errors(float(cost), float(max(duration, place, *design)))


def compared(
    meshes: Sequence[Mesh], solved: Sequence[Solution], determined: bool
) -> tuple[Mesh, ...]:
    """The meshes, each with its difference to the finest, which tells whether the estimates are
    honest: of the cost alone where the motion is not determined."""
    differences = [changes(s, solved[-1]) for s in solved[:-1]]
    values = [d.largest if determined else d.cost for d in differences]
    return tuple(replace(m, difference=d) for m, d in zip(meshes, [*values, None], strict=True))
