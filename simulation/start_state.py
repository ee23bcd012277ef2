"""The state that a simulation starts from, as it is passed: rows of numbers or mappings."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from dmoc.base.arguments import array, check_known, check_largest, number, shown
from dmoc.base.errors import SimulationError
from dmoc.base.names import omega_names, velocity_name
from dmoc.codegen.kernels import Array, Kernels
from dmoc.mechanics.attitudes import coordinates_of, in_coordinates, in_rates, said_of
from dmoc.mechanics.model_values import by_name


def state_of(kernels: Kernels, position: Any, velocity: Any) -> tuple[Array, Array]:
    """Position and velocity, shape (nq,) each.  A mapping may name attitudes and their angular
    velocities; an attitude that it leaves out is that of the frame before it."""
    names = kernels.coordinates
    if isinstance(position, Mapping):
        stated = by_name(position, "position", SimulationError)
        position = in_coordinates(kernels, stated, "position", SimulationError)
        for name in kernels.manifest.attitudes:
            own = coordinates_of(kernels, name)
            position |= {} if {*own} & {*position} else {own[0]: 1.0}
    said = said_of(kernels)
    q = vector(position, names, "position", said=said)
    if velocity is None:
        return q, np.zeros(len(names))
    if isinstance(velocity, Mapping):
        stated = by_name(velocity, "velocity", SimulationError)
        for spin in map(omega_names, kernels.manifest.attitudes):
            for name in {*spin} & {*stated}:
                number(stated[name], f"velocity of {name}", SimulationError)
        places = dict(zip(names, q.tolist(), strict=True))
        velocity = in_rates(kernels, stated, places, "velocity", SimulationError)
    rates = [velocity_name(name) for name in names]
    return q, vector(velocity, names, "velocity", rates, lambda _: said(rates))


def vector(
    values: Any, names: Sequence[str], what: str, other: Sequence[str] = (),
    said: Callable[[list[str]], list[str]] = list,
) -> Array:  # fmt: skip
    """Numbers by coordinate, shape (names,), of which a mapping leaves out zeros; ``other`` are
    further names that the coordinates have in it, ``said`` those that messages list."""
    numbers = values
    if isinstance(values, Mapping):
        columns = {name: j for j, name in (*enumerate(other), *enumerate(names))}
        by_column: dict[int, Any] = {}
        for name, value in by_name(values, what, SimulationError).items():
            check_known(name, columns, "coordinate", f"in {what}", SimulationError, said=said)
            if columns[name] in by_column:
                raise SimulationError(
                    f"{what} gives {names[columns[name]]!r} twice, also as {name!r}: give it once."
                )
            by_column[columns[name]] = value
        numbers = [by_column.get(j, 0.0) for j in range(len(names))]
    vector = array(numbers)
    if vector is None or vector.shape != (len(names),) or not np.isfinite(vector).all():
        raise SimulationError(
            f"{what} = {shown(values)}: expected {len(names)} finite numbers ({', '.join(names)})."
        )
    for name, value in zip(names, vector.tolist(), strict=True):
        check_largest(value, f"{what} of {name}", SimulationError)
    return np.array(vector)
