"""Many starts: better minima than from one guess, told with how often they were found, repeatable,
and `infeasible` only after them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from math import pi
from typing import Any

import numpy as np
import pytest
import sympy as sp
from answers import answer_of
from sympy.physics.mechanics import dynamicsymbols
from systems import double_integrator, unit_mass

import dmoc
from dmoc.base.deadline import Deadline
from dmoc.base.errors import ProblemError
from dmoc.codegen.kernels import Kernels
from dmoc.models.registry import find
from dmoc.solvers.outcome import Options, Status
from dmoc.solving.attempts import Attempt
from dmoc.solving.mesh import one_mesh
from dmoc.solving.multistart import exploration, ranking, rounds
from dmoc.solving.multistart.effort import Effort


@pytest.fixture(scope="module", autouse=True)
def many_starts(effort: Callable[..., Effort]) -> Iterator[None]:
    """Explore from as many starts as users do."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Effort, "of", effort)
        yield


@pytest.fixture(scope="module")
def hanging() -> dmoc.Problem:
    """Many starts lead to 41.25 at 50 steps, few to 37.42."""
    reference = find("cart_pendulum_hanging")
    return dmoc.Problem(reference.kernels(2), **{**reference.defaults, "steps": 50})


@pytest.fixture(scope="module")
def explored(hanging: dmoc.Problem) -> dmoc.Solution:
    return dmoc.solve(hanging, "ipm")


@pytest.fixture(scope="module")
def pendulum_and_torque() -> dmoc.MechanicalSystem:
    a, u = dynamicsymbols("a u")
    t = dynamicsymbols._t
    return dmoc.MechanicalSystem(
        "little_torque", coordinates=[a], inputs=[u],
        lagrangian=a.diff(t) ** 2 / 2 + 9.81 * sp.cos(a), forces={a: u}, parameters={}, cost=1,
    )  # fmt: skip


def little_torque(system: dmoc.MechanicalSystem, limit: float, steps: int) -> dmoc.Problem:
    return dmoc.Problem(
        system, start={"a": 0.0}, goal={"a": pi, "a_dot": 0.0}, steps=steps, final_time=(0.5, 10.0),
        bounds={"u": (-limit, limit)},
    )  # fmt: skip


@pytest.mark.slow
def test_a_motion_is_found_where_the_guess_alone_leads_nowhere() -> None:
    """A hammer drives a nail on a spring 2 cm deep, which takes it 26 ms of at least 0.2 s."""
    x, s, u = dynamicsymbols("x s u")
    system = dmoc.MechanicalSystem(
        "hammer", coordinates=[x, s], inputs=[u],
        lagrangian=x.diff() ** 2 / 2 + s.diff() ** 2 / 20 - 250 * s**2,
        forces={x: u, s: -5 * s.diff()}, surfaces={"nail": x <= s}, parameters={}, cost=u**2,
    )  # fmt: skip
    problem = dmoc.Problem(
        system, start={"x": -0.3, "s": 0}, goal={"s": 0.02, "s_dot": 0}, sequence=["nail"],
        steps=100, final_time=(0.2, 1.0), restitution=0.3,
    )  # fmt: skip
    alone = dmoc.solve(problem, "ipm", starts=1)
    assert alone.status == "infeasible"
    assert alone.starts == 0 and alone.others == ()
    many = answer_of(problem, "ipm")
    assert many.cost == pytest.approx(62.56, abs=0.05)


@pytest.mark.slow
def test_a_better_minimum_is_the_answer(explored: dmoc.Solution) -> None:
    assert explored.solved and explored.cost == pytest.approx(37.424, abs=1e-2)


@pytest.mark.slow
def test_others_are_listed_with_how_often_they_were_found(explored: dmoc.Solution) -> None:
    costs = [m.cost for m in explored.others]
    assert costs == sorted(costs) and len(costs) >= 1
    assert min(abs(c - 41.25) for c in costs) < 0.01
    assert explored.agreeing_starts >= 1
    agreeing = [explored.agreeing_starts, *(m.agreeing_starts for m in explored.others)]
    assert sum(agreeing) <= explored.starts
    assert "starts" in explored.message


@pytest.mark.slow
def test_the_default_driver_starts_from_the_best_minimum(
    hanging: dmoc.Problem, explored: dmoc.Solution
) -> None:
    driven = dmoc.solve(hanging)
    assert driven.method == "slsqp" and driven.solved
    assert driven.cost == pytest.approx(explored.cost, rel=1e-6)
    assert driven.iterations <= 10


@pytest.mark.slow
def test_the_same_seed_gives_the_same_answer(
    hanging: dmoc.Problem, explored: dmoc.Solution
) -> None:
    again = dmoc.solve(hanging, "ipm")
    assert (again.unknowns == explored.unknowns).all()
    assert again.others == explored.others


