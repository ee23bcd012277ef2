"""Seconds from a model to a solver: derivation, generation, compilation; first time and again."""

from __future__ import annotations

import os
import sys
import tempfile
import types
import warnings
from typing import Any

import casadi_pendulum
import sympy as sp
from common import Section, bytes_of_c, clocked
from sympy.physics.mechanics import LagrangesMethod, dynamicsymbols

import dmoc
from dmoc.models import catalogue


def cart_with_links(links: int) -> dmoc.MechanicalSystem:
    """A cart with a chain of point-mass pendulums and a stop for the first of them."""
    t = dynamicsymbols._t
    x, force = dynamicsymbols("x F")
    angles = dynamicsymbols(f"theta1:{links + 1}")
    m_c, m, l, g, stop = sp.symbols("m_c m l g stop")
    px, py = x, sp.S.Zero
    kinetic, potential = m_c * x.diff(t) ** 2 / 2, sp.S.Zero
    for angle in angles:
        px, py = px + l * sp.cos(angle), py + l * sp.sin(angle)
        kinetic += m * (px.diff(t) ** 2 + py.diff(t) ** 2) / 2
        potential += m * g * py
    return dmoc.MechanicalSystem(
        f"cart_{links}_links", [x, *angles], kinetic - potential,
        {m_c: 1.0, m: 0.5, l: 0.5, g: 9.81, stop: 0.3}, inputs=[force], forces={x: force},
        surfaces={"stop": angles[0] >= stop}, cost=force**2 / 2,
    )  # fmt: skip


def compare(quick: bool) -> Section:
    section = Section(
        "From a model to compiled functions",
        "Cold: no cache; warm: the kernels are found in the cache; the SymPy model is made "
        "before. dmoc compiles values, first and second derivatives for any N, sequence and "
        "parameter; CasADi's JIT and opty compile one problem with its N (opty: no second "
        "derivatives, no collisions).",
        ["tool and model", "cold, s", "warm, ms", "bytes of C"],
    )
    models = [
        ("cart-pendulum", catalogue.system("cart_pendulum")),
        ("cart, 4 links", cart_with_links(4)),
    ]
    models += [] if quick else [("cart, 6 links", cart_with_links(6))]
    for name, system in models:
        cold, warm = cold_and_warm(system)
        section.row(
            f"dmoc, {name}", f"{cold:.2f}", f"{1e3 * warm:.1f}", f"{bytes_of_c(system):,} (any N)"
        )
    built = casadi_pendulum.program(casadi_pendulum.PendulumCase())
    section.row(
        "CasADi, cart-pendulum, N = 100 + 100, not compiled", f"{built.seconds:.2f}", "no cache",
        "-",
    )  # fmt: skip
    if not quick:
        jit = casadi_pendulum.program(casadi_pendulum.PendulumCase(), compiled=True)
        section.row("CasADi with JIT at -O2, the same", f"{jit.seconds:.2f}", "no cache", "-")
    for links in (1, 4):
        try:
            seconds: Any = f"{_opty(links):.2f}"
        except Exception as error:  # a peer that fails is shown failing
            seconds = f"failed: {type(error).__name__}: {error}"[:90]
        section.row(
            f"opty, cart with {links} link{'s' * (links > 1)}, N = 200", seconds, "no cache", "-"
        )
    return section


def cold_and_warm(system: dmoc.MechanicalSystem) -> tuple[float, float]:
    """Seconds of a build without a cache, and with it."""
    before = os.environ.get("DMOC_CACHE")
    try:
        with tempfile.TemporaryDirectory() as folder:
            os.environ["DMOC_CACHE"] = folder
            cold, warm = (
                clocked(lambda: dmoc.build(system, backend="compiled"))[0] for _ in range(2)
            )
            return cold, warm
    finally:
        os.environ.pop("DMOC_CACHE")
        if before is not None:
            os.environ["DMOC_CACHE"] = before


def _opty(links: int) -> float:
    """Seconds for constraint and Jacobian functions of the smooth model; opty knows no
    collisions."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        # opty needs cyipopt to solve, and Ipopt's headers to install it; deriving and compiling
        # need neither.
        stand_in: Any = types.ModuleType("cyipopt")
        stand_in.Problem = object
        sys.modules.setdefault("cyipopt", stand_in)
        from opty.direct_collocation import ConstraintCollocator

    system = cart_with_links(links)

    def made() -> None:
        t, (x, *_) = dynamicsymbols._t, system.coordinates
        speeds = [sp.Function(f"u_{i}")(t) for i in range(len(system.coordinates))]
        kinematics = [u - q.diff(t) for u, q in zip(speeds, system.coordinates, strict=True)]
        method = LagrangesMethod(system.lagrangian, system.coordinates)
        equations = method.form_lagranges_equations()
        equations[list(system.coordinates).index(x)] -= system.inputs[0]
        equations = equations.subs(
            {q.diff(t): u for q, u in zip(system.coordinates, speeds, strict=True)}
        )
        nodes = 201
        collocator = ConstraintCollocator(
            sp.Matrix([*kinematics, *equations]),
            (*system.coordinates, *speeds),
            nodes,
            1.0 / (nodes - 1),
            known_parameter_map={s: v for s, v in system.parameters.items() if str(s) != "stop"},
            time_symbol=t,
        )
        collocator.generate_constraint_function()
        collocator.generate_jacobian_function()

    return clocked(made)[0]
