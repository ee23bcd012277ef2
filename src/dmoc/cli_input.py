"""What the commands share: consoles, options, reading of values, writing of files."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from dmoc.errors import OutputError, ProblemError

out = Console()
err = Console(stderr=True)
NOT_SOLVED, BAD_INPUT = 1, 2


class Controls(StrEnum):
    constant = "constant"
    linear = "linear"
    stages = "stages"


ModelArgument = Annotated[str, typer.Argument(help="Name of a shipped model or problem, or file.py:name.", show_default=False)]
JsonOption = Annotated[
    str | None,
    typer.Option("--json", metavar="FILE|-", help="Write the result as JSON; with - standard output is the JSON alone."),
]
FinalTimeOption = Annotated[
    str | None, typer.Option("--final-time", help="Largest final time in seconds, or its range, as 0.5:1.")
]
MethodOption = Annotated[str, typer.Option(help="Solver: slsqp, ipm (compiled interior point), ipopt, uno.")]
SetOption = Annotated[list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="Parameter value; repeatable.")]
BoundOption = Annotated[
    list[str] | None, typer.Option(metavar="NAME=LOW:HIGH", help="Bounds of an input or coordinate; repeatable.")
]
StartOption = Annotated[
    list[str] | None,
    typer.Option(metavar="NAME=VALUE", help="Start state: x, x_dot or p_x; a value, a range LOW:HIGH, or free; repeatable."),
]
RestitutionOption = Annotated[
    list[str] | None,
    typer.Option(metavar="E|SURFACE=E", help="Coefficient of restitution, 0 to 1, of all surfaces or of one; repeatable."),
]
PeriodicOption = Annotated[
    str | None, typer.Option(metavar="STATES", help="States that end as they start, as y,p_y; free at the start unless given.")
]
OrderOption = Annotated[int | None, typer.Option(help="Order of the discretisation: 2 (default) or 4.")]
ControlsOption = Annotated[
    Controls | None,
    typer.Option(
        help="Inputs constant in a step, linear between nodes (order 2), or at the two Gauss points of a step (order 4)."
    ),
]
GoalOption = Annotated[list[str] | None, typer.Option(metavar="NAME=VALUE", help="Goal state, like --start; repeatable.")]


# Input ---------------------------------------------------------------------------------------------------------------


def problem_fields(
    defaults: Mapping[str, Any], sequence: str | None, steps: str | None, final_time: str | None, controls: Controls | None,
    set_: list[str] | None, bound: list[str] | None, start: list[str] | None, goal: list[str] | None,
    restitution: list[str] | None, periodic: str | None,
) -> dict[str, Any]:  # fmt: skip
    """Fields of a problem: a model's own, changed by options."""
    fields = dict(defaults)
    if sequence is not None:
        fields["sequence"] = tuple(s for s in sequence.split(",") if s)
    if steps is not None:
        numbers = [read_whole(part, "--steps") for part in steps.split(",")]
        fields["steps"] = numbers[0] if len(numbers) == 1 else numbers
    if final_time is not None:
        fields["final_time"] = (
            read_value(final_time, "--final-time") if ":" in final_time else (None, read_number(final_time, "--final-time"))
        )
    if controls is not None:
        fields["controls"] = controls.value
    if restitution:
        fields["restitution"] = read_restitution(restitution)
    if periodic is not None:
        fields["periodic"] = tuple(s.strip() for s in periodic.split(",") if s.strip())
    for name, given in (("parameters", set_), ("bounds", bound), ("start", start), ("goal", goal)):
        option = {"parameters": "--set", "bounds": "--bound", "start": "--start", "goal": "--goal"}[name]
        pairs = dict(read_pair(text, option) for text in given or [])
        fields[name] = {**fields.get(name, {}), **pairs}
        replace_rest(fields[name], pairs)
    return fields


def replace_rest(values: dict[str, Any], given: dict[str, Any]) -> None:
    """A velocity replaces the default momentum of the same coordinate, and the reverse."""
    for name in given:
        if name.endswith("_dot") and f"p_{name[:-4]}" not in given:
            values.pop(f"p_{name[:-4]}", None)
        if name.startswith("p_") and f"{name[2:]}_dot" not in given:
            values.pop(f"{name[2:]}_dot", None)


def read_restitution(given: list[str]) -> float | dict[str, Any]:
    """Read one number for all surfaces, or SURFACE=E for some."""
    numbers = [text for text in given if "=" not in text]
    if numbers and len(given) > 1:
        raise ProblemError(
            f"--restitution {numbers[0]} stands beside others: give one number for all surfaces, or SURFACE=E for each."
        )
    if numbers:
        return read_number(numbers[0], "--restitution", "expected a number from 0 to 1, or SURFACE=E")
    return dict(read_pair(text, "--restitution") for text in given)


def read_pair(text: str, option: str) -> tuple[str, Any]:
    name, equals, value = text.partition("=")
    if not (name and equals and value):
        raise ProblemError(f"{option} {text}: expected NAME=VALUE.")
    return name.strip(), read_value(value, f"{option} {name.strip()}")


def read_value(text: str, what: str) -> Any:
    """Read a number, a range LOW:HIGH with empty ends open, or free."""
    if text == "free":
        return None
    if ":" in text:
        low, _, high = text.partition(":")
        return (read_number(low, what) if low else None, read_number(high, what) if high else None)
    return read_number(text, what)


def read_number(text: str, what: str, expected: str = "expected a number such as 0.5, or a range such as -1:1") -> float:
    try:
        return float(text)
    except ValueError:
        raise ProblemError(f"{what} = {text!r}: {expected}.") from None


def read_whole(text: str, what: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise ProblemError(f"{what} = {text!r}: expected a whole number.") from None


# Output --------------------------------------------------------------------------------------------------------------


def prepare_folder(folder: Path | None) -> None:
    """Fail before a long solve rather than after it."""
    if folder is None:
        return
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / f".dmoc-{os.getpid()}"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise OutputError(f"{folder} cannot be written ({error.strerror}): choose a writable folder.") from None


def prepare_file(name: str | None) -> None:
    if name in (None, "-"):
        return
    path = Path(str(name))
    try:
        existed = path.exists()
        with path.open("a", encoding="utf-8"):
            pass
        if not existed:
            path.unlink()
    except OSError as error:
        raise OutputError(f"{name} cannot be written ({error.strerror}): choose a file in a writable folder.") from None


def write_text(path: Path, text: str) -> None:
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise OutputError(f"{path} cannot be written ({error.strerror}): choose a writable place.") from None


def emit(summary: dict[str, Any], target: str | None) -> None:
    text = json.dumps(finite(summary), indent=2) + "\n"
    if target == "-":
        sys.stdout.write(text)
    elif target is not None:
        write_text(Path(target), text)


def finite(value: Any) -> Any:
    """JSON has no infinity: what is not finite becomes null."""
    if isinstance(value, dict):
        return {k: finite(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(v) for v in value]
    if isinstance(value, float) and value - value != 0.0:
        return None
    return value
