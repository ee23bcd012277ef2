"""Parts of carried solvers alone, under the sanitizers: which masses are positive definite, what
elimination solves, and what a node works with."""

from __future__ import annotations

from collections.abc import Callable
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from c_objects import SANITIZED, WARNINGS, object_of
from carried_folder import run, shared

from dmoc.codegen.compiler import HEADERS
from dmoc.export.solver import PARTS

pytestmark = pytest.mark.slow

Parts = Callable[..., list[float]]


@pytest.fixture(scope="module")
def parts(tmp_path_factory: pytest.TempPathFactory) -> Parts:
    """What parts.c prints."""
    folder = tmp_path_factory.mktemp("parts")
    flags = (
        *WARNINGS,
        *SANITIZED,
        *(f"-I{p}" for p in map(resources.files, PARTS)),
        f"-I{HEADERS}",
    )
    driver = object_of(Path(__file__).with_name("parts.c"), *flags)
    done = run("gcc", *SANITIZED, driver, *shared(SANITIZED, "dmoc_motion.c"), "-lm", "-o", "parts",
               folder=folder)  # fmt: skip
    assert done.returncode == 0, done.stderr

    def printed(*words: object) -> list[float]:
        done = run("./parts", *map(str, words), folder=folder)
        assert done.returncode == 0, done.stderr
        return [float(line) for line in done.stdout.split()]

    return printed


@pytest.mark.parametrize(
    ("matrix", "definite"),
    [
        ([[1.0]], True), ([[0.0]], False), ([[-1.0]], False), ([[1e-300]], True),
        ([[2.0, 1.0], [1.0, 2.0]], True), ([[1.0, 2.0], [2.0, 1.0]], False),
        ([[1.0, 0.0], [0.0, -1.0]], False), ([[-1.0, 0.0], [0.0, 1.0]], False),
        # What is left of the second pivot, 1e8 - 1e4^2 + d, is rounding below 1e-14 of 1e8.
        ([[1.0, 1e4], [1e4, 1e8 + 1e-4]], True), ([[1.0, 1e4], [1e4, 1e8]], False),
        ([[1.0, 1e4], [1e4, 1e8 + 6e-7]], False),
        ([[1.0, 1e-4], [1e-4, 1e-8 + 1e-18]], True), ([[1.0, 1e-4], [1e-4, 1e-8]], False),
        ([[1.0, 0.0, 0.0], [0.0, 1.0, 1e4], [0.0, 1e4, 1e8 + 1e-4]], True),
        ([[1.0, 0.0, 0.0], [0.0, 1.0, 1e4], [0.0, 1e4, 1e8 + 6e-7]], False),
        ([[1.0, 0.0, 1e-4], [0.0, 1.0, 0.0], [1e-4, 0.0, 1e-8 + 1e-18]], True),
        ([[1.0, 0.0, 1e-4], [0.0, 1.0, 0.0], [1e-4, 0.0, 1e-8]], False),
        ([[1.0, 0.5, 0.5], [0.5, 1.0, 0.5], [0.5, 0.5, 1.0]], True),
        ([[1.0, -0.5, -0.5], [-0.5, 1.0, -0.5], [-0.5, -0.5, 1.0]], False),
    ],
)  # fmt: skip
def test_a_mass_is_definite_where_every_pivot_is_clear_of_rounding(
    parts: Parts, matrix: list[list[float]], definite: bool
) -> None:
    flat = [entry for row in matrix for entry in row]
    assert parts("positive", len(matrix), *map(repr, flat)) == [definite]


@pytest.mark.parametrize("rows", [1, 2, 3])
@pytest.mark.parametrize(
    "matrix",
    [
        [[4.0]], [[2.0, 1.0], [1.0, 3.0]], [[0.0, 2.0], [5.0, 1.0]],  # which exchanges rows
        [[4.0, 1.0, 0.5], [1.0, 3.0, -1.0], [0.5, -1.0, 2.0]],
        [[0.0, 0.0, 2.0], [1.0, 1e-9, 3.0], [4.0, 5.0, 6.0]], [[1.0, 2.0, 3.0], [1.0, 2.0, 4.0],
        [0.0, 7.0, 1.0]],
    ],
)  # fmt: skip
def test_elimination_solves_for_every_row(
    parts: Parts, matrix: list[list[float]], rows: int
) -> None:
    A, n = np.array(matrix), len(matrix)
    B = np.arange(1.0, 1.0 + rows * n).reshape(rows, n) ** 1.5
    solved = np.array(parts("solve", n, rows, *map(repr, A.ravel().tolist() + B.ravel().tolist())))
    np.testing.assert_allclose(solved.reshape(rows, n), np.linalg.solve(A, B.T).T, rtol=1e-9)


def test_a_singular_matrix_solves_nothing(parts: Parts) -> None:
    assert not np.isfinite(parts("solve", 2, 1, 1.0, 2.0, 2.0, 4.0, 1.0, 1.0)).all()


def test_every_area_of_a_node_has_its_room(parts: Parts) -> None:
    """Two coordinates, one input, three parameters; a surface, a constraint and a tangent, which
    are three functions that push, with 4, 5 and 2 slopes, and four with what is entered."""
    n, inputs, k = 2, 1, 4
    areas = {
        "parameters": 3, "zeros": n + inputs, "mass": n * n, "copy": n * n, "rest": n, "column": n,
        "spare": n, "slopes": k * n, "push": k * n, "response": k * n, "product": k * k, "rates": k,
        "multiplier": 2 * k, "stored": 4 + 5 + 2 + 3 + 1 + 8,  # and what the judge and laws take
    }  # fmt: skip
    assert parts("room", n, inputs, 3, 1, 1, 1, 1, 1, 1, 4, 5, 2) == list(areas.values())


def test_a_model_that_nothing_holds_has_room_for_its_mass_alone(parts: Parts) -> None:
    assert parts("room", 3, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0) == [0, 3, 9, 9, 3, 3, 3, *[0] * 7]
