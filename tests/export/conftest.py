"""What tests of solvers in C share."""

from __future__ import annotations

from pathlib import Path

import pytest
from carried_problems import linkage

import dmoc


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The solver of the bob from below to the side."""
    target = tmp_path_factory.mktemp("solver") / "bob"
    problem = linkage(2)
    dmoc.generate_solver(problem, target, guess=dmoc.solve(problem, "ipm", starts=1, verify=False))
    return target
