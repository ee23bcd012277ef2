"""Hits with friction while other contacts are closed and constraints hold: closed forms, what the
check and the simulation make of them, what is refused."""

from __future__ import annotations

from dataclasses import replace
from math import radians, sin

import numpy as np
import pytest
import sympy as sp
from answers import answer_of
from hit_problems import MU, RODS, A, T, X, Y, thrown
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import ProblemError
from dmoc.program.hit_stages import STOP
from dmoc.program.transcription import Transcription

Z, C, D = dynamicsymbols("z c d")
BALL, CART, G, UNDER = sp.symbols("m_b m_c g mu_u")


def cart() -> dmoc.Kernels:
    """A ball flies towards the rough side of a cart that stands on a floor."""
    speeds = BALL * (X.diff(T) ** 2 + Y.diff(T) ** 2) + CART * (C.diff(T) ** 2 + D.diff(T) ** 2)
    return dmoc.build(
        dmoc.MechanicalSystem(
            "hit_cart", [X, Y, C, D], speeds / 2 - G * (BALL * Y + CART * D),
            {BALL: 1.0, CART: 3.0, MU: 1.2, UNDER: 1.1, G: 9.81},
            surfaces={"side": C + 1 - X >= 0, "floor": D >= 0},
            tangents={"side": Y - D, "floor": C}, friction={"side": MU, "floor": UNDER}, cost=1,
        )
    )  # fmt: skip


REST = {"x": 0.0, "y": 0.0, "c": 0.0, "d": 0.0}


def problem(sinking: float, under: float, word: str = "side:slip-") -> dmoc.Problem:
    """The ball meets the side after half a second, with 2 m/s, and sinks then."""
    rates = {"x_dot": 2, "y_dot": -sinking + 9.81 * 0.5, "c_dot": 0, "d_dot": 0}
    return dmoc.Problem(
        cart(), start=REST | rates, contacts=["floor" if under else "floor:slip+"],
        sequence=[word], restitution=0.5, parameters={"mu_u": under}, steps=6, final_time=0.8,
        durations=[(None, None), (0.1, None)],
    )  # fmt: skip


@pytest.mark.parametrize("method", ["ipm", "slsqp"])
def test_a_cart_that_friction_holds_takes_a_hit_like_a_wall(method: str) -> None:
    """The ball rubs the cart down, which presses it on the floor by what it takes to hold it."""
    solution = answer_of(problem(8.905, 1.1), method, starts=1)
    hit = solution.collisions[0]
    assert hit.impulses["side"] == pytest.approx((1 + 0.5) * 2)
    assert hit.tractions["side"] == pytest.approx(1.2 * 3)
    assert hit.impulses["floor"] == pytest.approx(1.2 * 3)
    assert hit.tractions["floor"] == pytest.approx(-3)
    np.testing.assert_allclose(solution.phases[1].v[0], [-1, -8.905 + 3.6, 0, 0], atol=1e-9)


@pytest.mark.parametrize("method", ["ipm", "slsqp"])
def test_a_smooth_floor_holds_the_cart_up_while_the_ball_stops_sinking(method: str) -> None:
    solution = answer_of(problem(1.0, 0.0, "side:slip-:stick"), method, starts=1)
    hit = solution.collisions[0]
    assert hit.impulses["side"] == pytest.approx((1 + 0.5) * 2 / (1 + 1 / 3))
    assert hit.impulses["floor"] == pytest.approx(1.0) == hit.tractions["side"]
    np.testing.assert_allclose(solution.phases[1].v[0], [-0.25, 0, 0.75, 0], atol=1e-8)


@pytest.mark.slow
def test_the_way_through_it_is_found() -> None:
    solution = answer_of(problem(1.0, 0.0, "side"))
    assert solution.collisions[0].course == "slip-:stick"


