"""Quantities that there are at hits alone: bounded at each of them, and priced by their peaks."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import ModelError, ProblemError
from dmoc.codegen.kernels import Kernels
from dmoc.inspection.kernel_check import kernel_errors

X, U = dynamicsymbols("x u")
M, PRICE = sp.symbols("m price")
E, TWICE = 0.8, ("wall", "left", "wall")


def block() -> dmoc.MechanicalSystem:
    """A block between two walls, with impulses of all hits of one and of its second one, and a rate
    whose largest magnitude is priced."""
    return dmoc.MechanicalSystem(
        "struck", [X], M * X.diff() ** 2 / 2, {M: 1.0, PRICE: 0.0}, inputs=[U], forces={X: U},
        surfaces={"wall": X <= 1, "left": X >= -1}, cost=U**2,
        quantities={"blow": dmoc.impulse("wall"), "second": dmoc.impulse("wall", 2),
                    "speed": -X * dmoc.approach("wall"), "push": U},
        objective=PRICE * dmoc.largest("speed"),
    )  # fmt: skip


@pytest.fixture(scope="module")
def kernels() -> Kernels:
    return dmoc.build(block())


def forth_and_back(kernels: Kernels, words: tuple[str, ...] = TWICE, **more: Any) -> dmoc.Problem:
    return dmoc.Problem(
        kernels, {"x": 0}, {"x": 0, "x_dot": 0}, words, restitution=E, steps=20,
        **{"final_time": 2, **more},
    )  # fmt: skip


def solved(problem: dmoc.Problem) -> dmoc.Solution:
    solution = dmoc.solve(problem, "ipm", starts=1)
    assert solution.solved
    return solution


def blows(solution: dmoc.Solution) -> list[float]:
    return [c.impulse for c in solution.collisions if c.surface == "wall"]


def test_a_bound_holds_at_every_hit(kernels: Kernels) -> None:
    """The free optimum strikes with 6.5 and 7.2 N s; P = m (1 + e) v."""
    free = solved(forth_and_back(kernels))
    assert min(blows(free)) > 6
    held = solved(forth_and_back(kernels, bounds={"blow": (None, 4)}))
    assert blows(held) == pytest.approx([4, 4], rel=1e-9)
    assert [c.rate_before for c in held.collisions[::2]] == pytest.approx(
        [4 / (1 + E)] * 2, rel=2e-3
    )
    assert [str(b) for b in held.active_bounds] == ["blow at event 1", "blow at event 3"]


def test_a_bound_holds_at_the_hit_of_its_number(kernels: Kernels) -> None:
    first, second = blows(solved(forth_and_back(kernels, bounds={"second": (None, 4)})))
    assert second == pytest.approx(4, rel=1e-9) and first > 5


def test_a_price_of_the_loudest_hit_is_the_slope_of_its_bound(kernels: Kernels) -> None:
    """At the optimum with a price of the peak s, the least cost with |speed| <= s falls with s as
    the price says; both hits are at the peak."""
    priced = solved(forth_and_back(kernels, parameters={"price": 20}))
    peak = priced.trajectory.totals["largest speed"]
    assert [c.rate_before for c in priced.collisions[::2]] == pytest.approx([peak, peak])
    costs = [
        solved(forth_and_back(kernels, bounds={"speed": (-peak - d, None)})).cost
        for d in (1e-3, -1e-3)
    ]
    assert (costs[0] - costs[1]) / 2e-3 == pytest.approx(-20, rel=1e-4)
    none = solved(forth_and_back(kernels, (), parameters={"price": 20}))
    assert none.trajectory.totals["largest speed"] == 0
    assert "the sequence never hits 'wall', of which quantity 'blow' and quantity" in none.message
    assert "does not determine" not in none.message


def test_the_check_notices_other_peaks_and_bounds(kernels: Kernels) -> None:
    motion = solved(forth_and_back(kernels, parameters={"price": 20})).trajectory
    peak = motion.totals["largest speed"]
    wrong = replace(motion, totals={"largest speed": 0.9 * peak})
    assert f"largest speed is {peak:.6g} at the hits" in dmoc.verify(wrong, kernels).message
    wrong = replace(motion, limits={"blow": (-float("inf"), 0.95 * max(blows_of(motion)))})
    assert "the bound of blow" in dmoc.verify(wrong, kernels).message


def blows_of(motion: Any) -> list[float]:
    return [c.impulse for c in motion.collisions if c.surface == "wall"]


def test_kernels_of_hits_agree_with_an_evaluation_in_many_digits(kernels: Kernels) -> None:
    errors = {c.kernel: c.error for c in kernel_errors(block(), kernels)}
    assert max(errors[f"hit_value{part}"] for part in ("", "_jac", "_hess")) < 1e-12


def test_hits_that_there_are_not(kernels: Kernels) -> None:
    with pytest.raises(ProblemError, match=r"'second' is about hit 2 of 'wall', .* hits once"):
        dmoc.solve(forth_and_back(kernels, ("wall",)))
    found = dmoc.search(forth_and_back(kernels, ()), max_collisions=1)
    assert {n.sequence for n in found.nodes} == {(), ("wall",), ("left",)}
    with pytest.raises(ProblemError, match="unknown state or quantity 'blow' at the goal"):
        forth_and_back(kernels).but(goal={"x": 0, "blow": 1})
    both = {"both": dmoc.impulse("wall") + dmoc.impulse("left")}
    with pytest.raises(ModelError, match=r"quantity 'both' contains .* with hits of impulse"):
        replace(block(), quantities=both, objective=0, parameters={M: 1.0})
    blow = dmoc.impulse("wall")
    for text, fields in (
        ("the cost contains dmoc.impulse\\(wall\\), a number of hits", {"cost": blow}),
        ("price dmoc.total of such an integral", {"objective": blow}),
        ("a number of a whole motion: expected it in `objective`", {"cost": dmoc.peak("blow")}),
    ):
        with pytest.raises(ModelError, match=text):
            replace(block(), **fields)
