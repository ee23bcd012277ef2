"""Options and arguments that several commands take, and how they end."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from dmoc.base.discretisation import ORDERS_SHOWN
from dmoc.cli import completion
from dmoc.solving.methods import SEARCHING, listed

NOT_SOLVED, BAD_INPUT = 1, 2


class Controls(StrEnum):
    constant = "constant"
    linear = "linear"
    stages = "stages"


def out_option(text: str, metavar: str | None = None) -> Any:
    """Where a command writes, with its own help."""
    return typer.Option("-o", "--out", metavar=metavar, help=text)


ModelArgument = Annotated[
    str,
    typer.Argument(
        help="Name of a shipped model or problem, or file.py:name.",
        show_default=False,
        autocompletion=completion.models,
    ),
]
SolutionArgument = Annotated[Path, typer.Argument(help="Solution file (.npz).", show_default=False)]
DarkOption = Annotated[bool, typer.Option("--dark", help="Draw figures on a dark background.")]
JsonOption = Annotated[
    str | None,
    typer.Option(
        "--json",
        metavar="FILE|-",
        help="Write the result as JSON; with - standard output is the JSON alone.",
    ),
]
FinalTimeOption = Annotated[
    str | None,
    typer.Option(
        "--final-time", help="Final time in seconds, or its range, as 0.5:1, or :1 for at most 1."
    ),
]
SequenceOption = Annotated[
    str | None,
    typer.Option(
        autocompletion=completion.surfaces,
        help="Events in their order, with commas between them, as left,right; '' for none. "
        "left is hit and released, +left lands and stays closed, -left leaves, left:stick, "
        "left:slip+ and left:slip- change the friction; several at one event as '+right -left'.",
    ),
]
ContactsOption = Annotated[
    str | None,
    typer.Option(
        autocompletion=completion.surfaces,
        metavar="CONTACTS",
        help="Surfaces that are closed at the start and rails that slide then, as left,rail:slip+; "
        "what has friction sticks unless it is said to slide.",
    ),
]
ViaOption = Annotated[
    str | None,
    typer.Option(
        metavar="PLACES",
        help="Coordinates at the events, values or ranges LOW:HIGH, with ';' between the events, "
        "as 'x=1,y=0.2;;x=2'.",
    ),
]
IgnoredOption = Annotated[
    str | None,
    typer.Option(
        autocompletion=completion.surfaces,
        metavar="SURFACES",
        help="Surfaces that hold nothing back where no event names them, as left,right.",
    ),
]
StepsOption = Annotated[
    str | None,
    typer.Option(help="Steps of each phase, one number or one for each phase, as 100,50."),
]
GuessOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="FILE|NAME=V1,V2,...",
        help="Start from a solution file with the same number of collisions, or along keyframes of "
        "coordinates and inputs, evenly spread over the time, with durations=T1,T2,... in seconds; "
        "repeatable.",
    ),
]
METHOD_HELP = f"Solver: {listed()}"
MethodOption = Annotated[
    str | None,
    typer.Option(
        autocompletion=completion.methods,
        help=f"{METHOD_HELP}; {SEARCHING} if the kernels are compiled.",
    ),
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        autocompletion=completion.parameters,
        metavar="NAME=VALUE",
        help="Parameter value; several with commas, or repeat it.",
    ),
]
BoundOption = Annotated[
    list[str] | None,
    typer.Option(
        autocompletion=completion.bounded,
        metavar="NAME=LOW:HIGH",
        help="Bounds of an input or coordinate; several with commas, or repeat it.",
    ),
]
StartOption = Annotated[
    list[str] | None,
    typer.Option(
        autocompletion=completion.states,
        metavar="NAME=VALUE",
        help="Start state: x, x_dot or p_x; a value, a range LOW:HIGH, or free; several with "
        "commas, or repeat it.",
    ),
]
RestitutionOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="E|SURFACE=E",
        help="Coefficient of restitution, 0 to 1, of all surfaces or of one; several with "
        "commas, as floor=0.8,wall=0.6, or repeat it.",
    ),
]
PeriodicOption = Annotated[
    str | None,
    typer.Option(
        metavar="STATES",
        help="States that end as they start, as y,p_y; free at the start unless given. a=b ends as "
        "b starts, x=x+0.5 that much further, x=x+? any distance further.",
    ),
]
OrderOption = Annotated[
    int | None,
    typer.Option(help=f"Order of the discretisation, one of {ORDERS_SHOWN}; 2 by default."),
]
ControlsOption = Annotated[
    Controls | None,
    typer.Option(
        help="Inputs constant in a step, linear between nodes (order 2 only), or linear in each "
        "step, "
        "with jumps at the nodes (stages, order 4 and more)."
    ),
]
GoalOption = Annotated[
    list[str] | None,
    typer.Option(
        autocompletion=completion.states,
        metavar="NAME=VALUE",
        help="Goal state, like --start; several with commas, or repeat it.",
    ),
]
