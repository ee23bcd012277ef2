"""Where surfaces that have ends are, as a model says it, and surfaces of several pieces."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import sympy as sp
from sympy.core.function import AppliedUndef

from dmoc.base.arguments import shown
from dmoc.base.errors import ModelError
from dmoc.base.names import name_of
from dmoc.base.tolerances import SAME
from dmoc.symbolic.definitions import expanded
from dmoc.symbolic.expressions import slack_of
from dmoc.symbolic.kinks import KINKS

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


def check_jumps(system: MechanicalSystem) -> None:
    """Refuse gaps with a ``Piecewise`` that jumps where one piece ends."""
    for name, gap in system.gaps.items():
        for pieces in gap.atoms(sp.Piecewise):
            for (before, condition), (after, _) in pairwise(pieces.args):
                seam = _seam(condition, system)
                if seam and _differs(before - after, seam, system):
                    raise ModelError(
                        f"surface {name!r} jumps where {name_of(seam[0])} = {seam[1]}: give each "
                        "piece a surface of its own, and say with `within` where it is."
                    )


def _seam(condition: Any, system: MechanicalSystem) -> tuple[Any, Any] | None:
    """A coordinate and its value where a relation begins to hold; None where it is not linear in
    one."""
    if not isinstance(condition, sp.core.relational.Relational) or condition.has(*KINKS):
        return None
    edge = condition.lhs - condition.rhs
    if any(edge.diff(symbol).atoms(AppliedUndef) for symbol in edge.atoms(AppliedUndef)):
        return None
    edge = expanded(edge, system.definitions)
    for q in system.coordinates:
        slope = edge.diff(q)
        if slope != 0 and not slope.has(q):
            return q, sp.expand(q - edge / slope)
    return None


def _differs(off: Any, seam: tuple[Any, Any], system: MechanicalSystem) -> bool:
    """Whether an expression is not zero at an ordinary point of a seam."""
    known = {s: value for s, value in system.parameters.items() if value is not None}
    off = expanded(off, system.definitions).subs(*seam).subs(known)
    left = sorted(off.atoms(AppliedUndef) | off.free_symbols, key=str)
    value = off.subs({s: sp.Rational(31 + 7 * i, 53) for i, s in enumerate(left)}).evalf()
    return bool(value.is_number and abs(value) > SAME)
