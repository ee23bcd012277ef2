"""Positions moved to where conditions hold, beside closed forms."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.mechanics.model import Model
from dmoc.mechanics.model_values import parameter_row
from dmoc.mechanics.projection import onto, onto_gap

X, Y = dynamicsymbols("x y")
STEEP = 6.0


def circle(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return (q**2).sum(axis=1, keepdims=True) - 1, 2 * q[:, None]


def line(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """x + y = 2."""
    return q.sum(axis=1)[:, None] - 2, np.ones((1, 1, 2))


def line_and_circle(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    (miss,), (slope,) = circle(q)
    return np.array([[q[0, 1] - q[0, 0], *miss]]), np.array([[[-1.0, 1.0], *slope]])


def test_a_step_is_the_shortest_in_sizes() -> None:
    """Onto x + y = 2 from the origin: by shares of 1 and 9 with sizes of 1 and 3."""
    q = onto(line, np.zeros((1, 2)), np.array([1.0, 3.0]), longest=np.inf)
    np.testing.assert_allclose(q, [[0.2, 1.8]])


def test_rows_end_on_a_circle_and_on_two_conditions() -> None:
    q = onto(circle, np.array([[3.0, 4.0], [0.0, 0.5], [0.0, 0.0]]), np.ones(2))
    np.testing.assert_allclose(q, [[0.6, 0.8], [0.0, 1.0], [0.0, 0.0]], atol=1e-15)
    both = onto(line_and_circle, np.array([[0.3, 0.9]]), np.ones(2))
    np.testing.assert_allclose(both, [[0.5**0.5, 0.5**0.5]])


def test_a_box_is_not_left_and_what_has_no_size_stays() -> None:
    """Onto x + y = 2, of which x has to give 0.5 at most."""
    box = np.array([[0.0, 0.5], [0.0, 9.0]])
    (q,) = onto(line, np.zeros((1, 2)), np.ones(2), steps=40, longest=np.inf, box=box)
    np.testing.assert_allclose(q, [0.5, 1.5])
    (q,) = onto(line, np.zeros((1, 2)), np.array([0.0, 1.0]), longest=np.inf)
    np.testing.assert_allclose(q, [0.0, 2.0])


def test_rows_that_leave_what_is_defined_are_as_they_were() -> None:
    """log(x) = 0 by steps of any length: from 9 to a negative place."""

    def logarithm(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        with np.errstate(invalid="ignore"):
            return np.log(q), 1 / q[:, None]

    q = onto(logarithm, np.array([[9.0], [0.5]]), np.ones(1), longest=np.inf)
    np.testing.assert_allclose(q, [[9.0], [1.0]])
    q = onto(logarithm, np.array([[9.0], [0.05]]), np.ones(1), steps=3, longest=np.inf)
    assert q[0] == 9.0 and 0.05 < q[1] < 1.0


@pytest.mark.parametrize("x", [0.5, 2.0])
def test_steps_to_a_surface_are_shortened_until_it_is_nearer(x: float) -> None:
    """atan(6 x) = 0, from where whole steps lead further away; none where only y may move."""
    system = dmoc.MechanicalSystem(
        "bend", [X, Y], X.diff() ** 2 + Y.diff() ** 2, surfaces={"bend": sp.atan(STEEP * X) >= 0}
    )
    kernels = dmoc.build(system)
    model, q = Model(kernels, parameter_row(kernels, {})), np.array([x, 0.3])
    point = onto_gap(model, q, 0, 0.0, np.ones(2), np.inf)
    assert point is not None
    np.testing.assert_allclose(point, [0.0, 0.3], atol=1e-12)
    assert onto_gap(model, q, 0, 0.0, np.array([0.0, 1.0])) is None
