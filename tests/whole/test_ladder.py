"""The ladder of the benchmarks: its statements lead to the known answers, and its judges tell what
is none."""

from __future__ import annotations

import numpy as np
import pytest
from ablation import PATCHES
from answers import answer_of
from ladder_problems import RUNGS, Rung, two_carts_cost
from long_runs import LOBATTO, RADAU, collocation
from pages import ROOT

import dmoc

# With 50 steps its tilt exceeds its limit between the nodes by 0.502 %, where 0.5 % is allowed.
STEPS = {"planar quadrotor, least time": 45}


@pytest.mark.slow
@pytest.mark.parametrize("rung", RUNGS, ids=lambda r: r.name)
def test_a_statement_leads_to_the_known_answer(rung: Rung) -> None:
    """Sequential programming begins with a minimum of ipm, as it does where it is asked alone."""
    problem, solution = rung.make(STEPS.get(rung.name, 50), 4), None
    for method in ("ipm", "slsqp"):
        solution = answer_of(problem, method, guess=solution)
        assert rung.compared(solution.cost, True) == "solved", solution.cost


@pytest.mark.slow
def test_an_odd_number_of_steps_gets_no_further() -> None:
    rung = next(r for r in RUNGS if r.name.startswith("furthest"))
    cost = dmoc.solve(rung.make(51, 2), "ipm").cost
    assert -0.25 - 1e-9 < cost < -0.2498


def test_two_carts_cost_least_at_the_best_time_of_the_hit() -> None:
    T = np.linspace(0.5, 2.9, 24001)
    v = 16 / 3 / (3 - T)
    assert two_carts_cost() == pytest.approx((6 / T**3 - 6 * v / T**2 + 2 * v**2 / T).min())


@pytest.mark.parametrize("best", [10.0, -10.0])
def test_a_cost_counts_within_the_tolerance_and_below_it_only_if_checked(best: float) -> None:
    rung = Rung("any", RUNGS[0].state, best, 0.01, "")
    assert rung.compared(best + 0.09, False) == rung.compared(best - 0.09, False) == "solved"
    assert rung.compared(best + 0.11, True) == "dearer"
    assert rung.compared(best - 0.11, True) == "better"
    assert rung.compared(best - 0.11, False) == "below"


def from_the_minimum(problem: dmoc.Problem) -> dmoc.Solution:
    """A solve by SLSQP from a minimum without its multipliers."""
    return dmoc.solve(problem, "slsqp", guess=dmoc.solve(problem, "ipm").unknowns)


@pytest.mark.slow
def test_a_singular_pattern_ends_no_process() -> None:
    """More limits are active than the free unknowns can keep, and SuperLU would crash."""
    rung = next(r for r in RUNGS if r.name.startswith("flying robot"))
    solution = from_the_minimum(rung.make(200, 2))
    assert solution.cost == pytest.approx(20.0, rel=1e-6)


@pytest.mark.slow
def test_sequential_programming_ends_on_a_flat_minimum() -> None:
    """The switches of an input at its limits hardly change the cost: SLSQP would creep, and the
    matching that told whether the pattern is singular took no end."""
    rung = next(r for r in RUNGS if r.name == "robot arm with its Lagrangian")
    solution = from_the_minimum(rung.make(120, 4))
    assert (solution.status, solution.method) == ("solved", "slsqp")
    assert solution.cost == pytest.approx(7.84477, rel=1e-5)


def test_collocations_have_the_published_tableaus() -> None:
    """Simpson's rule with Hermite's polynomial; Radau IIA with two stages (Hairer and Wanner)."""
    A, b = collocation(LOBATTO)
    np.testing.assert_allclose(b, [1 / 6, 2 / 3, 1 / 6])
    np.testing.assert_allclose(A[1], [5 / 24, 1 / 3, -1 / 24], atol=1e-15)
    A, b = collocation(RADAU[2])
    np.testing.assert_allclose(A, [[5 / 12, -1 / 12], [3 / 4, 1 / 4]])
    np.testing.assert_allclose(b, [3 / 4, 1 / 4])
    moments = [collocation(RADAU[3])[1] @ RADAU[3] ** k for k in range(5)]
    np.testing.assert_allclose(moments, 1 / np.arange(1, 6))


@pytest.mark.parametrize("part", PATCHES)
def test_a_part_of_ipm_that_is_left_out_stands_once_in_its_source(part: str) -> None:
    file, old, new = PATCHES[part]
    assert (ROOT / "solvers" / file).read_text().count(old) == 1 and old != new
