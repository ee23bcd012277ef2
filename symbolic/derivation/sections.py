"""The derivation of a system, step by step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import sympy as sp

from dmoc.base.discretisation import DISCRETISATIONS, known_order
from dmoc.base.names import name_of, velocity_name
from dmoc.symbolic.continuous import Continuous, readable
from dmoc.symbolic.definitions import written_out
from dmoc.symbolic.derivation.continuous_sections import continuous_sections, minimal_time_section
from dmoc.symbolic.derivation.discrete_sections import (
    collision_sections,
    cost_sections,
    derivative_sections,
    discrete_sections,
    inner_nodes,
)
from dmoc.symbolic.derivation.document import Derivation
from dmoc.symbolic.derivation.structure import (
    NamedStructure,
    is_large,
    pattern_sections,
    structure_sections,
    with_names,
)
from dmoc.symbolic.derivation.symbols import MARK, DisplayNames
from dmoc.symbolic.discrete import StepElement, step_element
from dmoc.symbolic.system import MechanicalSystem, check_system


def derive(system: MechanicalSystem, order: int = 2, expanded: bool = False) -> Derivation:
    """Derive a system; see :func:`dmoc.derive`."""
    check_system(system)
    order = known_order(order)
    if expanded and system.definitions:
        system = written_out(system)
    f = readable(system)
    names = DisplayNames.beside(system)
    if expanded or not is_large(f):
        element = _readable_element(system, order, names, lambda f: f)
        sections = [
            *continuous_sections(system, f, names),
            *discrete_sections(system, element, names),
            *collision_sections(system, f, element, names),
            *cost_sections(system, f, element, names),
            *minimal_time_section(system, f, names),
            *derivative_sections(element, names),
        ]
    else:
        structure = NamedStructure.of(system, f, names)
        element = _readable_element(system, order, names, structure.opaque)
        in_names = (
            *discrete_sections(system, element, names),
            *collision_sections(system, structure.opaque(f), element, names),
            *cost_sections(system, f, element, names),
        )
        sections = [
            *structure_sections(structure),
            *with_names(in_names),
            *pattern_sections(structure, order, element),
        ]
    if names.marked:
        note = (
            f" {', '.join(names.marked)} with {MARK} are quantities of the derivation: the name "
            "without it is taken."
        )
        sections[0] = replace(sections[0], text=sections[0].text + note)
    return Derivation(f"Derivation of the model {system.name}", tuple(sections))


def _readable_element(
    system: MechanicalSystem,
    order: int,
    own: DisplayNames,
    shown: Callable[[Continuous], Continuous],
) -> StepElement:
    """The step element in symbols with the user's names: alpha_k, alpha_kp1, alpha_m (midpoint)
    or alpha_1, alpha_2, F_k, F_kp1, h; of the functions that are shown."""
    names = [name_of(q) for q in system.coordinates]
    inputs = [name_of(u) for u in system.inputs]
    table = {
        f"{part}_{i}": f"{n}_{part[2:]}" for part in ("q_k", "q_kp1") for i, n in enumerate(names)
    }
    inner = [f"{n}_{tag}" for tag in inner_nodes(DISCRETISATIONS[order].inside) for n in names]
    table |= {f"q_i_{i}": name for i, name in enumerate(inner)}
    table |= {
        f"{part}_{i}": f"{n}_{part[2:]}" for part in ("u_k", "u_kp1") for i, n in enumerate(inputs)
    }

    def point(name: str) -> Any:
        return own.symbol(f"{name}_m", "midpoint") if order == 2 else sp.Symbol(name)

    defined = [name_of(x) for x in system.definitions]
    f = Continuous.of(
        system,
        [point(n) for n in names],
        [point(velocity_name(n)) for n in names],
        [own.symbol(f"{n}_free", "input") for n in inputs],
        point("t"),
        list(system.parameters),
        [point(n) for n in defined],
        [point(velocity_name(n)) for n in defined],
    )
    return step_element(
        shown(f), order, lambda name: own.symbol(table.get(name, name), name), sp.sympify
    )
