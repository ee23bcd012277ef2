"""Rims of cylinders: angles that are roots, beside closed forms, SciPy and differences."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import sympy as sp
from scipy.optimize import minimize
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.angles import least_angle
from dmoc.base.errors import ModelError
from dmoc.symbolic.conversion import plain_nodes
from dmoc.symbolic.graph import Graph, GraphNode
from dmoc.symbolic.kernel_family import contracted
from dmoc.symbolic.rims import NearestToRim, RimAndEdge, RimAndLine, RimAndRim
from dmoc.symbolic.traversal import evaluated

WORLD, LEANING = dmoc.spatial.World(), dmoc.attitude(axis=(0, 1, 0), angle=0.6)


class Can:
    """A cylinder at random, its upper rim and its axis."""

    def __init__(self, rng: np.random.Generator) -> None:
        turn = rng.normal(size=4)
        R = dmoc.attitude(tuple(turn / np.linalg.norm(turn))).matrix
        self.at, (self.radius, self.half) = rng.normal(size=3), rng.uniform(0.1, 0.8, 2)
        attitude = sp.Matrix(R.tolist())
        self.shape = dmoc.spatial.Cylinder(self.radius, 2 * self.half, tuple(self.at), attitude)
        self.rim, self.R = dmoc.spatial.rims(self.shape)["_1"], R

    def place(self, s: float) -> np.ndarray:
        local = (self.radius * np.cos(s), self.radius * np.sin(s), self.half)
        return np.asarray(self.at + self.R @ local)


def least(square: Callable[[np.ndarray], float], count: int) -> float:
    """The least distance over angles and lengths, from many places."""
    starts = np.array(np.meshgrid(*[np.linspace(0, 6, 7)] * count)).reshape(count, -1).T
    best = sorted(starts, key=square)[:6]
    ends = (minimize(square, s, method="Nelder-Mead", options={"xatol": 1e-8}) for s in best)
    return math.sqrt(min(end.fun for end in ends))


@pytest.mark.parametrize("seed", range(6))
def test_rims_are_as_far_as_their_nearest_places(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = Can(rng), Can(rng)

    def of_rims(s: np.ndarray) -> float:
        return float(((a.place(s[0]) - b.place(s[1])) ** 2).sum())

    ours = float(WORLD.distance(a.rim, b.rim))
    assert abs(ours) == pytest.approx(least(of_rims, 2), abs=1e-6)
    assert float(WORLD.distance(b.rim, a.rim)) == pytest.approx(ours, abs=1e-13)
    edge = dmoc.spatial.edges(dmoc.spatial.Box((1, 2, 3), tuple(b.at), sp.Matrix(b.R)))["_6"]
    at, along = (np.array(v, dtype=float) for v in (edge.at, edge.along))

    def of_line(s: np.ndarray) -> float:
        way = a.place(s[0]) - at
        return float(way @ way - (way @ along) ** 2)

    ours = float(WORLD.distance(a.rim, edge))
    assert abs(ours) == pytest.approx(least(of_line, 1), abs=1e-6)
    assert float(WORLD.distance(edge, a.rim)) == ours
    rod = dmoc.spatial.Capsule(0.1, 0.2, tuple(b.at), sp.Matrix(b.R))
    away = least(lambda s: (np.cross(a.place(s[0]) - b.at, b.R[:, 2]) ** 2).sum(), 1)
    assert float(WORLD.distance(a.rim, rod)) == pytest.approx(away - 0.1, abs=1e-6)


@pytest.mark.parametrize("depth", [0.3, 1e-9, 0.0, -1e-9, -0.03])
def test_rims_overlap_by_what_is_negative(depth: float) -> None:
    """Two rims whose tangents cross: the shortest way is that across both."""
    n = np.array([1, 0, 1]) / math.sqrt(2)
    tangent = (np.array([0, 1, 0]) + np.cross(n, (0, 1, 0))) / math.sqrt(2)
    side = np.cross(n, tangent)
    out, axis = (side - n) / math.sqrt(2), (-side - n) / math.sqrt(2)
    at = np.array([1, 0, 1]) + depth * n - 0.5 * out - 0.5 * axis
    attitude = sp.Matrix(np.column_stack([out, np.cross(axis, out), axis]).tolist())
    a = dmoc.spatial.rims(dmoc.spatial.Cylinder(1.0, 2.0))["_1"]
    b = dmoc.spatial.rims(dmoc.spatial.Cylinder(0.5, 1.0, tuple(at), attitude))["_1"]
    for pair in ((a, b), (b, a)):
        assert float(WORLD.distance(*pair)) == pytest.approx(depth, abs=1e-12)


def test_where_tangents_are_parallel_the_way_counts() -> None:
    """A wheel above a kerb that runs along its rim."""
    wheel = dmoc.spatial.rims(dmoc.spatial.Cylinder(0.5, 2.0))["_1"]
    edge = dmoc.spatial.edges(dmoc.spatial.Box((2, 2, 2), at=(1.8, 0, 2.4)))["_8"]
    assert float(WORLD.distance(wheel, edge)) == pytest.approx(0.5, abs=1e-12)


def test_a_rim_beside_balls_and_planes() -> None:
    rim = dmoc.spatial.rims(dmoc.spatial.Cylinder(0.5, 2.0))["_2"]
    slope = dmoc.spatial.Plane(at=(0, 0, -3), normal=(0, 0.6, 0.8))
    for other, distance in (
        ((0.5, 0, -1.3), 0.3), ((0, 0, -1), 0.5), (dmoc.spatial.Sphere(0.1, (0.8, 0, -1.4)), 0.4),
        (slope, 2 * 0.8 - 0.5 * 0.6),
    ):  # fmt: skip
        assert float(WORLD.distance(rim, other)) == pytest.approx(distance, abs=1e-12)


def nodes_at(node: GraphNode, symbols: Any, x: np.ndarray) -> float:
    return float(evaluated([node], dict(zip(symbols, map(float, x), strict=True)), math)[0])


@pytest.mark.parametrize("kind", [RimAndEdge, RimAndRim, NearestToRim])
def test_slopes_are_those_of_an_implicit_function(kind: Any) -> None:
    """Of first to third order, by differences of the order before."""
    graph, step = Graph(), 1e-5
    function = kind.function(graph, plain_nodes)
    count = len(function.symbols)
    z = function.symbols
    x = np.array([1.4, 0.3, 3.5, 0.2, 0.4, 0.8, 0.7])[:count]
    node = function(z) if kind is NearestToRim else function.body
    path = ()
    for i in (0, 3, 1):
        path = (*path, i)
        slope = node.diff(z[i]) if kind is NearestToRim else function.derivative(path)
        ahead, behind = (nodes_at(node, z, x + s * step * np.eye(count)[i]) for s in (1, -1))
        found = nodes_at(slope, z, x)
        assert found == pytest.approx((ahead - behind) / (2 * step), rel=1e-6, abs=1e-8)
        assert found
        node = slope


def test_the_lower_of_two_valleys_is_found() -> None:
    """Of cos(2 s - c) + a cos(s - b), with two valleys of nearly the same depth, by a fine grid."""
    rng = np.random.default_rng(3)
    a, (b, c) = rng.uniform(-0.1, 0.1, 2000), rng.uniform(0, 7, (2, 2000))

    def terms(z: Any, _: Any) -> Any:
        s = z[-1]
        return (
            np.cos(2 * s - c) + a * np.cos(s - b),
            -2 * np.sin(2 * s - c) - a * np.sin(s - b),
            -4 * np.cos(2 * s - c) - a * np.cos(s - b),
        )

    angle = least_angle(terms, [], 12)
    value, slope, _ = terms([angle], None)
    grid = np.min([terms([s], None)[0] for s in np.linspace(0, 2 * np.pi, 400)], axis=0)
    assert (value <= grid + 1e-12).all() and abs(slope).max() < 1e-13


@pytest.mark.parametrize("backend", ["compiled", "numpy"])
def test_a_can_that_leans_falls_onto_a_ridge(backend: str) -> None:
    """Its lowest place is half its length times the cosine and its radius times the sine below."""
    z, world = dynamicsymbols("z"), dmoc.spatial.World(gravity=10)
    body = world.slide(z, "z", mass=2, inertia=(0, 0, 0))
    can = body.carried(dmoc.spatial.Cylinder(0.5, 1.2, attitude=LEANING))
    roof = dmoc.attitude(axis=(1, 0, 0), angle=np.pi / 4)
    beam = dmoc.spatial.edges(dmoc.spatial.Box((4, 1, 1), attitude=roof)).values()
    ridge = max(beam, key=lambda edge: edge.at[2])
    gap = world.distance(dmoc.spatial.rims(can)["_2"], ridge)
    kernels = dmoc.build(world.system("can", surfaces={"rim": gap >= 0}, cost=1), backend=backend)
    low = 0.6 * np.cos(0.6) + 0.5 * np.sin(0.6) + np.sqrt(0.5)
    run = dmoc.simulate(kernels, {"z": low + 0.2}, step_size=0.1, steps=4, restitution=0.5)
    assert run.collisions[0].time == pytest.approx(0.2, rel=1e-9)
    assert run.collisions[0].impulse == pytest.approx(1.5 * 2 * 2, rel=1e-3)  # steps of order 2


def test_only_sums_of_distances_are_functions_of_their_own() -> None:
    """What is linear in them has second derivatives as one function, a square has not."""
    graph = Graph()
    gap = (function := RimAndLine.function(graph, plain_nodes))(function.symbols)
    assert contracted(3 * gap) is not 3 * gap
    assert contracted(gap * gap) is gap * gap


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: dmoc.spatial.rims(dmoc.spatial.Sphere(1)), "has no rims: expected a cylinder"),
        (lambda: WORLD.distance(dmoc.spatial.rims(dmoc.spatial.Cylinder(1, 1))["_1"],
                                dmoc.spatial.Box((1, 1, 1))), "a rim has a distance from"),
    ],
)  # fmt: skip
def test_what_has_no_rims_is_refused(call: Callable[[], object], message: str) -> None:
    with pytest.raises(ModelError, match=message):
        call()
