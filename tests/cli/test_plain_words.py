"""Command lines that are read without Typer mean what Typer makes of them."""

from __future__ import annotations

import contextlib
import errno
import subprocess
import sys
from collections.abc import Callable
from enum import StrEnum
from functools import wraps
from importlib import import_module
from inspect import signature
from typing import Any

import pytest
import typer.main
from commands import Run

from dmoc.cli.app import COMMANDS
from dmoc.cli.groups import spread
from dmoc.cli.plain_words import Parameter, values_of
from dmoc.cli.typed import typed

VALUES = (
    "1", "0.5", "1e3", "-1", "", "x", "a=1,b=2", "9" * 20, "1_0", "nan", "-", "--", " 1", "1.5.2",
)  # fmt: skip


def command_of(name: str) -> Callable[..., None]:
    return spread(getattr(import_module(f"dmoc.cli.{COMMANDS[name]}"), name))


class ByTyper:
    """What Typer calls a command with."""

    def __init__(self, name: str) -> None:
        @wraps(command_of(name))
        def kept(**values: Any) -> None:
            self.values = values

        app = typer.Typer(pretty_exceptions_enable=False, add_completion=False)
        app.command()(typed(kept))
        self.command: Any = typer.main.get_command(app)

    def __call__(self, words: list[str]) -> dict[str, Any] | None:
        self.values: dict[str, Any] | None = None
        with contextlib.suppress(SystemExit):
            self.command(words)
        return self.values


@pytest.mark.parametrize("name", COMMANDS)
def test_plain_words_mean_what_typer_makes_of_them(name: str) -> None:
    command, by_typer, plain = command_of(name), ByTyper(name), set[str]()
    parameters = [Parameter.of(p) for p in signature(command).parameters.values()]
    needed = [f"{p.name}.npz" for p in parameters if p.words.argument]
    lines = [[], needed, [*needed, "more"], ["--nothing", *needed], ["--help"]]
    for p in parameters:
        texts = [*VALUES, *p.type] if issubclass(p.type, StrEnum) else VALUES
        for option in () if p.words.argument else p.words.options(p.name):
            lines += [[*needed, option], [option, *needed], [*needed, option, option]]
            lines += [[*needed, option, value] for value in texts]
            lines += [[f"{option}={value}", *needed, f"{option}={value}"] for value in VALUES[:3]]
            lines += [[f"{option}={value}", *needed] for value in texts]
    for words in lines:
        values = values_of(command, words)
        if values is not None:
            plain |= {word.partition("=")[0] for word in words}
            assert values == by_typer(words), words
    options = {o for p in parameters if not p.words.argument for o in p.words.options(p.name)}
    assert options <= plain


@pytest.mark.parametrize(
    "words",
    [
        "solve cart_pendulum --method ipm --json - --steps 20 --set m_p=1 --set l=2",
        "search puck_table -v --max-collisions=2 -o tree",
        "derive cart_pendulum --format latex --order 4 --expanded",
        "animate one.npz two.npz --fps 30 --speed 0.5 --dark",
        "explain no C compiler",
    ],
)
def test_usual_command_lines_need_no_typer(words: str) -> None:
    name, *more = words.split()
    values = values_of(command_of(name), more)
    assert values is not None and values == ByTyper(name)(more)


def test_a_command_that_is_plain_does_not_load_typer() -> None:
    code = (
        "import sys; from dmoc.__main__ import main; sys.argv = ['dmoc', 'models']\n"
        "try: main()\nexcept SystemExit as end: print(end.code, 'typer' in sys.modules)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.splitlines()[-1] == "0 False" and "cart_pendulum" in run.stdout


def test_a_pipe_that_nobody_reads_ends_a_command_quietly(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def closed(text: str) -> None:
        raise BrokenPipeError(errno.EPIPE, "Broken pipe")

    monkeypatch.setattr("dmoc.cli.console.print_text", closed)
    assert run("doctor --json") == (1, "", "")
