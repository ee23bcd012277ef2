"""Costs without a minimum are told with what runs away, and minima that are far away are kept."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any

import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.solvers.outcome import Status
from dmoc.solving import case
from dmoc.solving.mesh import one_mesh
from dmoc.solving.unbounded_cost import ended

pytestmark = pytest.mark.slow

x, u = dynamicsymbols("x u")
k = sp.Symbol("k")


def sled(goal: dict[Any, Any], order: int = 2, **fields: Any) -> dmoc.Problem:
    """1 kg that is pushed for 1 s, or as long as it likes."""
    fields = dict(fields)
    stated = {"final_time": 1, "steps": 20, "start": {x: 0}} | fields.pop("problem", {})
    fields = {"inputs": [u], "forces": {x: u}} | fields
    system = dmoc.MechanicalSystem("sled", [x], x.diff() ** 2 / 2, **fields)
    backend = stated.pop("backend", "auto")
    kernels = dmoc.build(system, order=order, backend=backend)
    return dmoc.Problem(kernels, stated.pop("start"), goal, **stated)


STOP: dict[Any, Any] = {x: 1, "x_dot": 0}
EFFORT = {"integrals": {"effort": u**2 / 2}, "objective": -dmoc.total("effort")}
FREE = {"final_time": (None, None)}
ROLLING = {"start": {x: 0, "x_dot": None}}
CHOSEN = {"design": {"k": (0, None)}}
PRICED: dict[str, Any] = {"cost": u**2, "terminal_cost": -k, "parameters": {k: 1.0}}
Statement = tuple[dict[Any, Any], int, dict[str, Any], str]  # goal, order, fields, what runs away
ENDLESS: dict[str, Statement] = {
    "an effort that is earned": (STOP, 2, EFFORT, "u"),
    "at order 4": (STOP, 4, EFFORT, "u"),
    "a price of the end": ({}, 2, {"terminal_cost": -x}, "u"),
    "a speed at the end": ({}, 2, {"objective": -dmoc.at_end(x.diff())}, "u"),
    "a price of the place": ({}, 2, {"cost": -x}, "u"),
    "an input with a sign": ({}, 2, {"cost": u}, "u"),
    "a price of the end and time": (
        {}, 2, {"terminal_cost": -x, "problem": FREE | {"bounds": {u: (-1, 1)}}}, "final_time"),
    "effort and time, on meshes": (
        {}, 4, {"terminal_cost": -x, "cost": u**2, "problem": FREE | {"steps": None}},
        "final_time"),
    "a long time": (
        {x: 1}, 2, {"objective": -dmoc.final_time, "cost": u**2, "problem": FREE}, "final_time"),
    "effort and time": ({}, 2, {"terminal_cost": -x, "cost": u**2, "problem": FREE}, "final_time"),
    "a speed at the start": (
        {}, 2, {"terminal_cost": -x, "cost": u**2, "problem": ROLLING}, "x_dot at the start"),
    "a speed at the start, forth alone": (
        {}, 4,
        {"terminal_cost": -x, "cost": u**2, "problem": {"start": {x: 0, "x_dot": (0, None)}}},
        "x_dot at the start"),
    "a place at the start": (
        {}, 2, {"objective": -dmoc.at_start(x), "cost": u**2, "problem": {"start": {x: None}}},
        "x at the start"),
    "a parameter": (STOP, 2, PRICED | {"problem": CHOSEN}, "k"),
    "its square": (STOP, 2, PRICED | {"terminal_cost": -k**2, "problem": CHOSEN}, "k"),
}  # fmt: skip


@pytest.mark.parametrize("name", ENDLESS)
def test_what_runs_away_is_named(name: str) -> None:
    goal, order, fields, runs = ENDLESS[name]
    problem = sled(goal, order, **fields)
    # With a free speed slsqp takes half a minute until it gives up.
    solution = dmoc.solve(problem, "ipm" if "at the start" in name else None, starts=1)
    assert solution.status == "stalled" and solution.verification is None
    assert solution.message.startswith(f"the cost has no minimum, it falls as {runs} grows: -")
    assert f"; bound {runs}, or give it a price" in solution.message
    assert solution.max_violation < 1e-6
    latest = problem.final_time_bounds[1]
    assert latest == float("inf") or solution.final_time == pytest.approx(latest, rel=1e-9)


@pytest.mark.parametrize(
    ("name", "limits"),
    [("a speed at the end", {u: (0, None)}), ("a speed at the start", {}), ("a parameter", {})],
)
def test_it_is_named_without_a_compiler(name: str, limits: dict[Any, Any]) -> None:
    """SLSQP ends somewhere on the way, and calls it solved; with inputs of both signs it takes long
    until then."""
    goal, order, fields, runs = ENDLESS[name]
    slow = fields.get("problem", {}) | {"backend": "numpy", "steps": 2, "bounds": limits}
    solution = dmoc.solve(sled(goal, order, **fields | {"problem": slow}), "slsqp", starts=1)
    assert solution.status == "stalled"
    assert solution.message.startswith(f"the cost has no minimum, it falls as {runs} grows: -")


@pytest.mark.parametrize("fields", [{"start": {x: 0, "x_dot": None}}, {"design": {"k": (0, None)}}])
@pytest.mark.parametrize("price", [10.0, 1e3, 1e5])
def test_a_speed_or_a_parameter_that_is_far_away_is_one(price: float, fields: Any) -> None:
    """v^2/2 - price v and k^2/2 - price k are -price^2/2 at the least."""
    own, parameters = (k, {k: 1.0}) if "design" in fields else (x.diff(), {})
    cost = u**2 + own**2 / 2 - price * own
    problem = sled({}, cost=cost, parameters=parameters, problem=fields)
    solution = dmoc.solve(problem)
    assert solution.solved
    assert solution.cost == pytest.approx(-(price**2) / 2, rel=1e-6)


@pytest.mark.parametrize("price", [1.0, 1e3, 1e6])
def test_a_minimum_that_is_far_away_is_one(price: float) -> None:
    """u = price (1 - t) costs -price^2/6, by the midpoint rule -price^2 (1/6 - h^2/24)."""
    solution = dmoc.solve(sled({}, cost=u**2 / 2, terminal_cost=-price * x))
    assert solution.solved
    assert solution.cost == pytest.approx(-(price**2) * (1 / 6 - 1 / 400 / 24), rel=1e-9)


def test_a_minimum_after_a_long_least_time_is_one() -> None:
    """The cost falls up to 600 s, of which no motion that is allowed takes less than 500 s."""
    late = -1 / (1 + ((dmoc.final_time - 600) / 100) ** 2)
    stated = {"final_time": (500, None), "steps": 10}
    solution = dmoc.solve(sled(STOP, cost=u**2, objective=late, problem=stated), verify=False)
    assert solution.solved, solution.message
    assert solution.final_time == pytest.approx(600, rel=1e-4)


@pytest.mark.parametrize("limits", [{}, {u: (-30, 30)}], ids=["free", "within limits"])
@pytest.mark.parametrize("starts", [1, None])
def test_a_slower_and_slower_motion_through_a_hit_has_no_minimum(
    limits: dict[Any, Any], starts: int | None
) -> None:
    """Forth to the wall, where half of the speed is left, and back: the effort falls as T^-3."""
    stated = {
        "start": {x: 0, "x_dot": 0}, "sequence": ["wall"], "restitution": 0.5, "steps": 25,
        "final_time": (0.5, None), "bounds": limits,
    }  # fmt: skip
    problem = sled({x: 0, "x_dot": 0}, cost=u**2, surfaces={"wall": x <= 1}, problem=stated)
    solution = dmoc.solve(problem, "ipm", starts=starts)
    assert solution.status == "stalled" and "give final_time an upper limit" in solution.message
    assert "falls as long as the motion takes longer" in solution.message
    assert dmoc.solve(problem.but(final_time=(0.5, 3.0)), "ipm", starts=starts).solved


@pytest.mark.parametrize("price", [3e4, 1e5, 3e8])
@pytest.mark.parametrize("options", [{}, {"method": "ipm", "starts": 1}, {"tolerance": 1e-4}])
def test_a_minimum_is_one_in_whatever_units(price: float, options: dict[str, Any]) -> None:
    """In millimetres what was 33 m with 100 N: the first motion says nothing of such sizes."""
    problem = sled({}, cost=u**2 / 2, terminal_cost=-price * x, problem={"steps": None})
    solution = dmoc.solve(problem, **options)
    assert solution.solved and solution.verification is not None
    assert solution.cost == pytest.approx(-(price**2) / 6, rel=1e-4)


def test_a_speed_at_the_start_is_one_in_whatever_units() -> None:
    own = dmoc.at_start(x.diff() ** 2) / 2 - 3e4 * dmoc.at_end(x)
    problem = sled({}, objective=own, inputs=[], forces={}, problem=ROLLING)
    solution = dmoc.solve(problem)
    assert solution.solved and solution.verification is not None
    assert solution.cost == pytest.approx(-(3e4**2) / 2, rel=1e-6)


@pytest.mark.parametrize("sequence", [[], ["wall"]])
def test_a_time_without_a_least_one_is_told(sequence: list[str]) -> None:
    """Nothing limits the force, and time alone costs; with a limit the least one is known."""
    stated = {"final_time": (None, None), "sequence": sequence, "steps": 20}
    problem = sled({x: 0.9, "x_dot": 0}, cost=1, surfaces={"wall": x <= 1}, problem=stated)
    solution = dmoc.solve(problem, "ipm", starts=1)
    assert solution.status == "stalled" and "it falls as u grows" in solution.message
    limited = dmoc.solve(problem.but(sequence=[], bounds={u: (-1e6, 1e6)}), "ipm")
    assert limited.solved and limited.cost == pytest.approx(2 * (0.9 / 1e6) ** 0.5, rel=1e-6)


@pytest.mark.parametrize(
    ("work", "name"),
    [("solved_from", "effort and time"), ("best_on_mesh", "a price of the place")],
)
def test_ctrl_c_in_a_solve_that_follows_ends_the_answer(
    work: str, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Be it a solve from the end of the first motion or one afresh: none comes after it."""
    goal, order, fields, _ = ENDLESS[name]
    problem, solve, before = sled(goal, order, **fields), getattr(case, work), 0

    def interrupted(*arguments: Any) -> dmoc.Solution:
        nonlocal before
        before += 1
        solution: dmoc.Solution = solve(*arguments)
        return replace(solution, status=Status.INTERRUPTED)

    monkeypatch.setattr(case, work, interrupted)
    solution = dmoc.solve(problem, "ipm", starts=1)
    assert solution.status == "interrupted" and "interrupted" in solution.message
    assert before == 1


