"""The modes of a motion: which contacts are closed and what sticks or slides.

A mode is a set of conditions: closed contacts, what sticks, and the joints of the model, which hold
in every mode.  Each has a gradient C, a direction B in which its force pushes, and second-order
terms.  A closed contact breaks where its force would pull, what sticks where its friction holds it
no more (:func:`dmoc.simulation.mode_choice.kept`); a joint does not break.

What a mode makes of accelerations and forces says :mod:`dmoc.simulation.integrator`.  An impact
obeys the same relations with impulses for forces and rates for second derivatives.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.algebra import solved
from dmoc.mechanics.bound_kernels import RAIL
from dmoc.mechanics.contact_mode import Mode
from dmoc.mechanics.model import Model

# Singular values below this share of the largest are those of conditions that say the same twice.
REDUNDANT = 1e-11
# Determinant, measured by the sizes of its rows and columns, of conditions that are far from that.
REGULAR = 1e-6


@dataclass(frozen=True)
class Reaction:
    """Accelerations (n, nq), contact forces (n, nc), friction forces (n, nt) and forces of joints
    (n, nj) of rows of states; zero where a surface is open or a tangent does not rub."""

    acceleration: Array
    normal: Array
    tangential: Array
    joint: Array


@dataclass(frozen=True)
class Conditions:
    """Conditions of a mode at rows of states: their gradients C and the directions B in which a
    unit of their multipliers pushes, both (n, m, nq): closed contacts, what sticks, joints."""

    C: Array
    B: Array


def conditions(model: Model, mode: Mode, q: Array, t: Array) -> Conditions:
    """The conditions of a mode at rows of positions."""
    normals = model.gap_slopes(q, t)[..., :-1]
    along = model.tangent_slopes(q, t)[..., :-1]
    closed, at = list(mode.closed), model.supports
    pushes = -normals[:, closed]
    for k, s in mode.sliding:
        if at[k] != RAIL:
            pushes[:, closed.index(at[k])] -= s * model.friction[k] * along[:, k]
    held = along[:, list(mode.sticking)], model.joint_slopes(q, t)[..., :-1]
    return Conditions(
        np.concatenate([normals[:, closed], *held], axis=1),
        np.concatenate([pushes, *held], axis=1),
    )


def condition_rates(model: Model, mode: Mode, q: Array, v: Array, t: Array) -> Array:
    """Rates (n, m) of the conditions of a mode at rows of states."""
    normal, along = model.gap_rates(q, v, t), model.slide_rates(q, v, t)
    held = normal[:, list(mode.closed)], along[:, list(mode.sticking)]
    return np.hstack([*held, model.joint_rates(q, v, t)])


def answers(M: Array, c: Conditions, wanted: Array) -> tuple[Array, Array]:
    """The change M^-1 B^T lam of an acceleration or a velocity (n, nq) that changes C a by what is
    wanted (n, m), and its multipliers lam (n, m): the smallest where several would do."""
    response = columns(M, c.B)
    A = c.C @ response
    if A.shape[1] == 1:
        lam = np.asarray(wanted / A[:, 0])
    else:
        squares = np.einsum("nmi,nim->nm", c.C, columns(M, c.C))
        lam = _multipliers(A, np.where(squares > 0, np.sqrt(np.abs(squares)), 1.0), wanted)
    return (response @ lam[..., None])[..., 0], lam


def spread(model: Model, mode: Mode, lam: Array) -> tuple[Array, Array, Array]:
    """Multipliers (n, m) of a mode as forces of all surfaces (n, nc), tangents (n, nt) and joints
    (n, nj)."""
    normal, tangential = np.zeros((len(lam), model.nc)), np.zeros((len(lam), model.nt))
    count = len(mode.closed)
    rest = count + len(mode.sticking)
    normal[:, list(mode.closed)] = lam[:, :count]
    tangential[:, list(mode.sticking)] = lam[:, count:rest]
    if mode.sliding:
        slide, signs = map(list, zip(*mode.sliding, strict=True))
        tangential[:, slide] = -np.array(signs) * model.bearing(normal)[:, slide]
    return normal, tangential, lam[:, rest:]


def columns(M: Array, B: Array) -> Array:
    """M^-1 B^T, shape (n, nq, m); not a number where M is singular or not finite."""
    return solved(M, np.ascontiguousarray(np.swapaxes(B, 1, 2)))


def _multipliers(A: Array, size: Array, b: Array) -> Array:
    """The shortest solution of A lam = b with rows and columns measured by their sizes; not a
    number where there is none."""
    scaled = A / size[:, :, None] / size[:, None, :]
    if not (np.isfinite(scaled).all() and np.isfinite(b).all()):
        return np.full(b.shape, np.nan)
    if (np.abs(np.linalg.det(scaled)) > REGULAR).all():
        return np.asarray(np.linalg.solve(scaled, (b / size)[..., None])[..., 0] / size)
    inverse = np.linalg.pinv(scaled, rcond=REDUNDANT)
    return np.asarray((inverse @ (b / size)[..., None])[..., 0] / size)
