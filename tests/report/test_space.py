"""Scenes in space: what a camera sees of them, their faces, and the order in which these are
painted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from films import AXES, TURN, flight, motion
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.motion.scene import Scene, Shape
from dmoc.report import camera as cameras
from dmoc.report.animation.page import film_room, page_of
from dmoc.report.animation.stage import stage_of
from dmoc.report.camera import Camera, camera_of, reach_of
from dmoc.report.curves import panels_of
from dmoc.report.faces import (
    BODY,
    EDGE,
    MASS,
    OTHER,
    block,
    faces_of,
    frame_of,
    helix,
    upright,
)
from dmoc.report.figure import plot
from dmoc.report.film import Film, Take
from dmoc.report.places import flat_marks, room_of
from dmoc.report.poses import poses_of
from dmoc.report.solid_painter import normals_of, painters_order, shadows_of, wall_of
from dmoc.report.style import LIGHT

LOW, HIGH = np.array([-1.0, -2.0, 0.0]), np.array([1.0, 2.0, 1.0])
# It looks along y from (0, -10, 0.5), z upwards.
AHEAD = Camera(np.array([0.0, 0.0, 0.5]), 10.0, 0.0, LOW, HIGH, yaw=0.0, pitch=0.0)
BACK = np.array([0.0, 1.0, 0.0])


def test_a_camera_that_looks_along_y_sees_x_and_z() -> None:
    """What is half as far is twice as large."""
    points = np.array([[0, 0, 0.5], [1, 0, 1.5], [1, -5, 1.5], [1, 10, 1.5]])
    expected = [[0, 0, 10], [1, 1, 10], [2, 2, 5], [0.5, 0.5, 20]]
    np.testing.assert_allclose(AHEAD.seen(points), expected, atol=1e-14)


def test_a_camera_that_is_turned_and_lifted_has_its_axes() -> None:
    """From +x it sees y to the right; from above, north upwards."""
    side, above = replace(AHEAD, yaw=np.pi / 2), replace(AHEAD, pitch=np.pi / 2)
    np.testing.assert_allclose(side.axes, [[0, 1, 0], [0, 0, 1], [1, 0, 0]], atol=1e-15)
    np.testing.assert_allclose(above.axes, [[1, 0, 0], [0, 1, 0], [0, 0, 1]], atol=1e-15)
    np.testing.assert_allclose(above.eye, [0, 0, 10.5], atol=1e-14)


def test_directions_are_as_long_as_they_are_seen() -> None:
    x, z, *ways = AHEAD.flat(np.array([1.0, -5, 1.5, 1, 0, 0, 0, 0, 1, 0, 1, 0]))
    assert (x, z) == pytest.approx((2, 2))
    # Along y a point goes by 2 / 5 of itself towards the middle.
    np.testing.assert_allclose(ways, [2, 0, 0, 2, -0.4, -0.4], rtol=1e-3, atol=1e-12)
    at, push = np.array([0, 0, 0.5, 0, 0, 0.5]), np.array([0.0, 0.0, 3.0])
    (mark,) = flat_marks([{"at": at, "impulse": push}], AHEAD)
    np.testing.assert_allclose([*mark["at"], *mark["impulse"]], [0, 0, 0, 1, 0, 3], atol=1e-6)


def test_faces_of_a_box_look_outwards() -> None:
    faces = block(np.array([2.0, 4.0, 6.0]))
    normals = normals_of(faces)
    areas = (
        np.linalg.norm(np.cross(faces[:, 2] - faces[:, 0], faces[:, 3] - faces[:, 1]), axis=1) / 2
    )
    np.testing.assert_allclose(areas @ np.abs(normals), [48, 24, 16])
    np.testing.assert_allclose(
        (faces.mean(axis=1) * normals).sum(axis=1), np.abs(normals) @ [1, 2, 3]
    )


def test_what_is_round_has_its_size_and_looks_outwards() -> None:
    bodies = ("sphere", [2.0], 2.0), ("capsule", [0.5, 3.0], 2.0), ("cylinder", [2.0, 1.0], 0.5)
    for kind, sizes, high in bodies:
        faces, parts = faces_of(kind, np.array([0, 0, 0, *AXES, *sizes]), 1.0)
        assert np.hypot(*faces[..., :2].T).max() == pytest.approx(sizes[0])
        assert (faces[..., 2].min(), faces[..., 2].max()) == pytest.approx((-high, high))
        assert ((faces.mean(axis=1) * normals_of(faces)).sum(axis=1) > 0).all()
        assert set(parts) == ({BODY} if kind == "capsule" else {BODY, OTHER})


def test_faces_go_with_the_frame_of_their_shape() -> None:
    values = np.array([1.0, 2.0, 3.0, 0, 1, 0, 0, 0, 1, 2, 4, 6])  # its x along y, y along z
    points = faces_of("block", values, 1.0)[0].reshape(-1, 3)
    np.testing.assert_allclose([points.min(axis=0), points.max(axis=0)], [[-2, 1, 1], [4, 3, 5]])


def test_a_frame_is_straight_again_after_interpolation() -> None:
    frame = frame_of(np.array([0.9, 0.1, 0.0]), np.array([0.0, 0.8, 0.1]))
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(frame) == pytest.approx(1)
    assert np.linalg.det(upright(np.array([0.0, 0.0, -2.0]))) == pytest.approx(1)


def test_rods_springs_and_masses_are_thin() -> None:
    rod, parts = faces_of("rod", np.array([0.0, 0, 0, 0, 0, 2, 1, 0, 2]), 1.0)
    assert set(parts) == {EDGE} and np.abs(rod[..., 1]).max() == pytest.approx(0.012)
    bob, parts = faces_of("bob", np.array([1.0, 2.0, 3.0]), 2.0)
    assert set(parts) == {MASS} and bob[..., 0].max() == pytest.approx(1.06)
    coil = helix(np.zeros(3), np.array([0.0, 0.0, 1.0]), 0.1)
    np.testing.assert_allclose(coil[[0, -1]], [[0, 0, 0], [0, 0, 1]], atol=1e-15)
    assert np.hypot(*coil[:, :2].T).max() == pytest.approx(0.1)


def test_the_farthest_face_is_painted_first_and_none_from_behind() -> None:
    square = np.array([[-1.0, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]])  # it looks at the eye
    faces = np.array([square + BACK / 2, square[::-1], square + 2 * BACK, square - 3 * BACK])
    assert painters_order(faces, normals_of(faces), AHEAD).tolist() == [2, 0, 3]


def test_shadows_fall_along_the_light() -> None:
    point = np.array([[[1.0, 2.0, 3.0]]])
    shadow = shadows_of(point, 1.0)[0, 0]
    assert shadow[2] == pytest.approx(1)
    np.testing.assert_allclose((point[0, 0] - shadow) / cameras.LIGHT, [2 / cameras.LIGHT[2]] * 3)


def test_a_wall_is_as_large_as_the_room_and_the_ground_is_none() -> None:
    wall = wall_of(np.array([1.5, 0.0, 0.0, -1.0, 0.0, 0.0]), AHEAD)
    assert wall is not None
    np.testing.assert_allclose([wall.min(axis=0), wall.max(axis=0)], [[1.5, -2, 0], [1.5, 2, 1]])
    assert wall_of(np.array([5.0, 0, 0, 0, 0, 1]), AHEAD) is None
    assert wall_of(np.array([0.0, 0, 0.5, 0, 0, 1]), AHEAD) is not None


def scene() -> Scene:
    """A ball of radius 0.5 that goes from (0, 0, 1) to (4, 0, 1) over a floor at 0, before a wall
    that is far."""
    shapes = (Shape("sphere", "", 0, 10), Shape("plane", "", 10, 6), Shape("plane", "", 16, 6))
    still = [*AXES, 0.5, 0, 0, 0, 0, 0, 1, 0, 90, 0, 0, -1, 0]
    values = np.array([[x, 0, 1, *still] for x in (0.0, 4.0)])
    return Scene(shapes, (np.array([0.0, 1.0]),), (values,))


def test_the_room_reaches_around_what_moves_and_to_the_planes_beside_it() -> None:
    low, high = reach_of(scene())
    np.testing.assert_allclose([low, high], [[-0.5, -0.5, 0], [4.5, 0.5, 1.5]])
    camera = camera_of([scene()])
    assert camera.floor == 0
    room = room_of([scene()], 0.0, 0.0)
    seen = camera.seen(camera.corners)
    assert (room.left, room.top) == pytest.approx((seen[:, 0].min(), seen[:, 1].max()))


@pytest.mark.parametrize(
    ("kind", "sizes", "half"),
    [
        # Along (0, 0.6, 0.8) in the world.
        ("cylinder", [1.0, 10.0], [1.0, 3.8, 4.6]), ("capsule", [1.0, 10.0], [1.0, 4.0, 5.0]),
        ("block", [2.0, 4.0, 10.0], [1.0, 4.6, 5.2]), ("sphere", [2.0], [2.0, 2.0, 2.0]),
    ],
)  # fmt: skip
def test_bodies_reach_as_far_as_they_are_turned(
    kind: str, sizes: list[float], half: list[float]
) -> None:
    frame = [1.0, 0, 0, 0, 0.8, -0.6]
    values = np.array([[0.0, 0, 0, *frame, *sizes]] * 2)
    shapes = (Shape(kind, "", 0, values.shape[1]),)
    low, high = reach_of(Scene(shapes, (np.array([0.0, 1.0]),), (values,)))
    np.testing.assert_allclose([low, high], [np.negative(half), half])


def turning(far: float) -> Scene:
    """A box of the sides 1, 1, 4 that goes by so much while it turns about y by 90 degrees."""
    s = np.linspace(0.0, 1.0, 21)
    c, n, zero, one = np.cos(np.pi / 2 * s), np.sin(np.pi / 2 * s), 0 * s, 1 + 0 * s
    values = np.stack(
        [far * s, zero, zero, c, zero, -n, zero, one, zero, one, one, 4 * one], axis=1
    )
    return Scene((Shape("block", "", 0, 12),), (3 * s,), (values,))


def test_a_motion_that_stays_is_shown_in_poses_beside_each_other() -> None:
    poses = poses_of(turning(0.5))
    assert [pose.time for pose in poses] == pytest.approx([0, 0.6, 1.2, 1.8, 2.4, 3.0])
    assert [pose.last for pose in poses] == [False] * 5 + [True]
    assert poses_of(turning(5.0)) == []
    assert poses_of(motion().scene) == []


def test_a_pose_at_an_event_takes_the_place_of_those_near_it() -> None:
    whole = turning(0.0)
    (t,), (values,) = whole.times, whole.values
    two = Scene(whole.shapes, (t[:10], t[9:]), (values[:10], values[9:]))  # an event at 1.35 s
    poses = poses_of(two)
    assert [pose.time for pose in poses] == pytest.approx([0, 0.6, 1.35, 1.8, 2.4, 3.0])
    assert [pose.phase for pose in poses] == [0, 0, 0, 1, 1, 1]
    assert [pose.last for pose in poses] == [False, False, True, False, False, True]


def test_figures_and_films_show_bodies_in_space_where_they_are() -> None:
    """The orange ball is drawn around its place, before the wall with an arrow of the impulse."""
    take = Take("", flight())
    room = film_room([take.scene])
    assert room.camera is not None
    figure = Figure((6.0, 4.0))
    axes = figure.add_axes((0, 0, 1, 1))
    draw = stage_of(axes, take, room, LIGHT)
    draw(TURN + 0.01)
    bodies = max(
        (c for c in axes.collections if isinstance(c, PolyCollection)), key=lambda c: c.zorder
    )
    colours = bodies.get_facecolor()
    mass = colours[:, 0] > 2 * colours[:, 2]
    corners = np.concatenate([p.vertices[:-1] for p in np.array(bodies.get_paths())[mass]])
    place = room.camera.seen(np.array([0.99, 0.0, 0.7]))[:2]
    np.testing.assert_allclose((corners.min(axis=0) + corners.max(axis=0)) / 2, place, atol=0.01)
    assert any("1 wall impulse 9" in text.get_text() for text in axes.texts)
    shown = plot(take.trajectory)
    assert shown.axes[0].get_title() == "0 to 0.5 s,\nthen wall"
    assert any(text.get_text() == "grid 0.2 m" for text in shown.axes[0].texts)


def test_a_page_in_space_has_what_draws_it_and_one_in_the_plane_has_not() -> None:
    solid, flat = (page_of(Film("", (Take("", film),))) for film in (flight(), motion()))
    assert "makeSpace(motion, bounds, clock)" in solid and '"ground":0.0' in solid
    assert "glPainter" not in flat and ".space canvas" not in flat


def test_normal_forces_and_inputs_have_arrows_in_space_and_friction_has_none() -> None:
    solid = flight()
    assert solid.scene is not None
    first, size = len(solid.scene.shapes), solid.scene.values[0].shape[1]
    shapes = (*solid.scene.shapes, Shape("force", "u", size, 6))
    values = tuple(
        np.hstack([v, np.tile([0.0, 0, 0, 0, 0, 1], (len(v), 1))]) for v in solid.scene.values
    )
    take = Take("", replace(solid, scene=replace(solid.scene, shapes=shapes, values=values)))
    arrows = {(arrow["kind"], arrow["shape"]): arrow["largest"] for arrow in take.arrows}
    assert arrows == {("u", first): 5.0, ("N", first - 1): 20.0}


def test_a_body_that_turns_has_its_angular_velocity_in_the_place_of_rates() -> None:
    """Of the four numbers of its attitude; other coordinates keep theirs."""
    x, world = dynamicsymbols("x"), dmoc.spatial.World()
    world.ball("q", inertia=(1, 1, 2))
    world.slide(x, "x", mass=1, inertia=(0, 0, 0))
    top = dmoc.build(world.system("top", cost=1), backend="numpy")
    run = dmoc.simulate(top, {}, {"q_omega_z": 2.0, "x_dot": 1.0}, step_size=0.1, steps=3)
    shown = {
        kind: [c.name for p in panels_of(run.trajectory) if p.quantity == kind for c in p.curves]
        for kind in ("q", "v", "p", "quantities")
    }
    assert shown["q"] == ["q0", "q1", "q2", "q3", "x"]
    assert (shown["v"], shown["p"]) == (["x_dot"], ["p_x"])
    assert shown["quantities"] == ["q_omega_x", "q_omega_y", "q_omega_z"]
