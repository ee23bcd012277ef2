"""Values that belong to a model, read from what a user gives: its parameters and the
coefficients of restitution."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from dmoc.base.arguments import ErrorKind, check_known, check_magnitude, is_number, number, shown
from dmoc.base.errors import ProblemError
from dmoc.base.names import name_of
from dmoc.codegen.kernels import Array, Kernels


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
