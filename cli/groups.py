"""Options that commands take in groups and hand on as one: dataclasses whose fields are options of
the command line, or keywords of the library that it shows."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from enum import StrEnum
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, get_type_hints

from dmoc.base.options import Option, options_of
from dmoc.cli import completion
from dmoc.cli.option_values import read_names
from dmoc.cli.words import option

# What the command line takes where the library reads more.
TYPES: Mapping[str, Any] = {"names": str | None, "path": Path | None}
COMPLETED = {"method": completion.methods}
WORDS, STATED = "words", "stated"  # in the metadata of a field


@dataclass(frozen=True)
class Stated:
    """What an option states: a field of a problem, by a function of its text; or, with its name in
    messages, values of a field by name, which change those that a model comes with, and may be
    lists of ``lists`` values or more: of phases, or of an attitude."""

    field: str
    read: Callable[[Any], Any] = str
    option: str = ""
    lists: int = 0


def stated(help: str, about: Stated | None = None, **words: Any) -> Any:
    """An option of a group, with its words and what it states."""
    names = [about.option] if about is not None and about.option else []
    metadata = {WORDS: option(*names, help=help, **words), STATED: about}
    return field(default=None, metadata=metadata)


def spread(command: Callable[..., None]) -> Callable[..., None]:
    """A command whose signature has the options of a group in its place."""
    signature = inspect.signature(command, eval_str=True)
    parameters: list[inspect.Parameter] = []
    groups: dict[str, Any] = {}
    for parameter in signature.parameters.values():
        group = parameter.annotation
        if not is_dataclass(group):
            parameters.append(parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY))
            continue
        groups[parameter.name] = group
        shown = _shown(group)
        parameters += [
            parameter.replace(name=f.name, annotation=shown[f.name], default=f.default)
            for f in fields(group)
            if f.name in shown
        ]

    @wraps(command)
    def spread_out(**options: Any) -> None:
        grouped = {
            name: group(**{n: _read(group, n, options.pop(n)) for n in _shown(group)})
            for name, group in groups.items()
        }
        command(**options, **grouped)

    read: Any = spread_out
    read.__signature__ = signature.replace(parameters=parameters)
    return spread_out


def passed_on(keywords: Any) -> dict[str, Any]:
    """The keywords of the library that the command line has."""
    return {name: getattr(keywords, name) for name in _shown(type(keywords))}


def _shown(group: Any) -> dict[str, Any]:
    """The options of a group, each with its type and words."""
    keywords = {name: _typed(name, o) for name, o in options_of(group).items() if o.help}
    types = get_type_hints(group)
    own = [f for f in fields(group) if WORDS in f.metadata]
    return keywords | {f.name: Annotated[types[f.name], f.metadata[WORDS]] for f in own}


def _typed(name: str, about: Option) -> Any:
    """The type and the words of a keyword on the command line."""
    kind, completed = TYPES.get(about.reader, about.type), COMPLETED.get(name)
    if about.reader == "choice" and completed is None:
        make: Any = StrEnum
        kind = make(name, {value: value for value in about.limits["choices"]})
    metavar = "FILE" if about.reader == "path" else None
    return Annotated[kind, option(help=about.help, metavar=metavar, completed=completed)]


def _read(group: Any, name: str, value: Any) -> Any:
    """A value of the command line as the library takes it."""
    names = options_of(group)[name].reader == "names"
    return read_names(value) if names and value is not None else value
