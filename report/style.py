"""How figures look: light and dark, in colours that the colour-blind can tell (Okabe & Ito 2008),
and with line styles that tell the same."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from dmoc.base.arguments import choice
from dmoc.base.errors import OutputError

# Line styles of the curves of a panel, as Matplotlib takes them; limits and jumps are dotted.
DASHES: tuple[Any, ...] = (
    "-",
    (0, (5, 1.5)),
    (0, (6, 1.5, 1.2, 1.5)),
    (0, (2.2, 1.1)),
    (0, (6, 1.2, 1.2, 1.2, 1.2, 1.2)),
)
DOTS = (0, (1, 1.6))


@dataclass(frozen=True)
class Style:
    """Colours of a figure.

    Attributes
    ----------
    paper, ink, muted, grid : str
        The background, texts, what stands behind, and the lines of the grid.
    colours : tuple of str
        Of curves.
    tints : tuple of str
        Of areas behind texts; ``free`` where nothing touches.
    verdicts : mapping of str to str
        Of the nodes of a search, behind ``on_verdict``.
    alarm : str
        Of what was not solved.
    """

    paper: str
    ink: str
    muted: str
    grid: str
    colours: tuple[str, ...]
    tints: tuple[str, ...]
    free: str
    verdicts: Mapping[str, str]
    on_verdict: str
    alarm: str

    def stroke(self, number: int, place: int) -> dict[str, Any]:
        """Colour of the curve of a number, and its line style from its place in a panel."""
        return {
            "color": self.colours[number % len(self.colours)],
            "linestyle": DASHES[place % len(DASHES)],
        }

    @property
    def settings(self) -> dict[str, Any]:
        """The same as Matplotlib's settings."""
        written = ("text.color", "axes.labelcolor", "axes.titlecolor", "xtick.color", "ytick.color")
        return {
            **dict.fromkeys(written, self.ink),
            **dict.fromkeys(("figure.facecolor", "axes.facecolor"), self.paper),
            "axes.edgecolor": self.muted,
            "grid.color": self.grid,
        }


VERDICTS = MappingProxyType(
    {
        "optimal": "#009E73",
        "feasible": "#56B4E9",
        "grazes": "#F0E442",
        "collapses": "#B7A6FF",
        "unverified": "#E69F00",
        "infeasible": "#BBBBBB",
        "unreachable": "#D55E00",
        "failed": "#CC79A7",
    }
)
LIGHT = Style(
    paper="#ffffff",
    ink="#202020",
    muted="#767676",
    grid="#e4e4e4",
    colours=("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"),
    tints=("#cce3f0", "#f7dfcc", "#b3e2d5", "#f5e4ed", "#faeccc", "#a6d7f3"),
    free="#f4f4f4",
    verdicts=VERDICTS,
    on_verdict="#101010",
    alarm="#B00020",
)
# The blue and the green of the light style are too dark on black: lighter ones of the same hues.
DARK = Style(
    paper="#14171a",
    ink="#e8e8e8",
    muted="#9a9fa5",
    grid="#31363b",
    colours=("#56B4E9", "#FF8A3D", "#2CC79A", "#E39CC6", "#F0E442", "#B7A6FF"),
    tints=("#1d4460", "#5a2f14", "#145544", "#56384a", "#534b12", "#3b3566"),
    free="#22272b",
    verdicts=VERDICTS,
    on_verdict="#101010",
    alarm="#FF6B6B",
)
STYLES = {"light": LIGHT, "dark": DARK}


def style_of(name: str) -> Style:
    """The style of a name; raise OutputError for another one."""
    choice(name, "style", tuple(STYLES), OutputError)
    return STYLES[name]
