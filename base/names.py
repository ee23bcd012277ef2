"""Names: from symbols to text, and which texts may become part of generated code and file names."""

from __future__ import annotations

import keyword
import re
from collections.abc import Mapping, Sequence
from typing import Any

from dmoc.base.arguments import place, shown
from dmoc.base.errors import ModelError

_IDENTIFIER = re.compile(r"[A-Za-z][A-Za-z0-9_]*", re.ASCII)
_LONGEST = 64
# Units of momenta by the unit of the coordinate; of another coordinate, the unit of its momentum is
# not known.
MOMENTUM_UNITS = {"m": "kg m/s", "rad": "kg m2/s"}
NAMED_IN_CODE = ("model", "system")
# What SymPy prints for alpha(t) and for its first derivative; of a sum or a second derivative
# nothing is the name.
_APPLIED, _RATE = re.compile(r"([^()\s]+)\(\w+\)"), re.compile(r"Derivative\((.+), \w+\)")
_C_KEYWORDS = frozenset(
    """alignas alignof auto bool break case char const constexpr continue default do
    double else enum extern false float for goto if inline int long nullptr register
    restrict return short signed sizeof static static_assert struct switch
    thread_local true typedef typeof typeof_unqual union unsigned void volatile while""".split()
)


def name_of(symbol: Any) -> str:
    """Return the plain name of a coordinate, velocity, input or parameter.

    ``alpha(t)`` is "alpha", ``Derivative(alpha(t), t)`` is "alpha_dot", a text stays as it is.
    """
    try:
        text = str(symbol)
    except Exception:  # an integer of more than 4300 digits, or a foreign class
        text = shown(symbol)
    rate = _RATE.fullmatch(text)
    if rate:
        return name_of(rate[1]) + "_dot"
    applied = _APPLIED.fullmatch(text)
    return applied[1] if applied else text


def velocity_name(coordinate: str) -> str:
    return f"{coordinate}_dot"


def momentum_name(coordinate: str) -> str:
    return f"p_{coordinate}"


def load_of(grip: str) -> str:
    """Name of the load of a grip with a strength."""
    return f"{grip}_load"


def bounded_momentum(coordinate: str) -> str:
    """The quantity that the momentum of a coordinate is where it is bounded along the way."""
    return f"momentum_{coordinate}"


def omega_names(attitude: str) -> tuple[str, str, str]:
    """The quantities that are the angular velocity of an attitude."""
    x, y, z = (f"{attitude}_omega_{axis}" for axis in "xyz")
    return x, y, z


def of_quaternions(coordinates: Sequence[str], quantities: Sequence[str]) -> set[str]:
    """The coordinates that are quaternions of attitudes, whose angular velocities are among the
    quantities."""
    known, own = {*coordinates}, set[str]()
    for attitude in (name.removesuffix("0") for name in coordinates if name.endswith("0")):
        four = {f"{attitude}{k}" for k in range(4)}
        if four <= known and {*omega_names(attitude)} <= {*quantities}:
            own |= four
    return own


def unit_constraint(attitude: str) -> str:
    """The constraint that the quaternion of an attitude has length 1."""
    return f"{attitude}_unit"


def unit_of(name: str, units: Mapping[str, str]) -> str:
    """Unit of a coordinate, velocity or momentum from those of coordinates; empty where it is not
    known."""
    if name in units:
        return units[name]
    if name.startswith("p_"):
        return MOMENTUM_UNITS.get(units.get(name[2:], ""), "")
    return f"{units[name[:-4]]}/s" if name.endswith("_dot") and name[:-4] in units else ""


def check_name(name: Any, role: str) -> str:
    """Return ``name`` if it may be used for ``role``; raise :class:`ModelError` otherwise."""
    if not isinstance(name, str):
        raise ModelError(f"{role} name = {shown(name)}: expected a text.")
    if not _IDENTIFIER.fullmatch(name) or len(name) > _LONGEST:
        raise ModelError(
            f"{role} name {place(name)!r} is not a C identifier: use a letter followed by at most "
            f"{_LONGEST - 1} letters, digits or underscores (ASCII)."
        )
    # Only the model's own name becomes one in C and Python; the others are data.
    if role in NAMED_IN_CODE and (name in _C_KEYWORDS or keyword.iskeyword(name)):
        raise ModelError(
            f"{role} name {name!r} is a keyword of C or Python: choose another name, such as "
            f"{name}_1."
        )
    return name
