"""Shapes of scenes as they are drawn, and scenes made from coordinates alone."""

from __future__ import annotations

from dataclasses import replace
from math import cos, pi, sin

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.motion.scene import COLUMNS, Scene, Shape, wrong_scene
from dmoc.motion.trajectory import Trajectory
from dmoc.report.default_drawing import _straight, scene_for
from dmoc.report.places import extent_of, room_of
from dmoc.report.shapes import look_of, painter
from dmoc.report.snapshots import height_of, layout_of, window_of
from dmoc.report.style import LIGHT


def axes_with(kind: str, *values: float) -> Axes:
    axes = Figure().add_subplot(xlim=(0.0, 1.0), ylim=(0.0, 1.0))
    scene = still(kind, *values)
    painter(axes, scene, scene.shapes[0], look_of(LIGHT, 1.0))(np.array(values))
    return axes


def still(kind: str, *values: float) -> Scene:
    """A scene of one shape that does not move."""
    rows = np.array([values, values])
    return Scene((Shape(kind, "", 0, len(values)),), (np.array([0.0, 1.0]),), (rows,))


def test_a_box_turns_counterclockwise_about_its_centre() -> None:
    (patch,) = axes_with("box", 1.0, 2.0, 2.0, 1.0, pi / 2).patches
    wanted = {(1.5, 1.0), (1.5, 3.0), (0.5, 3.0), (0.5, 1.0)}
    assert {tuple(np.round(corner, 12)) for corner in patch.get_xy()} == wanted


def test_a_disc_is_round_and_shows_its_angle() -> None:
    axes = axes_with("disc", 1.0, 2.0, 0.5, 0.3)
    (disc,) = axes.patches
    assert (disc.center, disc.radius) == ((1.0, 2.0), 0.5)  # type: ignore[attr-defined]
    (spoke,) = axes.lines
    np.testing.assert_allclose(
        spoke.get_xydata(), [(1.0, 2.0), (1 + 0.5 * cos(0.3), 2 + 0.5 * sin(0.3))]
    )
    assert not axes_with("disc", 1.0, 2.0, 0.5, 0.0).lines  # what never turns has no radius


@pytest.mark.parametrize(
    ("ends", "solid"), [((0, 0, 1, 0), (0, -1)), ((0, 0, 0, 1), (1, 0)), ((1, 0, 0, 0), (0, 1))]
)
def test_a_wall_is_hatched_on_the_right_of_its_way(
    ends: tuple[float, ...], solid: tuple[float, float]
) -> None:
    axes = axes_with("wall", *map(float, ends))
    (strokes,) = axes.collections
    for stroke in strokes.get_segments():
        assert np.dot(stroke[1] - stroke[0], solid) > 0
    assert len(strokes.get_segments()) > 20


def test_a_wall_without_end_has_strokes_where_it_is_seen() -> None:
    (strokes,) = axes_with("wall", -1e9, 0.5, 1e9, 0.5).collections
    feet = np.array([stroke[0] for stroke in strokes.get_segments()])
    assert 20 < len(feet) < 60 and feet[:, 0].min() < 0.1 and feet[:, 0].max() > 0.9


def test_a_spring_goes_from_one_end_to_the_other() -> None:
    (line,) = axes_with("spring", 0.0, 1.0, 3.0, 5.0).lines
    way = np.asarray(line.get_xydata())
    np.testing.assert_allclose(way[[0, -1]], [(0.0, 1.0), (3.0, 5.0)])
    off = (way - (0.0, 1.0)) @ (-0.8, 0.6)  # beside the straight way
    assert off.max() == pytest.approx(0.02) and off.min() == pytest.approx(-0.02)


@pytest.mark.parametrize(
    ("kind", "values", "low", "high"),
    [
        ("link", (0, 1, 2, 3, -1, 5), (-1, 1), (2, 5)),
        ("point", (1, 2), (1, 2), (1, 2)),
        ("disc", (1, 2, 0.5, 0), (0.5, 1.5), (1.5, 2.5)),
        ("box", (0, 0, 2, 1, pi / 2), (-0.5, -1), (0.5, 1)),
        ("wall", (0, 0, 4, 0), (0, 0), (4, 0)),
    ],
)
def test_the_extent_holds_the_whole_shape(
    kind: str, values: tuple[float, ...], low: tuple[float, float], high: tuple[float, float]
) -> None:
    extent = extent_of(still(kind, *values))
    np.testing.assert_allclose(extent, (low, high), atol=1e-12)


