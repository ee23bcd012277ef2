"""Integrals along the paths that are integrated from each node, by a quadrature that halves steps
until two rules agree: what functions come to over the motion, and where they are the hardest.

At a pole the rules differ however short a part is; at a root, whose slope alone is infinite, they
come the nearer the shorter it is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dmoc.base.discretisation import gauss
from dmoc.base.records import record
from dmoc.base.tolerances import TINY
from dmoc.check.integrated_steps import IntegratedSteps, basis_at
from dmoc.codegen.kernels import Array
from dmoc.simulation.flow import Steps

# Points of the two rules, and the share of what a step adds that they may differ by in a part.
COARSE, FINE, AGREES = 3, 4, 1e-6
# How often steps are halved, and how many parts there may be at a time: what varies faster is not
# known.
DEEPEST, MOST_PARTS = 30, 20_000
# With every half of a part around a singular place r = 0 the difference of the rules changes by
# 2^(a - 1) where a function is as r^-a there; what falls less fast than this counts as a pole.
POLE = -0.2
# Weights of the logarithms that give this slope by least squares over all halves.
TREND = np.arange(DEEPEST + 1) - DEEPEST / 2
TREND /= (TREND**2).sum()
(_COARSE, _COARSE_WEIGHTS), (_FINE, _FINE_WEIGHTS) = gauss(COARSE), gauss(FINE)
# Beside nodes, where motions turn round, functions shall be numbers; at the nodes themselves they
# may be 0/0.
EDGES = np.array([1e-6, 1 - 1e-6])
PLACES = np.concatenate([EDGES, _COARSE, _FINE])
BASIS = basis_at(PLACES)
# The finer rule, and its difference from the coarser one.
RULES = np.array(
    [np.concatenate([0 * EDGES, sign * _COARSE_WEIGHTS, _FINE_WEIGHTS]) for sign in (0.0, -1.0)]
)

# Functions (n, m) of rows of q, v, u and t.
Integrands = Callable[[Array, Array, Array, Array], Array]


class Place(NamedTuple):
    """Where a function is the hardest to integrate: positions, time, and its value there."""

    q: Array
    t: float
    value: float


@record(frozen=True, eq=False)
class _Look:
    """Parts of steps, functions (places, n, m) at states of these, their integrals by the finer
    rule, those of the magnitudes, and by how much the coarser one differs, shape (n, m) each."""

    parts: IntegratedSteps
    state: tuple[Array, ...]
    functions: Array
    value: Array
    size: Array
    off: Array

    @classmethod
    def at(cls, parts: IntegratedSteps, functions: Integrands) -> _Look:
        """Look at parts of steps."""
        q, v, u, t = state = parts.along(PLACES, BASIS)
        q_rows, v_rows, u_rows = (a.reshape(t.size, a.shape[2]) for a in (q, v, u))
        c = functions(q_rows, v_rows, u_rows, t.ravel())
        shape, h = (*t.shape, c.shape[1]), parts.steps.h[:, None]
        flat = c.reshape(len(PLACES), -1)
        (value, off), (size, of_size) = (
            (RULES @ part).reshape(2, *shape[1:]) * h for part in (flat, np.abs(flat))
        )
        off = np.maximum(np.abs(off), np.abs(of_size))
        return cls(parts, state, c.reshape(shape), value, size, off)

    @property
    def undefined(self) -> NDArray[np.bool_]:
        """Functions that are not numbers at a place, shape (m,)."""
        none = np.isnan(self.off).any(axis=0)  # or infinite
        return np.asarray(np.isnan(self.functions).any(axis=(0, 1)) if none.any() else none)

    def trend(self, depth: int) -> Array:
        """Contributions of the parts of a depth to the slopes of the logarithms of the
        differences."""
        return np.asarray(TREND[depth] * np.log2(np.maximum(self.off, TINY)))

    def hardest(self, j: int) -> Place:
        """The place where a function is the largest in the part in which the rules differ most, or
        not a number."""
        (q, _, _, t), c = self.state, self.functions[..., j]
        part = int(np.argmax(self.off[:, j]))  # the first that is not a number, if there is one
        point = int(np.argmax(np.abs(c[:, part])))
        return Place(q[point, part], float(t[point, part]), float(c[point, part]))


@record(frozen=True, eq=False)
class Integrals:
    """Integrals of functions along a motion, those of the magnitudes, what the quadrature leaves of
    both, which functions are not numbers somewhere and which have a pole, shape (m,) each, and the
    last look at the parts where each was not resolved."""

    values: Array
    sizes: Array
    left: Array
    undefined: NDArray[np.bool_]
    has_pole: NDArray[np.bool_]
    looks: Sequence[_Look]

    def hardest(self, j: int) -> Place:
        """The place where a function is the hardest to integrate."""
        return self.looks[j].hardest(j)


def integrals_along(courses: Sequence[IntegratedSteps], functions: Integrands) -> Integrals:
    """The integrals of functions along all steps of a motion."""
    look, depth, trend = _Look.at(joined(courses), functions), 0, np.zeros((1, 1))
    count, number = look.off.shape
    enough = AGREES * np.where(np.isfinite(look.size), look.size, 0.0).sum(axis=0) / count
    looks, sums, rough = [look] * number, np.zeros((2, number)), ~(look.off <= enough)
    while True:
        again, undefined = rough.any(axis=1), look.undefined
        if undefined.any() or depth == DEEPEST or 2 * np.count_nonzero(again) > MOST_PARTS:
            again[:] = False
        sums += [look.value[~again].sum(axis=0), look.size[~again].sum(axis=0)]
        if not again.any():
            break
        trend, depth = np.tile((trend + look.trend(depth))[again], (2, 1)), depth + 1
        look = _Look.at(look.parts.part(again).halves(), functions)
        rough = ~(look.off <= enough)
        looks = [look if rough[:, j].any() else before for j, before in enumerate(looks)]
    has_pole = np.zeros(number, dtype=bool)
    if depth == DEEPEST:
        has_pole = (rough & ~(trend + look.trend(depth) < POLE)).any(axis=0)
    left = np.where(rough, look.off, 0.0).sum(axis=0)
    return Integrals(sums[0], sums[1], left, undefined, has_pole, looks)


def together(parts: Sequence[Integrals]) -> Integrals:
    """The integrals along all parts of a motion; each is the hardest where it leaves most."""
    first, *others = parts
    if not others:
        return first
    values, sizes, left = (
        np.sum([getattr(p, name) for p in parts], axis=0) for name in ("values", "sizes", "left")
    )
    undefined, has_pole = (
        np.any([getattr(p, name) for p in parts], axis=0) for name in ("undefined", "has_pole")
    )
    bad = [np.where(p.undefined | p.has_pole, np.inf, p.left) for p in parts]
    looks = [parts[int(k)].looks[j] for j, k in enumerate(np.argmax(bad, axis=0))]
    return Integrals(values, sizes, left, undefined, has_pole, looks)


def joined(courses: Sequence[IntegratedSteps]) -> IntegratedSteps:
    """The steps of several modes, one after the other."""
    if len(courses) == 1:
        return courses[0]
    of_steps, of_ends = (
        [np.concatenate([getattr(part, name) for part in parts]) for name in names]
        for parts, names in (
            ([course.steps for course in courses], ("t", "h", "u0", "u1")),
            (courses, ("start", "ends", "stop")),
        )
    )
    return IntegratedSteps(Steps(*of_steps), *of_ends)
