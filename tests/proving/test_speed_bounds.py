"""Proofs of motions whose velocities are bounded: answers by hand, and those of a quadratic program
that is written down here."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize, minimize_scalar
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.proving.branch import Branch
from dmoc.proving.global_proof import Claim
from dmoc.proving.linear import IN_SUM, LinearProblem
from dmoc.proving.linear_problem import linear_problem

t = dynamicsymbols._t
x, u = dynamicsymbols("x u")
E = 0.8


@pytest.fixture(scope="module")
def kernels() -> dict[int, Kernels]:
    block = dmoc.MechanicalSystem(
        "block_of_a_speed", [x], x.diff(t) ** 2 / 2, inputs=[u], forces={x: u}, cost=u**2 / 2,
        surfaces={"right": x <= 1, "left": x >= 0},
    )  # fmt: skip
    return {order: dmoc.build(block, order=order) for order in (2, 4, 6)}


def there(kernels: Kernels, most: float, **more: Any) -> dmoc.Problem:
    """From rest to rest, a metre further, with a largest speed."""
    bounds = {"x_dot": (None, most)}
    fields = {"final_time": 1, "steps": 8, "bounds": bounds, **more}
    return dmoc.Problem(kernels, start={"x": 0}, goal={"x": 1, "x_dot": 0}, sequence=[], **fields)


def and_back(kernels: Kernels, most: float, **more: Any) -> dmoc.Problem:
    """To the wall and back, with a largest speed in both directions."""
    fields = {"final_time": 1, "steps": 4, "bounds": {"x_dot": (-most, most)}, **more}
    goal = {"x": 0, "x_dot": 0}
    return dmoc.Problem(
        kernels, start={"x": 0}, goal=goal, sequence=["right"], restitution=E, **fields
    )


@pytest.mark.parametrize("final_time", [1, (0.5, 1.0)])
def test_a_speed_is_kept(kernels: dict[int, Kernels], final_time: Any) -> None:
    """Parabolas of the speed v take a = 3/2 (T - 1/v) to v and from it, for 4 v^2/(3 a); without a
    bound it costs 6."""
    for most, near in ((1.2, 1e-9), (1.4, 1e-3)):  # a is a node with the first of them
        proof = dmoc.prove(there(kernels[6], most, final_time=final_time))
        a = 1.5 * (1 - 1 / most)
        assert proof.claim is Claim.OPTIMAL and proof.left_out == ()
        assert proof.cost == pytest.approx(4 * most**2 / (3 * a), rel=near)


@pytest.mark.parametrize(("order", "final_time"), [(2, 1), (6, (0.5, 1.0))])
def test_what_is_too_slow_is_impossible(
    kernels: dict[int, Kernels], order: int, final_time: Any
) -> None:
    bounds = {"x_dot": (-2, 0.99), "u": (-50, 50)}
    problem = there(kernels[order], 0.99, final_time=final_time, bounds=bounds, steps=5)
    assert dmoc.prove(problem).claim is Claim.IMPOSSIBLE


@pytest.mark.parametrize("final_time", [1, (0.9, 1.0)])
def test_speeds_are_kept_in_more_places_than_small_arrays_hold(
    kernels: dict[int, Kernels], final_time: Any
) -> None:
    """Nearly as slow as it may be: at both ends of all steps but for the first ones and the last
    ones; in a box that cannot be divided, too."""
    problem = there(kernels[4], 1.05, final_time=final_time, steps=10)
    motion = dmoc.solve(problem.but(final_time=1), starts=1)
    proof = dmoc.prove(problem, seconds=5)
    assert proof.claim is Claim.OPTIMAL and proof.cost == pytest.approx(motion.cost, rel=1e-9)


@pytest.mark.parametrize(
    "ends", [({"x": 0, "x_dot": None}, {"x": 1, "x_dot": 0}), ({"x": 0}, {"x": 1})]
)
def test_a_start_or_an_end_at_the_largest_speed(kernels: dict[int, Kernels], ends: Any) -> None:
    """A parabola takes a = 3 (T - 1/v) from there to rest, or from rest, for 2 v^2/(3 a)."""
    start, goal = ends
    for T in (1.0, 1.1):
        problem = there(kernels[4], 1.25, final_time=T, bounds={"x_dot": (0, 1.25)})
        proof = dmoc.prove(problem.but(start=start, goal=goal), gap=1e-6)
        assert proof.claim is Claim.OPTIMAL
        assert proof.cost == pytest.approx(2 * 1.25**2 / (9 * (T - 0.8)), rel=5e-3)


def test_speeds_of_a_start_that_is_free_are_those_of_its_bounds(
    kernels: dict[int, Kernels],
) -> None:
    """At a constant speed nothing is paid, and a metre takes as long as that says."""
    free = {"start": {"x": 0, "x_dot": None}, "goal": {"x": 1}, "steps": 3}
    problem = there(kernels[4], 1.25, bounds={"x_dot": (-1, 1.25)}).but(**free)
    assert dmoc.prove(problem.but(final_time=(0.1, 0.85))).cost == pytest.approx(0, abs=1e-9)
    slow = dmoc.prove(problem.but(final_time=(0.1, 0.79), bounds={**problem.bounds, "u": (-9, 9)}))
    assert slow.claim is Claim.IMPOSSIBLE


def test_a_hit_at_the_largest_speed(kernels: dict[int, Kernels]) -> None:
    """A parabola to the speed v in a = 3 (t_1 - 1/v), for 2 v^2/(3 a), and as fast to the wall;
    from there to rest 2 (a^2 + a b + b^2)/t_2, with a and b of both ends, less d/t_2."""
    most = 2.8

    def cost(first: float) -> float:
        t = 1 - first
        a, b = -E * most + 1 / t, 1 / t
        return 2 * most**2 / (9 * (first - 1 / most)) + 2 * (a * a + a * b + b * b) / t

    expected = minimize_scalar(cost, bounds=(0.4, 0.8), method="bounded").fun
    proof = dmoc.prove(and_back(kernels[6], most, steps=8))
    assert proof.claim is Claim.OPTIMAL and expected > 26.3  # without the bound: 24.6
    assert proof.cost == pytest.approx(expected, rel=5e-5)


def least(most: float, first: float, steps: int) -> float:
    """The least cost at the durations of both phases, at order 2: momenta of the steps are those of
    the ends and half the impulses beside them, which inputs give."""

    def motion(inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        momentum, speeds, ends = 0.0, [], []
        for duration, own in ((first, inputs[:steps]), (1 - first, inputs[steps:])):
            h, place = duration / steps, 0.0
            for one in own:
                momentum += h * one / 2
                speeds.append(momentum)
                place += h * momentum
                momentum += h * one / 2
            ends.append(place)
            speeds.append(momentum)
            momentum *= -E
            speeds.append(momentum)
        return np.array(speeds), np.array([*ends, momentum])

    n = 2 * steps
    at_rest = motion(np.zeros(n))
    A, B = (np.array([motion(row)[k] - at_rest[k] for row in np.eye(n)]).T for k in (0, 1))
    h = np.repeat([first / steps, (1 - first) / steps], steps)
    solution = minimize(
        lambda z: float(h @ z**2 / 2), np.linalg.lstsq(B, [1, -1, 0], rcond=None)[0],
        jac=lambda z: h * z, method="SLSQP", options={"ftol": 1e-12, "maxiter": 300},
        constraints=[
            {"type": "eq", "fun": lambda z: B @ z - [1, -1, 0], "jac": lambda z: B},
            {"type": "ineq", "fun": lambda z: most - A @ z, "jac": lambda z: -A},
            {"type": "ineq", "fun": lambda z: most + A @ z, "jac": lambda z: A},
        ],
    )  # fmt: skip
    return float(solution.fun) if solution.success else np.inf


def test_the_program_of_steps_is_bounded(kernels: dict[int, Kernels]) -> None:
    for most in (2.4, 2.8):
        proof = dmoc.prove(and_back(kernels[2], most))
        expected = minimize_scalar(
            lambda first, most=most: least(most, first, 4), bounds=(0.45, 0.6), method="bounded",
            options={"xatol": 1e-7},
        ).fun  # fmt: skip
        assert proof.claim is Claim.OPTIMAL
        assert proof.cost == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("order", [2, 4, 6])
def test_ways_that_are_too_long_in_sum_are_impossible_on_fine_meshes(
    kernels: dict[int, Kernels], order: int
) -> None:
    """It is 2.1 m by way of two walls, at 1.9 m/s in a second. Bounds of the velocities of single
    steps are too many to be priced; with those of the phases the number of steps makes no
    difference, and what is possible stays so."""
    problem = dmoc.Problem(
        kernels[order], start={"x": 0.3}, goal={"x": 0.4, "x_dot": 0}, sequence=["right", "left"],
        restitution=E, final_time=1, steps=20, bounds={"x_dot": (-1.9, 1.9)},
    )  # fmt: skip

    def bounded(problem: dmoc.Problem, best: float) -> Branch:
        branch = Branch(linear_problem(problem.in_rates()), best, 2e3, 1e-2, 1e-6, 10.0)
        branch.run(2000)
        return branch

    assert bounded(problem, np.inf).waiting == 0
    wide = problem.but(bounds={"x_dot": (-4, 4)}, steps=3)
    cost = dmoc.solve(wide, starts=4).cost
    assert 0.99 * cost <= bounded(wide, cost).bound <= cost * (1 + 1e-7)


def test_a_proof_takes_sums_where_no_motion_is_known(
    kernels: dict[int, Kernels], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is possible is proved with the conditions of single steps alone."""
    taken = []

    def branch_of(linear: LinearProblem) -> Any:
        taken.append(any((phase.conditions[:, 4] == IN_SUM).any() for phase in linear.phases))
        return Branch

    monkeypatch.setattr("dmoc.proving.prove.branch_of", branch_of)
    for most, claim in ((1.9, Claim.OPTIMAL), (0.9, Claim.IMPOSSIBLE)):
        bounds = {"x_dot": (-2, most), "u": (-50, 50)}
        problem = there(kernels[2], most, steps=4, bounds=bounds)
        assert dmoc.prove(problem, seconds=5).claim is claim
    assert taken == [False, True]
