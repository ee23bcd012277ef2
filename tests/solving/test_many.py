"""Many solves at once: the same answers with any workers, a row for every problem, and nothing lost
by one that fails, by time or by Ctrl-C."""

from __future__ import annotations

import errno
import multiprocessing.util
import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import block_and_wall
import numpy as np
import pytest
from batch_rows import MASSES, masses

import dmoc
from dmoc.base.errors import ProblemError
from dmoc.motion.trajectory import Array
from dmoc.program.structure_cache import MEMORY
from dmoc.solving import many
from dmoc.solving.keywords import Keywords

pytestmark = pytest.mark.slow


def same(a: dmoc.Batch, b: dmoc.Batch) -> bool:
    columns = ("status", "message", "collisions", "check")
    numbers = ("cost", "final_time", "collision_times", "impulses", "iterations")
    return all(getattr(a, c) == getattr(b, c) for c in columns) and all(
        np.array_equal(getattr(a, n), getattr(b, n), equal_nan=True) for n in numbers
    )


@pytest.mark.slow
def test_each_row_is_what_a_solve_of_its_own_finds(bounced: dmoc.Problem) -> None:
    problems = masses(bounced, *MASSES)
    batch = dmoc.solve_many(iter(problems), keep=True)
    assert batch.complete and batch.solved.all() and batch.counts == {"solved": 3}
    assert batch.check == ("passed",) * 3 and batch.collisions == ("wall",) * 3
    # The force and the impulse grow with the mass, the motion stays.
    least, at, _ = block_and_wall.EXACT[0.8]
    assert batch.cost == pytest.approx(least * np.square(MASSES), rel=1e-5)
    assert batch.collision_times[:, 0] == pytest.approx(at, abs=1e-4)
    assert batch.impulses[:, 0] / MASSES == pytest.approx(batch.impulses[1, 0], rel=1e-6)
    for problem, solution, cost in zip(problems, batch.solutions, batch.cost, strict=True):
        assert solution is not None and solution.kernels is problem.kernels
        assert solution.cost == cost == dmoc.solve(problem, "ipm", starts=1).cost


def test_rows_that_start_at_a_solution_are_what_each_finds_alone(seed: dmoc.Problem) -> None:
    """Of neighbours in the angle, the largest force and the time, and in masses and lengths:
    programs that share what their form says, and whose names and numbers are their own."""
    nominal = seed.but(steps=(12, 12), final_time=1.0)
    first, late = dmoc.solve(nominal, "ipm", verify=False), nominal.but(final_time=(0.9, 1.1))
    angle = nominal.start["alpha"]
    problems = [
        late.but(
            start={**late.start, "alpha": a * angle}, bounds={"F": (-200 * b, 200 * b)},
            final_time=(0.9 * b, a), parameters={"m_p": b, "l": 0.5 * a},
        )
        for a, b in ((1.0, 0.98), (0.99, 1.01), (1.02, 1.0))
    ]  # fmt: skip
    batch = dmoc.solve_many(problems, guess=first, keep=True, verify=False)
    assert batch.solved.all()
    for problem, row in zip(problems, batch.solutions, strict=True):
        MEMORY.clear()
        alone = dmoc.solve(problem, "ipm", guess=first, verify=False)
        assert row is not None and row.message == alone.message
        np.testing.assert_allclose(row.unknowns, alone.unknowns, rtol=1e-12, atol=1e-12)
        assert row.multipliers.keys() == alone.multipliers.keys()
        for name, values in alone.multipliers.items():
            np.testing.assert_allclose(row.multipliers[name], values, rtol=1e-12, atol=1e-12)
        assert row.active_bounds == alone.active_bounds
        assert row.scale == alone.scale


@pytest.mark.slow
def test_the_rows_do_not_depend_on_who_solves(bounced: dmoc.Problem) -> None:
    problems = masses(bounced, *np.linspace(0.5, 2.0, 11))
    here = dmoc.solve_many(problems)
    assert same(here, dmoc.solve_many(problems, workers=2))
    with ThreadPoolExecutor(4) as threads:
        assert same(here, dmoc.solve_many(problems, executor=threads))


