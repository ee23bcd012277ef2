"""Write motions as a page that plays them, as a GIF or as an mp4."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from math import isfinite, nan
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from dmoc.base.arguments import listed, place, positive, shown, whole
from dmoc.base.arguments import path as path_of
from dmoc.base.errors import OutputError, ProblemError
from dmoc.base.files import write_whole
from dmoc.base.signatures import public
from dmoc.motion.trajectory import Trajectory
from dmoc.report.animation.movie import movie_of
from dmoc.report.animation.page import page_of
from dmoc.report.film import Branch, Film, Proofs, Take
from dmoc.report.style import style_of

if TYPE_CHECKING:
    from typing import TypeAlias

FORMATS = (".html", ".gif", ".mp4")
MOST = 3  # motions of a search that a movie shows side by side
MOST_FRAMES_PER_SECOND = 60


class Moved(Protocol):
    """What has a motion, as a :class:`dmoc.Solution` and a :class:`dmoc.Simulation` have; what a
    solution says of itself beside it is told too."""

    @property
    def trajectory(self) -> Trajectory: ...


if TYPE_CHECKING:
    Shown: TypeAlias = Moved | Trajectory


@public(OutputError)
def animate(
    motions: Shown | Sequence[Shown] | Mapping[str, Shown],
    path: str | os.PathLike[str],
    *,
    speed: float | None = None,
    fps: int = 25,
    style: str = "light",
) -> Path:
    """Write motions, side by side on one clock, as a page, a GIF or an mp4.

    The page is one file that fetches nothing: the mechanism with its hits and contact forces, in
    space in three dimensions that dragging turns, and positions, velocities, momenta, inputs and
    forces as curves with a cursor.  It plays, pauses, steps, and goes to any time by its slider,
    its curves and its events.

    Parameters
    ----------
    motions : Solution, Simulation, Trajectory, a sequence of them, or a mapping of names to them
    path : path
        The ending decides: .html, .gif or .mp4.
    speed : float, optional
        Seconds of the motion in a second of a GIF or an mp4; by default 1, less for a motion of
        less than 3 s, more for one of more than 30 s.  A page has a choice of speeds.
    fps : int
        Frames of a GIF or an mp4 in a second, 1 to 60.
    style : {"light", "dark"}
        Of a GIF or an mp4.  A page follows its reader.

    Returns
    -------
    Path

    Raises
    ------
    ProblemError
        If an argument does not fit.
    OutputError
        If the format is unknown or the file cannot be written.
    MissingExtraError
        If Matplotlib is needed and not installed, or ffmpeg is needed and not there.

    Examples
    --------
    >>> import dmoc
    >>> from dmoc.models.registry import find
    >>> problem = dmoc.Problem(dmoc.load("cart_pendulum"), **find("cart_pendulum").defaults)
    >>> fast = dmoc.solve(problem, "ipm", starts=1)
    >>> slow = dmoc.solve(problem.but(final_time=1.2), "ipm", starts=1)
    >>> print(dmoc.animate({"in 1 s": fast, "in 1.2 s": slow}, "both.html"))
    both.html
    """
    target, takes = path_of(path), _takes(motions)
    models = dict.fromkeys(take.trajectory.model for take in takes)
    return _written(Film(", ".join(models), tuple(takes)), target, speed, fps, style)


def animate_tree(
    title: str,
    nodes: Iterable[tuple[tuple[str, ...], str, str, float | None, tuple[str, ...], Moved | None]],
    path: str | os.PathLike[str],
    *,
    speed: float | None = None,
    fps: int = 25,
    style: str = "light",
    proofs: Proofs | None = None,
) -> Path:
    """Write the tree of a search as a page in which the nodes (sequence, name, verdict, cost,
    evidence, solution) show their motions, verdicts and proofs, or its best motions as a GIF or an
    mp4; see :func:`animate`."""
    proofs = proofs or Proofs()
    target = path_of(path)
    takes: list[Take] = []
    branches = []
    for sequence, name, verdict, cost, evidence, solution in nodes:
        take = None if solution is None else len(takes)
        proved = proofs.proved.get(sequence, "")
        branches.append(Branch(sequence, name, verdict, cost, evidence, take, proved))
        if solution is not None:
            takes.append(_take(name, solution))
    if target.suffix.lower() != ".html":
        order = {"optimal": 0, "feasible": 1}
        good = [b for b in branches if b.motion is not None and b.verdict in order]
        good.sort(key=lambda b: (order[b.verdict], b.cost or 0.0))
        if not good:
            raise ProblemError(
                "the search has no confirmed motion: a page (.html) shows its verdicts."
            )
        takes, branches = [takes[b.motion or 0] for b in good[:MOST]], []
    film = Film(title, tuple(takes), tuple(branches), proofs.statement)
    return _written(film, target, speed, fps, style)


def _written(film: Film, path: Path, speed: float | None, fps: int, style: str) -> Path:
    ending = path.suffix.lower()
    if ending not in FORMATS:
        raise OutputError(f"{place(path)} has no known format: end it in .html, .gif or .mp4.")
    if speed is not None:
        positive(speed, "speed", "expected a positive number such as 0.5")
    whole(fps, "fps", 1, MOST_FRAMES_PER_SECOND)
    colours = style_of(style)
    if ending == ".html":
        write_whole(path, page_of(film).encode())
    else:
        write_whole(path, movie_of(film, ending, speed, fps, colours))
    return path


def _takes(motions: Any) -> list[Take]:
    """The motions with their names: the given ones, the events, or numbers where those are the
    same."""
    if isinstance(motions, Mapping):
        takes = [_take(str(name), motion) for name, motion in motions.items()]
    else:
        several = isinstance(motions, Iterable) and not isinstance(motions, (str, bytes))
        several &= not _is_motion(motions)
        several_motions = listed(motions, "motions", "solutions") if several else [motions]
        takes = [_take("", motion) for motion in several_motions]
        takes = _named(takes)
    if not takes:
        raise ProblemError("there are no motions: give one or more solutions.")
    return takes


def _is_motion(value: object) -> bool:
    return isinstance(getattr(value, "trajectory", value), Trajectory)


def _take(name: str, motion: Any) -> Take:
    if isinstance(motion, Trajectory):
        return Take(name, motion)
    if not _is_motion(motion):
        raise ProblemError(
            f"motions = {shown(motion)}: expected solutions, simulations or their trajectories, "
            "one, several, or a mapping of names to them."
        )
    status, message = (getattr(motion, what, "") for what in ("status", "message"))
    cost = float(getattr(motion, "cost", nan))  # of which a motion may say nothing
    stated = cost if isfinite(cost) else None
    return Take(name, motion.trajectory, str(status), message, stated)


def _named(takes: Sequence[Take]) -> list[Take]:
    """Takes with the names of their models and events, numbered where several are the same."""
    names = []
    for take in takes:
        events = ", ".join(event.word for event in take.trajectory.collisions)
        names.append(f"{take.trajectory.model}: {events}" if events else take.trajectory.model)
    if len(set(names)) < len(names):
        names = [f"{i}. {name}" for i, name in enumerate(names, start=1)]
    return [replace(take, name=name) for take, name in zip(takes, names, strict=True)]
