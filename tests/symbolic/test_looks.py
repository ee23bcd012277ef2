"""Drawings in space: shapes that bodies take along, and what is seen of a linkage that is not
drawn."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import ModelError
from dmoc.motion.attitude import rotation
from dmoc.symbolic.drawing import table_of_drawing, values_of
from dmoc.symbolic.joints import ORIGIN, Load
from dmoc.symbolic.looks import box_of
from dmoc.symbolic.system import MechanicalSystem

S = dmoc.spatial
a, b, u, v, w, x, y, z = dynamicsymbols("a b u v w x y z")
P = np.array([0.5, 0.1, -0.7, 0.5]) / np.linalg.norm([0.5, 0.1, -0.7, 0.5])
POSE = dict(zip((x, y, z), (1.0, 2.0, 3.0), strict=True))
POSE |= dict(zip(dynamicsymbols("q0:4"), P.tolist(), strict=True))


def columns(system: MechanicalSystem, k: int, at: dict[Any, float]) -> np.ndarray:
    """The columns of a shape in a pose."""
    known = dict(at)
    for name, value in system.definitions.items():
        known[name] = value.xreplace(known)  # those of velocities stay expressions
    return np.array([float(sp.sympify(e).xreplace(known)) for e in values_of(system.shapes[k])])


def free(*shapes: Any, **fields: Any) -> MechanicalSystem:
    """A body that floats, drawn by some shapes."""
    world = S.World(gravity=9.81)
    world.free((x, y, z), mass=2, inertia=(0.3, 0.2, 0.1)).draw(*shapes)
    return world.system("body", cost=1, **fields)


def test_shapes_go_with_their_body() -> None:
    """By the rotation matrix of its quaternion, after their own turn about y by 90 degrees."""
    turn = dmoc.attitude(axis=(0, 1, 0), angle=np.pi / 2)
    local = (0.1, 0.2, 0.3)
    system = free(
        S.Box((0.4, 0.2, 0.1), local, turn), S.Sphere(0.05, local), S.Capsule(0.1, 0.3, local),
        S.Cylinder(0.2, 0.02, attitude=dynamicsymbols("q0:4")), S.Plane(local, (0, 3, 4)),
        dmoc.Link((0, 0, 0), local), dmoc.Point(local), dmoc.Spring(local, (0, 0, 1)),
    )  # fmt: skip
    R, place = np.array(rotation(P)), np.array([1.0, 2.0, 3.0])
    there = place + R @ local
    expected = [
        [*there, *(R @ [0, 0, -1]), *(R @ [0, 1, 0]), 0.4, 0.2, 0.1],
        [*there, *R[:, 0], *R[:, 1], 0.05],
        [*there, *R[:, 0], *R[:, 1], 0.1, 0.3],
        [*place, *(R @ R)[:, 0], *(R @ R)[:, 1], 0.2, 0.02],
        [*there, *(R @ [0, 0.6, 0.8])],
        [*place, *there], [*there], [*there, *(place + R[:, 2])],
    ]  # fmt: skip
    kinds = ["block", "sphere", "capsule", "cylinder", "plane", "rod", "bob", "coil"]
    assert [row[0] for row in table_of_drawing(system.drawing)] == kinds
    for k, values in enumerate(expected):
        np.testing.assert_allclose(columns(system, k, POSE), values, atol=1e-15)


def test_a_body_that_is_not_drawn_is_the_box_of_its_inertia() -> None:
    """A box with the sides a, b, c has the moments m (b^2 + c^2) / 12, ..."""
    world = S.World()
    world.free((x, y, z), mass=3, inertia=(3 * (4 + 9) / 12, 3 * (1 + 9) / 12, 3 * (1 + 4) / 12))
    (box,) = world.system("body", cost=1).drawing
    assert [float(side) for side in box.size] == pytest.approx([1, 2, 3])
    assert world.ball("p", inertia=(1, 1, 1)).draw() is not None  # and one without shapes is not


def test_the_box_of_an_inertia_has_its_principal_axes() -> None:
    turn = np.array(dmoc.attitude(euler=(0.3, -0.5, 0.9)).matrix)
    moments = turn @ np.diag([5, 10, 13]) @ turn.T / 12  # of sides 3, 2, 1 and the mass 1
    box = box_of(Load(ORIGIN, sp.Integer(1), ORIGIN, sp.Matrix((moments + moments.T) / 2)))
    axes, sides = np.array(box.attitude, dtype=float), [float(e) for e in box.size]
    assert np.linalg.det(axes) == pytest.approx(1)
    own = axes @ np.diag([(sum(np.square(sides)) - s**2) / 12 for s in sides]) @ axes.T
    np.testing.assert_allclose(own, moments, atol=1e-12)


def test_a_box_without_a_mass_has_the_diagonal_1_and_a_flat_one_some_height() -> None:
    size = box_of(Load(ORIGIN, sp.S.Zero, ORIGIN, sp.diag(1, 1, 2))).size
    assert [float(e) for e in size] == pytest.approx([0.5**0.5, 0.5**0.5, 1e-3 * 0.5**0.5])


def test_an_arm_is_rods_between_its_joints_with_arrows_of_its_torques() -> None:
    world = S.World(gravity=9.81)
    base = world.hinge(a, "z", mass=4, inertia=(0.1, 0.1, 0.12), torque=2 * u)
    arm = base.hinge(b, "y", at=(0, 0, 0.3), tip=(0.4, 0, 0), mass=2, torque=-v)
    slide = arm.slide(x, "x", mass=1, force=w)
    system = world.system("arm", inputs=[u, v, w], cost=1, surfaces={"table": arm.tip[2] >= 0.1})
    names = [row[:2] for row in table_of_drawing(system.drawing)]
    assert names == [
        ["rod", ""], ["block", ""], ["rod", ""], ["bob", ""], ["torque", "u"], ["torque", "v"],
        ["force", "w"], ["touch", "table"], ["plane", ""],
    ]  # fmt: skip
    at = {a: np.pi / 2, b: 0.0, x: 0.1}
    for k, values in (
        (2, [0, 0, 0.3, 0, 0.4, 0.3]), (3, [0, 0.5, 0.3]), (4, [0, 0, 0, 0, 0, 1]),
        (5, [0, 0, 0.3, 1, 0, 0]), (6, [0, 0.5, 0.3, 0, 1, 0]), (7, [0, 0.4, 0.3, 0, 0, 1]),
        (8, [0, 0, 0.1, 0, 0, 1]),
    ):  # fmt: skip
        np.testing.assert_allclose(columns(system, k, at), values, atol=1e-15)
    assert slide.name == "x"


def test_a_torque_in_axes_of_the_world_has_arrows_along_them() -> None:
    world = S.World()
    world.ball("q", inertia=(1, 1, 1), torque=(u, 0, v), axes="world")
    system = world.system("top", inputs=[u, v], cost=1)
    for k, axis in ((1, [1, 0, 0]), (2, [0, 0, 1])):
        np.testing.assert_allclose(columns(system, k, POSE)[3:], axis, atol=1e-15)


def test_what_touches_is_the_ball_around_a_point_and_its_plane_below_it() -> None:
    ramp = {"ramp": 3 * x + 4 * z >= 5, "limit": x * z <= 9}
    system = free(S.Sphere(0.1), surfaces=ramp)
    touch, plane = columns(system, 1, POSE), columns(system, 2, POSE)
    normal = np.array([0.6, 0, 0.8])
    np.testing.assert_allclose(touch, [*([1, 2, 3] - 0.1 * normal), *normal], atol=1e-15)
    np.testing.assert_allclose(plane, [*((1 - 0.1) * normal), *normal], atol=1e-15)
    assert len(system.drawing) == 3  # a surface that is no plane is not drawn


def test_contacts_and_planes_that_are_stated_are_the_only_ones() -> None:
    own = [dmoc.Contact("floor", (x, y, z), (0, 0, 1)), S.Plane((0, 0, -1))]
    system = free(S.Sphere(0.1), surfaces={"floor": z >= 0}, drawing=own)
    assert [row[0] for row in table_of_drawing(system.drawing)] == ["touch", "plane", "sphere"]


def test_a_contact_in_space_pushes_as_its_gap_grows() -> None:
    places = {"ball": x**2 + y**2 + z**2 >= 1}
    system = dmoc.MechanicalSystem(
        "mass", [x, y, z], sum(q.diff() ** 2 for q in (x, y, z)) / 2, cost=1, surfaces=places,
        drawing=[dmoc.Contact("ball", (x, y, z))],
    )  # fmt: skip
    at = {x: 0.0, y: 0.6, z: 0.8}
    np.testing.assert_allclose(columns(system, 0, at), [0, 0.6, 0.8, 0, 0.6, 0.8], atol=1e-15)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: S.Box((1, 2)), "the size of a Box .*: expected 3 expressions"),
        (lambda: S.Box((1, 0, 1)), "a side of a Box = 0: expected a positive length"),
        (lambda: S.Sphere(-1), "the radius of a Sphere = -1"),
        (lambda: S.Cylinder(1, 0), "the length of a Cylinder = 0"),
        (lambda: S.Capsule(1, 1, at=(0, 0)), "the place of a Capsule .*: expected 3 expressions"),
        (lambda: S.Sphere(1, attitude=(1, 0)), "the attitude of a Sphere .*: expected a dmoc.att"),
        (lambda: S.Plane(normal=(0, 0, 0)), "the normal of a Plane is zero"),
        (lambda: S.Arrow(3), "the input of an Arrow = 3: expected a dynamicsymbol"),
        (lambda: free(dmoc.Point((x, y))), "body q is drawn by Point.*: expected shapes in space"),
        (lambda: free(3), "body q is drawn by 3: expected shapes in space"),
        (lambda: free(S.Arrow(u)), "an Arrow of u.*: expected an input of the model"),
        (lambda: free(drawing=[dmoc.Point((x, y)), S.Sphere(1)]), "of the plane, .* of space"),
        (lambda: dmoc.Spring((0, 0), (0, 0, 1)), "an end of a Spring .* has 3 entries"),
        (
            lambda: dmoc.Contact("floor", (0, 0, 1), normal=(0, 1)),
            "the normal of a Contact .* has 2 entries: expected three, as in",
        ),
    ],
)  # fmt: skip
def test_what_is_no_shape_in_space_is_told(make: Any, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        make()
