"""The derivation against textbook results and against SymPy's own Lagrange equations."""

from __future__ import annotations

import pytest
import sympy as sp
from sympy.physics.mechanics import LagrangesMethod, dynamicsymbols
from systems import block_system, driven_system, puck_system

import dmoc
from dmoc.models import catalogue
from dmoc.symbolic.continuous import (
    dot,
    energy,
    mass_matrix,
    momenta,
    readable,
    right_hand_side,
)
from dmoc.symbolic.derivation.discrete_sections import tangents
from dmoc.symbolic.discrete import StepElement, step_element
from dmoc.symbolic.graph import gradient

pytestmark = pytest.mark.slow


def zero(expression: sp.Expr) -> bool:
    return bool(sp.simplify(expression) == 0)


def vanishes(expression: sp.Expr) -> bool:
    """Whether an expression is zero at a point, to 30 digits."""
    symbols = sorted(expression.free_symbols, key=str)
    point = {s: sp.Rational(7 + 3 * i, 11 + i) for i, s in enumerate(symbols)}
    return abs(expression.xreplace(point).evalf(30, chop=False)) < 1e-25


def element(system: dmoc.MechanicalSystem, order: int) -> StepElement:
    return step_element(readable(system), order, sp.Symbol, sp.sympify)


def test_equations_of_motion_of_the_source() -> None:
    f = readable(catalogue.system("cart_pendulum"))
    alpha = f.q[0]
    m_p, m_c, l, g, *_ = f.par
    a, b = sp.symbols("a b")
    rows = sp.Matrix(mass_matrix(f)) * sp.Matrix([a, b]) - sp.Matrix(right_hand_side(f))
    # x'' sin(alpha) = l alpha'' + g cos(alpha)
    assert zero(rows[0] / (m_p * l) - (l * a + g * sp.cos(alpha) - b * sp.sin(alpha)))
    # (m_p + m_c) x'' - m_p l (alpha'' sin(alpha) + alpha'^2 cos(alpha)) = F
    assert zero(
        rows[1]
        - ((m_p + m_c) * b - m_p * l * (a * sp.sin(alpha) + f.v[0] ** 2 * sp.cos(alpha)) - f.u[0])
    )


def test_equations_of_motion_equal_sympys_lagrange_equations() -> None:
    for system in (catalogue.system("cart_pendulum"), puck_system()):
        method = LagrangesMethod(system.lagrangian, list(system.coordinates))
        reference = method.form_lagranges_equations()
        f = readable(system)
        accelerations = sp.Matrix([q.diff(dynamicsymbols._t, 2) for q in system.coordinates])
        names = dict(zip(f.v, system.velocities, strict=True)) | dict(
            zip(f.q, system.coordinates, strict=True)
        )
        force = (
            sp.Matrix(right_hand_side(f))
            .subs(dict(zip(f.u, [0] * len(f.u), strict=True)))
            .subs(names)
        )
        ours = sp.Matrix(mass_matrix(f)).subs(names) * accelerations - force
        assert all(zero(a - b) for a, b in zip(ours, reference, strict=True))


def test_energy_is_kinetic_plus_potential() -> None:
    f = readable(catalogue.system("cart_pendulum"))
    m_p, _, l, g, *_ = f.par
    kinetic = (sp.Matrix([f.v]) * sp.Matrix(mass_matrix(f)) * sp.Matrix(f.v))[0] / 2
    assert zero(energy(f) - kinetic - m_p * g * l * sp.sin(f.q[0]))
    assert all(
        zero(a - b)
        for a, b in zip(momenta(f), sp.Matrix(mass_matrix(f)) * sp.Matrix(f.v), strict=True)
    )


def test_slot_derivatives_equal_direct_differentiation() -> None:
    for system, order in (
        (catalogue.system("cart_pendulum"), 2),
        (driven_system(), 2),
        (block_system(), 4),
    ):
        e = element(system, order)
        explicit = dict(e.definitions)
        for expression in (e.L_d, e.e_plus, e.C_d, *e.r_plus, *e.r_i):
            for i, z in enumerate(e.x_k):
                direct = expression.xreplace(explicit).diff(z)
                assert vanishes(direct - e.D(expression, i).xreplace(explicit))


def test_second_derivatives_of_a_step_equal_direct_differentiation() -> None:
    for system, order in ((driven_system(), 2), (block_system(), 4)):
        e = element(system, order)
        explicit = dict(e.definitions)
        for i, row in enumerate(e.hessian(e.L_d)):
            assert not any(row[:i])
            slope = e.L_d.xreplace(explicit).diff(e.x_k[i])
            for z, second in zip(e.x_k[i:], row[i:], strict=True):
                assert vanishes(slope.diff(z) - second.xreplace(explicit))


def test_third_slot_derivative_is_minus_the_energy_of_the_midpoint() -> None:
    system = catalogue.system("cart_pendulum")
    e, f = element(system, 2), readable(system)
    middle = e.points[0].start
    names = dict(zip((*f.q, *f.v), (*middle.q, *middle.v), strict=True))
    assert zero(e.D(e.L_d, e.at_h) + energy(f).subs(names))


def test_momentum_with_impulse_and_its_tangential_form_are_equal() -> None:
    """t . (r_plus + r_minus - lam n) = t . (r_plus + r_minus) for every tangent t, and there are
    nq - 1 independent ones."""
    for system in (catalogue.system("cart_pendulum"), puck_system()):
        f = readable(system)
        for gap in f.g:
            normal = gradient(gap, f.q)
            vectors = tangents(normal)
            assert len(vectors) == len(f.q) - 1
            assert sp.Matrix(vectors).rank() == len(f.q) - 1
            assert all(zero(dot(t, normal)) for t in vectors)


def test_derivation_contains_every_step() -> None:
    derivation = dmoc.derive(puck_system())
    titles = [s.title for s in derivation.sections]
    assert titles == [
        "Lagrangian",
        "Momenta",
        "Mass matrix",
        "Energy",
        "Virtual work and generalised forces",
        "Equations of motion",
        "Unilateral constraints",
        "Midpoint of a step",
        "Discrete Lagrangian",
        "Discrete forces",
        "Discrete Euler-Lagrange equations",
        "Collision conditions",
        "Discrete cost",
        "Path constraints",
        "Minimal collision time",
        "First derivatives",
        "Second derivatives (step)",
        "Second derivatives (energy)",
    ]
    text = str(derivation)
    assert all(title in text for title in titles)
    assert "tangential momentum" in text
    latex = derivation.latex()
    assert latex.count("{") == latex.count("}")
    assert latex.count(r"\section") == len(titles)
    assert derivation._repr_html_().count("<h3>") == len(titles)
