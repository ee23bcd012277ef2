"""Curves of a motion over time, in panels of one quantity and one unit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from dmoc.base.names import of_quaternions
from dmoc.base.tolerances import SAME
from dmoc.motion.scene import resampled
from dmoc.motion.states import PARTS
from dmoc.motion.trajectory import Array, Phase, Trajectory
from dmoc.report.labels import Label, label_of, rate_of, with_index, with_unit

# Units of momenta in SI, in which forces are newton.
MOMENTA = {"m": "N s", "rad": "N m s"}
# Quantities without a unit whose ranges differ by more than this have panels of their own.
APART = 10.0
TITLES = {
    "q": "coordinates",
    "v": "velocities",
    "p": "momenta",
    "u": "inputs",
    "quantities": "quantities",
    "N": "normal forces",
    "T": "friction",
}


@dataclass(frozen=True)
class Curve:
    """A curve."""

    name: str
    label: Label
    number: int  # which decides its colour; a contact has one number in all panels
    values: tuple[Array | None, ...]  # one for each phase, None where it has none
    bounds: tuple[float, ...] = (-np.inf, np.inf)  # lowest and highest value allowed
    # Of friction, which the values keep on both sides of zero; one for each phase, or none.
    limits: tuple[Array | None, ...] = ()
    contact: str = ""


@dataclass(frozen=True)
class Panel:
    """Curves of one quantity, a key of TITLES, with their times in each phase; of forces the
    impulses of each event too."""

    quantity: str
    unit: str
    times: tuple[Array, ...]
    curves: tuple[Curve, ...]
    impulses: tuple[Mapping[str, float], ...] = ()
    grips: frozenset[str] = frozenset()  # places among the contacts, whose units are not known

    @property
    def title(self) -> str:
        """What a panel shows: forces of grips are no normal forces."""
        names = {curve.contact for curve in self.curves}
        own = [TITLES[self.quantity]] if names - self.grips or not names else []
        return " and ".join([*own, "forces of grips"] if names & self.grips else own)

    @property
    def axis(self) -> str:
        """The label of its axis, for Matplotlib: the curve if there is one, and its unit."""
        alone = len(self.curves) == 1 and self.quantity in ("q", "v", "p", "u", "quantities")
        symbol = f"${self.curves[0].label.tex}$"
        text = f"input {symbol}" if self.quantity == "u" else symbol
        return with_unit(text if alone else self.title, self.unit)


def panels_of(motion: Trajectory, beside: Sequence[Trajectory] = ()) -> list[Panel]:
    """Coordinates, velocities, momenta, inputs, quantities and contact forces, those of one unit
    together; for motions that stand beside each other in the same panels.  Of quaternions there are
    angular velocities in the place of rates and momenta."""
    names, units = motion.coordinates, [motion.units.get(name, "") for name in motion.coordinates]
    labels = [label_of(name) for name in names]
    every, turns = beside or (motion,), of_quaternions(names, motion.quantities)
    panels: list[Panel] = []
    for quantity, texts, symbols, measures in (
        ("q", names, labels, units),
        ("v", [f"{name}_dot" for name in names], map(rate_of, labels),
         [f"{unit}/s" if unit else "" for unit in units]),
        ("p", [f"p_{name}" for name in names], [with_index("p", label) for label in labels],
         [MOMENTA.get(unit, "") for unit in units]),
        ("u", motion.inputs, map(label_of, motion.inputs),
         [motion.units.get(name, "") for name in motion.inputs]),
        ("quantities", motion.quantities, map(label_of, motion.quantities),
         [motion.units.get(name, "") for name in motion.quantities]),
    ):  # fmt: skip
        parts = [_course(motion, phase, quantity) for phase in motion.phases]
        bounds = {"q": motion.coordinate_bounds, "u": motion.input_bounds}.get(
            quantity, [motion.limits.get(name, (-np.inf, np.inf)) for name in texts]
        )
        curves = [
            Curve(name, symbol, i, tuple(v[:, i] for _, v in parts), tuple(map(float, bounds[i])))
            for i, (name, symbol) in enumerate(zip(texts, symbols, strict=True))
        ]
        if not texts:
            continue
        values = np.vstack([getattr(p, quantity) for m in every for p in m.phases]).T
        for unit, numbers in _grouped(measures, None if quantity == "u" else values):
            own = tuple(
                curves[i] for i in numbers if quantity not in ("v", "p") or names[i] not in turns
            )
            if not own:
                continue
            panels.append(Panel(quantity, unit, tuple(t for t, _ in parts), own))
    return [*panels, *_forces(motion)]


def _grouped(units: Sequence[str], values: Array | None) -> list[tuple[str, list[int]]]:
    """Numbers of quantities by their units, in order; those without a unit by their ranges, if
    values are given."""
    groups: list[tuple[str, list[int]]] = []
    for i, unit in enumerate(units):
        for other, numbers in groups:
            if other == unit and (unit or values is None or _alike(values[i], values[numbers[0]])):
                numbers.append(i)
                break
        else:
            groups.append((unit, [i]))
    return groups


def _alike(a: Array, b: Array) -> bool:
    """Whether two ranges fit on one axis; what stands still fits on any."""
    spans = sorted((float(np.ptp(a)), float(np.ptp(b))))
    return spans[0] <= SAME * spans[1] or spans[1] <= APART * spans[0]


def _course(motion: Trajectory, phase: Phase, quantity: str) -> tuple[Array, Array]:
    """Times and values along a phase: coordinates are round between few nodes too, and steps of
    constant inputs have both of their ends; a phase without steps has the last inputs."""
    if quantity == "u" and not phase.steps:
        return phase.t, motion.last_inputs[None]
    if quantity == "q" and np.isfinite(phase.v).all():
        return resampled(phase.t, phase.q, phase.v)
    if quantity == "u" and motion.input_form.width:
        return motion.input_times(phase), phase.u
    if quantity == "u":
        return np.repeat(phase.t, 2)[1:-1], np.repeat(phase.u, 2, axis=0)
    if quantity == "quantities" and phase.steps:
        h = np.diff(phase.t)[:, None]
        return (phase.t[:-1, None] + h * np.linspace(0, 1, PARTS)).ravel(), phase.quantities
    return phase.t, getattr(phase, quantity)


def contacts_of(motion: Trajectory) -> dict[str, int]:
    """Names of all contacts along a motion, with their numbers."""
    names: dict[str, None] = {}
    for phase in motion.phases:
        names |= dict.fromkeys([*phase.closed, *phase.rubbing])
    for event in motion.collisions:
        names |= dict.fromkeys([*event.impulses, *event.tractions])
    return {name: i for i, name in enumerate(names)}


def _forces(motion: Trajectory) -> Iterator[Panel]:
    """Normal forces and friction; where nothing else shows them, normal impulses beside those of
    friction."""
    phases, events = motion.phases, motion.collisions
    grips = frozenset(place for places in motion.grips.values() for place in places)
    curves: dict[str, list[Curve]] = {"N": [], "T": []}
    for name, number in contacts_of(motion).items():
        for letter, own in curves.items():
            values = tuple(_force(phase, letter, name) for phase in phases)
            if any(part is not None for part in values):
                limits = tuple(_limit(motion, phase, name) for phase in phases)
                symbol = "R" if name in grips else letter
                own.append(
                    Curve(
                        f"{letter} {name}", with_index(symbol, label_of(name)), number, values,
                        limits=limits if letter == "T" else (), contact=name,
                    )
                )  # fmt: skip
    alone = not curves["N"]
    impulses: dict[str, list[Mapping[str, float]]] = {
        "N": [e.impulses for e in events],
        "T": [{**(e.impulses if alone else {}), **e.tractions} for e in events],
    }
    for letter, own in curves.items():
        if own:
            times = tuple(phase.t for phase in phases)
            unit = "" if grips & {curve.contact for curve in own} else "N"
            yield Panel(letter, unit, times, tuple(own), tuple(impulses[letter]), grips)


def _force(phase: Phase, letter: str, name: str) -> Array | None:
    """The force of a contact along a phase that has steps."""
    values, names = (
        (phase.normal, phase.closed) if letter == "N" else (phase.tangential, tuple(phase.rubbing))
    )
    return values[:, names.index(name)] if name in names and phase.steps else None


def _limit(motion: Trajectory, phase: Phase, name: str) -> Array | None:
    """Largest friction along a phase, shape (N + 1,), if its contact rubs there."""
    if name not in phase.rubbing or not phase.steps:
        return None
    return motion.friction_limits(phase)[:, list(phase.rubbing).index(name)]
