"""What users pass, read at the border: numbers, arrays, ranges, lists, paths, functions; what does
not fit is an error of one sentence.

Values may be of foreign classes whose methods fail in any way, so everything that is asked of one
stands under ``except Exception``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence, Set
from inspect import signature
from itertools import islice
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dmoc.base.errors import DmocError, ProblemError
from dmoc.base.messages import LONGEST_TEXT
from dmoc.base.messages import path as path
from dmoc.base.messages import place as place
from dmoc.base.messages import shown as shown
from dmoc.base.tolerances import LARGEST_PARAMETER

MOST_ENTRIES = (
    10_000  # of a list: beyond it a generator without an end is more likely than a meaning
)

MOST_LISTED = 28  # names that a message lists beside the nearest of them
# Texts, and bytes in other clothes, whose entries are no numbers.
TEXTS = (str, bytes, bytearray, memoryview)

Range = tuple[float, float]
# What `interval` reads: a number, a pair (lower, upper) with None for no bound, None for free.
Interval: TypeAlias = float | Sequence[float | None] | NDArray[Any] | None
ErrorKind = type[DmocError]


def is_number(value: Any) -> bool:
    """Whether a value is one real number: a truth value, a text, a complex number, an array
    with a shape or a masked entry is none."""
    if type(value) in (float, int):
        return True
    if isinstance(value, (bool, np.bool_, str, bytes, complex, np.complexfloating)):
        return False
    if isinstance(value, np.ndarray):
        return value.ndim == 0 and value.dtype.kind in "iuf" and not _is_masked(value)
    return hasattr(type(value), "__float__") or hasattr(type(value), "__index__")


def _is_masked(value: Any) -> bool:
    """Whether a value has masked entries, without numpy.ma, which takes long to load."""
    return bool(np.any(getattr(value, "_mask", False)))


def is_row(value: Any) -> bool:
    """Whether a value is a list, a tuple or an array with one axis."""
    return isinstance(value, (tuple, list)) or (isinstance(value, np.ndarray) and value.ndim == 1)


def is_zero(value: Any) -> bool:
    """Whether a value is the number zero."""
    return is_number(value) and _float(value) == 0


def number(value: Any, what: str, error: ErrorKind = ProblemError) -> float:
    """Read a finite number."""
    result = _float(value)
    if result is None or not math.isfinite(result):
        raise error(
            f"{what} = {shown(value)}: expected a {'' if result is None else 'finite '}number."
        )
    return result


def check_magnitude(size: float, value: Any, what: str, error: ErrorKind = ProblemError) -> None:
    """Refuse a value, of some size as a float, of which squares overflow."""
    if value != 0 and not 1 / LARGEST_PARAMETER <= abs(size) <= LARGEST_PARAMETER:
        raise error(
            f"{what} = {shown(value)}: expected 0 or a magnitude from 1e-100 to 1e100; use other "
            "units."
        )


def check_largest(size: float, what: str, error: ErrorKind = ProblemError) -> None:
    """Refuse a finite value of which squares overflow; a smaller one counts as nothing."""
    if LARGEST_PARAMETER < abs(size) < math.inf:
        raise error(
            f"{what} = {shown(size)}: expected a magnitude of at most 1e100; use other units."
        )


def positive(value: Any, what: str, expected: str, error: ErrorKind = ProblemError) -> float:
    """Read a positive finite number."""
    result = _float(value)
    if result is None or not 0 < result < math.inf:
        raise error(f"{what} = {shown(value)}: {expected}.")
    return result


def whole(
    value: Any, what: str, least: int, most: int, error: ErrorKind = ProblemError, unit: str = ""
) -> int:
    """Read a whole number from a range."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < least:
        raise error(f"{what} = {shown(value)}: expected a whole number of at least {least}{unit}.")
    if value > most:
        raise error(f"{what} = {shown(value)}: expected at most {most}{unit}.")
    return int(value)


def flag(value: Any, what: str, error: ErrorKind = ProblemError) -> bool:
    """Read a truth value; a text such as "no" would count as true."""
    if not isinstance(value, (bool, np.bool_)):
        raise error(f"{what} = {shown(value)}: expected True or False.")
    return bool(value)


def choice(value: Any, what: str, choices: Iterable[str], error: ErrorKind = ProblemError) -> str:
    """Read one of several texts."""
    names = list(choices)
    if not isinstance(value, str) or value not in names:
        raise error(f"{what} = {shown(value)}: expected one of {', '.join(names)}.")
    return str(value)


