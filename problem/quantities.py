"""What a problem says of the quantities of its model, along the way, at both ends and at events,
and of its integrals at the goal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dmoc.base.arguments import Range, interval, shown
from dmoc.base.errors import ProblemError
from dmoc.base.records import value_class
from dmoc.base.tolerances import KEPT
from dmoc.codegen.kernels import Array
from dmoc.mechanics.phase_models import ENDS
from dmoc.mechanics.projection import onto
from dmoc.problem.design import by_design, moves_by_design
from dmoc.problem.ranges import fixed_velocity

if TYPE_CHECKING:
    from dmoc.problem.problem import Problem

# Newton steps to a position that has the quantities of an end.
NEWTON = 20
TURN = 2 * np.pi


@value_class(frozen=True)
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


def quantity_ranges_of(problem: Problem) -> QuantityRanges:
    """The ranges that a problem states; those that its fixed ends decide are checked."""
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
    start = _left(problem, "start", _ranges(problem, problem.ends["start"], "start"))
    goal = _left(problem, "goal", _ranges(problem, problem.ends["goal"], "goal"))
    shape = len(problem.sequence), len(rows), 2
    return QuantityRanges(start, goal, np.array(events, dtype=float).reshape(shape))


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


def _left(problem: Problem, end: str, ranges: Array) -> Array:
    """The ranges that are left to be kept where a fixed start or goal does not decide the
    quantities, shape (nz, 2); the others are known, and checked."""
    rows, boundary = problem.kernels.quantity_rows, getattr(problem, f"{end}_bounds")
    q, model = boundary.position[:, 0], problem.models[ENDS[end]]
    if not rows or (q != boundary.position[:, 1]).any():
        return ranges
    v = fixed_velocity(boundary, problem, q)
    at = q, np.zeros(problem.nq) if v is None else v, np.zeros(problem.nu), 0.0
    values, slopes = model.quantities(*at), np.abs(model.quantity_slopes(*at))
    sizes = slopes[:, : 2 * problem.nq] @ _largest(problem)
    moves = v is None or moves_by_design(problem, boundary)
    open_ = by_design(problem, "quantity_point") | [
        row["inputs"] or (row["velocities"] and moves) or (row["time"] and end == "goal")
        for row in rows
    ]
    for j, row in enumerate(rows):
        if open_[j]:
            continue
        for said, (low, high) in (
            ("is given as", ranges[j]), ("is bounded to", problem.quantity_bounds[j]),
        ):  # fmt: skip
            if problem.measured and said == "is bounded to":
                continue
            near = KEPT * max(abs(e) for e in (low, high, values[j], sizes[j]) if np.isfinite(e))
            if not low - near <= values[j] <= high + near:
                between = f"{low:g}" if low == high else f"{low:g} to {high:g}"
                raise ProblemError(
                    f"quantity {row['name']!r} is {values[j]:g} at the {end}, which the "
                    f"coordinates and velocities decide, and {said} {between}: change one of them."
                )
    return np.where(open_[:, None], ranges, (-np.inf, np.inf))


def _largest(problem: Problem) -> Array:
    """The largest coordinates and velocities of the start and the goal, shape (2 nq,)."""
    ends = problem.start_bounds, problem.goal_bounds
    states = np.abs([[end.position, end.velocity] for end in ends])
    return np.asarray(np.where(np.isfinite(states), states, 0.0).max(axis=(0, 3)).ravel())


def onto_quantities(problem: Problem, end: str, q: Array) -> Array:
    """Positions (n, nq) near rows (n, nq) that have the quantities of places at the "start" or at
    the "goal"; the rows as they are where that leads to none. They are found by Newton steps along
    coordinates that are not fixed, which cost by their inertias."""
    rows, model = problem.kernels.quantity_rows, problem.models[ENDS[end]]
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
        values = model.quantities(q, np.zeros_like(q), none, t)
        timed = np.asarray(np.isnan(values).all(axis=0))
    on = [j for j in on if not timed[j]]
    low, high = getattr(problem, f"{end}_bounds").position.T
    below, above = problem.coordinate_bounds.T
    low, high = np.maximum(low, below), np.minimum(high, above)
    if not on or (low == high).all():
        return q
    light = 1 / np.sqrt(np.abs(np.diagonal(model.mass(q[0]))))

    def missing(at: Array) -> tuple[Array, NDArray[np.bool_]]:
        """What positions miss, and which of them nothing that is more than rounding errors."""
        z = model.quantities(at, np.zeros_like(at), none, t)[:, on]
        off = z - np.clip(z, *own[on].T)
        return off, (np.abs(off) <= KEPT * (1 + np.abs(z))).all(axis=1)

    def conditions(at: Array) -> tuple[Array, Array]:
        J = model.quantity_slopes(at, np.zeros_like(at), none, t)[:, on, : problem.nq]
        return missing(at)[0], np.where(np.isfinite(J), J, 0.0)  # where a quantity is not defined

    with np.errstate(all="ignore"):
        box, sizes = np.stack([low, high], axis=1), np.where(low < high, light, 0.0)
        at = onto(conditions, q, sizes, NEWTON, np.inf, box)
        # Where the quantities hardly move, a step may be many turns of an angle.
        for i in np.flatnonzero((np.abs(at - q) > np.pi).any(axis=0)):
            nearer = at.copy()
            nearer[:, i] -= TURN * np.round((at - q)[:, i] / TURN)
            inside = (low[i] <= nearer[:, i]) & (nearer[:, i] <= high[i])
            at = np.where((inside & missing(nearer)[1])[:, None], nearer, at)
        arrived = np.isfinite(at).all(axis=1) & missing(at)[1]
    return np.where(arrived[:, None], at, q)


def total_bounds_of(problem: Problem) -> Array:
    """Bounds of the totals, shape (number, 2); one on the side from which nothing holds what stands
    in the place of kinks is refused."""
    senses = problem.kernels.manifest.senses
    bounds = []
    for name in problem.model.totals_of:
        stated = problem.goal.get(name)
        low, high = interval(stated, f"goal of {name}")
        sense = senses.get(name, 0)
        if (sense > 0 and low > -np.inf) or (sense < 0 and high < np.inf):
            wanted, least = (
                ("(None, upper)", "too large") if sense > 0 else ("(lower, None)", "too small")
            )
            raise ProblemError(
                f"goal of {name} = {shown(stated)}: expected {wanted}, because its integrand has "
                f"kinks, in whose place stand unknowns that may be {least}."
            )
        bounds.append((low, high))
    return np.array(bounds, dtype=float).reshape(-1, 2)


def total_limits_of(problem: Problem) -> dict[str, Range]:
    """Bounds of the integrals that have some, by name."""
    named = zip(problem.model.totals_of, problem.total_bounds.tolist(), strict=True)
    return {name: (low, high) for name, (low, high) in named if low > -np.inf or high < np.inf}


def pressing_integrals(problem: Problem) -> set[str]:
    """Names of the integrals that hold their hidden unknowns on the kinks: the cost, whose name is
    empty, and those that are bounded or priced."""
    priced = problem.kernels.manifest.priced
    return {"", *problem.total_limits, *priced}
