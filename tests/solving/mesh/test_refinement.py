"""Mesh refinement: the estimate is honest, and what cannot be reached is said."""

from __future__ import annotations

from dataclasses import replace
from math import nan
from typing import Any

import block_and_wall
import pytest
import seed as seed_example
import sympy as sp
from answers import answer_of
from sympy.physics.mechanics import dynamicsymbols
from systems import block_on_floor, block_system, unit_mass

import dmoc
from dmoc.base.deadline import ENDLESS
from dmoc.base.errors import ProblemError
from dmoc.solvers.outcome import Status
from dmoc.solving.checked_solution import checked
from dmoc.solving.mesh.refinement import refined

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(("order", "tolerance"), [(2, 1e-5), (4, 1e-8)])
def test_the_estimate_bounds_the_error_against_the_closed_form(
    order: int, tolerance: float
) -> None:
    exact, time, _ = block_and_wall.closed_form(0.8)
    solution = dmoc.solve(block_and_wall.problem(0.8, 8, order), tolerance=tolerance)
    assert (
        solution.solved
        and solution.error_estimate is not None
        and solution.error_estimate <= tolerance
    )
    error = max(abs(solution.cost / exact - 1), abs(solution.collisions[0].time - time))
    assert error <= 1.5 * solution.error_estimate + 1e-8  # the closed form is minimised to 1e-8
    assert [m.steps[0] for m in solution.meshes] == sorted({m.steps[0] for m in solution.meshes})
    between = solution.meshes[1:-1]
    assert between
    for mesh in between:
        assert mesh.difference is not None and mesh.difference <= 2 * mesh.estimate
    assert solution.meshes[-1].simulated is not None and solution.meshes[-1].simulated <= tolerance


def test_times_of_all_meshes_count_and_those_before_them_once() -> None:
    problem = block_and_wall.problem(0.8, 8)
    problem = problem.but(kernels=replace(problem.kernels, seconds=2.0))
    solution = dmoc.solve(problem, tolerance=1e-3, starts=3)
    assert solution.starts == 3 and len(solution.meshes) > 1
    assert {"build", "explore", "guess", "solve", "verify"} == set(solution.seconds)
    assert solution.seconds["explore"] > 0 and solution.seconds["build"] == 2.0


def test_seed_to_a_millionth() -> None:
    solution = answer_of(seed_example.problem(10, 4), tolerance=1e-6, starts=1)
    assert solution.cost == pytest.approx(seed_example.LIMIT, rel=1e-6)
    first, *others, last = solution.meshes
    assert last.iterations - others[-1].iterations < 15 and first.iterations > 10  # warm starts
    again = dmoc.Solution.from_bytes(solution.to_bytes())
    assert again.meshes == solution.meshes and again.error_estimate == solution.error_estimate


def test_rounding_errors_of_fine_meshes_do_not_end_the_refinement() -> None:
    solution = answer_of(seed_example.problem(20, 4), tolerance=1e-8)
    assert solution.cost == pytest.approx(seed_example.LIMIT, rel=1e-7)


def test_a_limit_ends_the_refinement_with_the_best_mesh() -> None:
    solution = dmoc.solve(block_and_wall.problem(0.8, 10), tolerance=1e-13, seconds=2.0)
    assert solution.status == "not_verified" and "exceeds the tolerance 1e-13" in solution.message
    assert solution.max_violation < 1e-8


def test_an_infeasible_problem_stays_infeasible() -> None:
    assert (
        dmoc.solve(
            block_and_wall.problem(0.8, 10).but(bounds={"u": (-1, 1)}), tolerance=1e-4
        ).status
        == "infeasible"
    )


def test_wrong_tolerances_are_refused() -> None:
    with pytest.raises(ProblemError, match="tolerance = 0"):
        dmoc.solve(block_and_wall.problem(0.8, 10), tolerance=0)


@pytest.mark.parametrize("order", [2, 4])
def test_the_estimate_is_honest_where_inputs_switch(order: int) -> None:
    """Least time against a wall with |u| <= 1 and e = 0.5: sqrt(2) + 2 sqrt(5/4) - sqrt(2)/2;
    the switches fall between the nodes."""
    walls = {"wall": dynamicsymbols("x") <= 1}
    system = unit_mass("fast_block", surfaces=walls, cost=sp.Integer(1))
    exact = 2**0.5 + 2 * 1.25**0.5 - 2**0.5 / 2
    problem = dmoc.Problem(
        dmoc.build(system, order=order), start={"x": 0}, goal={"x": 0, "x_dot": 0},
        sequence=["wall"], steps=10, final_time=(None, 10), bounds={"u": (-1, 1)}, restitution=0.5,
    )  # fmt: skip
    for tolerance in (1e-4, 1e-5):
        solution = answer_of(problem, tolerance=tolerance)
        assert solution.error_estimate is not None
        assert abs(solution.cost / exact - 1) <= solution.error_estimate <= tolerance