def check_known(
    name: str,
    among: Iterable[str],
    what: str,
    where: str = "",
    error: ErrorKind = ProblemError,
    hint: str = "",
    said: Callable[[list[str]], list[str]] = list,
) -> None:
    """Check that a name is one of those known; the message shows a hint, or the nearest of them,
    and all of them as they are ``said``, but for very many where there is a hint."""
    names = list(among)
    if name not in names:
        import difflib  # which only a mistake needs

        names = said(names)

        close = difflib.get_close_matches(name[:LONGEST_TEXT], names, 1)
        hint = hint or (f"did you mean {close[0]!r}?" if close else "")
        listed = f": expected one of {', '.join(names)}" if names else ": the model has none"
        if hint and len(names) > MOST_LISTED:
            listed = ""
        raise error(
            f"unknown {what} {shown(name)}{' ' + where if where else ''}{listed}"
            f"{f' ({hint})' if hint else ''}."
        )


def text(value: Any, what: str, error: ErrorKind = ProblemError) -> str:
    if not isinstance(value, str):
        raise error(f"{what} = {shown(value)}: expected a text.")
    return str(value)


def interval(value: Any, what: str) -> Range:
    """Read a number, a pair with None for no bound, or None for free."""
    if is_number(value):
        fixed = number(value, what)
        return fixed, fixed
    return limits(value, what, "expected a number or a pair (lower, upper)")


def limits(value: Any, what: str, expected: str) -> Range:
    """Read a pair with None for no bound, or None for free."""
    if value is None:
        return -math.inf, math.inf
    if not is_row(value) or len(value) != 2:
        raise ProblemError(f"{what} = {shown(value)}: {expected}.")
    low, high = _bound(value[0], what, -math.inf), _bound(value[1], what, math.inf)
    if low > high:
        raise ProblemError(
            f"{what}: the lower bound {low:g} exceeds the upper bound {high:g}; exchange them."
        )
    return low, high


def listed(
    value: Any, what: str, of: str, error: ErrorKind = ProblemError, most: int = MOST_ENTRIES
) -> list[Any]:
    """Read a list, or anything else that has an order; the order of a set is none, and a
    mapping's values would be ignored."""
    if isinstance(value, TEXTS):
        raise error(f"{what} = {shown(value)}: expected a list of {of} such as [{shown(value)}].")
    if isinstance(value, (Mapping, Set)):
        kind = "mapping" if isinstance(value, Mapping) else "set"
        raise error(f"{what} = {shown(value)}: expected a list of {of}, not a {kind}.")
    try:
        iterator = iter(value)
    except Exception:  # no list, an array without dimensions, or a foreign class
        raise error(f"{what} = {shown(value)}: expected a list of {of}; [] for none.") from None
    entries = list(islice(iterator, most + 1))
    if len(entries) > most:
        raise error(
            f"{what} has more than {most} entries: expected a list of {of}, with fewer of them."
        )
    return entries


def names(value: Any, what: str, of: str, error: ErrorKind = ProblemError) -> list[str]:
    """Read a list of texts."""
    entries = listed(value, what, of, error)
    for entry in entries:
        if not isinstance(entry, str):
            raise error(f"{what} has the entry {shown(entry)}: expected {of} by name, as texts.")
    return [str(entry) for entry in entries]


def array(value: Any) -> NDArray[np.float64] | None:
    """Read an array of numbers of any shape (...), not finite ones among them; None for a value
    that is no array."""
    try:
        raw = np.asarray(value)
    except Exception:  # rows of different lengths, or a foreign class
        return None
    if _is_masked(value) or isinstance(value, TEXTS):
        return None
    if raw.dtype.kind == "O":
        entries = [_float(entry) for entry in raw.ravel()]
        return None if None in entries else np.array(entries, dtype=float).reshape(raw.shape)
    with np.errstate(over="ignore"):  # of more than double precision
        return raw.astype(float) if raw.dtype.kind in "iuf" else None


def function(
    value: Any, what: str, of: str, error: ErrorKind = ProblemError
) -> Callable[[Any], Any]:
    """Read a function of one argument."""
    try:
        if isinstance(value, type):
            raise TypeError
        signature(value).bind(None)
    except TypeError:
        raise error(
            f"{what} = {shown(value)}: expected a function of one argument, {of}."
        ) from None
    except Exception:  # written in C, without a signature
        pass
    call: Callable[[Any], Any] = value
    return call


def executor(value: Any, what: str = "executor", error: ErrorKind = ProblemError) -> Any:
    """Read what solves tasks elsewhere, or None."""
    if value is not None:
        try:
            fits = callable(value.submit) and not isinstance(value, type)
        except Exception:
            fits = False
        if not fits:
            raise error(
                f"{what} = {shown(value)}: expected a concurrent.futures.Executor, or None."
            )
    return value


def _bound(value: Any, what: str, none: float) -> float:
    """One bound of a pair; None and the infinity on its side stand for no bound."""
    return none if value is None or _float(value) == none else number(value, what)


def _float(value: Any) -> float | None:
    """A number as a float, NaN beyond the largest one; None for what is no number."""
    if type(value) is float:  # nearly all
        return value
    if not is_number(value):
        return None
    try:
        with np.errstate(over="ignore"):  # of more than double precision
            return float(value)
    except OverflowError:
        return math.nan
    except Exception:  # a symbol, a signalling NaN, or a foreign class
        return None
