"""Unknowns along a known motion: those of its ends."""

from __future__ import annotations

import numpy as np
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.guess.transfer import Piece, unknowns_along
from dmoc.program.layout import Layout

X, T = dynamicsymbols("x"), dynamicsymbols._t


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
