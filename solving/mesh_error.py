"""The error of a solution on a mesh, estimated from the meshes before it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dmoc.nlp.active import ALONG_THE_WAY
from dmoc.solution import Mesh, Solution

# The error of a mesh falls by this factor at least when the steps are halved, also where inputs
# switch between steps.
SLOWEST_ORDER = 1.0
# The order that counts on where limits hold inputs or the motion.
LIMITED_ORDER = 2
# A cost below this share of its size, as that of a motion that needs no input, is next to none:
# errors are compared with the share.
LITTLE = 1e-3


def estimate(solved: Sequence[Solution], meshes: Sequence[Mesh], order: int) -> float:
    """Estimated error of the last solution; infinite for the first.  Two meshes show no order: half
    of the discretisation's is assumed."""
    if len(solved) < 2:
        return np.inf
    ratio = _ratio(solved[-2], solved[-1])
    last = change(solved[-2], solved[-1])
    limited = _limited(solved[-1])
    order = min(order, LIMITED_ORDER) if limited else order
    shown = order / 2
    if len(solved) > 2:
        before = change(solved[-3], solved[-2])
        shown = _order(before / max(last, 1e-300), _ratio(solved[-3], solved[-2]), ratio, order)
    fastest = (
        meshes[-1].estimate / ratio**order if limited and np.isfinite(meshes[-1].estimate) else 0.0
    )
    return float(max(last / (ratio**shown - 1), fastest, barrier(solved[-1])))


def barrier(s: Solution) -> float:
    """What the solver's barrier has left of the cost, relative to it."""
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
    return [b.steps // a.steps for a, b in zip(coarse.phases, fine.phases, strict=True)]


def _ratio(coarse: Solution, fine: Solution) -> float:
    """That of the phases that are refined."""
    return max(_ratios(coarse, fine))


def change(coarse: Solution, fine: Solution) -> float:
    """Largest relative difference of cost and durations, and of positions at common nodes."""
    cost = abs(fine.cost - coarse.cost) / max(abs(fine.cost), _little(fine))
    pairs = list(zip(coarse.phases, fine.phases, strict=True))
    duration = max(abs(b.duration - a.duration) for a, b in pairs) / fine.final_time
    spread = np.ptp(np.vstack([p.q for p in fine.phases]), axis=0)
    scale = np.maximum(
        spread, 1e-6 * np.array([fine.scale.get(name, 1.0) for name in fine.trajectory.coordinates])
    )
    place = max(
        float((np.abs(b.q[::step] - a.q) / scale).max(initial=0.0))
        for (a, b), step in zip(pairs, _ratios(coarse, fine), strict=True)
    )
    return float(max(cost, duration, place))


def compared(meshes: Sequence[Mesh], solved: Sequence[Solution]) -> tuple[Mesh, ...]:
    """The meshes, each with its difference to the finest, which tells whether the estimates are
    honest."""
    pairs = zip(meshes, solved, strict=True)
    return tuple(
        replace(m, difference=change(s, solved[-1]) if s is not solved[-1] else None)
        for m, s in pairs
    )
