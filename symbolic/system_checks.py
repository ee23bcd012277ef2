"""What makes a system one: its names, symbols, friction, kinks and masses are in order, or one
sentence says what is not."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import sympy as sp
from sympy.core.function import AppliedUndef
from sympy.physics.mechanics import dynamicsymbols

from dmoc.base.arguments import shown
from dmoc.base.errors import ModelError
from dmoc.base.names import (
    bounded_momentum,
    check_name,
    load_of,
    momentum_name,
    name_of,
    velocity_name,
)
from dmoc.symbolic.contact_references import check_forces, forces_of
from dmoc.symbolic.definitions import atoms_below, check_definitions, expanded, kinds_of
from dmoc.symbolic.drawing import values_of
from dmoc.symbolic.event_sums import check_event_terms, event_terms, hit_quantities
from dmoc.symbolic.expressions import (
    KINDS,
    approach_speed,
    atoms_of,
    coefficients_of,
    final_time,
    sliding_speed,
    unknown_symbol,
)
from dmoc.symbolic.grips import check_grips
from dmoc.symbolic.kinks import check_smooth, real_symbols, split
from dmoc.symbolic.mass_check import check_mass_matrix
from dmoc.symbolic.objectives import check_objective
from dmoc.symbolic.rest import check_damping
from dmoc.symbolic.restitution import (
    check_impact_laws,
    check_restitution,
    check_tangential_restitution,
)
from dmoc.symbolic.strengths import check_strengths
from dmoc.symbolic.surface_ends import check_jumps, check_within
from dmoc.symbolic.tangent_pairs import check_pairs, pairs_of

if TYPE_CHECKING:
    from dmoc.symbolic.system import MechanicalSystem

# What places and states are made of.
PLACE = ("coordinates", "the time", "parameters")
STATE = ("coordinates", "velocities", "the time", "parameters")
DEFINED = {
    "coordinates": ("definitions of places",),
    "velocities": ("velocities of definitions", "definitions of velocities"),
}


def check_parts(system: MechanicalSystem) -> None:
    """Raise ModelError where the parts of a system do not fit together."""
    check_definitions(system)
    check_restitution(system)
    check_tangential_restitution(system)
    check_pairs(system)
    check_impact_laws(system)
    check_forces(system)
    check_event_terms(system)
    check_grips(system)
    check_strengths(system)
    check_objective(system)
    check_within(system)
    check_jumps(system)
    _check_friction(system)
    _check_symbols(system)
    _check_kinks(system)
    check_switches(system)
    _check_rates(system)
    _check_momenta(system)
    check_mass_matrix(system)
    for what, kind, places in (
        ("surface", "a relation", system.gaps), ("constraint", "an equation", system.constraints),
    ):  # fmt: skip
        for name, place in places.items():
            moving = {*system.coordinates, *system.velocities}
            if not atoms_below(place, system.definitions) & moving:
                raise ModelError(
                    f"{what} {name!r} contains no coordinate: expected {kind} in "
                    f"{_listed(system.coordinates)}."
                )


def check_names(system: MechanicalSystem) -> None:
    """Raise ModelError unless all symbols are of their kinds and all names are distinct."""
    _check_kinds(system)
    symbols = {
        "coordinate": [name_of(q) for q in system.coordinates],
        "input": [name_of(u) for u in system.inputs],
        "parameter": [name_of(s) for s in system.parameters],
        "definition": [name_of(x) for x in system.definitions],
        "quantity": list(system.quantities),
        "load of a grip": [*map(load_of, map(str, system.strength))],
        "integral": list(system.integrals),
        "attitude": list(system.attitudes),
    }
    labels = {
        "surface": list(system.surfaces),
        "switch": list(system.switches),
        "path constraint": list(system.path_constraints),
        "constraint": list(system.constraints),
        "grip": list(system.grips),
        "tangent": [name for name in system.tangents if name not in system.surfaces],
    }
    for role, names in (symbols | labels).items():
        for name in names:
            check_name(name, role)
            if name == approach_speed.name and system.restitution:
                raise ModelError(
                    f"the {role} {name!r} has the name of the speed of a hit: choose another name."
                )
            if name == sliding_speed.name and system.tangents:
                raise ModelError(
                    f"the {role} {name!r} has the name of the speed in friction: choose another "
                    "name."
                )
            if name == "t":
                raise ModelError(f"the {role} 't' has the name of the time: choose another name.")
            if name == final_time.name and role == "integral":
                raise ModelError(
                    f"the integral {name!r} has the name of the final time: choose another name."
                )
            if name == "durations" and role in ("coordinate", "input"):
                raise ModelError(
                    f"the {role} 'durations' has the name of the times of the phases in a guess: "
                    "choose another name."
                )
    _check_distinct(labels)
    symbols["switch"] = labels["switch"]
    for x in symbols["definition"]:
        symbols[f"velocity of {x}"] = [velocity_name(x)]
    for q in symbols["coordinate"]:
        symbols[f"velocity of {q}"] = [velocity_name(q)]
        symbols[f"momentum of {q}"] = [momentum_name(q)]
    _check_distinct(symbols)


def _check_kinds(system: MechanicalSystem) -> None:
    """Refuse coordinates, inputs and parameters that are no symbols of their kind."""
    if not system.coordinates:
        raise ModelError(
            f"model {system.name!r} has no coordinates: give at least one dynamicsymbol."
        )
    for role in ("coordinate", "definition"):
        for q in getattr(system, f"{role}s"):
            if not _is_function_of_time(q):
                raise ModelError(
                    f"{role} {shown(q)} is not a function of time: make it with "
                    "sympy.physics.mechanics.dynamicsymbols."
                )
    for u in system.inputs:
        if not isinstance(u, sp.Symbol) and not _is_function_of_time(u):
            raise ModelError(f"input {shown(u)} is not a dynamicsymbol or a Symbol.")
    for symbol in system.parameters:
        if not isinstance(symbol, sp.Symbol):
            raise ModelError(f"parameter {shown(symbol)} is not a SymPy Symbol.")
        if symbol.is_extended_real is False or not symbol.is_commutative:
            raise ModelError(
                f"the symbol of parameter {symbol} is assumed not to be a real number: make it "
                f"as Symbol({symbol.name!r})."
            )


def _check_friction(system: MechanicalSystem) -> None:
    """Refuse friction without a tangent, a tangent without friction, and what is neither."""
    for name in system.friction:
        if name not in system.tangents:
            raise ModelError(
                f"{shown(name)} has friction but no tangent: give the tangential position of "
                f'its contact, as tangents={{"{name}": x}}.'
            )
    pairs = pairs_of(system)
    for name, tau in system.tangents.items():
        if name in pairs.values():
            continue
        if name not in system.friction and name not in system.tangential_restitution:
            raise ModelError(
                f"{shown(name)} has a tangent but no friction: give its coefficient mu, or, of "
                f'a rail, its largest force, as friction={{"{name}": 0.5}}; 0 for none.'
            )
        place = atoms_below(tau, system.definitions) & set(system.coordinates)
        if not place and name not in pairs:
            raise ModelError(
                f"the tangent of {name!r} contains no coordinate: expected a position along "
                f"the contact in {_listed(system.coordinates)}."
            )
        static, kinetic = coefficients_of(system.friction.get(name, sp.S.Zero))
        if static.free_symbols & {sliding_speed}:
            raise ModelError(
                f"the static friction of {name!r} contains dmoc.sliding_speed, which is 0 where it "
                "sticks: expected it in the second of the pair alone."
            )
        at_rest, slope = (e.subs(sliding_speed, 0) for e in (kinetic, kinetic.diff(sliding_speed)))
        for what, value in (("value", at_rest), ("slope", slope)):
            if value.has(sp.nan, sp.zoo, sp.oo, -sp.oo):
                raise ModelError(
                    f"the friction of {name!r}, {shown(kinetic)}, has no finite {what} at a "
                    "sliding speed of 0, from which it begins to slide: state an expression that "
                    "has one."
                )
        for value in (static, at_rest):
            if value.is_number and value < 0:
                raise ModelError(
                    f"the friction of {name!r} is {shown(value)}: expected 0 or a positive number."
                )
        if static.is_number and at_rest.is_number and static < at_rest:
            raise ModelError(
                f"the static friction of {name!r} is {shown(static)}, below the kinetic one, "
                f"{shown(at_rest)}: expected a pair (static, kinetic) with the larger one first."
            )


def _check_symbols(system: MechanicalSystem) -> None:
    """Refuse symbols where they do not belong, and those that are listed and used nowhere."""
    kinds = {
        "coordinates": set(system.coordinates),
        "velocities": set(system.velocities),
        "inputs": set(system.inputs),
        "the time": {dynamicsymbols._t},
        "parameters": set(system.parameters),
        "the approach speed": {approach_speed} if system.restitution else set(),
        "the sliding speed": {sliding_speed} if system.friction else set(),
        "forces": set(forces_of(system)),
    } | kinds_of(system)
    terms = *event_terms(system), *hit_quantities(system)
    of_hits = (atoms_of(term.value) for term in terms)
    used: set[Any] = set(system.objective.free_symbols).union(*of_hits)
    for where, expression, allowed in _expressions(system):
        atoms = atoms_of(expression)
        used |= atoms
        permitted = [kinds[kind] for kind in allowed]
        permitted += [kinds[own] for kind in allowed for own in DEFINED.get(kind, ())]
        for symbol in sorted(atoms.difference(*permitted), key=str):
            if name_of(symbol) in system.quantities:
                raise ModelError(
                    f"{where} contains {symbol}, which has the name of a quantity: write its "
                    "expression instead."
                )
            raise ModelError(unknown_symbol(symbol, where, kinds, allowed))
    for symbol in system.parameters:
        if symbol not in used:
            raise ModelError(
                f"parameter {symbol} is used nowhere in model {system.name!r}: remove it or use it."
            )
    acts = (*system.forces.values(), *system.friction.values())
    in_forces: set[Any] = set().union(*map(atoms_of, acts))
    for u in system.inputs:
        if u not in in_forces:
            raise ModelError(
                f"input {name_of(u)} appears in no force of model {system.name!r}: remove it or "
                "use it."
            )


def _expressions(system: MechanicalSystem) -> Iterator[tuple[str, Any, tuple[str, ...]]]:
    """Names of the expressions of a system, with these, and the kinds of symbols that belong
    there."""
    for x, e in system.definitions.items():
        yield f"definition {name_of(x)}", e, STATE
    yield "the Lagrangian", system.lagrangian, STATE
    yield "the cost", system.cost, KINDS
    yield "the dissipation", system.dissipation, STATE
    yield "the terminal cost", system.terminal_cost, STATE
    ends = {name: sp.Tuple(*w) for name, w in system.inside.items()}
    in_space = {n for pair in pairs_of(system).items() for n in pair}
    of_pairs = {name: tau for name, tau in system.tangents.items() if name in in_space}
    others = {name: tau for name, tau in system.tangents.items() if name not in in_space}
    for what, expressions, allowed in (
        ("the force on {}", {name_of(q): e for q, e in system.forces.items()}, KINDS),
        ("an end of surface {!r}", ends, PLACE),
        ("surface {!r}", {name: system.gaps[name] for name in system.surfaces}, PLACE),
        ("path constraint {!r}", system.path_functions, KINDS),
        ("constraint {!r}", system.constraints, STATE),
        ("grip {!r}", {n: sp.Tuple(*parts) for n, parts in system.grips.items()}, STATE),
        ("the strength of {!r}", system.strength, ("parameters",)),
        ("the tangent of {!r}", others, PLACE),
        ("the tangential direction {!r}", of_pairs, STATE),
        ("the friction of {!r}", system.friction, (*PLACE, "inputs", "the sliding speed")),
        ("the restitution of {!r}", system.restitution, (*PLACE, "the approach speed")),
        ("quantity {!r}", system.quantities_along, (*KINDS, "forces")),
        ("the tangential restitution of {!r}", system.tangential_restitution, ("parameters",)),
        ("integral {!r}", system.integrands, KINDS),
        ("switch {!r}", system.switches, STATE),
    ):
        for name, expression in expressions.items():
            yield what.format(name), expression, allowed
    for part in system.shapes:
        for expression in values_of(part):
            yield f"a {type(part).__name__} of the drawing", expression, PLACE


def _check_momenta(system: MechanicalSystem) -> None:
    """Refuse quantities with the names of bounded momenta that are none."""
    for q, v in zip(map(name_of, system.coordinates), system.velocities, strict=True):
        value = system.quantities.get(bounded_momentum(q))
        if value is None:
            continue
        momentum = expanded(system.lagrangian, system.definitions).diff(v)
        if sp.expand(expanded(value, system.definitions) - momentum) != 0:
            raise ModelError(
                f"quantity {bounded_momentum(q)!r} has the name of the momentum of {q} along the "
                "way and is not its derivative of the Lagrangian: choose another name."
            )


def _check_kinks(system: MechanicalSystem) -> None:
    """Refuse functions that jump, and kinks that cannot be split into smooth functions."""
    check_smooth(system.lagrangian, "the Lagrangian")
    check_smooth(system.dissipation, "the dissipation")
    real, _ = real_symbols(system)
    check_damping(system.dissipation.xreplace(real), [real[v] for v in system.velocities])
    check_smooth(system.terminal_cost, "the terminal cost", kinks=True)
    for name, place in system.constraints.items():
        check_smooth(place, f"constraint {name!r}", kinks=True)
    for name, value in system.quantities_along.items():
        check_smooth(value, f"quantity {name!r}", kinks=True)
    for name, mu in system.friction.items():
        check_smooth(mu, f"the friction of {name!r}", kinks=True)
    for q, force in system.forces.items():
        check_smooth(force, f"the force on {name_of(q)}")
    split(system)


def _check_rates(system: MechanicalSystem) -> None:
    """Refuse constraints of velocities that are not linear in them: no impulse along dc/dv keeps
    the others."""
    for name, constraint in system.constraints.items():
        c = expanded(constraint, system.definitions)
        for v in system.velocities:
            if any(sp.expand(c.diff(v, w)).equals(0) is False for w in system.velocities):
                raise ModelError(
                    f"constraint {name!r} is not linear in the velocity {name_of(v)}: give it as "
                    "velocities times functions of the coordinates and the time, or hold a place."
                )


def _is_function_of_time(symbol: Any) -> bool:
    return isinstance(symbol, AppliedUndef) and symbol.args == (dynamicsymbols._t,)


def _check_distinct(roles: dict[str, list[str]]) -> None:
    """Refuse a name that stands for two things; ``roles`` are the names of each kind of thing."""
    role_of: dict[str, str] = {}
    for role, names in roles.items():
        for name in names:
            if name in role_of:
                raise ModelError(
                    f"the name {name!r} is used twice, as {role_of[name]} and as {role}: rename "
                    "one."
                )
            role_of[name] = role


def _listed(symbols: Sequence[Any]) -> str:
    return ", ".join(name_of(s) for s in symbols)


def check_switches(system: MechanicalSystem) -> None:
    """Refuse switches that do not change along a motion, and functions that jump."""
    moving = {*system.coordinates, *system.velocities, dynamicsymbols._t}
    for name, w in system.switches.items():
        check_smooth(w, f"switch {name!r}", kinks=True)
        if not atoms_below(w, system.definitions) & moving:
            raise ModelError(
                f"switch {name!r} contains no coordinate, no velocity and no time: expected an "
                "expression that vanishes at its event, such as x - 1."
            )
