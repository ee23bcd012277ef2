"""Problems with known answers: the tolerance of each is what its discretisation earns, and
errors fall with the order."""

from __future__ import annotations

from collections.abc import Callable
from math import log2
from typing import Any

import block_and_wall
import cart_links
import cart_pole
import hanging
import hopper
import numpy as np
import puck
import pytest
import seed as seed_example
import superball
import sympy as sp
import two_bounces
import two_discs
from answers import answer_of
from scipy.integrate import quad
from scipy.optimize import minimize
from sympy.physics.mechanics import dynamicsymbols
from systems import bouncer_problem, bryson_denham, double_integrator, unit_mass

import dmoc

pytestmark = pytest.mark.slow

T = dynamicsymbols._t


def cost(problem: dmoc.Problem) -> float:
    return answer_of(problem, "ipm", starts=1).cost


def orders(error: Callable[[int, int], float], steps: tuple[int, int]) -> dict[int, float]:
    """Order that two meshes show, for both discretisations."""
    return {o: log2(abs(error(steps[0], o)) / abs(error(steps[1], o))) for o in (2, 4)}


@pytest.mark.parametrize("e", [1.0, 0.8, 0.5, 0.0])
def test_block_and_wall(e: float) -> None:
    exact, time, speed = block_and_wall.closed_form(e)
    errors = {}
    for order, steps in ((2, 20), (2, 40), (4, 10), (4, 20)):
        solution = answer_of(block_and_wall.problem(e, steps, order), "ipm", starts=1)
        errors[order, steps] = abs(solution.cost / exact - 1)
        hit = solution.collisions[0]
        tolerance = {2: 0.1 / steps**2 * 40, 4: 20 / steps**4}[order]
        assert (hit.time, hit.momentum_before[0]) == pytest.approx((time, speed), rel=tolerance)
        assert hit.momentum_after[0] == pytest.approx(-e * speed, abs=4 * speed * tolerance)
    assert errors[2, 40] < 2e-3 and errors[4, 20] < 3e-6
    assert 3.5 < errors[2, 20] / errors[2, 40] < 4.5
    # With e = 0 or 1: polynomials of degree 2 in the position before and after, and a law without
    # discrete energies or with equal ones.
    assert (errors[4, 10] < 1e-9) is (e in (0.0, 1.0))
    assert e in (0.0, 1.0) or 3.6 < log2(errors[4, 10] / errors[4, 20]) < 4.3


@pytest.mark.parametrize("e", block_and_wall.EXACT)
def test_the_closed_form_of_the_block_gives_the_published_digits(e: float) -> None:
    assert block_and_wall.closed_form(e) == pytest.approx(block_and_wall.EXACT[e], abs=1e-7)


def test_the_elastic_law_is_kept_to_rounding_and_the_others_to_second_order() -> None:
    for e, tolerance in ((1.0, 1e-10), (0.6, 5e-4)):
        hit = dmoc.solve(block_and_wall.problem(e, 40), "ipm").collisions[0]
        assert hit.momentum_after[0] / hit.momentum_before[0] == pytest.approx(-e, abs=tolerance)


def test_wall_that_moves() -> None:
    """A wall at 1 - 0.3 t: in its frame the block starts and ends with the speed 0.3, and the
    wall stands still."""
    drift, e = 0.3, 0.8
    x, u = dynamicsymbols("x u")
    system = unit_mass(
        "moving_wall", surfaces={"wall": x <= 1 - sp.Rational(3, 10) * T}, cost=u**2 / 2
    )

    def leg(distance: float, before: float, after: float, time: float) -> float:
        d, w = distance - before * time, after - before
        return 6 * d**2 / time**3 - 6 * d * w / time**2 + 2 * w**2 / time

    def unfolded(z: np.ndarray) -> float:
        t, w = z
        return leg(1, drift, w, t) + leg(drift - 1, -e * w, drift, 1 - t)

    best = minimize(
        unfolded, (0.45, 3.0), method="Nelder-Mead", options={"xatol": 1e-11, "fatol": 1e-13}
    )

    def posed(steps: int, order: int) -> dmoc.Problem:
        return dmoc.Problem(
            dmoc.build(system, order=order), start={"x": 0}, goal={"x": 0, "x_dot": 0},
            sequence=["wall"], steps=steps, final_time=1.0, restitution=e,
        )  # fmt: skip

    fine = answer_of(posed(40, 4), "ipm")
    assert fine.cost == pytest.approx(best.fun, rel=1e-8)
    assert fine.collisions[0].time == pytest.approx(best.x[0], abs=1e-6)
    rates = orders(lambda n, o: cost(posed(n, o)) - best.fun, (10, 20))
    assert 1.8 < rates[2] < 2.2 and 3.7 < rates[4] < 4.3
    assert dmoc.solve(posed(40, 2)).cost == pytest.approx(cost(posed(40, 2)), rel=1e-6)


