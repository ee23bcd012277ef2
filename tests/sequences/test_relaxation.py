"""Relaxed programs: their sizes, and the order of hits that are named."""

from __future__ import annotations

import math

import numpy as np
import pytest
from systems import there_and_back

from dmoc.codegen.kernels import Kernels
from dmoc.guess.automatic import initial_guesses
from dmoc.mechanics.touch import Open
from dmoc.sequences import relaxation
from dmoc.sequences.relaxation import Relaxation, _repeated


@pytest.mark.parametrize(
    ("order", "times"),
    [((), 0), ((3,), 0), ((0, 1), 0), ((1, 1), 1), ((0, 0, 1), 1), ((0, 1, 0), 0), ((2, 2, 2), 2)],
)
def test_a_surface_follows_itself_so_often(order: tuple[int, ...], times: int) -> None:
    assert _repeated(order) == times


@pytest.mark.parametrize(("latest", "time"), [(4.0, 4.0), (math.inf, 3.0)])
def test_gaps_are_measured_by_the_longest_time(
    block: Kernels, monkeypatch: pytest.MonkeyPatch, latest: float, time: float
) -> None:
    """A block of 2 kg: rates in which it covers its reach in this time, and impulses that give it
    such rates; without a latest time, in the natural one."""
    monkeypatch.setattr(relaxation, "natural_time", lambda _: 3.0)
    problem = there_and_back(block, final_time=(0.5, latest), parameters={"m": 2.0}, steps=4)
    own = Relaxation(problem, Open((), (), ()), (0,), cost=7.0)
    scale = own._scale(problem, initial_guesses(problem)[0].x)
    assert (scale.time, scale.cost) == (time, 7.0)
    (reach,) = problem.reach
    assert reach >= 1  # to the wall
    sizes = [scale.gap[0], scale.rate[0], scale.lam[0]]
    np.testing.assert_allclose(sizes, [reach, reach / time, 2 * reach / time])
