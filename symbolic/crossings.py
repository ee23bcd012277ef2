"""Functions w(q, q', t) of a model whose zeros are events: its switches."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from sympy.physics.mechanics import dynamicsymbols

from dmoc.base.errors import ModelError
from dmoc.symbolic.definitions import atoms_below
from dmoc.symbolic.kinks import check_smooth

if TYPE_CHECKING:
    from dmoc.symbolic.system import MechanicalSystem


def crossings_of(system: MechanicalSystem) -> dict[str, Any]:
    """All crossing functions by name, in the order of the kernels."""
    return dict(system.switches)


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