def test_cost_that_depends_on_the_time() -> None:
    """Least int (1 + t) u^2 / 2 from 0 to 1, rest to rest: u = (a + b t) / (1 + t)."""
    system = unit_mass("timed", cost=(1 + T) * dynamicsymbols("u") ** 2 / 2)
    A = [
        [quad(lambda t, f=f, k=k: f(t) * t**k / (1 + t), 0, 1)[0] for k in (0, 1)]
        for f in (lambda t: 1.0, lambda t: 1 - t)
    ]
    a, b = np.linalg.solve(A, [0.0, 1.0])
    exact = quad(lambda t: (a + b * t) ** 2 / (1 + t) / 2, 0, 1)[0]

    def error(n: int, order: int) -> float:
        kernels = dmoc.build(system, order=order)
        return (
            cost(
                dmoc.Problem(
                    kernels, start={"x": 0}, goal={"x": 1, "x_dot": 0}, steps=n, final_time=1.0
                )
            )
            - exact
        )

    rates = orders(error, (5, 10))
    assert 1.8 < rates[2] < 2.2 and 3.7 < rates[4] < 4.3


def test_lagrangian_that_depends_on_the_time() -> None:
    """A mass that grows, m = 1 + t: p = m v is constant, so x = p log(1 + t)."""
    x, u = dynamicsymbols("x u")
    system = dmoc.MechanicalSystem(
        "growing", [x], (1 + T) * x.diff(T) ** 2 / 2, {}, [u], {x: u}, cost=u**2
    )
    for order, tolerance in ((2, 2e-3), (4, 2e-6)):
        run = dmoc.simulate(dmoc.build(system, order=order), [0.0], [2.0], step_size=0.1, steps=20)
        np.testing.assert_allclose(run.q[:, 0], 2 * np.log(1 + run.t), atol=tolerance)
        np.testing.assert_allclose(run.p, 2.0, atol=1e-12)


SPEED = {"speed": dynamicsymbols("x").diff(T) <= sp.Rational(1, 2)}


@pytest.mark.parametrize(
    ("name", "fields", "time"),
    [
        ("fast_integral", {"cost": sp.Integer(1)}, 2.0),
        ("fast_terminal", {"terminal_cost": T}, 2.0),
        ("limited", {"cost": sp.Integer(1), "path_constraints": SPEED}, 2.5),
    ],
)
def test_minimum_time(name: str, fields: dict[str, Any], time: float) -> None:
    """A unit mass with |u| <= 1 from 0 to 1, rest to rest: 2 s.  With v <= 1/2 it takes 0.5 s to
    the limit, 1.5 s along it, 0.5 s to stop."""
    for order in (2, 4):
        problem = dmoc.Problem(
            dmoc.build(unit_mass(name, **fields), order=order), start={"x": 0},
            goal={"x": 1, "x_dot": 0}, steps=40, final_time=(0.5, 5), bounds={"u": (-1, 1)},
        )  # fmt: skip
        assert cost(problem) == pytest.approx(time, rel=2e-3)


def test_terminal_cost_in_position_and_velocity() -> None:
    """J = int u^2 / 2 + s (x_E - 1)^2 / 2 + r v_E^2 / 2 over 1 s: linear-quadratic, so the
    optimum solves two linear equations."""
    x, u = dynamicsymbols("x u")
    s, r = 50, 3
    system = unit_mass(
        "soft_goal", cost=u**2 / 2, terminal_cost=(s * (x - 1) ** 2 + r * x.diff(T) ** 2) / 2
    )
    # u = a (1 - t) + b with a = -s (x_E - 1), b = -r v_E.
    A = np.array([[1 + s / 3, s / 2], [r / 2, 1 + r]])
    a, b = np.linalg.solve(A, [s, 0.0])
    x_E, v_E = a / 3 + b / 2, a / 2 + b
    exact = (
        quad(lambda t: (a * (1 - t) + b) ** 2 / 2, 0, 1)[0]
        + s * (x_E - 1) ** 2 / 2
        + r * v_E**2 / 2
    )
    for order, tolerance in ((2, 1e-3), (4, 1e-10)):
        assert cost(
            dmoc.Problem(dmoc.build(system, order=order), start={"x": 0}, steps=40, final_time=1.0)
        ) == pytest.approx(exact, rel=tolerance)


