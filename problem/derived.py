"""Problems like another one, and what follows from a problem, made once."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from copy import copy
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
    return like(problem, vars(problem).keys() - names, **changes)


def like(problem: Problem, without: Collection[str] = (), **changes: Any) -> Problem:
    """The same problem with some attributes replaced as they are; it keeps what was found of the
    other one, but for some attributes."""
    other = copy(problem)
    for name in without:
        vars(other).pop(name, None)
    vars(other).update(changes)
    return other


def kept(problem: Problem) -> dict[str, Any]:
    """The attributes of a problem but for what follows from it, which copies leave behind."""
    return {name: value for name, value in vars(problem).items() if name != MADE}


def once(problem: Problem, make: Callable[[Problem], T]) -> T:
    """What a function makes of a problem, made once."""
    made: dict[Any, Any] = vars(problem).setdefault(MADE, {})
    if make not in made:
        made[make] = make(problem)
    result: T = made[make]
    return result
