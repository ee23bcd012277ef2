"""What becomes of a refinement whose finer meshes fail, of costs without a minimum, and of motions
that the problem leaves open."""

from __future__ import annotations

from dataclasses import replace
from math import sqrt

import block_and_wall
import pytest
import sympy as sp
from answers import answer_of
from contact_problems import against_wall, pushed, rail, two_masses
from sympy.physics.mechanics import dynamicsymbols
from systems import block_on_floor, block_system, unit_mass

import dmoc
from dmoc.base.deadline import ENDLESS
from dmoc.program.extraction import multiplier_vectors
from dmoc.program.transcription import Transcription
from dmoc.solvers.curvature import SecondOrder
from dmoc.solvers.outcome import Duals, Status
from dmoc.solving.checked_solution import checked
from dmoc.solving.mesh.refinement import Solve, refined

pytestmark = pytest.mark.slow
X, Y, U = dynamicsymbols("x y u")
M, G, MU = sp.symbols("m g mu")


def sliding_back(cost: sp.Expr, sequence: list[str], steps: int | None = None) -> dmoc.Problem:
    """A block slides 1 m to a wall and 0.3 m back, where it rests; the speed of its start is
    free."""
    walls = {"floor": Y >= 0, "wall": X <= 1}
    system = block_on_floor("sliding_back", 1.0, 9.81, 0.3, surfaces=walls, cost=cost)
    return dmoc.Problem(
        system, start={X: 0, Y: 0, "x_dot": (0.1, 10)}, goal={X: 0.7, "x_dot": 0},
        contacts=["floor:slip+"], sequence=sequence, restitution={"wall": 0.6},
        bounds={"u": (0, 0)}, final_time=(0.1, 5), steps=steps,
    )  # fmt: skip


SPEED = sqrt(2 * 0.3 * 9.81 * (1 + 0.3 / 0.6**2))  # 3.2849657532


@pytest.mark.parametrize("cost", [sp.Integer(0), U**2 / 2])
def test_a_motion_that_costs_nothing_is_exact_on_the_first_mesh(cost: sp.Expr) -> None:
    solution = answer_of(sliding_back(cost, ["wall floor:slip-"]), starts=16)
    assert len(solution.meshes) == 2
    assert solution.error_estimate is not None and solution.error_estimate < 1e-6
    assert solution.phases[0].v[0, 0] == pytest.approx(SPEED, rel=1e-9)
    assert solution.optimality == 0 or cost != 0


def test_a_sequence_in_which_friction_has_to_turn_is_named() -> None:
    solution = dmoc.solve(sliding_back(sp.Integer(0), ["wall"], 20), starts=16)
    assert solution.status == "infeasible"
    assert "sequence = ['wall floor:slip-'] leads to a motion" in solution.message


def test_what_turns_is_named_at_the_hit_where_it_does() -> None:
    """A block on a rail between two walls, which slides there, back, and there again."""
    system = replace(
        rail(U**2 / 2, name="between_walls"), surfaces={"right": X <= 1, "left": X >= -1}
    )
    problem = dmoc.Problem(
        system, start={"x": 0}, goal={"x": 0, "x_dot": 0}, contacts=["rail:slip+"],
        sequence=["right", "left"], restitution=0.8, steps=20, final_time=3,
    )  # fmt: skip
    answer = dmoc.solve(problem, starts=16)
    assert answer.status == "infeasible"
    assert "sequence = ['right rail:slip-', 'left rail:slip+'] leads to a motion" in answer.message


@pytest.mark.parametrize("steps", [None, 20])
@pytest.mark.parametrize("wall", [False, True])
def test_a_cost_that_falls_for_ever_is_no_minimum(steps: int | None, wall: bool) -> None:
    """Unit mass from rest to rest, int u^2/2 falls as T^-3."""
    problem = dmoc.Problem(
        block_system(), start={"x": 0}, goal={"x": 0 if wall else 0.5, "x_dot": 0},
        sequence=["wall"] if wall else [], final_time=(None, None), steps=steps,
    )  # fmt: skip
    solution = dmoc.solve(problem, "ipm", starts=8)
    assert solution.status == "stalled" and not solution.converged
    assert (
        "the cost has no minimum, it falls as long as the motion takes longer" in solution.message
    )
    limited = answer_of(problem.but(final_time=(None, 2)), "ipm", starts=8)
    assert limited.final_time == pytest.approx(2)


