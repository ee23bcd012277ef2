"""Options that state a problem, each with the field that it states and how its text is read."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from enum import StrEnum
from functools import partial
from typing import TYPE_CHECKING, Any

from dmoc.base.discretisation import ORDERS_SHOWN
from dmoc.cli import completion
from dmoc.cli.groups import STATED, Stated, stated
from dmoc.cli.option_values import (
    read_durations,
    read_events,
    read_names,
    read_pairs,
    read_periodic,
    read_restitution,
    read_steps,
    read_value,
    read_via,
)

if TYPE_CHECKING:
    from dmoc.models.registry import Reference
    from dmoc.problem.problem import Problem


class Controls(StrEnum):
    constant = "constant"
    linear = "linear"
    stages = "stages"


@dataclass(frozen=True)
class CourseOptions:
    """What happens, in how many steps, and where."""

    sequence: str | None = stated(
        "Events in their order, with commas between them, as left,right; '' for none. "
        "left is hit and released, +left lands and stays closed, -left leaves, left:stick, "
        "left:slip+ and left:slip- change the friction; several at one event as '+right -left'.",
        Stated("sequence", read_events),
        completed=completion.surfaces,
    )
    steps: str | None = stated(
        "Steps of each phase, one number or one for each phase, as 100,50.",
        Stated("steps", read_steps),
    )
    durations: str | None = stated(
        "Durations of the phases in seconds, values or ranges LOW:HIGH with commas between them, "
        "free for any; 0 for the last one ends the motion with its last event, as free,0.",
        Stated("durations", read_durations),
        metavar="SECONDS",
    )
    via: str | None = stated(
        "Coordinates at the events, values or ranges LOW:HIGH, with ';' between the events, as "
        "'x=1,y=0.2;;x=2'.",
        Stated("via", read_via),
        metavar="PLACES",
    )


@dataclass(frozen=True)
class ModelOptions:
    """Values of a model."""

    order: int | None = stated(f"Order of the discretisation, one of {ORDERS_SHOWN}; 2 by default.")
    set_: list[str] | None = stated(
        "Parameter value, or one for each phase, as k=10,50; several with commas, or repeat it.",
        Stated("parameters", option="--set", lists=2),
        completed=completion.parameters,
        metavar="NAME=VALUE",
    )
    restitution: list[str] | None = stated(
        "Coefficient of restitution, 0 to 1, of all surfaces or of one; several with commas, as "
        "floor=0.8,wall=0.6, or repeat it.",
        Stated("restitution", read_restitution),
        metavar="E|SURFACE=E",
    )


@dataclass(frozen=True)
class ProblemOptions(ModelOptions):
    """What else a problem has, whatever its sequence."""

    final_time: str | None = stated(
        "Final time in seconds, or its range, as 0.5:1, or :1 for at most 1.",
        Stated("final_time", partial(read_value, what="--final-time")),
    )
    controls: Controls | None = stated(
        "Inputs constant in a step, linear between nodes (order 2 only), or linear in each step, "
        "with jumps at the nodes (stages, order 4 and more).",
        Stated("controls", str),
    )
    bound: list[str] | None = stated(
        "Bounds of an input, coordinate, velocity or quantity; several with commas, or repeat it.",
        Stated("bounds", option="--bound"),
        completed=completion.bounded,
        metavar="NAME=LOW:HIGH",
    )
    design: list[str] | None = stated(
        "Parameter that the solver chooses, within a range; several with commas, or repeat it.",
        Stated("design", option="--design"),
        completed=completion.parameters,
        metavar="NAME=LOW:HIGH",
    )
    start: list[str] | None = stated(
        "Start state: x, x_dot, p_x or a quantity; a value, a range LOW:HIGH, or free; several "
        "with commas, or repeat it. An attitude is its quaternion, q=1,0,0,0.",
        Stated("start", option="--start", lists=4),
        completed=completion.states,
        metavar="NAME=VALUE",
    )
    goal: list[str] | None = stated(
        "Goal state, like --start, or the bound of an integral; several with commas, or repeat it.",
        Stated("goal", option="--goal", lists=4),
        completed=completion.states,
        metavar="NAME=VALUE",
    )
    periodic: str | None = stated(
        "States that end as they start, as y,p_y; free at the start unless given. a=b ends as b "
        "starts, x=-x on the other side, x=x+0.5 that much further, x=x+? any distance further.",
        Stated("periodic", read_periodic),
        metavar="STATES",
    )
    contacts: str | None = stated(
        "Surfaces that are closed at the start and rails that slide then, as left,rail:slip+; "
        "what has friction sticks unless it is said to slide.",
        Stated("contacts", read_names),
        completed=completion.surfaces,
        metavar="CONTACTS",
    )
    ignored: str | None = stated(
        "Surfaces that hold nothing back where no event names them, as left,right.",
        Stated("ignored", read_names),
        completed=completion.surfaces,
        metavar="SURFACES",
    )


def stated_by(*groups: Any) -> Iterator[tuple[str, Stated, Any]]:
    """Options that state a field of a problem: name, what they state, and what they were given."""
    for group in groups:
        for f in fields(group):
            if f.metadata[STATED] is not None:
                yield f.name, f.metadata[STATED], getattr(group, f.name)


def problem_fields(defaults: Mapping[str, Any], *groups: Any) -> dict[str, Any]:
    """Fields of a problem: a model's own, changed by options."""
    changed = dict(defaults)
    for _, about, value in stated_by(*groups):
        if about.option:
            pairs = read_pairs(value, about.option, about.lists)
            changed[about.field] = {**changed.get(about.field, {}), **pairs}
            _replace_rest(changed[about.field], pairs)
        elif value not in (None, []):
            changed[about.field] = about.read(value)
    return changed


def _replace_rest(values: dict[str, Any], chosen: Mapping[str, Any]) -> None:
    """A velocity replaces the default momentum of the same coordinate, and the reverse."""
    for name in chosen:
        if name.endswith("_dot") and f"p_{name[:-4]}" not in chosen:
            values.pop(f"p_{name[:-4]}", None)
        if name.startswith("p_") and f"{name[2:]}_dot" not in chosen:
            values.pop(f"{name[2:]}_dot", None)


def stated_problem(reference: Reference, order: int | None, fields: dict[str, Any]) -> Problem:
    """A problem of its fields; with steps that are refined its model has an order of its own."""
    from dmoc.problem.problem import Problem
    from dmoc.problem.statement import AUTOMATIC_ORDER

    if order is None and "steps" not in fields and fields.get("controls") != "linear":
        order = AUTOMATIC_ORDER
    return Problem(reference.kernels(order, progress=True), **fields)
