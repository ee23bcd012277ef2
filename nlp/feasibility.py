"""Minimal collision times: how soon a phase can end in its collision at full input.

The equations of motion at averaged coefficients, half-way between the phase's start and its collision, with the inputs at the bounds
that drive towards the surface, give constant accelerations a; with them the gap is a quadratic in time, and its first root is T_min
(Kern & Gross 2018, "implementation issue #3").  It is an estimate: it guides the solver and is never the last word.
"""

from __future__ import annotations

import numpy as np

from dmoc.codegen.kernels import Array, Kernels
from dmoc.nlp.algebra import solved


def averaged_accelerations(
    kernels: Kernels, q: Array, v: Array, q_c: Array, surface: int, bounds: Array, par: Array
) -> tuple[Array, Array]:
    """Return a = M^-1 F half-way between q and q_c at full input towards a surface, and da/dq half-way.

    Parameters
    ----------
    q, v, q_c : arrays of shape (nq,)
        State at the start and position at the collision; the coefficients are taken at (q + q_c)/2 and v.
    surface : int
        Index of the surface.
    bounds : array of shape (nu, 2)
        Finite bounds of the inputs.
    par : array of shape (1, npar)

    Returns
    -------
    a : array of shape (nq,)
    a_D_s : array of shape (nq, 2 nq)
        Derivative with respect to the averaged position and v.
    """
    nq, nu = len(q), len(bounds)
    at, rate = (0.5 * (q + q_c))[None], v[None].copy()
    middle, now = bounds.mean(axis=1)[None], np.zeros((1, 1))
    mass = kernels.call("dynamics", at, rate, middle, now, par)[0].reshape(nq, nq)
    inputs = kernels.call("input_matrix", at, rate, middle, now, par)[0].reshape(nq, nu)
    rows, columns = kernels.pattern("surface_jac", "g_D_q")
    gradient = np.zeros(nq)
    values = kernels.call("surface_jac", at, now, par)[0][0]
    gradient[columns[rows == surface]] = values[rows == surface]  # a surface with a minimal time stands still
    push = solved(mass, inputs).T @ gradient
    full = np.where(push > 0, bounds[:, 1], bounds[:, 0])[None]
    force = kernels.call("dynamics", at, rate, full, now, par)[1][0]
    a = solved(mass, force)
    mass_s, force_s = kernels.call("dynamics_jac", at, rate, full, now, par)
    M_D_s, F_D_s = np.zeros((nq * nq, 2 * nq)), np.zeros((nq, 2 * nq))
    M_D_s[kernels.pattern("dynamics_jac", "M_D_s")] = mass_s[0]
    F_D_s[kernels.pattern("dynamics_jac", "F_D_s")] = force_s[0]
    change = F_D_s - np.einsum("ijs,j->is", M_D_s.reshape(nq, nq, 2 * nq), a)
    return a, solved(mass, change)


def minimal_time(
    kernels: Kernels, q_k: Array, q_kp1: Array, h: float, q_c: Array, surface: int, bounds: Array, par: Array
) -> tuple[float, Array]:
    """Return T_min of a phase and its gradient with respect to y = (q_k, q_kp1, h, q_c).

    q_k and q_kp1 are the nodes of the phase's first step of size h, and q_c is its collision node.  T_min is infinite, with a zero gradient,
    where the quadratic has no root ahead; it is 0 where an input is unbounded, because then nothing limits the acceleration.
    """
    nq = len(q_k)
    if not np.isfinite(bounds).all():
        return 0.0, np.zeros(3 * nq + 1)
    qm, v = 0.5 * (q_k + q_kp1), (q_kp1 - q_k) / h
    a, a_D_s = averaged_accelerations(kernels, qm, v, q_c, surface, bounds, par)
    arguments = (q_k[None].copy(), q_kp1[None].copy(), np.array([[h]]), q_c[None].copy(), a[None], par)
    with np.errstate(invalid="ignore", divide="ignore"):
        time = float(kernels.call("min_time", *arguments)[0][0, surface])
    if not (np.isfinite(time) and time > 0):
        return np.inf, np.zeros(3 * nq + 1)
    rows, columns = kernels.pattern("min_time_jac", "T_min_D_y")
    explicit = np.zeros(4 * nq + 1)
    values = kernels.call("min_time_jac", *arguments)[0][0]
    explicit[columns[rows == surface]] = values[rows == surface]
    # s = ((qm + q_c)/2, v) with qm = (q_k + q_kp1)/2 and v = (q_kp1 - q_k)/h
    one = np.eye(nq)
    s_D_y = np.zeros((2 * nq, 3 * nq + 1))
    s_D_y[:nq, :nq] = s_D_y[:nq, nq : 2 * nq] = one / 4
    s_D_y[:nq, 2 * nq + 1 :] = one / 2
    s_D_y[nq:, :nq], s_D_y[nq:, nq : 2 * nq] = -one / h, one / h
    s_D_y[nq:, 2 * nq] = -v / h
    return time, explicit[: 3 * nq + 1] + explicit[3 * nq + 1 :] @ a_D_s @ s_D_y
