"""What a file holds, declared as kinds of values: they write it, and refuse on reading whatever is
not of the kind.

A record lists its fields, each with a kind.  Kinds write values as JSON, large arrays beside it.  A
size is a number, or a letter that stands for the same number wherever it appears in a record and in
those inside it.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from typing import Any, Protocol

import numpy as np

from dmoc.base.records import record
from dmoc.motion.trajectory import Array

Size = int | str | None  # None for any number
Put = Callable[[str, Array], None]
Take = Callable[[str, tuple[int, ...]], Array]

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}", re.ASCII)
LARGEST_INTEGER = 2**53  # a float holds it exactly
LARGEST_NUMBER = 1e150  # it still has a square
LARGEST_TEXT = 4 * 2**20  # characters of JSON; what is large is an array
LONGEST_SAID = 60  # characters of foreign text in a message


class Refused(Exception):  # noqa: N818 - who reads the file says it in words of its own
    """A value is not of its kind; the text says where, and what was expected."""


def no_arrays(where: str, _: object) -> Any:
    raise Refused(f"{where} is an array, expected none")


@record(frozen=True, eq=False)
class Context:
    """What the reading of a value may need: the arrays by place and shape, and the sizes known
    so far."""

    take: Take = no_arrays
    sizes: dict[str, int] = field(default_factory=dict)

    def inside(self) -> Context:
        return Context(self.take, dict(self.sizes))

    def check(self, size: Size, number: int, where: str) -> None:
        """Fix a size that is not known yet; refuse a number of entries that differs from a known
        one."""
        if size is None:
            return
        expected = size if isinstance(size, int) else self.sizes.setdefault(size, number)
        if number != expected:
            raise Refused(f"{where} has {number} entries, expected {expected}")


class FieldKind(Protocol):
    """A kind of value."""

    def write(self, value: Any, where: str, put: Put) -> Any:
        """Return the value as JSON, and put arrays beside it."""

    def read(self, data: Any, where: str, context: Context) -> Any:
        """Return the value that JSON stands for; raise Refused if it is of another kind."""


def dumped(kind: FieldKind, value: Any, put: Put = no_arrays) -> str:
    """Return a value as JSON text."""
    return json.dumps(kind.write(value, "", put))


def plain(text: str) -> Any:
    """Return what a JSON text holds, of whatever kind; raise Refused if it is none."""
    if len(text) > LARGEST_TEXT:
        raise Refused(f"its text has {len(text)} characters, expected at most {LARGEST_TEXT}")
    try:
        return json.loads(text, object_pairs_hook=_once)
    except RecursionError:
        raise Refused("its text is nested too deeply") from None
    except ValueError:
        raise Refused("its text is no JSON") from None


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    fields = dict(pairs)
    if len(fields) < len(pairs):
        raise Refused("its text has a field twice")
    return fields


def said(data: object) -> str:
    """Foreign text in a message: quoted, short, on one line."""
    text = (
        ascii(data)
        if isinstance(data, (str, int, float, type(None)))
        else f"a {type(data).__name__}"
    )
    return text if len(text) <= LONGEST_SAID else text[:LONGEST_SAID] + "..."


def _expect(right: bool, data: object, where: str, expected: str) -> None:
    if not right:
        raise Refused(f"{where or 'its content'} is {said(data)}, expected {expected}")


def _at(where: str, name: object) -> str:
    return f"{where}.{name}" if where else str(name)


@record(frozen=True, eq=False)
class Nothing:
    """No value."""

    def write(self, value: Any, where: str, put: Put) -> None:
        if value is not None:
            raise TypeError(f"{where}: {value!r} is not None")

    def read(self, data: Any, where: str, context: Context) -> None:
        _expect(data is None, data, where, "nothing")


@record(frozen=True, eq=False)
class Plain:
    """A value that JSON has by itself: what makes it, whether data are right, and what else was
    expected."""

    make: Callable[[Any], Any]
    right: Callable[[Any], bool]
    expected: str

    def write(self, value: Any, where: str, put: Put) -> Any:
        return self.make(value)

    def read(self, data: Any, where: str, context: Context) -> Any:
        _expect(self.right(data), data, where, self.expected)
        return self.make(data)


def Number(
    low: float = -LARGEST_NUMBER, high: float = LARGEST_NUMBER, special: bool = False
) -> Plain:
    """A number in a range; any at all, infinite and NaN included, where it is ``special``."""

    def right(data: Any) -> bool:
        number = isinstance(data, float) or (_is_whole(data) and abs(data) <= LARGEST_INTEGER)
        return number and (special or low <= data <= high)

    return Plain(float, right, "a number" if special else f"a number from {low:g} to {high:g}")


def Whole(low: int = 0) -> Plain:
    """A whole number of at least ``low``."""
    return Plain(
        int,
        lambda data: _is_whole(data) and low <= data <= LARGEST_INTEGER,
        f"a whole number of at least {low}",
    )


def _is_whole(data: Any) -> bool:
    return isinstance(data, int) and not isinstance(data, bool)


def Flag() -> Plain:
    return Plain(bool, lambda data: isinstance(data, bool), "true or false")


def Text() -> Plain:
    """A text of printable characters and ends of lines; others become question marks when it is
    written."""
    return Plain(
        lambda value: "".join(c if c == "\n" or c.isprintable() else "?" for c in str(value)),
        lambda data: isinstance(data, str) and data.replace("\n", "").isprintable(),
        "a printable text",
    )


def Name() -> Plain:
    """A name as models have them."""
    return Plain(
        str, lambda data: isinstance(data, str) and NAME.fullmatch(data) is not None, "a name"
    )


def Choice(values: Sequence[str | int]) -> Plain:
    """One of some texts or whole numbers."""
    return Plain(
        lambda value: next((v for v in values if v == value), value),
        lambda data: not isinstance(data, bool) and data in values,
        "one of " + ", ".join(map(str, values)),
    )


class Either:
    """A value of the first kind that takes it."""

    def __init__(self, *kinds: FieldKind) -> None:
        self.kinds = kinds

    def write(self, value: Any, where: str, put: Put) -> Any:
        *first, last = self.kinds
        for kind in first:
            try:
                return kind.write(value, where, put)
            except (TypeError, ValueError):
                continue
        return last.write(value, where, put)

    def read(self, data: Any, where: str, context: Context) -> Any:
        *first, last = self.kinds
        for kind in first:
            try:
                return kind.read(data, where, context.inside())
            except Refused:
                continue
        return last.read(data, where, context)


@record(frozen=True, eq=False)
class Listed:
    """A tuple of values of one kind."""

    kind: FieldKind
    size: Size = None

    def write(self, value: Any, where: str, put: Put) -> list[Any]:
        return [self.kind.write(v, _at(where, i), put) for i, v in enumerate(value)]

    def read(self, data: Any, where: str, context: Context) -> tuple[Any, ...]:
        _expect(isinstance(data, list), data, where, "a list")
        context.check(self.size, len(data), where)
        return tuple([self.kind.read(g, _at(where, i), context) for i, g in enumerate(data)])


@record(frozen=True, eq=False)
class ShortArray:
    """A short array, within the text."""

    size: Size = None
    kind: FieldKind = field(default_factory=Number)

    def write(self, value: Any, where: str, put: Put) -> list[Any]:
        return Listed(self.kind).write(np.asarray(value).tolist(), where, put)

    def read(self, data: Any, where: str, context: Context) -> Array:
        """Read a short array, shape (size,)."""
        return np.array(Listed(self.kind, self.size).read(data, where, context), dtype=float)


@record(frozen=True, eq=False)
class Mapped:
    """A mapping of texts to values of one kind."""

    kind: FieldKind
    size: Size = None
    names: FieldKind = field(default_factory=Text)

    def write(self, value: Any, where: str, put: Put) -> dict[str, Any]:
        return {
            self.names.write(name, where, put): self.kind.write(v, _at(where, name), put)
            for name, v in value.items()
        }

    def read(self, data: Any, where: str, context: Context) -> dict[str, Any]:
        _expect(isinstance(data, dict), data, where, "a mapping")
        context.check(self.size, len(data), where)
        names = {name: self.names.read(name, f"a name in {where}", context) for name in data}
        return {
            names[name]: self.kind.read(value, _at(where, name), context)
            for name, value in data.items()
        }


class Stored:
    """A float64 array beside the text, which has its shape; any shape of one or two sizes if none
    is given.  One without entries is its shape alone.

    Its values are numbers; any at all, infinite and NaN included, where it is ``special``.
    """

    def __init__(self, *shape: Size, special: bool = False) -> None:
        self.shape, self.special = shape, special

    def write(self, value: Any, where: str, put: Put) -> list[int]:
        array = np.asarray(value, dtype=float)
        if array.size:
            put(where, array)
        return list(array.shape)

    def read(self, data: Any, where: str, context: Context) -> Array:
        """Read an array of one or two dimensions, shape (n,) or (n, m), from the archive."""
        shape = Listed(Whole()).read(data, f"the shape of {where}", context)
        sizes = self.shape or (None,) * len(shape)
        if len(shape) != len(sizes) or not 1 <= len(shape) <= 2:
            raise Refused(
                f"{where} has {len(shape)} dimensions, expected {len(self.shape) or '1 or 2'}"
            )
        for size, number in zip(sizes, shape, strict=True):
            context.check(size, number, where)
        array = context.take(where, shape) if 0 not in shape else np.zeros(shape)
        if not self.special and not (np.abs(array) <= LARGEST_NUMBER).all():
            raise Refused(
                f"{where} has a value that is not a number from {-LARGEST_NUMBER:g} to "
                f"{LARGEST_NUMBER:g}"
            )
        return array


@record(frozen=True, eq=False)
class Record:
    """Named values, each of its own kind: no fewer and no others.

    ``make`` takes them as keywords; ``wrong`` says what does not fit together, or nothing.
    ``attributes`` has the names of those that the value calls differently, by fields.
    """

    make: Callable[..., Any]
    fields: Mapping[str, FieldKind]
    wrong: Callable[[Any], str | None] = lambda _: None
    attributes: Mapping[str, str] = field(default_factory=dict)

    def write(self, value: Any, where: str, put: Put) -> dict[str, Any]:
        data = (
            value
            if isinstance(value, Mapping)
            else {name: getattr(value, self._attribute(name)) for name in self.fields}
        )
        if set(data) != set(self.fields):
            raise ValueError(
                f"{where}: {sorted(set(data) ^ set(self.fields))} are not in both, the value and "
                "its declaration"
            )
        return {
            name: kind.write(data[name], _at(where, name), put)
            for name, kind in self.fields.items()
        }

    def read(self, data: Any, where: str, context: Context) -> Any:
        _expect(isinstance(data, dict), data, where, "a mapping")
        for name in data:
            if name not in self.fields:
                raise Refused(f"{_at(where, said(name))} is unknown")
        for name in self.fields:
            if name not in data:
                raise Refused(f"{_at(where, name)} is missing")
        within = context.inside()
        value = self.make(
            **{
                self._attribute(name): kind.read(data[name], _at(where, name), within)
                for name, kind in self.fields.items()
            }
        )
        wrong = self.wrong(value)
        if wrong:
            raise Refused(wrong)
        return value

    def _attribute(self, name: str) -> str:
        return self.attributes.get(name, name)
