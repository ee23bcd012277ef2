"""Relations of both ends of a motion, and where these are, as far as a problem says it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from dmoc.base.arguments import Range, check_known, interval, listed, number, shown
from dmoc.base.errors import ProblemError
from dmoc.base.names import name_of
from dmoc.base.records import value_class
from dmoc.codegen.kernels import Array
from dmoc.mechanics.attitudes import coordinates_of, on_sphere, said_of
from dmoc.mechanics.model_values import by_name
from dmoc.problem.quantities import onto_quantities
from dmoc.problem.ranges import midpoints, names_in
from dmoc.problem.reach import onto_first

if TYPE_CHECKING:
    from dmoc.problem.problem import Problem

EXPECTED = (
    "expected a state at the start such as 'x' or '-x', a sum such as -x + 0.5 in symbols or "
    "{'x': -1, 'y': 2}, or a pair of one of them and a difference such as ('x', 0.5)"
)


@value_class(frozen=True)
class Relation:
    """A state at the end is a sum of factors times states at the start, and a difference between
    two bounds further."""

    end: str
    terms: tuple[tuple[str, float], ...]
    low: float = 0.0
    high: float = 0.0

    @property
    def fixed(self) -> bool:
        return self.low == self.high

    @property
    def starts(self) -> tuple[str, ...]:
        """The states at the start."""
        return tuple(name for name, _ in self.terms)

    @property
    def kind(self) -> tuple[str, tuple[tuple[str, float], ...], bool, bool, bool]:
        """The relation without its difference: its states, and which bounds there are."""
        return self.end, self.terms, self.fixed, self.low > -np.inf, self.high < np.inf

    @property
    def source(self) -> str:
        """The sum of states at the start, in words."""
        first, *others = (_term(name, factor) for name, factor in self.terms)
        return first + "".join(
            f" - {term[1:]}" if term.startswith("-") else f" + {term}" for term in others
        )


def _term(name: str, factor: float) -> str:
    return name if factor == 1 else f"-{name}" if factor == -1 else f"{factor:g} {name}"


def relations_of(problem: Problem) -> tuple[Relation, ...]:
    """The relations of the end and the start that ``periodic`` states."""
    periodic = problem.periodic
    pairs = periodic.items() if isinstance(periodic, Mapping) else [(n, n) for n in periodic]
    return tuple(_relation(problem, str(end), value) for end, value in pairs)


def carried(problem: Problem, q: Array) -> Array:
    """A position at the end by ``periodic``, from one at the start, shape (nq,) each. Differences
    are middles of their ranges, and as near to zero as they can be where these have one end."""
    end, names = q.copy(), list(problem.kernels.coordinates)
    for r in problem.relations:
        if {r.end, *r.starts} <= {*names}:
            (difference,) = midpoints(np.array([[r.low, r.high]]), np.zeros(1))
            end[names.index(r.end)] = difference + sum(f * q[names.index(n)] for n, f in r.terms)
    return end


def periodic_of(problem: Problem) -> tuple[str, ...] | dict[str, Any]:
    """The periodic states as they were passed: their names, or a mapping without symbols."""
    if isinstance(problem.periodic, Mapping):
        read = by_name(problem.periodic, "periodic")
        return {end: _plain(end, value) for end, value in read.items()}
    turned = problem.kernels.manifest.attitudes
    named = [name_of(name) for name in listed(problem.periodic, "periodic", "states")]
    each = [coordinates_of(problem.kernels, n) if n in turned else [n] for n in named]
    states = [name for names in each for name in names]
    for i, name in enumerate(states):
        _check_known(problem, name)
        if name in states[:i]:
            raise ProblemError(f"periodic names {name!r} twice: give it once.")
    return tuple(states)


def _relation(problem: Problem, end: str, value: Any) -> Relation:
    source, difference = value if isinstance(value, tuple) else (value, 0.0)
    terms = source if isinstance(source, Mapping) else _signed(source)
    _check_known(problem, end)
    for name in terms:
        _check_known(problem, name)
    low, high = interval(difference, f"the difference of {end} in periodic")
    return Relation(end, tuple(terms.items()), low, high)


def _check_known(problem: Problem, name: str) -> None:
    said = said_of(problem.kernels)
    check_known(name, *names_in(problem, "start"), "in periodic", said=said)


def _signed(name: str) -> dict[str, float]:
    """A state, or one with a minus before it."""
    return {name[1:].strip(): -1.0} if name.startswith("-") else {name: 1.0}


def _plain(end: str, value: Any) -> Any:
    """What a state at the end is, without symbols: a name or factors by name, alone or with a
    difference."""
    if isinstance(value, list):
        value = tuple(value)
    if isinstance(value, tuple):
        if len(value) != 2:
            raise ProblemError(f"periodic: {end!r} has {shown(value)}: {EXPECTED}.")
        source, further = value
    else:
        source, further = value, 0.0
    plain, constant = _source(end, source)
    if not constant:
        return (plain, further) if isinstance(value, tuple) else plain
    low, high = interval(further, f"the difference of {end} in periodic")
    return plain, constant + low if low == high else _moved((low, high), constant)


def _moved(bounds: Range, by: float) -> tuple[float | None, float | None]:
    low, high = (bound + by if np.isfinite(bound) else None for bound in bounds)
    return low, high


def _source(end: str, value: Any) -> tuple[str | dict[str, float], float]:
    """The states at the start, and the constant of their sum."""
    if isinstance(value, str):
        return value, 0.0
    if isinstance(value, Mapping):
        factors = by_name(value, f"periodic: {end!r}")
        read = {n: number(f, f"the factor of {n} in periodic") for n, f in factors.items()}
        return _without_zeros(end, value, read), 0.0
    if not hasattr(value, "as_coefficients_dict"):
        raise ProblemError(f"periodic: {end!r} has {shown(value)}: {EXPECTED}.")
    read, constant = {}, 0.0
    for term, factor in value.expand().as_coefficients_dict().items():
        if term.is_number:
            constant += number(term * factor, f"the difference of {end} in periodic")
        elif term.is_Symbol or term.is_Function or term.is_Derivative:
            read[name_of(term)] = number(factor, f"the factor of {name_of(term)} in periodic")
        else:
            raise ProblemError(
                f"periodic: {end!r} has {shown(value)}, where {shown(term)} is no state times a "
                f"number: {EXPECTED}."
            )
    if set(read.values()) == {1.0} and len(read) == 1:
        return next(iter(read)), constant
    return _without_zeros(end, value, read), constant


def _without_zeros(end: str, value: Any, factors: dict[str, float]) -> dict[str, float]:
    kept = {name: factor for name, factor in factors.items() if factor}
    if not kept:
        raise ProblemError(
            f"periodic: {end!r} has {shown(value)}, which no state at the start enters: state "
            f"it in the goal."
        )
    return kept


def start_position_of(problem: Problem) -> Array:
    """The position at the start: fixed values, middles of ranges, and for free ones what
    their bounds have nearest to zero; where neither end says anything of a coordinate, it is
    that of the first surface of the sequence."""
    q = _midway(problem, problem.start_bounds.position, np.zeros(problem.nq))
    (at,) = onto_quantities(problem, "start", onto_first(problem, q)[None])
    return np.asarray(at)


def goal_position_of(problem: Problem) -> Array:
    """The position at the goal: fixed values, middles of ranges, free ones as ``periodic`` says
    or as at the start; moved to where the quantities are that the goal states."""
    at_start = carried(problem, problem.start_position)
    q = _midway(problem, problem.goal_bounds.position, at_start)
    (at,) = onto_quantities(problem, "goal", q[None])
    return np.asarray(at)


def _midway(problem: Problem, bounds: Array, default: Array) -> Array:
    """Middles of ranges, with the quaternions that are not fixed on their sphere."""
    q, fixed = midpoints(bounds, default), bounds[:, 0] == bounds[:, 1]
    return np.where(fixed, q, on_sphere(problem.kernels, q))


def unsaid_of(problem: Problem) -> Array:
    """1 for coordinates of which neither start nor goal say where they are, else 0."""
    ends = np.hstack([problem.start_bounds.position, problem.goal_bounds.position])
    return np.where(np.isinf(ends).all(axis=1), 1.0, 0.0)
