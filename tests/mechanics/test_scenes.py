"""Scenes of motions: the drawing where the motion is, finely enough."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.mechanics.model_trajectory import scene_of
from dmoc.mechanics.phase_models import PhaseModels
from dmoc.motion.scene import FINE, FINEST, Scene, Shape, resampled, wrong_scene


def places(scene: Scene, kind: str, phase: int) -> np.ndarray:
    (shape,) = (s for s in scene.shapes if s.kind == kind)
    return scene.of(shape, phase)


def test_few_nodes_become_round_arcs_of_fourth_order() -> None:
    errors = []
    for steps in (6, 12):
        t = np.linspace(0.0, np.pi, steps + 1)
        q, v = np.stack([np.cos(t), np.sin(t)], 1), np.stack([-np.sin(t), np.cos(t)], 1)
        times, way = resampled(t, q, v)
        assert len(times) - 1 >= FINE and (np.diff(times) > 0).all()
        np.testing.assert_array_equal(way[:: (len(times) - 1) // steps], q)
        errors.append(np.abs(way - np.stack([np.cos(times), np.sin(times)], 1)).max())
    assert errors[0] < 2e-4 and 14 < errors[0] / errors[1] < 18


def test_cubics_are_exact_on_steps_of_any_sizes() -> None:
    t = np.array([0.0, 0.3, 1.0, 1.2])
    cubic = np.polynomial.Polynomial([1.0, -2.0, 0.5, 3.0])
    times, way = resampled(t, cubic(t)[:, None], cubic.deriv()(t)[:, None])
    np.testing.assert_allclose(way[:, 0], cubic(times), atol=1e-14)


def test_more_nodes_than_can_be_drawn_are_thinned() -> None:
    t = np.linspace(0.0, 1.0, 10 * FINEST + 1)
    times, way = resampled(t, t[:, None], np.ones((len(t), 1)))
    assert len(times) == FINEST + 1 and times[0] == 0.0 and times[-1] == 1.0
    np.testing.assert_array_equal(way[:, 0], times)


def test_a_solution_has_the_scene_of_its_motion(solution: dmoc.Solution) -> None:
    scene = solution.trajectory.scene
    assert scene is not None and wrong_scene(scene) is None
    assert [len(t) for t in scene.times] == [101, 101]
    for i, phase in enumerate(solution.phases):
        alpha, x = phase.q.T
        tip = np.stack([x + 0.5 * np.cos(alpha), 0.5 * np.sin(alpha)], 1)
        np.testing.assert_allclose(places(scene, "point", i), tip, atol=1e-12)
        np.testing.assert_allclose(scene.times[i], phase.t)
        np.testing.assert_allclose(places(scene, "box", i)[:, :2], np.stack([x, 0 * x], 1))
    lower = scene.contacts[0]
    assert lower.name == "lower"
    nx, ny = scene.of(lower, 0)[-1, 2:]
    np.testing.assert_allclose((nx, ny), (-np.sin(np.pi / 10), np.cos(np.pi / 10)), atol=1e-9)


def test_a_model_without_a_drawing_has_no_scene(block: Kernels) -> None:
    t = np.linspace(0.0, 1.0, 3)
    models = PhaseModels(block, np.array([[1.0, 1.0]]))
    assert scene_of(models, [(t, t[:, None], np.ones((3, 1)))]) is None


def test_a_drawing_that_is_nowhere_is_no_scene() -> None:
    kernels = dmoc.load("bouncing_pendulum")
    models = PhaseModels(kernels, np.array([[1.0, 1.0, 9.81, 0.0]]))
    t, q = np.linspace(0.0, 1.0, 3), np.ones((3, 1))
    assert scene_of(models, [(t, q, q)]) is not None
    assert scene_of(models, [(t, q, q * np.nan)]) is None


@pytest.mark.parametrize("every", [1, 7])
def test_a_simulation_has_a_scene_from_one_event_to_the_next(every: int) -> None:
    kernels = dmoc.load("bouncing_pendulum")
    run = dmoc.simulate(kernels, {"theta": 1.0}, step_size=0.01, steps=420, every=every)
    scene = run.scene
    assert scene is not None and wrong_scene(scene) is None
    times = [c.time for c in run.collisions]
    assert len(times) == 4
    assert [t[-1] for t in scene.times[:-1]] == times == [t[0] for t in scene.times[1:]]
    for i, (before, after) in enumerate(pairwise(range(5))):
        hit = places(scene, "point", before)[-1], places(scene, "point", after)[0]
        np.testing.assert_allclose(hit, [(0.0, -1.0)] * 2, atol=1e-9, err_msg=str(i))
    for phase in range(5):
        np.testing.assert_allclose(np.hypot(*places(scene, "point", phase).T), 1.0, atol=1e-12)
        assert (places(scene, "point", phase)[:, 0] > -1e-4).all()  # never behind the wall


def test_a_simulation_with_too_many_events_is_not_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dmoc.simulation.recording.MOST_DRAWN", 3)
    kernels = dmoc.load("bouncing_pendulum")
    run = dmoc.simulate(kernels, {"theta": 1.0}, step_size=0.01, steps=420)
    assert len(run.collisions) == 4 and run.scene is None


def test_what_does_not_fit_together_is_named() -> None:
    t, values = np.linspace(0.0, 1.0, 3), np.zeros((3, 6))
    good = Scene((Shape("link", "", 0, 4), Shape("point", "", 4, 2)), (t,), (values,))
    assert wrong_scene(good) is None
    for shapes, times, rows, expected in (
        ((Shape("link", "", 0, 5),), (t,), (values,), "a link of the scene has the wrong columns"),
        (good.shapes[1:], (t,), (values,), "a point of the scene has the wrong columns"),
        (good.shapes, (t[::-1],), (values,), "times of the scene do not increase"),
        (good.shapes, (t,), (values[:, 1:],), "values of the wrong shape"),
        (good.shapes, (t, t), (values,), "of different phases"),
    ):
        assert expected in str(wrong_scene(Scene(shapes, times, rows)))
