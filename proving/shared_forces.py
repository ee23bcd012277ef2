r"""What holds of forces that several contacts share.

Contacts with forces lam push with w = D^T lam in all, where rows of D are their directions, and
each force keeps to conditions C lam <= c.  A motion tells w and no more: where directions depend on
each other, D^T n = 0, forces differ by such n without any effect.  All that can be said of w are
sums of the conditions in which these cancel (Farkas)::

    z >= 0,   z C n = 0 for all n   =>   z C lam <= z c   for any lam of the motion's w

The least such z, those with the fewest conditions each, are the edges of a cone; all others are
sums of them.  They are found in exact fractions, an n at a time, as by Motzkin's double
description.

Source: T. S. Motzkin et al., The double description method, 1953.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction

import numpy as np

from dmoc.base.errors import ProblemError
from dmoc.base.tolerances import ROUNDING, SAME
from dmoc.codegen.kernels import Array

# Shares of directions are taken for fractions with no larger denominators where they are those.
LARGEST = 1000
# Sums that are looked at, at most.
MOST_SUMS = 1000

Condition = tuple[Array, float]


def forces_of(pushes: Array) -> Array:
    """Forces in directions (m, nq) that push with w in all, as function of w, shape (m, nq): those
    of the first directions that do not depend on each other."""
    inverse = np.zeros(pushes.shape)
    first = _independent(pushes)
    inverse[first] = np.linalg.pinv(pushes[first].T)
    return inverse


def told_of(pushes: Array, conditions: Iterable[Condition]) -> list[Condition]:
    """Of conditions row lam <= limit, each a row (m,) and a limit, the sums that a motion tells;
    ``pushes`` are the directions, shape (m, nq)."""
    given = list(conditions)
    first = _independent(pushes)
    if len(first) == len(pushes) or not given:
        return given
    rows = [[Fraction(x) for x in row.tolist()] for row, _ in given]
    limits = [Fraction(limit) for _, limit in given]
    sums = _edges([[_dot(row, n) for row in rows] for n in _without_effect(pushes, first)])
    own = {_said(z, rows, limits, first): z for z in sums}
    shares = np.array([[float(x) for x in z] for said, z in own.items() if said])
    if not len(shares):
        return []
    rests = shares @ np.array([limit for _, limit in given])
    return list(zip(shares @ np.array([row for row, _ in given]), rests.tolist(), strict=True))


def _independent(pushes: Array) -> list[int]:
    """The numbers of directions that do not depend on those before them."""
    first, basis = list[int](), np.zeros((0, pushes.shape[1]))
    for i, row in enumerate(pushes):
        rest = row - basis.T @ (basis @ row)
        rest -= basis.T @ (basis @ rest)  # twice is enough
        left = float(np.linalg.norm(rest))
        if left > SAME * float(np.linalg.norm(row)):
            first.append(i)
            basis = np.vstack([basis, rest / left])
    return first


def _without_effect(pushes: Array, first: Sequence[int]) -> list[list[Fraction]]:
    """Forces without any effect, one for each direction that depends on those before it."""
    forces = list[list[Fraction]]()
    for i in sorted({*range(len(pushes))} - {*first}):
        shares = np.linalg.lstsq(pushes[first].T, pushes[i], rcond=None)[0]
        one = [Fraction(0)] * len(pushes)
        one[i] = Fraction(-1)
        for j, share in zip(first, shares.tolist(), strict=True):
            one[j] = _fraction(share)
        forces.append(one)
    return forces


def _fraction(x: float) -> Fraction:
    """A number, or a simple fraction that it is up to rounding."""
    simple = Fraction(x).limit_denominator(LARGEST)
    return simple if abs(float(simple) - x) <= ROUNDING * max(abs(x), 1.0) else Fraction(x)


def _dot(a: Sequence[Fraction], b: Sequence[Fraction]) -> Fraction:
    return sum((x * y for x, y in zip(a, b, strict=True)), Fraction(0))


def _edges(equations: list[list[Fraction]]) -> list[list[Fraction]]:
    """The edges of the cone of all z >= 0 with equations z = 0."""
    count = len(equations[0])
    edges = [[Fraction(i == j) for j in range(count)] for i in range(count)]
    for equation in equations:
        values = [_dot(equation, z) for z in edges]
        more = [(v, z) for v, z in zip(values, edges, strict=True) if v > 0]
        less = [(v, z) for v, z in zip(values, edges, strict=True) if v < 0]
        edges = [z for v, z in zip(values, edges, strict=True) if v == 0]
        edges += [_sum(a, -b, z, y) for a, y in more for b, z in less]
        edges = _least(edges)
        if len(edges) > MOST_SUMS:
            raise ProblemError(
                f"{len(edges)} conditions hold of forces that contacts share: proofs take at most "
                f"{MOST_SUMS}; give fewer contacts that push alike."
            )
    return edges


def _sum(a: Fraction, b: Fraction, y: list[Fraction], z: list[Fraction]) -> list[Fraction]:
    """a y + b z, the largest of which is one."""
    both = [a * p + b * q for p, q in zip(y, z, strict=True)]
    largest = max(both)
    return [x / largest for x in both]


def _least(edges: list[list[Fraction]]) -> list[list[Fraction]]:
    """Those of which no other one has a part of the conditions alone; one of each."""
    parts = {sum(1 << i for i, x in enumerate(z) if x): z for z in edges}
    return [z for part, z in parts.items() if not any(o & part == o != part for o in parts)]


def _said(
    z: list[Fraction], rows: list[list[Fraction]], limits: list[Fraction], first: Sequence[int]
) -> tuple[Fraction, ...]:
    """What a sum of conditions says of the forces of the ``first`` directions, up to its size,
    where the others are zero; empty where that is nothing."""
    own = [_dot(z, [row[j] for row in rows]) for j in first]
    size = max(map(abs, own))
    return tuple(x / size for x in (*own, _dot(z, limits))) if size else ()
