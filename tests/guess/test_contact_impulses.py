"""First values of impulses along phases that are held: balances by hand."""

from __future__ import annotations

import numpy as np
import pytest
from systems import block_on_floor

import dmoc
from dmoc.guess.contacts import standing
from dmoc.program.layout import Layout


@pytest.mark.parametrize("order", [2, 4])
@pytest.mark.parametrize("word", ["slip+", "stick"])
def test_a_floor_carries_the_weight_of_a_block(order: int, word: str) -> None:
    """2 kg for 3 s in 6 steps: each has 10 N s, of which its stations have their shares; nothing
    is to be rubbed on a straight way."""
    kernels = dmoc.build(block_on_floor("carried_block", 2.0, 10.0, 0.5), order=order)
    goal = {"x": 1.0 if word == "slip+" else 0.0}
    problem = dmoc.Problem(
        kernels, {"x": 0.0, "y": 0.0}, goal, contacts=[f"floor:{word}"], steps=6, final_time=3.0
    )
    x, lay = standing(problem, 1.0), Layout.of(problem)
    normal, *_ = (r for r in lay.reactions(0) if r.kind == "normal")
    impulses = normal.impulses(x)[:, 0]
    shares = lay.stations.share[lay.stations.rows(0)]
    np.testing.assert_allclose(impulses, 10.0 * shares, rtol=1e-9)
    assert impulses.sum() == pytest.approx(60.0)
    others = [r.impulses(x) for r in lay.reactions(0) if r.kind != "normal"]
    np.testing.assert_allclose(np.hstack(others), 0.0, atol=1e-9)
