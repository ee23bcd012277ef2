"""One judge for all methods."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import block_and_wall
import numpy as np
import pytest
from methods import INSTALLED

import dmoc
from dmoc.guess.automatic import initial_guesses
from dmoc.models.registry import find
from dmoc.program.layout import Layout
from dmoc.program.scaling import scale_of
from dmoc.solvers.ipm import solve_ipm
from dmoc.solvers.judge import INFEASIBLE, judged, rounded, verdict
from dmoc.solvers.kkt import residuals
from dmoc.solvers.outcome import Duals, Ending, Options, Outcome, Residuals, Status
from dmoc.solving.methods import METHODS
from dmoc.solving.programs import Programs

SHARP, LOOSE, BROKEN = (
    Residuals(1e-9, 1e-12),
    Residuals(1e-3, INFEASIBLE / 2),
    Residuals(1e-9, 2 * INFEASIBLE),
)
NO_NUMBER = Residuals(np.inf, np.inf)


@pytest.mark.parametrize(
    ("left", "status"),
    [
        (SHARP, Status.SOLVED),
        (LOOSE, Status.STALLED),
        (BROKEN, Status.INFEASIBLE),
        (NO_NUMBER, Status.STALLED),
    ],
)
def test_residuals_decide_whatever_a_method_claims(left: Residuals, status: Status) -> None:
    for word in (Status.SOLVED, Status.INFEASIBLE, Status.STALLED):
        assert verdict(word, left, Options()) is status


def test_a_violation_that_is_none_but_rounding_is_told_apart_from_a_small_one() -> None:
    for violation, status in ((1e-5, Status.INFEASIBLE), (1e-7, Status.STALLED)):
        assert verdict(Status.STALLED, Residuals(1e-9, violation), Options()) is status


def test_rounding_errors_of_rows_are_no_violation() -> None:
    """On a fine mesh momenta are differences of positions that are large beside them: the rows of a
    minimum are violated by more than the tolerance, those beside it by more than rounding."""
    reference = find("puck_table")
    problem = dmoc.Problem(reference.kernels(), **{**reference.defaults, "steps": 100})
    coarse = dmoc.solve(problem, "ipm", starts=1, verify=False)
    fine = problem.but(steps=600)
    s = dmoc.solve(fine, "ipm", guess=coarse, starts=1, verify=False)
    assert s.status == "solved" and s.iterations < 60
    assert Options().violation < s.max_violation < 1e-9
    scale = scale_of(fine, s.unknowns, True)
    nlp = Programs(fine, scale).program()
    end = solve_ipm(nlp, nlp.scaled(s.unknowns), Options())
    assert end.status is Status.SOLVED
    off = 1 + 2.5 * np.finfo(float).eps * np.random.default_rng(1).uniform(-1, 1, nlp.n)
    beside = judged(nlp, Ending(Status.SOLVED, "", end.x * off, end.duals, 1), Options())
    assert beside.status is Status.STALLED and rounded(beside.left)


def test_a_point_beyond_a_bound_is_no_solution() -> None:
    """The minimum of wide bounds, judged by the program of narrow ones."""
    problem = block_and_wall.problem(0.8, 10).but(bounds={"u": (-100, 100)})
    end = outcome(problem, "ipm", Options())
    u = np.abs(end.x[Layout.of(problem).index_u]).max()
    x = initial_guesses(problem)[0].x
    scale = scale_of(problem, x)
    limit = 0.99 * float(u * scale.u[0])
    narrow = Programs(problem.but(bounds={"u": (-limit, limit)}), scale).program()
    judgement = judged(narrow, Ending(Status.SOLVED, "", end.x, end.duals, 1), Options())
    assert end.status is Status.SOLVED and judgement.status is Status.INFEASIBLE
    assert judgement.left.violation == pytest.approx(0.01 * u, rel=1e-9)


def test_slopes_by_step_sizes_count_by_how_far_these_can_move() -> None:
    """A step of 1/4 with a slope of 8, another unknown of 3 with a slope of 1."""
    nlp: Any = SimpleNamespace(
        n=2, n_eq=0, lower=np.full(2, -np.inf), upper=np.full(2, np.inf),
        layout=SimpleNamespace(index_h=np.array([0])), cost=lambda x: 4.0,
        lagrangian_gradient=lambda x, y, w: np.array([8.0, 1.0]),
        equality=lambda x: np.zeros(0), inequality=lambda x: np.zeros(0),
    )  # fmt: skip
    none = Duals(np.zeros(0), np.zeros(0), np.zeros(2))
    assert residuals(nlp, np.array([0.25, 3.0]), none) == Residuals(2.0 / 4.0, 0.0)


def test_limits_count_where_there_is_no_solution_and_interruptions_always() -> None:
    for word in (Status.ITERATION_LIMIT, Status.TIME_LIMIT):
        assert verdict(word, SHARP, Options()) is Status.SOLVED
        assert {verdict(word, left, Options()) for left in (LOOSE, BROKEN, NO_NUMBER)} == {word}
    assert verdict(Status.INTERRUPTED, SHARP, Options()) is Status.INTERRUPTED


def outcome(problem: dmoc.Problem, method: str, options: Options) -> Outcome:
    """A method alone, from the first automatic guess."""
    x = initial_guesses(problem)[0].x
    nlp = Programs(problem, scale_of(problem, x)).program(METHODS[method].guided)
    with np.errstate(all="ignore"):
        return METHODS[method].minimise()(nlp, nlp.scaled(x), options, None)


@pytest.mark.parametrize("method", INSTALLED)
def test_a_problem_without_a_feasible_motion_is_infeasible_to_every_method(method: str) -> None:
    weak = block_and_wall.problem(0.8, 10).but(bounds={"u": (-1, 1)})
    end = outcome(weak, method, Options())
    assert end.status is Status.INFEASIBLE and end.left.violation > 0.1


@pytest.mark.parametrize("method", INSTALLED)
def test_a_tolerance_below_rounding_stalls_every_method(method: str) -> None:
    end = outcome(block_and_wall.problem(0.8, 10), method, Options(optimality=1e-16))
    assert end.status is Status.STALLED and end.left.violation < 1e-10 and end.detail


@pytest.mark.parametrize(
    ("optimality", "violation", "sharp"),
    [(9e-6, 9e-10, True), (1.1e-5, 9e-10, False), (9e-6, 1.1e-9, False)],
)
def test_what_rounding_leaves_is_told_from_what_is_unfinished(
    optimality: float, violation: float, sharp: bool
) -> None:
    assert rounded(Residuals(optimality, violation)) is sharp
