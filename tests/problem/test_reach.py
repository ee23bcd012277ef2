"""How far coordinates may be expected to move, and how long that takes."""

from __future__ import annotations

from math import pi
from typing import Any

import pytest
import sympy as sp
from pytest import approx
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.guess.automatic import natural_time

T = dynamicsymbols._t
LIGHT = 1e-4
SHARE = (1 / LIGHT + 1) ** 0.5  # of a light part that takes as much energy as all in a metre


def moved(name: str, further: Any, **data: Any) -> dmoc.Problem:
    """A cart goes a metre; a light part is ``further`` to the right, as a function of b."""
    x, b, u = dynamicsymbols("x b u")
    part = x + further(b)
    height = -sp.cos(b) if further is sp.sin else 0
    kinetic = x.diff(T) ** 2 + LIGHT * (part.diff(T) ** 2 + sp.diff(height, T) ** 2)
    system = dmoc.MechanicalSystem(
        name, [x, b], kinetic / 2 - LIGHT * height, inputs=[u], forces={x: u}, cost=1
    )
    return dmoc.Problem(
        system, **({"start": {"x": 0.0, "b": None}, "goal": {"x": 1.0}, "final_time": 1.0} | data)
    )


def test_a_light_part_that_turns_gets_half_a_turn_far() -> None:
    """By its energy it would turn sixteen times."""
    assert moved("light_leg", sp.sin).reach == approx([1.0, pi], rel=1e-12)


def test_more_turns_are_expected_where_they_are_said() -> None:
    turns = 4 * pi
    wound = {"start": {"x": 0.0, "b": 0.0}, "goal": {"x": 1.0, "b": turns}}
    assert moved("light_leg", sp.sin, **wound).reach == approx([1.0, turns], rel=1e-12)
    wide = {"bounds": {"b": (-turns, turns)}}
    assert moved("light_leg", sp.sin, **wide).reach == approx([1.0, 2 * turns], rel=1e-12)


def test_only_what_turns_is_spread_further_than_it_reaches() -> None:
    """A light part that goes 0.1, of which its energy would make ten or more."""
    ends = {"start": {"x": 0.0, "b": 0.0}, "goal": {"x": 1.0, "b": 0.1}}
    assert moved("light_leg", sp.sin, **ends).spread == approx([1.0, pi], rel=1e-12)
    slider = moved("light_slider", lambda b: b, **ends)
    assert slider.spread == approx([1.0, 0.1], rel=1e-12)


@pytest.mark.parametrize(
    ("name", "further"),
    [("light_slider", lambda b: b), ("light_slider_on_a_bow", lambda b: b + b**2 / 9)],
)
def test_what_slides_gets_as_far_as_its_energy_takes_it(name: str, further: Any) -> None:
    """Nothing depends on where the slider is; or something does, and not as after a turn."""
    assert moved(name, further).reach == approx([1.0, SHARE], rel=1e-9)


def test_what_rounding_leaves_of_an_acceleration_takes_no_time() -> None:
    """A rod falls without turning, whatever the last digits of the forces say."""
    y, a = dynamicsymbols("y a")
    places = sp.Matrix([0, y]), sp.Matrix([sp.sin(a), y - sp.cos(a)])
    lagrangian = sum(
        m * (r.diff(T).dot(r.diff(T)) / 2 - sp.Rational(981, 100) * r[1])
        for m, r in zip((1, LIGHT), places, strict=True)
    )
    rod = dmoc.MechanicalSystem("falling_rod", [y, a], lagrangian, cost=1)
    for angle in (0.3, 0.7, 1.1, 1.9):
        problem = dmoc.Problem(rod, {"y": 1.0, "a": angle}, {"y": 0.0}, final_time=(0.1, 9.0))
        assert natural_time(problem) == approx((2 / 9.81) ** 0.5, rel=1e-5)
