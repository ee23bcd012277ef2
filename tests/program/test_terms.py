"""Where terms read numbers that are the same in every step."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dmoc.base.discretisation import DISCRETISATIONS, ORDERS
from dmoc.program.terms import Places, shares_of


@pytest.mark.parametrize("order", ORDERS)
def test_numbers_of_a_step_are_found_where_the_pool_has_them(order: int) -> None:
    """The first, one within, and the last, in any shape."""
    scheme = DISCRETISATIONS[order]
    lay: Any = SimpleNamespace(scheme=scheme)
    places, pool = (
        Places(lay, 0, 0, 100, False),
        np.concatenate([np.full(100, np.nan), shares_of(scheme)]),
    )
    wanted = np.array([[scheme.nodes[0], scheme.nodes[-1]], [0.5, -1.0], [0.0, 1.0]])
    np.testing.assert_array_equal(pool[places.number(wanted)], wanted)
    every = shares_of(scheme)
    np.testing.assert_array_equal(pool[places.number(every)], every)
