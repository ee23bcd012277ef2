"""The order of the unknowns, the only place that knows it.

    x = (h | q | u | lam | p_B | p_E | v_B | v_E)

h: step sizes, one a phase; q: coordinates at the nodes, a collision node shared by its two phases; u: inputs, one row a step
(constant) or one row a node of each phase (linear); lam: impulses, one a collision; p_B, p_E: momenta at both ends; v_B, v_E: velocities at
both ends, only where the problem bounds them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dmoc.codegen.kernels import Array
from dmoc.nlp.problem import Problem

Index = NDArray[np.intp]


@dataclass(frozen=True)
class Layout:
    """Sizes and index sets of the unknowns.

    ``index_a`` is an integer array of the shape of ``a`` that holds the positions of its entries in x, so that ``x[index_a]`` is a.
    """

    nq: int
    nu: int
    steps: tuple[int, ...]
    linear: bool
    velocity_at_start: bool
    velocity_at_end: bool

    @classmethod
    def of(cls, problem: Problem) -> Layout:
        return cls(
            problem.nq,
            problem.nu,
            problem.phase_steps,
            problem.controls == "linear",
            problem.start_bounds.needs_velocity,
            problem.goal_bounds.needs_velocity,
        )

    @property
    def phases(self) -> int:
        return len(self.steps)

    @property
    def total(self) -> int:
        """Number of steps of all phases."""
        return sum(self.steps)

    @cached_property
    def phase_of_step(self) -> Index:
        return np.repeat(np.arange(self.phases), self.steps)

    @cached_property
    def ends(self) -> Index:
        """First node of each phase, and the last node of all."""
        return np.concatenate([[0], np.cumsum(self.steps)])

    @cached_property
    def collision_nodes(self) -> Index:
        return self.ends[1:-1]

    @cached_property
    def _offsets(self) -> list[int]:
        return [int(o) for o in np.concatenate([[0], np.cumsum(self._sizes)])]

    @property
    def _sizes(self) -> list[int]:
        rows = self.total + (self.phases if self.linear else 0)
        return [
            self.phases,
            (self.total + 1) * self.nq,
            rows * self.nu,
            self.phases - 1,
            self.nq,
            self.nq,
            self.nq * self.velocity_at_start,
            self.nq * self.velocity_at_end,
        ]

    @property
    def size(self) -> int:
        return self._offsets[-1]

    def _block(self, i: int, *shape: int) -> Index:
        return np.arange(self._offsets[i], self._offsets[i + 1]).reshape(shape)

    @cached_property
    def index_h(self) -> Index:
        return self._block(0, -1)

    @cached_property
    def index_q(self) -> Index:
        return self._block(1, -1, self.nq)

    @cached_property
    def index_u(self) -> Index:
        rows = self.total + (self.phases if self.linear else 0)
        return self._block(2, rows, self.nu)

    @cached_property
    def index_lam(self) -> Index:
        return self._block(3, -1)

    @cached_property
    def index_p_B(self) -> Index:
        return self._block(4, -1)

    @cached_property
    def index_p_E(self) -> Index:
        return self._block(5, -1)

    @cached_property
    def index_v_B(self) -> Index:
        return self._block(6, -1)

    @cached_property
    def index_v_E(self) -> Index:
        return self._block(7, -1)

    @cached_property
    def row_u_k(self) -> Index:
        """Row of u at the start of each step."""
        return np.arange(self.total) + (self.phase_of_step if self.linear else 0)

    @cached_property
    def row_u_kp1(self) -> Index:
        """Row of u at the end of each step: the same row for inputs constant in a step."""
        return self.row_u_k + (1 if self.linear else 0)

    @cached_property
    def index_z(self) -> Index:
        """Local unknowns z = (q_k, q_kp1, u_k, u_kp1, h) of each step, shape (total, 2 nq + 2 nu + 1)."""
        return np.hstack(
            [
                self.index_q[:-1],
                self.index_q[1:],
                self.index_u[self.row_u_k],
                self.index_u[self.row_u_kp1],
                self.index_h[self.phase_of_step][:, None],
            ]
        )

    def step_inputs(self, x: Array) -> tuple[Array, Array, Array, Array, Array]:
        """Return q_k, q_kp1, u_k, u_kp1 and h of every step as arrays of shape (total, size)."""
        q = x[self.index_q]
        u_k = x[self.index_u[self.row_u_k]]
        u_kp1 = x[self.index_u[self.row_u_kp1]] if self.linear else u_k
        h = x[self.index_h[self.phase_of_step]][:, None]
        return q[:-1], q[1:], u_k, u_kp1, h
