"""Problems that end with an event."""

from __future__ import annotations

from typing import Any

import numpy as np
from systems import block_on_floor, block_system

import dmoc

G = 9.81
FALL = np.sqrt(2 * G)  # the speed at the floor


def against_wall(order: int = 4, **fields: Any) -> dmoc.Problem:
    """A unit mass that shall leave the wall with 0.8 after one second, of least effort."""
    stated: dict[str, Any] = {
        "start": {"x": 0.0}, "goal": {"x_dot": -0.8}, "sequence": ["wall"], "durations": [1.0, 0],
        "steps": 20, "restitution": 0.5,
    }  # fmt: skip
    return dmoc.Problem(dmoc.build(block_system(), order=order), **stated | fields)


def thrown_block(order: int, word: str, **fields: Any) -> dmoc.Problem:
    """A block that is thrown onto a floor with the friction 0.3; its force acts along the floor."""
    stated: dict[str, Any] = {
        "start": {"x": 0.0, "y": 1.0, "x_dot": 3.0}, "bounds": {"u": (-1e-9, 1e-9)}, "steps": 8,
        "sequence": [word], "durations": [None, 0], "restitution": 0.5,
    }  # fmt: skip
    kernels = dmoc.build(block_on_floor("thrown", 1.0, G, 0.3), order=order)
    return dmoc.Problem(kernels, **stated | fields)


def cubic(speed: float) -> float:
    """The least effort 1/2 int u^2 of a unit mass from rest at 0 to 1 with a speed, in one
    second: that of the cubic through both."""
    return 6 - 6 * speed + 2 * speed**2