def test_a_free_time_with_a_minimum_is_one() -> None:
    """Time and effort of a unit mass over 1 m, T + 12/T^3, are least at T = sqrt(6)."""
    system = unit_mass("timed", cost=1 + U**2)
    problem = dmoc.Problem(
        system, start={X: 0}, goal={X: 1, "x_dot": 0}, final_time=(None, None), steps=40
    )
    solution = answer_of(problem, "ipm")
    assert solution.final_time == pytest.approx(sqrt(6), rel=1e-3)


def solved_until(most: int, ended: Status) -> Solve:
    """Solves meshes up to some steps a phase; finer ones end otherwise."""

    def solve(meshed: dmoc.Problem, guess: dmoc.Solution | None, _: float | None) -> dmoc.Solution:
        s = dmoc.solve(meshed, "ipm", guess=guess, starts=1, verify=False)
        return s if max(meshed.phase_steps) <= most else replace(s, status=ended, optimality=1.0)

    return solve


@pytest.mark.parametrize("ended", [Status.STALLED, Status.INFEASIBLE, Status.ITERATION_LIMIT])
def test_a_confirmed_mesh_is_kept_where_a_finer_one_fails(ended: Status) -> None:
    problem, exact = block_and_wall.problem(0.8, 20), block_and_wall.closed_form(0.8)[0]
    answer = refined(problem, 1e-9, ENDLESS, solved_until(40, ended), checked)
    assert answer.steps == (40, 40) and answer.verification and answer.verification.passed
    assert answer.status == "not_verified"  # 1e-9 was asked for
    assert f"the mesh of 160 steps a phase ended {ended}" in answer.message
    assert answer.error_estimate is not None
    assert abs(answer.cost / exact - 1) <= answer.error_estimate < 1e-2


def test_one_mesh_alone_is_measured_against_a_coarser_one() -> None:
    problem, exact = block_and_wall.problem(0.8, 40), block_and_wall.closed_form(0.8)[0]
    answer = refined(problem, 5e-3, ENDLESS, solved_until(40, Status.STALLED), checked)
    assert answer.status == "solved" and [m.steps[0] for m in answer.meshes] == [20, 40]
    assert "the mesh of 80 steps a phase ended stalled" in answer.message
    assert answer.error_estimate is not None
    assert abs(answer.cost / exact - 1) <= answer.error_estimate <= 5e-3


def test_a_contradicted_finest_mesh_gives_way_to_a_confirmed_one() -> None:
    problem = block_and_wall.problem(0.8, 20)

    def check(solution: dmoc.Solution) -> dmoc.Solution:
        seen = checked(solution)
        return seen if max(solution.steps) <= 40 else replace(seen, status=Status.NOT_VERIFIED)

    answer = refined(problem, 1e-9, ENDLESS, solved_until(80, Status.STALLED), check)
    assert answer.steps == (40, 40)


@pytest.mark.parametrize("finest", [80, 160])
def test_a_confirmed_mesh_is_measured_against_finer_ones_that_are_contradicted(finest: int) -> None:
    """The first mesh alone is confirmed, and has no estimate of its own."""
    problem, exact = block_and_wall.problem(0.8, 20), block_and_wall.closed_form(0.8)[0]

    def check(solution: dmoc.Solution) -> dmoc.Solution:
        seen = checked(solution)
        return seen if max(solution.steps) <= 20 else replace(seen, status=Status.NOT_VERIFIED)

    answer = refined(problem, 2e-2, ENDLESS, solved_until(finest, Status.STALLED), check)
    assert answer.steps == (20, 20) and answer.status == "solved"
    assert answer.error_estimate is not None
    assert abs(answer.cost / exact - 1) <= answer.error_estimate <= 2e-2
    sharper = refined(problem, 1e-5, ENDLESS, solved_until(finest, Status.STALLED), check)
    assert sharper.status == "not_verified" and sharper.steps == (20, 20)


