"""Figures without a window, and how they reach a file."""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from dmoc.errors import MissingExtraError, OutputError
from dmoc.writing import write_whole

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LENGTH = 6.0  # inches of axes from left to right in a figure of one column
# Inches of a legend's entry beside its text, and of a character of it.
KEY, CHARACTER = 0.66, 0.09


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure of a size in inches.

    Raises
    ------
    MissingExtraError
        If Matplotlib is not installed.
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ModuleNotFoundError:
        raise MissingExtraError(
            "Matplotlib is needed to plot: install it with `pip install 'dmoc[plot]'`."
        ) from None
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def write(figure: Figure, path: Path) -> None:
    """Write a figure; the ending of the path decides the format."""
    ending = path.suffix[1:].lower()
    if ending not in figure.canvas.get_supported_filetypes():
        raise OutputError(f"{path} has no known format: end it in .png, .pdf or .svg.")
    content = io.BytesIO()
    figure.savefig(content, dpi=200, format=ending)
    write_whole(path, content.getvalue())


def symbol(name: str) -> str:
    """A name as mathematics: greek names become letters, what follows an underscore a subscript."""
    greek = (
        "alpha beta gamma delta epsilon zeta eta theta kappa lambda mu nu xi rho sigma tau phi "
        "chi psi omega"
    ).split()
    head, _, tail = name.partition("_")

    def letter(text: str) -> str:
        return f"\\{text}" if text in greek else (text if len(text) == 1 else f"\\mathrm{{{text}}}")

    parts = [letter(part) for part in tail.split("_") if part]
    return letter(head) + (f"_{{{','.join(parts)}}}" if parts else "")


def entries_in_a_row(labels: Sequence[str]) -> int:
    """How many entries of a legend have room beside each other over the axes."""
    plain = [re.sub(r"\\mathrm|[$_{}]", "", label) for label in labels]
    widths = [KEY + CHARACTER * len(re.sub(r"\\[a-z]+", "a", text)) for text in plain]
    if sum(widths) <= LENGTH:
        return len(labels)
    return max(1, int(LENGTH / max(widths)))


def legend_above(axes: Axes, handles: Sequence[Artist]) -> None:
    """A legend over the axes, where it hides no curve, in as many rows as it needs."""
    labels = [str(handle.get_label()) for handle in handles]
    axes.legend(
        handles=list(handles),
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=entries_in_a_row(labels),
        frameon=False,
        borderaxespad=0.1,
        fontsize=9,
    )
