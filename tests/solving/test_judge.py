"""One judge for all methods."""

from __future__ import annotations

import block_and_wall
import numpy as np
import pytest
from methods import INSTALLED

import dmoc
from dmoc.nlp.guess import initial_guesses
from dmoc.nlp.scaling import scale_of
from dmoc.solvers.judge import INFEASIBLE, verdict
from dmoc.solvers.outcome import Options, Outcome, Residuals, Status
from dmoc.solving.methods import METHODS
from dmoc.solving.program import Programs

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
    found = outcome(weak, method, Options())
    assert found.status is Status.INFEASIBLE and found.left.violation > 0.1


@pytest.mark.parametrize("method", INSTALLED)
def test_a_tolerance_below_rounding_stalls_every_method(method: str) -> None:
    found = outcome(block_and_wall.problem(0.8, 10), method, Options(optimality=1e-16))
    assert found.status is Status.STALLED and found.left.violation < 1e-10 and found.detail
