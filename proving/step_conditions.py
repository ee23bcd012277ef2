"""What is asked of the steps of a phase beside places: bounds of velocities; and of contacts that
last, which only push, that what sticks takes no more than its friction, and that what slides does
so in its direction.

The pushes of a mode take impulses imp = -F (r_plus + r_minus) where steps meet, -F r_i inside
them, with the inverse F of their directions. At the ends of a phase, and of each step of degree 2
and more, momenta are those of velocities that keep the mode.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from dmoc.base.discretisation import DISCRETISATIONS
from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.mechanics.contacts import RAIL
from dmoc.proving.linear import IN_EACH, IN_SUM
from dmoc.proving.linear_model import Frame, LinearModel
from dmoc.proving.shared_forces import forces_of, told_of

# Coefficients below this share of the largest of their row are rounding errors.
NOTHING = 1e-12


@record(frozen=True, eq=False)
class Momenta:
    """Rows of a step, times its size, shape (3, nq, 2 r + na + nb + ns + 1): what the pushes at its
    start and at its end have to make up for, and at each node inside."""

    first: Array
    last: Array
    inside: tuple[Array, ...]


class StepConditions:
    """What is asked of a phase: rows ``S`` of a step and ``conditions`` that they make, as
    :class:`~dmoc.proving.linear.LinearPhase` has them."""

    def __init__(self, model: LinearModel, i: int, frame: Frame, P: Array) -> None:
        """``P`` are the rows of the steps of phase i in the model's momenta, shape (3, d + 1, nq, r
        + na + nb + ns + 1)."""
        self.model, self.frame, p = model, frame, model.problem
        self.mode, self.steps, self.scheme = p.touch.modes[i], p.phase_steps[i], p.scheme
        self.leaving = {j for one in model.liftoffs if one.event == i for j in one.surfaces}
        self.width = frame.size + P.shape[3]
        self._rows, self._conditions = list[Array](), list[tuple[int, ...]]()
        if not self.steps:
            return
        self._add_speeds(p.velocity_bounds)
        self._add_ways(p.velocity_bounds)
        if not self.mode.free:
            self._add_directions()
            self._add_forces(_momenta(model, frame, P, self._wide))

    @property
    def S(self) -> Array:
        return np.array(self._rows).reshape(-1, 3, self.width)

    @property
    def conditions(self) -> Array:
        return np.array(self._conditions, dtype=float).reshape(-1, 5)

    def _wide(self, rows: Array) -> Array:
        """Rows of (q_k, a, u, s, 1) as those of (q_k, h p_k, a, u, s, 1)."""
        return np.insert(rows, [self.frame.size] * self.frame.size, 0.0, axis=-1)

    def _add(
        self, first: int, last: int, row: Array, of_next: Array | None = None, kind: int = IN_EACH
    ) -> None:
        """Add a condition that holds from one step to another one."""
        numbers = list[int]()
        for one in (row,) if of_next is None else (row, of_next):
            one, size = one.copy(), np.abs(one[:, :-1])
            one[:, :-1][size <= NOTHING * size.max(initial=0.0)] = 0.0
            numbers.append(len(self._rows))
            self._rows.append(one)
        if first <= last and np.abs(self._rows[numbers[0]]).max() > 0:
            then = numbers[1] if numbers[1:] else -1
            self._conditions.append((numbers[0], then, first, last, kind))

    def _add_directions(self) -> None:
        """The way of what slides in each step, and its speed between steps that have nodes
        inside."""
        Z, r = self.frame.Z, self.frame.size
        end = 2 * r + (self.scheme.degree - 1) * r
        for k, s in self.mode.sliding:
            tangent, own = s * self.model.tangent(k), s * self.model.movers.of_tangent(k)
            way, moved = np.zeros((3, self.width)), own[0] + tangent @ self.frame.moved
            way[0, :r], way[0, end : end + r] = tangent @ Z, -tangent @ Z
            way[0, self._driven] = np.kron([1, *[0] * self.scheme.inside, -1], self._drive(moved))
            self._add(0, self.steps - 1, way)
            self._add_between(-tangent, 0.0, -own[1])

    @property
    def _driven(self) -> slice:
        """Columns of the shifts at the nodes of a step."""
        return slice(-1 - (self.scheme.degree + 1) * len(self.frame.drives), -1)

    def _drive(self, moved: Array) -> Array:
        """Functions of the shifts, shape (..., shifts), as those of what drives the phase."""
        return moved[..., self.frame.drives]

    def _add_between(self, along: Array, most: float, moved: Array | float = 0.0) -> None:
        """What a velocity and what shifts add to it are at most, by the momentum between steps that
        have nodes inside."""
        if self.scheme.inside:
            r, row = self.frame.size, np.zeros((3, self.width))
            speed = self.model.velocity(self.frame)
            row[0, r : 2 * r] = along @ speed.A[:, r:]
            row[1, :r], row[1, -1] = along @ speed.A[:, :r], along @ speed.b - most
            at_start = np.eye(self.scheme.degree + 1)[0]
            row[1, self._driven] = np.kron(at_start, self._drive(moved + along @ speed.shifted))
            self._add(1, self.steps - 1, row)

    def _add_speeds(self, bounds: Array) -> None:
        """Bounds of the velocities of steps, shape (nq, 2), where the program has them."""
        r, scheme = self.frame.size, self.scheme
        order = [0, *range(2, scheme.degree + 1), 1]
        for j, sign, most in sides(bounds):
            if not self._moves(j):
                continue  # it stays where it is
            for first, last, place in self._places():
                row = np.zeros((3, self.width))
                by_node = sign * scheme.slopes(np.array([place]))[0, order]
                slopes = np.kron(by_node, self.frame.Z[j])
                row[0, :r], row[0, 2 * r : r + len(slopes)] = slopes[:r], slopes[r:]
                row[0, self._driven] = np.kron(by_node, self._drive(self.frame.moved[j]))
                row[1, -1] = -most
                self._add(first, last, row)
            if not self.mode.free:
                self._add_between(sign * np.eye(len(bounds))[j], most)

    def _moves(self, j: int) -> bool:
        """Whether a coordinate may change."""
        both = np.append(self.frame.Z[j], self.frame.moved[j])
        return bool(np.abs(both).max(initial=0.0) > NOTHING)

    def _add_ways(self, bounds: Array) -> None:
        """How far a phase goes at most at these velocities. That follows from those of its steps,
        of which a bound would have to price all at once."""
        r, Z = self.frame.size, self.frame.Z
        end = 2 * r + (self.scheme.degree - 1) * r
        for j, sign, most in sides(bounds):
            if self.steps > 1 and self._moves(j) and self._follow:
                row, own = np.zeros((3, self.width)), self._drive(sign * self.frame.moved[j])
                row[0, :r], row[0, end : end + r] = -sign * Z[j], sign * Z[j]
                row[0, self._driven] = np.kron([-1, *[0] * self.scheme.inside, 1], own)
                row[1, -1] = -most
                self._add(0, self.steps - 1, row, kind=IN_SUM)

    @property
    def _follow(self) -> bool:
        """Whether the mean velocity of each step is a mean of those that are bounded, with weights
        that are not negative: steps have polynomials of as many coefficients."""
        if not self.scheme.inside:
            return True
        places = np.tile(np.sort(DISCRETISATIONS[self.scheme.order - 2].nodes), (3, 1))
        places[0, 0], places[2, -1] = places[0, :2].mean(), places[2, -2:].mean()
        powers = np.arange(places.shape[1])
        means = [np.linalg.solve(own[None] ** powers[:, None], 1 / (1 + powers)) for own in places]
        return bool(np.min(means) > -NOTHING)

    def _places(self) -> Iterator[tuple[int, int, float]]:
        """Places in a step where the program bounds velocities: the first step that has it, the
        last one, and the place."""
        last = self.steps - 1
        if not self.scheme.inside:
            yield 0, last, 0.5
            return
        places = np.sort(DISCRETISATIONS[self.scheme.order - 2].nodes).tolist()
        yield 0, 0, sum(places[:2]) / 2
        yield 1, last, places[0]
        for place in places[1:-1]:
            yield 0, last, place
        yield 0, last - 1, places[-1]
        yield last, last, sum(places[-2:]) / 2

    def _add_forces(self, momenta: Momenta) -> None:
        """The forces of all pushes, or sums of those that contacts share, each where steps meet, or
        at the ends of each step of its own."""
        last = self.steps - 1
        pushes = self.frame.pushes
        inverse = forces_of(pushes)
        first_share, *shares, _ = self.scheme.weights
        for cone, limit in told_of(pushes, self._cones()):

            def row(rows: Array, share: float, cone: Array = cone, limit: float = limit) -> Array:
                own = -(cone @ inverse) @ rows
                own[2, -1] -= limit * share
                return own

            begins, ends = row(momenta.first, first_share), row(momenta.last, first_share)
            closed = self.mode.closed
            leaves = any(cone[a] != 0 and j in self.leaving for a, j in enumerate(closed))
            if self.scheme.inside:
                self._add(0, last, begins)
                self._add(0, last - leaves, ends)
                for inside, share in zip(momenta.inside, shares, strict=True):
                    self._add(0, last, row(inside, share))
            else:
                self._add(0, 0, begins)
                self._add(0, last - 1, ends, begins)
                self._add(last, last - leaves, ends)

    def _cones(self) -> Iterator[tuple[Array, float]]:
        """Rows of the pushes, and largest forces, that they do not exceed."""
        closed, sticking, p = self.mode.closed, self.mode.sticking, self.model.problem
        for row in self.model.cones(closed, sticking):
            yield row, 0.0
        for along, k in zip(np.eye(len(self.frame.pushes))[len(closed) :], sticking, strict=True):
            limit = float(p.static_friction[0, k])
            if p.touch.contacts.supports[k] == RAIL and np.isfinite(limit):
                yield along, limit
                yield -along, limit


def sides(bounds: Array) -> Iterator[tuple[int, float, float]]:
    """The bounds that there are, shape (n, 2), as limits of sign * value from above."""
    for j, (low, high) in enumerate(bounds.tolist()):
        if np.isfinite(high):
            yield j, 1.0, high
        if np.isfinite(low):
            yield j, -1.0, -low


def _momenta(model: LinearModel, frame: Frame, P: Array, wide: Callable[[Array], Array]) -> Momenta:
    """What is missing to the momenta of the states at both ends of a step, and inside it."""
    n, r = model.problem.nq, frame.size
    speed = model.velocity(frame)
    G, p_0, V = model.momentum.A[:, :n], model.momentum.b, speed.A
    by_place, by_momentum = model.M @ V[:, :r] + G @ frame.Z, model.M @ V[:, r:]
    rest = model.M @ speed.b + G @ frame.origin + p_0
    by_shift = (model.M @ speed.shifted + G @ frame.moved)[:, frame.drives]
    *inside, first, last = np.moveaxis(wide(P), 1, 0)
    first, last = first.copy(), last.copy()
    # h p of the state before a step and of the one after it, whose h p_y is left h r_plus
    last -= by_momentum[:, : frame.moving] @ frame.left @ last
    first[1, :, :r] += by_place
    first[0, :, r : 2 * r] += by_momentum
    end = P.shape[1] * r
    last[1, :, end : end + r] -= by_place
    first[1, :, -1] += rest
    last[1, :, -1] -= rest
    given, nodes = len(frame.drives), P.shape[1]
    first[1, :, -1 - given * nodes : -1 - given * (nodes - 1)] += by_shift
    last[1, :, -1 - given : -1] -= by_shift
    return Momenta(first, last, tuple(inside))
