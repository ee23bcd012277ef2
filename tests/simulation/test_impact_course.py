"""Impacts on contacts that are touched at once, with friction: rocking and falling boxes, against
closed forms, a calculation with viscous contacts, and what holds of every impact."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache, partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import sympy as sp
from hypothesis import example, given, settings
from hypothesis import strategies as st
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.mechanics.model import Model
from dmoc.mechanics.model_values import parameter_row
from dmoc.results.simulation import Simulation
from dmoc.simulation.impact_course import Blow, blow_on
from dmoc.simulation.mode_choice import Place

T = dynamicsymbols._t
x, y, a = dynamicsymbols("x y a")
B, H, LEFT, RIGHT, STEP = sp.symbols("b h mu_l mu_r d")
GRAVITY = 9.81


def boxes(order: int) -> Kernels:
    """A box of mass 1 on its lower corners, the right one over a step, in an order of names."""
    corners = {
        name: (x + s * B * sp.cos(a) + H * sp.sin(a), y + s * B * sp.sin(a) - H * sp.cos(a))
        for name, s in (("left", -1), ("right", 1))[::order]
    }
    rates = x.diff(T) ** 2 + y.diff(T) ** 2 + (B**2 + H**2) / 3 * a.diff(T) ** 2
    height = {"left": corners["left"][1], "right": corners["right"][1] - STEP}
    return dmoc.build(
        dmoc.MechanicalSystem(
            "falling_box", [x, y, a], rates / 2 - GRAVITY * y,
            {B: 0.1, H: 0.3, LEFT: 0.8, RIGHT: 0.8, STEP: 0.0},
            surfaces={name: height[name] >= 0 for name in corners},
            tangents={name: corner[0] for name, corner in corners.items()},
            friction={name: {"left": LEFT, "right": RIGHT}[name] for name in corners},
        )
    )  # fmt: skip


@pytest.fixture(scope="module")
def box() -> Kernels:
    return boxes(1)


@pytest.fixture(scope="module")
def renamed() -> Kernels:
    return boxes(-1)


def on_a_corner(b: float, h: float, tilt: float) -> list[float]:
    """The place of a box that stands on its left corner if it is tilted to the left, by a positive
    angle, else on its right one."""
    s = -np.sign(tilt)
    return [s * b - s * b * np.cos(tilt) - h * np.sin(tilt),
            h * np.cos(tilt) - s * b * np.sin(tilt), tilt]  # fmt: skip


@pytest.mark.parametrize("tilt", [0.09, 0.16, 0.24, -0.24])
@pytest.mark.parametrize("h", [0.01, 0.003])
def test_a_block_rocks_on(box: Kernels, renamed: Kernels, tilt: float, h: float) -> None:
    """Housner (1963): each impact keeps (1 - 3/2 sin^2(atan(b/h)))^2 of the energy, that of a
    rotation about the corner that it leaves, and of that about the corner it lands on."""
    ends = []
    for kernels in (box, renamed):
        run = dmoc.simulate(
            kernels, on_a_corner(0.1, 0.3, tilt), step_size=h, steps=round(1.8 / h), restitution=0.0
        )
        assert len(run.collisions) >= 5
        first = "right" if tilt > 0 else "left"
        assert [c.surface == first for c in run.collisions[:4]] == [True, False, True, False]
        for c in run.collisions[:5]:
            kept = c.momentum_after[2] / c.momentum_before[2]
            assert kept**2 == pytest.approx((1 - 1.5 * 0.1) ** 2) == pytest.approx(0.7225)
        assert np.diff(run.energy).max() < 1e-12
        ends.append(run.q[-1])
    assert ends[0] == pytest.approx(ends[1], abs=1e-10)


def test_a_block_that_rocks_comes_to_rest(box: Kernels) -> None:
    """The time to fall from a small tilt, then those up and down each arch, of which the rate is
    0.85 times that before, from theta'' = p^2 (theta - b / h)."""
    tilt, p = 0.01, np.sqrt(GRAVITY * 0.3 / (4 / 3 * (0.1**2 + 0.3**2)))
    falls = np.arccosh(1 / (1 - 3 * tilt)) / p
    rates = 0.85 ** np.arange(1, 200) * np.sqrt(1 - (1 - 3 * tilt) ** 2)
    arches = 2 * np.arctanh(rates) / p
    for h in (0.02, 0.001):
        run = dmoc.simulate(
            box, on_a_corner(0.1, 0.3, tilt), step_size=h, steps=round(1 / h), restitution=0.0
        )
        assert run.q[-1] == pytest.approx([0, 0.3, 0], abs=1e-9)
        rests = max(s.begin for s in run.contacts)
        assert rests == pytest.approx(falls + sum(arches), rel=2e-4)
        flights = np.diff([hit.time for hit in run.collisions])  # none of less than 1e-4 in all
        assert flights.min() > 1e-5 * h
        assert run.normal[-1] == pytest.approx([GRAVITY / 2] * 2)


DROPS = (  # half-width, half-height, mu, tilt, rates, restitution
    (0.2, 0.3, 0.1, 0.05, (0.4, 0.0, 0.0), 0.0), (0.2, 0.3, 0.3, 0.05, (0.4, 0.0, 0.0), 0.0),
    (0.2, 0.2, 2.0, -0.1, (0.0, 0.0, 0.0), 0.0), (0.23, 0.38, 0.05, 0.0, (0.0, 0.0, 2.0), 0.0),
    (0.3, 0.1, 0.3, 0.4, (1.0, -1.0, 0.0), 0.0), (0.15, 0.25, 0.1, 0.05, (-0.4, 0.0, 1.5), 0.3),
    (0.3, 0.25, 1.0, -0.3, (0.5, 0.0, 0.0), 0.0),
)  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("b", "h", "mu", "tilt", "rates", "e"), DROPS)
def test_a_carton_that_is_dropped_falls_in_one_way(
    box: Kernels, renamed: Kernels, b: float, h: float, mu: float, tilt: float,
    rates: tuple[float, float, float], e: float,
) -> None:  # fmt: skip
    """Whatever the order of names, the step size, and which side is called left; energy never
    grows."""
    middle = h * np.cos(tilt) + b * abs(np.sin(tilt)) + 0.1
    data = {"b": b, "h": h, "mu_l": mu, "mu_r": mu}

    def fallen(kernels: Kernels, side: int, step: float) -> Simulation:
        turned = np.array([side, 1, side])
        run = dmoc.simulate(
            kernels, [0, middle, side * tilt], turned * rates, step_size=step,
            steps=round(0.8 / step), restitution=e, parameters=data,
        )  # fmt: skip
        assert np.diff(run.energy).max() < 1e-10
        assert all(c.impulse > 0 for c in run.collisions)
        corners = run.q[:, 1] - b * np.abs(np.sin(run.q[:, 2])) - h * np.cos(run.q[:, 2])
        assert corners.min() > -1e-9
        return run.q[-1] * turned

    first = fallen(box, 1, 0.01)
    for other in (fallen(renamed, 1, 0.01), fallen(box, -1, 0.01), fallen(box, 1, 0.004)):
        assert other == pytest.approx(first, abs=1e-6)


# Single impacts -----------------------------------------------------------------------------------


def impact(
    kernels: Kernels, q: np.ndarray, v: np.ndarray, e: float, data: Mapping[str, float]
) -> tuple[Model, Blow]:
    model, small = Model(kernels, parameter_row(kernels, dict(data))), np.full(2, 1e-9)
    at = Place(0.0, np.concatenate([q, v]), np.zeros(0), tolerances(small))
    blow = blow_on(model, at, [0, 1], np.full(2, e))
    assert blow is not None
    return model, blow


def tolerances(small: np.ndarray) -> Any:
    return SimpleNamespace(rate=small, slide=small)


def viscous(model: Model, q: np.ndarray, v: np.ndarray, mu: tuple[float, float]) -> np.ndarray:
    """The velocity after a plastic impact on two contacts that are compressed in proportion, each
    as a stiff damper that pushes with what its rate exceeds (1 - tau) times that before it."""
    rows = np.vstack([model.gap_slopes(q)[:, :-1], model.tangent_slopes(q)[:, :-1]])
    inverse, stiff, parts = np.linalg.inv(model.mass(q)), 400.0, 40_000
    w, soft = (rows @ v).tolist(), 1e-4 * float(np.abs(v).max())
    before, total = [max(rate, 0.0) for rate in w[:2]], [0.0] * 4
    columns = (rows @ inverse @ rows.T).tolist()  # of rates by impulses, plain numbers
    for k in range(2 * parts):
        share = max(1 - k / parts, 0.0)
        a, b = (max(w[i] - share * before[i], 0.0) * stiff / parts for i in (0, 1))
        c, d = (
            -max(-1.0, min(1.0, w[2 + i] / soft)) * mu[i] * push for i, push in enumerate((a, b))
        )
        w = [x + p * c - m * a + s * d - n * b for x, (m, n, p, s) in zip(w, columns, strict=True)]
        total = [total[0] - a, total[1] - b, total[2] + c, total[3] + d]
    return np.asarray(v + inverse @ (total @ rows))


TURNS = (  # half-width, half-height, tilt, rates, mu
    (1.0, 0.0, 0.92, (0.445, -1.069, -0.863), (0.28, 0.32)),
    (0.2, 0.3, 0.0, (0.1, -1.0, 0.5), (0.1, 0.1)), (0.2, 0.3, 0.0, (-0.3, -1.0, 2.0), (0.3, 0.2)),
    (0.1, 0.4, 0.0, (0.5, -1.0, -0.3), (0.6, 0.6)), (0.1, 0.3, 0.3, (0.6, -0.4, -1.5), (0.5, 0.4)),
)  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("b", "h", "tilt", "rates", "mu"), TURNS)
def test_two_feet_are_compressed_in_proportion(
    box: Kernels, b: float, h: float, tilt: float, rates: tuple[float, float, float],
    mu: tuple[float, float],
) -> None:  # fmt: skip
    """Feet that stop and turn as both land."""
    data = {"b": b, "h": h, "mu_l": mu[0], "mu_r": mu[1], "d": 2 * b * np.sin(tilt)}
    q = np.array([0.0, b * np.sin(tilt) + h * np.cos(tilt), tilt])
    model, blow = impact(box, q, np.array(rates), 0.0, data)
    assert blow.velocity == pytest.approx(viscous(model, q, np.array(rates), mu), abs=4e-3)


rate, any_box = st.floats(-2, 2), cache(partial(boxes, 1))


@settings(max_examples=150)
@example(0.001, 0.375, -1.5, 0.0, 0.3, 0.5, 0.5, 0.0)  # feet that nearly push along each other
@example(0.0, -0.97, -1.7, -0.97, 3.0, 0.138, 0.498, 0.0)  # sliding jams, so that it goes backwards
@example(0.0, 0.0, -0.5, 1.0, 3.0, 0.5, 0.5, 0.0)  # a corner jams that is not approached
@example(  # and turns the other one faster towards the floor
    0.5, 1.962978872964888, 0.045013564435985566, -0.9412194864462404, 5.0, 0.05220473674485902,
    0.1953143616487903, 0.0,
)  # fmt: skip
@example(0.0, 0.0, -0.5, 1.0001, 2.9, 0.5, 0.5, 0.0)  # or leaves before the other one turns it
@given(
    st.integers(-1000, 1000).map(lambda n: n / 1000), rate, rate, rate,
    st.sampled_from([0.05, 0.3, 1.0, 3.0]),
    st.floats(0.05, 0.5), st.just(0.0) | st.floats(1e-9, 0.5), st.sampled_from([0.0, 0.0, 0.5]),
)  # fmt: skip
def test_what_holds_of_every_impact(
    tilt: float, ahead: float, down: float, turn: float, mu: float, b: float, h: float, e: float
) -> None:
    """Contacts push, friction stays in its cone, both explain the momentum, nothing is approached
    after it, and no energy comes from a plastic impact.  Sliding that jams in a restitution may
    have no outcome, which a simulation tells."""
    kernels, mu = any_box(), min(mu, 1.0) if e else mu
    data = {"b": b, "h": h, "mu_l": mu, "mu_r": mu, "d": 2 * b * np.sin(tilt)}
    q = np.array([0.0, b * np.sin(tilt) + h * np.cos(tilt), tilt])
    v = np.array([ahead, down, turn])
    model, blow = impact(kernels, q, v, e, data)
    size = 1e-7 * max(np.abs(v).max(), 1e-2)
    assert (blow.normal >= -size).all()
    assert (np.abs(blow.tangential) <= mu * blow.normal + size).all()
    M = model.mass(q)
    change = blow.tangential @ model.tangent_slopes(q)[:, :-1]
    change -= blow.normal @ model.gap_slopes(q)[:, :-1]
    assert M @ (blow.velocity - v) == pytest.approx(change, abs=size)
    assert (model.gap_rates(q, blow.velocity) <= size).all()
    if e == 0:
        assert blow.velocity @ M @ blow.velocity <= v @ M @ v * (1 + 1e-9) + size**2


@pytest.mark.parametrize("turn", [1.0, 1.000001])
def test_a_corner_that_jams_at_rest_is_the_limit_of_one_that_is_approached(turn: float) -> None:
    """The corner at rest slides to a stop by an impulse of its own and is compressed before the
    other one, as it is where it is approached ever so slowly."""
    data = {"b": 0.5, "h": 0.5, "mu_l": 3.0, "mu_r": 3.0}
    q, down = np.array([0.0, 0.5, 0.0]), -0.5
    _, at_rest = impact(any_box(), q, np.array([0.0, down, turn]), 0.0, data)
    _, approached = impact(any_box(), q, np.array([0.0, down, 1 - 1e-6]), 0.0, data)
    assert at_rest.velocity == pytest.approx(approached.velocity, abs=2e-6)
    assert at_rest.normal == pytest.approx([25 / 64, 3 / 16], abs=2e-6)
    assert at_rest.tangential == pytest.approx([-5 / 128, -5 / 128], abs=2e-6)
