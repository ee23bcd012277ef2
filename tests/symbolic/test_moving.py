"""Energies and rates where functions depend on the time, beside their closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols
from systems import block_system, driven_system

import dmoc
from dmoc.mechanics.model import Model
from dmoc.mechanics.model_values import parameter_row
from dmoc.symbolic.continuous import impact_work, readable
from dmoc.symbolic.discrete import StepElement, step_element
from dmoc.symbolic.quadrature import lobatto_nodes

T = dynamicsymbols._t


def pushed(order: int) -> tuple[StepElement, dict[sp.Symbol, float]]:
    """A step of a unit mass under an input, and its size and start."""
    element = step_element(readable(block_system()), order, sp.Symbol, sp.sympify)
    return element, {element.h: 0.5, element.t_k: 0.0}


def value(e: StepElement, expression: sp.Expr, numbers: dict[sp.Symbol, float]) -> float:
    resolved = sp.sympify(expression).subs(dict(e.definitions))
    return float(resolved.subs(numbers).subs("m", 1))


@pytest.mark.parametrize("order", [4, 6])
def test_a_step_under_a_constant_force_has_the_energies_of_its_ends(order: int) -> None:
    """The motion 3 t + t^2 is a polynomial of the step: the derivative of the action by the time
    of an end, with the work, is minus the energy there, 9/2 and 16/2."""
    e, numbers = pushed(order)
    for (q,), place in zip(e.nodes, map(float, lobatto_nodes(e.inside + 1)), strict=True):
        numbers[q] = 3 * 0.5 * place + (0.5 * place) ** 2
    numbers |= dict.fromkeys((*e.u_k, *e.u_kp1), 2.0)
    assert value(e, e.e_minus, numbers) == pytest.approx(-9 / 2, rel=1e-12)
    assert value(e, e.e_plus, numbers) == pytest.approx(-16 / 2, rel=1e-12)


def test_the_energies_of_order_two_have_the_forces_of_their_own_ends() -> None:
    """v = 3.5: -v^2/2 + h/2 u_k v before, -v^2/2 - h/2 u_kp1 v after."""
    e, numbers = pushed(2)
    numbers |= {e.q_k[0]: 0.0, e.q_kp1[0]: 1.75, e.u_k[0]: 2.0, e.u_kp1[0]: 5.0}
    assert value(e, e.e_minus, numbers) == pytest.approx(-6.125 + 0.25 * 2 * 3.5, rel=1e-12)
    assert value(e, e.e_plus, numbers) == pytest.approx(-6.125 - 0.25 * 5 * 3.5, rel=1e-12)


@pytest.mark.slow
def test_an_elastic_hit_under_a_load_that_grows_is_one_of_second_order() -> None:
    """y'' = -(1 + t) from 2 to the floor at 1, where the load has an energy of its own: t^2/2 +
    t^3/6 = 1, and up again with the same rate."""
    y = dynamicsymbols("y")
    loaded = dmoc.MechanicalSystem(
        "loaded", [y], y.diff(T) ** 2 / 2 - (1 + T) * y, {}, surfaces={"floor": y >= 1}
    )
    kernels = dmoc.build(loaded)
    (hit,) = (float(r.real) for r in np.roots([1 / 6, 1 / 2, 0, -1]) if abs(r.imag) < 1e-9 < r.real)
    rate, s = hit + hit**2 / 2, 2 - hit
    there = 1 + rate * s - (1 + hit) * s**2 / 2 - s**3 / 6
    for steps in (50, 80, 128, 400):  # wherever in its step the hit comes
        run = dmoc.simulate(kernels, [2.0], steps=steps, step_size=2 / steps, restitution=1.0)
        assert abs(run.q[-1, 0] - there) < 1.0 / steps**2


@pytest.mark.slow
def test_a_mass_that_grows_slows_down() -> None:
    """L = (1 + t) v^2 / 2: (1 + t) v' + v = 0."""
    x = dynamicsymbols("x")
    growing = dmoc.MechanicalSystem("growing", [x], (1 + T) * x.diff(T) ** 2 / 2, {})
    kernels = dmoc.build(growing)
    model = Model(kernels, parameter_row(kernels, {}))
    q, v, t = np.zeros((1, 1)), np.array([[3.0]]), np.array([0.5])
    assert model.acceleration(q, v, np.zeros((1, 0)), t)[0, 0] == pytest.approx(-2.0, rel=1e-12)


@pytest.mark.slow
def test_a_momentum_at_rest_is_no_velocity() -> None:
    """L = v^2 + v cos t: p = 2 v + cos t."""
    x = dynamicsymbols("x")
    carried = dmoc.MechanicalSystem("carried", [x], x.diff(T) ** 2 + x.diff(T) * sp.cos(T), {})
    kernels = dmoc.build(carried)
    model = Model(kernels, parameter_row(kernels, {}))
    q, p, t = np.zeros((1, 1)), np.array([[3.0]]), np.array([0.5])
    assert model.velocity(q, p, t)[0, 0] == pytest.approx((3 - np.cos(0.5)) / 2, rel=1e-12)


def test_rates_and_works_of_a_surface_that_moves() -> None:
    """g = x - w - 2 t: gamma = v - 2, W_t = -2 lam, W_gamma = lam (v - 2)."""
    x = dynamicsymbols("x")
    system = replace(block_system(), surfaces={"wall": x <= sp.Symbol("wall") + 2 * T})
    f, lam = readable(system), sp.Symbol("lam")
    moving, working = impact_work(f, [lam])
    assert sp.expand(moving + 2 * lam) == 0
    assert sp.expand(working - lam * (f.v[0] - 2)) == 0


@pytest.mark.slow
def test_gaps_accelerate_with_their_surface() -> None:
    """g = x sin t - y has d2g/dt2 = 2 v cos t - x sin t without acceleration."""
    x, y = dynamicsymbols("x y")
    turning = dmoc.MechanicalSystem(
        "turning_plane", [x, y], (x.diff(T) ** 2 + y.diff(T) ** 2) / 2, {},
        surfaces={"plane": y >= x * sp.sin(T)},
    )  # fmt: skip
    kernels = dmoc.build(turning)
    model = Model(kernels, parameter_row(kernels, {}))
    q, v, t = np.array([[2.0, 3.0]]), np.array([[5.0, 7.0]]), np.array([0.6])
    assert model.gap_rates(q, v, t)[0, 0] == pytest.approx(5 * np.sin(0.6) + 2 * np.cos(0.6) - 7)
    expected = 2 * 5 * np.cos(0.6) - 2 * np.sin(0.6)
    assert model.gap_accelerations(q, v, t)[0, 0] == pytest.approx(expected, rel=1e-12)


@pytest.mark.slow
def test_a_path_constraint_says_what_it_depends_on() -> None:
    """u a' <= 3 + t, in the coordinates (a, z)."""
    (row,) = dmoc.build(driven_system()).manifest.path_rows
    assert row["coordinates"] == [] and row["velocities"] and row["inputs"] and row["time"]
