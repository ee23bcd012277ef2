"""Unknowns along a known motion: those of its ends."""

from __future__ import annotations

import numpy as np
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols
from systems import there_and_back

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.guess.transfer import Piece, unknowns_along
from dmoc.program.layout import Layout

X, T = dynamicsymbols("x"), dynamicsymbols._t


def test_a_motion_on_another_mesh_has_its_places_and_inputs(block: Kernels) -> None:
    """There, x = (t - 1)^2 + t, along u = 3 t, and back: cubics and lines are met at every node."""
    problem = there_and_back(block, steps=(2, 5))

    def piece(begin: float, end: float) -> Piece:
        t = np.linspace(begin, end, 4)
        x, v = (t - 1) ** 2 + t, 2 * (t - 1) + 1
        return Piece(t, x[:, None], v[:, None], t, 3 * t[:, None])

    x = unknowns_along(problem, [piece(1.0, 1.6), piece(1.6, 3.1)], [7.0])
    layout = Layout.of(problem)
    t = np.array([1.0, 1.3, 1.6, 1.9, 2.2, 2.5, 2.8, 3.1])
    np.testing.assert_allclose(x[layout.index_h], [0.3, 0.3])
    np.testing.assert_allclose(x[layout.index_q][:, 0], (t - 1) ** 2 + t)
    middles = (t[:-1] + t[1:]) / 2
    np.testing.assert_allclose(x[layout.index_u][:, 0], 3 * middles)
    np.testing.assert_allclose(x[layout.impact.v_a], [[2.2]])
    np.testing.assert_allclose(x[layout.impact.v_c], [[2.2]])
    assert x[layout.impact.lam] == 7.0


def test_momenta_of_the_ends_are_those_of_place_speed_and_time() -> None:
    """A mass of (1 + 2 x)(1 + 3 t) kg: 2 m/s at x = 1 after 0.5 s, 5 m/s at x = 3 after 1 s."""
    u = dynamicsymbols("u")
    mass = (1 + 2 * X) * (1 + 3 * T)
    system = dmoc.MechanicalSystem(
        "growing", [X], mass * X.diff() ** 2 / 2, {}, [u], {X: u}, cost=sp.Integer(1) * u**2
    )
    problem = dmoc.Problem(
        system, start={"x": 1, "x_dot": 2}, goal={"x": 3, "x_dot": 5}, steps=2, final_time=1
    )
    t = np.array([0.5, 0.8, 1.0])
    q, v = np.array([[1.0], [2.0], [3.0]]), np.array([[2.0], [4.0], [5.0]])
    x = unknowns_along(problem, [Piece(t, q, v, t[:-1], np.zeros((2, 1)))], [])
    layout = Layout.of(problem)
    np.testing.assert_allclose(x[layout.index_p_B], [3 * 2.5 * 2])
    np.testing.assert_allclose(x[layout.index_p_E], [7 * 4 * 5])
