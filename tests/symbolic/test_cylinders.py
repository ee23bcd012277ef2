"""Distances of whole cylinders, beside MuJoCo, closed forms and differences."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.symbolic.conversion import plain_nodes
from dmoc.symbolic.graph import Graph
from dmoc.symbolic.separation import _functions
from dmoc.symbolic.traversal import evaluated
from tests.placed_shapes import Placed, nearest

WORLD, ACROSS = dmoc.spatial.World(), dmoc.attitude(axis=(1, 0, 0), angle=np.pi / 2)


@pytest.mark.parametrize(
    ("kind", "count"), [("capsule", 4), ("cylinder", 3), ("box", 2), ("hull", 1)]
)
def test_cylinders_are_as_far_as_those_of_mujoco(kind: str, count: int) -> None:
    """Apart; moved along the shortest way until both touch; and a little further."""
    rng, found = np.random.default_rng(4), 0
    close = 1e-7 if kind == "hull" else 1e-10  # meshes have the digits of single numbers
    while found < count:
        drum, other = Placed("cylinder", rng), Placed(kind, rng)
        reference, way = nearest(drum, other)
        if reference <= 0:
            assert float(WORLD.distance(drum.shape, other.shape)) < 1e-9
            continue
        found += 1
        assert float(WORLD.distance(other.shape, drum.shape)) == pytest.approx(reference, abs=close)
        n, at = way / reference, other.at
        for depth in (0.0, 1e-4):
            other.place(at - (reference + depth) * n)
            gap = float(WORLD.distance(drum.shape, other.shape))
            assert gap == pytest.approx(-depth, abs=max(close, depth / 50))


def can(radius: float, length: float, at: Any, attitude: Any = None) -> Any:
    return dmoc.spatial.Cylinder(radius, length, at=at, attitude=attitude)


@pytest.mark.parametrize(
    ("other", "distance"),
    [
        (can(0.5, 1.0, (2, 0, 0.2)), 0.5),  # beside each other
        (can(0.5, 1.0, (0, 0, 2)), 0.5),  # one above the other
        (can(0.5, 1.0, (1.8, 0, 1.9)), math.hypot(0.3, 0.4)),  # their rims
        (can(0.5, 8.0, (0, 0, 1.7), ACROSS), 0.2),  # lying on the lid
        (can(0.5, 8.0, (2, 0, 0), ACROSS), 0.5),  # across the side
        (can(0.5, 8.0, (1.8, 0, 1.6), ACROSS), 0.5),  # a side along a rim
        (dmoc.spatial.Capsule(0.1, 8.0, (0, 1.4, 0)), 0.3),
        (dmoc.spatial.Capsule(0.1, 8.0, (0, 0, 1.4), ACROSS), 0.3),
        (dmoc.spatial.Box((2, 2, 2), (0, 0, 2.5)), 0.5),
        (dmoc.spatial.Box((2, 2, 2), (2.3, 0, 2.4)), 0.5),  # an edge along a rim
        (can(0.5, 1.0, (0.3, 0, 0)), -1.2),
    ],
)
def test_shapes_that_are_aligned_have_their_distance(other: Any, distance: float) -> None:
    """Where directions vanish or several are one."""
    drum = dmoc.spatial.Cylinder(1.0, 2.0)
    for pair in ((drum, other), (other, drum)):
        assert float(WORLD.distance(*pair)) == pytest.approx(distance, abs=1e-9)


@pytest.mark.parametrize("kinds", [("cylinder", "segment"), ("box", "box")])
def test_gaps_along_a_direction_have_their_slopes(kinds: tuple[str, str]) -> None:
    """Of first and second order, by differences, for each number of a direction."""
    a, b = ((kind,) for kind in kinds)
    graph, (_, gap) = Graph(), _functions(a, b)
    function = gap.function(graph, plain_nodes)
    z, step = function.symbols, 1e-6
    x = np.random.default_rng(2).uniform(0.2, 0.9, len(z))

    def value(node: Any, at: np.ndarray) -> float:
        return float(evaluated([node], dict(zip(z, map(float, at), strict=True)), math)[0])

    for number in (0, 1, 4):
        x[-1] = number
        slope = function.derivative((1,))
        for node, derivative, i in ((function.body, slope, 1), (slope, slope.diff(z[0]), 0)):
            ahead, behind = (value(node, x + s * step * np.eye(len(z))[i]) for s in (1, -1))
            found = (ahead - behind) / (2 * step)
            assert value(derivative, x) == pytest.approx(found, rel=1e-6, abs=1e-8)


def test_a_rod_falls_onto_a_drum() -> None:
    """Both lie, across each other: their sides meet at the sum of the radii."""
    z, world = dynamicsymbols("z"), dmoc.spatial.World(gravity=10)
    body = world.slide(z, "z", mass=2, inertia=(0, 0, 0))
    rod = body.carried(dmoc.spatial.Capsule(0.3, 2.0, (0, 0, 0), ACROSS))
    turned = dmoc.attitude(axis=(0, 1, 0), angle=np.pi / 2)
    gap = world.distance(rod, dmoc.spatial.Cylinder(0.5, 3.0, attitude=turned))
    kernels = dmoc.build(world.system("rod", surfaces={"drum": gap >= 0}, cost=1), backend="numpy")
    run = dmoc.simulate(kernels, {"z": 1.0}, step_size=0.1, steps=4, restitution=0.5)
    assert run.collisions[0].time == pytest.approx(0.2, rel=1e-9)
    assert run.collisions[0].impulse == pytest.approx(1.5 * 2 * 2, rel=1e-3)  # steps of order 2
