"""Boxes of durations: they hold all that add up to the final time, and few of them suffice."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import dmoc
from dmoc.models.registry import find
from dmoc.proving.branch import Branch
from dmoc.proving.linear_problem import linear_problem

WALLS = ["east", "north"]
T = 2.0


@pytest.fixture(scope="module")
def puck() -> dmoc.Problem:
    reference = find("puck_table")
    problem = dmoc.Problem(reference.kernels(), **reference.defaults)
    return problem.but(sequence=WALLS, final_time=T, steps=4).in_rates()


@pytest.mark.parametrize("final_time", [T, (0.7 * T, T)])
def test_boxes_hold_all_durations_that_add_up(
    puck: dmoc.Problem, final_time: float | tuple[float, float]
) -> None:
    linear = linear_problem(puck.but(final_time=final_time))
    branch = Branch(linear, np.inf, 1e9, -1e9, -1e9, 1.0)  # of interest, whatever they cost
    branch.run(600)
    boxes = branch.state()["waiting"][:, 1:7]
    low, high = boxes[:, :3], boxes[:, 3:]
    rng = np.random.default_rng(0)
    times = rng.choice([T, linear.final_time[0]], (500, 1))
    points = rng.dirichlet(np.ones(3), 500) * times
    points = points[(points > linear.durations[:, 0]).all(axis=1)]
    within = (points[:, None] >= low - 1e-14) & (points[:, None] <= high + 1e-14)
    assert within.all(axis=2).any(axis=1).all()


def test_boxes_are_cut_to_what_has_time(puck: dmoc.Problem) -> None:
    """No more than half of a duration's range, in the ratio, is ruled out by the others."""
    branch = Branch(linear_problem(puck), np.inf, 1e9, -1e9, -1e9, 1.0)
    branch.run(600)
    boxes = branch.state()["waiting"][:, 1:7]
    low, high = boxes[:, :3], boxes[:, 3:]
    top = T - (low.sum(axis=1, keepdims=True) - low)
    bottom = T - (high.sum(axis=1, keepdims=True) - high)
    assert (np.log(top / low) > 0.5 * np.log(high / low)).all()
    assert (np.log(high / np.maximum(bottom, low)) > 0.5 * np.log(high / low)).all()


def test_few_boxes_suffice(puck: dmoc.Problem) -> None:
    """Without cuts it takes 1800 of them."""
    cost = dmoc.solve(puck).cost
    branch = Branch(linear_problem(puck), cost, 1e4 * cost, 1e-4, 1e-9, cost)
    assert not branch.run(100_000)
    assert cost * (1 - 1e-4) <= branch.bound <= cost * (1 + 1e-9)
    assert branch.boxes < 1200


@pytest.mark.parametrize("bounds", [{}, {"x": (-9.0, 9.0)}])
def test_prices_without_bounds_of_inputs_are_those_with_distant_ones(
    puck: dmoc.Problem, bounds: dict[str, tuple[float, float]]
) -> None:
    """The dual without bounds is one quadratic function; with them it is a sum over all inputs."""
    durations = np.array([0.8, 0.7, 0.5])
    found = []
    for most in (np.inf, 1e4):
        problem = puck.but(bounds={**bounds, "f_x": (-most, most), "f_y": (-most, most)})
        small = np.stack([durations * (1 - 1e-7), durations * (1 + 1e-7)], axis=1)
        linear = replace(linear_problem(problem), durations=small)
        branch = Branch(linear, np.inf, 1e4, 1e-9, 1e-9, 1.0)
        found.append([branch.bound, *branch.state()["waiting"][0, 7:-1]])
    assert found[0][0] > 0.1
    np.testing.assert_allclose(found[0], found[1], rtol=1e-5, atol=1e-7)
