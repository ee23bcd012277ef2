"""Laws of impact that a system states: coefficients of restitution as expressions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from dmoc.base.arguments import shown
from dmoc.base.errors import ModelError
from dmoc.motion.impact_laws import BALL, IMPACT_LAWS, RETURNING
from dmoc.symbolic.continuous import Continuous, dot, gap_rates
from dmoc.symbolic.expressions import approach_speed
from dmoc.symbolic.graph import GraphNode
from dmoc.symbolic.kernel_family import family, state_inputs
from dmoc.symbolic.kinks import check_smooth
from dmoc.symbolic.spec import Input, KernelSpec, Output

if TYPE_CHECKING:
    from dmoc.symbolic.system import MechanicalSystem


def check_restitution(system: MechanicalSystem) -> None:
    """Refuse a restitution of what is no surface, one that jumps or has kinks, and a number that
    creates energy."""
    for name, e in system.restitution.items():
        _check_surface(system, name, "restitution")
        check_smooth(e, f"the restitution of {name!r}", kinks=True)
        if e.is_number and not 0 <= e <= 1:
            raise ModelError(
                f"the restitution of {name!r} is {shown(e)}: expected a number from 0 (plastic) to "
                "1 (elastic), or an expression in dmoc.approach_speed and parameters."
            )


def check_tangential_restitution(system: MechanicalSystem) -> None:
    """Refuse a tangential restitution of what is no surface or has no tangent, and a number that
    creates energy."""
    for name, e_t in system.tangential_restitution.items():
        _check_surface(system, name, "tangential restitution")
        if name not in system.tangents:
            raise ModelError(
                f"{shown(name)} has a tangential restitution but no tangent: give the tangential "
                f'position of its contact, as tangents={{"{name}": x}}.'
            )
        if e_t.is_number and not -1 <= e_t <= 1:
            raise ModelError(
                f"the tangential restitution of {name!r} is {shown(e_t)}: expected a number from "
                "-1 (smooth) to 1 (a superball), or an expression in parameters; more creates "
                "energy."
            )


def check_impact_laws(system: MechanicalSystem) -> None:
    """Refuse laws of impact of what is no surface, has no friction or has another law, and unknown
    ones."""
    for name, law in system.impact_laws.items():
        _check_surface(system, name, "law of impact")
        stated = [key for key in IMPACT_LAWS if key != RETURNING]
        if law not in stated:
            raise ModelError(
                f"the impact law of {name!r} is {shown(law)}: expected one of "
                f"{', '.join(map(repr, stated))}."
            )
        if name in system.tangential_restitution and law != BALL:
            raise ModelError(
                f"{name!r} has tangential restitution, which is a law of impact by itself, and "
                f"the impact law {law!r}: leave one of them out."
            )
        if name not in system.friction and law != BALL:
            raise ModelError(
                f"{name!r} has the impact law {law!r} but no friction, without which all laws of "
                f'impact are one: leave it out, or give friction={{"{name}": 0.5}}.'
            )
        e = system.restitution.get(name, sp.S.Zero)
        if IMPACT_LAWS[law].constant and e.has(approach_speed, dynamicsymbols._t):
            raise ModelError(
                f"the restitution of {name!r} is {shown(e)}: by {IMPACT_LAWS[law].name} it is a "
                "number or an expression in parameters; state such a one, or another impact law."
            )


def _check_surface(system: MechanicalSystem, name: str, kind: str) -> None:
    """Refuse a restitution of what is no surface."""
    if name not in system.surfaces:
        raise ModelError(
            f"{shown(name)} has a {kind} but is no surface: expected one of "
            f"{', '.join(system.surfaces) or 'none, the model has no surfaces'}."
        )


def laws_in_words(system: MechanicalSystem) -> dict[str, dict[str, str]]:
    """The expressions by surface, as they are shown, of what a system states."""
    names = "restitution", "tangential_restitution", "impact_laws"
    kinds = {name: getattr(system, name) for name in names}
    return {
        kind: {name: sp.sstr(e) for name, e in stated.items()}
        for kind, stated in kinds.items()
        if stated
    }


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


def tangential_kernels(f: Continuous) -> list[KernelSpec]:
    """The kernel of the tangential restitution that a system states, -1 for other tangents."""
    if not f.e_t:
        return []
    out = (Output.vector("e_t", f.e_t),)
    text = "Coefficients of tangential restitution of tangents."
    return [KernelSpec("tangential", text, (state_inputs(f)[-1],), out)]


def coefficients(f: Continuous, rates: list[Any]) -> list[GraphNode]:
    """The coefficients of restitution at the rates of the gaps, as nodes."""
    speed = f.L.graph.symbol(approach_speed.name)
    return [e.subs({speed: rate}) for e, rate in zip(f.e, rates, strict=True)]
