"""Where nothing keeps all limits, SLSQP stops where the squares of what is violated are least:
closed forms of two unknowns, of which one follows from the other."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dmoc.solvers.slsqp import _least_violation


def least(
    wanted: float, box: tuple[float, float], row: tuple[float, float], start: float = 0.0
) -> float:
    """The unknown y, behind which 2 y follows: the equation y = wanted, bounds of 2 y, and the
    inequality a y + b >= 0."""
    a, b = row
    lower, upper = np.array([-9.0, box[0]]), np.array([9.0, box[1]])
    nlp = SimpleNamespace(
        lower=lower, upper=upper, n_in=1,
        equality=lambda x: np.array([x[1] - 2 * x[0], x[0] - wanted]),
        inequality=lambda x: np.array([a * x[0] + b]),
    )  # fmt: skip
    reduced = SimpleNamespace(
        equality=np.array([[1.0]]), inequality=np.array([[a]]), unknowns=np.array([[2.0]])
    )
    elimination = SimpleNamespace(
        complete=lambda x, y: np.array([y[0], 2 * y[0]]), reduce=lambda x, rows, gone: reduced
    )
    parts = SimpleNamespace(kept=np.array([0]), eliminated=np.array([1]), kept_rows=np.array([1]))
    descent: Any = SimpleNamespace(
        nlp=nlp, parts=parts, elimination=elimination, lengths=np.ones(2)
    )
    tally: Any = SimpleNamespace(check_time=lambda: None, step=lambda x: None)
    x = _least_violation(descent, np.array([start, 2 * start]), tally)
    assert x[1] == pytest.approx(2 * x[0])
    return float(x[0])


@pytest.mark.parametrize(
    ("wanted", "box", "row", "y"),
    [
        (1.0, (-9, 9), (1.0, 0.0), 1.0),  # all is kept
        (1.0, (-9, 1), (1.0, 0.0), 0.6),  # (y - 1)^2 + (2 y - 1)^2
        (-1.0, (-1, 9), (-1.0, 0.0), -0.6),
        (-1.0, (3, 9), (1.0, 9.0), 1.0),  # (y + 1)^2 + (2 y - 3)^2
        (1.0, (-9, 9), (-1.0, 0.0), 0.5),  # (y - 1)^2 + y^2
        (1.0, (-9, 9), (-2.0, 1.0), 0.6),
        (-1.0, (-9, 9), (1.0, -2.0), 0.5),  # (y + 1)^2 + (y - 2)^2
    ],
)
@pytest.mark.parametrize("start", [0.0, 3.0, -3.0])
def test_what_is_violated_is_shared_by_squares(
    wanted: float, box: tuple[float, float], row: tuple[float, float], y: float, start: float
) -> None:
    assert least(wanted, box, row, start) == pytest.approx(y, abs=1e-6)