@pytest.mark.parametrize("sign", ["+", "-"])
@pytest.mark.parametrize("word", ["side:slip-:stick", "side:slip-:stick:late", "side:slip-"])
def test_what_slides_beside_a_hit_goes_on_until_its_stop(sign: str, word: str) -> None:
    """At any unknowns: the row is s c_dot at the stop, whatever c_dot is after the hit."""
    stated = problem(1.0, 0.3, word).but(contacts=[f"floor:slip{sign}"])
    nlp = Transcription(stated)
    lay, scaled = nlp.layout, np.random.default_rng(1).uniform(0.5, 2.0, nlp.n)
    rows = nlp.laws.held.slides_on.numbers
    assert len(rows) == (word != "side:slip-")
    if len(rows):
        x, factor = nlp.physical(scaled), 1.0 if sign == "+" else -1.0
        (at,) = nlp.laws.held.slides_on.numbers
        values = np.concatenate([nlp.equality(scaled), nlp.inequality(scaled)]) * nlp.row_sizes
        assert values[at] == pytest.approx(factor * x[lay.hit.v_h[0, STOP, 2]])


@pytest.mark.parametrize(("sinking", "under"), [(8.905, 1.1), (1.0, 0.0)])
def test_the_simulation_takes_the_same_hit(sinking: float, under: float) -> None:
    way = "side:slip-" if under else "side:slip-:stick"
    after = answer_of(problem(sinking, under, way), starts=1).phases[-1]
    run = dmoc.simulate(
        cart(), REST, {"x_dot": 2, "y_dot": -sinking + 9.81 * 0.5}, step_size=0.01, steps=80,
        restitution=0.5, parameters={"mu_u": under},
    )  # fmt: skip
    np.testing.assert_allclose(run.v[-1], after.v[-1], atol=1e-8)
    np.testing.assert_allclose(run.q[-1], after.q[-1], atol=1e-8)


def test_what_holds_has_to_hold_after_the_stop_too() -> None:
    """In all the floor would bear the push, but not where nothing presses the cart down any more:
    from the stop at P = 2.9 / 1.2 on it slips, as on ice."""
    stops = problem(2.9, 1.1, "side:slip-:stick:late")
    assert dmoc.solve(stops, starts=1).status == "infeasible"
    run = dmoc.simulate(
        cart(), REST, {"x_dot": 2, "y_dot": -2.9 + 9.81 * 0.5}, step_size=0.005, steps=102,
        restitution=0.5, parameters={"mu_u": 1.1},
    )  # fmt: skip
    stop = 2.9 / 1.2
    impulses = {c.surface: (c.impulse, c.tractions[c.surface]) for c in run.collisions}
    assert impulses == {"side": pytest.approx((3, 2.9)), "floor": pytest.approx((2.9, -stop))}
    slips = (3 - stop) / 3
    after = [-1, -9.81 * 0.01, slips - 1.1 * 9.81 * 0.01, 0]
    assert run.v[-1] == pytest.approx(after, abs=1e-8)


def test_a_cart_that_the_floor_cannot_hold_slips() -> None:
    """The floor bears 0.7 of what presses the cart down, 1.2 P, and P pushes it."""
    assert dmoc.solve(problem(8.905, 0.7), starts=1).status == "infeasible"
    slips = problem(8.905, 0.7, "side:slip- floor:slip+")
    slips = slips.but(final_time=0.515, durations=[(None, None), (0.01, None)])  # until it rests
    push = (1 - 0.7 * 1.2) / 3
    P = (1 + 0.5) * 2 / (1 + push)
    hit = answer_of(slips, starts=1).collisions[0]
    assert hit.impulses == pytest.approx({"side": P, "floor": 1.2 * P})
    run = dmoc.simulate(
        cart(), REST, {"x_dot": 2, "y_dot": -4}, step_size=0.005, steps=102, restitution=0.5,
        parameters={"mu_u": 0.7},
    )  # fmt: skip
    assert run.v[-1, [0, 2]] == pytest.approx([2 - P, push * P - 0.7 * 9.81 * 0.01], abs=1e-8)
    held = answer_of(problem(8.905, 1.1), starts=1).trajectory
    weak = replace(held, parameters={**held.parameters, "mu_u": 0.6})
    message = dmoc.verify(weak, cart()).message
    assert "floor would have to pull or to slip, or stop sliding, in the hit of side" in message


