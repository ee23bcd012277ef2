"""Parameters that a solver chooses together with the motion."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from dmoc.base.errors import ModelError
from dmoc.base.names import name_of
from dmoc.motion.impact_laws import IMPACT_LAWS, law_of
from dmoc.symbolic.continuous import FUNCTIONS, Continuous, as_tuple

if TYPE_CHECKING:
    from dmoc.symbolic.system import MechanicalSystem

# Functions that no motion depends on.
SHOWN = ("looks",)


def check_design(system: MechanicalSystem, f: Continuous, names: Sequence[str]) -> None:
    """Refuse to choose parameters that programs take as numbers, and those that nothing depends
    on."""
    parameters = dict(zip(map(name_of, system.parameters), f.par, strict=True))
    symbols = dict(zip(map(name_of, system.parameters), system.parameters, strict=True))
    of = {name: as_tuple(getattr(f, name)) for name in FUNCTIONS if name not in SHOWN}
    for name in names:
        s = parameters[name]
        for tangent, value in zip(system.tangents, of["e_t"], strict=False):
            if s in value.free_symbols:
                raise ModelError(
                    f"design parameter {name} is in the tangential restitution of {tangent!r}, "
                    "which the program takes as a number: give it a value in parameters."
                )
        for surface, value in zip(system.gaps, of["e"], strict=False):
            law = IMPACT_LAWS[law_of(surface, system.impact_laws, system.tangential_restitution)]
            if law.constant and s in value.free_symbols:
                raise ModelError(
                    f"design parameter {name} is in the restitution of {surface!r}, which is a "
                    f"number by {law.name}: give it a value in parameters."
                )
        free = set[object]().union(*(e.free_symbols for values in of.values() for e in values))
        if s not in free and symbols[name] not in system.objective.free_symbols:
            raise ModelError(
                f"design parameter {name}: nothing of the motion or its cost depends on it; leave "
                "it out."
            )