def test_wide_scenes_stand_below_each_other_and_tall_ones_beside() -> None:
    for values, expected in (((0, 0, 8, 1), (3, 1)), ((0, 0, 1, 8), (1, 3))):
        scene = still("link", *values)
        layout = layout_of(replace(scene, times=scene.times * 3, values=scene.values * 3))
        assert (layout.rows, layout.columns) == expected
        assert layout.height < 6


def test_a_window_on_a_straight_motion_is_not_flat() -> None:
    left, right, low, high = window_of([still("link", 0, 0, 1, 0)])[:4]
    assert left < 0 and right > 1 and low < 0 < high
    assert height_of([still("link", 0, 0, 1, 0)], 3.0) >= 0.6


def test_very_many_phases_are_shown_together() -> None:
    kernels = dmoc.load("bouncing_pendulum")
    run = dmoc.simulate(kernels, {"theta": 1.0}, step_size=0.01, steps=3200)
    assert len(run.collisions) == 30
    figure = run.plot()
    (snapshots,) = (axes for axes in figure.axes if axes.get_title())
    assert snapshots.get_title() == "0 to 32 s, 30 events"
    masses = [line.get_xydata()[0] for line in snapshots.lines if line.get_marker() == "o"]
    np.testing.assert_allclose(np.hypot(*np.transpose(masses)), 1.0, atol=1e-9)
    assert not any(axes.texts for axes in figure.axes)


# Models without a drawing -------------------------------------------------------------------------


def test_a_scene_of_a_model_is_not_replaced(solution: dmoc.Solution) -> None:
    assert scene_for(solution.trajectory) is solution.trajectory.scene


def test_lengths_are_sliders_and_angles_hands(solution: dmoc.Solution) -> None:
    motion = replace(solution.trajectory, scene=None)
    scene = scene_for(motion)
    assert wrong_scene(scene) is None and len(scene.times) == 2
    kinds = " ".join(f"{s.kind}:{s.name}" for s in scene.shapes)
    assert kinds == "disc:alpha link: link:x box: contact:lower"
    _, hand, rail, slider, contact = scene.shapes
    q = np.vstack([phase.q for phase in motion.phases])
    for i, phase in enumerate(motion.phases):
        way = scene.of(hand, i)
        angle = np.arctan2(way[:, 3] - way[:, 1], way[:, 2] - way[:, 0])
        np.testing.assert_allclose(angle, phase.q[:, 0], atol=1e-9)
        share = (phase.q[:, 1] - q[:, 1].min()) / np.ptp(q[:, 1])
        left, _, right, _ = scene.of(rail, i)[0]
        width = scene.of(slider, i)[0, 2]  # the rail goes on beyond the slider
        wanted = left + width + share * (right - left - 2 * width)
        np.testing.assert_allclose(scene.of(slider, i)[:, 0], wanted)
        np.testing.assert_allclose(scene.of(contact, i)[:, :2], way[:, 2:])
    # The limiter turns the hand counterclockwise.
    nx, ny = scene.of(contact, 0)[-1, 2:]
    np.testing.assert_allclose((nx, ny), (-sin(q[100, 0]), cos(q[100, 0])), atol=1e-9)


