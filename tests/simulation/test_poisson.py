"""One impact with friction after Poisson: known answers, and energy that never grows."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from dmoc.simulation.impact_laws.course import Coefficients, Impulses
from dmoc.simulation.impact_laws.poisson import impulses


def rod(angle: float) -> tuple[np.ndarray, np.ndarray]:
    """Directions (-grad g, grad tau) of the lower left end of a uniform rod of length 1, in the
    velocities (x, y, angle) of its centre, and its inverse masses."""
    c, s = np.cos(angle) / 2, np.sin(angle) / 2
    return np.array([[0, 1, -c], [1, 0, s]]), np.array([1.0, 1.0, 12.0])


@pytest.mark.parametrize(
    ("angle", "v", "mu", "after", "normal", "tangential", "states"),
    [
        (45, (-0.3, -1, 0), 0.2, (-0.16363636, -0.31818182, -2.31416765), 0.681818182, 0.136363636,
         ((-1,), (-1,))),
        (60, (0.5, -1, 0), 0.3, (0.64219558, -0.08626835, -2.00232502), 0.913731651, 0.142195585,
         ((1, -1), (-1,))),
        (60, (0.1, -1, 0), 0.6, (0.53689891, 0.17003607, -1.23991491), 1.170036071, 0.436898905,
         ((1, 0), (0,))),
    ],
)  # fmt: skip
def test_a_rod_that_hits_a_floor(
    angle: float, v: tuple[float, ...], mu: float, after: tuple[float, ...], normal: float,
    tangential: float, states: tuple[tuple[int, ...], ...],
) -> None:  # fmt: skip
    D, inverse = rod(np.radians(angle))
    hit = impulses(D @ v, D * inverse @ D.T, Coefficients(mu, 0.5))
    assert v + inverse * (D.T @ [hit.normal, hit.tangential]) == pytest.approx(after, abs=6e-9)
    assert hit.normal == pytest.approx(normal, abs=6e-10)
    assert hit.tangential == pytest.approx(tangential, abs=6e-10)
    assert (hit.compression, hit.restitution) == states


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("mu", [0.0, 0.05, 0.1, 0.3])
@pytest.mark.parametrize("inertia", [0.5, 0.4])
def test_a_ball_sticks_or_slides(inertia: float, mu: float, e: float) -> None:
    """A disc or ball of radius 1, k = I / (m r^2), that comes down with 2 m/s, 0.7 m/s along the
    floor and 0.1 rad/s: it sticks with -m s / (1 + 1/k) where friction holds that."""
    n, s = -2.0, 0.7 + 0.1
    hit = impulses(np.array([n, s]), np.diag([1.0, 1 + 1 / inertia]), Coefficients(mu, e))
    sticks = s / (1 + 1 / inertia)
    assert hit.normal == pytest.approx((1 + e) * 2, rel=1e-14)
    assert -hit.tangential == pytest.approx(min(sticks, mu * hit.normal), rel=1e-14)


def test_what_separates_takes_no_impulse() -> None:
    hit = impulses(np.array([0.1, 1.0]), np.eye(2), Coefficients(0.5, 1.0))
    assert hit == Impulses(0.0, 0.0, (), ())


def test_a_jam_ends_where_sliding_stops() -> None:
    """While it slides the contact is pressed together harder and harder."""
    response = np.array([[1.0, 0.9], [0.9, 1.0]])
    hit = impulses(np.array([-1.0, 1.0]), response, Coefficients(2.0, 0.0))
    n, t = np.array([-1.0, 1.0]) + response @ [hit.normal, hit.tangential]
    assert hit.compression == (1, 0)
    assert [n, t] == pytest.approx([0, 0], abs=1e-14)


def test_what_is_at_rest_sticks_beside_a_contact_whose_sliding_jams() -> None:
    """The push itself presses the bodies together, and what sticks takes them apart."""
    response = np.array([[-0.4, 3.1], [-1.6, 6.9]])
    hit = impulses(np.array([-0.3, -1e-17]), response, Coefficients(0.8, 0.0))
    assert hit.compression == (0,)
    assert response @ [hit.normal, hit.tangential] == pytest.approx([0.3, 0.0])
    (slope,) = hit.slopes(response, 0.8)
    assert slope == pytest.approx(1.6 / 6.9) == hit.tangential / hit.normal


@pytest.mark.parametrize(
    ("response", "mu", "rates"),
    [
        ((2.9854261127486215, -3.945223531987561, 5.216362609240357), 1.294155576093227,
         (-1.8362151124205066, 0.2861486786775706)),
        ((3.769470643848912, 3.2451594389151066, 2.795544903540221), 1.6567881768800687,
         (-1.1439889477482759, 0.5603693386415284)),
    ],
)  # fmt: skip
def test_what_sticks_goes_on_to_stick(
    response: tuple[float, ...], mu: float, rates: tuple[float, ...]
) -> None:
    """Rounding errors of the rates of bodies that are nearly bound do not slide."""
    A = np.array([response[:2], response[1:]])
    hit = impulses(np.array(rates), A, Coefficients(mu, 1.0))
    assert (hit.course, hit.restitution) == ("slip+:stick", (0,))


@example(-1.0, 1.0, 1.0, 1.0, 0.0, 2.2e-309, 0.0)  # a friction that stops nothing
@example(-0.15625, 1.0, 0.25, 1.0, 0.0, 5e-324, 1.0)
@given(
    st.floats(-10, -1e-3), st.floats(-10, 10), st.floats(0.01, 100), st.floats(0.01, 100),
    st.floats(-0.999, 0.999), st.floats(0, 5), st.floats(0, 1),
)  # fmt: skip
def test_energy_never_grows_and_the_laws_hold(
    n: float, t: float, normal: float, tangential: float, coupled: float, mu: float, e: float
) -> None:
    off = coupled * np.sqrt(normal * tangential)
    response = np.array([[normal, off], [off, tangential]])
    hit = impulses(np.array([n, t]), response, Coefficients(mu, e))
    lam = np.array([hit.normal, hit.tangential])
    before = np.array([n, t])
    after = before + response @ lam
    gained = lam @ (before + after) / 2
    scale = before @ np.linalg.solve(response, before) / 2
    assert gained <= 1e-9 * scale
    # Multiples of the smallest number, which a friction next to none has, are rounded to such.
    rounding = 1e-12 * mu * hit.normal + np.finfo(float).tiny
    assert abs(hit.tangential) <= mu * hit.normal + rounding
    assert after[0] >= -1e-9 * (abs(n) + np.abs(response[0] @ np.abs(lam)))
