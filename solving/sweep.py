"""A problem solved over a grid of values."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from dmoc.base.arguments import check_known, is_number, listed
from dmoc.base.errors import DmocError, ProblemError
from dmoc.base.progress import Listener
from dmoc.base.records import record
from dmoc.base.signatures import public
from dmoc.mechanics.model_values import by_name
from dmoc.problem.problem import Problem
from dmoc.problem.ranges import names_in
from dmoc.results.batch import Batch
from dmoc.solving.many import MOST_PROBLEMS, OPTIONS, BatchProgress, batch_of
from dmoc.solving.request import check_problem
from dmoc.solving.starts import InitialGuess

# Columns of what is not a parameter say where it belongs.
WHERE = {
    "parameters": "",
    "start": "start ",
    "goal": "goal ",
    "bounds": "bounds ",
    "design": "design ",
}


@dataclass(frozen=True)
class Axis:
    """Values of one entry of a mapping of the problem."""

    field: str
    name: str
    values: tuple[Any, ...]

    @property
    def column(self) -> str:
        return WHERE[self.field] + self.name


@record(frozen=True, eq=False)
class Grid(Sequence[Problem | DmocError]):
    """The problems of a sweep, each stated when it is asked for."""

    problem: Problem
    axes: Sequence[Axis]
    rows: Sequence[Sequence[Any]]

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, number: Any) -> Any:
        return _problem(self.problem, self.axes, self.rows[number])


@public(ProblemError, OPTIONS)
def sweep(
    problem: Problem,
    parameters: Mapping[Any, Iterable[float]] | None = None,
    *,
    start: Mapping[Any, Iterable[Any]] | None = None,
    goal: Mapping[Any, Iterable[Any]] | None = None,
    bounds: Mapping[Any, Iterable[Any]] | None = None,
    design: Mapping[Any, Iterable[Any]] | None = None,
    method: str | None = None,
    workers: int = 1,
    executor: Executor | None = None,
    guess: InitialGuess = None,
    keep: bool = False,
    seconds: float | None = None,
    progress: Listener[BatchProgress] = None,
    **options: Any,
) -> Batch:
    """Solve a problem for every combination of some values.

    Parameters
    ----------
    problem : Problem
        What is not varied.
    parameters, start, goal, bounds, design : mapping of name to list of values, optional
        What is varied, as in :class:`~dmoc.Problem`; the last one varies fastest.  Each is a column
        of ``varied``: parameters under their name, others as "start alpha"; a pair (lower, upper)
        counts as its upper value, or as its lower one if that is None.
    method, workers, executor, guess, keep, seconds, progress, **options
        As in :func:`dmoc.solve_many`.

    Returns
    -------
    Batch
        ``plot`` draws it over one or two values.  A combination that is no problem is "refused",
        and its message says why.

    Raises
    ------
    ProblemError
        If an argument does not fit.

    Examples
    --------
    >>> import dmoc
    >>> from dmoc.models.registry import find
    >>> reference = find("puck_table")
    >>> problem = dmoc.Problem(reference.kernels(), **reference.defaults)
    >>> batch = dmoc.sweep(problem.but(sequence=["east"]), {"m": [0.5, 1.0]})
    >>> batch.varied["m"], batch.cost.round(3)
    (array([0.5, 1. ]), array([0.704, 2.815]))
    """
    keywords = {**locals()}
    check_problem(problem)
    varied = {
        "parameters": parameters,
        "start": start,
        "goal": goal,
        "bounds": bounds,
        "design": design,
    }
    axes = [
        axis
        for field, values in varied.items()
        if values is not None
        for axis in _axes(problem, field, values)
    ]
    if not axes:
        raise ProblemError(
            "nothing is varied: give values, such as parameters={'l': [0.4, 0.5, 0.6]}."
        )
    count = math.prod(len(axis.values) for axis in axes)
    if count > MOST_PROBLEMS:
        raise ProblemError(
            f"the sweep has {count} problems: expected at most {MOST_PROBLEMS}; take fewer values."
        )
    grid = list(product(*(axis.values for axis in axes)))
    columns = {
        axis.column: np.array([_number(values[i]) for values in grid])
        for i, axis in enumerate(axes)
    }
    return batch_of(Grid(problem, axes, grid), columns, keywords, problem.kernels.compiled)


def _axes(problem: Problem, field: str, values_by_name: Mapping[Any, Iterable[Any]]) -> list[Axis]:
    """Axes of a sweep over values of one field."""
    parameters = problem.kernels.parameters, "parameter"
    of_model = field in ("parameters", "design")
    names, what = parameters if of_model else names_in(problem, field)
    axes = []
    for name, values in by_name(values_by_name, field).items():
        check_known(name, names, what, f"in {field}")
        entries = listed(values, f"{field} of {name}", "values")
        if not entries:
            raise ProblemError(f"{field} of {name} has no values: give at least one.")
        axes.append(Axis(field, name, tuple(entries)))
    return axes


def _problem(problem: Problem, axes: Sequence[Axis], values: Sequence[Any]) -> Problem | DmocError:
    """The problem with some values, or why there is none."""
    fields: dict[str, dict[str, Any]] = {
        axis.field: dict(getattr(problem, axis.field)) for axis in axes
    }
    for axis, value in zip(axes, values, strict=True):
        fields[axis.field][axis.name] = value
    try:
        return problem.but(**fields)
    except DmocError as error:
        return error


def _number(value: Any) -> float:
    """A value as a table shows it."""
    if is_number(value):
        return float(value)
    try:
        low, high = value
        return float(low if high is None else high)
    except (TypeError, ValueError):
        return math.nan
