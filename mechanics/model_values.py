"""Values that belong to a model, read from what a user gives: its parameters and the
coefficients of restitution."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np

from dmoc.base.arguments import (
    ErrorKind,
    check_known,
    check_magnitude,
    is_number,
    is_row,
    number,
    shown,
)
from dmoc.base.errors import ProblemError
from dmoc.base.names import name_of
from dmoc.codegen.kernels import Array, Kernels

# A parameter's value, or one for each phase.
ParameterValue: TypeAlias = float | Sequence[float] | Array


def parameter_rows(
    kernels: Kernels, changes: Mapping[Any, Any], phases: int | None, error: ErrorKind
) -> Array:
    """Parameter values in the model's order by phase, shape (phases, npar), or one row that all
    phases have: the model's own, some of them changed, to a number or to one for each phase. Where
    None says that nobody knows how many phases there are, the longest list does."""
    stated = by_name(changes, "parameters", error)
    lists = {n: list(x) for n, x in stated.items() if is_row(x)}
    if phases is None:
        phases = max((len(x) for x in lists.values()), default=1) or 1
    for name, values in lists.items():
        if len(values) != phases:
            several = f"a number, or one for each of the {phases} phases, not {len(values)}"
            raise error(
                f"parameter {name} = {shown(stated[name])}: expected "
                f"{several if phases > 1 else 'a number, as there is one phase'}."
            )
    each = [{n: x[i] for n, x in lists.items()} for i in range(phases if lists else 1)]
    return np.concatenate([parameter_row(kernels, {**stated, **own}, error) for own in each])


def parameter_row(
    kernels: Kernels, changes: Mapping[Any, Any], error: ErrorKind = ProblemError
) -> Array:
    """Parameter values in the model's order, shape (1, npar): the model's own, some of them
    changed."""
    values = kernels.parameters
    for name, value in by_name(changes, "parameters", error).items():
        check_known(name, values, "parameter", error=error)
        values[name] = stated = number(value, f"parameter {name}", error)
        # what follows from others by rounding may be a tiny number, which harms nothing
        check_magnitude(max(abs(stated), 1.0), stated, f"parameter {name}", error)
    for name, value in values.items():
        if value is None:
            raise error(
                f"parameter {name} of model {kernels.name!r} has no value: set it ({name}=...)."
            )
    return np.array([list(values.values())], dtype=float)


def parameter_in_words(value: Any) -> str:
    """The value of a parameter, or its values by phase."""
    if is_row(value):
        return ", then ".join(f"{float(x):g}" for x in value)
    return f"{float(value):g}"


def restitution_row(kernels: Kernels, values: Any, error: ErrorKind = ProblemError) -> Array:
    """Coefficients of restitution in the order of the surfaces, shape (nc,); not a number where
    the law of the model says it.

    Given is one for all surfaces, or a mapping from surfaces; those that it leaves out have the
    law of the model, which None stands for, and are elastic where that has none.  Grips close
    plastically.
    """
    surfaces, laws = kernels.surfaces, kernels.manifest.restitution
    values = {} if values is None else values
    plastic = {place for places in kernels.manifest.grips.values() for place in places}
    if not isinstance(values, Mapping):
        e = _coefficient(values, "restitution", error)
        values = dict.fromkeys([s for s in surfaces if s not in plastic], e)
    named = by_name(values, "restitution", error) | dict.fromkeys(plastic, 0.0)
    for surface in named:
        if surface in kernels.manifest.grips and values.get(surface, 0.0) != 0:
            raise error(
                f"restitution of {surface!r} = {shown(values[surface])}: a grip closes without "
                "rebound; leave it out."
            )
        if surface not in surfaces and surface not in kernels.manifest.grips:
            among = f"expected one of {', '.join(surfaces)}" if surfaces else "the model has none"
            raise error(f"restitution of {shown(surface)}: unknown surface, {among}.")
    coefficients = [
        np.nan
        if s in laws and named.get(s) is None
        else _coefficient(named.get(s, 1.0), f"restitution of {s!r}", error)
        for s in surfaces
    ]
    return np.array(coefficients, dtype=float)


def _coefficient(value: Any, what: str, error: ErrorKind) -> float:
    if not is_number(value) or not 0 <= number(value, what, error) <= 1:
        raise error(f"{what} = {shown(value)}: expected a number from 0 (plastic) to 1 (elastic).")
    return float(value)


def by_name(values: Any, what: str, error: ErrorKind = ProblemError) -> dict[str, Any]:
    """Read a mapping from names, as texts or symbols, to values."""
    if not isinstance(values, Mapping):
        raise error(f"{what} = {shown(values)}: expected a mapping from names to values.")
    named: dict[str, Any] = {}
    for key, value in values.items():
        name = name_of(key)
        if name in named:
            raise error(
                f"{what} gives {shown(name)} twice, as a text and as a symbol: give it once."
            )
        named[name] = value
    return named