def along(sinking: float, ahead: float, under: float, word: str) -> dmoc.Problem:
    """The ball meets the side of a cart that slides away from it."""
    speed = ahead + under * 9.81 * 0.5  # it brakes until the hit
    rates = {"x_dot": 2 + ahead, "y_dot": -sinking + 9.81 * 0.5, "c_dot": speed, "d_dot": 0}
    way = speed * 0.5 - under * 9.81 / 8
    return dmoc.Problem(
        cart(), start={"x": way - (2 + ahead) / 2 + 1, "y": 0.0, "c": 0.0, "d": 0.0} | rates,
        contacts=["floor:slip+"], sequence=[word], restitution=0.5, parameters={"mu_u": under},
        steps=6, final_time=0.52, durations=[(None, None), (0.02, None)],
    )  # fmt: skip


SLIDES = (  # it sinks with, slides ahead with, mu of the floor, the way, T / P once it has stopped
    (8.905, 1.0, 0.5, "side:slip-"),
    (2.9, 1.0, 0.3, "side:slip-:stick:late"),
    (1.0, 1.0, 0.3, "side:slip-:stick"),
)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["ipm", "slsqp"])
@pytest.mark.parametrize(("sinking", "ahead", "under", "word"), SLIDES)
def test_a_cart_that_slides_on_takes_a_hit(
    sinking: float, ahead: float, under: float, word: str, method: str
) -> None:
    """The friction of the floor grows with that of the side, which presses the cart down: of the
    impulses P and T the cart takes P - mu T ahead, and the ball stops sinking at T = its rate."""
    problem = along(sinking, ahead, under, word)
    solution = answer_of(problem, method, starts=1)
    hit = solution.collisions[0]
    stops = sinking / 1.2  # normal impulse until it does not sink any more
    # closing rate 2 - P - (P - mu T) / 3, with T = 1.2 P until then, and T = sinking after it
    compression = 2 / (4 / 3 - under * 1.2 / 3)
    if compression > stops:
        compression = (2 + under * sinking / 3) / (4 / 3)
    P = 1.5 * compression
    T = min(1.2 * P, sinking)
    assert hit.impulses == pytest.approx({"side": P, "floor": T}, rel=1e-7)
    assert hit.tractions == pytest.approx({"side": T, "floor": -under * T}, rel=1e-7)
    after = [2 + ahead - P, T - sinking, ahead + (P - under * T) / 3, 0]
    np.testing.assert_allclose(solution.phases[1].v[0], after, atol=1e-7)
    start = {k: v for k, v in problem.start.items() if not k.endswith("_dot")}
    rates = {k: v for k, v in problem.start.items() if k.endswith("_dot")}
    run = dmoc.simulate(
        cart(), start, rates, step_size=0.01, steps=52, restitution=0.5,
        parameters={"mu_u": under},
    )  # fmt: skip
    np.testing.assert_allclose(run.v[-1], solution.phases[1].v[-1], atol=1e-6)


@pytest.mark.slow
def test_a_box_that_stands_on_both_corners_holds_a_hit() -> None:
    """A ball rubs its side down at a fifth of a metre: P = 3, T = 3.6, and the moments about the
    left corner give the impulses below; of the friction the sum is -P, shared equally."""
    b, h = 0.2, 0.5
    middle, across = X + 0 * A, (Z - X) * sp.cos(A) + (Y - C) * sp.sin(A)
    up = -(Z - X) * sp.sin(A) + (Y - C) * sp.cos(A)
    corners = {
        name: (middle + s * b * sp.cos(A) + h * sp.sin(A), C + s * b * sp.sin(A) - h * sp.cos(A))
        for name, s in (("left", -1), ("right", 1))
    }
    speeds = 3 * (X.diff(T) ** 2 + C.diff(T) ** 2) + A.diff(T) ** 2 * (b**2 + h**2)
    speeds += Z.diff(T) ** 2 + Y.diff(T) ** 2
    system = dmoc.MechanicalSystem(
        "hit_box", [Z, Y, X, C, A], speeds / 2 - G * (Y + 3 * C),
        {MU: 1.2, UNDER: 1.1, G: 9.81}, cost=1,
        surfaces={n: at[1] >= 0 for n, at in corners.items()} | {"side": across >= b},
        tangents={n: at[0] for n, at in corners.items()} | {"side": up},
        friction=dict.fromkeys(corners, UNDER) | {"side": MU},
    )  # fmt: skip
    # After half a second the ball is at 0.2 m and sinks with 8.905 m/s.
    start = {"z": b + 1, "y": 0.2 + 4 * 0.5 + 9.81 / 8, "x": 0, "c": h, "a": 0}
    rates = {"z_dot": -2, "y_dot": -4, "x_dot": 0, "c_dot": 0, "a_dot": 0}
    standing = dmoc.Problem(
        system, start=start | rates, contacts=["left", "right"], sequence=["side:slip-"],
        restitution={"side": 0.5}, steps=6, final_time=0.8, durations=[(None, None), (0.1, None)],
    )  # fmt: skip
    hit = answer_of(standing, starts=1).collisions[0]
    right = 3.6 - 3 * 0.2 / (2 * b)
    expected = {"side": 3, "right": right, "left": 3.6 - right}
    assert hit.impulses == pytest.approx(expected, rel=1e-6)
    assert hit.tractions == pytest.approx({"side": 3.6, "left": 1.5, "right": 1.5}, rel=1e-6)
    run = dmoc.simulate(
        system, start, {k.removesuffix("_dot"): v for k, v in rates.items()}, step_size=0.01,
        steps=80, restitution={"side": 0.5},
    )  # fmt: skip
    np.testing.assert_allclose(run.v[-1, :2], [1, -8.905 + 3.6 - 9.81 * 0.3], atol=1e-8)


