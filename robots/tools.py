"""What is fixed to links of a robot beside what its file says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from dmoc.base.arguments import array, number, positive, shown
from dmoc.base.errors import ModelError
from dmoc.base.names import check_name
from dmoc.robots.names import known
from dmoc.robots.records import Array, Description, Link, Shape

KEYS = ("link", "at", "mass", "centre", "inertia", "radius")


def with_tools(description: Description, tools: Any, label: str) -> Description:
    """The links with further ones that are fixed to them."""
    if not isinstance(tools, Mapping):
        raise ModelError(
            f'tools = {shown(tools)}: expected a mapping such as {{"racket": {{"link": "hand"}}}}.'
        )
    links = list(description.links)
    for name, tool in tools.items():
        places = [link.name for link in links]
        if check_name(name, "tool") in places:
            raise ModelError(f"tool {name!r} has the name of a link of {label}: rename it.")
        if not isinstance(tool, Mapping) or "link" not in tool:
            raise ModelError(
                f"tool {name!r} = {shown(tool)}: expected a mapping with a link, such as "
                '{"link": "hand", "at": (0, 0, 0.1), "mass": 0.5}.'
            )
        for key in tool:
            known(key, KEYS, "part", f"of tool {name!r}")
        before = known(tool["link"], places, "link", f"of {label}")
        links.append(_link(name, tool, places.index(before)))
    return replace(description, links=tuple(links))


def _link(name: str, tool: Mapping[str, Any], before: int) -> Link:
    what = f"of tool {name!r}"
    mass = number(tool.get("mass", 0.0), f"the mass {what}", ModelError)
    inertia = numbers_of(tool.get("inertia", np.zeros(3)), f"the inertia {what}", ((3,), (3, 3)))
    inertia = np.diag(inertia) if inertia.ndim == 1 else inertia
    shapes = []
    if "radius" in tool:
        radius = positive(
            tool["radius"], f"the radius {what}", "expected a positive length", ModelError
        )
        shapes.append(Shape(name, "sphere", np.array([radius, 0, 0]), np.zeros(3), np.eye(3)))
    at, centre = (
        numbers_of(tool.get(key, np.zeros(3)), f"{key} {what}", ((3,),)) for key in ("at", "centre")
    )
    return Link(name, before, at, np.eye(3), mass, centre, inertia, shapes=tuple(shapes))


def numbers_of(value: Any, what: str, shapes: tuple[tuple[int, ...], ...]) -> Array:
    numbers = array(value)
    if numbers is None or numbers.shape not in shapes or not np.all(np.isfinite(numbers)):
        matrix = ", or a matrix of them" if len(shapes) > 1 else ""
        raise ModelError(f"{what} = {shown(value)}: expected three finite numbers{matrix}.")
    if numbers.ndim == 2 and not np.array_equal(numbers, numbers.T):
        raise ModelError(f"{what} = {shown(value)}: expected a symmetric matrix.")
    return numbers
