"""A film as a GIF or an mp4: mechanisms side by side, with the time, hits and contact forces."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from math import ceil
from typing import TYPE_CHECKING

import numpy as np

from dmoc.base.errors import MissingExtraError, OutputError
from dmoc.base.files import scratch_folder
from dmoc.motion.trajectory import Array
from dmoc.report.animation.page import film_room
from dmoc.report.animation.stage import Drawn, stage_of
from dmoc.report.canvas import new_figure
from dmoc.report.film import Film
from dmoc.report.places import Room
from dmoc.report.style import Style

if TYPE_CHECKING:
    from matplotlib.animation import AbstractMovieWriter
    from matplotlib.figure import Figure

SHORTEST, LONGEST = 3.0, 30.0  # seconds that a movie takes unless its speed is given
HOLD = 0.6  # seconds for which its end stands
MOST_FRAMES = 5000
DOTS = 100  # in an inch; a column has an even number of them, as mp4 wants
WIDTH = 6.4  # inches of a column
LOWEST, HIGHEST = 2.4, 5.2  # inches of a mechanism, which has the shape of its room between them
ABOVE, BELOW = 0.38, 0.34  # inches of the names over several of them, and of the times under it


def movie_of(film: Film, ending: str, speed: float | None, fps: int, style: Style) -> bytes:
    """The content of a GIF or an mp4 of the motions of a film, with so many seconds of the motion
    in a second of it; one that would be too long is refused."""
    times = _times(max(take.trajectory.final_time for take in film.takes), speed, fps)
    figure, stages = _set(film, style)
    with ExitStack() as stack:
        folder = stack.enter_context(scratch_folder())
        path = folder / f"movie{ending}"
        writer = _writer(ending, fps, stack)
        stack.enter_context(_ffmpeg_errors())
        with writer.saving(figure, os.fspath(path), dpi=DOTS):
            for t in times:
                for draw in stages:
                    draw(float(t))
                writer.grab_frame(facecolor=style.paper)
        return path.read_bytes()


@contextmanager
def _ffmpeg_errors() -> Iterator[None]:
    """Say that ffmpeg has failed; a Ctrl-C, which ends ffmpeg too, stays what it is."""
    try:
        yield
    except (subprocess.CalledProcessError, BrokenPipeError) as error:
        before: BaseException | None = error
        while before is not None:
            if isinstance(before, KeyboardInterrupt):
                raise KeyboardInterrupt from None
            before = before.__context__
        raise OutputError(
            "ffmpeg has failed to write the movie: see whether it runs and its temporary folder "
            "has room, or write a .gif."
        ) from None


def _set(film: Film, style: Style) -> tuple[Figure, list[Drawn]]:
    """A figure with the mechanisms beside each other, at one scale."""
    takes = film.takes
    room = film_room([take.scene for take in takes])
    wide, tall = room.sides
    high = min(max(WIDTH * tall / wide, LOWEST), HIGHEST)
    above = ABOVE if len(takes) > 1 else 0.0  # one motion needs no name
    height = 2 * ceil((high + above + BELOW) * DOTS / 2) / DOTS
    figure = new_figure(WIDTH * len(takes), height)
    figure.set_layout_engine("none")
    figure.set_facecolor(style.paper)
    share = 1.0 / len(takes)
    stages: list[Drawn] = []
    for i, take in enumerate(takes):
        axes = figure.add_axes((i * share, BELOW / height, share, high / height))
        stages.append(stage_of(axes, take, _fitted(room, WIDTH / high), style))
        if above:
            axes.set_title(take.name, color=style.ink, fontsize=11, parse_math=False)
    return figure, stages


def _fitted(room: Room, ratio: float) -> Room:
    """A room, widened to the shape of its axes."""
    wide, tall = room.sides
    width = max(wide, ratio * tall) / 2
    x, y = (room.left + room.right) / 2, (room.bottom + room.top) / 2
    return Room(x - width, x + width, y - width / ratio, y + width / ratio, room.camera)


def _times(duration: float, speed: float | None, fps: int) -> Array:
    """The times of the frames, the end among them, and again while it stands."""
    if speed is None:
        speed = duration / min(max(duration, SHORTEST), LONGEST)
    count = duration * fps / speed
    if count > MOST_FRAMES:
        raise OutputError(
            f"the movie would have {count:.0f} frames, and {MOST_FRAMES} at most are written: "
            "raise the speed, or lower the frames in a second (fps)."
        )
    moving = np.linspace(0.0, duration, max(int(np.ceil(count)), 1) + 1)
    return np.append(moving, np.full(round(HOLD * fps), duration))


def _writer(ending: str, fps: int, stack: ExitStack) -> AbstractMovieWriter:
    from matplotlib import rc_context
    from matplotlib.animation import FFMpegWriter, PillowWriter

    if ending == ".gif":
        return PillowWriter(fps=fps)
    stack.enter_context(rc_context({"animation.ffmpeg_path": _ffmpeg()}))
    return FFMpegWriter(fps=fps, codec="h264", bitrate=-1)


def _ffmpeg() -> str:
    """Where ffmpeg is: that of the machine, or that of imageio-ffmpeg."""
    path = shutil.which("ffmpeg")
    if path is not None:
        return path
    try:
        from imageio_ffmpeg import get_ffmpeg_exe

        return str(get_ffmpeg_exe())
    except (ModuleNotFoundError, RuntimeError):
        raise MissingExtraError(
            "ffmpeg is needed to write an mp4: install it, or imageio-ffmpeg with "
            "`pip install 'dmoc[mp4]'`; a .gif and a .html need neither."
        ) from None