@pytest.mark.parametrize(
    ("floor", "how"), [("floor:stick", "stops sliding"), ("floor:slip-", "turns")]
)
def test_contacts_that_stop_or_turn_beside_a_hit_are_refused(floor: str, how: str) -> None:
    with pytest.raises(ProblemError, match=f"floor {how} while side is hit with friction"):
        along(2.9, 1.0, 0.3, f"side:slip- {floor}")


@pytest.mark.slow
@pytest.mark.parametrize(("angle", "v", "mu", "after", "normal", "tangential", "course"), RODS)
def test_constraints_hold_during_a_hit(
    angle: float, v: tuple[float, ...], mu: float, after: tuple[float, ...], normal: float,
    tangential: float, course: str,
) -> None:  # fmt: skip
    """The rod that hits the floor, its height written twice."""
    height, a = Y.diff(T) ** 2 / 2 + Z.diff(T) ** 2 / 2, radians(angle)
    rod = dmoc.MechanicalSystem(
        "joined_rod", [X, Y, A, Z], (X.diff(T) ** 2 + height + A.diff(T) ** 2 / 12) / 2, {MU: 0.2},
        surfaces={"floor": Y - sp.sin(A) / 2 >= 0}, tangents={"floor": X - sp.cos(A) / 2},
        friction={"floor": MU}, constraints={"one": Z - Y}, cost=1,
    )  # fmt: skip
    place = {"x": 0.0, "y": sin(a) / 2, "a": a, "z": sin(a) / 2}
    fallen = dmoc.Problem(
        rod, sequence=[f"floor:{course}"], restitution=0.5, parameters={"mu": mu},
        **thrown((*v, v[1]), place),
    )  # fmt: skip
    solution = answer_of(fallen, starts=1)
    np.testing.assert_allclose(solution.phases[1].v[0], (*after, after[1]), atol=1e-8)
    assert solution.collisions[0].impulses["floor"] == pytest.approx(normal, abs=1e-8)
    assert solution.collisions[0].tractions["floor"] == pytest.approx(tangential, abs=1e-8)


def test_what_holds_may_leave_a_hit_nothing_to_slide_along() -> None:
    """A mass on a smooth floor runs into a rough wall: it comes back with e times its speed."""
    mass = dmoc.MechanicalSystem(
        "mass_in_a_corner", [X, Y], (X.diff() ** 2 + Y.diff() ** 2) / 2 - 9.81 * Y,
        surfaces={"floor": Y >= 0, "wall": X <= 1}, tangents={"wall": Y}, friction={"wall": 0.3},
        cost=1,
    )  # fmt: skip
    motion = dmoc.simulate(
        dmoc.build(mass), [0, 0], [1, 0], step_size=0.05, steps=40,
        restitution={"floor": 0.0, "wall": 0.5},
    )  # fmt: skip
    (hit,) = motion.collisions
    assert hit.time == pytest.approx(1.0) and hit.impulse == pytest.approx(1.5)
    assert motion.q[-1] == pytest.approx([0.5, 0.0], abs=1e-6)
