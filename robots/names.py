"""Names of a file as names of a model: identifiers, each of them once."""

from __future__ import annotations

import re
from collections.abc import Collection
from typing import Any

from dmoc.base.arguments import check_known, shown
from dmoc.base.errors import ModelError
from dmoc.base.names import velocity_name

LONGEST = 44  # of a name that others are made of


def known(name: Any, among: Collection[str], what: str, where: str) -> str:
    """One of the names of a file."""
    if not isinstance(name, str):
        raise ModelError(f"{what} {shown(name)} {where}: expected a name, as a text.")
    check_known(name, among, what, where, ModelError)
    return name


class Names:
    """Names that are taken, and what names of a file have become."""

    def __init__(self) -> None:
        self.taken: set[str] = set()
        self.of: dict[str, str] = {}

    def give(self, name: str) -> str:
        """An identifier for a name of a file."""
        own = re.sub(r"[^A-Za-z0-9_]", "_", name).strip("_")[:LONGEST]
        own = own if re.match("[A-Za-z]", own) else f"n_{own}"
        number, base = 1, "time" if own == "t" else own
        own = base
        while {own, velocity_name(own)} & self.taken:
            number += 1
            own = f"{base}_{number}"
        self.taken |= {own, velocity_name(own)}
        self.of[name] = own
        return own
