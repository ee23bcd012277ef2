"""Where no start leads to a motion, what was left open is tried otherwise, and that is said."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from typing import Any

import pytest
from systems import block_system

import dmoc
from dmoc.base.deadline import ENDLESS
from dmoc.base.errors import ProblemError
from dmoc.codegen.kernels import Kernels
from dmoc.solvers.outcome import Options, Status
from dmoc.solving.attempts import Attempt
from dmoc.solving.multistart import rounds


def stopped(block: Kernels, **changes: Any) -> dmoc.Problem:
    """1 kg is braked with 0.5 N at least, hits a wall after 1 m and would not stay there: it takes
    4 - sqrt(12) s, and an integral of u^2 / 2 of an eighth of it."""
    stated: dict[str, Any] = {
        "sequence": ["wall"], "bounds": {"u": (-1, -0.5)}, "restitution": 0,
        "final_time": (None, 5), "steps": 20,
    }  # fmt: skip
    start, goal = {"x": 0.0, "x_dot": 2.0}, {"x": 1.0, "x_dot": 0.0}
    return dmoc.Problem(block, start, goal, **(stated | changes))


def test_an_end_at_rest_may_be_that_of_the_last_event(block: Kernels) -> None:
    solution = dmoc.solve(stopped(block))
    assert solution.status == "solved" and solution.phases[-1].duration == 0
    assert solution.cost == pytest.approx((4 - math.sqrt(12)) / 8, rel=1e-6)
    assert "no start led to a motion: it has a last duration of 0" in solution.message


def test_a_form_that_there_is_none_of_is_not_tried(
    block: Kernels, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(self: dmoc.Problem, **changes: Any) -> dmoc.Problem:
        if "durations" in changes:
            raise ProblemError("no motion ends with such an event.")
        return but(self, **changes)

    but = dmoc.Problem.but
    monkeypatch.setattr(dmoc.Problem, "but", refused)
    solution = dmoc.solve(stopped(block))
    assert solution.status == "infeasible" and "nor did" not in solution.message


@pytest.mark.parametrize(
    ("seconds", "failing", "starts"),
    [(None, (4,), 0), (30.0, (4,), 5), (30.0, (2, 4), 14)],
)
def test_another_order_is_tried_after_a_third_of_the_time(
    monkeypatch: pytest.MonkeyPatch, seconds: float | None, failing: tuple[int, ...], starts: int
) -> None:
    """A start of order 4 takes 2 s, and none of some orders leads to a motion.  Where no form does,
    the starts go on."""
    real, now, orders = rounds.attempts_from, [100.0], list[int]()

    def slow(programs: Any, points: Any, options: Options, *_: Any) -> list[Attempt]:
        order = programs.problem.order
        some = list(points)
        if seconds and order == 4:
            some = some[: math.ceil(options.deadline.left / 2)]
            now[0] += 2.0 * len(some)
        orders.extend([order] * len(some))
        attempts = real(programs, some, replace(options, deadline=ENDLESS))
        return [a.ending(Status.INFEASIBLE) if order in failing else a for a in attempts]

    if seconds:
        monkeypatch.setattr(time, "perf_counter", lambda: now[0])
    monkeypatch.setattr(rounds, "attempts_from", slow)
    problem = dmoc.Problem(block_system(), {"x": 0.0}, {"x": 0.5, "x_dot": 0.0}, final_time=1.0)
    solution = dmoc.solve(problem, seconds=seconds)
    assert orders.count(4) == starts or not seconds
    if 2 in failing:  # but the guess on the problem's own mesh does
        assert solution.starts == starts
        return
    assert solution.status == "solved" and solution.kernels is not None
    assert solution.cost == pytest.approx(1.5, rel=1e-3)
    assert solution.kernels.manifest.order == 2 and solution.steps[0] >= 60
    assert "it has kernels of order 2 and 60 steps" in solution.message
