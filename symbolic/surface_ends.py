"""Where surfaces that have ends are, as a model says it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import sympy as sp

from dmoc.base.arguments import shown
from dmoc.base.errors import ModelError
from dmoc.symbolic.expressions import slack_of

if TYPE_CHECKING:
    from dmoc.symbolic.system import MechanicalSystem


def joined(value: Any) -> tuple[Any, ...]:
    """Relations that all hold: one, several, or one that joins several with ``&``."""
    every = value if isinstance(value, (list, tuple)) else (value,)
    return tuple(
        part
        for r in every
        for part in (sorted(r.args, key=sp.default_sort_key) if isinstance(r, sp.And) else [r])
    )


def inside_of(system: MechanicalSystem) -> dict[str, tuple[Any, ...]]:
    """Functions w(q, t) >= 0 where a surface that has ends is, by its name."""
    return {
        name: tuple(slack_of(r, f"an end of surface {name!r}") for r in relations)
        for name, relations in system.within.items()
    }


def check_within(system: MechanicalSystem) -> None:
    """Refuse ends of what is no surface, and no ends of one that is said to have some."""
    for name, relations in system.within.items():
        if name not in system.surfaces:
            raise ModelError(
                f"within says where {shown(name)} is, which is no surface: expected one of "
                f"{', '.join(system.surfaces) or 'none, as the model has none'}."
            )
        if not relations:
            raise ModelError(
                f"within says nothing of surface {name!r}: give relations such as (x >= 0, x <= "
                "1), or leave it out."
            )
