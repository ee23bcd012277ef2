"""What fixed values say of contacts that last: contradictions are infeasible, and what is said
twice is no obstacle."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
import sympy as sp
from contact_problems import F, G, M, T, U, X, Y, floor
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.solvers import diagnosis
from dmoc.solvers.judge import judged
from dmoc.solvers.outcome import Duals, Ending, Options, Status
from dmoc.solving.methods import Method

pytestmark = pytest.mark.slow

W = dynamicsymbols("w")
SPEED = sp.Symbol("speed")
AT = {"x": 0, "y": 0}
MOVED = {**AT, "x_dot": 1}
RAISED = {**AT, "y_dot": 1}
UNITS = ("metre", "kilogram", "second")


@cache
def kernels(kind: str) -> Any:
    """A block on a floor, a belt, a lift and a ramp; and one that can fly."""
    if kind == "floor":
        return dmoc.build(floor())
    gap = {"lift": Y >= SPEED * T, "ramp": Y >= SPEED / 2 * X}.get(kind, Y >= 0)
    rubs = {"floor": X - SPEED * T} if kind == "belt" else {}
    parameters = {M: 1.0, G: 5.0} | ({} if kind == "flyer" else {SPEED: 1.0})
    return dmoc.build(
        dmoc.MechanicalSystem(
            f"contradicted_{kind}", [X, Y], M * (X.diff(T) ** 2 + Y.diff(T) ** 2) / 2 - M * G * Y,
            parameters | ({F: 0.3} if rubs else {}), inputs=[U, W],
            forces={X: U, Y: W} if kind == "flyer" else {X: U + W}, surfaces={"floor": gap},
            tangents=rubs, friction=dict.fromkeys(rubs, F), cost=U**2 + W**2,
        )
    )  # fmt: skip


def answer(kind: str, start: dict[str, Any], goal: dict[str, Any], **more: Any) -> dmoc.Solution:
    more = {"contacts": ["floor"], "steps": 10, "final_time": 1.0} | more
    return dmoc.solve(dmoc.Problem(kernels(kind), start=start, goal=goal, **more), starts=1)


@pytest.mark.parametrize(
    ("kind", "start", "goal", "more"),
    [
        ("floor", AT, {"y": 0.2}, {}),
        ("floor", AT, {"y_dot": 1}, {}),
        ("floor", AT, {"x": 0, "y": 0, "x_dot": 0, "y_dot": 1}, {}),
        ("floor", AT, {"x": 0, "y": 0, "x_dot": 1, "y_dot": 0}, {}),
        ("floor", AT, {"x_dot": 1}, {}),
        ("floor", AT, {"x": 1, "y": 0, "x_dot": -1, "y_dot": 0}, {"contacts": ["floor:slip+"]}),
        ("floor", AT, {"x": 1}, {"sequence": ["floor:slip+"], "via": [{"y": 0.2}]}),
        ("floor", AT, {"x": 1}, {"sequence": ["floor:slip+"], "via": [{"x": 0.2}]}),
        ("floor", {"x": 0}, {}, {"periodic": {"y": ("y", 0.1)}}),
        ("floor", {"y": 0}, {}, {"periodic": {"x": ("x", 1)}}),
        ("floor", {**AT, "y": 0.5}, {"y": 0.2},
         {"contacts": (), "sequence": ["+floor"], "final_time": (0.1, 1)}),
        ("belt", MOVED, {"x_dot": 0, "y_dot": 0}, {}),
        ("belt", MOVED, {"x": 0.5, "y": 0, "x_dot": 1, "y_dot": 0}, {}),
        ("lift", RAISED, {"x": 1, "y": 0.5}, {}),
        ("lift", RAISED, {"x": 1, "x_dot": 0, "y_dot": 0}, {}),
        ("ramp", AT, {"x": 1, "x_dot": 1, "y_dot": 0.2}, {}),
        ("ramp", AT, {"x": 1, "p_x": 1, "p_y": 0.2}, {}),
    ],
)  # fmt: skip
def test_fixed_values_off_a_closed_contact_are_infeasible(
    kind: str, start: dict[str, Any], goal: dict[str, Any], more: dict[str, Any]
) -> None:
    solution = answer(kind, start, goal, **more)
    assert solution.status == "infeasible", solution.message
    assert "no feasible motion" in solution.message


@pytest.mark.parametrize(
    ("kind", "start", "goal", "more", "cost"),
    [
        ("floor", AT, {**AT, "x_dot": 0, "y_dot": 0}, {}, 0.0),
        ("floor", AT, {**AT, "x_dot": 0, "y_dot": 0}, {"parameters": {"m": 1e-6}}, 0.0),
        ("floor", AT, {}, {"periodic": ["x", "y", "x_dot", "y_dot"]}, 0.0),
        ("floor", {"x": 0}, {}, {"periodic": ["y", "p_x", "p_y"]}, 0.0),
        ("belt", MOVED, {"x": 1, "y": 0, "x_dot": 1, "y_dot": 0}, {}, 0.0),
        ("belt", MOVED, {"x": 0.5, "x_dot": 1}, {"final_time": (0.1, 3)}, 0.0),
        # Two inputs share the force: rest to rest over a way of 1 in a time of 1 costs 12 / 2.
        ("lift", RAISED, {"x": 1, "y": 1, "x_dot": 0, "y_dot": 1}, {}, 6.0),
    ],
)
def test_fixed_values_that_say_what_a_contact_says_are_no_obstacle(
    kind: str, start: dict[str, Any], goal: dict[str, Any], more: dict[str, Any], cost: float
) -> None:
    solution = answer(kind, start, goal, **more)
    assert solution.solved, solution.message
    assert solution.cost == pytest.approx(cost, rel=0.02, abs=1e-9)


@pytest.mark.parametrize("power", [-6, -3, 3, 6])
@pytest.mark.parametrize("unit", ["metre", "kilogram", "second"])
def test_a_block_that_stays_where_it_sticks_is_solved_in_all_units(unit: str, power: int) -> None:
    metre, kilogram, second = (10.0**power if unit == u else 1.0 for u in UNITS)
    solution = answer(
        "floor", AT, {**AT, "x_dot": 0, "y_dot": 0}, final_time=second,
        parameters={"m": kilogram, "g": 5 * metre / second**2},
    )  # fmt: skip
    assert solution.solved and solution.cost == 0, solution.message


@pytest.mark.slow
def test_a_periodic_motion_that_leaves_its_contact_begins_on_it() -> None:
    solution = answer("flyer", {"x": 0}, {"x": 1}, sequence=["-floor"], periodic=["y"])
    assert solution.solved, solution.message
    assert solution.phases[0].q[:, 1] == pytest.approx(0, abs=1e-9)


@pytest.mark.slow
def test_a_search_for_the_least_violation_without_end_is_told(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A metre in a second needs 4 N at least; what three iterations find is not what conflicts."""
    weak = {"bounds": {"u": (-1, 1)}, "start": AT, "goal": {"x": 1, "x_dot": 0}}
    sentence = "the search for the least violation came to no end, so that there may be a motion"
    ended = answer("flyer", **weak, contacts=[])
    assert ended.status == "infeasible" and sentence not in ended.message
    monkeypatch.setattr(diagnosis, "ITERATIONS", 3)
    broken_off = answer("flyer", **weak, contacts=[])
    assert broken_off.status == "infeasible" and sentence in broken_off.message


def test_what_has_a_motion_is_not_infeasible(monkeypatch: pytest.MonkeyPatch) -> None:
    """The method loses its way from every start, the search for the least violation finds one."""

    def losing(self: Method, form: str = "") -> Any:
        def driver(nlp: Any, x: Any, options: Options, duals: Any) -> Any:
            none = Duals(np.zeros(nlp.n_eq), np.zeros(nlp.n_in), np.zeros(nlp.n))
            return judged(nlp, Ending(Status.STALLED, "", x + 0.01, none, 1), options)

        return driver

    monkeypatch.setattr(Method, "minimise", losing)
    lost = answer("flyer", {"x": 0, "y": 1}, {"x": 1, "x_dot": 0}, contacts=[])
    assert lost.status == "stalled" and not lost.conflicts
    assert "there is a motion that keeps all constraints" in lost.message
