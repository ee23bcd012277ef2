"""What comes after a solve whose motion ends with an event: other meshes, guesses, batches,
sensitivities, files and figures, the check."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from last_events import FALL, against_wall, cubic, thrown_block
from pytest import approx
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import ProblemError, SimulationError
from dmoc.export.loaded_solver import load_solver
from dmoc.export.solver import generate_solver
from dmoc.motion.trajectory import Trajectory

pytestmark = pytest.mark.slow


def test_a_solution_begins_another_one() -> None:
    """On other meshes, in other orders and forms of the inputs, and after a phase that goes on."""
    first = dmoc.solve(against_wall())
    for problem, error in (
        (against_wall(steps=40), 1e-9), (against_wall(2, steps=50), 2e-4),
        (against_wall(6, steps=10, controls="constant"), 3e-3),
    ):  # fmt: skip
        again = dmoc.solve(problem, guess=first)
        assert again.solved and again.cost == approx(1.52, abs=error)
    longer = against_wall(durations=None, final_time=2.0)
    assert dmoc.solve(against_wall(), guess=dmoc.solve(longer)).solved
    with pytest.raises(ProblemError, match="guess ends with its last event"):
        dmoc.solve(longer, guess=first)


def test_courses_are_those_of_the_phases_before_the_event() -> None:
    for guess in ({"x": [0, 0.3, 1], "durations": 0.9}, [{"x": [0, 0.3, 1], "u": 1.0}]):
        assert dmoc.solve(against_wall(), guess=guess).cost == approx(1.52)
    with pytest.raises(ProblemError, match="one for each of the 1 phases before the last"):
        dmoc.solve(against_wall(), guess=[{"x": 1.0}, {"x": 1.0}])


def test_refinement_finds_the_event_at_the_end() -> None:
    refined = dmoc.solve(against_wall(2, steps=None), tolerance=1e-4)
    assert refined.solved and refined.cost == approx(1.52, rel=1e-4)
    assert [m.steps[-1] for m in refined.meshes] == [0] * len(refined.meshes)


def test_sensitivities_and_batches() -> None:
    """J = 6 - 6 r/e + 2 (r/e)^2 of a unit mass, and m^2 times as much of another one."""
    problem = against_wall()
    slopes = dmoc.sensitivities(problem, dmoc.solve(problem))
    assert slopes["goal"]["x_dot"] == approx(-0.8) and slopes["parameters"]["m"] == approx(3.04)
    assert slopes["restitution"]["wall"] == approx(-1.28)
    masses = dmoc.sweep(problem, {"m": [1.0, 2.0]})
    assert masses.cost == approx([1.52, 6.08])
    goals = dmoc.solve_many([problem.but(goal={"x_dot": -r}) for r in (0.4, 0.6)])
    assert goals.cost == approx([cubic(0.8), cubic(1.2)])


# Results ------------------------------------------------------------------------------------------


def test_results_show_the_state_after_the_end(tmp_path: Path) -> None:
    solution = dmoc.solve(thrown_block(4, "+floor:slip+"))
    again = dmoc.Solution.load(solution.save(tmp_path / "thrown.npz"))
    assert (
        again.phases[-1].v == approx(solution.phases[-1].v)
        and again.verify(thrown_block(4, "floor:slip+").kernels).passed
    )
    assert repr(again.phases[-1]) == "<State after the last event at 0.451524 s, floor:slip+>"
    rows = dict(row for row in again.summary().rows if len(row) == 2)
    assert rows["phase 1"] == "the state after the last event, floor:slip+"
    table = again.to_frame()
    last = table.iloc[-2:]
    assert list(last["phase"]) == [0, 1] and last["t"].nunique() == 1
    assert last["x_dot"].to_list() == approx([3.0, 3 - 0.3 * FALL], abs=1e-7)
    assert str(thrown_block(4, "+floor:slip+").summary()).count("ends with its event") == 1
    for ending in ("html", "png", "gif"):
        target = tmp_path / f"thrown.{ending}"
        again.plot(target) if ending == "png" else again.animate(target, fps=5)
        assert target.stat().st_size > 1000
    again.report(tmp_path / "report.html")


def spoilt(motion: Trajectory, **fields: Any) -> Trajectory:
    """The motion with another state after its end."""
    return replace(motion, phases=(*motion.phases[:-1], replace(motion.phases[-1], **fields)))


@pytest.mark.parametrize(("word", "what"), [
    ("floor:slip+", "law of impact"), ("+floor:slip+", "moves with|law of impact"),
])  # fmt: skip
def test_the_check_judges_the_state_after_the_event(word: str, what: str) -> None:
    problem = thrown_block(4, word)
    motion = dmoc.solve(problem).trajectory
    assert dmoc.verify(motion, problem.kernels).passed
    after, (along, up) = motion.phases[-1], 0.3 * np.eye(2)
    for spoil, says in (
        ({"v": after.v + up, "p": after.p + up}, f"momentum|{what}"),
        ({"v": after.v + along, "p": after.p + along}, f"momentum|{what}"),
        ({"q": after.q + up}, "y jumps by 0.3"),
        ({"t": after.t + 0.1}, "the next begins at"),
    ):
        check = dmoc.verify(spoilt(motion, **spoil), problem.kernels)
        assert not check.passed and re.search(says, check.message)


def test_the_check_refuses_other_phases_without_steps() -> None:
    problem = against_wall(sequence=["wall", "wall"], durations=[None, None, 0], final_time=2.0)
    motion = dmoc.solve(problem).trajectory
    first, _, last = motion.phases
    with pytest.raises(SimulationError, match="phase 1 of the motion has no steps"):
        dmoc.verify(replace(motion, phases=(first, last, last)), problem.kernels)


def test_a_simulated_end_before_or_after_the_event_counts_as_it() -> None:
    """The strike comes as early and as late as the errors of order 2 say."""
    for steps in (6, 7, 8, 9):
        solution = dmoc.solve(against_wall(2, steps=steps, controls="constant"))
        assert solution.solved and not solution.verification.missed_contacts


def test_a_solver_in_c_ends_with_an_event(tmp_path: Path) -> None:
    """Its last row is behind the event, and another speed there is another problem."""
    problem = against_wall()
    generate_solver(problem, tmp_path / "solver")
    solver = load_solver(tmp_path / "solver")
    solver.set(goal={"x_dot": -0.6})
    end, own = solver.solve(), dmoc.solve(problem.but(goal={"x_dot": -0.6}), starts=1)
    assert end.status == "solved" and end.cost == approx(own.cost, rel=1e-9)
    velocities = np.vstack([phase.v for phase in own.trajectory.phases])
    assert end.tables["velocities"] == approx(velocities, abs=1e-6)
    assert end.tables["velocities"][-2:, 0] == approx([1.2, -0.6], abs=1e-9)  # e = 1/2


def test_files_have_motions_that_end_with_an_event(tmp_path: Path) -> None:
    """On a mesh of its own and on finer ones, with other minima beside it."""
    x = dynamicsymbols("x")
    ball = dmoc.MechanicalSystem(
        "ball", [x], x.diff() ** 2 / 2 - 10 * x, surfaces={"floor": x >= 0}
    )
    problem = dmoc.Problem(
        ball, {"x": 1, "x_dot": 0}, sequence=["floor"], durations=[None, 0], restitution=0.5
    )
    solution = dmoc.solve(problem)
    assert solution.solved
    again = dmoc.Solution.load(solution.save(tmp_path / "ball.npz"))
    assert [mesh.steps for mesh in again.meshes] == [mesh.steps for mesh in solution.meshes]
