"""Figures without a window, and how they reach a file."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

from dmoc.errors import MissingExtraError, OutputError
from dmoc.writing import write_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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
