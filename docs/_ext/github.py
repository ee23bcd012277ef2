"""Links that lead somewhere on GitHub, where pages are read as they stand: what MyST reads in their
place."""

from __future__ import annotations

import re
from typing import Any

from sphinx.application import Sphinx

FORMS = (
    # An anchor in front of a paragraph is a target.
    (re.compile(r'^<a id="([\w-]+)"></a>\s*', re.MULTILINE), r"(\1)=\n"),
    # The folder of the examples is the gallery.
    (re.compile(r"\]\((?:\.\./)+examples/?\)"), "](/examples/index)"),
)


def read(app: Sphinx, document: str, source: list[str]) -> None:
    for form, instead in FORMS:
        source[0] = form.sub(instead, source[0])


def setup(app: Sphinx) -> dict[str, Any]:
    app.connect("source-read", read)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
