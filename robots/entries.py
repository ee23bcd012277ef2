"""Entries of a URDF: numbers where numbers are expected, and one of what there is one of."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterator

from dmoc.base.arguments import shown
from dmoc.base.errors import ModelError

TRIPLES = ("xyz", "rpy", "size")
NUMBERS = (
    "value", "radius", "length", "ixx", "iyy", "izz", "ixy", "ixz", "iyz", "lower", "upper",
    "effort", "velocity", "damping", "friction", "multiplier", "offset",
)  # fmt: skip
MANY = ("link", "joint", "collision")


def check_urdf(root: ET.Element, label: str) -> None:
    """Refuse what is no number, and what stands there twice, by the name of its link or joint."""
    for part in root:
        owner = f"{part.tag} {part.get('name')} of {label}"
        for element in part.iter():
            _check_single(element, owner)
            for name, count in _counts(element):
                if _numbers(element.get(name, "")) != count:
                    kind = "three numbers with blanks between them" if count == 3 else "a number"
                    raise ModelError(
                        f"<{element.tag} {name}={shown(element.get(name))}> in {owner}: expected "
                        f"{kind}."
                    )


def _check_single(element: ET.Element, owner: str) -> None:
    inside = Counter(str(child.tag) for child in element if child.tag not in MANY)
    for tag, count in inside.items():
        if count > 1:
            raise ModelError(f"{owner} has {count} elements <{tag}>: expected one.")


def _counts(element: ET.Element) -> Iterator[tuple[str, int]]:
    yield from ((name, 3) for name in TRIPLES if name in element.attrib)
    yield from ((name, 1) for name in NUMBERS if name in element.attrib)


def _numbers(text: str) -> int:
    """How many numbers a text is, or -1."""
    try:
        return len([float(part) for part in text.split()])
    except ValueError:
        return -1
