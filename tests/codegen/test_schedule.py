"""Functions that code calls, with the order of the highest derivative that any result needs."""

from __future__ import annotations

from itertools import permutations
from types import SimpleNamespace
from typing import Any

import pytest

from dmoc.codegen.schedule import _by_function


@pytest.mark.parametrize("paths", list(permutations([(), (0,), (0, 1)])))
def test_a_function_has_the_order_of_its_highest_derivative(paths: Any) -> None:
    """Whichever comes first; another function has its own."""
    results: Any = [SimpleNamespace(value=("f", path)) for path in paths]
    others: Any = [SimpleNamespace(value=("g", (1,))), SimpleNamespace(value=("h", ()))]
    assert _by_function([others[0], *results, others[1]]) == {
        ("g", 1): [(1,)],
        ("f", 2): list(paths),
        ("h", 0): [()],
    }
