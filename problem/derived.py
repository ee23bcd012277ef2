"""Problems like another one, and what follows from a problem, made once."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Any, TypeVar

from dmoc.base.errors import ProblemError
from dmoc.base.signatures import check_argument

if TYPE_CHECKING:
    from dmoc.problem.problem import Problem

T = TypeVar("T")
MADE = "_made"  # the attribute in which a problem keeps what follows from it


def unread(problem: Problem, changes: Mapping[str, Any]) -> Problem:
    """The same problem with some fields replaced by values that are not read."""
    names = [item.name for item in fields(problem)]
    for name in changes:
        check_argument(name, names, type(problem).__name__, ProblemError)
    other = object.__new__(type(problem))
    for name in names:
        object.__setattr__(other, name, changes.get(name, getattr(problem, name)))
    return other


def like(problem: Problem, without: Collection[str] = (), **changes: Any) -> Problem:
    """The same problem with some attributes replaced as they are; it keeps what was found of the
    other one, but for some attributes."""
    other = object.__new__(type(problem))
    other.__dict__.update(kept(problem, without), **changes)
    return other


def kept(problem: Problem, without: Collection[str] = ()) -> dict[str, Any]:
    """The attributes of a problem, but for some, and for what follows from it."""
    left_out = {MADE, *without}
    return {name: value for name, value in vars(problem).items() if name not in left_out}


def once(problem: Problem, make: Callable[[Problem], T]) -> T:
    """What a function makes of a problem, made once."""
    made: dict[Any, Any] = vars(problem).setdefault(MADE, {})
    if make not in made:
        made[make] = make(problem)
    result: T = made[make]
    return result
