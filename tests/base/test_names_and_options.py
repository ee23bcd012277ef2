"""Names that may become code, options without a value, places of quadratures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from dmoc.base.discretisation import gauss
from dmoc.base.errors import ModelError, ProblemError
from dmoc.base.names import check_name
from dmoc.base.options import option, read


@pytest.mark.parametrize(
    ("name", "fits"),
    [("a", True), ("a_1", True), ("a" * 64, True), ("a" * 65, False), ("1a", False), ("a-b", False),
     ("_a", False), ("", False), ("\u00e4", False)],
)  # fmt: skip
def test_a_name_is_an_identifier_of_64_letters_at_most(name: str, fits: bool) -> None:
    if fits:
        assert check_name(name, "coordinate") == name
    else:
        with pytest.raises(ModelError, match="is not a C identifier"):
            check_name(name, "coordinate")


@dataclass(frozen=True)
class Options:
    count: int = option(1, "positive", expected="expected a positive number")
    most: float | None = option(None, "positive", expected="expected a positive number")
    plain: object = option(3)


def test_an_option_may_be_left_open_where_its_field_may_be_none() -> None:
    assert read(Options, {"most": None, "plain": None}, ProblemError) == Options(1, None, None)
    assert read(Options, {"count": 2, "most": 4.0}, ProblemError) == Options(2, 4.0)
    with pytest.raises(ProblemError, match="count = None"):
        read(Options, {"count": None}, ProblemError)
    with pytest.raises(ProblemError, match="most = -1"):
        read(Options, {"most": -1}, ProblemError)


def test_places_of_a_quadrature_rise_with_their_weights() -> None:
    """Gauss with two and three points, and the nodes inside of Lobatto's with four."""
    for points, offsets, weights in (
        (gauss(1), [0.0], [1.0]),
        (gauss(2), [-np.sqrt(3) / 6, np.sqrt(3) / 6], [0.5, 0.5]),
        (gauss(3), [-np.sqrt(0.15), 0.0, np.sqrt(0.15)], [5 / 18, 4 / 9, 5 / 18]),
    ):
        np.testing.assert_allclose(points[0], 0.5 + np.array(offsets), atol=1e-15)
        np.testing.assert_allclose(points[1], weights, atol=1e-15)
    np.testing.assert_allclose(gauss(2, 1)[0], 0.5 + np.array([-1, 1]) * np.sqrt(5) / 10)
