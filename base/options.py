"""Options of a function, each stated once, as a field of a dataclass: type and default, how it is
read, and what the command line says of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, fields, replace
from functools import cache, partial
from types import NoneType
from typing import TYPE_CHECKING, Any, TypeVar, get_args, get_type_hints

from dmoc.base.records import value_class

if TYPE_CHECKING:
    from dmoc.base.arguments import ErrorKind

T = TypeVar("T")
ABOUT = "option"  # in the metadata of a field


@value_class(frozen=True)
class Option:
    """What is known of an option beside its default."""

    reader: str = ""  # the function of dmoc.base.arguments that reads what a caller gives, if any
    help: str = ""  # what the command line says of it, which else has no such option
    decides: bool = True  # the answer depends on it
    limits: Mapping[str, Any] = field(default_factory=dict)  # further arguments of the reader
    type: Any = None  # of the field

    def read(self, value: Any, name: str, error: ErrorKind) -> Any:
        """A value as it is read; None where the field may be None."""
        if not self.reader or (value is None and NoneType in get_args(self.type)):
            return value
        # here, so that the command line shows its help without NumPy
        from dmoc.base import arguments

        return getattr(arguments, self.reader)(value, name, error=error, **self.limits)


def option(
    default: Any, reader: str = "", help: str = "", *, decides: bool = True, **limits: Any
) -> Any:
    """A field with its default; ``limits`` are further arguments of its reader."""
    return field(default=default, metadata={ABOUT: Option(reader, help, decides, limits)})


# One on which the answer does not depend: whether, when and where it is looked for.
elsewhere = partial(option, decides=False)


@cache
def options_of(kind: Any) -> Mapping[str, Option]:
    """The options of a dataclass, by name."""
    types = get_type_hints(kind)
    return {
        f.name: replace(f.metadata.get(ABOUT, Option()), type=types[f.name]) for f in fields(kind)
    }


def read(kind: type[T], values: Mapping[str, Any], error: ErrorKind) -> T:
    """Options from values by name, of which others are ignored; one without a value has its
    default."""
    options: Any = kind
    stated = options_of(options).items()
    return kind(
        **{name: one.read(values[name], name, error) for name, one in stated if name in values}
    )
