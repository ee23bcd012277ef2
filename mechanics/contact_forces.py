"""Accelerations and forces of contacts and constraints at states of a mode.

They are what keeps closed contacts closed, what sticks in its place, and the constraints of the
model, equation :eq:`reaction` of the theory.
"""

from __future__ import annotations

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.algebra import solved, solved_transpose
from dmoc.mechanics.contact_mode import Mode
from dmoc.mechanics.contacts import RAIL
from dmoc.mechanics.model import Model

# Singular values below this share of the largest are those of conditions that say the same twice.
REDUNDANT = 1e-10


def accelerations_and_forces(
    model: Model, mode: Mode, state: tuple[Array, Array, Array, Array]
) -> Array:
    """Rows (a | N | T | R) at rows of states (q, v, u, t) of a mode, shape (n, model.ny): N of all
    surfaces, T of all tangents, R of all constraints; zero where something is open, not a number
    where the masses are none."""
    (q, v, u, t), closed, stuck = state, list(mode.closed), list(mode.sticking)
    model = model.with_friction_at(q, v, u, t)
    M, F = model.equations(q, v, u, t)
    normals, along = model.gap_slopes(q, t)[..., :-1], model.tangent_slopes(q, t)[..., :-1]
    T, pushes = np.zeros((len(q), model.nt)), -normals
    for k, s in mode.sliding:
        if model.supports[k] == RAIL:
            T[:, k] = -s * model.friction[..., k]
        else:
            pushes[:, model.supports[k]] -= s * model.friction[..., k, None] * along[:, k]
    F = F + np.einsum("nk,nki->ni", T, along)
    held = along[:, stuck], model.joint_slopes(q, t)[..., :-1]
    C = np.concatenate([normals[:, closed], *held], axis=1)
    B = np.concatenate([pushes[:, closed], *held], axis=1)
    bent = np.hstack([
        model.gap_accelerations(q, v, t)[:, closed],
        model.slide_accelerations(q, v, t)[:, stuck], model.joint_accelerations(q, v, t),
    ])  # fmt: skip
    response = solved_transpose(M, B)
    missing = (C @ solved(M, F)[..., None])[..., 0] + bent
    forces = -_multipliers(C @ response, missing)
    y = np.zeros((len(q), model.nq + model.nc + model.nt + model.nj))
    a, N, _, R = np.split(y, np.cumsum([model.nq, model.nc, model.nt]), axis=1)
    a[:] = solved(M, F + np.einsum("nm,nmi->ni", forces, B))
    N[:, closed] = forces[:, : len(closed)]
    T[:, stuck] = forces[:, len(closed) : len(closed) + len(stuck)]
    for k, s in mode.sliding:
        if model.supports[k] != RAIL:
            T[:, k] = -s * model.friction[..., k] * N[:, model.supports[k]]
    y[:, model.nq + model.nc :][:, : model.nt] = T
    R[:] = forces[:, len(closed) + len(stuck) :]
    return y


def _multipliers(A: Array, b: Array) -> Array:
    """A^-1 b of each row, the shortest where several would do."""
    size = np.sqrt(np.abs(np.diagonal(A, axis1=1, axis2=2)))
    size = np.where(size > 0, size, 1.0)
    scaled = A / size[:, :, None] / size[:, None, :]
    good = np.isfinite(scaled).all(axis=(1, 2)) & np.isfinite(b).all(axis=1)
    x = np.full(b.shape, np.nan)
    inverse = np.linalg.pinv(scaled[good], rcond=REDUNDANT)
    x[good] = (inverse @ (b / size)[good][..., None])[..., 0]
    return x / size