def test_x_and_y_are_a_point_that_is_pushed_as_its_momentum_jumps(puck: Kernels) -> None:
    problem = dmoc.Problem(
        puck, start={"x": -2.0, "y": 0.5}, goal={"x": -2.0, "y": -0.5}, sequence=["post"], steps=12,
        final_time=2.0,
    )  # fmt: skip
    motion = dmoc.solve(problem, "ipm", verify=False, starts=1).trajectory
    assert motion.scene is None
    scene = scene_for(motion)
    point, contact = scene.shapes
    assert (point.kind, contact.kind, contact.name) == ("point", "contact", "post")
    for i, phase in enumerate(motion.phases):
        np.testing.assert_allclose(scene.of(point, i)[:: 60 // 12], phase.q, atol=1e-12)
    x, y = motion.collisions[0].position
    normal = np.array([x - 1.0, y]) / np.hypot(x - 1.0, y)  # away from the post
    np.testing.assert_allclose(scene.of(contact, 0)[-1], (x, y, *normal), atol=1e-6)


def test_places_of_several_points_are_in_one_plane(solution: dmoc.Solution) -> None:
    two = [0, 1, 1, 0, 0]
    phases = tuple(replace(p, q=p.q[:, two], v=p.v[:, two], p=p.p[:, two]) for p in solution.phases)
    (hit,) = solution.collisions
    event = replace(
        hit, momentum_before=hit.momentum_before[two], momentum_after=hit.momentum_after[two]
    )
    motion = replace(
        solution.trajectory, scene=None, units=dict.fromkeys(("x1", "y1", "x2", "y2"), "m"),
        coordinates=("x1", "y1", "x2", "y2", "s"), phases=phases, collisions=(event,),
    )  # fmt: skip
    scene = scene_for(motion)
    assert [s.kind for s in scene.shapes] == ["point", "point", "link", "box", "contact"]
    for shape, columns in zip(scene.shapes, ([0, 1], [1, 0]), strict=False):
        np.testing.assert_allclose(scene.of(shape, 1), solution.phases[1].q[:, columns])
    (left, _, _, _), lowest = scene.of(scene.shapes[2], 0)[0], scene.of(scene.shapes[0], 0)
    assert scene.of(scene.shapes[2], 0)[0, 1] < lowest[:, 1].min() and np.isfinite(left)


def test_sliders_of_one_unit_have_one_scale(solution: dmoc.Solution) -> None:
    motion = replace(solution.trajectory, scene=None, units={"alpha": "m", "x": "m"})
    scene = scene_for(motion)
    q = np.vstack([phase.q for phase in motion.phases])
    boxes = [s for s in scene.shapes if s.kind == "box"]
    spans = [np.ptp(np.vstack([scene.of(b, i) for i in (0, 1)])[:, 0]) for b in boxes]
    assert spans[0] / spans[1] == pytest.approx(np.ptp(q[:, 0]) / np.ptp(q[:, 1]), rel=1e-3)


def test_a_coordinate_that_stands_still_is_drawn_in_the_middle(solution: dmoc.Solution) -> None:
    phases = tuple(replace(p, q=0 * p.q + 3.0, v=0 * p.v) for p in solution.phases)
    motion = replace(solution.trajectory, scene=None, phases=phases, units={})
    scene = scene_for(motion)
    assert wrong_scene(scene) is None
    assert all(np.isfinite(values).all() for values in scene.values)
    rail, box = scene.shapes[:2]
    left, _, right, _ = scene.of(rail, 0)[0]
    assert scene.of(box, 0)[0, 0] == pytest.approx((left + right) / 2)


def in_unit(motion: Trajectory, unit: float) -> Trajectory:
    """A motion of which the coordinates, and the lengths of its scene, are told in a unit so many
    times larger; the bounds of its inputs are far."""
    assert motion.scene is not None
    names = [c for s in motion.scene.shapes for c in (COLUMNS[s.kind] * s.size)[: s.size]]
    lengths = np.where(np.isin(names, ["angle", "nx", "ny"]), 1.0, 1 / unit)
    scene = replace(motion.scene, values=tuple(lengths * v for v in motion.scene.values))
    phases = tuple(
        replace(p, q=p.q / unit, v=p.v / unit, p=p.p / unit, u=p.u / unit) for p in motion.phases
    )
    far = 8 * max(float(np.abs(p.u).max()) for p in motion.phases)
    bounds = np.tile([-far / unit, far / unit], (len(motion.inputs), 1))
    return replace(motion, phases=phases, scene=scene, input_bounds=bounds)


def test_a_motion_of_tiny_numbers_is_drawn_as_one_of_large_ones(solution: dmoc.Solution) -> None:
    drawn = []
    for unit in (1.0, 1e13):
        figure = replace(solution, trajectory=in_unit(solution.trajectory, unit)).plot()
        drawn.append([(len(a.lines), len(a.patches), len(a.collections)) for a in figure.axes])
    assert drawn[0] == drawn[1]


def test_the_room_of_what_stands_still_at_one_place_is_a_room() -> None:
    for place in (0.0, 1e-20, 1e20):
        room = room_of([still("point", place, place)], 0.1, 0.1)
        assert room.left < place < room.right and room.bottom < place < room.top


@pytest.mark.parametrize(
    ("jump", "normal"),
    [([3.0, 4.0], [0.6, 0.8]), ([-2.0], [-1, 0]), ([0.0, 0.0], [0, 1]), ([0.0], [0, 1])],
)
def test_a_contact_pushes_as_the_momentum_jumps(jump: list[float], normal: list[float]) -> None:
    """Upwards where it does not."""
    rows = np.array([[0.5, 2.0], [1.5, 3.0]])
    made = _straight(lambda q: q, np.array(jump))(rows)
    np.testing.assert_allclose(made, np.hstack([rows, [normal, normal]]))
