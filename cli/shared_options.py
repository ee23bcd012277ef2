"""Options and arguments that several commands take, and how they end."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from dmoc.cli import completion
from dmoc.cli.words import argument, option

NOT_SOLVED, BAD_INPUT = 1, 2


def out_option(text: str, metavar: str | None = None) -> Any:
    """The option for the place to which a command writes, with its own help."""
    return option("-o", "--out", metavar=metavar, help=text)


ModelArgument = Annotated[
    str,
    argument(
        help="Name of a shipped model or problem, or file.py:name.",
        completed=completion.models,
    ),
]
SolutionArgument = Annotated[Path, argument(help="Solution file (.npz).")]
DarkOption = Annotated[bool, option("--dark", help="Draw figures on a dark background.")]
JsonOption = Annotated[
    str | None,
    option(
        "--json",
        metavar="FILE|-",
        help="Write the result as JSON; with - standard output is the JSON alone.",
    ),
]
GuessOption = Annotated[
    list[str] | None,
    option(
        metavar="FILE|NAME=V1,V2,...",
        help="Start from a solution file with the same number of collisions, or along keyframes of "
        "coordinates and inputs, evenly spread over the time, with durations=T1,T2,... in seconds; "
        "repeatable.",
    ),
]
