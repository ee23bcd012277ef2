"""Contacts with two tangential directions, whose hits obey the law of a ball: they are read, they
are checked, and they have kernels of their own.

Both directions are tangents: the first one has the name of its surface, the second one that of
:func:`~dmoc.motion.impact_laws.second_of`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import sympy as sp

from dmoc.base.arguments import shown
from dmoc.base.errors import ModelError
from dmoc.base.names import name_of
from dmoc.motion.impact_laws import BALL, second_of
from dmoc.symbolic.continuous import Continuous, dot, own_rates
from dmoc.symbolic.definitions import atoms_below, expanded
from dmoc.symbolic.expressions import atoms_of
from dmoc.symbolic.kernel_family import family, state_inputs
from dmoc.symbolic.rest import with_limits
from dmoc.symbolic.spec import Input, KernelSpec

if TYPE_CHECKING:
    from dmoc.symbolic.system import MechanicalSystem


def with_pairs(tangents: Mapping[Any, Any], laws: Mapping[Any, Any]) -> dict[str, dict[Any, Any]]:
    """Tangents with both directions of each that has two, and the laws of impact with theirs."""
    each, laws = dict[Any, Any](), dict(laws)
    for name, tangent in tangents.items():
        if not isinstance(tangent, (tuple, list, sp.Tuple, sp.MatrixBase)):
            each[name] = tangent
            continue
        if len(tangent) != 2:
            raise ModelError(
                f"the tangent of {name!r} is given as {len(tangent)} expressions: expected one, or "
                "two of a contact in space."
            )
        if second_of(name) in tangents:
            raise ModelError(
                f"the second direction of the tangent of {name!r} has the name "
                f"{second_of(name)!r}, which another tangent has: rename that one."
            )
        if laws.setdefault(name, BALL) != BALL:
            raise ModelError(
                f"the tangent of {name!r} has two directions and the impact law "
                f"{shown(laws[name])}, which is one of the plane: leave the law out, or give "
                "one direction."
            )
        each[name], each[second_of(name)] = tangent
    return {"tangents": each, "impact_laws": laws}


def pairs_of(system: MechanicalSystem) -> dict[str, str]:
    """The second direction of each tangent that has one."""
    laws = system.impact_laws
    named = dict.fromkeys([*(n for n in system.tangents if n in laws), *laws])
    return {name: second_of(name) for name in named if laws[name] == BALL}


def check_pairs(system: MechanicalSystem) -> None:
    """Refuse the law of a ball without two directions or friction, friction that varies along a
    motion, and directions that are no places and not linear in the velocities."""
    rails = {*system.tangents} - {*system.surfaces}
    for name in {*system.tangents} & {*system.surfaces} - {*pairs_of(system)}:
        if (rail := second_of(name)) in rails:
            raise ModelError(
                f"the rail {rail!r} has the name of a second direction of the tangent of {name!r}: "
                "rename it."
            )
    for name, second in pairs_of(system).items():
        if name in system.surfaces and second not in system.tangents:
            raise ModelError(
                f"{name!r} has the impact law {BALL!r} but not two tangential directions: expected "
                f'their sliding velocities, as tangents={{"{name}": (v_x, v_y)}}.'
            )
        if name not in system.surfaces:
            raise ModelError(
                f"the tangent of {name!r} has two directions but is at no surface: expected one of "
                f"{', '.join(system.surfaces) or 'none, the model has no surfaces'}; a rail has "
                "one direction."
            )
        mu = system.friction.get(name)
        if mu is None or isinstance(mu, sp.Tuple) or atoms_of(mu) - {*system.parameters}:
            stated = "no friction" if mu is None else f"the friction {shown(mu)}"
            raise ModelError(
                f"{name!r} has two tangential directions and {stated}: expected one coefficient, a "
                f'number or an expression in parameters, as friction={{"{name}": 0.5}}.'
            )
        for key in (name, second):
            sigma = expanded(system.tangents[key], system.definitions)
            if (v := _curved_in(sigma, system.velocities)) is not None:
                raise ModelError(
                    f"a tangential direction of {name!r} is not linear in the velocity "
                    f"{name_of(v)}: expected a sliding velocity, or a tangential position."
                )
            if not atoms_below(sigma, {}) & {*system.coordinates, *system.velocities}:
                raise ModelError(
                    f"a tangential direction of {name!r} contains no coordinate and no velocity: "
                    "expected a sliding velocity, or a tangential position."
                )


def _curved_in(e: Any, velocities: Sequence[Any]) -> Any:
    """A velocity in which an expression is not linear; None if there is none."""
    symbols = {v: sp.Dummy() for v in velocities}
    e = e.xreplace(symbols)
    for v, s in symbols.items():
        slope = e.diff(s)
        for w in slope.free_symbols & {*symbols.values()}:
            if sp.expand(slope.diff(w)).equals(0) is False:
                return v
    return None


def pair_kernels(f: Continuous, system: MechanicalSystem) -> list[KernelSpec]:
    """Kernels of hits of contacts with two tangential directions: the friction of what slides, by
    tangents, and by contacts the power of tangential impulses and what the cone leaves of them."""
    pairs = pairs_of(system)
    if not pairs:
        return []
    numbers = {name: k for k, name in enumerate(system.tangents)}
    surfaces = {name: j for j, name in enumerate(system.gaps)}
    q, v, _, t, par = state_inputs(f)
    T = Input.vector(f.L.graph, "T", len(f.tau))
    lam = Input.vector(f.L.graph, "lam", len(f.g))
    sigma, drag, power, cone = own_rates(f, f.tau), [f.L.graph.zero] * len(f.tau), [], []
    for name, second in pairs.items():
        both, P = [numbers[name], numbers[second]], lam.symbols[surfaces[name]]
        slides, forces = ([of[k] for k in both] for of in (sigma, T.symbols))
        held = f.mu[both[0]] * P
        for k, s in zip(both, slides, strict=True):
            drag[k] = held * s * with_limits(dot(slides, slides), -0.5)
        power.append(dot(forces, slides))
        cone.append(held**2 - dot(forces, forces))
    return [
        *family(
            "drag",
            "Friction mu P sigma/|sigma| of sliding contacts with two directions; 0 of others.",
            (q, v, lam, t),
            {"D": drag},
            par,
        ),
        *family(
            "skid",
            "Tangential impulses times sliding velocities, T_1 sigma_1 + T_2 sigma_2.",
            (q, v, T, t),
            {"W_s": power},
            par,
        ),
        *family(
            "cone",
            "What the cone of friction leaves of tangential impulses, (mu P)^2 - T_1^2 - T_2^2.",
            (q, T, lam, t),
            {"left": cone},
            par,
        ),
    ]
