"""Figures without a window, and how they reach a file."""

from __future__ import annotations

import io
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dmoc.base.arguments import path as path_of
from dmoc.base.arguments import place
from dmoc.base.errors import MissingExtraError, OutputError
from dmoc.base.files import write_whole
from dmoc.report.labels import letters
from dmoc.report.style import Style, style_of

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH = 8.4  # inches of a figure of one column
LENGTH = 5.7  # inches of its axes from left to right, about
PAD = 0.07  # inches around axes
LONGEST = 20  # letters of a label that stands beside axes
SMALL = 8  # points of small text
DPI = 200  # of figures in files


@contextmanager
def painted(name: str, path: str | os.PathLike[str] | None) -> Iterator[Style]:
    """Draw in the style of a name, for a file if a path is given: unknown styles and formats are
    refused before anything is drawn."""
    style = style_of(name)
    try:
        import matplotlib.backends.backend_agg
        import matplotlib.figure
    except ModuleNotFoundError:
        raise MissingExtraError(
            "Matplotlib is needed to plot: install it with `pip install 'dmoc[plot]'`."
        ) from None
    if path is not None:
        _format_of(path_of(path))
    settings: Any = style.settings  # Matplotlib types their names
    with matplotlib.rc_context(settings):
        yield style


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure of a size in inches."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    from dmoc.report.shown_figure import ShownFigure

    figure = ShownFigure(
        figsize=(width, height), layout=ConstrainedLayoutEngine(w_pad=PAD, h_pad=PAD)
    )
    FigureCanvasAgg(figure)
    return figure


def written(figure: Figure, path: str | os.PathLike[str] | None) -> Figure:
    """The figure, which is written if a path is given; its ending decides the format."""
    if path is not None:
        content = io.BytesIO()
        figure.savefig(content, dpi=DPI, format=_format_of(path_of(path)))
        write_whole(path, content.getvalue())
    return figure


def _format_of(path: Path) -> str:
    """The format of a figure, by the ending of its file."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    ending = path.suffix[1:].lower()
    if ending not in FigureCanvasAgg.get_supported_filetypes():
        raise OutputError(f"{place(path)} has no known format: end it in .png, .pdf or .svg.")
    return ending


def plain_axes(axes: Axes, style: Style) -> None:
    """Axes with a grid behind the curves and without a frame above and on the right."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(True, linewidth=0.6)
    axes.set_axisbelow(True)
    inked(axes, style)


def inked(axes: Axes, style: Style) -> None:
    """Ticks in the colours of the style also where they are made when the figure is drawn."""
    axes.tick_params(colors=style.muted, labelcolor=style.ink)


def legend_beside(axes: Axes, handles: Sequence[Artist]) -> None:
    """A legend on the right of the axes, where it hides no curve, or over them where
    its words are long; texts alone stand without a gap before them."""
    from matplotlib.lines import Line2D

    labels = [str(handle.get_label()) for handle in handles]
    place: dict[str, Any] = {"loc": "center left", "bbox_to_anchor": (1.0, 0.5)}
    if max(map(letters, labels)) > LONGEST:
        place = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0)}
    drawn = any(not isinstance(h, Line2D) or h.get_linestyle() != "None" for h in handles)
    axes.legend(
        handles=list(handles),
        **place,
        frameon=False,
        borderaxespad=0.4,
        handlelength=2.6 if drawn else 0.0,
        handletextpad=0.8 if drawn else 0.0,
        fontsize=SMALL,
    )