def test_a_number_of_starts_is_kept(hanging: dmoc.Problem) -> None:
    assert dmoc.solve(hanging, "ipm", starts=7, verify=False).starts == 7


def test_starts_that_there_is_no_time_for_are_not_made(
    block: Kernels, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They are made some at a time, random ones and others beside what these have led to; none
    after those at which the time is used up."""
    problem = dmoc.Problem(
        block, start={"x": 0}, goal={"x": 1, "x_dot": 0}, bounds={"u": (-9, 9)}, steps=4,
        final_time=1.0,
    )  # fmt: skip
    made: dict[str, list[range]] = {"random_motions": [], "neighbours": []}

    def recording(name: str) -> Callable[..., Any]:
        make = getattr(rounds, name)

        def recorded(problem: dmoc.Problem, *others: Any) -> Any:
            made[name].append(next(numbers for numbers in others if isinstance(numbers, range)))
            return make(problem, *others)

        return recorded

    for name in made:
        monkeypatch.setattr(rounds, name, recording(name))
    effort = Effort(first=8, random=4, beside=12, total=50, widens=False)
    ended = exploration.explored(problem, effort, Options())
    named = len(ended.starts) - sum(map(len, made["random_motions"] + made["neighbours"]))
    assert len(ended.starts) == 50 and ended.ranked[0].minimum.starts == 50
    assert ended.ranked[0].minimum.first == "automatic 1" and named >= 1
    assert made["neighbours"] == [range(12), range(12, 24)]
    assert made["random_motions"] == [range(24), range(24, 24), range(24, 26 - named)]
    made["random_motions"].clear()
    few = exploration.explored(problem, effort, Options(deadline=Deadline.after(1e-9)))
    assert len(made["random_motions"]) == 1 and len(few.starts) < 50


@pytest.mark.slow
def test_starts_that_agree_end_the_exploration() -> None:
    system = unit_mass("easy", cost=dynamicsymbols("u") ** 2)
    problem = dmoc.Problem(system, start={"x": 0}, goal={"x": 1, "x_dot": 0}, final_time=1)
    answer = dmoc.solve(problem, "ipm")
    assert answer.cost == pytest.approx(12, rel=1e-3)
    assert answer.starts < 30 and answer.agreeing_starts == answer.starts and answer.others == ()


@pytest.mark.slow
def test_a_swing_up_with_little_torque_is_found(
    pendulum_and_torque: dmoc.MechanicalSystem,
) -> None:
    solution = answer_of(little_torque(pendulum_and_torque, 2.0, 200), "ipm")
    assert solution.cost == pytest.approx(5.7041, abs=2e-3)


@pytest.mark.slow
def test_a_confirmed_minimum_is_not_passed_over_for_the_same_one_of_a_finer_mesh(
    pendulum_and_torque: dmoc.MechanicalSystem,
) -> None:
    """With inputs that are linear in steps, two minima differ in the step of a switch: one costs
    5.7134 and is not confirmed, the other 5.7095.  Of 200 steps both cost 5.7010."""
    problem = little_torque(pendulum_and_torque, 2.0, 50).but(controls="linear")
    solution = answer_of(problem, "ipm", seed=1)
    assert solution.cost == pytest.approx(5.70947, rel=1e-5)
    other = next(m for m in solution.others if m.cost < 6)
    assert other.status == "not_verified" and other.cost > solution.cost
    fine = dmoc.solve(problem.but(steps=200), "ipm", guess=solution)
    assert fine.cost == pytest.approx(5.70100, rel=1e-5)


@pytest.mark.slow
def test_infeasible_is_said_after_many_starts(pendulum_and_torque: dmoc.MechanicalSystem) -> None:
    solution = dmoc.solve(little_torque(pendulum_and_torque, 0.2, 40), "ipm")
    assert solution.status == "infeasible"
    assert solution.starts >= 300
    assert f"{solution.starts} starts" in solution.message


@pytest.mark.parametrize("starts", [0, -1, 1.5, "many", True])
def test_wrong_numbers_of_starts_are_refused(hanging: dmoc.Problem, starts: object) -> None:
    with pytest.raises(ProblemError, match="starts"):
        dmoc.solve(hanging, starts=starts)  # type: ignore[arg-type]


def test_what_was_explored_survives_a_file(explored: dmoc.Solution) -> None:
    again = dmoc.Solution.from_bytes(explored.to_bytes())
    assert again.others == explored.others
    assert (again.starts, again.agreeing_starts) == (explored.starts, explored.agreeing_starts)
    assert np.isfinite(again.to_dict()["others"][0]["cost"])


def test_starts_that_come_to_rest_lead_to_rest() -> None:
    """What stands still gives no sizes: those of the starts count."""
    at_rest = double_integrator(40).but(start={"x": 0.0}, goal={"x": 0.0, "x_dot": 0.0})
    solution = answer_of(at_rest, "ipm")
    assert solution.cost < 1e-12
    assert solution.agreeing_starts == solution.starts == 13


def test_minima_of_the_coarse_mesh_that_become_one_need_no_more_starts(seed: dmoc.Problem) -> None:
    """Of 24 steps the source's problem has two, of costs 131.4 and 139.6."""
    solution = dmoc.solve(seed, "ipm")
    assert solution.cost == pytest.approx(129.6024, rel=1e-6)
    assert solution.starts < 40 and solution.others == ()


def test_minima_that_finer_meshes_lose_are_told(
    block: Kernels, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They are no starts that led nowhere."""
    refined = ranking._refined

    def stalled(*arguments: Any) -> Attempt:
        attempt = refined(*arguments)
        return replace(attempt, outcome=replace(attempt.outcome, status=Status.STALLED))

    monkeypatch.setattr(ranking, "_refined", stalled)
    task = {"start": {"x": 0.0}, "goal": {"x": 0.0, "x_dot": 0.0}, "sequence": ["wall"]}
    solution = answer_of(dmoc.Problem(block, **task, steps=40, final_time=1.0), "ipm")
    assert solution.agreeing_starts == 0 and solution.others[0].status == "coarse"
    assert "starts led to one minimum on a coarse mesh alone" in solution.message


@pytest.mark.slow
@pytest.mark.parametrize("shift", [0.0, 3.0])
@pytest.mark.parametrize("method", ["ipm", "slsqp"])
def test_a_motion_at_rest_is_no_measure_of_what_its_next_start_is(
    method: str, shift: float
) -> None:
    """A body held on its leg by its weight: what the first solves leave of a motion is no size."""
    x, y, u = dynamicsymbols("x y u")
    t, ground = dynamicsymbols._t, sp.Symbol("ground")
    weight = x + y / 5
    hopper = dmoc.MechanicalSystem(
        "standing_hopper", [x, y], x.diff(t) ** 2 / 2 + y.diff(t) ** 2 / 10 - 9.81 * weight,
        {ground: 0.0}, inputs=[u], forces={x: u, y: -u}, surfaces={"ground": y >= ground},
        cost=u**2,
    )  # fmt: skip
    problem = dmoc.Problem(
        hopper, start={"x": 0.5 + shift, "y": shift}, goal={"x": 0.5 + shift, "x_dot": 0.0},
        contacts=["ground"], steps=12, final_time=0.8, parameters={"ground": shift},
    )  # fmt: skip
    solution = answer_of(problem, method, starts=4)
    assert solution.cost == pytest.approx(0.8 * 9.81**2, rel=1e-9)


@pytest.mark.slow
def test_what_there_was_no_time_for_is_not_called_infeasible(
    block: Kernels, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With 1 N a block of 1 kg gets no further than 0.25 m in one second."""
    problem = dmoc.Problem(
        block, start={"x": 0}, goal={"x": 0.5, "x_dot": 0}, bounds={"u": (-1, 1)}, steps=10,
        final_time=1.0,
    )  # fmt: skip
    ended = exploration.explored(problem, Effort(), Options(deadline=Deadline.after(1e-9)))
    assert ended.late and not ended.solutions
    assert not exploration.explored(problem, Effort(total=3, widens=False), Options()).late
    assert dmoc.solve(problem, "ipm").status == "infeasible"
    monkeypatch.setattr(exploration, "explored", lambda *_: ended)
    late = dmoc.solve(problem, "ipm")
    assert late.status == "time_limit" and "raise it; until then no feasible" in late.message


@pytest.mark.slow
@pytest.mark.parametrize(
    "status, more", [(Status.SOLVED, ""), (Status.GRAZES, ", but one of its collisions has no")]
)
def test_beside_a_contradicted_answer_the_cheapest_confirmed_minimum_is_told(
    block: Kernels, monkeypatch: pytest.MonkeyPatch, status: Status, more: str
) -> None:
    task = {"start": {"x": 0.0}, "goal": {"x": 0.5, "x_dot": 0.0}}
    problem = dmoc.Problem(block, **task, steps=10, final_time=1.0)
    ended = exploration.explored(problem, Effort(), Options())
    (first,) = ended.ranked
    motions = [replace(first.solution.trajectory, cost=c) for c in (7.0, 6.0)]
    others = [
        replace(first, solution=replace(first.solution, trajectory=motion)) for motion in motions
    ]
    others[1] = replace(others[1], solution=replace(others[1].solution, status=status))
    against = replace(first, solution=replace(first.solution, status=Status.NOT_VERIFIED))
    both = replace(ended, ranked=(against, *others))
    monkeypatch.setattr(exploration, "explored", lambda *_: both)
    monkeypatch.setattr(one_mesh, "_best_of", lambda *_: (against.solution, 0))
    message = dmoc.solve(problem, "ipm").message
    assert f"the best minimum that is confirmed costs 6{more}" in message
    assert ("but one" in message) == bool(more)
