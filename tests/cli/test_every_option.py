"""Every option of every command with values that it can hardly mean: one sentence, no traceback."""

from __future__ import annotations

from typing import Any

import pytest
import typer
from commands import Run

from dmoc.base.errors import DmocError
from dmoc.cli.app import command_line
from dmoc.program.layout import Layout

VALUES = ("", "nonsense", "-1", "nan", "1e999", "=", "l=", "l=1,l=2", "::", "ü;,", "9" * 20)
# What else a command needs before it looks at its options, or soon comes to its end with.
BEFORE = {
    "simulate": ("--final-time", "0.1"), "sweep": ("--set", "g=9:10:2"),
    "search": ("--max-collisions", "0"), "fit": ("--parameter", "g=1:20"),
}  # fmt: skip
# They derive a model, which takes long, or write where they are told to.
LEFT_OUT = {"derive", "generate", "build", "new"}


def options() -> list[tuple[str, str]]:
    """Commands and their options that take a value."""
    commands: dict[str, Any] = vars(typer.main.get_command(command_line()))["commands"]
    return [
        (name, parameter.opts[-1])
        for name, command in commands.items()
        for parameter in command.params
        if name not in LEFT_OUT and parameter.opts[-1].startswith("-") and not parameter.is_flag
    ]


@pytest.mark.slow
@pytest.mark.parametrize(("command", "option"), options())
def test_an_option_with_a_strange_value_ends_with_one_sentence(
    run: Run, monkeypatch: pytest.MonkeyPatch, command: str, option: str
) -> None:
    def nothing_is_solved(*_: object) -> Layout:
        raise DmocError("nothing is solved here.")

    monkeypatch.setattr(Layout, "of", nothing_is_solved)
    for value in VALUES:
        before = [word for word in BEFORE.get(command, ()) if option not in BEFORE[command]]
        argument = [] if command == "doctor" else ["cart_pendulum"]
        code, out, err = run(command, *argument, *before, f"{option}={value}")
        assert code in (0, 1, 2) and "Traceback" not in out + err, (value, out, err)
        assert code != 2 or err.lower().count("error") >= 1, (value, out, err)
        assert len(err.splitlines()) <= 20, (value, err)


@pytest.mark.parametrize("option", ["--set", "--bound", "--start", "--goal", "--restitution"])
@pytest.mark.parametrize("command", ["solve", "search", "sweep"])
@pytest.mark.parametrize("values", [("a=1", "a=2"), ("a=1,a=2",), ("a=0:1:5", "a=1:2:3")])
def test_two_values_of_one_name_are_refused(
    run: Run, command: str, option: str, values: tuple[str, ...]
) -> None:
    words = [word for value in values for word in (option, value)]
    more = ("--set", "g=9:10:2") if command == "sweep" else ()
    code, _, err = run(f"{command} cart_pendulum", *words, *more)
    is_range = values[0].count(":") == 2
    assert code == 2 and err.count("error:") == 1
    assert "is given twice" in err or (is_range and "expected a number" in err), err
