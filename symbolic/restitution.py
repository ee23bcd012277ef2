"""Laws of impact that a system states: coefficients of restitution as expressions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import sympy as sp

from dmoc.base.arguments import shown
from dmoc.base.errors import ModelError
from dmoc.symbolic.continuous import Continuous, dot, gap_rates
from dmoc.symbolic.expressions import approach_speed
from dmoc.symbolic.graph import Node
from dmoc.symbolic.kernel_family import family, state_inputs
from dmoc.symbolic.kinks import check_smooth
from dmoc.symbolic.spec import Input, KernelSpec

if TYPE_CHECKING:
    from dmoc.symbolic.system import MechanicalSystem


def check_restitution(system: MechanicalSystem) -> None:
    """Refuse a restitution of what is no surface, one that jumps or has kinks, and a number that
    creates energy."""
    for name, e in system.restitution.items():
        if name not in system.surfaces:
            raise ModelError(
                f"{shown(name)} has a restitution but is no surface: expected one of "
                f"{', '.join(system.surfaces) or 'none, the model has no surfaces'}."
            )
        check_smooth(e, f"the restitution of {name!r}", kinks=True)
        if e.is_number and not 0 <= e <= 1:
            raise ModelError(
                f"the restitution of {name!r} is {shown(e)}: expected a number from 0 (plastic) to "
                "1 (elastic), or an expression in dmoc.approach_speed and parameters."
            )


def laws_in_words(system: MechanicalSystem) -> dict[str, str]:
    """The expressions by surface, as they are shown."""
    return {name: sp.sstr(e) for name, e in system.restitution.items()}


def rebound_kernels(f: Continuous) -> list[KernelSpec]:
    """Kernels of the restitution e(q, gamma, t) that a system states, zero for other surfaces."""
    if not f.e:
        return []
    q, v, _, t, par = state_inputs(f)
    lam = Input.vector(f.L.graph, "lam", len(f.g))
    rates = gap_rates(f)
    values = coefficients(f, rates)
    kept = [a * e for a, e in zip(lam.symbols, values, strict=True)]
    return family(
        "rebound",
        "Rates of the gaps before an impact times coefficients of restitution, gamma_j e_j, and "
        "impulses times these coefficients; the sum of impulses times both.",
        (q, v, lam, t),
        {
            "gamma_e": [e * rate for e, rate in zip(values, rates, strict=True)],
            "P_e": kept,
            "W_e": [dot(kept, rates)],
        },
        par,
    )


def coefficients(f: Continuous, rates: list[Any]) -> list[Node]:
    """The coefficients of restitution at the rates of the gaps, as nodes."""
    speed = f.L.graph.symbol(approach_speed.name)
    return [e.subs({speed: rate}) for e, rate in zip(f.e, rates, strict=True)]