@pytest.mark.parametrize("e", [0.7, 0.4])
def test_a_periodic_bouncer_gains_what_its_impacts_lose(e: float) -> None:
    rates = orders(lambda n, o: cost(bouncer_problem(e, n, o)[0]) - bouncer_problem(e)[1], (20, 40))
    assert 1.8 < rates[2] < 2.2 and 3.7 < rates[4] < 4.3


@pytest.mark.parametrize("e", [1.0, 0.7, 0.4])
def test_periodic_bouncer(e: float) -> None:
    """The elastic one needs no input and costs nothing."""
    problem, exact = bouncer_problem(e, 20, 4)
    solution = dmoc.solve(problem, "ipm")
    assert solution.cost == pytest.approx(exact, rel=1e-5, abs=1e-8)
    first, last = solution.phases[0], solution.phases[-1]
    assert last.q[-1] == pytest.approx(first.q[0], abs=1e-10) and last.v[-1] == pytest.approx(
        first.v[0], abs=1e-8
    )


def test_double_integrator_and_bryson_denham() -> None:
    assert cost(double_integrator(100)) == pytest.approx(12.0, rel=2e-4)
    assert cost(double_integrator(10, 4)) == pytest.approx(12.0, rel=1e-10)
    assert cost(bryson_denham(100)) == pytest.approx(4.0, rel=5e-4)
    assert cost(bryson_denham(40, 4)) == pytest.approx(4.0, rel=2e-5)


def test_two_bounces_up_to_a_peak() -> None:
    for order, steps, tolerance in ((2, 50, 4e-4), (4, 10, 1e-8)):
        solution = answer_of(two_bounces.problem(steps, order), "ipm")
        assert solution.phases[0].v[0, 0] == pytest.approx(3.866780188, rel=tolerance)
        assert [p.duration for p in solution.phases] == pytest.approx(
            [0.788334391, 0.709500952, 0.319275428], rel=tolerance
        )
        assert solution.final_time == pytest.approx(1.817110772, rel=tolerance)


def test_a_superball_comes_back_from_under_a_table() -> None:
    solution = answer_of(superball.problem(), "ipm")
    first, last = solution.phases[0], solution.phases[-1]
    assert first.v[0, 2] == pytest.approx(5 * 3.0 / (26 * 0.03), rel=1e-9)
    assert last.v[-1] == pytest.approx(-first.v[0], rel=1e-9)


def test_two_discs() -> None:
    for order, steps, tolerance in ((2, 50, 5e-5), (4, 20, 1e-7)):
        solution = answer_of(two_discs.problem(steps, order), "ipm")
        assert solution.cost == pytest.approx(1.39654216, rel=tolerance)
        assert solution.collisions[0].time == pytest.approx(0.683220, abs=1e-5)
    default = answer_of(two_discs.problem(20))
    assert default.cost == pytest.approx(cost(two_discs.problem(20)), rel=1e-6)


def test_kellys_cart_pole() -> None:
    """From his straight guess Kelly's motion, whose cost on a fine mesh is 58.808; from the
    automatic ones a cheaper minimum."""
    problem = cart_pole.problem(80, 4)
    kelly, best = (
        dmoc.solve(problem, "ipm", guess=cart_pole.straight(problem)),
        dmoc.solve(problem, "ipm", starts=40),
    )
    assert kelly.solved and kelly.cost == pytest.approx(cart_pole.LIMIT, rel=1e-5)
    assert kelly.cost == pytest.approx(cart_pole.DYMOS, rel=2e-3)
    assert best.solved and best.cost == pytest.approx(57.9449, rel=1e-5)


def test_seed_at_both_orders() -> None:
    assert cost(seed_example.problem()) == pytest.approx(129.602392, rel=1e-7)
    assert cost(seed_example.problem(20, 4)) == pytest.approx(seed_example.LIMIT, rel=1e-4)
    assert cost(seed_example.problem(80, 4)) == pytest.approx(seed_example.LIMIT, rel=1e-6)


def test_hanging_pendulum_at_both_orders() -> None:
    solution = dmoc.solve(hanging.problem())
    fine = dmoc.solve(hanging.problem(50, 4), "ipm", guess=solution)
    assert solution.solved and fine.solved
    assert fine.cost == pytest.approx(solution.cost, rel=5e-4)


def test_puck_among_walls() -> None:
    problem = puck.problem(20, 4)
    assert puck.least_cost(problem.start, problem.goal, 2.0) == pytest.approx(0.415, abs=1e-12)
    assert cost(problem) == pytest.approx(0.415, rel=1e-8)
    assert cost(puck.problem()) == pytest.approx(0.415, rel=1e-4)


