"""Curves of a motion over time, in panels of one quantity and one unit."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import groupby
from typing import TypedDict

import numpy as np

from dmoc.motion.trajectory import Array, Phase, Trajectory
from dmoc.report.animation.numbers import rounded

# Samples of a phase that are kept at most: a curve has no more pixels.
MOST = 400
GREEK = dict(
    zip(
        "alpha beta gamma delta epsilon zeta eta theta kappa lambda mu nu xi rho sigma tau phi chi "
        "psi omega".split(),
        "αβγδεζηθκλμνξρστφχψω",
        strict=True,
    )
)


class Label(TypedDict):
    """A name as mathematics: what stands on the line and what below it."""

    head: str
    tail: str


class Curve(TypedDict):
    """A curve: one list of values for each phase, None where it has none; a bound on each side,
    None where there is none; limits of friction as another list for each phase, which the values
    keep on both sides of zero."""

    name: str
    label: Label
    contact: str
    values: list[list[float] | None]
    low: float | None
    high: float | None
    limits: list[list[float] | None]


class Panel(TypedDict):
    """Curves of one quantity, with their times in each phase."""

    what: str
    title: str
    unit: str
    times: list[list[float]]
    curves: list[Curve]


def label(name: str) -> Label:
    """A name as mathematics: Greek letters, and what follows an underscore below the line."""
    head, _, tail = name.partition("_")
    parts = [GREEK.get(part, part) for part in tail.split("_") if part]
    return {"head": GREEK.get(head, head), "tail": ",".join(parts)}


def panels_of(motion: Trajectory) -> list[Panel]:
    """Positions, velocities, momenta, inputs and contact forces, each unit in a panel of its
    own."""
    panels = [*_states(motion), *_inputs(motion)]
    closed = dict.fromkeys(name for phase in motion.phases for name in phase.closed)
    rubbing = dict.fromkeys(name for phase in motion.phases for name in phase.rubbing)
    if closed:
        curves = [_force(motion, name, "N", _normal, None) for name in closed]
        panels.append(_panel("normal", "normal forces", "N", _times(motion), curves))
    if rubbing:
        curves = [_force(motion, name, "T", _friction, _friction_limit) for name in rubbing]
        panels.append(_panel("friction", "friction", "N", _times(motion), curves))
    return panels


def _states(motion: Trajectory) -> Iterator[Panel]:
    """Positions and velocities by their units, and momenta."""
    times, names = _times(motion), motion.coordinates
    for unit, columns in _by_unit(names, motion.units):
        curves = [
            _curve(names[i], label(names[i]), [p.q[:, i] for p in motion.phases],
                   motion.coordinate_bounds[i])
            for i in columns
        ]  # fmt: skip
        yield _panel("positions", "positions", unit, times, curves)
    for unit, columns in _by_unit(names, motion.units):
        curves = [
            _curve(f"{names[i]}_dot", _dotted(names[i]), [p.v[:, i] for p in motion.phases])
            for i in columns
        ]
        yield _panel("velocities", "velocities", f"{unit}/s" if unit else "", times, curves)
    for unit, columns in _by_unit(names, motion.units):
        curves = [
            _curve(f"p_{names[i]}", label(f"p_{names[i]}"), [p.p[:, i] for p in motion.phases])
            for i in columns
        ]
        yield _panel("momenta", "momenta", _MOMENTA.get(unit, ""), times, curves)


_MOMENTA = {"m": "N s", "rad": "N m s"}


def _inputs(motion: Trajectory) -> Iterator[Panel]:
    names = motion.inputs
    courses = [_input_course(motion, phase) for phase in motion.phases]
    for unit, columns in _by_unit(names, motion.units):
        curves = [
            _curve(names[i], label(names[i]), [u[:, i] for _, u in courses], motion.input_bounds[i])
            for i in columns
        ]
        yield _panel("inputs", "inputs", unit, [t for t, _ in courses], curves)


def _input_course(motion: Trajectory, phase: Phase) -> tuple[Array, Array]:
    """Times and values of the inputs of a phase as a polygon: steps of constant inputs have both
    of their ends."""
    if motion.input_form.width:
        return motion.input_times(phase), phase.u
    return np.repeat(phase.t, 2)[1:-1], np.repeat(phase.u, 2, axis=0)


def _times(motion: Trajectory) -> list[Array]:
    return [phase.t for phase in motion.phases]


def _by_unit(names: Sequence[str], units: Mapping[str, str]) -> Iterator[tuple[str, list[int]]]:
    """Units in the order in which they come, and which names have them."""
    seen = list(dict.fromkeys(units.get(name, "") for name in names))
    order = sorted(range(len(names)), key=lambda i: seen.index(units.get(names[i], "")))
    for unit, columns in groupby(order, key=lambda i: units.get(names[i], "")):
        yield unit, list(columns)


def _dotted(name: str) -> Label:
    """The name of a rate: a letter with a dot, or a word with a prime."""
    found = label(name)
    found["head"] += "\N{COMBINING DOT ABOVE}" if len(found["head"]) == 1 else "\N{PRIME}"
    return found


def _force(
    motion: Trajectory,
    name: str,
    letter: str,
    values: Callable[[Trajectory, Phase, str], Array | None],
    limits: Callable[[Trajectory, Phase, str], Array | None] | None,
) -> Curve:
    """The force of a contact, in the phases that have it."""
    symbol: Label = {"head": letter, "tail": label(name)["head"]}
    if label(name)["tail"]:
        symbol["tail"] += "," + label(name)["tail"]
    curve = _curve(f"{letter} {name}", symbol, [values(motion, p, name) for p in motion.phases])
    curve["contact"] = name
    if limits is not None:
        found = [limits(motion, phase, name) for phase in motion.phases]
        curve["limits"] = [None if v is None else rounded(_thinned(v)) for v in found]
    return curve


def _normal(_: Trajectory, phase: Phase, name: str) -> Array | None:
    return phase.normal[:, phase.closed.index(name)] if name in phase.closed else None


def _friction(_: Trajectory, phase: Phase, name: str) -> Array | None:
    if name not in phase.rubbing:
        return None
    return phase.tangential[:, list(phase.rubbing).index(name)]


def _friction_limit(motion: Trajectory, phase: Phase, name: str) -> Array | None:
    if name not in phase.rubbing:
        return None
    limits = motion.friction_limits(phase)[:, list(phase.rubbing).index(name)]
    return limits if np.isfinite(limits).all() else None


def _curve(
    name: str,
    symbol: Label,
    values: Iterable[Array | None],
    bounds: Sequence[float] | Array = (-np.inf, np.inf),
) -> Curve:
    low, high = (float(b) if np.isfinite(b) else None for b in bounds)
    return {
        "name": name,
        "label": symbol,
        "contact": "",
        "values": [None if v is None else rounded(_thinned(v)) for v in values],
        "low": low,
        "high": high,
        "limits": [],
    }


def _panel(what: str, title: str, unit: str, times: Iterable[Array], curves: list[Curve]) -> Panel:
    return {
        "what": what,
        "title": title,
        "unit": unit,
        "times": [rounded(_thinned(t)) for t in times],
        "curves": curves,
    }


def _thinned(values: Array) -> Array:
    """At most MOST of the values, evenly, with both ends."""
    if len(values) <= MOST:
        return values
    kept: Array = values[np.linspace(0, len(values) - 1, MOST).round().astype(int)]
    return kept
