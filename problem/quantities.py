"""What a problem says of the quantities of its model: along the way, at both ends, at events."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from dmoc.base.arguments import interval
from dmoc.base.errors import ProblemError
from dmoc.base.tolerances import KEPT
from dmoc.codegen.kernels import Array
from dmoc.problem.design import by_design, moves_by_design

if TYPE_CHECKING:
    from dmoc.problem.problem import Problem


# Newton steps to a position that has the quantities of an end.
NEWTON = 20


@dataclass(frozen=True)
class QuantityRanges:
    """Ranges of the quantities at the start and at the goal, shape (nz, 2) each, and at the events,
    shape (events, nz, 2); equal ends fix a value, infinite ones leave it free."""

    start: Array
    goal: Array
    via: Array

    @property
    def kinds(self) -> tuple[bytes, ...]:
        """Which values are fixed, and which ranges have ends."""
        ranges = np.concatenate([self.start[None], self.goal[None], self.via])
        return np.isfinite(ranges).tobytes(), (ranges[..., 0] == ranges[..., 1]).tobytes()


def quantity_ranges(problem: Problem) -> QuantityRanges:
    """The ranges that a problem states; those that its fixed start decides are checked."""
    rows = problem.kernels.quantity_rows
    via = problem.via or (None,) * len(problem.sequence)
    events = [
        _ranges(problem, places or {}, f"via of event {i + 1}") for i, places in enumerate(via)
    ]
    for i, ranges in enumerate(events):
        for row, limits in zip(rows, ranges, strict=True):
            if np.isfinite(limits).any() and (row["velocities"] or row["inputs"]):
                raise ProblemError(
                    f"via of event {i + 1}: quantity {row['name']!r} contains velocities, inputs "
                    "or forces, which jump there: expected one of places."
                )
    start = _ranges(problem, problem.start, "start")
    if problem.start_bounds.is_state:
        start = _decided(problem, start)
    shape = len(problem.sequence), len(rows), 2
    return QuantityRanges(
        start, _ranges(problem, problem.goal, "goal"), np.array(events, dtype=float).reshape(shape)
    )


def _ranges(problem: Problem, values: Mapping[str, Any], what: str) -> Array:
    """Ranges of all quantities among the values by name, within their bounds."""
    names = problem.kernels.quantities
    ranges = [interval(values.get(name), f"{what} of {name}") for name in names]
    for name, (low, high), (below, above) in zip(
        names, ranges, problem.quantity_bounds, strict=True
    ):
        if high < below or low > above:
            raise ProblemError(
                f"the {what} of {name} ({low:g} to {high:g}) lies outside its bounds {below:g} to "
                f"{above:g}."
            )
    return np.array(ranges, dtype=float).reshape(len(names), 2)


def _decided(problem: Problem, ranges: Array) -> Array:
    """The ranges that a fixed start leaves to be kept: those of quantities that contain inputs;
    the others are known, and checked."""
    rows = problem.kernels.quantity_rows
    left = np.tile((-np.inf, np.inf), (len(rows), 1))
    if not rows:
        return left
    model, q = problem.model, problem.start_bounds.position[:, 0]
    v = problem.start_bounds.velocity[:, 0]
    if not np.isfinite(v).all():
        v = model.velocity(q, problem.start_bounds.momentum[:, 0])
    values = model.quantities(q, v, np.zeros(problem.nu), 0.0)
    chosen = by_design(problem, "quantity_point")
    if moves_by_design(problem, problem.start_bounds):
        chosen = chosen | [row["velocities"] for row in rows]
    for j, row in enumerate(rows):
        if row["inputs"] or chosen[j]:
            left[j] = ranges[j]
            continue
        for said, (low, high) in (
            ("is given as", ranges[j]), ("is bounded to", problem.quantity_bounds[j]),
        ):  # fmt: skip
            if problem.measured and said == "is bounded to":
                continue
            near = KEPT * max(abs(e) for e in (low, high, values[j], 1.0) if np.isfinite(e))
            if not low - near <= values[j] <= high + near:
                between = f"{low:g}" if low == high else f"{low:g} to {high:g}"
                raise ProblemError(
                    f"quantity {row['name']!r} is {values[j]:g} at the start, which the "
                    f"coordinates and velocities decide, and {said} {between}: change one of them."
                )
    return left


def onto_quantities(problem: Problem, end: str, q: Array) -> Array:
    """Positions near rows (n, nq) that have the quantities of places at the "start" or at the
    "goal", by Newton steps along coordinates that are not fixed, which cost by their inertias; the
    rows as they are where that leads to none."""
    rows = problem.kernels.quantity_rows
    own = getattr(problem.quantity_ranges, end)
    on = [
        j for j, row in enumerate(rows)
        if np.isfinite(own[j]).any() and not (row["velocities"] or row["inputs"])
    ]  # fmt: skip
    first, last = problem.final_time_bounds
    t = np.full(len(q), 0.0 if end == "start" else last if first == last else np.nan)
    none = np.zeros((len(q), problem.nu))
    # Those that depend on a time that is open say nothing of the place.
    with np.errstate(all="ignore"):
        values = problem.model.quantities(q, np.zeros_like(q), none, t)
        timed = np.asarray(np.isnan(values).all(axis=0))
    on = [j for j in on if not timed[j]]
    low, high = getattr(problem, f"{end}_bounds").position.T
    below, above = problem.coordinate_bounds.T
    low, high = np.maximum(low, below), np.minimum(high, above)
    if not on or (low == high).all():
        return q
    ease = np.where(low < high, 1 / np.abs(np.diagonal(problem.model.mass(q[0]))), 0.0)
    at = q.copy()
    with np.errstate(all="ignore"):
        for _ in range(NEWTON):
            state = at, np.zeros_like(at), none, t
            z = problem.model.quantities(*state)[:, on]
            off = z - np.clip(z, *own[on].T)
            J = problem.model.quantity_slopes(*state)[:, on, : problem.nq]
            J = np.where(np.isfinite(J), J, 0.0)  # where a quantity is not defined
            share = np.linalg.pinv(J @ (ease[:, None] * np.swapaxes(J, 1, 2)))
            step = -ease * np.einsum("nji,njk,nk->ni", J, share, off)
            at = np.clip(at + step, low, high)
    arrived = np.isfinite(at).all(axis=1) & (np.abs(off) <= KEPT * (1 + np.abs(z))).all(axis=1)
    return np.where(arrived[:, None], at, q)
