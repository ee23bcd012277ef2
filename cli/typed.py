"""Commands for Typer: help, completion, and what is wrong with a command line."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from functools import wraps
from typing import Annotated, Any, get_args

import typer

from dmoc.cli.console import out
from dmoc.cli.words import Words


def application(commands: Mapping[str, Callable[..., None]]) -> typer.Typer:
    """Spread commands as one application."""
    app = typer.Typer(
        help="Discrete mechanics and optimal control for mechanical systems with collisions.",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
        callback=_options,
    )
    for command in commands.values():
        app.command()(typed(command))
    return app


def typed(command: Callable[..., None]) -> Callable[..., None]:
    """A spread command whose signature Typer reads."""
    signature = inspect.signature(command)
    parameters = [p.replace(annotation=_typed(p)) for p in signature.parameters.values()]

    @wraps(command)
    def called(**values: Any) -> None:
        command(**values)

    read: Any = called
    read.__signature__ = signature.replace(parameters=parameters)
    read.__annotations__ = {p.name: p.annotation for p in parameters}
    return called


def _typed(parameter: inspect.Parameter) -> Any:
    kind, words = get_args(parameter.annotation)
    about = {
        "help": words.help, "metavar": words.metavar, "autocompletion": _completed(words)
    }  # fmt: skip
    if words.argument:
        return Annotated[kind, typer.Argument(show_default=False, **about)]
    return Annotated[kind, typer.Option(*words.options(parameter.name), **about)]


def _completed(words: Words) -> Callable[..., Any] | None:
    """The completion that the shell proposes, as a function whose annotations Typer reads."""
    completed = words.completed
    if completed is None or "context" not in inspect.signature(completed).parameters:
        return completed

    def called(context: Any, incomplete: str) -> Any:
        return completed(context, incomplete)

    called.__annotations__ = {"context": typer.Context, "incomplete": str}
    return called


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
