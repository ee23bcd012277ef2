"""Classes of fields that are made in a fraction of the time that a frozen dataclass takes: the
first solve of a process makes two hundred of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import MISSING, FrozenInstanceError, dataclass, fields
from operator import attrgetter
from reprlib import recursive_repr
from typing import TYPE_CHECKING, Any, TypeVar

__all__ = ["record", "value_class"]

T = TypeVar("T")

if TYPE_CHECKING:
    from dataclasses import dataclass as record
    from dataclasses import dataclass as value_class
else:

    def record(*, frozen: bool, eq: bool) -> Callable[[type[T]], type[T]]:
        """A dataclass without comparison that type checkers take for a frozen one: nothing watches
        over it at run time, so that it is no class of what users get.  Its ``__init__`` is compiled
        for the first instance: a process makes some of only half of these classes."""
        assert frozen and not eq
        return _record

    def value_class(*, frozen: bool) -> Callable[[type[T]], type[T]]:
        """A frozen dataclass.  What compares, hashes, shows and guards its instances is the same
        for all such classes, where ``dataclass`` compiles it for each."""
        assert frozen
        return _value


def _record(made: Any) -> Any:
    made = dataclass(init=False, eq=False, repr=False)(made)
    if "__init__" not in made.__dict__:
        made.__init__ = _first_of(made)
    return made


def _first_of(owner: Any) -> Callable[..., None]:
    """The ``__init__`` of a class without instances, which makes its own; two threads may begin
    with it at once."""

    def first(self: Any, *arguments: Any, **named: Any) -> None:
        owner.__init__ = own = _init_of(owner)
        own(self, *arguments, **named)

    return first


def _init_of(owner: type[Any]) -> Callable[..., None]:
    """A function that sets the fields of a class."""
    scope: dict[str, Any] = {}
    parameters, body = ["self"], list[str]()
    for f in fields(owner):
        name, default, content = f.name, f"{f.name}__default", f.name
        parameter, made = name, f.default_factory is not MISSING
        if made or f.default is not MISSING:
            scope[default] = f.default_factory if made else f.default
            parameter = f"{name}={default}"
        if made:  # by what stands for a value that is not passed
            content = (
                f"{default}() if {name} is {default} else {name}" if f.init else f"{default}()"
            )
        parameters += [parameter] if f.init else []
        body += [f"self.{name} = {content}"] if f.init or made else []
    body += ["self.__post_init__()"] if hasattr(owner, "__post_init__") else []
    exec("\n    ".join([f"def __init__({', '.join(parameters)}):", *(body or ["pass"])]), scope)
    init: Callable[..., None] = scope["__init__"]
    init.__qualname__ = f"{owner.__qualname__}.__init__"
    return init


SHARED = ("__eq__", "__hash__", "__repr__", "__setattr__", "__delattr__")


def _value(made: type[T]) -> type[T]:
    made = dataclass(eq=False, repr=False)(made)
    names = [f.name for f in fields(made) if f.compare]  # type: ignore[arg-type]
    # Of one name alone it would be the value instead of a tuple of values.
    made._compared = attrgetter(*names, "__class__")  # type: ignore[attr-defined]
    for name in SHARED:
        if made.__dict__.get(name) is None:
            setattr(made, name, getattr(_Shared, name))
    return made


class _Shared:
    """What classes of values have in common; a field is set once, by ``__init__``."""

    _compared: Callable[[Any], tuple[Any, ...]]

    def __eq__(self, other: object) -> bool:
        if other.__class__ is not self.__class__:
            return NotImplemented
        return self._compared(self) == self._compared(other)

    def __hash__(self) -> int:
        return hash(self._compared(self))

    @recursive_repr()
    def __repr__(self) -> str:
        shown = (f.name for f in fields(self) if f.repr)  # type: ignore[arg-type]
        return f"{type(self).__qualname__}({', '.join(f'{n}={getattr(self, n)!r}' for n in shown)})"

    def __setattr__(self, name: str, content: Any) -> None:
        if name in self.__dict__ or name not in type(self).__dataclass_fields__:  # type: ignore[attr-defined]
            raise FrozenInstanceError(f"cannot assign to field {name!r}")
        self.__dict__[name] = content

    def __delattr__(self, name: str) -> None:
        raise FrozenInstanceError(f"cannot delete field {name!r}")
