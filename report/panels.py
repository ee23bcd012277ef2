"""Panels of a motion over time: coordinates, velocities, momenta and inputs, those of one unit
together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from dmoc.motion.scene import resampled
from dmoc.motion.trajectory import Array, Phase, Trajectory
from dmoc.report import contacts
from dmoc.report.canvas import legend_beside, plain, symbol
from dmoc.report.style import DOTS, Style

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

Panel: TypeAlias = "tuple[str, Callable[[Axes], None]]"
# Units of momenta in SI, in which forces are newton.
MOMENTA = {"m": "N s", "rad": "N m s"}
# Coordinates without a unit whose ranges differ by more than this have panels of their own.
APART = 10.0
# Coordinates, velocities and momenta: in words, and as mathematics.
WORDS = {"q": "coordinates", "v": "velocities", "p": "momenta"}
MARKS = {"q": "{}", "v": r"\dot{{{}}}", "p": "p_{{{}}}"}


def panels_of(trajectory: Trajectory, velocities: bool, style: Style) -> list[Panel]:
    """Labels of the panels from top to bottom, and what draws them."""
    names, units = trajectory.coordinates, trajectory.units
    found = _states(trajectory, "q", {n: units.get(n, "") for n in names}, style)
    if velocities:
        rates = {n: f"{units[n]}/s" if units.get(n) else "" for n in names}
        found += _states(trajectory, "v", rates, style)
    momenta = {n: MOMENTA.get(units.get(n, ""), "") for n in names}
    found += _states(trajectory, "p", momenta, style)
    found += _inputs(trajectory, style)
    if contacts.has_normal_forces(trajectory):
        found.append(
            ("normal forces [N]", lambda axes: contacts.normal_forces(axes, trajectory, style))
        )
    if contacts.has_friction(trajectory):
        found.append(
            ("friction [N]", lambda axes: contacts.friction_forces(axes, trajectory, style))
        )
    return found


def grouped(
    units: Sequence[str], values: Sequence[Array] | None = None
) -> list[tuple[str, list[int]]]:
    """Numbers of quantities by their units, in order; those without a unit by their ranges, if
    values are given."""
    found: list[tuple[str, list[int]]] = []
    for i, unit in enumerate(units):
        for other, numbers in found:
            if other == unit and (unit or values is None or _alike(values[i], values[numbers[0]])):
                numbers.append(i)
                break
        else:
            found.append((unit, [i]))
    return found


def _alike(a: Array, b: Array) -> bool:
    """Whether two ranges fit on one axis; what stands still fits on any."""
    spans = sorted((float(np.ptp(a)), float(np.ptp(b))))
    return spans[0] <= 1e-9 * spans[1] or spans[1] <= APART * spans[0]


def _states(
    trajectory: Trajectory, quantity: str, units: dict[str, str], style: Style
) -> list[Panel]:
    values = np.vstack([getattr(phase, quantity) for phase in trajectory.phases]).T
    texts = [_state(trajectory, quantity, i) for i in range(len(units))]
    panels: list[Panel] = []
    for unit, numbers in grouped(list(units.values()), list(values)):
        label = texts[numbers[0]] if len(numbers) == 1 else WORDS[quantity]

        def draw(axes: Axes, numbers: list[int] = numbers) -> None:
            lines = draw_states(axes, trajectory, quantity, numbers, style)
            if len(lines) > 1:
                legend_beside(axes, lines)

        panels.append((with_unit(label, unit), draw))
    return panels


def _state(trajectory: Trajectory, quantity: str, i: int) -> str:
    """A coordinate, velocity or momentum as mathematics."""
    return f"${MARKS[quantity].format(symbol(trajectory.coordinates[i]))}$"


def with_unit(label: str, unit: str) -> str:
    """The label of an axis."""
    return f"{label} [{plain(unit)}]" if unit else label


def draw_states(
    axes: Axes,
    trajectory: Trajectory,
    quantity: str,
    numbers: list[int],
    style: Style,
) -> list[Artist]:
    """Draw curves of the phases, joined by dots where they jump, and return one of each for a
    legend."""
    first: list[Artist] = []
    for place, i in enumerate(numbers):
        stroke = style.stroke(i, place)
        text = _state(trajectory, quantity, i)
        drawn = [
            axes.plot(*_curve(phase, quantity, i), **stroke, label=text)[0]
            for phase in trajectory.phases
        ]
        first.append(drawn[0])
        if quantity == "q":
            continue
        for before, after in pairwise(trajectory.phases):
            ends = (getattr(before, quantity)[-1, i], getattr(after, quantity)[0, i])
            look = {"color": stroke["color"], "linestyle": DOTS, "lw": 1.2, "gid": "jump"}
            axes.plot([before.t[-1]] * 2, ends, **look)
    return first


def _curve(phase: Phase, quantity: str, i: int) -> tuple[Array, Array]:
    """Times and values of a coordinate, velocity or momentum; coordinates are round between few
    nodes too."""
    if quantity == "q" and np.isfinite(phase.v).all():
        t, q = resampled(phase.t, phase.q[:, [i]], phase.v[:, [i]])
        return t, q[:, 0]
    return phase.t, getattr(phase, quantity)[:, i]


def _inputs(trajectory: Trajectory, style: Style) -> list[Panel]:
    units = [trajectory.units.get(name, "") for name in trajectory.inputs]
    panels: list[Panel] = []
    for unit, numbers in grouped(units):
        name = f"input ${symbol(trajectory.inputs[numbers[0]])}$"

        def draw(axes: Axes, numbers: list[int] = numbers) -> None:
            _input_panel(axes, trajectory, numbers, style)

        panels.append((with_unit(name if len(numbers) == 1 else "inputs", unit), draw))
    return panels


def _input_panel(axes: Axes, trajectory: Trajectory, numbers: list[int], style: Style) -> None:
    curves = draw_inputs(axes, trajectory, numbers, style)
    handles = curves if len(curves) > 1 else []
    values = np.vstack([phase.u[:, numbers] for phase in trajectory.phases])
    handles += _bounds(axes, trajectory, numbers, (float(values.min()), float(values.max())), style)
    if handles:
        legend_beside(axes, handles)


def draw_inputs(
    axes: Axes, trajectory: Trajectory, numbers: list[int], style: Style
) -> list[Artist]:
    """Draw inputs as they are within the steps, and return one curve of each for a legend."""
    first: list[Artist] = []
    for place, i in enumerate(numbers):
        look: dict[str, Any] = style.stroke(i, place)
        look["label"] = f"${symbol(trajectory.inputs[i])}$"
        drawn: list[Artist] = []
        for phase in trajectory.phases:
            values = phase.u[:, i]
            if trajectory.input_form.width:
                drawn += axes.plot(trajectory.input_times(phase), values, **look)
            else:
                drawn.append(axes.stairs(values, phase.t, baseline=None, lw=1.5, **look))
        first.append(drawn[0])
    return first


def _bounds(
    axes: Axes,
    trajectory: Trajectory,
    numbers: list[int],
    reach: tuple[float, float],
    style: Style,
) -> list[Artist]:
    """Lines at bounds near the values; what else bounds the inputs as texts: a far line would
    flatten the curves."""
    from matplotlib.lines import Line2D

    low, high = reach
    span = max(high - low, 1e-12)
    said: list[Artist] = []
    near = False
    for i in numbers:
        colour = style.colours[i % len(style.colours)]
        far = ["", ""]
        for side, bound in enumerate(trajectory.input_bounds[i]):
            if low - span <= bound <= high + span:
                axes.axhline(bound, color=colour, linestyle=DOTS, linewidth=1.2, gid="limit")
                near = True
            elif np.isfinite(bound):
                far[side] = rf"\leq {bound:g}" if side else rf"{bound:g}\leq "
        if any(far):
            text = f"${far[0]}{symbol(trajectory.inputs[i])}{far[1]}$"
            said.append(Line2D([], [], linestyle="none", label=text))
    if near:
        said.append(Line2D([], [], color=style.muted, linestyle=DOTS, lw=1.2, label="bounds"))
    return said