def test_what_runs_away_is_named_wherever_the_solve_was_lost() -> None:
    """Far away rounding errors decide, of which a cost above zero may be left."""
    goal, order, fields, _ = ENDLESS["a price of the end and time"]
    problem = sled(goal, order, **fields)
    lost = dmoc.solve(problem, "ipm", starts=1)
    costs = replace(lost.trajectory, cost=14484.6)
    lost = replace(lost, trajectory=costs, cause="", notes=(), status=Status.STALLED)
    looked_at: Any = SimpleNamespace(problem=problem, afresh=partial(dmoc.solve, starts=16))
    told = ended(lost, looked_at)
    assert told.message.startswith("the cost has no minimum, it falls as final_time grows: -400")


def test_what_no_limit_of_the_time_helps_is_diagnosed_once(
    block: Kernels, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is pushed forwards alone, and to rest further on."""
    count, without = [0], one_mesh._without_start

    def counted(*arguments: Any) -> dmoc.Solution:
        count[0] += 1
        return without(*arguments)

    monkeypatch.setattr(one_mesh, "_without_start", counted)
    problem = dmoc.Problem(
        block, {"x": 0}, {"x": 0.5, "x_dot": 0}, steps=20, bounds={"u": (0, 1)},
        durations=[(None, None)],
    )  # fmt: skip
    assert dmoc.solve(problem, starts=4).status == "infeasible"
    assert count == [1]
