"""Values of all unknowns of a problem, and what is read off them."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.mechanics.model import Model
from dmoc.problem.problem import Problem
from dmoc.program.layout import Layout


@record(frozen=True, eq=False)
class Iterate:
    """Values of the unknowns of a problem, in its units; they are not changed in place.

    Attributes
    ----------
    problem : Problem
        The problem with the design of these values.
    lay : Layout
    x : array, shape (n,)
    """

    problem: Problem
    lay: Layout
    x: Array

    @classmethod
    def of(cls, problem: Problem, x: Array) -> Iterate:
        """Some values of the unknowns of a problem."""
        lay = Layout.of(problem)
        return cls(lay.problem_at(problem, x), lay, x)

    def moved(self, x: Array) -> Iterate:
        """Other values with the same design."""
        return Iterate(self.problem, self.lay, x)

    @cached_property
    def q(self) -> Array:
        """Coordinates at the nodes, shape (total + 1, nq)."""
        return self.x[self.lay.index_q]

    @cached_property
    def t(self) -> Array:
        """Times of the nodes, shape (total + 1,)."""
        return self.lay.times(self.x)

    @cached_property
    def rates(self) -> Array:
        """Means of the velocities in steps, shape (total, nq)."""
        h = self.x[self.lay.index_h][self.lay.phase_of_step]
        return np.asarray(np.diff(self.q, axis=0) / h[:, None])

    @cached_property
    def steps(self) -> list[Array]:
        """The arguments q_k, q_kp1, u_k, u_kp1, h, t_k and q_i of kernels of steps, each of shape
        (total, size)."""
        return self.lay.step_inputs(self.x)

    @cached_property
    def model(self) -> Model:
        """The model with rows of parameters for all steps."""
        return self.lay.model_of_steps(self.problem)

    def end(self, node: int) -> tuple[Array, Array, Array]:
        """Position, velocity and time at the first node, 0, or the last one, -1; velocities that
        are no unknowns are zero."""
        index = self.lay.index_v_B if node == 0 else self.lay.index_v_E
        v = self.x[index] if len(index) else np.zeros(self.lay.nq)
        return self.q[node], v, self.t[node] if node else np.zeros(())
