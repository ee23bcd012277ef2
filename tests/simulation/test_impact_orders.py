"""Several surfaces that are hit at one moment: what is symmetric stays so, whatever the names, and
where the order decides the notes say what each would make of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.simulation.simultaneous_impacts import simultaneous

T = dynamicsymbols._t
x, y, a = dynamicsymbols("x y a")
SIDES = ("left", "right"), ("right", "left")
GRAVITY = 9.81


def valley(slope: float, mu: float, names: Sequence[str]) -> Kernels:
    """A ball over a valley between two planes."""
    c, s = float(np.cos(slope)), float(np.sin(slope))
    signs = {"left": -1, "right": 1}
    tangents = {n: c * x + signs[n] * s * y for n in names}
    rough = {"tangents": tangents, "friction": dict.fromkeys(names, mu)} if mu else {}
    return dmoc.build(
        dmoc.MechanicalSystem(
            "valley", [x, y], (x.diff(T) ** 2 + y.diff(T) ** 2) / 2 - GRAVITY * y,
            surfaces={n: c * y - signs[n] * s * x >= 0 for n in names}, **rough,
        )
    )  # fmt: skip


@pytest.mark.parametrize("names", SIDES)
@pytest.mark.parametrize("e", [1.0, 0.5])
@pytest.mark.parametrize("degrees", [20, 30, 40])
def test_a_ball_that_falls_straight_into_a_valley_comes_straight_back(
    degrees: float, e: float, names: Sequence[str]
) -> None:
    run = dmoc.simulate(
        valley(np.radians(degrees), 0.0, names), [0, 0.5], step_size=0.01, steps=55, restitution=e
    )
    fallen = np.sqrt(GRAVITY)
    after = 0.55 - fallen / GRAVITY
    expected = e * fallen * after - GRAVITY * after**2 / 2
    assert run.q[-1] == pytest.approx([0, expected], abs=1e-9)
    (note,) = run.notes
    assert "hit at once at t = 0.319275 s, and which comes first decides" in note


def test_the_notes_tell_what_each_order_makes() -> None:
    """A plane of 30 degrees alone turns the fall w into (-w sin 60, w cos 60), along the other."""
    run = dmoc.simulate(valley(np.pi / 6, 0.0, SIDES[0]), [0, 0.5], step_size=0.01, steps=40)
    w = np.sqrt(GRAVITY)
    aside, up = f"{w * np.sin(np.pi / 3):.4g}", f"{w / 2:.4g}"
    (note,) = run.notes
    assert f"they leave x_dot = 0, y_dot = {w:.4g}; " in note
    assert f"'left' first: x_dot = {aside}, y_dot = {up}; " in note
    assert note.endswith(f"'right' first: x_dot = -{aside}, y_dot = {up}")


def test_orders_that_agree_need_no_note() -> None:
    """Planes at right angles turn any velocity round."""
    run = dmoc.simulate(valley(np.pi / 4, 0.0, SIDES[0]), [0, 0.5], step_size=0.01, steps=55)
    assert run.notes == () and run.q[-1, 0] == pytest.approx(0, abs=1e-9)
    assert run.energy[-1] == pytest.approx(0.5 * GRAVITY)


@pytest.mark.parametrize("names", SIDES)
def test_friction_leaves_what_is_symmetric_so(names: Sequence[str]) -> None:
    """Both push up with 2 P (cos + mu sin) until the fall w stops, and friction turns then: they
    throw the ball back with 2 e P (cos - mu sin)."""
    mu, e, slope = 0.2, 0.5, np.pi / 6
    run = dmoc.simulate(
        valley(slope, mu, names), [0, 0.5], step_size=0.005, steps=70, restitution=e
    )
    w, hit = np.sqrt(GRAVITY), run.collisions[0]
    up, down = (np.cos(slope) + s * mu * np.sin(slope) for s in (1, -1))
    P = w / (2 * up)
    assert hit.impulse == pytest.approx((1 + e) * P)
    assert abs(hit.tractions[hit.surface]) == pytest.approx(mu * (1 - e) * P)
    after = 0.35 - w / GRAVITY
    assert run.v[-1] == pytest.approx([0, e * w * down / up - GRAVITY * after], abs=1e-9)


@pytest.mark.parametrize("names", SIDES)
@pytest.mark.parametrize(("mu", "e"), [(0.0, 1.0), (0.0, 0.5), (0.3, 1.0), (0.3, 0.5)])
def test_a_box_that_falls_flat_rises_flat(names: Sequence[str], mu: float, e: float) -> None:
    b, h = 0.2, 0.5
    at = {n: {"left": -1, "right": 1}[n] for n in names}
    tangents = {n: x + s * b * sp.cos(a) + h * sp.sin(a) for n, s in at.items()}
    rough = {"tangents": tangents, "friction": dict.fromkeys(names, mu)} if mu else {}
    rates = x.diff(T) ** 2 + y.diff(T) ** 2 + (b**2 + h**2) / 3 * a.diff(T) ** 2
    box = dmoc.MechanicalSystem(
        "flat_box", [x, y, a], rates / 2 - GRAVITY * y,
        surfaces={n: y + s * b * sp.sin(a) - h * sp.cos(a) >= 0 for n, s in at.items()}, **rough,
    )  # fmt: skip
    run = dmoc.simulate(dmoc.build(box), [0, 1, 0], step_size=0.01, steps=50, restitution=e)
    w = np.sqrt(GRAVITY)
    after = 0.5 - w / GRAVITY
    height = h + e * w * after - GRAVITY * after**2 / 2
    assert run.q[-1] == pytest.approx([0, height, 0], abs=1e-9)
    assert "'left' first: " in run.notes[-1] and "'right' first: " in run.notes[-1]


@pytest.mark.parametrize("names", [("ab", "ac", "bc"), ("bc", "ac", "ab")])
def test_a_disc_on_two_that_touch(names: Sequence[str]) -> None:
    """Of mass 1 and diameter 1, in free flight."""
    q = dynamicsymbols("x1 y1 x2 y2 x3 y3")
    discs = {"a": q[:2], "b": q[2:4], "c": q[4:]}

    def apart(one: str, other: str) -> sp.Expr:
        return sp.sqrt(sum((p - r) ** 2 for p, r in zip(discs[one], discs[other], strict=True)))

    system = dmoc.MechanicalSystem(
        "three_discs", list(q), sum(c.diff(T) ** 2 for c in q) / 2,
        surfaces={name: apart(*name) >= 1 for name in names},
    )  # fmt: skip
    run = dmoc.simulate(
        dmoc.build(system), [0, 2.0, -0.5, 0.5, 0.5, 0.5], [0, -1, 0, 0, 0, 0], step_size=0.01,
        steps=90,
    )  # fmt: skip
    # It gets 2 P cos 30 up, each other one P along its line: by the energy, v^2 = (v - 2 P c)^2 +
    # 2 P^2 with c = cos 30, so that P = 4 v c / (4 c^2 + 2).
    P = 4 * np.cos(np.pi / 6) / 5
    up = 2 * P * np.cos(np.pi / 6) - 1
    sides = [P / 2, P * np.cos(np.pi / 6)]
    assert run.v[-1] == pytest.approx([0, up, -sides[0], -sides[1], sides[0], -sides[1]], abs=1e-9)
    assert {c.surface for c in run.collisions} == {"ab", "ac"} and len(run.notes) == 1


numbers = st.floats(-1, 1)


@settings(max_examples=100, deadline=None)
@given(
    arrays(float, (3, 3), elements=numbers), arrays(float, 3, elements=st.floats(0.05, 1)),
    arrays(float, 3, elements=st.sampled_from([0.0, 0.5, 1.0])), st.permutations(range(3)),
)  # fmt: skip
def test_impacts_at_once_gain_no_energy(
    slopes: np.ndarray, rates: np.ndarray, e: np.ndarray, order: list[int]
) -> None:
    """Whatever their coefficients; nothing pulls, nothing is approached after them, and the names
    do not matter."""
    response = slopes @ slopes.T + 0.2 * np.eye(3)

    def whole(order: list[int]) -> np.ndarray:
        hits = simultaneous(
            np.zeros(3), np.full(3, 1e-13), rates[order], rates[order],
            response[np.ix_(order, order)], e[order], 0.0,
        )  # fmt: skip
        assert hits is not None and all(impulse > 0 for _, impulse in hits.impulses)
        sums = np.zeros(3)
        for j, impulse in hits.impulses:
            sums[order[j]] += impulse
        return sums

    impulses = whole([0, 1, 2])
    assert impulses @ response @ impulses <= 2 * impulses @ rates * (1 + 1e-9)
    assert (rates - response @ impulses <= 1e-8).all()
    assert whole(order) == pytest.approx(impulses, abs=1e-6)
