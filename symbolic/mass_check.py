"""Masses of a system: positive, free of velocities, and not singular everywhere."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import mpmath
import sympy as sp

from dmoc.base.errors import GenerationError, ModelError
from dmoc.base.names import name_of
from dmoc.base.tolerances import LARGEST_PARAMETER
from dmoc.symbolic.continuous import readable
from dmoc.symbolic.expressions import atoms_of
from dmoc.symbolic.graph import Graph, GraphNode, reverse
from dmoc.symbolic.traversal import evaluated

if TYPE_CHECKING:
    from dmoc.symbolic.system import MechanicalSystem

DIGITS = 30  # in which it is seen whether a mass matrix is singular


def check_mass_matrix(system: MechanicalSystem) -> None:
    """Refuse masses that are singular, that depend on velocities or that no float takes."""
    f, graph = readable(system), Graph()
    parts = (f.L, *f.x_of)
    constants = {c: graph.symbol(f"constant {i}") for i, c in enumerate(_constants(parts))}
    with mpmath.workdps(DIGITS):
        exact = {node: mpmath.mpf(c.evalf(DIGITS)) for c, node in constants.items()}
    try:
        (lagrangian,) = f.as_nodes([f.L], graph, constants)
    except GenerationError:  # what has no numbers is refused when it is built
        return
    v = [graph.symbol(s.name) for s in f.v]
    mass = [[p.diff(s) for s in v] for p in reverse(lagrangian, v)]
    for q, row in zip(system.coordinates, mass, strict=True):
        if all(entry is graph.zero for entry in row):
            raise ModelError(
                f"the kinetic energy does not contain the velocity of coordinate {name_of(q)}: "
                "the mass matrix would be singular; give the coordinate inertia or remove it."
            )
    entries = [entry for row in mass for entry in row]
    for entry in entries:
        if entry is graph.zero or entry.free_symbols - set(exact):
            continue
        (value,) = evaluated([entry], exact, mpmath)
        if not 1 / LARGEST_PARAMETER <= abs(value) <= LARGEST_PARAMETER:
            raise ModelError(
                f"the mass matrix of model {system.name!r} contains {mpmath.nstr(value, 6)}: "
                "expected masses from 1e-100 to 1e100; use other units."
            )
    # What depends on velocities may have to be expanded to be seen not to.
    if any(entry.free_symbols & set(v) for entry in entries) and any(
        atoms_of(sp.expand(entry)) & set(system.velocities) for entry in system.mass_matrix
    ):
        raise ModelError(
            "the kinetic energy is not quadratic in the velocities: the mass matrix depends on "
            "them."
        )
    if _is_singular(mass, exact):
        names = ", ".join(map(name_of, system.coordinates))
        raise ModelError(
            f"the mass matrix of model {system.name!r} is singular (its determinant is zero "
            f"everywhere): the coordinates {names} are not independent, or one lacks inertia."
        )


def _constants(expressions: Sequence[Any]) -> list[Any]:
    """The constants of expressions that a float would round."""
    constants: dict[Any, None] = {}
    parts = sp.preorder_traversal(expressions)
    for part in parts:
        if isinstance(part, sp.Expr) and part.is_number:
            parts.skip()
            if not part.is_Integer and part.is_extended_real:
                constants[part] = None
    return list(constants)


def _is_singular(mass: list[list[GraphNode]], constants: Mapping[GraphNode, Any]) -> bool:
    """Tell whether M is singular at several fixed generic points, hence everywhere."""
    entries = [entry for row in mass for entry in row]
    symbols = entries[0].graph.symbols
    for shift in (0.0, 1.7, 4.1):
        with mpmath.workdps(DIGITS):
            point = {
                s: mpmath.mpf(0.4 + (0.618033988749895 * (i + 1) + shift) % 1.0)
                for i, s in enumerate(symbols)
            } | dict(constants)
            matrix = mpmath.matrix(len(mass))
            try:
                values = evaluated(entries, point, mpmath)
            except (TypeError, ZeroDivisionError):  # a condition, or a value, is not real there
                return False
            for k, value in enumerate(values):
                matrix[k // len(mass), k % len(mass)] = value
            # What is singular in one set of units is so in all of them.
            scale = mpmath.fprod(abs(matrix[i, i]) for i in range(len(mass)))
            scale = scale or max(map(abs, matrix)) ** len(mass)
            determinant = abs(mpmath.det(matrix))
            if mpmath.isfinite(determinant) and determinant > scale * 1e-20:
                return False
    return True
