"""Motions as tables for other programs: data frame, CSV, JSON, and xarray.

A table has a row for each node of each phase, so that the time of a collision has two, of the state
before and after it.  Inputs that are constant in a step stand in the row where the step begins; in
the last row of a phase, where none begins, those of the step that ends.  Inputs that may jump at
every node have two rows there, of both sides.
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from dmoc.base.errors import MissingExtraError, MotionError
from dmoc.base.names import velocity_name
from dmoc.motion.states import PARTS, Names, forces_in, phase_forces
from dmoc.motion.trajectory import Array, Phase, Trajectory

if TYPE_CHECKING:
    from pandas import DataFrame
    from xarray import Dataset

# By the ending of a file.
FORMATS = ("csv", "json")


def columns(motion: Trajectory) -> dict[str, Array]:
    """The table of a motion by columns: time, phase, coordinates, velocities, momenta, inputs,
    quantities, and the forces of those contacts that have any, shape (n,) each."""
    parts = [_rows(motion, phase, number) for number, phase in enumerate(motion.phases)]
    whole = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    places, shown = Names.of(motion).places, forces_in(motion)
    order = sorted(places, key=lambda name: (places[name][0] != "t", places[name][0] != "phase"))
    touching = {"normal": list(motion.restitution), "tangential": list(motion.friction)}
    table = {}
    for name in order:
        part, column = places[name]
        if part not in touching or touching[part][column or 0] in shown:
            table[name] = whole[part] if column is None else whole[part][:, column]
    return table


def _rows(motion: Trajectory, phase: Phase, number: int) -> dict[str, Array]:
    """The rows of a phase, by the fields of a state, shape (rows, size) each."""
    n, form, u = phase.steps, motion.input_form, phase.u
    if not n:
        node = begins = np.zeros(1, dtype=np.intp)
        u = motion.last_inputs[None]
    elif form.jumps:
        node, begins = np.repeat(np.arange(n + 1), 2)[1:-1], np.arange(2 * n)
    else:
        node, begins = np.arange(n + 1), np.minimum(np.arange(n + 1), len(phase.u) - 1)
    normal, tangential, reaction = phase_forces(motion, phase)
    return {
        "t": phase.t[node], "phase": np.full(len(node), number), "q": phase.q[node],
        "v": phase.v[node], "p": phase.p[node], "u": u[begins], "normal": normal[node],
        "tangential": tangential[node], "reaction": reaction[node],
        "quantities": _quantities(phase, form.jumps),
    }  # fmt: skip


def _quantities(phase: Phase, jumps: bool) -> Array:
    """Quantities at the nodes, or on both sides of them, shape (rows, nz)."""
    if not phase.steps:
        return phase.quantities.reshape(1, -1)
    ends = phase.quantities.reshape(phase.steps, PARTS, -1)[:, [0, -1]]
    return ends.reshape(2 * phase.steps, -1) if jumps else np.vstack([ends[:, 0], ends[-1:, 1]])


def units(motion: Trajectory) -> dict[str, str]:
    """Units of the columns, where they are known: the model gives those of coordinates and inputs,
    times are in seconds and contact forces in newton, but for those of grips."""
    names = {"t": "s"} | dict(motion.units)
    names |= {
        velocity_name(name): f"{motion.units[name]}/s"
        for name in motion.coordinates
        if name in motion.units
    }
    own, grips = Names.of(motion), {name for of in motion.grips.values() for name in of}
    contacts = {"normal": own.surfaces, "tangential": own.tangents}
    return names | {
        name: "N"
        for name, (part, i) in own.places.items()
        if part in contacts and i is not None and contacts[part][i] not in grips
    }


def to_csv(motion: Trajectory) -> str:
    """The table as comma-separated values with all digits; the header has units in brackets."""
    unit, table = units(motion), columns(motion)
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(f"{name} [{unit[name]}]" if name in unit else name for name in table)
    writer.writerows(zip(*(column.tolist() for column in table.values()), strict=True))
    return stream.getvalue()


def to_json(motion: Trajectory) -> str:
    """The motion as a JSON object: model, parameters, units, columns, and the collisions between
    the phases; null for what is not finite."""
    table = {name: column.tolist() for name, column in columns(motion).items()}
    document = {
        "model": motion.model,
        "order": motion.order,
        "controls": motion.controls,
        "parameters": dict(motion.parameters),
        "units": {name: unit for name, unit in units(motion).items() if name in table},
        "columns": {name: [_finite(x) for x in values] for name, values in table.items()},
        "collisions": [
            {"event": c.word, "time": c.time, "impulse": c.impulse, "grazes": c.grazes}
            for c in motion.collisions
        ],
    }
    return json.dumps(document, indent=1) + "\n"


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None


WRITERS: dict[str, Callable[[Trajectory], str]] = {"csv": to_csv, "json": to_json}


def written_as(ending: str) -> Callable[[Trajectory], str]:
    """The function that writes tables of an ending, as "csv"; an unknown ending is refused."""
    if ending not in WRITERS:
        endings = " or ".join(f".{name}" for name in WRITERS)
        raise MotionError(
            f"{ending or 'no ending'!r} is no format of a table: end it in {endings}."
        )
    return WRITERS[ending]


def to_frame(motion: Trajectory) -> DataFrame:
    """The table as a pandas DataFrame with the units in ``attrs["units"]``.

    Raises
    ------
    MissingExtraError
        If pandas is not installed.
    """
    table = columns(motion)
    frame: DataFrame = _package("pandas", "a data frame").DataFrame(table)
    frame.attrs["units"] = {name: unit for name, unit in units(motion).items() if name in table}
    return frame


def to_xarray(motion: Trajectory) -> Dataset:
    """The table as an xarray Dataset over the dimension ``time``, with the coordinates time and
    phase, and units as attributes; ``dataset.groupby("phase")`` takes the phases apart.

    Raises
    ------
    MissingExtraError
        If xarray is not installed.
    """
    unit, table = units(motion), columns(motion)
    (t, times), (phase, numbers), *others = table.items()
    dataset: Dataset = _package("xarray", "a dataset").Dataset(
        {
            name: ("time", column, {"units": unit[name]} if name in unit else {})
            for name, column in others
        },
        coords={"time": ("time", times, {"units": unit[t]}), phase: ("time", numbers)},
        attrs={"model": motion.model, "order": motion.order},
    )
    return dataset


def _package(name: str, what: str) -> Any:
    try:
        return import_module(name)
    except ModuleNotFoundError:
        raise MissingExtraError(
            f"{name} is needed for {what}: install it with `pip install {name}`, or take to_csv()."
        ) from None
