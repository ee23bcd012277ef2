"""Roots along a coordinate and the cubics of a known motion, against SciPy."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, exp, pi
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import brentq

from dmoc.guess.transfer import Piece, equally_long
from dmoc.problem.contacts import _root, crossings


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
    place = _root(value, low, high, 1e-15)
    assert place == pytest.approx(expected, rel=1e-13) or abs(value(place)) <= abs(value(expected))


def test_the_root_of_what_is_linear_takes_few_values() -> None:
    places = []

    def value(s: float) -> float:
        places.append(s)
        return 2.0 * s - pi

    assert _root(value, 0.0, 3.0, 1e-15) == pytest.approx(pi / 2, rel=1e-15)
    assert len(places) <= 8


@pytest.mark.parametrize(
    ("place", "points"),
    [
        (4.0, [4.0]),  # as far as is looked
        (4.01, []), (0.3, [0.3]), (-4.0, [-4.0]), (-4.01, []), (-1.0, [-1.0]),
        (0.5, [0.5]), (1.0, [1.0]), (0.0, [0.0]),
    ],
)  # fmt: skip
def test_a_surface_is_met_up_to_four_reaches_away(place: float, points: list[float]) -> None:
    """Of a coordinate that reaches 1 m from q = 0; the other one reaches 5 m and is not moved."""
    model = SimpleNamespace(
        surface_coordinates=[np.array([1])], gap_rounding=lambda q, t: np.array([1e-12]),
        gaps=lambda q, t: (q[..., 1] - place)[..., None],
    )  # fmt: skip
    problem: Any = SimpleNamespace(model=model, reach=np.array([5.0, 1.0]), nq=2)
    crossed = crossings(problem, np.array([7.0, 0.0]), 0)
    np.testing.assert_allclose(crossed, [[7.0, p] for p in points], atol=1e-12)


def test_both_sides_of_a_surface_are_met_nearest_first() -> None:
    """(q - 1)(q - 3)(q + 2) = 0 from 0.5."""
    model = SimpleNamespace(
        surface_coordinates=[np.array([0])], gap_rounding=lambda q, t: np.array([1e-12]),
        gaps=lambda q, t: (q - 1) * (q - 3) * (q + 2),
    )  # fmt: skip
    problem: Any = SimpleNamespace(model=model, reach=np.array([1.0]), nq=1)
    np.testing.assert_allclose(crossings(problem, np.array([0.5]), 0), [[1.0], [-2.0]], atol=1e-9)


def test_positions_between_nodes_are_those_of_the_cubics() -> None:
    rng = np.random.default_rng(3)
    t = np.cumsum(rng.uniform(0.1, 0.3, 7))
    q, v = rng.normal(size=(7, 2)), rng.normal(size=(7, 2))
    piece = Piece(t, q, v, t, q)
    at = np.concatenate([t, rng.uniform(t[0], t[-1], 50)])
    np.testing.assert_allclose(
        piece.positions(at), CubicHermiteSpline(t, q, v)(at), rtol=0, atol=1e-13
    )


def test_phases_that_take_equally_long_lead_the_same_way_in_the_same_time() -> None:
    def piece(begin: float, end: float) -> Piece:
        t = np.linspace(begin, end, 9)
        v = np.stack([np.cos(t), 2 * t], axis=1)
        return Piece(t, np.stack([np.sin(t), t**2], axis=1), v, t, t[:, None])

    pieces = [piece(1.0, 1.25), piece(1.25, 4.0), piece(4.0, 4.75)]
    stretched = equally_long(pieces)
    assert [p.t[0] for p in stretched] == pytest.approx([1.0, 2.25, 3.5])
    assert [p.t[-1] for p in stretched] == pytest.approx([2.25, 3.5, 4.75])
    for a, b in zip(pieces, stretched, strict=True):
        np.testing.assert_array_equal(a.q, b.q)
        np.testing.assert_allclose(b.t_u, b.t)
        share = np.linspace(0, 1, 33)
        places = [p.positions(p.t[0] + share * np.ptp(p.t)) for p in (a, b)]
        np.testing.assert_allclose(places[0], places[1], rtol=1e-12)
