"""What data can tell of parameters: by the singular values of the derivatives of all residuals, in
sizes of the parameters, and in words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.fitting.parameters import MODEL, RESTITUTION, Parameter

# Singular values, as shares of the largest, of directions that nothing depends on; differences on
# both sides leave errors of 1e-9.
NOTHING = 1e-7
# Share of its first size that an unknown has at least: one near zero is no smaller.
SMALL = 1e-3
# Entries of such a direction, as shares of its largest, that take part in it.
PART = 0.02
# Entries that are so close to a ratio of small whole numbers are one.
ALIKE, LARGEST_POWER = 0.02, 4


@record(frozen=True, eq=False)
class Identification:
    """Directions of unknowns, in sizes, that residuals do not depend on (k, unknowns), and a
    sentence about each; covariance (unknowns, unknowns), infinite of what is not determined."""

    nothing: Array
    sentences: tuple[str, ...]
    covariance: Array


def identified(J: Array, parameters: Sequence[Parameter], x: Array, pushed: bool) -> Identification:
    """What derivatives (n, unknowns) of residuals in standard deviations tell of unknowns with the
    values x; ``pushed`` says whether a force is measured."""
    size = np.maximum(np.abs(x), SMALL * np.array([p.size for p in parameters]))
    _, s, V = np.linalg.svd(np.linalg.qr(J * size, mode="r"), full_matrices=True)
    s = np.append(s, np.zeros(len(V) - len(s)))
    known = s > NOTHING * max(float(s[0]), 1e-300)
    root = V[known].T / s[known]
    covariance = size[:, None] * (root @ root.T) * size
    nothing = _rotated(V[~known])
    for direction in nothing:
        part = np.abs(direction) > PART * np.abs(direction).max()
        covariance[np.outer(part, part)] = np.inf
    sentences = tuple(_sentence(d, parameters, x, pushed) for d in nothing)
    return Identification(nothing, sentences, covariance)


def _rotated(basis: Array) -> Array:
    """The same directions by few unknowns each: reduced to echelon form, the largest entries
    first."""
    rows = basis.copy()
    for i in range(len(rows)):
        left = np.abs(rows[i:])
        r, c = divmod(int(np.argmax(left)), left.shape[1])
        rows[[i, i + r]] = rows[[i + r, i]]
        rows[i] /= rows[i, c]
        for other in range(len(rows)):
            if other != i:
                rows[other] -= rows[other, c] * rows[i]
    return rows


def _sentence(direction: Array, parameters: Sequence[Parameter], x: Array, pushed: bool) -> str:
    part = np.flatnonzero(np.abs(direction) > PART * np.abs(direction).max()).tolist()
    own = [parameters[k] for k in part]
    if len(part) == 1:
        return f"nothing that is measured depends on {own[0].name}"
    named = _listed([p.name for p in own])
    powers = _powers(direction[part])
    scaled = all(p.kind in (MODEL, RESTITUTION) and x[k] for p, k in zip(own, part, strict=True))
    if powers is None or not scaled:
        change = ", ".join(
            f"{p.name} by {0.01 * d * (abs(x[k]) or p.size):+.2g}"
            for p, d, k in zip(own, direction[part], part, strict=True)
        )
        return f"{named} are not known apart: a change of {change} changes nothing that is measured"
    why = ": no force is measured" if not pushed and set(powers) == {1} else ""
    if len(part) == 2:
        return f"only {_invariant(own, powers)} is determined{why}"
    if set(powers) == {1}:
        return f"only ratios of {named} are determined{why}"
    terms = ", ".join(f"{p.name} by {n:+d} %" for p, n in zip(own, powers, strict=True))
    return f"{named} are not known apart: a change of {terms} changes nothing that is measured"


def invariant(direction: Array) -> tuple[NDArray[np.intp], Array]:
    """The unknowns that have part in a direction, by their numbers, and their entries, as small
    whole numbers where they are some."""
    part = np.flatnonzero(np.abs(direction) > PART * np.abs(direction).max())
    powers = _powers(direction[part])
    return part, direction[part] if powers is None else np.array(powers, dtype=float)


def _powers(entries: Array) -> tuple[int, ...] | None:
    """Entries as small whole numbers in their proportion, the first positive; None if they are
    none."""
    lead = entries / entries[0]
    for factor in range(1, LARGEST_POWER + 1):
        rounded = np.round(lead * factor)
        if (np.abs(rounded) >= 1).all() and (
            np.abs(lead * factor - rounded) < ALIKE * np.abs(rounded)
        ).all():
            whole = [int(n) for n in rounded]
            return tuple(whole) if max(map(abs, whole)) <= LARGEST_POWER else None
    return None


def _invariant(own: Sequence[Parameter], powers: tuple[int, ...]) -> str:
    """What stays the same where two parameters grow by powers of one factor."""
    (a, m), (b, n) = zip((p.name for p in own), powers, strict=True)
    if n < 0:
        return f"{_power(a, -n)} {_power(b, m)}"
    return f"{_power(a, n)}/{_power(b, m)}"


def _power(name: str, n: int) -> str:
    return name if n == 1 else f"{name}^{n}"


def _listed(names: Sequence[str]) -> str:
    return f"{', '.join(names[:-1])} and {names[-1]}" if len(names) > 1 else names[0]
