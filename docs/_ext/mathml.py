"""Formulas as MathML, which browsers show without a script and without the network, in a font that
is made for them."""

from __future__ import annotations

import logging
import re
from importlib.resources import files
from pathlib import Path
from typing import Any

from docutils import nodes
from fontTools.subset import Options, Subsetter
from fontTools.ttLib import TTFont
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.util.math import get_node_equation_number

FONT = files("ziamath") / "fonts" / "STIXTwoMath-Regular.ttf"
# Latin, Greek, punctuation, accents, letter-like symbols, arrows, operators, fences, and the
# letters of mathematics.
LETTERS = [
    *range(0x20, 0x17F),
    *range(0x2B0, 0x400),
    *range(0x2000, 0x2070),
    *range(0x20D0, 0x2110),
    *range(0x2110, 0x2150),
    *range(0x2190, 0x2300),
    *range(0x2308, 0x2330),
    *range(0x23B0, 0x23E0),
    *range(0x27E0, 0x27F0),
    *range(0x1D400, 0x1D800),
]


def mathml(latex: str, display: str) -> str:
    """MathML of a formula; the converter knows ``align*`` inside of formulas, not ``aligned``."""
    text = str(convert(re.sub(r"\{aligned\}", "{align*}", latex), display=display))
    left = re.findall(r">(\\[a-zA-Z]+)<", text)
    if left:
        raise ValueError(f"the formula {latex!r} has {left[0]}, which the converter does not know")
    return text


def inline(self: Any, node: nodes.math) -> None:
    self.body.append(mathml(node.astext(), "inline"))
    raise nodes.SkipNode


def block(self: Any, node: nodes.math_block) -> None:
    self.body.append(self.starttag(node, "div", CLASS="math notranslate nohighlight"))
    self.body.append(f'<div class="formula">{mathml(node.astext(), "block")}</div>')
    if node["number"]:
        self.body.append(f'<span class="eqno">({get_node_equation_number(self, node)})')
        self.add_permalink_ref(node, "Link to this equation")
        self.body.append("</span>")
    self.body.append("</div>\n")
    raise nodes.SkipNode


def write_font(app: Sphinx, failed: Exception | None) -> None:
    """Write what pages need of the font beside the style sheets."""
    target = Path(app.outdir) / "_static" / "math.woff"
    if failed or app.builder.format != "html" or target.exists():
        return
    logging.getLogger("fontTools").setLevel(logging.WARNING)
    options = Options(flavor="woff", layout_features=["*"])
    font = TTFont(str(FONT))
    subsetter = Subsetter(options)
    subsetter.populate(unicodes=LETTERS)
    subsetter.subset(font)
    font.flavor = "woff"
    font.save(target)


def setup(app: Sphinx) -> dict[str, Any]:
    app.add_html_math_renderer("mathml", (inline, None), (block, None))
    app.connect("build-finished", write_font)
    return {"version": "3", "parallel_read_safe": True, "parallel_write_safe": True}
