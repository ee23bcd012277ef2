"""Patterns of sparse matrices from contributions."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse

from dmoc.program.sparse import SparsePattern


def test_contributions_to_one_entry_share_its_slot() -> None:
    """The matrix is the one that SciPy adds up from the same contributions."""
    rng, shape = np.random.default_rng(7), (9, 5)
    groups = [
        (rng.integers(-1, 9, size), rng.integers(0, 5, size)) for size in ((12, 3), (0, 4), (20, 1))
    ]
    pattern = SparsePattern(shape, groups)
    values = np.zeros(pattern.size)
    wanted = np.zeros(shape)
    for slots, (rows, columns) in zip(pattern.slots, groups, strict=True):
        assert slots.shape == rows.shape and ((slots < 0) == (rows < 0)).all()
        numbers, there = rng.normal(size=rows.shape), rows >= 0
        np.add.at(values, slots[there], numbers[there])
        entries = numbers[there], (rows[there], columns[there])
        wanted += scipy.sparse.coo_matrix(entries, shape=shape).toarray()
    matrix = scipy.sparse.csr_matrix((values, pattern.indices, pattern.indptr), shape=shape)
    assert matrix.has_canonical_format and matrix.toarray() == pytest.approx(wanted, abs=1e-14)


def test_one_column_in_rows_that_follow_each_other_has_an_entry_in_each() -> None:
    pattern = SparsePattern((3, 2), [(np.array([1, 0, 1]), np.array([1, 1, 1]))])
    assert pattern.indptr.tolist() == [0, 1, 2, 2] and pattern.indices.tolist() == [1, 1]
    assert pattern.slots[0].tolist() == [1, 0, 1]


def test_no_contributions_make_an_empty_pattern() -> None:
    for groups in ([], [(np.full((2, 3), -1), np.full((2, 3), -1))]):
        pattern = SparsePattern((4, 2), groups)
        assert pattern.size == 0 and pattern.indptr.tolist() == [0] * 5


@pytest.mark.parametrize("place", [(4, 0), (0, 2), (0, -1)])
def test_places_outside_are_refused(place: tuple[int, int]) -> None:
    with pytest.raises(ValueError, match=r"expected places of 4 by 2"):
        SparsePattern((4, 2), [(np.array([place[0]]), np.array([place[1]]))])
