"""Steps of a motion that were integrated from their first nodes, and states within them."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.mechanics.bound_kernels import Index
from dmoc.simulation.flow import Steps

# Coefficients of the powers of the share by positions, velocities and accelerations at both ends,
# and of those of its first two derivatives.
QUINTIC = np.array(
    [
        [1, 0, 0, 0, 0, 0], [0, 1, 0, 0, 0, 0], [0, 0, 0.5, 0, 0, 0],
        [-10, -6, -1.5, 10, -4, 0.5], [15, 8, 1.5, -15, 7, -1], [-6, -3, -0.5, 6, -3, 0.5],
    ]
)  # fmt: skip
RATE = np.arange(1, 6)[:, None] * QUINTIC[1:]
BEND = np.arange(1, 5)[:, None] * RATE[1:]


@record(frozen=True, eq=False)
class IntegratedSteps:
    """Steps that were integrated from their first nodes: states (n, 2 nq ...) at both ends, and
    the accelerations there (n, 2, nq).  Between them is the polynomial of degree 5."""

    steps: Steps
    start: Array
    ends: Array
    stop: Array

    def part(self, which: Index | slice) -> IntegratedSteps:
        """Some of the steps, by their numbers, shape (n,), or a slice."""
        ends = (a[which] for a in (self.start, self.ends, self.stop))
        return IntegratedSteps(self.steps.part(which), *ends)

    def at(self, share: float | Array) -> tuple[Array, Array, Array, Array]:
        """q, v, u and t at a share of every step, one for all or one for each, shape (n,): shapes
        (n, nq), (n, nq), (n, nu) and (n,)."""
        s = np.reshape(share, (-1, 1))
        basis = basis_at(np.broadcast_to(s[:, 0], len(self.steps)))
        place, rate, _ = np.einsum("dnb,bnq->dnq", basis, self._data)
        u = self.steps.u0 + s * (self.steps.u1 - self.steps.u0)
        return place, rate / self.steps.h[:, None], u, self.steps.t + s[:, 0] * self.steps.h

    def along(self, shares: Array, basis: Array) -> tuple[Array, Array, Array, Array]:
        """q, v, u and t at some shares (m,) of all steps, shapes (m, n, ...); ``basis`` is that of
        the shares, :func:`basis_at`."""
        place, rate, _ = np.tensordot(basis, self._data, 1)
        u = self.steps.u0 + shares[:, None, None] * (self.steps.u1 - self.steps.u0)
        t = self.steps.t + shares[:, None] * self.steps.h
        return place, rate / self.steps.h[:, None], u, t

    def halves(self) -> IntegratedSteps:
        """The first halves of the steps, and then the second ones."""
        whole, h, (q, v, u, t) = self.steps, self.steps.h / 2, self.at(0.5)
        half = basis_at(np.array([0.5]))[2]
        a = np.tensordot(half, self._data, 1)[0] / whole.h[:, None] ** 2
        middle, size = np.hstack([q, v]), 2 * q.shape[1]
        return IntegratedSteps(
            Steps(
                np.concatenate([whole.t, t]), np.concatenate([h, h]),
                np.concatenate([whole.u0, u]), np.concatenate([u, whole.u1]),
            ),
            np.concatenate([self.start[:, :size], middle]),
            np.concatenate(
                [np.stack([self.ends[:, 0], a], axis=1), np.stack([a, self.ends[:, 1]], axis=1)]
            ),
            np.concatenate([middle, self.stop[:, :size]]),
        )  # fmt: skip

    @cached_property
    def _data(self) -> Array:
        """Positions, velocities and accelerations at both ends in units of the share, shape
        (6, n, nq)."""
        nq, h = self.ends.shape[2], self.steps.h[:, None]
        sides = ((self.start, self.ends[:, 0]), (self.stop, self.ends[:, 1]))
        return np.stack(
            [part for y, a in sides for part in (y[:, :nq], h * y[:, nq : 2 * nq], h**2 * a)]
        )


def basis_at(s: Array) -> Array:
    """Factors of the data of both ends in positions and their first and second derivatives at
    shares (m,), shape (3, m, 6)."""
    powers = s[:, None] ** np.arange(6)
    return np.stack([powers @ QUINTIC, powers[:, :5] @ RATE, powers[:, :4] @ BEND])
