"""Figures without a window, and how they reach a file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from dmoc.errors import MissingExtraError, OutputError

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
        raise MissingExtraError("Matplotlib is needed to plot: install it with `pip install dmoc[plot]`.") from None
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def write(figure: Figure, path: Path) -> None:
    """Write a figure; the ending of the path decides the format."""
    try:
        figure.savefig(path, dpi=200)
    except OSError as error:
        raise OutputError(f"{path} cannot be written ({error.strerror}): choose a writable place.") from None
    except ValueError:
        raise OutputError(f"{path} has no known format: end it in .png, .pdf or .svg.") from None


def symbol(name: str) -> str:
    """A name as mathematics: greek names become letters, what follows an underscore a subscript."""
    greek = "alpha beta gamma delta epsilon zeta eta theta kappa lambda mu nu xi rho sigma tau phi chi psi omega".split()
    head, _, tail = name.partition("_")

    def letter(text: str) -> str:
        return f"\\{text}" if text in greek else (text if len(text) == 1 else f"\\mathrm{{{text}}}")

    return letter(head) + (f"_{{{','.join(letter(part) for part in tail.split('_'))}}}" if tail else "")
