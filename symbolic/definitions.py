"""Symbols that stand for expressions of places and velocities: what they may be, what they are made
of, and their rates."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from dmoc.base.errors import ModelError
from dmoc.base.names import name_of
from dmoc.symbolic.called import CalledFunction
from dmoc.symbolic.expressions import atoms_of
from dmoc.symbolic.graph import SUM, GraphNode
from dmoc.symbolic.kinks import KINKS, check_smooth
from dmoc.symbolic.traversal import reached

if TYPE_CHECKING:
    from dmoc.symbolic.system import MechanicalSystem


# The fields of a system that contain definitions, but for the drawing.
EXPRESSIONS = (
    "lagrangian", "forces", "dissipation", "surfaces", "tangents", "cost", "terminal_cost",
    "constraints", "path_constraints", "quantities", "integrals", "within",
)  # fmt: skip
WITH_KINKS = ("surfaces", "path_constraints")  # of them, those whose definitions may have kinks


def rate_symbol(function: Any) -> Any:
    """The derivative of a function of time."""
    return function.diff(dynamicsymbols._t)


def _function(atom: Any) -> Any:
    """An atom, or the function of which it is a derivative."""
    return atom.expr if isinstance(atom, sp.Derivative) else atom


def symbols_of(definitions: Iterable[Any]) -> set[Any]:
    """Definitions and their rates."""
    return {s for x in definitions for s in (x, rate_symbol(x))}


def check_definitions(system: MechanicalSystem) -> None:
    """Raise ModelError for definitions that contain themselves, what is defined after them, or a
    kink where one is of no use."""
    later = set(system.definitions)
    for symbol, value in system.definitions.items():
        where = f"definition {name_of(symbol)}"
        for atom in sorted(map(_function, atoms_of(value)), key=str):
            if atom == symbol:
                raise ModelError(f"{where} contains itself: expected what is defined before it.")
            if atom in later:
                raise ModelError(
                    f"{where} contains {name_of(atom)}, which is defined after it: put "
                    f"{name_of(atom)} before {name_of(symbol)}."
                )
        check_smooth(value, where)
        later.remove(symbol)
    _check_kinks(system)


def _check_kinks(system: MechanicalSystem) -> None:
    """Refuse definitions with kinks in what is no distance: what splits kinks does not see them."""
    bent: set[Any] = set()
    for symbol, value in system.definitions.items():
        if value.has(*KINKS, CalledFunction) or atoms_of(value) & bent:
            bent |= {symbol, rate_symbol(symbol)}
    for field in EXPRESSIONS if bent else ():
        if field in WITH_KINKS:
            continue
        for atom in sorted(set().union(*map(atoms_of, _flat(getattr(system, field)))), key=str):
            if atom in bent:
                raise ModelError(
                    f"the {field.replace('_', ' ')} of model {system.name!r} contains "
                    f"{name_of(_function(atom))}, a definition with a kink, which may stand in "
                    "surfaces and path constraints alone: write it out there."
                )


def _flat(values: Any) -> Iterator[Any]:
    """The expressions of a field."""
    if isinstance(values, Mapping):
        values = tuple(values.values())
    if isinstance(values, tuple):
        for value in values:
            yield from _flat(value)
    else:
        yield values


def kinds_of(system: MechanicalSystem) -> dict[str, set[Any]]:
    """The symbols of definitions by what they are."""
    velocities = {*system.velocities, *map(rate_symbol, system.definitions)}
    fast: set[Any] = set()
    for symbol, value in system.definitions.items():
        if atoms_of(value) & (velocities | fast):
            fast.add(symbol)
    places = set(system.definitions) - fast
    return {
        "definitions of places": places,
        "velocities of definitions": set(map(rate_symbol, places)),
        "definitions of velocities": fast,
    }


def atoms_below(expression: Any, definitions: Mapping[Any, Any]) -> set[Any]:
    """The atoms of an expression, and those that its definitions and their rates are made of."""
    atoms: set[Any] = set()
    waiting = atoms_of(expression)
    while waiting:
        atoms |= waiting
        below = (atoms_of(definitions[x]) for x in map(_function, waiting) if x in definitions)
        waiting = set().union(*below) - atoms
    return atoms


def expanded(expression: Any, definitions: Mapping[Any, Any]) -> Any:
    """The expression without definitions, whose size may double with each of them."""
    below = atoms_below(expression, definitions) if definitions else ()
    table: dict[Any, Any] = {}
    for symbol, value in definitions.items():
        rate = rate_symbol(symbol)
        if symbol in below or rate in below:
            table[symbol] = value.xreplace(table)
            table[rate] = rate_symbol(table[symbol])
    return expression.xreplace(table)


def written_out(system: MechanicalSystem) -> MechanicalSystem:
    """The system without definitions, and without its drawing."""

    def each(values: Any) -> Any:
        if isinstance(values, Mapping):
            return {key: each(value) for key, value in values.items()}
        if isinstance(values, tuple):
            return tuple(map(each, values))
        return expanded(values, system.definitions)

    fields = {name: each(getattr(system, name)) for name in EXPRESSIONS}
    return replace(system, definitions={}, drawing=(), **fields)


def rate_of(node: GraphNode, rates: dict[GraphNode, GraphNode]) -> GraphNode:
    """The derivative of a node along the motion; ``rates`` are those of symbols, and of all nodes
    once they are asked for."""
    g = node.graph
    for n in reached([node]):
        if n not in rates:
            slopes = n.parts if n.kind == SUM else n.partials()
            moving = ((rates[part], slope) for part, slope in slopes if rates[part] is not g.zero)
            rates[n] = g.sum((rate * slope, 1.0) for rate, slope in moving)
    return rates[node]