def test_problems_are_explored_only_where_that_is_asked_for(
    bounced: dmoc.Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    starts: list[Any] = []
    solved = many.solved

    def noted(problem: dmoc.Problem, keywords: Keywords, guess: Any, **_: Any) -> dmoc.Solution:
        starts.append(keywords.starts)
        return solved(problem, replace(keywords, starts=1), guess)

    monkeypatch.setattr(many, "solved", noted)
    dmoc.solve_many([bounced])
    dmoc.solve_many([bounced], starts=7)
    dmoc.sweep(bounced, {"m": [1.0]})
    dmoc.sweep(bounced, {"m": [1.0]}, starts=None)
    assert starts == [1, 7, 1, None]


def test_a_guess_and_options_serve_all(bounced: dmoc.Problem) -> None:
    problems = masses(bounced, 0.9, 1.1)
    nominal = dmoc.solve(bounced, "ipm")
    cold, warm = dmoc.solve_many(problems), dmoc.solve_many(problems, guess=nominal, verify=False)
    assert warm.cost == pytest.approx(cold.cost, rel=1e-8)
    assert (warm.iterations < cold.iterations).all() and warm.check == ("", "")
    assert dmoc.solve_many(problems, iterations=1).status == ("iteration_limit",) * 2


def test_collisions_of_different_numbers_leave_gaps(bounced: dmoc.Problem) -> None:
    free = bounced.but(sequence=(), goal={"x": 0.5, "x_dot": 0.0})
    batch = dmoc.solve_many([free, bounced])
    assert batch.collisions == ("", "wall")
    assert np.isnan(batch.collision_times[0]).all() and np.isfinite(batch.impulses[1]).all()
    # from rest to rest over half a metre in a second: 6 s^2 / t^3
    assert batch.cost[0] == pytest.approx(1.5, rel=1e-6)


def test_a_problem_that_cannot_be_solved_is_a_row(
    bounced: dmoc.Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    solved = many.solved

    def flawed(problem: dmoc.Problem, *rest: Any, **_: Any) -> dmoc.Solution:
        m = problem.parameters["m"]
        if m == 1.0:
            raise ProblemError("the second is none.")
        if m == 2.0:
            raise ZeroDivisionError("by chance")
        return solved(problem, *rest)

    monkeypatch.setattr(many, "solved", flawed)
    monkeypatch.setattr(many.Pace, "together", 1)
    batch = dmoc.solve_many(masses(bounced, 0.5, 1.0, 2.0, 3.0))
    assert batch.status == ("solved", "refused", "failed", "solved")
    assert batch.message[1:3] == ("the second is none.", "ZeroDivisionError: by chance")
    assert np.isnan(batch.cost[1:3]).all() and batch.complete


class Deadly(dmoc.Problem):
    """A problem that ends the process that unpacks it."""

    def __reduce__(self) -> tuple[Any, ...]:
        return os._exit, (1,)


@pytest.mark.slow
def test_a_worker_that_dies_costs_only_its_problem(bounced: dmoc.Problem) -> None:
    problems = masses(bounced, *np.linspace(0.5, 2.0, 9))
    deadly = problems[4]
    problems[4] = Deadly(deadly.kernels, deadly.start, deadly.goal, deadly.sequence)
    batch = dmoc.solve_many(problems, workers=2)
    assert batch.status == ("solved",) * 4 + ("failed",) + ("solved",) * 4
    assert batch.message[4] == "the worker process died"
    # Killed, and perhaps not yet gone; one that the pool's thread has just awaited passes for alive
    # until that thread has noted how it ended.
    until = time.monotonic() + 20
    while any(c.is_alive() for c in multiprocessing.active_children()):
        assert time.monotonic() < until
        time.sleep(0.05)


def test_where_no_worker_can_be_started_that_is_told(
    bounced: dmoc.Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As on a full disk, and in a process of a pool."""

    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("dmoc.solving.processes.ProcessPoolExecutor", full)
    batch = dmoc.solve_many(masses(bounced, 1.0, 1.0), workers=2, verify=False)
    assert batch.status == ("not_tried",) * 2
    assert batch.message[0].startswith("no worker process can be started ([Errno 28] No space")
    assert batch.message[0].endswith("take workers=1")


@pytest.mark.parametrize("workers", [1, 2])
def test_a_sweep_states_a_problem_when_its_turn_comes(
    bounced: dmoc.Problem, workers: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not those that are left when the time is used up."""
    stated = list[Any]()

    def counted(problem: dmoc.Problem, axes: Any, values: Any) -> Any:
        stated.append(values)
        return problem.but(parameters={"m": values[0]})

    monkeypatch.setattr("dmoc.solving.sweep._problem", counted)
    masses = np.linspace(1.0, 2.0, 1000)
    batch = dmoc.sweep(bounced, {"m": masses}, seconds=1e-9, workers=workers)
    assert batch.status == ("not_tried",) * 1000 and not stated
    assert (batch.varied["m"] == masses).all()
    dmoc.sweep(bounced, {"m": masses[:3]})
    assert [values for (values,) in stated] == [1.0, *masses[1:3]]


def test_no_problems_are_an_empty_table() -> None:
    batch = dmoc.solve_many([])
    assert len(batch) == 0 and batch.complete and batch.columns()["cost"] == []


SCRIPT = r"""
import os

import dmoc
from dmoc.models.registry import find

reference = find("puck_table")
problem = dmoc.Problem(reference.kernels(), **{**reference.defaults, "steps": 10})


def east(t):
    return 0.1 * t


os.write(1, f"run {__name__}\n".encode())  # whole, also beside another worker
"""
CALL = "print(dmoc.solve_many([problem] * 2, workers=2, guess=GUESS).status)"


@pytest.mark.slow
@pytest.mark.parametrize(
    "call, runs",
    [
        (CALL.replace("GUESS", "None"), ["run __main__"]),
        (
            f"if __name__ == '__main__': {CALL.replace('GUESS', '{chr(120): east}')}",
            ["run __main__", "run __mp_main__"],
        ),
    ],
    ids=["no guard", "its function"],
)
def test_workers_run_the_script_only_for_its_functions(
    tmp_path: Path, call: str, runs: list[str]
) -> None:
    script = tmp_path / "script.py"
    script.write_text(SCRIPT + call + "\n", encoding="utf-8")
    done = subprocess.run(
        [sys.executable, str(script)], capture_output=True, text=True, timeout=120
    )
    # A worker that is quick leaves nothing to do for another one.
    lines = done.stdout.splitlines()
    assert {*lines} == {"('solved', 'solved')", *runs} and len(lines) <= 4, done.stderr


def test_a_sweep_goes_over_every_combination(bounced: dmoc.Problem) -> None:
    batch = dmoc.sweep(
        bounced, {"m": [1.0, 2.0]}, start={"x": [0.0, -0.5, 0.25]}, bounds={"u": [(-30, 40)]}
    )
    assert list(batch.varied) == ["m", "start x", "bounds u"]
    assert batch.varied["m"].tolist() == [1, 1, 1, 2, 2, 2]
    assert batch.varied["start x"].tolist() == [0.0, -0.5, 0.25] * 2
    assert batch.varied["bounds u"].tolist() == [40.0] * 6
    one = bounced.but(parameters={"m": 2.0}, start={"x": -0.5}, bounds={"u": (-30, 40)})
    assert batch.cost[4] == dmoc.solve(one, "ipm", starts=1).cost
    assert batch.cost[3:] == pytest.approx(4 * batch.cost[:3], rel=1e-6)


def test_a_combination_that_is_no_problem_is_refused_in_its_row(bounced: dmoc.Problem) -> None:
    batch = dmoc.sweep(bounced, start={"x": [0.0, 1.5]})
    assert batch.status == ("solved", "refused") and "wall" in batch.message[1]


def test_the_columns_of_a_sweep_are_numbers(bounced: dmoc.Problem) -> None:
    bounds: Array = dmoc.sweep(bounced, bounds={"u": [(-30, None), (None, 40), None]}).varied[
        "bounds u"
    ]
    np.testing.assert_array_equal(bounds, [-30.0, 40.0, np.nan])


@pytest.mark.slow
def test_the_script_stays_where_it_is_while_workers_start(
    bounced: dmoc.Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Other threads look there."""
    script, seen = sys.modules["__main__"], []

    def started(*arguments: Any) -> int:
        seen.append(sys.modules["__main__"])
        return spawnv_passfds(*arguments)

    spawnv_passfds = multiprocessing.util.spawnv_passfds
    monkeypatch.setattr(multiprocessing.util, "spawnv_passfds", started)
    assert set(dmoc.solve_many([bounced] * 2, workers=2).status) == {"solved"}
    assert len(seen) >= 2 and all(module is script for module in seen)
