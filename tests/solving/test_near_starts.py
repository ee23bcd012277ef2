"""A motion of the same events on another mesh is near a minimum: the barrier is small from the
first."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import dmoc
from dmoc.models.registry import find
from dmoc.program.transcription import Transcription
from dmoc.solvers import ipm
from dmoc.solvers.outcome import Duals, Ending, Options, Status
from dmoc.solving.starts import starts_of


@pytest.fixture(scope="module")
def table() -> dmoc.Problem:
    reference = find("puck_table")
    return dmoc.Problem(reference.kernels(), **{**reference.defaults, "steps": 60})


@pytest.fixture(scope="module")
def coarse(table: dmoc.Problem) -> dmoc.Solution:
    return dmoc.solve(table, "ipm", starts=1, verify=False)


@pytest.mark.parametrize("steps", [30, 240])
def test_it_takes_fewer_iterations(table: dmoc.Problem, coarse: dmoc.Solution, steps: int) -> None:
    problem = table.but(steps=steps)
    unknowns = starts_of(problem, coarse).points[0]
    near = dmoc.solve(problem, "ipm", guess=coarse, starts=1, verify=False)
    far = dmoc.solve(problem, "ipm", guess=unknowns, starts=1, verify=False)
    assert near.status == far.status == "solved"
    assert near.cost == pytest.approx(far.cost, rel=1e-9)
    assert near.iterations < 0.7 * far.iterations


def test_rows_do_as_solves(table: dmoc.Problem, coarse: dmoc.Solution) -> None:
    problem = table.but(steps=80)
    problems = [problem.but(final_time=t) for t in (1.9, 1.95, 2.0, 2.05)]
    batch = dmoc.solve_many(problems, "ipm", guess=coarse, verify=False)
    alone = dmoc.solve(problems[-1], "ipm", guess=coarse, starts=1, verify=False)
    assert (batch.cost[-1], batch.iterations[-1]) == (alone.cost, alone.iterations)


def test_other_events_or_no_other_mesh_are_not_near(
    table: dmoc.Problem, coarse: dmoc.Solution
) -> None:
    assert starts_of(table.but(steps=30), coarse).near
    assert not starts_of(table, coarse).near
    other = table.but(steps=30, sequence=["west", "east", "north"])
    assert not starts_of(other, coarse).near


def test_where_a_small_barrier_leads_nowhere_the_usual_one_does(
    table: dmoc.Problem, coarse: dmoc.Solution, monkeypatch: pytest.MonkeyPatch
) -> None:
    own, small, begun = ipm.solve_ipm, list[bool](), list[np.ndarray]()

    def failing(
        nlp: Transcription, x: np.ndarray, options: Options, duals: Duals | None = None
    ) -> Ending:
        """An end far away, but from the first start with the usual barrier."""
        small.append(duals is not None)
        begun.append(x.copy())
        end = own(nlp, x, options, duals)
        if np.array_equal(x, begun[0]) and not small[-1]:
            return end
        return replace(end, status=Status.INFEASIBLE, x=end.x + 1.0)

    monkeypatch.setattr(ipm, "solve_ipm", failing)
    answer = dmoc.solve(table.but(steps=30), "ipm", guess=coarse, starts=1, verify=False)
    assert answer.status == "solved" and small[0] and not any(small[1:])