@pytest.mark.parametrize(
    ("distance", "mu", "mass"), [(1.0, 0.5, 1.0), (-5.0, 0.5, 1.0), (1.0, 0.01, 1.0), (1, 0.5, 7.0)]
)
def test_a_phase_that_shrinks_to_nothing_is_refined_to_the_closed_form(
    distance: float, mu: float, mass: float
) -> None:
    """The block has no time to wait: the first phase keeps its shortest duration, a thousandth of
    a second, and the other one costs m^2 (6 d^2/T^3 + (mu g)^2 T/2)."""
    way = "slip+" if distance > 0 else "slip-"
    solution = dmoc.solve(
        dmoc.Problem(
            block_on_floor("shrinking", 1.0, 10.0, 0.5), start={"x": 0, "y": 0},
            goal={"x": distance, "x_dot": 0},
            contacts=["floor"], sequence=[f"floor:{way}"], final_time=1,
            parameters={"mu": mu, "m": mass},
        )
    )  # fmt: skip
    time = 0.999
    exact = mass**2 * (6 * distance**2 / time**3 + (10 * mu) ** 2 * time / 2)
    assert solution.solved and solution.error_estimate is not None
    assert solution.error_estimate <= 1e-3
    assert solution.cost == pytest.approx(exact, rel=1e-3)
    assert solution.phases[0].duration == pytest.approx(1 - time, rel=1e-6)


def test_the_first_mesh_alone_is_no_checked_answer() -> None:
    """Its error is not estimated, so that nothing says what the answer is worth."""
    problem = block_and_wall.problem(0.8, 20)
    first = dmoc.solve(problem, "ipm")

    def solve(problem: dmoc.Problem, coarse: dmoc.Solution | None, _: float | None) -> Any:
        return first if coarse is None else replace(first, status=Status.ITERATION_LIMIT)

    answer = refined(problem, 1e-3, ENDLESS, solve, checked)
    assert answer.status == "not_verified" and len(answer.meshes) == 1
    assert answer.message.startswith("one mesh was solved, which gives no estimate of its error")


def test_a_motion_that_costs_nothing_needs_no_finest_mesh() -> None:
    problem = dmoc.Problem(
        block_system(), start={"x": 0, "x_dot": 1}, goal={"x": 0.3}, sequence=["wall"],
        restitution=0.8, bounds={"u": (-5, 5)}, final_time=(0.1, 3),
    )  # fmt: skip
    solution = answer_of(problem, "ipm")
    assert "exceeds" not in solution.message
    assert solution.cost < 1e-12 and len(solution.meshes) <= 3
    # There at the speed of the start, back at 0.8 of it.
    assert solution.final_time == pytest.approx(1 + 0.7 / 0.8, rel=1e-6)


@pytest.mark.parametrize("confirmed", [True, False])
def test_a_dearer_minimum_takes_the_place_only_of_one_that_is_contradicted(confirmed: bool) -> None:
    """Meshes of 10 and 20 steps agree, that of 80 is led to something that costs more."""
    problem, exact = block_and_wall.problem(0.8, 10), block_and_wall.closed_form(0.8)[0]

    def solve(meshed: dmoc.Problem, guess: dmoc.Solution | None, _: float | None) -> dmoc.Solution:
        s = dmoc.solve(meshed, "ipm", guess=guess, starts=1, verify=False)
        dearer = replace(s.trajectory, cost=2 * s.cost)
        return s if max(meshed.phase_steps) <= 20 else replace(s, trajectory=dearer)

    def check(solution: dmoc.Solution) -> dmoc.Solution:
        motion = replace(solution.trajectory, cost=nan)  # whose cost is no matter here
        seen = checked(replace(solution, trajectory=motion))
        seen = replace(seen, trajectory=solution.trajectory)
        coarse = max(solution.steps) <= 20
        return seen if confirmed or not coarse else replace(seen, status=Status.NOT_VERIFIED)

    answer = refined(problem, 1e-6, ENDLESS, solve, check)
    another = "the mesh of 80 steps a phase led to another minimum, which costs 49.1"
    assert (another in answer.message) == confirmed
    assert max(answer.steps) == 20 if confirmed else max(answer.steps) > 20
    assert answer.cost == pytest.approx(exact if confirmed else 2 * exact, rel=1e-3)


def test_a_limit_on_the_finest_mesh_does_not_hide_that_coarser_ones_are_infeasible() -> None:
    problem = block_and_wall.problem(0.8, 10).but(bounds={"u": (-1, 1)})

    def solve(meshed: dmoc.Problem, guess: dmoc.Solution | None, _: float | None) -> dmoc.Solution:
        s = dmoc.solve(meshed, "ipm", starts=1)
        coarse = max(meshed.phase_steps) < 80
        return s if coarse else replace(s, status=Status.ITERATION_LIMIT, conflicts=())

    answer = refined(problem, 1e-3, ENDLESS, solve, checked)
    assert answer.status == "infeasible" and answer.conflicts and max(answer.steps) == 10


def test_a_contradiction_is_told_beside_the_estimate() -> None:
    problem = block_and_wall.problem(0.8, 10)

    def solve(meshed: dmoc.Problem, guess: dmoc.Solution | None, _: float | None) -> dmoc.Solution:
        s = dmoc.solve(meshed, "ipm", guess=guess, starts=1, verify=False)
        fine = max(meshed.phase_steps) > 20
        return replace(s, status=Status.STALLED, optimality=1e-3) if fine else s

    def check(solution: dmoc.Solution) -> dmoc.Solution:
        seen = checked(solution)
        assert seen.verification is not None
        contradicted = replace(seen.verification, passed=False, message="it misses the wall")
        return replace(seen, status=Status.NOT_VERIFIED, verification=contradicted)

    answer = refined(problem, 1e-9, ENDLESS, solve, check)
    assert answer.status == "not_verified" and "exceeds the tolerance 1e-09, and" in answer.message
    assert "contradicts the finest mesh (it misses the wall): the mesh of 80" in answer.message
