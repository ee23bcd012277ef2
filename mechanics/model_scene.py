"""The scene of a motion: the drawing of its model, evaluated along its phases."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.model import Model
from dmoc.motion.scene import Scene, resampled, shapes_in


def scene_of(model: Model, phases: Iterable[tuple[Array, Array, Array]]) -> Scene | None:
    """The scene of phases, each given as times, positions and velocities at its nodes.

    None where the model has no drawing, or the drawing is nowhere: velocities at a singular mass
    matrix are not numbers, nor is the root of a negative length.
    """
    shapes = shapes_in(model.kernels.manifest.drawing)
    if not shapes:
        return None
    with np.errstate(all="ignore"):
        ways = [resampled(*phase) for phase in phases]
        values = tuple([model.drawing(q, t) for t, q in ways])
    if not all(np.isfinite(part).all() for part in values):
        return None
    return Scene(shapes, tuple([t for t, _ in ways]), values)
