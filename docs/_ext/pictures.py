"""The pictures of the first pages: ``make pictures`` writes them into docs/pictures.

The swing-up is what two commands of the README write; the others show a motion of an example at
equal intervals of time, the later the stronger.  The fit and the proof are those of their pages.
"""

from __future__ import annotations

import io
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

import dmoc
from dmoc.motion.scene import Array, Scene, Shape
from dmoc.report.places import room_of, values_at
from dmoc.report.shapes import look_of, painter
from dmoc.report.solid_painter import draw_ground, draw_ways, solids
from dmoc.report.style import DARK

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "docs" / "pictures"
DOTS, WIDTH, HEIGHT = 200, 4.8, 3.6  # in an inch, and inches
COLOURS = 128  # of a picture, which are enough for its shades
FAINT, PALE = 0.12, 0.3  # strength of the first time, in the plane and in space
ROOM = 0.05  # of the larger side, around everything
BELOW = 0.06  # of the width, for the strokes of a floor
# Shapes that move, and those of which all columns are points.
MOVING, POLYLINES = ("link", "point", "disc", "box", "spring"), ("link", "spring", "wall")


@dataclass(frozen=True)
class Strobe:
    """An example, the times at which it is drawn, and how often its motion is repeated."""

    name: str
    shots: int
    repeat: int = 1


STROBES = (
    Strobe("walker", 7, 4), Strobe("finger_puck", 16), Strobe("hopper", 10, 2), Strobe("coin", 11),
)  # fmt: skip


def main() -> None:
    FOLDER.mkdir(exist_ok=True)
    dmoc_command = [sys.executable, "-m", "dmoc"]
    with tempfile.TemporaryDirectory() as folder:
        for arguments in (
            ["search", "cart_pendulum", "--max-collisions", "2", "--out", "result"],
            ["animate", "result/solution.npz", "--out", str(FOLDER / "swing_up.gif")],
        ):
            subprocess.run([*dmoc_command, *arguments], cwd=folder, check=True)
        for strobe in STROBES:
            script = ROOT / "examples" / f"{strobe.name}.py"
            subprocess.run([sys.executable, str(script), folder], check=True)
            solution = dmoc.Solution.load(Path(folder) / f"{strobe.name}.npz")
            scene = solution.trajectory.scene
            assert scene is not None
            path = FOLDER / f"{strobe.name}.png"
            if scene.in_space:
                draw_in_space(scene, strobe, path)
            else:
                draw(solution, strobe, path)
    of_page("fit.md", 1, "fit", FOLDER / "fit.png")
    of_page("proofs.md", 2, "proof", FOLDER / "proof.png")


