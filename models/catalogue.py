"""What is shipped, by name.  Importing this module needs no SymPy; making a system does."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from importlib import import_module
from math import pi
from typing import TYPE_CHECKING, Any

from dmoc.base.records import value_class

if TYPE_CHECKING:
    from dmoc.symbolic.system import MechanicalSystem


@value_class(frozen=True)
class Entry:
    """A shipped model, with the fields of a :class:`dmoc.Problem` if it comes with one."""

    model: str
    title: str
    problem: Mapping[str, Any] | None = field(default=None)


ENTRIES = {
    "cart_pendulum": Entry(
        "cart_pendulum",
        "swing up a pendulum on a cart by bouncing it off a limiter",
        {
            "start": {"alpha": pi / 10 + pi / 20, "x": 0.0},
            "goal": {"alpha": pi / 2, "p_alpha": 0.0, "p_x": 0.0},
            "sequence": ("lower",),
            "steps": 100,
            "final_time": (None, 1.0),  # not of the source: without it the cost falls for ever
            "bounds": {"F": (-200.0, 200.0), "x": (-10.0, 10.0)},
        },
    ),
    "cart_pendulum_hanging": Entry(
        "cart_pendulum",
        "swing it up from hanging at rest, through a collision and past lost controllability at "
        "alpha = 0",
        {
            "start": {"alpha": -pi / 2, "x": 0.0},
            "goal": {"alpha": pi / 2, "p_alpha": 0.0, "p_x": 0.0},
            "sequence": ("lower",),
            "steps": 100,
            "final_time": (None, 2.0),
            "bounds": {"F": (-200.0, 200.0), "x": (-10.0, 10.0)},
            "parameters": {"alpha_min": -3 * pi / 4},
        },
    ),
    "puck_table": Entry(
        "puck_table",
        "a puck that moves fast and must come back moving: the walls can do the work (for dmoc "
        "search)",
        {
            "start": {"x": 0.3, "y": 0.2, "x_dot": 1.5, "y_dot": 0.4},
            "goal": {"x": 0.4, "y": 0.7, "x_dot": 1.2, "y_dot": -0.3},
            "sequence": ("east", "west", "north"),
            "steps": 40,
            "final_time": 2.0,
        },
    ),
    "bouncing_pendulum": Entry(
        "bouncing_pendulum",
        "a pendulum without inputs that bounces off a wall (forward simulation)",
    ),
}


def models() -> list[str]:
    """Names of the shipped models."""
    return sorted({entry.model for entry in ENTRIES.values()})


def system(model: str) -> MechanicalSystem:
    """Make the description of a shipped model."""
    made: MechanicalSystem = import_module(f"dmoc.models.{model}").system()
    return made
