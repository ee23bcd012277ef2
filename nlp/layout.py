"""The order of the unknowns, the only place that knows it.

    x = (h | q | u | lam | p_B | p_E | v_B | v_E | v_a | v_c | t | q_i)

h: step sizes, one a phase; q: coordinates at the nodes, a collision node shared by its two phases; u: inputs, one row a step
(constant), one row a node of each phase (linear), or two rows a step, its ends (stages); lam: impulses, one a collision; p_B, p_E: momenta
at both ends; v_B, v_E: velocities at both ends, only where the problem needs them; v_a, v_c: velocities before and after the collisions;
t: times of the nodes, only where the model depends on them; q_i: coordinates of the nodes inside the steps (order 4).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dmoc.codegen.kernels import Array
from dmoc.discretisation import FORMS, Discretisation, InputForm
from dmoc.nlp.problem import Problem
from dmoc.symbolic.names import velocity_name

Index = NDArray[np.intp]


@dataclass(frozen=True)
class Layout:
    """Sizes and index sets of the unknowns.

    ``index_a`` is an integer array of the shape of ``a`` that holds the positions of its entries in x, so that ``x[index_a]`` is a.
    """

    nq: int
    nu: int
    steps: tuple[int, ...]
    form: InputForm
    velocity_at_start: bool
    velocity_at_end: bool
    timed: bool
    scheme: Discretisation

    @classmethod
    def of(cls, problem: Problem) -> Layout:
        periodic = any(name in problem.periodic for name in map(velocity_name, problem.kernels.coordinates))
        return cls(
            problem.nq,
            problem.nu,
            problem.phase_steps,
            FORMS[problem.control_form],
            problem.start_bounds.needs_velocity or periodic,
            problem.goal_bounds.needs_velocity or periodic or bool(problem.kernels.manifest["terminal_velocity"]),
            problem.explicit_time,
            problem.scheme,
        )

    @property
    def phases(self) -> int:
        return len(self.steps)

    @property
    def total(self) -> int:
        """Number of steps of all phases."""
        return sum(self.steps)

    @property
    def inside(self) -> int:
        """Number of nodes inside a step."""
        return self.scheme.inside

    @property
    def input_rows(self) -> int:
        """Number of rows of u."""
        return sum(map(self.form.rows, self.steps))

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
        return [
            self.phases,
            (self.total + 1) * self.nq,
            self.input_rows * self.nu,
            self.phases - 1,
            self.nq,
            self.nq,
            self.nq * self.velocity_at_start,
            self.nq * self.velocity_at_end,
            (self.phases - 1) * self.nq,
            (self.phases - 1) * self.nq,
            (self.total + 1) * self.timed,
            self.total * self.nq * self.inside,
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
        return self._block(2, self.input_rows, self.nu)

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
    def index_v_a(self) -> Index:
        return self._block(8, -1, self.nq)

    @cached_property
    def index_v_c(self) -> Index:
        return self._block(9, -1, self.nq)

    @cached_property
    def index_t(self) -> Index:
        return self._block(10, -1)

    @cached_property
    def index_q_i(self) -> Index:
        """Shape (total, inside * nq)."""
        return self._block(11, self.total, self.inside * self.nq)

    @cached_property
    def row_u_k(self) -> Index:
        """Row of u at the start of each step."""
        before = np.cumsum([0, *map(self.form.rows, self.steps[:-1])])
        starts = [first + self.form.starts(n) for first, n in zip(before, self.steps, strict=True)]
        return np.concatenate(starts)

    @property
    def row_u_kp1(self) -> Index:
        """Row of u at the end of each step: the same row for inputs constant in a step."""
        return self.row_u_k + self.form.width

    @cached_property
    def step_of_input(self) -> Index:
        """The last step that each row of u enters."""
        steps = np.zeros(self.input_rows, dtype=np.intp)
        steps[self.row_u_kp1] = np.arange(self.total)
        steps[self.row_u_k] = np.arange(self.total)
        return steps

    @cached_property
    def index_z(self) -> Index:
        """Local unknowns z = (q_k, q_kp1, u_k, u_kp1, h, t_k, q_i) of each step; t_k is nowhere (-1) in a model without explicit time."""
        return np.hstack(
            [
                self.index_q[:-1],
                self.index_q[1:],
                self.index_u[self.row_u_k],
                self.index_u[self.row_u_kp1],
                self.index_h[self.phase_of_step][:, None],
                self.time_columns[:-1],
                self.index_q_i,
            ]
        )

    @cached_property
    def time_columns(self) -> Index:
        """Unknown t of each node, shape (total + 1, 1); nowhere (-1) in a model without explicit time."""
        return self.index_t[:, None] if self.timed else np.full((self.total + 1, 1), -1)

    def times(self, x: Array) -> Array:
        """Times of the nodes, shape (total + 1,)."""
        h = x[self.index_h][self.phase_of_step]
        return np.concatenate([[0.0], np.cumsum(h)])

    def split(self, z: Index) -> list[Index]:
        """Split local unknowns into q_k, q_kp1, u_k, u_kp1, h, t_k and q_i."""
        return np.split(z, np.cumsum([self.nq, self.nq, self.nu, self.nu, 1, 1]), axis=1)

    def step_inputs(self, x: Array) -> list[Array]:
        """Return q_k, q_kp1, u_k, u_kp1, h, t_k and q_i of every step as arrays of shape (total, size)."""
        parts = [np.ascontiguousarray(x[at]) for at in self.split(self.index_z)]
        if not self.timed:
            parts[5] = np.zeros((self.total, 1))
        return parts
