"""The linear system of the interior-point method, its factorisation, and the C they are in."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import dmoc
from dmoc.program.transcription import Transcription
from dmoc.solvers.compiled import Factorisation
from dmoc.solvers.kkt_layout import kkt_layout

ROOT = Path(__file__).resolve().parents[2]


def test_the_linear_system_is_that_of_the_program(seed: dmoc.Problem) -> None:
    problem = seed.but(
        steps=[3, 4, 3],
        sequence=["lower", "upper"],
        start={"alpha": (0.4, 0.5), "x": 0.0, "alpha_dot": (-1, 1)},
    )
    nlp = Transcription(problem)
    K = kkt_layout(nlp)
    m = nlp.n_eq + nlp.n_in
    free = np.flatnonzero(np.concatenate([nlp.lower < nlp.upper, np.ones(m, dtype=bool)]))
    assert sorted(K.place[free]) == list(range(K.size)) and (np.delete(K.place, free) == -1).all()
    rng = np.random.default_rng(0)
    x, y, w = rng.uniform(0.1, 1, nlp.n), rng.normal(size=nlp.n_eq), rng.normal(size=nlp.n_in)
    hess = nlp.lagrangian_hessian(x, y, -w).tocsr()
    jac = scipy.sparse.vstack([nlp.equality_jacobian(x), nlp.inequality_jacobian(x)]).tocsr()
    values = np.zeros(len(K.row) + 1)
    for source, entries in ((hess.data, K.from_hess), (jac.data, K.from_jac)):
        np.add.at(values, entries, source)  # what is not wanted falls into the last place
    upper = scipy.sparse.csc_matrix((values[:-1], K.row, K.start), shape=(K.size, K.size))
    matrix = (upper + scipy.sparse.triu(upper, 1).T).toarray()
    H = (hess + scipy.sparse.triu(hess, 1).T).toarray()
    expected = np.block([[H, jac.toarray().T], [jac.toarray(), np.zeros((m, m))]])[
        np.ix_(free, free)
    ]
    np.testing.assert_allclose(matrix[np.ix_(K.place[free], K.place[free])], expected, atol=1e-12)


@settings(max_examples=150)
@given(st.integers(0, 10**6), st.integers(0, 8), st.integers(0, 7))
def test_factorisation_solves_and_counts_signs(number: int, pivots: int, final: int) -> None:
    """Random sparse indefinite matrices against dense linear algebra, whatever the widths of the
    pivots."""
    rng = np.random.default_rng([number, pivots, final])
    widths = rng.integers(1, 3, pivots)
    first = np.concatenate([[0], np.cumsum(widths)]).astype(np.int32)
    n = int(first[-1]) + final
    assume(n > 0)
    K = np.triu(rng.normal(size=(n, n)) * (rng.random((n, n)) < 0.4))
    np.fill_diagonal(K, rng.normal(size=n) + np.sign(rng.normal(size=n)) * 3)
    upper = scipy.sparse.csc_matrix(K)
    dense = K + np.triu(K, 1).T
    signs = np.linalg.eigvalsh(dense)
    assume(np.abs(signs).min() >= 1e-3)
    right = rng.normal(size=n)
    K = Factorisation(first, upper.indptr.astype(np.int32), upper.indices.astype(np.int32))
    counts, x = K.factor(upper.data), K.solve(right)
    assert counts == ((signs > 0).sum(), (signs < 0).sum(), 0)
    np.testing.assert_allclose(dense @ x, right, atol=1e-6)


@pytest.mark.parametrize(("wide", "steps", "border"), [(2, 90, 1), (7, 12, 3), (90, 2, 0)])
def test_a_chain_with_a_border_is_factorised(wide: int, steps: int, border: int) -> None:
    """Saddle points of pivots of two that couple neighbours and all of them the border: columns
    with the same rows, and more of them than one block takes."""
    rng = np.random.default_rng([wide, steps, border])
    n = 2 * wide * steps
    step = np.arange(n) // (2 * wide)
    K = rng.normal(size=(n, n)) * (np.abs(step[:, None] - step) <= 1)
    second = np.arange(n) % 2 == 1
    K[np.ix_(second, second)] = 0.0  # equations
    K[np.arange(0, n, 2), np.arange(1, n, 2)] += 9.0 * np.sqrt(wide)
    K = np.block([[K, rng.normal(size=(n, border))], [np.zeros((border, n)), -9 * np.eye(border)]])
    upper = scipy.sparse.csc_matrix(np.triu(K))
    dense = np.triu(K) + np.triu(K, 1).T
    signs = np.linalg.eigvalsh(dense)
    right = rng.normal(size=n + border)
    first = np.arange(0, n + 1, 2, dtype=np.int32)
    K = Factorisation(first, upper.indptr.astype(np.int32), upper.indices.astype(np.int32))
    counts, x = K.factor(upper.data), K.solve(right)
    assert counts == ((signs > 0).sum(), (signs < 0).sum(), 0)
    np.testing.assert_allclose(dense @ x, right, atol=1e-8)


def test_a_final_group_without_diagonal_is_factorised() -> None:
    """Saddle points need pivots of two, which complete pivoting finds."""
    A = np.random.default_rng(4).normal(size=(3, 5))
    dense = (
        np.block([[np.zeros((5, 5)), A.T], [A, np.zeros((3, 3))]])
        + np.diag([1.0] * 5 + [0.0] * 3) * 1e-3
    )
    upper = scipy.sparse.csc_matrix(np.triu(dense) + 0.0)
    first = np.zeros(1, dtype=np.int32)
    right = np.arange(8.0)
    K = Factorisation(first, upper.indptr.astype(np.int32), upper.indices.astype(np.int32))
    counts, x = K.factor(upper.data), K.solve(right)
    assert counts == (5, 3, 0)
    np.testing.assert_allclose(dense @ x, right, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    "source",
    ["program/passes.c", *(f"solvers/{p.name}" for p in sorted((ROOT / "solvers").glob("*.c")))],
)
def test_sources_compile_without_warnings(tmp_path: Path, source: str) -> None:
    compiler = shutil.which("gcc") or shutil.which("cc")
    assert compiler is not None
    flags = ["-std=c11", "-O2", "-Wall", "-Wextra", "-Werror", "-pedantic"]
    flags += [f"-I{ROOT / folder}" for folder in ("codegen", "program", "solvers")]
    subprocess.run(
        [compiler, *flags, "-c", str(ROOT / source), "-o", str(tmp_path / "x.o")], check=True
    )
