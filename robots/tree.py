"""How a robot shows itself: its links as a tree, with what moves them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from dmoc.base.table import Table
from dmoc.robots.records import Description, Joint, Limits

HEAD = ("link", "kg", "joint", "range", "effort", "shapes")
UNITS = {"hinge": ("rad", "N m"), "slide": ("m", "N")}


def table_of(
    description: Description, held: Mapping[str, float], renamed: Mapping[str, str],
    notes: Sequence[str],
) -> Table:  # fmt: skip
    """The links of a description, each below the one that it hangs from."""
    depths: list[int] = []
    rows = []
    for link in description.links:
        depths.append(0 if link.before is None else depths[link.before] + 1)
        shapes = ", ".join(shape.name for shape in link.shapes)
        joints: list[Joint | None] = [*link.joints] or [None]
        first = [f"{'  ' * depths[-1]}{link.name}", f"{link.mass:.4g}" if link.mass else ""]
        for joint in joints:
            rows.append((*first, *_cells(joint, held, renamed), shapes))
            first, shapes = ["", ""], ""
    return Table(tuple(rows), HEAD, tuple(f"not taken: {note}" for note in notes))


def _cells(
    joint: Joint | None, held: Mapping[str, float], renamed: Mapping[str, str]
) -> tuple[str, str, str]:
    """What joint it is, its range and its effort."""
    if joint is None:
        return "fixed", "", ""
    if joint.name in held:
        return f"{joint.name}: locked at {held[joint.name]:.4g}", "", ""
    what = f"{renamed.get(joint.name, joint.name)}: {joint.kind}"
    if joint.follows is not None:
        return f"{what}, follows {joint.follows[0]}", "", ""
    if joint.kind not in UNITS:
        return what, "", ""
    way, force = UNITS[joint.kind]
    return what, _range(joint.limits, way), _range(joint.effort, force) if joint.driven else "none"


def _range(limits: Limits, unit: str) -> str:
    return "" if limits is None else f"{limits[0]:.4g} to {limits[1]:.4g} {unit}"
