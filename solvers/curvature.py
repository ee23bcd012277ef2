"""Second-order conditions at a stationary point: whether it is a minimum.

H is the Hessian of L at the multipliers, A the slopes of the equations and of the inequalities and
bounds that hold x.  The point is a strict minimum if d'Hd > 0 for all d != 0 with A d = 0, and none
if d'Hd < 0 for one (J. Nocedal, S. J. Wright: Numerical Optimization, 2006, theorems 12.5, 12.6).
The signs of the pivots of::

    K = [ H - s W   A'       ]        W: weights of the unknowns
        [ A        -RELAXED  ]        s: a curvature

tell it: as many are positive as there are unknowns if and only if H - s W + A'A/RELAXED is positive
definite.  The small diagonal keeps equations harmless that follow from others.  Solving with such a
K again and again leads to the direction of the least curvature.
"""

from __future__ import annotations

import enum
from dataclasses import field
from functools import cached_property
from math import isfinite

import numpy as np

from dmoc.base.records import record
from dmoc.base.tolerances import KEPT
from dmoc.codegen.kernels import Array
from dmoc.program.blocks import Bools, Index
from dmoc.program.transcription import Transcription
from dmoc.solvers.compiled import Factorisation, entries_of, holding, largest_bend, signs
from dmoc.solvers.kkt import cost_size, violation
from dmoc.solvers.kkt_layout import KKTLayout, kkt_layout
from dmoc.solvers.outcome import Duals

# Curvatures in their size, of a direction along which all unknowns change by their sizes: below the
# first one the cost falls; where none is larger than the second one it does not change.  What lies
# between is so little that nobody asks.
FALLS, LEVEL = -1e-6, 1e-9
# Their size is the cost; where that is small, this share of the largest curvature of one unknown.
BENT = 1e-3
# Diagonals of K: equations, inequalities that hold x and those that do not, unknowns at a bound.
RELAXED, ACTIVE_ROW, IDLE, FIXED = 1e-11, 1e-8, 1e14, 1e12
# A multiplier or a distance, relative to the cost and to the sizes, that is so many times the other
# one, and above this, tells whether a bound holds x.
CLEARLY, NOISE = 10.0, 1e-6
CURVED = 1e-10  # of all unknowns, relative to the cost, where the curvature of some is wanted
# Curvatures that are added until K has the signs: from the least one, by a factor, so many; and
# bisections between the last two.
RAISED, MOST_RAISES, BISECTIONS = 100.0, 12, 4
# What compiled code takes of these numbers to see a bowl (rows.pxi).
STRICT = {
    "clearly": CLEARLY, "noise": NOISE, "level": LEVEL, "bent": BENT, "fixed": FIXED,
    "relaxed": RELAXED, "held": ACTIVE_ROW, "idle": IDLE,
}  # fmt: skip
# Iterations towards a direction, and the change of its curvature that ends them.
ITERATIONS, STEADY = 40, 0.02
# Rates of what holds along a direction of size 1 that are rounding errors.
TANGENT = 1e-4
# Distances, in sizes of the unknowns, at which motions along a direction are looked at, the steps
# of Newton's method that bring them onto the constraints, and the share of the expected fall of the
# cost that confirms it; no fall below the last one, in that size, counts.
DISTANCES, CORRECTIONS, CONFIRMED = (0.3, 0.1, 0.03, 0.01, 3e-3), 6, 0.3
LEAST_FALL = 1e-9


class Landscape(enum.Enum):
    """The cost of the motions around a stationary one."""

    BOWL = "strict minimum"
    VALLEY = "does not change along a direction"
    SADDLE = "falls along a direction"


@record(frozen=True, eq=False)
class Curvature:
    """The shape of the cost around a motion.

    Where it is no bowl, ``least`` is the least curvature, in its size, and ``direction`` belongs to
    it, shape (n,): in scaled unknowns, the largest of which changes by its size.
    """

    shape: Landscape
    least: float = np.inf
    direction: Array = field(default_factory=lambda: np.zeros(0))

    @classmethod
    def inflection(cls, direction: Array) -> Curvature:
        """A saddle without curvature along a direction, shape (n,), in which the cost falls in
        third order."""
        return cls(Landscape.SADDLE, 0.0, direction)


