"""What hidden unknowns are on the functions with kinks in whose place they stand."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.problem.problem import Problem
from dmoc.program.layout import Layout


def hidden_values(problem: Problem, lay: Layout, step: Sequence[Array]) -> Array:
    """Values of the hidden unknowns in steps (q_k, q_kp1, u_k, u_kp1, h, t_k, q_i) of shape (total,
    size), shape (total, values in a step)."""
    q_k, q_kp1, u_k, u_kp1, h, t_k, q_i = step
    scheme, n, model = lay.scheme, len(q_k), lay.model_of_steps(problem)
    powers, c = np.arange(scheme.degree + 1), scheme.places[:, None]
    shapes = c**powers @ scheme.shapes.T
    slopes = powers * c ** np.maximum(powers - 1, 0) @ scheme.shapes.T
    within = q_i.reshape(n, scheme.inside, lay.nq)
    nodes = np.concatenate([q_k[:, None], q_kp1[:, None], within], axis=1)
    q, rates = (np.einsum("ca,kaj->ckj", at, nodes) for at in (shapes, slopes))
    places = [(i, share) for i, share in enumerate(scheme.places)]
    if scheme.points == 1:
        places = [(0, side) for side in ((0.0, 1.0) if lay.form.width else (0.0,))]
    values = [
        model.hidden(
            q[i], rates[i] / h, u_k + share * (u_kp1 - u_k), (t_k + scheme.places[i] * h)[:, 0]
        )
        for i, share in places
    ]
    return np.hstack(values)


def lifted(problem: Problem, lay: Layout, step: list[Array]) -> list[Array]:
    """Steps of shape (total, size) with the hidden unknowns behind, as kernels take them that have
    any; these are on their functions."""
    if not lay.index_s.size:
        return step
    values = hidden_values(problem, lay, step)
    both = lay.hidden_of_kernels.shape[1] // values.shape[1]
    return [*step, np.tile(values, (1, both))]
