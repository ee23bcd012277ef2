"""The commands together, and how errors leave them."""

from __future__ import annotations

import errno
import io
import os
import sys
import warnings
from collections.abc import Callable, Sequence
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING

from dmoc.base.errors import DmocError
from dmoc.base.files import REMEDY
from dmoc.cli.console import err
from dmoc.cli.groups import spread
from dmoc.cli.plain_words import values_of
from dmoc.cli.shared_options import BAD_INPUT, NOT_SOLVED

if TYPE_CHECKING:
    from typer import Typer

COMPLETION = "_DMOC_COMPLETE"  # set by the shell that asks for words
NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
# The commands and their modules, of which a call loads one, and help all.
COMMANDS = {
    "new": "new", "models": "model", "derive": "model", "generate": "model", "build": "model",
    "solve": "solve", "search": "search", "sweep": "sweep", "simulate": "simulate",
    "prove": "prove", "fit": "fit", "verify": "result", "plot": "result", "animate": "animate",
    "export": "export", "report": "export", "doctor": "doctor", "explain": "explain",
}  # fmt: skip


def command_line(words: Sequence[str] = ()) -> Typer:
    """The command that words begin with, or all commands, for Typer."""
    first = next((word for word in words if not word.startswith("-")), "")
    return _for_typer(tuple([first] if first in COMMANDS else COMMANDS))


@cache
def _for_typer(names: tuple[str, ...]) -> Typer:
    from dmoc.cli.typed import application  # Typer takes longer to load than a solve

    return application({name: _command(name) for name in names})


@cache
def _command(name: str) -> Callable[..., None]:
    return spread(getattr(import_module(f"dmoc.cli.{COMMANDS[name]}"), name))


def _run(words: Sequence[str]) -> None:
    """Do what words say: plain ones at once, and whatever else Typer makes of them."""
    if words and words[0] in COMMANDS and COMPLETION not in os.environ:
        command = _command(words[0])
        values = values_of(command, words[1:])
        if values is not None:
            command(**values)
            sys.exit(0)
    command_line(words)(prog_name="dmoc")


def main() -> None:
    """Run the command line; errors become one sentence and exit status 2."""
    debug = "--debug" in sys.argv
    if debug:
        sys.argv.remove("--debug")  # so that it may stand anywhere
    else:
        warnings.showwarning = lambda message, *_, **__: err.print(
            f"warning: {message}", soft_wrap=True
        )
    try:
        _run(sys.argv[1:])
    except (DmocError, OSError) as error:
        if isinstance(error, BrokenPipeError):  # nobody reads any further
            sys.stdout = io.StringIO()
            sys.exit(NOT_SOLVED)
        if debug or (isinstance(error, OSError) and error.errno not in NO_ROOM):
            raise
        what = (
            f"{error} ({error.help})"
            if isinstance(error, DmocError)
            else f"standard output cannot be written ({error.strerror}): {REMEDY}."
        )
        err.print(f"error: {what}", style="red", soft_wrap=True)
        if isinstance(error, OSError):
            sys.stdout = io.StringIO()  # Python would try once more, and complain, when it ends
        sys.exit(BAD_INPUT)
    except KeyboardInterrupt:
        err.print("interrupted")
        sys.exit(130)
