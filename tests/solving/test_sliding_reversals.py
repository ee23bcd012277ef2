"""Sequences in which hits turn what slides."""

from __future__ import annotations

from itertools import islice

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.solving.sliding_reversals import _turned

x, y, u = dynamicsymbols("x y u")


def between_walls(hits: int) -> dmoc.Problem:
    """A block that slides to and fro between two walls."""
    system = dmoc.MechanicalSystem(
        "shuttle", [x, y], (x.diff() ** 2 + y.diff() ** 2) / 2 - 9.81 * y, inputs=[u],
        forces={x: u}, surfaces={"floor": y >= 0, "wall": x <= 1, "back": x >= -1},
        tangents={"floor": x}, friction={"floor": sp.Rational(3, 10)}, cost=u**2,
    )  # fmt: skip
    return dmoc.Problem(
        system, {x: 0, y: 0}, {x: 0}, contacts=["floor:slip+"], sequence=["wall", "back"] * hits,
        restitution=0.5, final_time=3, steps=2,
    )  # fmt: skip


def test_those_with_more_turns_come_first() -> None:
    assert [*_turned(between_walls(1))] == [
        ("wall floor:slip-", "back floor:slip+"), ("wall floor:slip-", "back floor:stick"),
        ("wall floor:slip-", "back"), ("wall floor:stick", "back"),
        ("wall", "back floor:slip-"), ("wall", "back floor:stick"), ("wall", "back"),
    ]  # fmt: skip


def test_a_long_sequence_goes_as_deep_as_it_is_long() -> None:
    """Further than Python calls itself."""
    first, second = islice(_turned(between_walls(1500)), 2)
    assert first == ("wall floor:slip-", "back floor:slip+") * 1500
    assert second == (*first[:-1], "back floor:stick")
