"""How the shipped models look: positions of their parts in the plane.  Other models are drawn as
curves only."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import cos, sin

import numpy as np

from dmoc.trajectory import Array


@dataclass(frozen=True)
class Picture:
    """Lines (arrays of points), point masses, limits of the motion, and bodies that are drawn at
    both ends only, in metres."""

    lines: tuple[Array, ...]
    masses: tuple[tuple[float, float], ...]
    limits: tuple[Array, ...] = ()
    bodies: tuple[Array, ...] = ()


Shape = Callable[[Array, Mapping[str, float]], Picture]


def shape_of(model: str) -> Shape | None:
    """Return the drawing of a shipped model, or None."""
    return {"cart_pendulum": _cart_pendulum, "bouncing_pendulum": _bouncing_pendulum}.get(model)


def _cart_pendulum(q: Array, parameters: Mapping[str, float]) -> Picture:
    alpha, x, l = float(q[0]), float(q[1]), parameters["l"]
    tip = (x + l * cos(alpha), l * sin(alpha))
    width, height = 0.24 * l, 0.12 * l
    corners = [
        (-width, -height),
        (width, -height),
        (width, height),
        (-width, height),
        (-width, -height),
    ]
    cart = np.array([(x + a, b) for a, b in corners])
    rod = np.array([(x, 0.0), tip])
    limits = tuple(
        np.array([(x + r * l * cos(a), r * l * sin(a)) for r in (0.75, 1.1)])
        for a in (parameters["alpha_min"], parameters["alpha_max"])
    )
    return Picture((rod,), (tip,), limits, (cart,))


def _bouncing_pendulum(q: Array, parameters: Mapping[str, float]) -> Picture:
    theta, l, wall = float(q[0]), parameters["l"], parameters["theta_wall"]
    tip = (l * sin(theta), -l * cos(theta))
    side = np.array([(r * l * sin(wall) - 0.02 * l, -r * l * cos(wall)) for r in (0.7, 1.15)])
    return Picture((np.array([(0.0, 0.0), tip]),), (tip,), (side,))