def test_hopper_carries_its_weight_and_is_periodic() -> None:
    solution = answer_of(hopper.problem(), "ipm", starts=8)
    assert solution.collisions[0].impulse == pytest.approx(
        1.3 * hopper.G * solution.final_time, rel=1e-9
    )
    first, last = solution.phases[0], solution.phases[-1]
    assert last.q[-1, 1:] == pytest.approx(first.q[0, 1:], abs=1e-9)
    assert last.p[-1] == pytest.approx(first.p[0], abs=1e-9)


@pytest.mark.parametrize("links", [1, 2])
def test_cart_with_links_and_a_stop(links: int) -> None:
    """Both discretisations find the same motion, and the simulation confirms it."""
    problems = cart_links.problem(links), cart_links.problem(links, 40, 4)
    coarse, fine = (answer_of(problem, "ipm", starts=8).cost for problem in problems)
    assert coarse == pytest.approx(fine, rel=1e-2)


def test_a_lossy_ball_ends_where_it_should() -> None:
    """Drop from 0.8 with e = 0.6: impacts at t_1 (1 + 2 e), t_1 (1 + 2 e + 2 e^2) ...; steps of
    order 4 are exact in free flight and at impacts."""
    ball = dmoc.build(two_bounces.system(), order=4)
    fall, e = (2 * 0.8 / 9.81) ** 0.5, 0.6
    run = dmoc.simulate(ball, [0.8], step_size=0.01, steps=120, restitution=e)
    times = [fall, fall * (1 + 2 * e), fall * (1 + 2 * e + 2 * e**2)]
    assert [c.time for c in run.collisions] == pytest.approx(times, abs=1e-9)
    speeds = [9.81 * fall * e**k for k in range(3)]
    assert [-c.momentum_before[0] for c in run.collisions] == pytest.approx(speeds, rel=1e-9)
    second_order = dmoc.simulate(
        dmoc.build(two_bounces.system()), [0.8], step_size=0.01, steps=120, restitution={"floor": e}
    )
    assert [c.time for c in second_order.collisions] == pytest.approx(times, abs=1e-3)


def test_block_thrown_back_by_a_moving_wall() -> None:
    """A wall that comes with the speed 0.5: v+ = -e v- - (1 + e) 0.5."""
    x = dynamicsymbols("x")
    system = dmoc.MechanicalSystem(
        "swept", [x], x.diff(T) ** 2 / 2, {}, surfaces={"wall": x <= 1 - T / 2}
    )
    for order in (2, 4):
        for e in (1.0, 0.3):
            run = dmoc.simulate(
                dmoc.build(system, order=order), [0.0], [1.0], step_size=0.01, steps=100,
                restitution=e,
            )  # fmt: skip
            assert run.collisions[0].time == pytest.approx(2 / 3, abs=1e-12)
            assert run.p[-1, 0] == pytest.approx(-e - (1 + e) / 2, abs=1e-12)


def test_damped_oscillator() -> None:
    """Spring and Rayleigh damper: x = exp(-t / 5) (cos w t + sin w t / (5 w)), w^2 = 4 - 1/25."""
    x = dynamicsymbols("x")
    system = dmoc.MechanicalSystem(
        "damped", [x], x.diff(T) ** 2 / 2 - 2 * x**2, {}, dissipation=x.diff(T) ** 2 / 5
    )
    w = (4 - 0.04) ** 0.5

    def error(n: int, order: int) -> float:
        run = dmoc.simulate(dmoc.build(system, order=order), [1.0], step_size=3 / n, steps=n)
        return float(
            np.abs(
                run.q[:, 0] - np.exp(-run.t / 5) * (np.cos(w * run.t) + np.sin(w * run.t) / (5 * w))
            ).max()
        )

    rates = orders(error, (20, 40))
    assert 1.9 < rates[2] < 2.1 and 3.8 < rates[4] < 4.2


def test_a_plastic_impact_ends_in_lasting_contact() -> None:
    from dmoc.base.errors import SimulationError

    kernels = dmoc.build(two_bounces.system())
    run = dmoc.simulate(kernels, [0.8], step_size=0.01, steps=100, restitution=0.0)
    assert [(c.surface, c.lands) for c in run.collisions] == [("floor", ("floor",))]
    assert run.contacts[0].end == 1.0
    with pytest.raises(SimulationError, match=r"restitution = 1.5: expected a number from 0"):
        dmoc.simulate(kernels, [0.8], step_size=0.01, steps=100, restitution=1.5)


def test_restitution_needs_no_new_kernels() -> None:
    problem = block_and_wall.problem(0.9)
    assert problem.but(restitution={"wall": 0.2}).kernels is problem.kernels
