"""Options of a function, each stated once, as an annotated field of a dataclass: type and default,
how it is read, and what the command line says of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cache
from types import NoneType
from typing import TYPE_CHECKING, Any, TypeVar, get_args, get_type_hints

if TYPE_CHECKING:
    from dmoc.base.arguments import ErrorKind

T = TypeVar("T")


@dataclass(frozen=True)
class Option:
    """What is known of an option beside its default."""

    reader: str = ""  # the function of dmoc.base.arguments that reads what a caller gives, if any
    help: str = ""  # what the command line says of it, which else has no such option
    # Whether the answer depends on it, and not only whether, when and where it is looked for.
    decides: bool = True
    limits: Mapping[str, Any] = field(default_factory=dict)  # further arguments of the reader
    type: Any = None  # of the field

    def read(self, value: Any, name: str, error: ErrorKind) -> Any:
        """A value as it is read; None where the field may be None."""
        if not self.reader or (value is None and NoneType in get_args(self.type)):
            return value
        # here, so that the command line shows its help without NumPy
        from dmoc.base import arguments

        return getattr(arguments, self.reader)(value, name, error=error, **self.limits)


def option(reader: str = "", help: str = "", *, decides: bool = True, **limits: Any) -> Option:
    """What a field's annotation says of it; ``limits`` are further arguments of its reader."""
    return Option(reader, help, decides, limits)


@cache
def options_of(kind: Any) -> Mapping[str, Option]:
    """The options of a dataclass, by name."""
    types, annotated = get_type_hints(kind), get_type_hints(kind, include_extras=True)
    stated: dict[str, Option] = {}
    for name in (f.name for f in fields(kind)):
        about = getattr(annotated[name], "__metadata__", ())
        one = next((a for a in about if isinstance(a, Option)), Option())
        stated[name] = replace(one, type=types[name])
    return stated


def read(kind: type[T], values: Mapping[str, Any], error: ErrorKind) -> T:
    """Options from values by name, of which others are ignored; one without a value has its
    default."""
    options: Any = kind
    stated = options_of(options).items()
    return kind(
        **{name: one.read(values[name], name, error) for name, one in stated if name in values}
    )
