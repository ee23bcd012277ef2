"""Whether the end of Newton's method is a minimum: curvatures of two unknowns by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dmoc.solvers.slsqp_state import Descent

KINDS = "equality", "inequality", "unknowns"
NONE = np.zeros((0, 2))
ALONG, ACROSS, BOTH = [[1.0, 0.0]], [[0.0, 1.0]], [[1.0, 0.0], [0.0, 1.0]]
DIAGONAL = [[1.0, 1.0]]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("rows", "curvature", "lengths", "minimum"),
    [
        (NONE, (1, 2), (1, 1), True), (NONE, (1, -2), (1, 1), False),
        (ACROSS, (1, -2), (1, 1), True), (ACROSS, (-1, 2), (1, 1), False),
        (ALONG, (1, -2), (1, 1), False), (ALONG, (-1, 2), (1, 1), True),
        (BOTH, (-1, -2), (1, 1), True),
        (DIAGONAL, (3, -2), (1, 1), True), (DIAGONAL, (2, -3), (1, 1), False),
        # In sizes s: along (1/s_0, -1/s_1).
        (DIAGONAL, (3, -2), (2, 1), False), (DIAGONAL, (2, -3), (1, 2), True),
    ],
)  # fmt: skip
def test_curvature_counts_along_what_is_left_free(
    kind: str, rows: Any, curvature: tuple[int, int], lengths: tuple[int, int], minimum: bool
) -> None:
    held = {**dict.fromkeys(KINDS, NONE), kind: np.array(rows)}
    assert is_minimum(held, curvature, lengths, np.zeros(2)) is minimum


@pytest.mark.parametrize(
    ("fixed", "curvature", "minimum"),
    [
        ((0, 0), (1, -2), False), ((1, 0), (-1, 2), True), ((0, -1), (-1, 2), False),
        ((0, -1), (1, -2), True), ((1, 1), (-1, -2), True),
    ],
)  # fmt: skip
def test_what_a_bound_holds_is_not_free(
    fixed: tuple[int, int], curvature: tuple[int, int], minimum: bool
) -> None:
    held = dict.fromkeys(KINDS, NONE)
    assert is_minimum(held, curvature, (1, 1), np.array(fixed, float)) is minimum


def is_minimum(
    held: dict[str, np.ndarray], curvature: tuple[int, int], lengths: tuple[int, int], force: Any
) -> bool:
    """Of unknowns in sizes with a diagonal Hessian, some rows, and forces of bounds."""
    descent: Any = SimpleNamespace(
        w=np.zeros(1), bound_force=force, is_eliminated=np.zeros(2, dtype=bool),
        elimination=SimpleNamespace(reduce=lambda x, rows, bounds: SimpleNamespace(**held)),
        lengths=np.array(lengths, float), parts=SimpleNamespace(kept=np.arange(2)),
        _hessian=lambda x, reduced, D: np.diag(np.array(curvature, float)),
    )  # fmt: skip
    return Descent.is_minimum(descent, np.zeros(2))
