"""Values and paths as messages show them, and paths that users give; what every command loads, so
that nothing here needs NumPy."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

from dmoc.base.errors import DmocError, OutputError

LONGEST_TEXT = 60  # of a value shown in a message
LONGEST_PLACE = 150  # of a path in a message, which is told by its end
LONGEST_PATH = 4096  # that an operating system takes
ADDRESS = re.compile(r" at 0x[0-9a-fA-F]+")  # of an object in memory: it says nothing to a reader


def shown(value: Any) -> str:
    """A value as a message shows it: in one line and not longer than a line."""
    try:
        text = ADDRESS.sub("", " ".join(repr(value).split()))
    # an integer of more than 4300 digits, or a foreign class: the message must come all the same
    except Exception:
        text = f"a value of type {type(value).__name__}"
    return text if len(text) <= LONGEST_TEXT else text[: LONGEST_TEXT - 1] + "…"


def path(value: Any, what: str = "path", error: type[DmocError] = OutputError) -> Path:
    """Read the path of a file that is to be written or read."""
    try:
        name = os.fspath(value)
        fits = isinstance(name, str) and 0 < len(os.fsencode(name)) <= LONGEST_PATH
    except Exception:  # no path, or one that no file system can hold
        fits = False
    if not fits or "\0" in name:
        raise error(f"{what} = {shown(value)}: expected the path of a file, as a text or a Path.")
    return Path(name)


def place(path: Path | str) -> str:
    """A path as a message shows it: in one line, of a long one the end."""
    text = "".join(c if c.isprintable() else "?" for c in str(path))
    return text if len(text) <= LONGEST_PLACE else "…" + text[1 - LONGEST_PLACE :]
