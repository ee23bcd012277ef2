"""Forces of contacts and constraints by name, in the expressions of a model."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import sympy as sp
from sympy.core.function import AppliedUndef
from sympy.physics.mechanics import dynamicsymbols

from dmoc.base.errors import ModelError
from dmoc.base.signatures import public
from dmoc.symbolic.expressions import reference
from dmoc.symbolic.grips import names_of_places

if TYPE_CHECKING:
    from dmoc.symbolic.system import MechanicalSystem

NORMAL, TRACTION, REACTION = "normal", "traction", "reaction"
KINDS = {NORMAL: "surface", TRACTION: "tangent", REACTION: "constraint"}


@public(ModelError)
def normal(surface: str) -> Any:
    """The normal force N >= 0 of a contact in newton, in a quantity; zero while it is open.

    Parameters
    ----------
    surface : str
        One of the ``surfaces`` of the model.

    Returns
    -------
    Expr

    Raises
    ------
    ModelError
        If it is no name.

    Examples
    --------
    >>> import dmoc
    >>> dmoc.normal("left") + dmoc.normal("right")
    normal(left) + normal(right)
    """
    return reference(NORMAL, surface, "a surface", "floor")


@public(ModelError)
def traction(tangent: str) -> Any:
    """The friction force T of a contact or a rail in newton, in a quantity: T grad tau acts on the
    coordinates; zero while nothing rubs.

    Parameters
    ----------
    tangent : str
        One of the ``tangents`` of the model.

    Returns
    -------
    Expr

    Raises
    ------
    ModelError
        If it is no name.

    Examples
    --------
    >>> import dmoc
    >>> 0.3 * dmoc.normal("floor") - dmoc.traction("floor")
    0.3*normal(floor) - traction(floor)
    """
    return reference(TRACTION, tangent, "a tangent", "floor")


@public(ModelError)
def reaction(constraint: str) -> Any:
    """The force R of a constraint of the model, in a quantity: R grad phi acts on the coordinates,
    R dc/dv of a constraint c of velocities; or that of a grip, zero while it is open.

    Parameters
    ----------
    constraint : str
        One of the ``constraints`` of the model, or the place of one of its ``grips``: ``"hand"``,
        or ``"hand_1"`` where it has several.

    Returns
    -------
    Expr

    Raises
    ------
    ModelError
        If it is no name.

    Examples
    --------
    >>> import dmoc
    >>> -dmoc.reaction("rod")
    -reaction(rod)
    """
    return reference(REACTION, constraint, "a constraint", "rod")


def forces_of(system: MechanicalSystem) -> dict[Any, str]:
    """The forces of all contacts, tangents and constraints, in the order of y, and their names."""
    kinds = (
        (normal, "N", system.surfaces),
        (reaction, "N", [n for names in names_of_places(system.grips).values() for n in names]),
        (traction, "T", system.tangents),
        (reaction, "R", system.constraints),
    )
    return {make(name): f"{letter}_{name}" for make, letter, names in kinds for name in names}


def forces_in(expression: Any) -> list[Any]:
    """The forces that an expression contains."""
    parts = (p for p in expression.atoms(AppliedUndef) if p.args != (dynamicsymbols._t,))
    return sorted((p for p in parts if p.func.__name__ in KINDS), key=str)


def has_forces(system: MechanicalSystem) -> bool:
    """Whether a quantity contains forces."""
    return any(forces_in(e) for e in system.quantities_along.values())


def check_forces(system: MechanicalSystem) -> None:
    """Refuse forces of what the model has not."""
    forces = forces_of(system)
    for name, value in system.quantities.items():
        for part in forces_in(value):
            if part not in forces:
                what = KINDS[part.func.__name__]
                names = [str(f.args[0]) for f in forces if f.func == part.func]
                raise ModelError(
                    f"quantity {name!r} contains {part}: expected the name of a {what} of the "
                    f"model, one of {', '.join(names) or 'none'}."
                )


def symbols_of_forces(system: MechanicalSystem, name: str) -> list[Any]:
    """Symbols y = (a | N | T | R) of a model whose quantities contain forces; else none."""
    count = len(system.coordinates) + len(forces_of(system)) if has_forces(system) else 0
    return [sp.Symbol(f"{name}_{i}", real=True) for i in range(count)]
