"""Ends of which nothing could come are refused, and no others: what is fixed of them counts."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import ProblemError
from dmoc.codegen.kernels import Kernels
from dmoc.problem.quantities import total_bounds_of, total_limits_of

X, Y, Z = dynamicsymbols("x y z")


@pytest.fixture(scope="module")
def corner() -> Kernels:
    """A mass before x - y <= 1 and z <= 1, of which the first has two coordinates."""
    kinetic = sum(c.diff() ** 2 for c in (X, Y, Z)) / 2
    walls = {"lean": X - Y <= 1, "roof": Z <= 1}
    return dmoc.build(dmoc.MechanicalSystem("corner", [X, Y, Z], kinetic, {}, surfaces=walls))


@pytest.fixture(scope="module")
def twins() -> Kernels:
    """A point before two lines that are the same, and one across them."""
    lines = {"low": Y >= 0, "same": 2 * Y >= 0, "left": X >= 0}
    kinetic = (X.diff() ** 2 + Y.diff() ** 2) / 2
    return dmoc.build(dmoc.MechanicalSystem("before_twins", [X, Y], kinetic, {}, surfaces=lines))


@pytest.mark.parametrize(
    ("contacts", "sequence", "refused"),
    [
        (["low"], ["+same"], "same touches wherever low do"),
        (["low", "left"], ["+same"], "same touches wherever low and left do"),
        (["same"], ["+low"], "low touches wherever same do"),
        (["left"], ["+low"], ""),
        (["left"], ["+low +same"], ""),
    ],
)
def test_what_touches_with_others_has_nothing_to_land_from(
    twins: Kernels, contacts: list[str], sequence: list[str], refused: str
) -> None:
    """Of two surfaces that are the same, and a third one."""
    start = {"x": 0.0} if "left" in contacts else {"x": 1.0}
    start |= {"y": 0.0} if {"low", "same"} & {*contacts} else {"y": 1.0}
    stated: dict[str, Any] = {"contacts": contacts, "sequence": sequence, "restitution": 0.0}
    if refused:
        with pytest.raises(ProblemError, match=rf"event 1 \(\{sequence[0]}\): {refused}"):
            dmoc.Problem(twins, start, {}, steps=4, final_time=1.0, **stated)
    else:
        dmoc.Problem(twins, start, {}, steps=4, final_time=1.0, **stated)


@pytest.mark.parametrize("end", ["start", "goal"])
@pytest.mark.parametrize("size", [1e-3, 1.0, 1e4])
@pytest.mark.parametrize(
    ("closed", "beyond", "refused"),
    [
        (False, -1.0, False), (False, 0.0, False), (False, 5e-13, False), (False, 1e-11, True),
        (True, 1e-11, False), (True, 5e-10, False), (True, 1e-8, True),
    ],
)  # fmt: skip
def test_what_rounding_leaves_behind_a_surface_is_a_share_of_its_place(
    block: Kernels, end: str, size: float, closed: bool, beyond: float, refused: bool
) -> None:
    """A wall at some size: 1e-12 of it, and 1e-9 of what is closed."""
    at, there = {"x": size * (1 + beyond)}, {"x": 0.0}
    stated: dict[str, Any] = {"parameters": {"wall": size}, "final_time": 1.0, "steps": 4}
    if closed:
        stated["contacts"] = ["wall"]
        there = {"x": size}
    ends = {"start": at, "goal": there} if end == "start" else {"start": there, "goal": at}
    if refused:
        with pytest.raises(ProblemError, match=f"the {end} .* lies behind surface 'wall'"):
            dmoc.Problem(block, **ends, **stated)
    else:
        dmoc.Problem(block, **ends, **stated)


@pytest.mark.parametrize("end", ["start", "goal"])
@pytest.mark.parametrize(
    ("state", "behind"),
    [
        ({"x": 5.0, "y": 0.0, "z": 0.0}, "lean"),
        ({"x": 5.0, "y": (0.0, 9.0), "z": 0.0}, ""),  # y may be 4 or more
        ({"x": (0.0, 5.0), "y": 0.0, "z": 0.0}, ""),
        ({"x": 0.0, "y": 0.0, "z": 1.1}, "roof"),
        ({"x": (0.0, 5.0), "y": (0.0, 9.0), "z": 1.1}, "roof"),
        ({"x": 0.0, "y": 0.0, "z": (1.0, 1.1)}, ""),
        ({"x": 1.0, "y": 0.0, "z": 1.0}, ""),
    ],
)
def test_an_end_lies_behind_a_surface_whose_coordinates_are_fixed(
    corner: Kernels, end: str, state: dict[str, Any], behind: str
) -> None:
    ends: dict[str, Any] = {"start": {"x": 0.0, "y": 0.0, "z": 0.0}, "goal": {}} | {end: state}
    if behind:
        with pytest.raises(ProblemError, match=f"the {end} .* lies behind surface '{behind}'"):
            dmoc.Problem(corner, **ends, steps=4, final_time=1.0)
    else:
        dmoc.Problem(corner, **ends, steps=4, final_time=1.0)


@pytest.mark.parametrize(
    ("state", "into"),
    [
        ({"x": 1.0, "y": 0.0, "z": 0.0, "x_dot": 0.1}, "lean"),
        ({"x": 1.0, "y": 0.0, "z": 0.0, "y_dot": 0.1}, ""),
        ({"x": 1.0, "y": 0.0, "z": 1.0, "y_dot": 0.1, "z_dot": 0.1}, "roof"),
        ({"x": 1.0, "y": (0.0, 9.0), "z": 0.0, "x_dot": 0.1}, ""),  # y may be more than 0
        ({"x": 0.99, "y": 0.0, "z": 0.0, "x_dot": 0.1}, ""),
    ],
)
def test_a_start_on_a_surface_does_not_move_into_it(
    corner: Kernels, state: dict[str, Any], into: str
) -> None:
    stated = {"x_dot": 0.0, "y_dot": 0.0, "z_dot": 0.0} | state
    if into:
        with pytest.raises(ProblemError, match=f"lies on surface '{into}' and moves into"):
            dmoc.Problem(corner, start=stated, goal={}, steps=4, final_time=1.0)
    else:
        dmoc.Problem(corner, start=stated, goal={}, steps=4, final_time=1.0)


@pytest.mark.parametrize(
    ("sense", "bounds", "fits"),
    [
        (1, (None, 2.0), True), (1, (0.0, None), False), (1, (0.0, 2.0), False), (1, None, True),
        (-1, (0.0, None), True), (-1, (None, 2.0), False), (-1, (0.0, 2.0), False),
        (0, (0.0, 2.0), True),
    ],
)  # fmt: skip
def test_an_integral_with_kinks_has_bounds_on_the_side_that_holds_it(
    sense: int, bounds: Any, fits: bool
) -> None:
    problem: Any = SimpleNamespace(
        kernels=SimpleNamespace(manifest=SimpleNamespace(senses={"work": sense})),
        model=SimpleNamespace(totals_of=["way", "work"]), goal={"way": 1.0, "work": bounds},
    )  # fmt: skip
    if not fits:
        with pytest.raises(ProblemError, match="its integrand has kinks"):
            total_bounds_of(problem)
        return
    low, high = (np.nan if b is None else b for b in bounds or (None, None))
    expected = [-np.inf if np.isnan(low) else low, np.inf if np.isnan(high) else high]
    problem.total_bounds = total_bounds_of(problem)
    np.testing.assert_array_equal(problem.total_bounds, [[1.0, 1.0], expected])
    held = {"way": (1.0, 1.0)} | ({} if bounds is None else {"work": tuple(expected)})
    assert total_limits_of(problem) == held


def test_a_gap_without_a_slope_at_an_end_is_refused_there() -> None:
    """The floor is a quarter of a circle, which is upright at x = 1."""
    kinetic = (X.diff() ** 2 + Y.diff() ** 2) / 2
    rim = {"rim": sp.sqrt(1 - X**2) <= Y}
    kernels = dmoc.build(dmoc.MechanicalSystem("on_a_rim", [X, Y], kinetic, {}, surfaces=rim))
    start, goal = {X: 0, Y: 2}, {X: 1, Y: 1}
    expected = r"the gap to surface 'rim' has no slope at the goal \(x=1, y=1\): expected one with"
    with pytest.raises(ProblemError, match=expected):
        dmoc.Problem(kernels, start, goal, steps=4, final_time=1)
    dmoc.Problem(kernels, start, {X: 1}, steps=4, final_time=1)
