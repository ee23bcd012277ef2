"""Calls that do not fit a public function: one sentence of ours, where Python has a TypeError."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from functools import wraps
from importlib import import_module
from inspect import signature
from itertools import islice
from types import FunctionType
from typing import Any, TypeVar

from dmoc.base.errors import DmocError
from dmoc.base.messages import LONGEST_TEXT

T = TypeVar("T")
# What other tools call an argument, and what it is called here.
OF_OTHERS = {
    "verbose": "progress",
    "disp": "progress",
    "tol": "tolerance",
    "timeout": "seconds",
    "maxiter": "iterations",
    "max_iter": "iterations",
    "n_jobs": "workers",
    "x0": "start",
    "tf": "final_time",
    "dt": "step_size",
}
MOST_TAKERS = 3  # functions that a message names at most
MISSPELT = 0.85  # likeness of a name to what it is a misspelling of


def public(error: type[DmocError], options: Collection[str] = ()) -> Callable[[T], T]:
    """Mark a function, or a class with its public methods, as what users call: a call that does not
    fit is refused with an error of this kind.  ``options`` are what ``**`` takes, where it does not
    take any name."""

    def marked(thing: Any) -> Any:
        if not isinstance(thing, type):
            return _worded(thing, thing.__name__, error, options)
        for name, member in [*vars(thing).items()]:
            label = thing.__name__ if name == "__init__" else name
            if not label.startswith("_"):
                setattr(thing, name, _member(member, label, error))
        return thing

    return marked


def _member(member: Any, label: str, error: type[DmocError]) -> Any:
    """A method that refuses in words; what is none as it is."""
    if isinstance(member, classmethod):
        return classmethod(_worded(member.__func__, label, error))
    return _worded(member, label, error) if isinstance(member, FunctionType) else member


def _worded(
    function: Callable[..., Any],
    label: str,
    error: type[DmocError],
    options: Collection[str] = (),
) -> Any:
    """The function; a call that does not fit it is refused in words."""

    @wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        if options:
            _check_fit(function, args, kwargs, label, error, options)
        try:
            return function(*args, **kwargs)
        except TypeError:
            _check_fit(function, args, kwargs, label, error, options)
            raise  # not of this call: of something in it

    return call


def _check_fit(
    function: Callable[..., Any],
    args: tuple[Any, ...],
    kwargs: dict[str, Any],
    label: str,
    error: type[DmocError],
    options: Collection[str],
) -> None:
    """Refuse arguments that a function does not take, or takes otherwise."""
    known = signature(function)
    stated = [p for p in known.parameters.values() if p.name not in ("self", "cls")]
    if options or all(p.kind is not p.VAR_KEYWORD for p in stated):
        names = [p.name for p in stated if p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD)]
        for name in kwargs:
            check_argument(name, [*names, *options], label, error)
    try:
        known.bind(*args, **kwargs)
    except TypeError as misfit:
        usage = (f"{p.name}=..." if p.kind is p.KEYWORD_ONLY else p.name for p in stated)
        raise error(
            f"this call of {label} does not fit it, {misfit}: expected {label}({', '.join(usage)})."
        ) from None


def check_argument(name: str, among: Collection[str], label: str, error: type[DmocError]) -> None:
    """Refuse an argument of another name; the message says what may be meant."""
    from dmoc.base.arguments import check_known  # with NumPy, which only a mistake needs here

    if not among:
        raise error(f"{label} has no arguments by name: leave {name!r} out.")
    if name not in among:
        check_known(name, among, "argument", f"of {label}", error, hint=_hint(name, among))


def _hint(name: str, among: Collection[str]) -> str:
    """A hint at the name that is meant: one that is nearly the same, another tool's name for it, or
    an argument of another function; empty without any."""
    from difflib import get_close_matches

    near = get_close_matches(name[:LONGEST_TEXT], among, 1, MISSPELT)
    meant = near[0] if near else OF_OTHERS.get(name)
    if meant in among:
        return f"did you mean {meant!r}?"
    takers = ", ".join(islice(_takers(name), MOST_TAKERS))
    return f"an argument of {takers}" if takers else ""


def _takers(argument: str) -> Iterator[str]:
    """The public functions, and classes that no function makes, with an argument; they lie above,
    and are loaded here."""
    dmoc = import_module("dmoc")
    for name in dmoc.__all__:
        thing = getattr(dmoc, name)
        made = hasattr(thing, "from_bytes")
        if callable(thing) and not made and argument in signature(thing).parameters:
            yield f"dmoc.{name}"
