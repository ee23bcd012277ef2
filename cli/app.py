"""The commands together, and how errors leave them."""

from __future__ import annotations

import errno
import io
import sys
import warnings
from collections.abc import Sequence
from functools import cache
from importlib import import_module
from typing import Annotated

import typer

from dmoc.base.errors import DmocError
from dmoc.base.files import REMEDY
from dmoc.cli.console import err, out
from dmoc.cli.groups import spread
from dmoc.cli.shared_options import BAD_INPUT

NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
# The commands and their modules, of which a call loads one, and help all.
COMMANDS = {
    "new": "new", "models": "model", "derive": "model", "generate": "model", "build": "model",
    "solve": "solve", "search": "search", "sweep": "sweep", "simulate": "simulate",
    "verify": "result", "plot": "result", "animate": "animate", "export": "export",
    "report": "export", "doctor": "doctor", "explain": "explain",
}  # fmt: skip


def command_line(words: Sequence[str] = ()) -> typer.Typer:
    """The command that words begin with, or all commands."""
    first = next((word for word in words if not word.startswith("-")), "")
    return _app(tuple([first] if first in COMMANDS else COMMANDS))


@cache
def _app(commands: tuple[str, ...]) -> typer.Typer:
    app = typer.Typer(
        help="Discrete mechanics and optimal control for mechanical systems with collisions.",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
        callback=_options,
    )
    for name in commands:
        module = import_module(f"dmoc.cli.{COMMANDS[name]}")
        app.command()(spread(getattr(module, name)))
    return app


def _version(asked: bool) -> None:
    if asked:
        from dmoc.cli.doctor import versions

        out.print(versions())
        raise typer.Exit()


def _options(
    debug: Annotated[bool, typer.Option("--debug", help="Show tracebacks of errors.")] = False,
    version: Annotated[
        bool,
        typer.Option(
            "--version", "-V", callback=_version, is_eager=True, help="Show versions and backend."
        ),
    ] = False,
) -> None:
    del debug, version  # read before anything can fail


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
        command_line(sys.argv[1:])(prog_name="dmoc")
    except (DmocError, OSError) as error:
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
