"""Feedback in C: the inputs are those of Python, at any phase, time and state."""

from __future__ import annotations

import math
from pathlib import Path
from subprocess import run

import numpy as np
import pytest
from c_objects import SANITIZED, WARNINGS, object_of
from sympy.physics.mechanics import dynamicsymbols
from systems import unit_mass

import dmoc
from dmoc.base.errors import ProblemError
from dmoc.control.controller import Measured

X, U = dynamicsymbols("x u")

MAIN = r"""
#include "thrown_feedback.h"
#include <stdio.h>

int main(void)
{
    int phase;
    double t, seconds, y[THROWN_FEEDBACK_STATES], u[THROWN_FEEDBACK_INPUTS];
    for (int i = 0; i < THROWN_FEEDBACK_PHASES; ++i) {
        thrown_feedback_span(i, &t, &seconds);
        printf("%.17g %.17g\n", t, seconds);
    }
    while (scanf("%d %lf %lf %lf %lf", &phase, &t, &seconds, y, y + 1) == 5) {
        thrown_feedback_input(phase, t, seconds, y, u);
        printf("%.17g\n", u[0]);
    }
    return 0;
}
"""


@pytest.fixture(scope="module")
def hold() -> tuple[dmoc.Problem, dmoc.Solution, dmoc.Feedback]:
    wall = unit_mass("planned_wall", cost=U**2 / 2, surfaces={"wall": X <= 1})
    problem = dmoc.Problem(
        dmoc.build(wall, order=4), {"x": 0.0}, {"x": 0.5, "x_dot": 0.0}, sequence=["wall"],
        steps=10, final_time=2.0, bounds={"u": (-20, 20)},
    )  # fmt: skip
    solution = dmoc.solve(problem)
    return problem, solution, dmoc.feedback(solution)


def test_inputs_are_those_of_python(
    hold: tuple[dmoc.Problem, dmoc.Solution, dmoc.Feedback], tmp_path: Path
) -> None:
    """At times within phases and beyond their nodes; some are cut off by the bounds."""
    problem, solution, feedback = hold
    folder = tmp_path / "thrown"
    files = dmoc.generate_solver(problem, folder, guess=solution, feedback=feedback)
    table = folder / "thrown_feedback.csv"
    assert table in files
    assert table.read_bytes() == feedback.to_csv(tmp_path / "own.csv").read_bytes()
    assert "thrown_feedback_input" in (folder / "README.md").read_text()
    assert "thrown_feedback.c" in (folder / "Makefile").read_text()
    (folder / "driver.c").write_text(MAIN)
    sources = (folder / "thrown_feedback.c", folder / "driver.c")
    objects = [object_of(source, *WARNINGS, *SANITIZED) for source in sources]
    run(["gcc", *SANITIZED, *objects, "-lm", "-o", folder / "driver"], check=True)

    random = np.random.default_rng(3)
    rows = [
        (int(random.integers(2)), *random.uniform((-0.5, 0, -1, -3), (2.5, 0.1, 2, 3)).tolist())
        for _ in range(200)
    ]
    rows += [(0, g.t[3], 0.0, 0.3, 1.0) for g in feedback.phases]
    stdin = "".join(
        " ".join(f"{x:.17g}" for x in row) + "\n" for row in [*rows, (1, 1, 0, np.nan, 0)]
    )
    done = run([folder / "driver"], input=stdin, capture_output=True, text=True, check=True)
    lines = done.stdout.splitlines()
    spans = [tuple(map(float, line.split())) for line in lines[:2]]
    assert spans == [feedback.span(0), feedback.span(1)]
    low, high = feedback.bounds[0]
    cut = 0
    for (phase, t, seconds, *y), line in zip(rows, lines[2:-1], strict=True):
        measured = Measured(phase, t, np.array(y))
        u = float(feedback.steer(phase, t, seconds, measured)[0])
        cut += not low <= u <= high
        assert float(line) == pytest.approx(min(max(u, low), high), rel=1e-12, abs=1e-12)
    assert 0 < cut < len(rows) / 2
    assert math.isnan(float(lines[-1]))


def test_what_is_no_feedback_of_the_answer_is_refused(
    hold: tuple[dmoc.Problem, dmoc.Solution, dmoc.Feedback], tmp_path: Path
) -> None:
    problem, solution, feedback = hold
    with pytest.raises(ProblemError, match="feedback = 3: expected what"):
        dmoc.generate_solver(problem, tmp_path / "a", guess=solution, feedback=3)  # type: ignore[arg-type]
    other = problem.but(final_time=2.1)
    with pytest.raises(ProblemError, match="that of another motion"):
        dmoc.generate_solver(other, tmp_path / "a", feedback=feedback)
    with pytest.raises(ProblemError, match="and most_bytes = "):
        size = feedback_bytes(problem, solution, tmp_path / "b")
        dmoc.generate_solver(
            problem, tmp_path / "c", guess=solution, feedback=feedback, most_bytes=size
        )


def feedback_bytes(problem: dmoc.Problem, solution: dmoc.Solution, folder: Path) -> int:
    """Bytes that a solver takes without a feedback."""
    dmoc.generate_solver(problem, folder, guess=solution)
    lines = (folder / "README.md").read_text().splitlines()
    sizes = [
        line.split("|")[2].split()[0] for line in lines if line.startswith(("| work", "| const"))
    ]
    return sum(map(int, sizes))
