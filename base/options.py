"""Options of a function, each stated once: an annotated field of a dataclass."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from functools import cache
from types import NoneType
from typing import Any, TypeVar, get_args, get_type_hints

from dmoc.base.arguments import ErrorKind

T = TypeVar("T")


@dataclass(frozen=True)
class Option:
    """What is known of an option beside its type.

    Attributes
    ----------
    read : callable, optional
        Reads what a caller gives, from the value, its name, and ``error``, which is raised where it
        does not fit.
    decides : bool
        Whether the answer depends on it, and not only whether, when and where it is looked for.
    optional : bool
        Whether its type has None, which is not read.
    """

    read: Callable[..., Any] | None = None
    decides: bool = True
    optional: bool = False


@cache
def options_of(kind: Any) -> Mapping[str, Option]:
    """The options of a dataclass, by name."""
    types, annotated = get_type_hints(kind), get_type_hints(kind, include_extras=True)
    stated: dict[str, Option] = {}
    for name in (f.name for f in fields(kind)):
        about = getattr(annotated[name], "__metadata__", ())
        option = next((a for a in about if isinstance(a, Option)), Option())
        stated[name] = replace(option, optional=NoneType in get_args(types[name]))
    return stated


def read(kind: type[T], values: Mapping[str, Any], error: ErrorKind) -> T:
    """Options from values by name, of which others are ignored; one without a value has its
    default."""
    stated: Any = kind
    named = {name: values[name] for name in options_of(stated) if name in values}
    for name, value in named.items():
        option = options_of(stated)[name]
        if option.read is not None and not (option.optional and value is None):
            named[name] = option.read(value, name, error=error)
    return kind(**named)
