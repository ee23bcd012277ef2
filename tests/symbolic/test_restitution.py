"""Coefficients of restitution as a system states them: ranges, and the kernels of their laws."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import ModelError

X, Y = dynamicsymbols("x y")
C, T = sp.Symbol("c"), dynamicsymbols._t


def box(**more: Any) -> dmoc.MechanicalSystem:
    """A point before two walls, of which the second goes away at 0.5 m/s."""
    walls = {"east": X <= 1, "north": Y <= 2 + T / 2}
    return dmoc.MechanicalSystem(
        "box", [X, Y], (X.diff() ** 2 + Y.diff() ** 2) / 2, {C: 0.25}, surfaces=walls,
        tangents={"east": Y}, friction={"east": C}, **more,
    )  # fmt: skip


@pytest.mark.parametrize("e", [0, 1, 0.5, sp.Rational(1, 3), C])
def test_numbers_from_plastic_to_elastic_are_coefficients(e: Any) -> None:
    assert box(restitution={"east": e}).restitution["east"] == sp.sympify(e)


@pytest.mark.parametrize("e", [-0.01, 1.01, 2, -1])
def test_numbers_beyond_create_energy(e: float) -> None:
    with pytest.raises(ModelError, match="the restitution of 'east' is"):
        box(restitution={"east": e})


@pytest.mark.parametrize("e", [-1, 1, 0])
def test_tangential_coefficients_go_from_smooth_to_superballs(e: int) -> None:
    assert box(tangential_restitution={"east": e}).tangential_restitution["east"] == e
    with pytest.raises(ModelError, match=r"north.* but no tangent"):
        box(tangential_restitution={"north": e})


def test_a_law_acts_at_the_rate_of_its_own_gap() -> None:
    """At 3 and 2 m/s: the coefficient c g of one wall, 1/(1 + g) of the other at 2 - 0.5 m/s."""
    g = dmoc.approach_speed
    kernels = dmoc.build(box(restitution={"east": C * g, "north": 1 / (1 + g)}))
    q, v, lam = np.array([[0.0, 0.0]]), np.array([[3.0, 2.0]]), np.array([[5.0, 7.0]])
    row = np.array([list(kernels.parameters.values())], dtype=float)
    results = kernels.call("rebound", q, v, lam, np.zeros((1, 1)), row)
    made = dict(zip(kernels.outputs("rebound"), results, strict=True))
    np.testing.assert_allclose(made["gamma_e"], [[0.75 * 3.0, 0.4 * 1.5]])
    np.testing.assert_allclose(made["P_e"], [[0.75 * 5.0, 0.4 * 7.0]])
    np.testing.assert_allclose(made["W_e"], [[0.75 * 5.0 * 3.0 + 0.4 * 7.0 * 1.5]])
