"""The directive ``diagram``: a figure of drawings.py on light and on dark pages, with its caption.

Figures are drawn when the manual is built, once for every change of their code.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib
from docutils import nodes
from drawings import DRAWINGS
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from dmoc.report.style import STYLES

FOLDER = "diagrams"  # beside the pages, made by the build
CODE = "drawings.py", "strokes.py"


class Diagram(SphinxDirective):
    """A figure by name; its content is the caption."""

    required_arguments = 1
    has_content = True

    def run(self) -> list[nodes.Node]:
        name = self.arguments[0]
        if name not in DRAWINGS:
            raise self.error(f"no diagram {name!r}: expected one of {', '.join(DRAWINGS)}")
        text = " ".join(self.content)
        figure = nodes.figure()
        for style in STYLES:
            uri = f"/{FOLDER}/{name}-{style}.svg"
            figure += nodes.image(uri=uri, alt=text, classes=[f"only-{style}"])
        caption, messages = self.parse_inline(text, lineno=self.lineno)
        figure += nodes.caption(text, "", *caption)
        return [figure, *messages]


def draw(app: Sphinx) -> None:
    """Write the figures that are older than their code."""
    folder = Path(app.srcdir) / FOLDER
    code = max(Path(__file__).with_name(name).stat().st_mtime for name in CODE)
    folder.mkdir(exist_ok=True)
    fonts = {"mathtext.fontset": "stix", "svg.hashsalt": "dmoc", "font.size": 10}
    for name, drawing in DRAWINGS.items():
        for word, style in STYLES.items():
            path = folder / f"{name}-{word}.svg"
            if path.exists() and path.stat().st_mtime > code:
                continue
            with matplotlib.rc_context({**fonts, **style.settings}):
                figure = drawing(style)
                figure.savefig(path, metadata={"Date": None}, facecolor=style.paper)


def setup(app: Sphinx) -> dict[str, Any]:
    app.add_directive("diagram", Diagram)
    app.connect("builder-inited", draw)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
