"""The modes of a motion: which contacts are closed and what sticks or slides.

A mode is a set of conditions: closed contacts, what sticks, and the joints of the model, which hold
in every mode.  Each has a gradient C, a direction B in which its force pushes, and second-order
terms.  A closed contact breaks where its force would pull, what sticks where its friction holds it
no more (:func:`dmoc.simulation.mode_choice.kept`); a joint does not break.

What a mode makes of accelerations and forces says :mod:`dmoc.simulation.integrator`.  An impact
obeys the same relations with impulses for forces and rates for second derivatives.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dmoc.base.arguments import check_known
from dmoc.base.errors import SimulationError
from dmoc.codegen.kernels import Array, Kernels
from dmoc.mechanics.algebra import solved
from dmoc.mechanics.model import Model
from dmoc.motion.trajectory import Phase

# Singular values below this share of the largest are those of conditions that say the same twice.
REDUNDANT = 1e-11
# Determinant, measured by the sizes of its rows and columns, of conditions that are far from that.
REGULAR = 1e-6
RAIL = -1  # the surface of a tangent that belongs to none


@dataclass(frozen=True)
class Mode:
    """Closed surfaces, tangents that stick, and tangents that slide with their signs, each by its
    place in the model."""

    closed: tuple[int, ...] = ()
    sticking: tuple[int, ...] = ()
    sliding: tuple[tuple[int, int], ...] = ()


FREE = Mode()


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


def supports(kernels: Kernels) -> tuple[int, ...]:
    """The surface that each tangent belongs to, or RAIL."""
    surfaces = kernels.surfaces
    return tuple(surfaces.index(n) if n in surfaces else RAIL for n in kernels.tangents)


def mode_of(phase: Phase, kernels: Kernels) -> Mode:
    """The mode of a phase; what rubs at an open surface has no part in it."""
    for name in phase.closed:
        check_known(name, kernels.surfaces, "closed surface", error=SimulationError)
    for name in phase.rubbing:
        check_known(name, kernels.tangents, "rubbing tangent", error=SimulationError)
    for forces, what, names in (
        (phase.normal, "normal", phase.closed),
        (phase.tangential, "tangential", phase.rubbing),
    ):
        shape = (len(phase.t), len(names))
        if names and forces.shape != shape:
            raise SimulationError(
                f"{what} forces of the phase from {phase.t[0]:.4g} s on have the shape "
                f"{forces.shape}: expected {shape}, a column for each of {', '.join(names)}."
            )
    states = [
        (kernels.tangents.index(name), s)
        for name, s in phase.rubbing.items()
        if name in phase.closed or name not in kernels.surfaces
    ]
    return Mode(
        tuple(kernels.surfaces.index(name) for name in phase.closed),
        tuple(k for k, s in states if s == 0),
        tuple((k, s) for k, s in states if s != 0),
    )


def without_rails(mode: Mode, kernels: Kernels) -> Mode:
    """A mode as it is during an impact, in which rails have no part."""
    at = supports(kernels)
    return replace(
        mode,
        sticking=tuple(k for k in mode.sticking if at[k] != RAIL),
        sliding=tuple((k, s) for k, s in mode.sliding if at[k] != RAIL),
    )


def conditions(model: Model, mode: Mode, q: Array, t: Array) -> Conditions:
    """The conditions of a mode at rows of positions."""
    normals = model.gap_slopes(q, t)[..., :-1]
    along = model.tangent_slopes(q, t)[..., :-1]
    closed, at = list(mode.closed), supports(model.kernels)
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
    count, at = len(mode.closed), supports(model.kernels)
    normal[:, list(mode.closed)] = lam[:, :count]
    rest = count + len(mode.sticking)
    tangential[:, list(mode.sticking)] = lam[:, count:rest]
    for k, s in mode.sliding:
        held = 1.0 if at[k] == RAIL else normal[:, at[k]]
        tangential[:, k] = -s * model.friction[k] * held
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
