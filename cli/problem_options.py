"""Options that state a problem, each with the field that it states and how its text is read."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from typing import Annotated, Any, get_type_hints

import typer

from dmoc.base.discretisation import ORDERS_SHOWN
from dmoc.cli import completion
from dmoc.cli.option_values import (
    read_names,
    read_pairs,
    read_periodic,
    read_restitution,
    read_steps,
    read_value,
    read_via,
)


class Controls(StrEnum):
    constant = "constant"
    linear = "linear"
    stages = "stages"


@dataclass(frozen=True)
class Stated:
    """What an option states: a field of a problem, by a function of its text; or, with its name in
    messages, values of a field by name, which change those that a model comes with."""

    field: str
    read: Callable[[Any], Any] = read_names
    option: str = ""


SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        autocompletion=completion.parameters,
        metavar="NAME=VALUE",
        help="Parameter value; several with commas, or repeat it.",
    ),
    Stated("parameters", option="--set"),
]
RestitutionOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="E|SURFACE=E",
        help="Coefficient of restitution, 0 to 1, of all surfaces or of one; several with "
        "commas, as floor=0.8,wall=0.6, or repeat it.",
    ),
    Stated("restitution", read_restitution),
]
OrderOption = Annotated[
    int | None,
    typer.Option(help=f"Order of the discretisation, one of {ORDERS_SHOWN}; 2 by default."),
]


@dataclass(frozen=True)
class CourseOptions:
    """What happens, in how many steps, and where."""

    sequence: Annotated[
        str | None,
        typer.Option(
            autocompletion=completion.surfaces,
            help="Events in their order, with commas between them, as left,right; '' for none. "
            "left is hit and released, +left lands and stays closed, -left leaves, left:stick, "
            "left:slip+ and left:slip- change the friction; several at one event as "
            "'+right -left'.",
        ),
        Stated("sequence"),
    ] = None
    steps: Annotated[
        str | None,
        typer.Option(help="Steps of each phase, one number or one for each phase, as 100,50."),
        Stated("steps", read_steps),
    ] = None
    via: Annotated[
        str | None,
        typer.Option(
            metavar="PLACES",
            help="Coordinates at the events, values or ranges LOW:HIGH, with ';' between the "
            "events, as 'x=1,y=0.2;;x=2'.",
        ),
        Stated("via", read_via),
    ] = None


@dataclass(frozen=True)
class ProblemOptions:
    """What else a problem has, whatever its sequence."""

    final_time: Annotated[
        str | None,
        typer.Option(help="Final time in seconds, or its range, as 0.5:1, or :1 for at most 1."),
        Stated("final_time", partial(read_value, what="--final-time")),
    ] = None
    order: OrderOption = None
    controls: Annotated[
        Controls | None,
        typer.Option(
            help="Inputs constant in a step, linear between nodes (order 2 only), or linear in "
            "each step, with jumps at the nodes (stages, order 4 and more)."
        ),
        Stated("controls", str),
    ] = None
    set_: SetOption = None
    bound: Annotated[
        list[str] | None,
        typer.Option(
            autocompletion=completion.bounded,
            metavar="NAME=LOW:HIGH",
            help="Bounds of an input or coordinate; several with commas, or repeat it.",
        ),
        Stated("bounds", option="--bound"),
    ] = None
    start: Annotated[
        list[str] | None,
        typer.Option(
            autocompletion=completion.states,
            metavar="NAME=VALUE",
            help="Start state: x, x_dot or p_x; a value, a range LOW:HIGH, or free; several with "
            "commas, or repeat it.",
        ),
        Stated("start", option="--start"),
    ] = None
    goal: Annotated[
        list[str] | None,
        typer.Option(
            autocompletion=completion.states,
            metavar="NAME=VALUE",
            help="Goal state, like --start; several with commas, or repeat it.",
        ),
        Stated("goal", option="--goal"),
    ] = None
    restitution: RestitutionOption = None
    periodic: Annotated[
        str | None,
        typer.Option(
            metavar="STATES",
            help="States that end as they start, as y,p_y; free at the start unless given. a=b "
            "ends as b starts, x=x+0.5 that much further, x=x+? any distance further.",
        ),
        Stated("periodic", read_periodic),
    ] = None
    contacts: Annotated[
        str | None,
        typer.Option(
            autocompletion=completion.surfaces,
            metavar="CONTACTS",
            help="Surfaces that are closed at the start and rails that slide then, as "
            "left,rail:slip+; what has friction sticks unless it is said to slide.",
        ),
        Stated("contacts"),
    ] = None
    ignored: Annotated[
        str | None,
        typer.Option(
            autocompletion=completion.surfaces,
            metavar="SURFACES",
            help="Surfaces that hold nothing back where no event names them, as left,right.",
        ),
        Stated("ignored"),
    ] = None


def stated_by(*groups: Any) -> Iterator[tuple[str, Stated, Any]]:
    """Options that state a field of a problem: name, what they state, and what they were given."""
    for group in groups:
        for name, hint in get_type_hints(type(group), include_extras=True).items():
            for stated in hint.__metadata__:
                if isinstance(stated, Stated):
                    yield name, stated, getattr(group, name)


def problem_fields(defaults: Mapping[str, Any], *groups: Any) -> dict[str, Any]:
    """Fields of a problem: a model's own, changed by options."""
    fields = dict(defaults)
    for _, stated, given in stated_by(*groups):
        if stated.option:
            pairs = read_pairs(given, stated.option)
            fields[stated.field] = {**fields.get(stated.field, {}), **pairs}
            _replace_rest(fields[stated.field], pairs)
        elif given not in (None, []):
            fields[stated.field] = stated.read(given)
    return fields


def _replace_rest(values: dict[str, Any], chosen: Mapping[str, Any]) -> None:
    """A velocity replaces the default momentum of the same coordinate, and the reverse."""
    for name in chosen:
        if name.endswith("_dot") and f"p_{name[:-4]}" not in chosen:
            values.pop(f"p_{name[:-4]}", None)
        if name.startswith("p_") and f"{name[2:]}_dot" not in chosen:
            values.pop(f"{name[2:]}_dot", None)
