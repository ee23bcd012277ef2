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


@pytest.mark.parametrize("sequence", [[], ["wall"]])
def test_a_solution_and_its_multipliers_are_found_from_near(
    block: Kernels, sequence: list[str]
) -> None:
    goal = {"x": 0.0 if sequence else 0.5, "x_dot": 0.0}
    problem = there_and_back(block, sequence=sequence, goal=goal, steps=6)
    x = initial_guesses(problem)[0].x
    nlp = Transcription(problem, scale_of(problem, x))
    end = solve_ipm(nlp, nlp.scaled(x), Options())
    rows = np.flatnonzero(end.duals.w > 1e-4)
    free = nlp.lower < nlp.upper
    near = end.x + np.where(free, 1e-4 * np.sin(1 + np.arange(nlp.n)), 0.0)
    y, w = 0.999 * end.duals.y, np.zeros(nlp.n_in)
    found, duals, _, left = polish(nlp, near, y, w, rows, NONE)
    assert max(left.optimality, left.violation) < 1e-10
    np.testing.assert_allclose(found, end.x, atol=1e-6)
    np.testing.assert_allclose(duals, end.duals.y, atol=1e-4)
