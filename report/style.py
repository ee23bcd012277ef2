"""How figures, films and pages look: light and dark, in colours that the colour-blind can tell
(Okabe & Ito 2008), and with line styles that tell the same."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, ClassVar

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
# Of the verdicts on nodes of a search: their colours, their signs, and what they mean.
LOOKS = (
    ("optimal", "#009E73", "\u2605", "optimal"),
    ("feasible", "#56B4E9", "\u2713", "feasible"),
    ("grazes", "#F0E442", "~", "grazes: a collision has no effect"),
    ("collapses", "#B7A6FF", "\u2193", "collapses: a shorter sequence does as well"),
    ("unverified", "#E69F00", "?", "not confirmed by simulation"),
    ("infeasible", "#BBBBBB", "\u2717", "infeasible: the goal is not reached"),
    ("unreachable", "#D55E00", "\u2298", "unreachable: its last collision cannot be made"),
    ("failed", "#CC79A7", "!", "failed: no answer"),
)
VERDICTS = MappingProxyType({name: colour for name, colour, *_ in LOOKS})
SIGNS = MappingProxyType({name: (sign, meaning) for name, _, sign, meaning in LOOKS})


@dataclass(frozen=True)
class Style:
    """Colours of a picture."""

    paper: str
    ink: str  # of texts
    muted: str  # what stands behind
    grid: str
    edge: str  # of a mechanism, as its body and its masses
    body: str
    mass: str
    hit: str  # events and their impulses
    colours: tuple[str, ...]  # of curves
    tints: tuple[str, ...]  # of areas behind texts
    free: str  # where nothing touches
    alarm: str  # what was not solved
    on_verdict: str = "#101010"
    verdicts: ClassVar[Mapping[str, str]] = VERDICTS

    @property
    def normal(self) -> str:
        return self.colours[2]

    @property
    def friction(self) -> str:
        return self.colours[3]

    def stroke(self, number: int, place: int) -> dict[str, Any]:
        """Colour of the curve of a number, and its line style from its place in a panel."""
        return {
            "color": self.colours[number % len(self.colours)],
            "linestyle": DASHES[place % len(DASHES)],
        }

    @property
    def settings(self) -> dict[str, Any]:
        """The colours as Matplotlib's settings."""
        written = ("text.color", "axes.labelcolor", "axes.titlecolor", "xtick.color", "ytick.color")
        return {
            **dict.fromkeys(written, self.ink),
            **dict.fromkeys(("figure.facecolor", "axes.facecolor"), self.paper),
            "axes.edgecolor": self.muted,
            "grid.color": self.grid,
        }

    @property
    def css(self) -> str:
        """The colours as variables of a page."""
        names = ("paper", "ink", "muted", "grid", "edge", "body", "mass", "hit", "normal",
                 "friction")  # fmt: skip
        colours = {name: getattr(self, name) for name in names} | dict(self.verdicts)
        colours |= {f"c{i}": colour for i, colour in enumerate(self.colours)}
        return " ".join(f"--{name}: {colour};" for name, colour in colours.items())


# Some colours are darker here and lighter below than the original ones: they are of texts too.
LIGHT = Style(
    paper="#ffffff",
    ink="#1c1c1c",
    muted="#5b5b5b",
    grid="#e4e4e4",
    edge="#1f4e79",
    body="#dbe9f3",
    mass="#c1440e",
    hit="#b03a00",
    colours=("#0072b2", "#d55e00", "#007d5b", "#a3457e", "#9a6700", "#2a84b5", "#333333"),
    tints=("#cce3f0", "#f7dfcc", "#b3e2d5", "#f5e4ed", "#faeccc", "#a6d7f3"),
    free="#f4f4f4",
    alarm="#b00020",
)
DARK = Style(
    paper="#14171a",
    ink="#e8e8e8",
    muted="#a9b0b6",
    grid="#31363b",
    edge="#8cc4ec",
    body="#24394a",
    mass="#f2935a",
    hit="#ffb27a",
    colours=("#56b4e9", "#f0843a", "#2cc295", "#e39ac4", "#e6b84c", "#9ad4f5", "#e4e4e4"),
    tints=("#1d4460", "#5a2f14", "#145544", "#56384a", "#534b12", "#3b3566"),
    free="#22272b",
    alarm="#ff6b6b",
)
STYLES = {"light": LIGHT, "dark": DARK}


def style_of(name: str) -> Style:
    """The style of a name; raise OutputError for another one."""
    choice(name, "style", tuple(STYLES), OutputError)
    return STYLES[name]
