"""The unknown accelerations and forces y = (a | N | T | R) at the places where quantities that
contain forces stand.

They are places of steps, in the order of time: all nodes of each step where steps have nodes
inside, each node of a phase where inputs are linear between nodes, else the middle of each step.
Both ends of the motion have more of them, where something is said of quantities there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from dmoc.base.discretisation import InputForm
from dmoc.base.records import record, value_class
from dmoc.codegen.kernels import Array
from dmoc.mechanics.touch import Touch
from dmoc.program.blocks import Bools, Index, Numbering
from dmoc.program.scale import Scale
from dmoc.program.stations import Stations


@value_class(frozen=True)
class Wanted:
    """Where forces are unknowns: along the motion, at its start, at its goal; ``contained`` says
    that the model's quantities contain any."""

    contained: bool = False
    along: bool = False
    start: bool = False
    goal: bool = False


@record(frozen=True, eq=False)
class ForceUnknowns:
    """The unknowns, NOWHERE where something is open or nothing is wanted; without columns where no
    quantity contains forces.

    Attributes
    ----------
    y : array of int, shape (sites, ny)
    y_ends : array of int, shape (2, ny)
    step : array of int, shape (sites,)
        The step of each site.
    share : array, shape (sites,)
        Its place in the step, in words ``place`` of its row.
    """

    y: Index
    y_ends: Index
    step: Index
    share: Array
    place: Callable[[int], str]

    @classmethod
    def of(
        cls, block: Numbering, wanted: Wanted, form: InputForm, stations: Stations,
        names: tuple[Sequence[str], Sequence[str]], touch: Touch,
    ) -> ForceUnknowns:  # fmt: skip
        """``names`` are those of coordinates and constraints."""
        step, phase = stations.step, stations.phase
        share = np.sort(stations.scheme.nodes)[stations.place - stations.scheme.degree * step]
        between = not (stations.own or form.width)
        if between:
            step = np.arange(sum(stations.steps))
            phase, share = np.repeat(np.arange(len(stations.steps)), stations.steps), 0.5 + 0 * step

        def place(r: int) -> str:
            return f"in step {r}" if between else stations.label(r)

        labels, ends = labels_of_forces(*names, touch), ("at the start", "at the goal")
        there = there_are_forces(*names, touch)[:, : len(labels) * wanted.contained]
        y = block(
            "y",
            there[phase] & wanted.along,
            lambda r, j: f"{labels[j]} {place(r)}",
            lambda s: sizes(s)[: there.shape[1]],
        )
        y_ends = block(
            "y_ends",
            there[[0, -1]] & np.array([wanted.start, wanted.goal])[:, None],
            lambda r, j: f"{labels[j]} {ends[r]}",
            lambda s: sizes(s)[: there.shape[1]],
        )
        return cls(y.index, y_ends.index, step, share, place)

    @property
    def count(self) -> int:
        """Number of accelerations and forces that kernels of quantities take."""
        return int(self.y.shape[1])


def sizes(s: Scale) -> Array:
    """Typical accelerations and forces, shape (ny,)."""
    return np.asarray(np.concatenate([s.v, s.lam, s.friction, s.reaction]) / s.time)


def labels_of_forces(coordinates: Sequence[str], joints: Sequence[str], touch: Touch) -> list[str]:
    """Names of the accelerations and forces."""
    names = touch.contacts
    return [
        *(f"acceleration of {name}" for name in coordinates),
        *(f"normal force of {name}" for name in names.surfaces),
        *(f"friction force of {name}" for name in names.tangents),
        *(f"force of constraint {name}" for name in joints),
    ]


def there_are_forces(coordinates: Sequence[str], joints: Sequence[str], touch: Touch) -> Bools:
    """Which accelerations and forces there are in each phase, shape (phases, ny)."""
    held = np.array([bool(joints) or not mode.free for mode in touch.modes])[:, None]
    a, R = (np.repeat(held, len(names), axis=1) for names in (coordinates, joints))
    return np.hstack([a, touch.is_closed, touch.rubs, R])
