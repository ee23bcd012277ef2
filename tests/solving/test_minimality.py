"""Answers are minima to second order: a solve goes on from saddles and maxima, and says what it
cannot mend."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import sympy as sp
from answers import answer_of
from methods import INSTALLED
from scipy.integrate import quad
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.solvers.outcome import Status

pytestmark = pytest.mark.slow

x, y, u, v = dynamicsymbols("x y u v")
REST = {"x": 0.0, "x_dot": 0.0}


def line(name: str, cost: Any, lagrangian: Any = None, **fields: Any) -> Kernels:
    """A mass on a line, or what else has one coordinate and one input."""
    return dmoc.build(
        dmoc.MechanicalSystem(
            name, coordinates=[x], inputs=[u],
            lagrangian=x.diff() ** 2 / 2 if lagrangian is None else lagrangian, forces={x: u},
            cost=cost, **{"parameters": {}} | fields,
        )
    )  # fmt: skip


@pytest.fixture(scope="module")
def hill() -> dmoc.Problem:
    """A point mass that has to get past a hill, which it may go around on both sides."""
    around = (x - sp.Rational(1, 2)) ** 2 + y**2
    system = dmoc.MechanicalSystem(
        "hill", coordinates=[x, y], inputs=[u, v], lagrangian=(x.diff() ** 2 + y.diff() ** 2) / 2,
        forces={x: u, y: v}, parameters={}, cost=(u**2 + v**2) / 2 + 60 * sp.exp(-20 * around),
    )  # fmt: skip
    rest = {"y": 0.0, "x_dot": 0.0, "y_dot": 0.0}
    ends = {"start": {"x": 0.0} | rest, "goal": {"x": 1.0} | rest}
    return dmoc.Problem(system, **ends, steps=40, final_time=1)


def detour(size: float) -> float:
    """The cost of going past the hill along x of least effort and y = size sin^2(pi t)."""

    def rate(t: float) -> float:
        effort = (6 - 12 * t) ** 2 + (2 * np.pi**2 * size * np.cos(2 * np.pi * t)) ** 2
        past = (3 * t**2 - 2 * t**3 - 0.5) ** 2 + (size * np.sin(np.pi * t) ** 2) ** 2
        return float(effort / 2 + 60 * np.exp(-20 * past))

    return float(quad(rate, 0, 1, points=[0.5])[0])


@pytest.mark.parametrize(
    ("method", "form"), [("slsqp", "full"), *((name, "condensed") for name in INSTALLED)]
)
def test_a_motion_over_the_hill_goes_around_it(hill: dmoc.Problem, method: str, form: str) -> None:
    solution = answer_of(hill, method, form=form, starts=1)
    assert "motions beside a stationary one of cost 21.6" in solution.message
    assert solution.cost < min(detour(size) for size in (0.0, 0.05, 0.15, 0.3)) - 0.1


def test_both_images_of_a_detour_cost_the_same(hill: dmoc.Problem) -> None:
    one = dmoc.solve(hill, "ipm", starts=1)
    (phase,) = one.phases
    other = dmoc.solve(
        hill, "ipm", guess={"x": list(phase.q[:, 0]), "y": list(-phase.q[:, 1])}, starts=1
    )
    assert "stationary" not in other.message
    assert other.cost == pytest.approx(one.cost, rel=1e-8)
    np.testing.assert_allclose(other.phases[0].q[:, 1], -phase.q[:, 1], atol=1e-5)


def test_a_saddle_at_which_the_iterations_are_spent_is_no_minimum(hill: dmoc.Problem) -> None:
    solution = dmoc.solve(hill, "ipm", starts=1, iterations=6)
    assert solution.status is Status.STATIONARY and not solution.converged
    assert "iteration_limit" in solution.message and solution.cost == pytest.approx(21.689, abs=0.1)
    assert dmoc.Solution.from_bytes(solution.to_bytes()).status is Status.STATIONARY


def test_the_best_of_many_starts_is_no_saddle(hill: dmoc.Problem) -> None:
    solution = answer_of(hill, "ipm", starts=4)
    assert solution.cost < 21.2
    assert all(other.cost < 21.2 or other.status == "coarse" for other in solution.others)


@pytest.fixture(scope="module")
def clamped() -> Kernels:
    """Effort against a push outwards: x = 0 is the minimum as long as a clamped beam does not
    buckle, x'''' = c x with x = x' = 0 at both ends, which is up to c = 4.7300^4 = 500.56."""
    c = sp.Symbol("c")
    return line("clamped", u**2 / 2 - c * x**2 / 2, parameters={c: 1.0})


@pytest.mark.parametrize("method", ["ipm", "slsqp"])
@pytest.mark.parametrize("push", [480.0, 520.0])
def test_the_load_at_which_rest_ceases_to_be_a_minimum(
    clamped: Kernels, method: str, push: float
) -> None:
    """Beyond it the cost has no minimum at all, and with bounds one away from rest."""
    rest = {"start": REST, "goal": REST, "steps": 40, "final_time": 1.0, "parameters": {"c": push}}
    problem = dmoc.Problem(clamped, **rest)
    solution = dmoc.solve(problem, method, starts=1, iterations=200)
    assert solution.cost == 0
    assert solution.status is (Status.SOLVED if push < 500 else Status.STATIONARY)
    limited = answer_of(problem.but(bounds={"u": (-1.0, 1.0)}), method, starts=1)
    assert (limited.cost < -1e-3) is (push > 500)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["ipm", "slsqp"])
def test_rest_on_top_of_a_terminal_cost(method: str) -> None:
    """From rest, cost of u^2/2 less k x(1)^2/2: with u = min(1, c (1 - t)), c = k x(1), the least
    cost is 1/2 - 1/(3 c) - k (1/2 - 1/(6 c^2))^2/2 where c > 1; x = 0 is a minimum for k < 3."""
    k = sp.Symbol("k")
    kernels = line("top", u**2 / 2, terminal_cost=-k * x**2 / 2, parameters={k: 1.0})
    problem = dmoc.Problem(
        kernels, start=REST, goal={"x": None, "x_dot": None}, steps=50, final_time=1.0,
        bounds={"u": (-1.0, 1.0)}, parameters={"k": 12.0},
    )  # fmt: skip
    c = 6.0
    for _ in range(50):
        c = 12 * (1 / 2 - 1 / (6 * c**2))
    least = 1 / 2 - 1 / (3 * c) - 6 * (c / 12) ** 2
    solution = answer_of(problem, method, starts=1)
    assert solution.cost == pytest.approx(least, rel=2e-3)
    low = answer_of(problem.but(parameters={"k": 2.9}), method, starts=1)
    assert low.cost == 0 and low.message.startswith("a local minimum was found")


@pytest.mark.slow
@pytest.mark.parametrize("method", ["ipm", "slsqp"])
def test_a_pendulum_held_upright_falls_where_that_pays(method: str) -> None:
    """Upright with w^2 = 4 and a reward of c (1 - cos x) for leaving: to second order
    (D^2 - w^2)^2 x = c x, so that the rates are +-i b and +-a with b^2 = sqrt(c) - w^2 and
    a^2 = sqrt(c) + w^2; rest at both ends has a solution where
    2 a b (1 - cos b cosh a) + (a^2 - b^2) sin b sinh a = 0, first at c = 614.52."""
    c = sp.Symbol("c")
    reward = u**2 / 2 + c * (sp.cos(x) - 1)
    kernels = line("upright", reward, x.diff() ** 2 / 2 - 4 * sp.cos(x), parameters={c: 1.0})

    def ends(reward: float) -> float:
        a, b = np.sqrt(np.sqrt(reward) + 4), np.sqrt(np.sqrt(reward) - 4)
        rest = (a**2 - b**2) * np.sin(b) * np.sinh(a)
        return float(2 * a * b * (1 - np.cos(b) * np.cosh(a)) + rest)

    from scipy.optimize import brentq

    critical = brentq(ends, 300, 900)
    for share in (0.95, 1.05):
        problem = dmoc.Problem(
            kernels, start=REST, goal=REST, steps=60, final_time=1.0,
            parameters={"c": share * critical},
        )  # fmt: skip
        solution = dmoc.solve(problem, method, starts=1, verify=False)
        assert solution.status is Status.SOLVED and (solution.cost < -1e-3) is (share > 1)


@pytest.mark.parametrize(
    ("cost", "stated"),
    [
        (sp.Integer(0), {"goal": {"x": 1.0, "x_dot": 0.0}, "final_time": 1.0}),
        (u**2 / 2, {"goal": REST, "final_time": (0.5, 2.0)}),
        (u**2 / 2, {"goal": {"x": 1.0, "x_dot": None}, "start": {"x": 0.0, "x_dot": None},
                    "final_time": (0.5, 2.0)}),
    ],
    ids=["no cost", "waiting", "coasting"],
)  # fmt: skip
@pytest.mark.parametrize("method", ["ipm", "slsqp"])
def test_one_minimum_among_others_is_said_to_be_so(method: str, cost: Any, stated: Any) -> None:
    """Any input does, any duration does, any speed does."""
    problem = dmoc.Problem(
        line("left_open", cost), **{"start": REST} | stated, steps=20, bounds={"u": (-9.0, 9.0)}
    )
    solution = answer_of(problem, method, starts=1)
    assert solution.message.count("others cost the same") == 1
    sharp = problem.but(final_time=1.0, start=REST, goal={"x": 0.5, "x_dot": 0.0})
    if cost != 0:
        assert "cost the same" not in dmoc.solve(sharp, method, starts=1).message


@pytest.mark.parametrize("steps", [10, 25])
def test_what_vanishes_with_the_steps_is_not_called_open(steps: int) -> None:
    """Full thrust to the wall and full thrust back: what the two inputs beside the hit are, is
    left open by the discretisation alone."""
    kernels = line("bang_bang", sp.Integer(1), surfaces={"wall": x <= 1})
    problem = dmoc.Problem(
        kernels, start=REST, goal=REST, sequence=["wall"], steps=steps, final_time=(0.1, 9.0),
        bounds={"u": (-1.0, 1.0)}, controls="linear",
    )  # fmt: skip
    solution = answer_of(problem, "ipm", starts=1)
    assert solution.cost == pytest.approx(2 * np.sqrt(2), rel=1e-3)
    assert "others cost the same" not in solution.message


@pytest.mark.slow
def test_what_is_left_open_is_said_once() -> None:
    """A refinement looks at durations and positions, the conditions of second order at all."""
    waiting = dmoc.Problem(
        line("waits", u**2 / 2), start=REST, goal=REST, final_time=(0.5, 2.0),
        bounds={"u": (-9.0, 9.0)},
    )  # fmt: skip
    solution = answer_of(waiting, starts=2)
    assert solution.message.count("others cost the same") == 1
    assert "the problem does not determine the duration of phase 0: others" in solution.message


@pytest.mark.slow
def test_hidden_unknowns_are_not_called_open() -> None:
    k = sp.Symbol("k", positive=True)
    kernels = line("for_nothing", k * sp.Abs(u), parameters={k: 1.0})
    problem = dmoc.Problem(
        kernels, start=REST, goal={"x": 0.5, "x_dot": 0.0}, steps=10, final_time=2.0,
        bounds={"u": (-1.0, 1.0)}, parameters={"k": 0.0},
    )  # fmt: skip
    solution = answer_of(problem, "ipm", starts=1)
    assert "unknown for" not in solution.message


def test_what_a_method_calls_stalled_is_no_minimum_at_a_saddle(
    hill: dmoc.Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A refinement takes a point that rounding errors keep from getting sharper for a minimum."""
    from dmoc.solvers import judge

    real = judge.verdict

    def dull(*arguments: Any) -> Status:
        status = real(*arguments)
        return Status.STALLED if status is Status.SOLVED else status

    with monkeypatch.context() as patch:
        patch.setattr(judge, "verdict", dull)
        solution = dmoc.solve(hill, "ipm", starts=1)
    assert solution.status is Status.STATIONARY
    assert replace(solution, status=Status.STALLED).optimality < 1e-6
