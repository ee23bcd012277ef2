"""Names in the derivation that people read: those of the model stay, and no other symbol has the
same."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import sympy as sp

from dmoc.base.names import name_of, velocity_name
from dmoc.symbolic.system import MechanicalSystem

MARK = "~"  # no name of a model contains it


class DisplayNames:
    """Gives each quantity of the derivation a name of its own: the usual one, marked where the
    model or another quantity has it."""

    def __init__(self, taken: Iterable[str]) -> None:
        self._taken = {form for name in taken for form in (name, latex_symbol(name))}
        self._names: dict[tuple[str, str], str] = {}

    @classmethod
    def beside(cls, system: MechanicalSystem) -> DisplayNames:
        """The names that are free beside those of a system."""
        moving = [name_of(q) for q in (*system.coordinates, *system.definitions)]
        others = [name_of(s) for s in (*system.inputs, *system.parameters)]
        return cls([*moving, *map(velocity_name, moving), *others, "t"])

    def __call__(self, usual: str, meaning: str) -> str:
        """Return the name of the quantity whose usual name and meaning are given, the same one
        each time."""
        if (usual, meaning) not in self._names:
            name = usual
            while name in self._taken or latex_symbol(name) in self._taken:
                name += MARK
            self._taken |= {name, latex_symbol(name)}
            self._names[usual, meaning] = name
        return self._names[usual, meaning]

    def symbol(self, usual: str, meaning: str) -> Any:
        return sp.Symbol(self(usual, meaning))

    @property
    def marked(self) -> list[str]:
        """The names given so far that are not the usual ones."""
        return sorted(name for name in self._names.values() if name.endswith(MARK))


def latex_symbol(name: str) -> str:
    """Write a name of the derivation as mathematics: alpha_dot_kp1 is \\dot{\\alpha}_{k+1},
    r_plus_x is r^+_{x}, x_m~ is \\tilde{x}_{m}."""
    plain = name.rstrip(MARK)
    head, *rest = plain.split("_")
    letter = sp.latex(sp.Symbol("lambda" if head == "lam" else head))
    if len(head) > 1 and letter == head:
        letter = f"\\mathrm{{{head}}}"
    above, below = "", []
    for part in rest:
        if part in ("dot", "ddot", "bar"):
            letter = f"\\{part}{{{letter}}}"
        elif part in ("plus", "minus"):
            above = "^+" if part == "plus" else "^-"
        else:
            below.append({"kp1": "k+1"}.get(part) or sp.latex(sp.Symbol(part)))
    for _ in range(len(name) - len(plain)):
        letter = f"\\tilde{{{letter}}}"
    return f"{letter}{above}" + (f"_{{{','.join(below)}}}" if below else "")
