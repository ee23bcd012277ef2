"""Poses of a motion in space that stays where it is: behind one another nobody could tell them
apart, so that pictures show them side by side."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dmoc.motion.scene import Scene, Shape
from dmoc.report.camera import STILL, reach_of

POSES = 6  # of a whole motion, equally spaced in time, beside those at events
NEAR = 0.06  # of the whole time: a pose that is as near to an event gives way
MOST_EVENTS = 8
STAYS = 1.8  # times the room of a pose is at most that of a motion that stays


class Pose(NamedTuple):
    """A row of the values of a phase, at a time, and whether the phase ends there."""

    phase: int
    row: int
    time: float
    last: bool


def poses_of(scene: Scene) -> list[Pose]:
    """The poses of a motion that stays where it is; none of another one."""
    if not scene.in_space or not _stays(scene):
        return []
    end = float(scene.times[-1][-1])
    ends = [float(times[-1]) for times in scene.times[:MOST_EVENTS]]
    wanted = [
        t for t in np.linspace(0.0, end, POSES) if np.abs(t - np.array(ends)).min() > NEAR * end
    ]
    poses = []
    for t in sorted({*wanted, *ends, end}):
        phase = next(i for i, times in enumerate(scene.times) if t <= times[-1])
        row = int(np.searchsorted(scene.times[phase], t))
        poses.append(Pose(phase, row, t, t == scene.times[phase][-1]))
    return poses


def _stays(scene: Scene) -> bool:
    """Whether what moves takes hardly more room along the motion than at either end of a phase."""
    moving = tuple(s for s in scene.shapes if s.kind not in STILL and _moves(scene, s))
    ends = [
        (times[[k]], values[[k]])
        for times, values in zip(scene.times, scene.values, strict=True)
        for k in (0, -1)
    ]
    single = max(_side(Scene(moving, (t,), (values,))) for t, values in ends)
    return bool(moving) and _side(Scene(moving, scene.times, scene.values)) <= STAYS * single


def _moves(scene: Scene, shape: Shape) -> bool:
    values = np.vstack([scene.of(shape, phase) for phase in range(len(scene.times))])
    return bool(np.ptp(values, axis=0).any())


def _side(scene: Scene) -> float:
    low, high = reach_of(scene)
    return float(max(high - low))
