"""The commands together, and how errors leave them."""

from __future__ import annotations

import errno
import io
import sys
import warnings
from typing import Annotated

import typer

from dmoc.base.errors import DmocError
from dmoc.base.files import REMEDY
from dmoc.cli.animate import animate
from dmoc.cli.console import err, out
from dmoc.cli.doctor import doctor, versions
from dmoc.cli.explain import explain
from dmoc.cli.export import export, report
from dmoc.cli.groups import spread
from dmoc.cli.model import build, derive, generate, models
from dmoc.cli.new import new
from dmoc.cli.result import plot, verify
from dmoc.cli.search import search
from dmoc.cli.shared_options import BAD_INPUT
from dmoc.cli.simulate import simulate
from dmoc.cli.solve import solve
from dmoc.cli.sweep import sweep

NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
COMMANDS = (
    new,
    models,
    derive,
    generate,
    build,
    solve,
    search,
    sweep,
    simulate,
    verify,
    plot,
    animate,
    export,
    report,
    doctor,
    explain,
)

app = typer.Typer(
    help="Discrete mechanics and optimal control for mechanical systems with collisions.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for command in COMMANDS:
    app.command()(spread(command))


def _version(asked: bool) -> None:
    if asked:
        out.print(versions())
        raise typer.Exit()


@app.callback()
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
        app(prog_name="dmoc")
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
