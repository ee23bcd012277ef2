"""Legends: whether words stand behind what is drawn of their curves, or alone."""

from __future__ import annotations

import pytest
from matplotlib.artist import Artist
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from dmoc.report.canvas import LONGEST, legend_beside


def handle(kind: str) -> Artist:
    """A line, a patch, or a text alone."""
    if kind == "patch":
        return Patch(label=kind)
    return Line2D([], [], linestyle="-" if kind == "line" else "None", label=kind)


@pytest.mark.parametrize(
    ("kinds", "drawn"),
    [
        (["line"], True), (["text"], False), (["patch"], True), (["text", "text"], False),
        (["text", "line", "text"], True), (["line", "text"], True), (["text", "patch"], True),
    ],
)  # fmt: skip
def test_words_alone_stand_without_a_gap(kinds: list[str], drawn: bool) -> None:
    axes = Figure().add_subplot()
    legend_beside(axes, [handle(kind) for kind in kinds])
    legend = axes.get_legend()
    assert legend is not None and [t.get_text() for t in legend.get_texts()] == kinds
    assert (legend.handlelength, legend.handletextpad) == ((2.6, 0.8) if drawn else (0.0, 0.0))


@pytest.mark.parametrize(("letters", "above"), [(LONGEST, False), (LONGEST + 1, True)])
@pytest.mark.parametrize("place", [0, 1, 2])
def test_a_legend_of_long_words_stands_over_the_curves(
    letters: int, above: bool, place: int
) -> None:
    axes = Figure().add_subplot()
    labels = ["a", "b", "c"]
    labels[place] = "x" * letters
    legend_beside(axes, [Line2D([], [], label=label) for label in labels])
    legend = axes.get_legend()
    assert legend is not None
    corner = axes.transAxes.inverted().transform(legend.get_bbox_to_anchor().p0)
    assert corner == pytest.approx((1.0, 1.0 if above else 0.5))
