"""Arrays and structs of constants as C."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

WIDTH = 100


class Constants:
    """Arrays of constants, each written once however often it is asked for."""

    def __init__(self) -> None:
        self.names: dict[tuple[str, bytes], str] = {}
        self.lines: list[str] = []
        self.bytes = 0  # bytes

    def array(self, kind: str, values: Any) -> str:
        """The name of an array of doubles, ints or ptrdiff_ts; NULL for none."""
        flat = np.ascontiguousarray(values).ravel()
        if not flat.size:
            return "NULL"
        key = kind, flat.tobytes()
        if key not in self.names:
            self.names[key] = f"{kind[0]}{len(self.names)}"
            self._write(kind, self.names[key], len(flat), map(literal, flat.tolist()))
            self.bytes += len(flat) * (4 if kind == "int" else 8)
        return self.names[key]

    def structs(self, kind: str, name: str, rows: Sequence[str]) -> str:
        """The name of an array of structs; NULL for none."""
        if not rows:
            return "NULL"
        self.lines += [f"static const {kind} {name}[] = {{", *(f"    {r}," for r in rows), "};"]
        return name

    def _write(self, kind: str, name: str, count: int, values: Iterable[str]) -> None:
        self.lines.append(f"static const {kind} {name}[{count}] = {{")
        line = "   "
        for value in values:
            if len(line) + len(value) > WIDTH - 2:
                self.lines.append(line)
                line = "   "
            line += f" {value},"
        self.lines += [line, "};"]


def literal(value: float | int) -> str:
    """A number in C."""
    if isinstance(value, int):
        return str(value)
    if np.isinf(value):
        return "INFINITY" if value > 0 else "-INFINITY"
    return repr(value)


def initial(*values: str | int) -> str:
    """An initialiser of a struct."""
    return f"{{{', '.join(map(str, values))}}}"