def of_page(page: str, blocks: int, name: str, path: Path) -> None:
    """Write the figure of a result that the first blocks of a page have."""
    names: dict[str, Any] = {}
    for block in (ROOT / "docs" / page).read_text().split("```python\n")[1 : 1 + blocks]:
        exec(block.partition("```")[0], names)
    content = io.BytesIO()
    names[name].plot().savefig(content, dpi=DOTS // 2)
    Image.open(content).convert("RGB").quantize(COLOURS).save(path, optimize=True)


def draw(solution: dmoc.Solution, strobe: Strobe, path: Path) -> None:
    """Write the picture of a motion."""
    scene = solution.trajectory.scene
    assert scene is not None
    figure = Figure(figsize=(WIDTH, HEIGHT), facecolor=DARK.paper)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_axis_off()
    seen = [
        (shape, values, k / (strobe.repeat * strobe.shots))
        for k in range(strobe.repeat * strobe.shots + 1)
        for shape, values in _at(scene, k * solution.final_time / strobe.shots, strobe.repeat)
    ]
    left, right, bottom, top = _window([_ends(shape, values) for shape, values, _ in seen], scene)
    axes.set(xlim=(left, right), ylim=(bottom, top))
    for shape, values, share in seen:
        strength = FAINT + (1 - FAINT) * share**1.6
        painter(axes, scene, shape, look_of(DARK, right - left, strength=strength))(values)
    for wall in _walls(scene):
        level = scene.of(wall, 0)[0][1]
        place = painter(axes, scene, wall, look_of(DARK, 0.7 * (right - left)))
        place(np.array([left, level, right, level]))
    written(figure, path)


def draw_in_space(scene: Scene, strobe: Strobe, path: Path) -> None:
    """Write the picture of a motion in space, seen from one side."""
    figure = Figure(figsize=(WIDTH, HEIGHT), facecolor=DARK.paper)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_axis_off()
    room = room_of([scene], ROOM, HEIGHT / WIDTH)
    axes.set(xlim=room[:2], ylim=room[2:4])
    axes.set_aspect("equal")
    assert room.camera is not None
    draw_ground(axes, scene, room.camera, DARK)
    draw_ways(axes, scene, room.camera, {"color": DARK.muted, "linewidth": 0.6})
    for t in np.linspace(0.0, scene.times[-1][-1], strobe.shots):
        strength = PALE + (1 - PALE) * (t / scene.times[-1][-1]) ** 1.6
        solids(axes, scene, room.camera, DARK, strength)(values_at(scene, float(t)))
    written(figure, path)


def written(figure: Figure, path: Path) -> None:
    content = io.BytesIO()
    figure.savefig(content, dpi=DOTS)
    Image.open(content).convert("RGB").quantize(COLOURS).save(path, optimize=True)


def _at(scene: Scene, t: float, repeat: int) -> Iterator[tuple[Shape, Array]]:
    """The moving shapes at a time, each with its values, of a motion that repeats."""
    duration = float(scene.times[-1][-1])
    step = min(int(t / duration * (1 + 1e-12)), repeat - 1)
    within = t - step * duration
    phase = max(i for i, times in enumerate(scene.times) if i == 0 or times[0] <= within)
    # What repeats goes on by what its first moving shape has gone.
    first = next(shape for shape in scene.shapes if shape.kind in MOVING)
    ahead = scene.of(first, -1)[-1][0] - scene.of(first, 0)[0][0]
    for shape in scene.shapes:
        if shape.kind in MOVING:
            columns = scene.of(shape, phase).T
            values = np.array([np.interp(within, scene.times[phase], c) for c in columns])
            values[: None if shape.kind in POLYLINES else 1 : 2] += step * ahead
            yield shape, values


def _walls(scene: Scene) -> list[Shape]:
    """Floors, which are drawn over the whole width."""
    walls = [shape for shape in scene.shapes if shape.kind == "wall"]
    return [wall for wall in walls if np.ptp(scene.of(wall, 0)[:, 1::2]) == 0]


def _window(places: list[Array], scene: Scene) -> tuple[float, float, float, float]:
    """What is seen: all places with some room around them, in the shape of the picture."""
    points = np.vstack([*places])
    low, high = points.min(axis=0), points.max(axis=0)
    room = ROOM * max(high - low)
    (left, bottom), (right, top) = low - room, high + room
    for wall in _walls(scene):
        bottom = scene.of(wall, 0)[0][1] - BELOW * (right - left)
    wide = max(right - left, (top - bottom) * WIDTH / HEIGHT)
    tall = wide * HEIGHT / WIDTH
    left, right = (left + right - wide) / 2, (left + right + wide) / 2
    if not _walls(scene):
        bottom -= (tall - (top - bottom)) / 2
    return left, right, bottom, bottom + tall


def _ends(shape: Shape, values: Array) -> Array:
    """Points that bound a shape."""
    if shape.kind in POLYLINES:
        return values.reshape(-1, 2)
    half = {"disc": values[2:3], "box": values[2:4] / 2}.get(shape.kind, np.zeros(1))
    return np.stack([values[:2] - half, values[:2] + half])


if __name__ == "__main__":
    main()
