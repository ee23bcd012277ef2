"""Inputs at which the forces of a motion have no slope: conditions of third order.

Where the forces do not change with an input to first order, neither do the constraints, and L is
stationary in the input alone: L(u) - L(u_0) is c_2 (u - u_0)^2 + c_3 (u - u_0)^3 + ...  If c_2 = 0,
as for the force u^3 at u = 0, the motion is no minimum unless c_3 = 0: L falls to one side, which
the conditions of second order do not see.  There the slopes of L have one sign on both sides.
"""

from __future__ import annotations

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.problem.reach import enter_linearly, slopes_by_inputs
from dmoc.program.transcription import Transcription
from dmoc.solvers.outcome import Duals

# Slopes of the forces, relative to those at the operating inputs, that count as none; how far from
# a motion slopes of L are looked at, in sizes of the inputs.
NONE, BESIDE = 1e-3, 0.03


def falling_inputs(nlp: Transcription, x: Array, duals: Duals) -> Array | None:
    """A direction, shape (n,), of inputs at which the forces have no slope, by their sizes, along
    which L falls in third order from x, shape (n,); None where there is none."""
    if enter_linearly(nlp.problem):
        return None
    direction = np.zeros(nlp.n)
    flat, inputs = _flat_rows(nlp, nlp.physical(x)), nlp.layout.index_u
    for j in range(nlp.problem.nu):
        at = inputs[flat[:, j], j]
        step = np.zeros(nlp.n)
        step[at] = BESIDE
        sides = (np.clip(x + side * step, nlp.lower, nlp.upper) for side in (1.0, -1.0))
        above, below = (nlp.lagrangian_gradient(z, duals.y, duals.w)[at] for z in sides)
        direction[at] = np.where(above * below > 0, -np.sign(above), 0.0)
    return direction if direction.any() else None


def _flat_rows(nlp: Transcription, x: Array) -> np.ndarray:
    """Rows of the inputs in unknowns x where the forces have no slope by one, shape (rows, nu)."""
    lay, at = nlp.layout, nlp.iterate(x)
    problem = at.problem
    q_k, q_kp1, _, _, h, t_k, _ = (part[lay.step_of_input] for part in at.steps)
    state, t = ((q_k + q_kp1) / 2, (q_kp1 - q_k) / h), (t_k + h / 2)[:, 0]
    around = np.tile(problem.operating_inputs, (len(t), 1))
    own, others = (slopes_by_inputs(problem, *state, u, t) for u in (x[lay.index_u], around))
    return np.asarray((own <= NONE * others) & (others > 0))
