"""Distances of named features, edges and faces, beside closed forms and those of whole shapes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import ModelError

WORLD = dmoc.spatial.World()
WEDGE = [(-1, -1, 0), (-1, 1, 0), (-1, 0, 1), (1, -1, 0), (1, 1, 0), (1, 0, 1)]
UPRIGHT = [dmoc.attitude(axis=axis, angle=np.pi / 4) for axis in ((1, 0, 0), (0, 1, 0))]


def beam(axis: int, height: float, length: float = 4.0) -> dmoc.spatial.Box:
    """A beam of sides 1 along x or y, that stands on an edge."""
    size = (length, 1, 1) if axis == 0 else (1, length, 1)
    return dmoc.spatial.Box(size, at=(0, 0, height), attitude=UPRIGHT[axis])


def looking(shape: dmoc.spatial.Box, way: float) -> dmoc.spatial.Box:
    """The edge that looks up or down."""
    return max(dmoc.spatial.edges(shape).values(), key=lambda e: way * float(e.out[2]))


@pytest.mark.parametrize("height", [3.0, 1.5, 1.3])
def test_edges_that_cross_are_apart_as_their_boxes_are(height: float) -> None:
    """By the least distance of the boxes while these are apart, and by its depth below."""
    lower, upper = beam(0, 0.0), beam(1, height)
    gap = float(WORLD.distance(looking(lower, 1), looking(upper, -1)))
    assert gap == pytest.approx(height - np.sqrt(2), abs=1e-12)
    assert gap == pytest.approx(float(WORLD.distance(lower, upper)), abs=1e-11)
    back = float(WORLD.distance(looking(upper, -1), looking(lower, 1)))
    assert back == pytest.approx(gap, abs=1e-14)


@pytest.mark.parametrize("solid", [dmoc.spatial.Box((1, 2, 3)), dmoc.spatial.Hull(WEDGE)])
def test_edges_look_away_from_what_they_bound(solid: object) -> None:
    """Two faces meet in each, and its own distance from a point on the way out is the way."""
    middle = np.array([0, 0, 0.0 if isinstance(solid, dmoc.spatial.Box) else 0.3])
    edges = dmoc.spatial.edges(solid)
    assert len(edges) == (12 if isinstance(solid, dmoc.spatial.Box) else 9)
    for edge in edges.values():
        out, at = np.array(edge.out, dtype=float), np.array(edge.at, dtype=float)
        assert out @ (at - middle) > 0 and abs(out @ np.array(edge.along, dtype=float)) < 1e-12
        place = at + 0.3 * out / np.linalg.norm(out)
        assert float(WORLD.distance(tuple(place), edge)) == pytest.approx(0.3, abs=1e-11)
        assert float(WORLD.distance(tuple(place), solid)) == pytest.approx(0.3, abs=1e-9)


@pytest.mark.parametrize(
    "solid", [dmoc.spatial.Box((1, 2, 3)), dmoc.spatial.Hull(WEDGE), dmoc.spatial.Cylinder(0.5, 2)]
)
def test_faces_hold_their_shape(solid: object) -> None:
    """Behind each of them the shape is, and touches it."""
    faces = dmoc.spatial.faces(solid)
    assert len(faces) == {"Box": 6, "Hull": 5, "Cylinder": 2}[type(solid).__name__]
    for face in faces.values():
        behind = dmoc.spatial.Plane(face.at, tuple(-e for e in face.normal))
        assert float(WORLD.distance(solid, behind)) == pytest.approx(0, abs=1e-11)
        at, n = (np.array(v, dtype=float) for v in (face.at, face.normal))
        assert float(WORLD.distance(solid, dmoc.spatial.Plane(face.at, face.normal))) < -0.9
        assert float(WORLD.distance(tuple(at + 0.2 * n), face)) == pytest.approx(0.2)


def test_features_of_a_box_have_an_order() -> None:
    box = dmoc.spatial.Box((2, 4, 6))
    looks = [tuple(map(int, edge.out)) for edge in dmoc.spatial.edges(box).values()]
    assert looks[:4] == [(0, 1, 1), (0, 1, -1), (0, -1, 1), (0, -1, -1)]
    assert looks[6] == (-1, 0, 1) and looks[11] == (-1, -1, 0)
    normals = [tuple(map(int, face.normal)) for face in dmoc.spatial.faces(box).values()]
    assert normals[:3] == [(1, 0, 0), (-1, 0, 0), (0, 1, 0)] and normals[5] == (0, 0, -1)


def test_a_beam_falls_onto_another_one_and_bounces() -> None:
    z, world = dynamicsymbols("z"), dmoc.spatial.World(gravity=10)
    falling = world.slide(z, "z", mass=2, inertia=(0, 0, 0))
    edge = looking(falling.carried(beam(1, 0.0)), -1)
    gap = world.distance(looking(beam(0, 0.0), 1), edge)
    system = world.system("beams", surfaces={"edge": gap >= 0}, cost=1)
    (hit, *_) = dmoc.simulate(
        dmoc.build(system, backend="numpy"), {"z": 2.0}, step_size=0.1, steps=4, restitution=0.5
    ).collisions
    time = np.sqrt(2 * (2 - np.sqrt(2)) / 10)
    assert hit.time == pytest.approx(time, rel=1e-9)
    assert hit.impulse == pytest.approx(1.5 * 2 * 10 * time, rel=1e-3)  # of steps of order 2


def test_a_rim_meets_a_face_that_turns() -> None:
    """The lowest point of a cylinder above a plate that is tilted by a: its axis is upright."""
    a, world = dynamicsymbols("a"), dmoc.spatial.World()
    plate = world.hinge(a, "y", mass=1, inertia=(1, 1, 1), centre=(0, 0, 0))
    lid = dmoc.spatial.faces(plate.carried(dmoc.spatial.Box((4, 4, 0.2))))["_5"]
    can = dmoc.spatial.Cylinder(0.3, 1.0, at=(0, 0, 0.7))
    system = world.system("plate", surfaces={"can": world.distance(can, lid) >= 0}, cost=1)
    hit = dmoc.simulate(
        dmoc.build(system, backend="numpy"), {"a": 0.0}, {"a_dot": 0.5}, step_size=0.1, steps=15,
        restitution=1.0,
    ).collisions[0]  # fmt: skip
    # 0.2 cos a - 0.3 sin a = 0.1
    phase = np.arccos(0.1 / np.hypot(0.2, 0.3)) - np.arctan2(0.3, 0.2)
    assert hit.time == pytest.approx(phase / 0.5, rel=1e-8)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: dmoc.spatial.edges(dmoc.spatial.Cylinder(1, 1)), "the side of a cylinder is that"),
        (lambda: dmoc.spatial.edges(dmoc.spatial.Plane()), "has no straight edges"),
        (lambda: dmoc.spatial.faces(dmoc.spatial.Sphere(1)), "has no flat faces: expected a box"),
    ],
)
def test_what_has_none_is_refused(call: Callable[[], object], message: str) -> None:
    with pytest.raises(ModelError, match=message):
        call()
