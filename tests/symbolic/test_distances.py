"""Distances between shapes in space, beside those of MuJoCo and what separates boxes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import ModelError
from tests.placed_shapes import WEDGE, Placed, of_mujoco

WORLD = dmoc.spatial.World()
CLOSE = 3e-12  # between closed forms and what MuJoCo finds by iterations of 1e-13


@pytest.mark.parametrize(
    ("kinds", "within"),
    [
        ("sphere sphere", True), ("sphere capsule", True), ("capsule capsule", True),
        ("sphere box", True), ("sphere cylinder", True), ("capsule box", True),
        ("point box", False), ("point hull", False), ("sphere hull", False),
        ("capsule hull", False),
    ],
)  # fmt: skip
def test_distances_are_those_of_mujoco(kinds: str, within: bool) -> None:
    """Of meshes and points MuJoCo has no digits where both overlap."""
    rng, apart = np.random.default_rng(7), 0
    for _ in range(6):
        a, b = (Placed(kind, rng) for kind in kinds.split())
        reference = of_mujoco(a, b)
        apart += reference > 0
        ours = float(WORLD.distance(a.shape, b.shape))
        assert (ours > 0) == (reference > 0)
        if within or reference > 0:
            assert ours == pytest.approx(reference, abs=CLOSE if within else 1e-7)
        assert float(WORLD.distance(b.shape, a.shape)) == pytest.approx(ours, abs=1e-12)
    assert apart > 2


@pytest.mark.parametrize("kinds", ["box box", "hull box", "hull hull"])
def test_boxes_and_hulls_are_apart_where_a_plane_separates_them(kinds: str) -> None:
    """By a linear program for the plane; and the distance is never too large."""
    rng, signs = np.random.default_rng(1), set()
    for _ in range(8 if kinds == "box box" else 3):
        a, b = (Placed(kind, rng) for kind in kinds.split())
        rows = [np.c_[a.corners, np.ones(len(a.corners))],
                -np.c_[b.corners, np.ones(len(b.corners))]]  # fmt: skip
        plane = linprog(
            np.zeros(4), A_ub=np.vstack(rows), b_ub=-np.ones(len(a.corners) + len(b.corners)),
            bounds=[(None, None)] * 4,
        )  # fmt: skip
        ours = float(WORLD.distance(a.shape, b.shape))
        assert (ours > 0) == plane.success
        signs.add(ours > 0)
        if ours > 0:
            assert ours <= of_mujoco(a, b) + 1e-7
    assert len(signs) == 2 or kinds != "box box"


def test_within_a_solid_the_nearest_face_counts() -> None:
    cube, drum = dmoc.spatial.Box((2, 2, 2)), dmoc.spatial.Cylinder(1.0, 4.0)
    rod = dmoc.spatial.Capsule(0.1, 0.5, at=(0.2, 0, 0))
    corner = dmoc.spatial.Hull([(0, 0, 0), (2, 0, 0), (0, 2, 0), (0, 0, 2)])
    for shape, other, depth in (
        ((0.3, 0, 0), cube, 0.7), ((0.2, 0.4, 0), drum, 1 - np.hypot(0.2, 0.4)),
        ((0, 0, 1.9), drum, 0.1), (rod, cube, 0.9), ((0.3, 0.2, 0.4), corner, 0.2),
        (dmoc.spatial.Sphere(0.5, at=(0.3, 0, 0)), cube, 1.2),
    ):  # fmt: skip
        assert float(WORLD.distance(shape, other)) == pytest.approx(-depth, abs=1e-11)


def test_two_edges_that_cross_meet() -> None:
    """Of two boxes on their edges: neither has a corner in the other."""
    roof = dmoc.attitude(axis=(1, 0, 0), angle=np.pi / 4)
    other = dmoc.attitude(axis=(0, 1, 0), angle=np.pi / 4)
    a = dmoc.spatial.Box((4, 1, 1), attitude=roof)
    for height in (1.7, 1.3):
        b = dmoc.spatial.Box((1, 4, 1), at=(0, 0, height), attitude=other)
        assert float(WORLD.distance(a, b)) == pytest.approx(height - np.sqrt(2), abs=1e-12)


@pytest.mark.parametrize("turned", [0.0, 1e-7, 1e-4])
def test_segments_may_be_parallel(turned: float) -> None:
    rod = dmoc.spatial.Capsule(0.1, 2.0)
    attitude = dmoc.attitude(axis=(0, 1, 0), angle=turned)
    other = dmoc.spatial.Capsule(0.1, 1.0, at=(1, 0, 0.7), attitude=attitude)
    nearest = 1 - np.sin(turned) * 0.5 if turned else 1.0
    # the end that is nearer lies within the length of the rod
    assert float(WORLD.distance(rod, other)) == pytest.approx(nearest - 0.2, abs=1e-9)
    above = dmoc.spatial.Capsule(0.1, 1.0, at=(0, 0, 2.0))
    assert float(WORLD.distance(rod, above)) == pytest.approx(0.5 - 0.2)


def test_planes_meet_the_lowest_points() -> None:
    turn = dmoc.attitude(axis=(0, 1, 0), angle=0.4)
    slope = dmoc.spatial.Plane(at=(0, 0, -1), normal=(0, 0, 2))
    c, s = np.cos(0.4), np.sin(0.4)
    for shape, lowest in (
        (dmoc.spatial.Sphere(0.2), 0.2),
        (dmoc.spatial.Capsule(0.1, 1.0, attitude=turn), 0.5 * c + 0.1),
        (dmoc.spatial.Cylinder(0.1, 1.0, attitude=turn), 0.5 * c + 0.1 * s),
        (dmoc.spatial.Cylinder(0.1, 1.0), 0.5),
        (dmoc.spatial.Box((1, 1, 2), attitude=turn), c + 0.5 * s),
        (dmoc.spatial.Hull([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, -0.3)]), 0.3),
        ((0, 0, -0.25), 0.25),
    ):
        for pair in ((shape, slope), (slope, shape)):
            assert float(WORLD.distance(*pair)) == pytest.approx(1 - lowest, abs=1e-11)


def test_features_are_shapes() -> None:
    features, plane = dmoc.spatial.features, dmoc.spatial.Plane(at=(0, 0, -1))
    box = features(dmoc.spatial.Box((2, 2, 1)))
    assert [*box] == [f"_{k}" for k in range(1, 9)]
    heights = {float(WORLD.distance(corner, plane)) for corner in box.values()}
    assert heights == {0.5, 1.5}
    ends = features(dmoc.spatial.Capsule(0.1, 1.0))
    assert [(k, float(WORLD.distance(e, plane))) for k, e in ends.items()] == [
        ("_a", pytest.approx(1.4)), ("_b", pytest.approx(0.4)),
    ]  # fmt: skip
    assert len(features(dmoc.spatial.Hull(WEDGE.tolist()))) == 4
    assert [*features((0, 0, 1))] == [""]


def test_a_ball_bounces_off_an_edge_of_a_box() -> None:
    """Slopes of the distance: the normal goes from the edge to the middle of the ball."""
    (y, z), world = dynamicsymbols("y z"), dmoc.spatial.World()
    ball = world.slide(y, "y").slide(z, "z", mass=2, inertia=(0, 0, 0))
    round_one, box = ball.carried(dmoc.spatial.Sphere(0.5)), dmoc.spatial.Box((4, 2, 2))
    system = world.system("ball", surfaces={"edge": world.distance(round_one, box) >= 0}, cost=1)
    start = {"y": 1.3, "z": 2.0}
    run = dmoc.simulate(system, start, {"z_dot": -1}, step_size=0.1, steps=7, restitution=1.0)
    (hit,) = run.collisions
    assert hit.time == pytest.approx(0.6, abs=1e-9)  # 0.3 beside the edge, 0.4 above it
    assert hit.impulse == pytest.approx(2 * 2 * 0.8, rel=1e-9)
    assert run.trajectory.phases[-1].v[-1] == pytest.approx(
        [2 * 0.8 * 0.6, 2 * 0.8 * 0.8 - 1], abs=1e-9
    )


def test_distances_stand_in_surfaces_and_path_constraints_alone() -> None:
    (x, u), world = dynamicsymbols("x u"), dmoc.spatial.World()
    body = world.slide(x, "x", mass=1, force=u, inertia=(0, 0, 0))
    gap = world.distance(body.carried(dmoc.spatial.Capsule(0.1, 1.0)), (1, 0, 0.8))
    system = world.system("rod", inputs=[u], path_constraints={"clear": gap >= 0}, cost=u**2)
    assert "clear" in system.path_constraints
    with pytest.raises(ModelError, match="a definition with a kink, which may stand in surfaces"):
        world.system("rod", inputs=[u], quantities={"gap": gap}, cost=u**2)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: WORLD.distance(dmoc.spatial.Plane(), dmoc.spatial.Plane()), "both shapes"),
        (lambda: WORLD.distance(3, (0, 0, 0)), "3 has no distance: expected a shape in space"),
        (lambda: WORLD.distance((0, 0), dmoc.spatial.Plane()), "the place of a point"),
        (lambda: WORLD.carried(4), "body world carries 4: expected a shape in space"),
        (lambda: dmoc.spatial.features(dmoc.spatial.Plane()), "has no corners or ends"),
        (lambda: dmoc.spatial.Hull([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)]), "in a plane"),
        (lambda: dmoc.spatial.Hull([(0, 0, 0), (1, 0, 0), (0, 1, 0)]), "four or more"),
        (lambda: dmoc.spatial.Hull("abc"), "expected triples of numbers"),
        (lambda: dmoc.spatial.Hull([(0, 0, float("nan"))] * 5), "expected finite numbers"),
        (lambda: dmoc.spatial.Hull(np.random.default_rng(0).normal(size=(200, 3))),
         "corners: expected at most 24"),
    ],
)  # fmt: skip
def test_what_has_no_distance_is_refused(call: Any, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        call()
