"""How a robot shows itself: its links as a tree, with what moves them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from dmoc.base.table import Table
from dmoc.robots.records import Description, Joint, Limits

HEAD = ("link", "kg", "joint", "range", "effort", "shapes")
UNITS = {"hinge": ("rad", "N m"), "slide": ("m", "N")}


def table_of(
    description: Description, held: Mapping[str, float], renamed: Mapping[str, str],
    shapes: Mapping[str, tuple[str, str]], notes: Sequence[str],
) -> Table:  # fmt: skip
    """The links of a description, each below the one that it hangs from, with what touches: link
    and kind of each shape, which stands for a name that is that of its link."""
    depths: list[int] = []
    rows = []
    for link in description.links:
        depths.append(0 if link.before is None else depths[link.before] + 1)
        own = ((name, kind) for name, (where, kind) in shapes.items() if where == link.name)
        touching = ", ".join(kind if name == link.name else name for name, kind in own)
        joints: list[Joint | None] = [*link.joints] or [None]
        first = [f"{' ' * depths[-1]}{link.name}", f"{link.mass:.4g}" if link.mass else ""]
        for joint in joints:
            rows.append((*first, *_cells(joint, held, renamed), touching))
            first, touching = ["", ""], ""
    return Table(tuple(rows), HEAD, tuple(f"note: {note}" for note in notes))


def _cells(
    joint: Joint | None, held: Mapping[str, float], renamed: Mapping[str, str]
) -> tuple[str, str, str]:
    """What joint it is, its range and its effort."""
    if joint is None:
        return "fixed", "", ""
    if joint.name in held:
        return joint.name, f"locked at {held[joint.name]:.4g}", ""
    what = renamed.get(joint.name, joint.name)
    if joint.follows is not None:
        return f"{what}, follows {joint.follows[0]}", "", ""
    if joint.kind not in UNITS:
        return what, joint.kind, ""
    way, force = UNITS[joint.kind]
    return what, _range(joint.limits, way), _range(joint.effort, force) if joint.driven else "none"


def _range(limits: Limits, unit: str) -> str:
    """Limits with their unit, which tells a hinge from a slide; without any the unit alone."""
    if limits is None:
        return unit
    low, high = limits
    return f"±{high:.4g} {unit}" if low == -high else f"{low:.4g} to {high:.4g} {unit}"