def test_an_equal_cost_is_not_another_minimum() -> None:
    """The same cost from another motion: only a dearer one is another minimum."""
    problem = block_and_wall.problem(0.8, 20)

    def solve(meshed: dmoc.Problem, guess: dmoc.Solution | None, _: float | None) -> dmoc.Solution:
        s = dmoc.solve(meshed, "ipm", guess=guess, starts=1, verify=False)
        phases = tuple(replace(p, q=p.q + 0.1) for p in s.phases)
        moved = replace(s, trajectory=replace(s.trajectory, phases=phases))
        return moved if max(meshed.phase_steps) > 40 else s

    answer = refined(problem, 1e-3, ENDLESS, solve, checked)
    assert "another minimum" not in answer.message


def test_one_mass_that_has_time_to_spare_ends_no_refinement() -> None:
    """Two masses in least time: the cost is resolved on 200 steps a phase, what one of them does on
    its way is not determined."""
    solution = answer_of(two_masses(), starts=8)
    assert max(solution.steps) <= 200
    assert "the problem does not determine a on the way" in solution.message
    assert solution.error_estimate is not None and solution.error_estimate <= 1e-3
    coarse = dmoc.solve(two_masses(50), starts=8)
    assert solution.cost == pytest.approx(coarse.cost, rel=1e-4)


def test_what_is_open_is_seen_where_finer_meshes_are_contradicted() -> None:
    """The coarse mesh is the answer: the cost is resolved, and the motion is another one on each
    mesh, further and further away."""
    problem = block_and_wall.problem(0.8, 20)

    def solve(meshed: dmoc.Problem, guess: dmoc.Solution | None, _: float | None) -> dmoc.Solution:
        s = dmoc.solve(meshed, "ipm", guess=guess, starts=1, verify=False)
        phases = tuple(replace(p, q=p.q + 1e-4 * max(s.steps) ** 2) for p in s.phases)
        return replace(s, trajectory=replace(s.trajectory, phases=phases))

    def check(solution: dmoc.Solution) -> dmoc.Solution:
        confirmed = Status.SOLVED if max(solution.steps) <= 20 else Status.NOT_VERIFIED
        return replace(checked(solution), status=confirmed)

    answer = refined(problem, 2e-2, ENDLESS, solve, check)
    assert max(answer.steps) == 20
    assert "the problem hardly determines durations and positions" in answer.message
    assert answer.error_estimate is not None


def test_everything_is_open_where_nothing_costs() -> None:
    x, y = dynamicsymbols("x y")
    system = dmoc.MechanicalSystem(
        "thrown", [x, y], (x.diff() ** 2 + y.diff() ** 2) / 2 - 9.81 * y, {}, cost=sp.Integer(0),
        surfaces={"floor": y >= 0},
    )  # fmt: skip
    problem = dmoc.Problem(
        system, start={x: 0, y: 1, "x_dot": (0, 5), "y_dot": (-5, 5)}, goal={x: 2},
        sequence=["floor"], restitution=0.8, final_time=(0.2, 3),
    )  # fmt: skip
    solution = answer_of(problem, starts=8)
    assert solution.error_estimate is not None
    assert solution.error_estimate < 1e-9 and len(solution.meshes) <= 3


@pytest.mark.parametrize("steps", [20, 40])
def test_durations_that_the_problem_leaves_open_are_named(steps: int) -> None:
    """A block waits, slides and waits: only the slide is determined."""
    solution = dmoc.solve(pushed(steps), starts=8)
    named = "the problem does not determine the duration of phase 0 and the duration of phase 2"
    assert solution.solved and named in solution.message
    against = answer_of(against_wall(steps, 0.5), starts=8)
    assert "does not determine" not in against.message


def test_the_curvature_of_a_duration_is_that_of_the_closed_form() -> None:
    """J = T + 12/T^3 has T^2 J''/J = 3 at its minimum, T = sqrt(6)."""
    system = unit_mass("timed", cost=1 + U**2)
    problem = dmoc.Problem(
        system, start={X: 0}, goal={X: 1, "x_dot": 0}, final_time=(0.1, 10), steps=40
    )
    s = dmoc.solve(problem, "ipm", starts=1)
    nlp = Transcription(problem)
    duals = Duals(*multiplier_vectors(nlp, s.multipliers))
    x = nlp.scaled(s.unknowns)
    (curvature,) = SecondOrder(nlp, x, duals).of_unknowns(nlp.layout.index_h)
    assert curvature * (s.final_time / 40) ** 2 / s.cost == pytest.approx(3, rel=1e-2)
