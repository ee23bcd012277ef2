"""Options that state a problem, in groups that several commands take and hand on as one."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass
from functools import wraps
from typing import Any, get_type_hints

from dmoc.cli.shared_options import (
    BoundOption,
    ContactsOption,
    FinalTimeOption,
    GoalOption,
    IgnoredOption,
    PeriodicOption,
    RestitutionOption,
    SequenceOption,
    SetOption,
    StartOption,
    StepsOption,
)


@dataclass(frozen=True)
class CourseOptions:
    """What happens, in how many steps and how long."""

    sequence: SequenceOption = None
    steps: StepsOption = None
    final_time: FinalTimeOption = None


@dataclass(frozen=True)
class ValueOptions:
    """Values by name."""

    set_: SetOption = None
    bound: BoundOption = None
    start: StartOption = None
    goal: GoalOption = None

    def by_field(self) -> tuple[tuple[str, str, list[str]], ...]:
        """Fields of a problem, with their options and what these were given."""
        return (
            ("parameters", "--set", self.set_ or []),
            ("bounds", "--bound", self.bound or []),
            ("start", "--start", self.start or []),
            ("goal", "--goal", self.goal or []),
        )


@dataclass(frozen=True)
class ConditionOptions:
    """Laws of impact, and what holds at the start and at the end."""

    restitution: RestitutionOption = None
    periodic: PeriodicOption = None
    contacts: ContactsOption = None
    ignored: IgnoredOption = None


def spread(command: Callable[..., None]) -> Callable[..., None]:
    """A command whose signature, which Typer reads, has the fields of a group in its place."""
    signature = inspect.signature(command, eval_str=True)
    parameters: list[inspect.Parameter] = []
    groups: dict[str, Any] = {}
    for parameter in signature.parameters.values():
        group = parameter.annotation
        if not is_dataclass(group):
            parameters.append(parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY))
            continue
        groups[parameter.name] = group
        hints = get_type_hints(group, include_extras=True)
        parameters += [
            parameter.replace(name=f.name, annotation=hints[f.name], default=f.default)
            for f in fields(group)
        ]

    @wraps(command)
    def spread_out(**options: Any) -> None:
        grouped = {
            name: group(**{f.name: options.pop(f.name) for f in fields(group)})
            for name, group in groups.items()
        }
        command(**options, **grouped)

    read: Any = spread_out
    read.__signature__ = signature.replace(parameters=parameters)
    read.__annotations__ = {p.name: p.annotation for p in parameters}
    return spread_out
