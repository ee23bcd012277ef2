"""A film as one page that plays by itself: style, script and document in one file, and nothing that
it would have to fetch."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from html import escape
from importlib.resources import files

from dmoc.report.animation.colours import as_css
from dmoc.report.animation.film import Film

# In the order in which they need each other.
SCRIPTS = ("values", "elements", "clock", "picture", "curves", "tree", "player")


def page_of(film: Film) -> str:
    """The text of a page that plays a film.

    Its policy lets a browser run the page's own script alone, and fetch nothing.
    """
    script = "\n".join(_source(f"{name}.js") for name in SCRIPTS)
    filled = {
        "title": escape(film["title"]),
        "style": as_css() + _source("page.css"),
        "script": script,
        "film": _document(film),
        "policy": f"default-src 'none'; style-src 'unsafe-inline'; script-src '{_digest(script)}'",
    }
    # What is filled in is not read again: names of a model may look like places to fill.
    return re.sub(r"\{\{(\w+)\}\}", lambda place: filled[place[1]], _source("page.html"))


def _source(name: str) -> str:
    """A file of the player."""
    return (files("dmoc.report.animation") / "player" / name).read_text(encoding="utf-8")


def _document(film: Film) -> str:
    """A film as JSON in which no text can end the element that holds it."""
    text = json.dumps(film, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c")


def _digest(script: str) -> str:
    """What a policy calls a script that may run."""
    return "sha256-" + base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
