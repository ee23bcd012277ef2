"""A puck and a cart-pendulum among walls, which are searched, and a block that is too weak."""

from __future__ import annotations

import pytest
from searches import shipped, unnamed

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.sequences.search import SearchResult


@pytest.fixture(scope="session")
def table() -> dmoc.Problem:
    return shipped("puck_table", steps=16)


@pytest.fixture(scope="session")
def whole(table: dmoc.Problem) -> SearchResult:
    return dmoc.search(table, 3)


@pytest.fixture(scope="session")
def pair(table: dmoc.Problem) -> SearchResult:
    return dmoc.search(table, 2)


@pytest.fixture
def weak(block: Kernels) -> dmoc.Problem:
    """The block comes to 1/2 in the time there is: the wall is out of reach."""
    return dmoc.Problem(
        block, start={"x": 0.0}, goal={"x": 0.2}, steps=20, bounds={"u": (-1, 1)},
        final_time=(None, 1.0),
    )  # fmt: skip


@pytest.fixture(scope="session")
def swung() -> SearchResult:
    return dmoc.search(unnamed("cart_pendulum"), strategy="propose")
