"""Strengths of grips: forces beyond which they let go by themselves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from dmoc.base.arguments import shown
from dmoc.base.errors import ModelError
from dmoc.base.names import load_of
from dmoc.symbolic.contact_references import reaction
from dmoc.symbolic.grips import names_of_places
from dmoc.symbolic.kernel_family import state_inputs
from dmoc.symbolic.spec import KernelSpec, Output

if TYPE_CHECKING:
    from dmoc.symbolic.continuous import Continuous
    from dmoc.symbolic.system import MechanicalSystem


def loads_of(system: MechanicalSystem) -> dict[str, Any]:
    """The loads R^2/F^2 of the grips that have a strength F, as quantities, by their names."""
    places = names_of_places(system.grips)
    return {
        load_of(name): sum(reaction(place) ** 2 for place in places[name]) / strength**2
        for name, strength in system.strength.items()
    }


def strength_kernels(f: Continuous, strengths: Sequence[Any]) -> list[KernelSpec]:
    """The kernel of the strengths of the grips that have one."""
    if not strengths:
        return []
    out = (Output.vector("F", strengths),)
    text = "Forces beyond which grips let go."
    return [KernelSpec("strength", text, (state_inputs(f)[-1],), out)]


def check_strengths(system: MechanicalSystem) -> None:
    """Refuse strengths of what is no grip, and those that are not positive."""
    for name, value in system.strength.items():
        if name not in system.grips:
            raise ModelError(
                f"{shown(name)} has a strength but is no grip of the model: expected one of "
                f"{', '.join(system.grips) or 'none'}."
            )
        if value.is_number and not value > 0:
            raise ModelError(
                f"the strength of grip {name!r} is {shown(value)}: expected a positive force; "
                "leave it out where the grip holds everything."
            )
