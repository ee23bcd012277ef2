"""The mesh on which minima of a coarse one are ranked."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from dmoc.solving.multistart.ranking import RANKING, _mesh


@pytest.mark.parametrize(
    ("steps", "own", "ranked"),
    [
        # That of the problem at most, and no coarser than its own.
        (40, 20, 40), (RANKING, 20, RANKING), (400, 20, RANKING), (400, 200, 200),
        (400, 400, 400), (40, 40, 40), (60, 200, 60),
    ],
)  # fmt: skip
@pytest.mark.parametrize("phase", [0, 1, 2])
def test_a_mesh_is_no_coarser_than_that_of_its_minimum(
    steps: int, own: int, ranked: int, phase: int
) -> None:
    """In each phase by itself; the others are as coarse as they may be."""
    wanted, coarse, expected = [30] * 3, [10] * 3, [30] * 3
    wanted[phase], coarse[phase], expected[phase] = steps, own, ranked
    problem: Any = SimpleNamespace(phase_steps=tuple(wanted), steps=tuple(wanted), meshed=list)
    basin: Any = SimpleNamespace(problem=SimpleNamespace(phase_steps=tuple(coarse)))
    mesh: Any = _mesh(problem, basin)
    assert mesh == expected
