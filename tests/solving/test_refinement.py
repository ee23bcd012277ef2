"""Mesh refinement: the estimate is honest, and what cannot be reached is said."""

from __future__ import annotations

import block_and_wall
import pytest
import seed as seed_example
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.errors import ProblemError

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(("order", "tolerance"), [(2, 1e-5), (4, 1e-8)])
def test_the_estimate_bounds_the_error_against_the_closed_form(
    order: int, tolerance: float
) -> None:
    exact, time, _ = block_and_wall.known(0.8)
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


def test_seed_to_a_millionth() -> None:
    solution = dmoc.solve(seed_example.problem(10, 4), tolerance=1e-6, starts=1)
    assert solution.solved and solution.cost == pytest.approx(seed_example.LIMIT, rel=1e-6)
    first, *others, last = solution.meshes
    assert last.iterations - others[-1].iterations < 15 and first.iterations > 10  # warm starts
    again = dmoc.Solution.from_bytes(solution.to_bytes())
    assert again.meshes == solution.meshes and again.error_estimate == solution.error_estimate


def test_rounding_errors_of_fine_meshes_do_not_end_the_refinement() -> None:
    solution = dmoc.solve(seed_example.problem(20, 4), tolerance=1e-8)
    assert solution.solved and solution.cost == pytest.approx(seed_example.LIMIT, rel=1e-7)


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
    x, u = dynamicsymbols("x u")
    T = dynamicsymbols._t
    system = dmoc.MechanicalSystem(
        "fast_block",
        [x],
        x.diff(T) ** 2 / 2,
        {},
        [u],
        {x: u},
        surfaces={"wall": x <= 1},
        cost=sp.Integer(1),
    )
    exact = 2**0.5 + 2 * 1.25**0.5 - 2**0.5 / 2
    problem = dmoc.Problem(
        dmoc.build(system, order=order),
        start={"x": 0},
        goal={"x": 0, "x_dot": 0},
        sequence=["wall"],
        steps=10,
        final_time=(None, 10),
        bounds={"u": (-1, 1)},
        restitution=0.5,
    )
    for tolerance in (1e-4, 1e-5):
        solution = dmoc.solve(problem, tolerance=tolerance)
        assert solution.solved and solution.error_estimate is not None
        assert abs(solution.cost / exact - 1) <= solution.error_estimate <= tolerance
