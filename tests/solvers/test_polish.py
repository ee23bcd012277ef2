"""Newton's method on the optimality conditions: from near a solution, without its multipliers, to
rounding errors."""

from __future__ import annotations

import numpy as np
import pytest
from systems import there_and_back

from dmoc.codegen.kernels import Kernels
from dmoc.guess.automatic import initial_guesses
from dmoc.program.scaling import scale_of
from dmoc.program.transcription import Transcription
from dmoc.solvers.ipm import solve_ipm
from dmoc.solvers.outcome import Options
from dmoc.solvers.polish import polish

NONE = np.zeros(0, dtype=np.intp)


@pytest.mark.parametrize(
    ("sequence", "start", "goal", "active"),
    [
        ([], {"x": 0.0}, {"x": 0.5, "x_dot": 0.0}, False),
        (["wall"], {"x": 0.0}, {"x": 0.0, "x_dot": 0.0}, False),
        ([], {"x": 0.0, "x_dot": 6.0}, {"x": 0.0, "x_dot": -6.0}, True),  # 1.5 m but for the wall
    ],
)
def test_a_solution_and_its_multipliers_are_found_from_near(
    block: Kernels,
    sequence: list[str],
    start: dict[str, float],
    goal: dict[str, float],
    active: bool,
) -> None:
    problem = there_and_back(block, sequence=sequence, start=start, goal=goal, steps=6)
    x = initial_guesses(problem)[0].x
    nlp = Transcription(problem, scale_of(problem, x))
    end = solve_ipm(nlp, nlp.scaled(x), Options())
    rows = np.flatnonzero(end.duals.w > 1e-4)
    assert bool(len(rows)) == active
    free = nlp.lower < nlp.upper
    near = end.x + np.where(free, 1e-4 * np.sin(1 + np.arange(nlp.n)), 0.0)
    y, w = 0.999 * end.duals.y, np.zeros(nlp.n_in)
    found, duals, forces, left = polish(nlp, near, y, w, rows, NONE)
    assert max(left.optimality, left.violation) < 1e-10
    np.testing.assert_allclose(found, end.x, atol=1e-6)
    np.testing.assert_allclose(duals, end.duals.y, atol=1e-4)
    np.testing.assert_allclose(forces, end.duals.w, atol=1e-4)


def test_what_would_have_to_pull_is_not_active(block: Kernels) -> None:
    """A gap that is held at the wall, which the best motion stays away from."""
    problem = there_and_back(block, sequence=[], goal={"x": 0.5, "x_dot": 0.0}, steps=6)
    x = initial_guesses(problem)[0].x
    nlp = Transcription(problem, scale_of(problem, x))
    end = solve_ipm(nlp, nlp.scaled(x), Options())
    row = np.array([nlp.laws.step.gap.index[3, 0] - nlp.n_eq])
    same, duals, forces, _ = polish(nlp, end.x, end.duals.y, np.zeros(nlp.n_in), row, NONE)
    np.testing.assert_array_equal(same, end.x)
    np.testing.assert_array_equal(duals, end.duals.y)
    assert not forces.any()
