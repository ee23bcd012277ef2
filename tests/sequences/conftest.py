"""A puck among four walls, which is searched, and a block that is too weak."""

from __future__ import annotations

import pytest

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.models.registry import find
from dmoc.sequences.search import SearchResult


@pytest.fixture(scope="session")
def table() -> dmoc.Problem:
    reference = find("puck_table")
    return dmoc.Problem(reference.kernels(), **{**reference.defaults, "steps": 16})


@pytest.fixture(scope="session")
def found(table: dmoc.Problem) -> SearchResult:
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
