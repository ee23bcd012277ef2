"""An answer that is followed along the central path until its inequalities tell whether they hold.

An interior-point method ends where the distance of each inequality times its multiplier is a number
mu that is not zero. Where both are near the root of mu, neither says which of them vanishes with
mu. From such an answer Newton's method goes on with smaller mu. With slacks s of the rows d, and
multipliers w of theirs and z of bounds, the path is::

    grad (f + y . c - w . d) - z_lower + z_upper = 0,   c = 0,   d = s,
    s w = mu,   (x - lower) z_lower = mu,   (upper - x) z_upper = mu
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse

from dmoc.codegen.kernels import Array
from dmoc.program.blocks import Index
from dmoc.proving.factorisation import SignedFactors
from dmoc.proving.optimality_system import OptimalitySystem, balanced, scaled
from dmoc.solvers.outcome import Duals

# How much smaller mu gets at a time, and the least one: what is told then has a distance or a
# multiplier well above its root.
SMALLER, LEAST, ROUNDS = 30.0, 1e-16, 12
# Products of so many mu are near it; equations that are missed by less are met.
NEAR, MET = 3.0, 1e-10
POSITIVE = 1e-14  # distances and multipliers at the beginning
SHARE = 0.995  # of the way to where one of them vanishes


@dataclass(eq=False)
class CentralPath:
    """Iterates of a program all of whose inequalities may hold: ``x``, shape (n,), multipliers
    ``y`` of the rows (c | d), shape (m,), and ``z`` of the bounds, shape (n,).  ``apart`` and
    ``push`` are distances and multipliers of lower bounds, upper bounds, and inequalities."""

    system: OptimalitySystem
    x: Array
    y: Array
    z: Array

    def __post_init__(self) -> None:
        nlp, free = self.system.nlp, self.system.free
        low, high = free & np.isfinite(nlp.lower), free & np.isfinite(nlp.upper)
        self.bounded: Index = np.concatenate([np.flatnonzero(low), np.flatnonzero(high)])
        self.signs = np.repeat([1.0, -1.0], [low.sum(), high.sum()])
        self.above: Index = np.flatnonzero(self.system.rows[nlp.n_eq :]) + nlp.n_eq
        push = np.concatenate([self.signs * self.z[self.bounded], -self.y[self.above]])
        apart = np.concatenate([self._off, nlp.values(self.x)[1 + self.above]])
        self.apart, self.push = np.maximum(apart, POSITIVE), np.maximum(push, POSITIVE)

    @property
    def _off(self) -> Array:
        """Distances from the bounds."""
        nlp = self.system.nlp
        limits = np.where(self.signs > 0, nlp.lower[self.bounded], nlp.upper[self.bounded])
        return np.asarray(self.signs * (self.x[self.bounded] - limits))

    def follow(self) -> Duals:
        """Go on as far as Newton's method leads; the multipliers there."""
        mu = float(np.mean(self.apart * self.push)) if len(self.push) else 0.0
        for _ in range(ROUNDS):
            F, K = self.system.at(self.x, self.y)
            if self._is_near(mu, F):
                if mu <= LEAST:
                    break
                mu = max(mu / SMALLER, LEAST)
            of_x, of_y = self._step(mu, F, K)
            if not (np.isfinite(of_x).all() and np.isfinite(of_y).all()):
                break
            self._go(mu, of_x, of_y)
        at = len(self.bounded)
        z = self._to_unknowns(self.signs * self.push[:at])
        return Duals.of_rows(self.system.nlp.n_eq, self.y, z)

    def _to_unknowns(self, values: Array) -> Array:
        """Sums of values of bounds, shape (n,)."""
        return np.asarray(np.bincount(self.bounded, values, len(self.x)), dtype=float)

    def _is_near(self, mu: float, F: Array) -> bool:
        """Whether it is at a point of the path, nearly."""
        at = len(self.bounded)
        of_x, of_y = self.system.parts(F)
        of_x -= self._to_unknowns(self.signs * self.push[:at])
        of_y[self.above] -= self.apart[at:]
        missed = max(np.abs(of_x).max(initial=0.0), np.abs(of_y).max(initial=0.0))
        return bool(missed <= MET + mu and (self.apart * self.push <= NEAR * mu).all())

    def _step(self, mu: float, F: Array, K: scipy.sparse.csr_matrix) -> tuple[Array, Array]:
        """Newton's step of x and y to the point of the path, slacks and multipliers of inequalities
        eliminated."""
        at = len(self.bounded)
        of_x, of_y = self.system.parts(F)
        of_x -= self._to_unknowns(self.signs * mu / self.apart[:at])
        of_y[self.above] -= mu / self.push[at:]
        bends, slack = self._to_unknowns(self.push[:at] / self.apart[:at]), np.zeros(len(self.y))
        slack[self.above] = -self.apart[at:] / self.push[at:]
        order = self.system.order
        right = np.concatenate([of_x, of_y])[order]
        with np.errstate(all="ignore"):
            K = (K + scipy.sparse.diags(np.concatenate([bends, slack])[order])).tocsr()
            d = balanced(K)
            step = d * SignedFactors(scaled(K, d)).solve((d * right)[:, None])[:, 0]
        return self.system.parts(-step)

    def _go(self, mu: float, of_x: Array, of_y: Array) -> None:
        """Take a step, as far as distances and multipliers stay positive."""
        at, apart, push = len(self.bounded), self.apart, self.push
        nearer, less = np.empty(len(apart)), np.empty(len(push))
        nearer[:at] = self.signs * of_x[self.bounded]
        less[:at] = mu / apart[:at] - push[:at] * (1 + nearer[:at] / apart[:at])
        less[at:] = -of_y[self.above]
        nearer[at:] = (mu - apart[at:] * less[at:]) / push[at:] - apart[at:]
        of_place, of_force = _share(apart, nearer), _share(push, less)
        self.x, self.y = self.x + of_place * of_x, self.y + of_force * of_y
        self.push = push + of_force * less
        self.apart = apart + of_place * nearer
        self.apart[:at] = np.maximum(self._off, POSITIVE * self.apart[:at])
        self.y[self.above] = -self.push[at:]


def _share(values: Array, changes: Array) -> float:
    """The share of changes that positive values may go, at most 1."""
    falls = changes < 0
    most = np.min(values[falls] / -changes[falls], initial=np.inf)
    return float(min(1.0, SHARE * most))
