"""Equations of motion by SymPy that share no code with dmoc: M q'' = F(q, q', u, t) with
M = d^2 L/dq'^2 and F = Q + dL/dq - (d^2 L/dq' dq) q' - d^2 L/dq' dt."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

# Times of the nodes, inputs at the start and at the end of each step: linear in between.
Inputs = tuple[np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Description:
    """A mechanical system in SymPy's terms alone: what dmoc and the simulation are given."""

    name: str
    coordinates: Sequence[Any]
    inputs: Sequence[Any]
    lagrangian: Any
    forces: Mapping[Any, Any]
    surfaces: Mapping[str, Any]
    parameters: Mapping[Any, float]
    tangents: Mapping[str, Any] = field(default_factory=dict)
    friction: Mapping[str, Any] = field(default_factory=dict)
    path_constraints: Mapping[str, Any] = field(default_factory=dict)


class Mechanism:
    """Numeric equations of motion of a description; ``par`` is the row of parameter
    values in its order."""

    def __init__(self, system: Description) -> None:
        t = dynamicsymbols._t
        rates = [c.diff(t) for c in system.coordinates]
        q, v, u = (
            sp.symbols(f"{letter}:{n}")
            for letter, n in (("q_", len(rates)), ("v_", len(rates)), ("u_", len(system.inputs)))
        )
        tau, names = sp.Symbol("tau_time"), [*system.coordinates, *system.inputs]

        def plain(expression: Any) -> Any:
            e = sp.sympify(expression).subs(dict(zip(rates, v, strict=True)))
            return e.subs(dict(zip(names, [*q, *u], strict=True))).subs(t, tau)

        lagrangian = plain(system.lagrangian)
        momenta = sp.Matrix([lagrangian.diff(s) for s in v])
        Q = sp.Matrix([plain(system.forces.get(c, 0)) for c in system.coordinates])
        slope = sp.Matrix([lagrangian.diff(s) for s in q])
        force = Q + slope - momenta.jacobian(q) * sp.Matrix(v) - momenta.diff(tau)
        self.surfaces = list(system.surfaces)
        par = list(system.parameters)
        state = [*q, *v, *u, tau, *par]
        self.nq = len(rates)
        self._motion = _numeric(state, [*momenta.jacobian(v), *force])
        self._momenta = _numeric(state, list(momenta))

    def motion(
        self, q: np.ndarray, v: np.ndarray, u: np.ndarray, t: float, par: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Mass matrix and force."""
        values = np.array(self._motion(*q, *v, *u, t, *par), dtype=float)
        return values[: self.nq**2].reshape(self.nq, self.nq), values[self.nq**2 :]

    def velocity(
        self, q: np.ndarray, p: np.ndarray, u: np.ndarray, t: float, par: np.ndarray
    ) -> np.ndarray:
        """Velocity of a momentum; p = M v + what the Lagrangian has linear in v."""
        rest = np.zeros(self.nq)
        offset = np.array(self._momenta(*q, *rest, *u, t, *par), dtype=float)
        return np.linalg.solve(self.motion(q, rest, u, t, par)[0], p - offset)


def _numeric(arguments: list[Any], results: list[Any]) -> Callable[..., list[float]]:
    function: Callable[..., list[float]] = sp.lambdify(arguments, results, modules="math", cse=True)
    return function
