"""Motions with scenes, made by hand, whose places are closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import dmoc
from dmoc.motion.scene import Scene, Shape
from dmoc.motion.trajectory import Collision, Phase, Trajectory

# A mass goes from x = 0 to a wall at x = 1 in 0.5 s and back in 1 s; the rod behind it has the
# length 0.25, both are 0.7 above the ground, which pushes with 10 N to 20 N and rubs with -4 N.
TURN, END, ROD, HIGH = 0.5, 1.5, 0.25, 0.7
EVIL = '</script><b>"wall"&\'{{style}}'


def place(t: float) -> float:
    """Where the mass is."""
    return t / TURN if t < TURN else (END - t) / (END - TURN)


def _phase(t: np.ndarray, force: bool) -> Phase:
    q = np.array([[place(s), HIGH] for s in t])
    v = np.tile([2.0, 0.0] if t[0] < TURN else [-1.0, 0.0], (len(t), 1))
    normal = 10.0 + 10.0 * (t[:, None] - t[0]) / (t[-1] - t[0])
    touching = {
        "closed": ("floor",),
        "rubbing": {"floor": 1},
        "normal": normal,
        "tangential": np.full((len(t), 1), -4.0),
    }
    return Phase(t, q, 3.0 * v, v, np.full((len(t) - 1, 1), 5.0), **(touching if force else {}))


def _values(t: np.ndarray) -> np.ndarray:
    x = np.array([place(s) for s in t])
    one, zero = np.ones_like(x), np.zeros_like(x)
    columns = [
        *(-0.5 * one, zero, 1.5 * one, zero),  # the floor
        *(x, HIGH * one, x - ROD, HIGH * one),  # the rod
        *(x, HIGH * one),  # the mass
        *(x, HIGH * one, -one, zero),  # the contact with the wall
        *(x, zero, zero, one),  # the contact with the floor
    ]
    return np.stack(columns, axis=1)


def motion(wall: str = "wall", model: str = "shuttle") -> Trajectory:
    """A mass that goes to a wall over a floor and back."""
    times = np.linspace(0.0, TURN, 6), np.linspace(TURN, END, 11)
    hit = Collision(
        wall, TURN, np.array([1.0, HIGH]), 9.0, np.array([6.0, 0.0]), np.array([-3.0, 0.0])
    )
    shapes = (
        Shape("wall", "", 0, 4),
        Shape("link", "", 4, 4),
        Shape("point", "", 8, 2),
        Shape("contact", wall, 10, 4),
        Shape("contact", "floor", 14, 4),
    )
    return Trajectory(
        model, "", ("x", "y"), ("u",), {}, (_phase(times[0], True), _phase(times[1], False)),
        (hit,), "constant", np.array([[-6.0, 6.0]]), np.full((2, 2), [-np.inf, np.inf]),
        {wall: 0.5, "floor": 0.0}, 2, (), {"floor": 0.5}, {"x": "m", "y": "m", "u": "N"},
        Scene(shapes, times, tuple(_values(t) for t in times)),
    )  # fmt: skip


AXES = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)  # the first two, of a frame that is not turned


def flight() -> Trajectory:
    """The mass that goes to a wall and back as an orange ball in space, beside a blue one that
    stays."""
    flat = motion()
    assert flat.scene is not None
    shapes = (
        Shape("bob", "", 0, 3), Shape("sphere", "", 3, 10), Shape("plane", "", 13, 6),
        Shape("touch", "wall", 19, 6), Shape("touch", "floor", 25, 6),
    )  # fmt: skip
    values = []
    for times in flat.scene.times:
        x = np.array([place(t) for t in times])
        one, zero = np.ones_like(x), np.zeros_like(x)
        ball = [0.5 * one, 0.8 * one, 0.2 * one, *(e * one for e in (*AXES, 0.2))]
        wall = [*(one, zero, zero, -one, zero, zero), *(x, zero, HIGH * one, -one, zero, zero)]
        floor = [x, zero, zero, zero, zero, one]
        values.append(np.stack([x, zero, HIGH * one, *ball, *wall, *floor], axis=1))
    return replace(flat, scene=Scene(shapes, flat.scene.times, tuple(values)))


def mirrored(trajectory: Trajectory) -> Trajectory:
    """The same motion, further to the left by one."""
    scene = trajectory.scene
    assert scene is not None
    shift = np.zeros(scene.values[0].shape[1])
    shift[[4, 6, 8, 10, 14]] = -1.0
    moved = replace(scene, values=tuple(values + shift for values in scene.values))
    return replace(trajectory, scene=moved)


def solution_of(trajectory: Trajectory, solved: dmoc.Solution) -> dmoc.Solution:
    """A solution with another motion."""
    return replace(solved, trajectory=trajectory)
