"""Forward simulation by the variational integrator with the collision time step."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dmoc.codegen.kernels import Array, Kernels
from dmoc.errors import SimulationError
from dmoc.simulation.stepper import Stepper
from dmoc.symbolic.names import name_of
from dmoc.trajectory import Collision


@dataclass(frozen=True)
class Simulation:
    """A simulated motion.

    Attributes
    ----------
    t : array of shape (n,)
        Times of the recorded nodes in seconds.
    q, p : arrays of shape (n, nq)
        Coordinates and momenta.
    energy : array of shape (n,)
        E = v . p - L at the recorded nodes.
    collisions : tuple of Collision
        In the order in which they happened.
    """

    t: Array
    q: Array
    p: Array
    energy: Array
    collisions: tuple[Collision, ...]


def simulate(
    kernels: Kernels,
    position: Mapping[str, float] | ArrayLike,
    velocity: Mapping[str, float] | ArrayLike | None = None,
    *,
    step_size: float,
    steps: int,
    inputs: ArrayLike | None = None,
    parameters: Mapping[str, float] | None = None,
    restitution: float | Mapping[str, float] = 1.0,
    every: int = 1,
) -> Simulation:
    """Simulate a system through its collisions.

    Each step solves r_minus(q_k, q_{k+1}) + p_k = 0.  A step that crosses a surface is split at the collision: first
    (q_tau, tau) from the momentum equation and g(q_tau) = 0, then (q_{k+1}, lam) from the balance of energy and the conservation of
    tangential momentum.  Several collisions in one step are handled one after the other.

    Parameters
    ----------
    kernels : Kernels
    position, velocity : arrays of shape (nq,) or mappings by coordinate name
        Initial state; velocities default to rest.
    step_size : float
        h in seconds.
    steps : int
    inputs : array of shape (steps, nu) or (nu,), optional
        Inputs of each step; zero by default.
    parameters : mapping, optional
        Values that replace the model's.
    restitution : float or mapping, optional
        Coefficient e in [0, 1] of all surfaces, or by surface (others are elastic).
    every : int, optional
        Record every so many steps.

    Returns
    -------
    Simulation

    Raises
    ------
    SimulationError
        If an argument does not fit, a step has no solution, the motion comes to rest on a surface, or collisions accumulate.
    """
    nq, nu = len(kernels.coordinates), len(kernels.inputs)
    if not (isinstance(step_size, (int, float, np.number)) and np.isfinite(step_size) and step_size > 0):
        raise SimulationError(f"step_size = {step_size!r}: expected a positive number of seconds.")
    for name, number in (("steps", steps), ("every", every)):
        if not isinstance(number, (int, np.integer)) or number < 1:
            raise SimulationError(f"{name} = {number!r}: expected a whole number of at least 1.")
    if not isinstance(parameters or {}, Mapping):
        raise SimulationError(f"parameters = {parameters!r}: expected a mapping from names to values.")
    par = _parameters(kernels, parameters or {})
    q = _vector(position, kernels.coordinates, "position")
    v = _vector(np.zeros(nq) if velocity is None else velocity, kernels.coordinates, "velocity")
    u = _inputs(inputs, steps, nu)
    start, e = np.zeros((1, 1)), _restitution(kernels, restitution)
    if kernels.has("surface"):
        gaps = kernels.call("surface", q[None], start, par)[0][0]
        if (gaps > 1e-12).any():
            worst = int(np.argmax(gaps))
            raise SimulationError(
                f"position lies behind surface {kernels.surfaces[worst]!r} by {gaps[worst]:g}: move it inside g <= 0."
            )
    p = kernels.call("legendre", q[None], v[None], start, par)[0][0]
    stepper = Stepper(kernels, par, e)
    t, positions, momenta = stepper.run(q, p, u, float(step_size), every)
    collisions = tuple(
        Collision(kernels.surfaces[j], time, at, float(lam), before, after)
        for _, time, j, lam, at, before, after in stepper.collisions
    )
    velocities = velocities_of(kernels, t, positions, momenta, par)
    energy = kernels.call("legendre", positions, velocities, t[:, None].copy(), par)[1][:, 0]
    return Simulation(t, positions, momenta, energy, collisions)


def velocities_of(kernels: Kernels, t: Array, q: Array, p: Array, par: Array) -> Array:
    """Return v = M(q, t)^-1 (p - dL/dv(q, 0, t)) for rows of states, shape (n, nq)."""
    nq = q.shape[1]
    rest, at = np.zeros_like(q), t[:, None].copy()
    offset = kernels.call("legendre", q, rest, at, par)[0]
    mass = kernels.call("dynamics", q, rest, np.zeros((1, len(kernels.inputs))), at, par)[0].reshape(-1, nq, nq)
    return np.ascontiguousarray(np.linalg.solve(mass, (p - offset)[:, :, None])[:, :, 0])


def _restitution(kernels: Kernels, given: float | Mapping[str, float]) -> Array:
    """Coefficients by surface, shape (nc,)."""
    if not isinstance(given, Mapping) and not (isinstance(given, (int, float, np.number)) and 0 <= given <= 1):
        raise SimulationError(f"restitution = {given!r}: expected a number from 0 (plastic) to 1 (elastic).")
    named = given if isinstance(given, Mapping) else dict.fromkeys(kernels.surfaces, given)
    for surface, e in named.items():
        if surface not in kernels.surfaces:
            known = ", ".join(kernels.surfaces) or "none, the model has no surface"
            raise SimulationError(f"restitution names {surface!r}: expected one of {known}.")
        if not isinstance(e, (int, float, np.number)) or not 0 <= e <= 1:
            raise SimulationError(f"restitution of {surface!r} = {e!r}: expected a number from 0 (plastic) to 1 (elastic).")
    return np.array([float(named.get(surface, 1.0)) for surface in kernels.surfaces])


def _inputs(given: ArrayLike | None, steps: int, nu: int) -> Array:
    try:
        u = (
            np.zeros((steps, nu))
            if given is None
            else np.array(np.broadcast_to(np.asarray(given, dtype=float), (steps, nu)), order="C")
        )
    except (TypeError, ValueError):
        raise SimulationError(f"inputs: expected numbers of shape ({steps}, {nu}) or ({nu},).") from None
    if not np.isfinite(u).all():
        raise SimulationError("inputs contain a value that is not finite: expected finite numbers.")
    return u


def _vector(given: Mapping[str, float] | ArrayLike, names: list[str], what: str) -> Array:
    if isinstance(given, Mapping):
        given = {name_of(n): value for n, value in given.items()}
        unknown = [n for n in given if n not in names]
        if unknown:
            raise SimulationError(f"{what} names {unknown[0]!r}: expected coordinates out of {', '.join(names)}.")
        given = [given.get(n, 0.0) for n in names]
    try:
        vector = np.array(given, dtype=float)
    except (TypeError, ValueError):
        raise SimulationError(f"{what} = {given!r}: expected {len(names)} numbers ({', '.join(names)}).") from None
    if vector.shape != (len(names),) or not np.isfinite(vector).all():
        raise SimulationError(f"{what} = {given!r}: expected {len(names)} finite numbers ({', '.join(names)}).")
    return vector


def _parameters(kernels: Kernels, changes: Mapping[str, float]) -> Array:
    values = kernels.parameters
    for symbol, value in changes.items():
        name = name_of(symbol)
        if name not in values:
            raise SimulationError(f"unknown parameter {name!r}: expected one of {', '.join(values)}.")
        if not isinstance(value, (int, float, np.number)) or not np.isfinite(value):
            raise SimulationError(f"parameter {name} = {value!r}: expected a finite number.")
        values[name] = float(value)
    missing = [n for n, value in values.items() if value is None]
    if missing:
        raise SimulationError(f"parameter {missing[0]} of model {kernels.name!r} has no value: set it in `parameters`.")
    return np.array([[float(v) for v in values.values() if v is not None]])
