"""Colours of a mechanism, which a page, a GIF and an mp4 draw alike."""

from __future__ import annotations

from typing import NamedTuple

from dmoc.report.style import VERDICTS


class Colours(NamedTuple):
    """What is drawn in which colour."""

    ground: str
    text: str
    quiet: str
    edge: str
    body: str
    mass: str
    hit: str
    normal: str
    friction: str


LIGHT = Colours("#ffffff", "#1c1c1c", "#5b5b5b", "#1f4e79", "#dbe9f3", "#c1440e", "#b03a00",
                "#00785a", "#a3457e")  # fmt: skip
DARK = Colours("#14171a", "#ececec", "#a9b0b6", "#8cc4ec", "#24394a", "#f2935a", "#ffb27a",
               "#3fd0a4", "#e39ac4")  # fmt: skip


def as_css() -> str:
    """The colours of both themes and of verdicts as variables of a page."""
    light, dark = LIGHT._asdict() | VERDICTS, DARK._asdict()
    return "".join(
        f"{which} {{ {' '.join(f'--{name}: {colour.lower()};' for name, colour in of.items())} }}\n"
        for which, of in ((":root", light), (':root[data-theme="dark"]', dark))
    )
