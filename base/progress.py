"""Progress, told to a function or shown in a line: on a terminal, in a notebook, or as plain
lines."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from importlib import import_module
from typing import Any, Literal, TypeAlias, TypeVar

from dmoc.base.arguments import ErrorKind, function, shown
from dmoc.base.deadline import Deadline
from dmoc.base.errors import ProblemError

P = TypeVar("P")
# What every function with progress takes: a function of what is told, or where it is shown.
Listener: TypeAlias = Callable[[P], object] | bool | Literal["lines"] | None
Line: TypeAlias = Callable[[str], None]
BETWEEN_LINES, BETWEEN_SHOWS = 1.0, 0.2  # seconds


@contextmanager
def listener(
    progress: Listener[P], first: str, error: ErrorKind = ProblemError
) -> Iterator[Callable[[P], object] | None]:
    """Yield the function that is to be called with progress; None where nobody wants it.

    True shows its text on standard error, in a line that is written over, if that is a terminal,
    and below the cell of a notebook; elsewhere nothing is shown.  "lines" writes a line of text to
    standard error every second, wherever that leads.  ``first`` is shown until something is told.
    """
    if callable(progress):
        yield function(progress, "progress", "what is told", error)
        return
    lines = isinstance(progress, str) and progress == "lines"
    if not (progress is None or isinstance(progress, bool) or lines):
        raise error(
            f"progress = {shown(progress)}: expected a function of one argument, True, False, "
            "'lines' or None."
        )
    line = _lines() if lines else _live() if progress else None
    if line is None:
        yield None
        return
    with line as show:
        show(first)
        yield lambda news: show(str(news))


def _live() -> AbstractContextManager[Line] | None:
    """A line that is written over, where there is a place for one."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    if hasattr(shell, "kernel"):
        return _in_notebook()
    return _on_terminal() if sys.stderr.isatty() else None


@contextmanager
def _on_terminal() -> Iterator[Line]:
    from rich.console import Console
    from rich.text import Text  # no markup is read: names have brackets

    with Console(stderr=True).status(Text("")) as status:
        yield lambda text: status.update(Text(text))


@contextmanager
def _in_notebook() -> Iterator[Line]:
    display: Any = import_module("IPython.display").display
    handle = display({"text/plain": ""}, raw=True, display_id=True)

    def write(text: str) -> None:
        handle.update({"text/plain": text}, raw=True)

    try:
        yield _seldom(write, BETWEEN_SHOWS)
    finally:
        write("")


@contextmanager
def _lines() -> Iterator[Line]:
    yield _seldom(lambda text: print(text, file=sys.stderr, flush=True), BETWEEN_LINES)


def _seldom(write: Line, between: float) -> Line:
    """A line that leaves out what comes within some seconds of what was written."""
    due = Deadline(0.0)

    def show(text: str) -> None:
        nonlocal due
        if due.passed:
            write(text)
            due = Deadline.after(between)

    return show
