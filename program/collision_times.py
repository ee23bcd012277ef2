"""Minimal collision times: how soon a phase can end in its collision at full input.

The equations of motion at averaged coefficients, half-way between the phase's start and its
collision, with the inputs at the bounds that drive towards the surface, give constant accelerations
a; with them the gap is a quadratic in time, and its first root is T_min (Kern & Gross 2018,
"implementation issue #3"; equation :eq:`minimal-time` of the theory).  It is an estimate and no
lower bound: a motion may be sooner, at constant full input already.
"""

from __future__ import annotations

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.algebra import solved
from dmoc.mechanics.model import Model


def averaged_accelerations(
    model: Model, q: Array, v: Array, q_c: Array, surface: int, bounds: Array
) -> tuple[Array, Array]:
    """Return a = M^-1 F (nq,) half-way between the positions q at the start and q_c at the
    collision, at full input within finite bounds (nu, 2) towards a surface, and its derivative (nq,
    2 nq) with respect to the averaged position and v."""
    at = 0.5 * (q + q_c)
    inputs = model.input_matrix(at, v, bounds.mean(axis=1))
    gradient = model.gap_slopes(at)[surface, :-1]  # a surface with a minimal time stands still
    push = solved(model.mass(at), inputs).T @ gradient
    full = np.where(push > 0, bounds[:, 1], bounds[:, 0])
    mass, force = model.equations(at, v, full)
    a = solved(mass, force)
    return a, solved(mass, model.equations_slopes(at, v, full, a=a))


def minimal_time(
    model: Model, q_k: Array, q_kp1: Array, h: float, q_c: Array, surface: int, bounds: Array
) -> tuple[float, Array]:
    """Return T_min of a phase and its gradient with respect to y = (q_k, q_kp1, h, q_c).

    q_k and q_kp1 are the nodes of the phase's first step of size h, and q_c is its collision node.
    T_min is infinite, with a zero gradient, where the quadratic has no root ahead; it is 0 where an
    input is unbounded, because then nothing limits the acceleration.
    """
    nq = len(q_k)
    if not np.isfinite(bounds).all():
        return 0.0, np.zeros(3 * nq + 1)
    qm, v = 0.5 * (q_k + q_kp1), (q_kp1 - q_k) / h
    a, a_D_s = averaged_accelerations(model, qm, v, q_c, surface, bounds)
    with np.errstate(invalid="ignore", divide="ignore"):
        time = float(model.minimal_times(q_k, q_kp1, h, q_c, a)[surface])
    if not (np.isfinite(time) and time > 0):
        return np.inf, np.zeros(3 * nq + 1)
    explicit = model.minimal_time_slopes(q_k, q_kp1, h, q_c, a)[surface]
    # s = ((qm + q_c)/2, v) with qm = (q_k + q_kp1)/2 and v = (q_kp1 - q_k)/h
    one = np.eye(nq)
    s_D_y = np.zeros((2 * nq, 3 * nq + 1))
    s_D_y[:nq, :nq] = s_D_y[:nq, nq : 2 * nq] = one / 4
    s_D_y[:nq, 2 * nq + 1 :] = one / 2
    s_D_y[nq:, :nq], s_D_y[nq:, nq : 2 * nq] = -one / h, one / h
    s_D_y[nq:, 2 * nq] = -v / h
    return time, explicit[: 3 * nq + 1] + explicit[3 * nq + 1 :] @ a_D_s @ s_D_y
