"""The command ``dmoc animate``: a motion as a page that plays it, a GIF or an mp4."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from dmoc.cli.console import style_of, written
from dmoc.cli.shared_options import out_option
from dmoc.cli.words import argument, option


def animate(
    solutions: Annotated[
        list[Path],
        argument(
            metavar="SOLUTION...",
            help="Solution files (.npz); several play side by side.",
        ),
    ],
    target: Annotated[
        Path | None,
        out_option(
            "Page, GIF or film (.html, .gif, .mp4); by default beside the first solution, as "
            ".html.",
            "FILE",
        ),
    ] = None,
    speed: Annotated[
        float | None,
        option(
            help="Seconds of the motion in a second of a .gif or .mp4; by default 1, less for a "
            "motion of less than 3 s.  A page has a choice of speeds."
        ),
    ] = None,
    fps: Annotated[int, option(help="Frames in a second of a .gif or .mp4.")] = 25,
    dark: Annotated[
        bool,
        option(
            "--dark", help="Draw a .gif or .mp4 on a dark background; a page follows its reader."
        ),
    ] = False,
) -> None:
    """Show a motion: the mechanism with its hits and contact forces, and its curves."""
    from dmoc.report.animation import animate as animated
    from dmoc.results.solution import Solution

    path = target or solutions[0].with_suffix(".html")
    motions = [Solution.load(solution) for solution in solutions]
    written(animated(motions, path, speed=speed, fps=fps, style=style_of(dark)))