class SecondOrder:
    """The second-order conditions at a stationary point with its multipliers, of a program without
    minimal times."""

    def __init__(self, nlp: Transcription, x: Array, duals: Duals) -> None:
        self.nlp, self.x, self.duals = nlp, x, duals
        self.free = nlp.lower < nlp.upper
        self.active, self.perhaps = self._holding()
        self.weights, self._kept = of_program(nlp)

    def curvature(self) -> Curvature:
        """The shape of the cost.

        Bounds that may hold x or not are left out first: a bowl without them is one.  Directions
        that keep them are free to go; one that leaves them has to lead into the feasible set.
        """
        if self._bowl(-LEVEL, self.active):
            return Curvature(Landscape.BOWL)
        without = self._least(self.active)
        if without.shape is Landscape.BOWL or not self.perhaps.any():
            return without
        kept = self._least(self.active | self.perhaps)
        sided = kept.shape is not Landscape.SADDLE and self._inwards(without.direction)
        return without if sided else kept

    def of_unknowns(self, at: Index) -> Array:
        """Second derivatives of the least cost with respect to some unknowns, shape (k,), each
        alone, while all others follow; shape (k,). They are 1/(K^-1)_ii with the K of a Newton
        step, in which the bounds and inequalities count that hold x, and infinite for unknowns that
        are fixed or active."""
        nlp, x, size = self.nlp, self.x, cost_size(self.nlp, self.x)
        distance = np.concatenate([np.minimum(x - nlp.lower, nlp.upper - x), nlp.inequality(x)])
        active = np.concatenate([np.abs(self.duals.z), self.duals.w]) / size > distance
        active = np.insert(active, nlp.n, np.ones(nlp.n_eq, dtype=bool))
        self._signs(CURVED * size, active)
        second = np.full(len(at), np.inf)
        for k in np.flatnonzero(self.free[at] & ~active[at]):
            right = np.zeros(len(active))
            right[at[k]] = 1.0
            second[k] = 1 / self._solved(right)[at[k]]
        return second

    def cheaper(self, along: Curvature) -> list[Array]:
        """Motions on both sides of a saddle, shape (n,) each, that keep the constraints and cost
        less, none where the direction turns out to lead to no such motion."""
        if along.shape is not Landscape.SADDLE:
            return []
        self._signs(1.0, self.active, bent=False)
        motions = (self._cheaper(side * along.direction, along.least) for side in (1.0, -1.0))
        return [z for z in motions if z is not None]

    def _cheaper(self, d: Array, least: float) -> Array | None:
        nlp, x = self.nlp, self.x
        slope = abs(float(nlp.lagrangian_gradient(x, self.duals.y, self.duals.w) @ d))
        bend = -least * self._size * float(d @ (self.weights * d)) / 2
        for t in DISTANCES:
            z = self._onto_constraints(x + t * d)
            fall = nlp.cost(x) - nlp.cost(z) - np.abs(self.duals.y) @ np.abs(nlp.equality(z))
            expected = slope * t + CONFIRMED * bend * t**2
            if violation(nlp, z) <= KEPT and fall >= max(expected, LEAST_FALL * self._size):
                return z
        return None

    def _onto_constraints(self, z: Array) -> Array:
        """The motion with what holds x restored, by Newton's method with the slopes at x."""
        nlp, rows = self.nlp, self.active[self.nlp.n :]
        for _ in range(CORRECTIONS):
            z = np.clip(z, nlp.lower, nlp.upper)
            missed = np.where(rows, nlp.values(z)[1:], 0.0)
            z = z - self._solved(np.concatenate([np.zeros(nlp.n), missed]))[: nlp.n]
        return np.clip(z, nlp.lower, nlp.upper)

    def _holding(self) -> tuple[Bools, Bools]:
        """Masks of the unknowns at bounds and of the rows (c | d) that hold x, and of those that
        may, shape (n + n_eq + n_in,) each."""
        nlp, x, z, w = self.nlp, self.x, self.duals.z, self.duals.w
        return holding(
            x, nlp.lower, nlp.upper, z, nlp.inequality(x), w, nlp.n_eq, cost_size(nlp, x),
            clearly=CLEARLY, noise=NOISE,
        )  # fmt: skip

    @cached_property
    def _layout(self) -> KKTLayout:
        return kkt_layout(self.nlp)

    @cached_property
    def _factorisation(self) -> Factorisation:
        return Factorisation(like=self._layout.factorisation)

    @cached_property
    def _parts(self) -> tuple[Array, Array]:
        """Entries of K that are those of H, and of A."""
        nlp, layout = self.nlp, self._layout
        hess = nlp.program.curvatures(np.ascontiguousarray(self.x), self.duals.rows, 1.0)
        return entries_of(layout, hess, nlp.slopes(self.x)[nlp.n :])

    @cached_property
    def _size(self) -> float:
        """The size of curvatures."""
        nlp, H = self.nlp, self._parts[0]
        most = BENT * largest_bend(self._layout, H, self.weights, nlp.lower, nlp.upper)
        return max(cost_size(nlp, self.x), most if isfinite(most) else 0.0)

    def _bowl(self, shift: float, active: Bools) -> bool:
        """Whether a curvature, in its size, makes a bowl; K with it is factorised."""
        return self._signs(shift * self._size, active)

    def _signs(self, shift: float, active: Bools, bent: bool = True) -> bool:
        """Factorise K with a shift, with H or without, and compare its signs with a bowl's."""
        H, A = self._parts
        positive, zero = signs(
            self._layout, self._factorisation, H if bent else np.zeros_like(H), A, active,
            shift * self.weights + self._size * self._kept, self.nlp.n_eq,
            fixed=FIXED, relaxed=RELAXED, held=ACTIVE_ROW, idle=IDLE,
        )  # fmt: skip
        return positive == int(self.free.sum()) and not zero

    def _solved(self, right: Array) -> Array:
        """Solve with the last K for a right-hand side of shape (n + n_eq + n_in,), zero at fixed
        unknowns, which are no part of K."""
        place = self._layout.place
        inside = place >= 0
        ordered = np.zeros(self._layout.size)
        ordered[place[inside]] = right[inside]
        return np.where(inside, self._factorisation.solve(ordered)[place], 0.0)

    def _bowl_from(self, active: Bools) -> float | None:
        """About the least curvature whose addition makes a bowl; K with it is factorised."""
        shift = LEVEL
        while not self._bowl(shift, active):
            shift *= RAISED
            if shift > LEVEL * RAISED**MOST_RAISES:
                return None
        low = shift / RAISED
        for _ in range(BISECTIONS if shift > LEVEL else 0):
            middle = np.sqrt(low * shift)
            low, shift = (low, middle) if self._bowl(middle, active) else (middle, shift)
        self._bowl(shift, active)
        return float(shift)

    def _least(self, active: Bools) -> Curvature:
        """The least curvature and its direction, by inverse iteration."""
        shift = self._bowl_from(active)
        if shift is None:  # no numbers to go by
            return Curvature(Landscape.BOWL)
        n, least = self.nlp.n, np.inf
        d = np.where(self.free & ~active[:n], np.random.default_rng(0).normal(size=n), 0.0)
        for _ in range(ITERATIONS):
            pull = self.weights * d
            d = self._solved(np.concatenate([pull, np.zeros(len(active) - n)]))[:n]
            length = float(d @ (self.weights * d))
            if not length > 0:  # nothing is free to go
                return Curvature(Landscape.BOWL)
            before, least = least, float(d @ pull) / length / self._size - shift
            d = np.where(active[:n], 0.0, d / np.sqrt(length))
            if abs(least - before) <= STEADY * abs(least):
                break
        shape = Landscape.SADDLE if least < FALLS else Landscape.VALLEY
        if FALLS <= least < -LEVEL or least > LEVEL or not self._tangent(d, active):
            return Curvature(Landscape.BOWL)
        return Curvature(shape, least, d / np.abs(d).max())

    def _tangent(self, d: Array, active: Bools) -> bool:
        """Whether a direction keeps what holds, which says that the numbers of K are good."""
        nlp = self.nlp
        rates = np.concatenate(
            [nlp.equality_jacobian(self.x) @ d, nlp.inequality_jacobian(self.x) @ d]
        )
        return bool(np.abs(rates[active[nlp.n :]]).max(initial=0.0) <= TANGENT * np.abs(d).max())

    def _inwards(self, d: Array) -> bool:
        """Whether a direction or its opposite keeps the bounds that may hold x."""
        nlp, x = self.nlp, self.x
        unknowns, rows = np.split(self.perhaps, [nlp.n])
        lower = x - nlp.lower <= nlp.upper - x
        rates = np.concatenate(
            [
                np.where(lower, d, -d)[unknowns],
                (nlp.inequality_jacobian(x) @ d)[rows[nlp.n_eq :]],
            ]
        )
        return bool((rates >= -NOISE).all() or (rates <= NOISE).all())


def _weights(nlp: Transcription) -> Array:
    """Weights of the unknowns in the length of a direction: those that every node or step has count
    as one together."""
    weights = np.ones(nlp.n)
    for block in nlp.layout.unknowns:
        if block.count and len(block.index) >= nlp.layout.total:
            weights[block.numbers] = 1 / len(block.index)
    return weights


def of_program(nlp: Transcription) -> tuple[Array, Array]:
    """Weights of the unknowns of a program in the length of a direction, and curvatures of those
    that the motion does not determine, since others have the same effect, shape (n,) each. A
    direction that changes these alone tells nothing of the motion, and every other one has its like
    that leaves them."""

    # in a tuple, because an array has no truth value
    (weights,) = nlp.structure.once("weights", lambda: (_weights(nlp),))
    kept = np.zeros(nlp.n)
    for law in nlp.laws:
        for index, _ in law.loose():
            kept[index] = -FALLS
    return weights, kept * weights
