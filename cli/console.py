"""Consoles, and the writing of results: texts, JSON, figures."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rich.console import Console

from dmoc.base.errors import DmocError
from dmoc.base.files import check_file, check_folder, write_whole

# What is printed is never read as markup: names, units and messages have brackets and colons of
# their own.  Colours are Text objects.
out = Console(markup=False, emoji=False, highlight=False)
err = Console(markup=False, emoji=False, highlight=False, stderr=True)


def prepare(folder: Path | None, json_: str | None) -> None:
    """Fail before a long solve rather than after it."""
    if folder is not None:
        check_folder(folder)
    if json_ not in (None, "-"):
        check_file(Path(str(json_)))


def emit(summary: dict[str, Any], target: str | None) -> None:
    text = json.dumps(finite(summary), indent=2) + "\n"
    if target == "-":
        print_text(text)
    elif target is not None:
        write_whole(Path(target), text.encode())


def finite(value: Any) -> Any:
    """A value as JSON has it: lists for arrays, and null for numbers that are not finite."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, dict):
        return {k: finite(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(v) for v in value]
    if isinstance(value, float) and value - value != 0.0:
        return None
    return value


def in_turn(*actions: Callable[[], None]) -> None:
    """Do all of them, so that the failure of one loses nothing of the others; then raise the
    first error."""
    errors = []
    for action in actions:
        try:
            action()
        except (DmocError, OSError) as error:
            errors.append(error)
    if errors:
        raise errors[0]


def style_of(dark: bool) -> str:
    return "dark" if dark else "light"


def draw(path: Path | None, figure: Callable[..., object], quiet: bool, dark: bool) -> None:
    """Draw a figure of a result that is kept already, if there is a place for it: what goes wrong
    is a note."""
    if path is None:
        return
    try:
        figure(path, style=style_of(dark))
    except Exception as error:
        text = str(error) if isinstance(error, DmocError) else f"{type(error).__name__}: {error}"
        err.print(f"note: {path} was not drawn: {text}", soft_wrap=True)
    else:
        if not quiet:
            written(path)


def written(*paths: Path) -> None:
    for path in paths:
        out.print(f"written: {path}", soft_wrap=True)


def print_text(text: str) -> None:
    sys.stdout.write(text)
    sys.stdout.flush()  # where the room is used up this fails here, not when Python ends
