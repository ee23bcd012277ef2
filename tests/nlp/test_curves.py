"""Roots along a coordinate and the cubics of a known motion, against SciPy."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, exp, pi

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import brentq

from dmoc.nlp.surfaces import _root
from dmoc.nlp.transfer import Piece


@pytest.mark.parametrize(
    ("value", "low", "high"),
    [
        (lambda s: 3.0 * (s - 0.1), 0.0, 1.0),
        (cos, 1.0, 3.0),
        (lambda s: exp(40 * s) - 2.0, -1.0, 1.0),
        (lambda s: (s - 0.3) ** 3, -1.0, 0.5),
        (lambda s: 1e-200 * (s * s - 2.0), 2.0, 0.0),
        (lambda s: s - 0.25, 0.25, 1.0),
    ],
)
def test_a_root_is_found_between_places_of_different_signs(
    value: Callable[[float], float], low: float, high: float
) -> None:
    expected = brentq(value, low, high, xtol=1e-15, rtol=1e-14, maxiter=1000)
    found = _root(value, low, high, 1e-15)
    assert found == pytest.approx(expected, rel=1e-13) or abs(value(found)) <= abs(value(expected))


def test_the_root_of_what_is_linear_takes_few_values() -> None:
    asked = []

    def value(s: float) -> float:
        asked.append(s)
        return 2.0 * s - pi

    assert _root(value, 0.0, 3.0, 1e-15) == pytest.approx(pi / 2, rel=1e-15)
    assert len(asked) <= 8


def test_positions_between_nodes_are_those_of_the_cubics() -> None:
    rng = np.random.default_rng(3)
    t = np.cumsum(rng.uniform(0.1, 0.3, 7))
    q, v = rng.normal(size=(7, 2)), rng.normal(size=(7, 2))
    piece = Piece(t, q, v, t, q)
    at = np.concatenate([t, rng.uniform(t[0], t[-1], 50)])
    np.testing.assert_allclose(
        piece.positions(at), CubicHermiteSpline(t, q, v)(at), rtol=0, atol=1e-13
    )
