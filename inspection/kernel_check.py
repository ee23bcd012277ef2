"""Kernels beside an evaluation that shares nothing with their derivation: the functions of the
system in numbers of many digits, differences for every derivative, and a quadrature of its own.

At a random point each kernel is compared with what the definitions of the derivation say of the
Lagrangian, the forces, the cost and the surfaces.  Matrices of derivatives are compared along
random directions.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import mpmath as mp
import numpy as np
import sympy as sp

from dmoc.codegen.kernels import Array, Kernels
from dmoc.inspection.reference_functions import DIGITS, STEP, Vector, moved
from dmoc.inspection.reference_values import Function, ReferenceValues
from dmoc.symbolic.continuous import Continuous, readable
from dmoc.symbolic.event_sums import (
    APPROACH,
    DEPARTURE,
    IMPULSE,
    LOSS,
    EventTerm,
    event_terms,
    hit_quantities,
    references_in,
)
from dmoc.symbolic.kinks import split
from dmoc.symbolic.system import MechanicalSystem

# Kernels of steps, whose costs and path constraints have no kinks.
OF_STEPS = ("step", "impact", "path", "path_node", "path_ends", "path_point")
# Differences of what is zero everywhere leave less.
NOTHING = 1e-30
POINTS = 20  # random points that are tried until all functions are real there


@dataclass(frozen=True)
class Checked:
    """The largest error of a kernel relative to the largest of the values compared."""

    kernel: str
    error: float


def kernel_errors(system: MechanicalSystem, kernels: Kernels) -> tuple[Checked, ...]:
    """Compare the kernels of a system, of any order, with an independent evaluation at random
    points and along random directions; kernels that are not listed were not compared."""
    with mp.workdps(DIGITS):
        for k in range(POINTS):
            errors = _at_random(system, kernels, np.random.default_rng([0, k]))
            if errors and np.isfinite([c.error for c in errors]).all():
                return errors
    return ()


def _at_random(
    system: MechanicalSystem, kernels: Kernels, rng: np.random.Generator
) -> tuple[Checked, ...]:
    values = np.array(
        [rng.uniform(0.5, 1.5) if x is None else x for x in kernels.parameters.values()]
    )
    errors = []
    for name, function in _families(system, kernels, values).items():
        if not kernels.has(name):
            continue
        sizes = [size for _, size in kernels.manifest.kernels[name]["inputs"]][:-1]
        x = rng.uniform(0.2, 0.9, sum(sizes))
        try:
            errors += _compared(kernels, name, (function, x, sizes), values, rng)
        except (TypeError, ValueError, ZeroDivisionError):
            return ()  # a function is not real there
    return tuple(errors)


def _families(system: MechanicalSystem, kernels: Kernels, values: Array) -> dict[str, Function]:
    """Functions that the kernels compute; in those of steps hidden unknowns are in the place of
    kinks."""
    f, parts = readable(system), split(system)
    s = [sp.Dummy(real=True) for _ in parts.unknowns]
    smooth = f.smooth(system, s)
    kinks = tuple(f.rewritten(system, [own.kink for own in parts.unknowns]))
    # The split functions with the hidden unknowns behind the inputs.
    split_up = replace(smooth, u=(*smooth.u, *s), C=smooth.C_s, r=smooth.l)
    systems = f, smooth, replace(f, r=kinks), split_up
    plain, of_steps, hidden, lifted = (ReferenceValues(g, kernels, values) for g in systems)
    families = plain.families | {name: of_steps.families[name] for name in OF_STEPS}
    ones = [mp.mpf(1)] * ("final_time" in kernels.manifest.totals)

    def over(x: Vector, value: Callable[[Vector], Vector]) -> list[Vector]:
        """Values at the points of a step on both sides, each with its own s, and their weights
        behind."""
        points = of_steps.points(x)
        per = 2 if len(points) == 1 else 1
        own = x[len(x) - len(s) * per * len(points) :]
        h = x[2 * (of_steps.nq + of_steps.nu)]
        rows = []
        for i, (y, weight) in enumerate((y, h * p[3] / per) for p in points for y in p[:per]):
            rows.append([*value([*y[:-1], *own[i * len(s) : (i + 1) * len(s)], y[-1]]), weight])
        return rows

    def summed(x: Vector, value: Callable[[Vector], Vector]) -> Vector:
        columns = zip(*over(x, value), strict=True)
        *values, weights = (list(column) for column in columns)
        return [mp.fdot(zip(column, weights, strict=True)) for column in values]

    return families | {
        "hidden": lambda x: {"s": hidden.r(x)},
        "lifted": lambda x: {
            "C_s_d": summed(x, lifted.C),
            "l_d": [limit for row in over(x, lifted.r) for limit in row[:-1]],
        },
        "integral": lambda x: {"I_d": summed(x, lambda y: [*lifted.c(y), *ones])},
        "integrand": lambda x: {"c": plain.c(x)},
        "hit_sum": _of_hits(system, f, plain, ("I_c", event_terms(system))),
        "hit_value": _of_hits(system, f, plain, ("z_c", hit_quantities(system))),
    }


def _of_hits(
    system: MechanicalSystem, f: Continuous, plain: ReferenceValues,
    named: tuple[str, Sequence[EventTerm]],
) -> Function:  # fmt: skip
    """Values at hits of (q, v_a, v_c, lam, t), by the name of their output."""
    (output, terms), n = named, len(f.q)
    numbers = {name: j for j, name in enumerate(system.gaps)}
    idle, functions = [mp.mpf(0)] * plain.nu, []
    for term in terms:
        j = numbers[term.surface]
        own = {a: sp.Dummy(real=True) for a in references_in(term.value)}
        kinds, value = [a.func.__name__ for a in own], term.value.xreplace(own)
        compiled = plain.function(f.rewritten(system, [value]), tuple(own.values()))
        functions.append((j, kinds, compiled))

    def kinetic(y: Vector) -> Any:
        still, back = ([*y[:n], *(s * v for v in y[n : 2 * n]), *y[2 * n :]] for s in (0, -1))
        return (plain.L(y)[0] + plain.L(back)[0]) / 2 - plain.L(still)[0]

    def values(x: Vector) -> dict[str, Vector]:
        sides = [[*x[:n], *x[n * k : n * (k + 1)], *idle, x[-1]] for k in (1, 2)]
        before, after = (plain.gap_rates(y) for y in sides)
        lost = kinetic(sides[0]) - kinetic(sides[1])
        made = []
        for j, kinds, compiled in functions:
            of = {IMPULSE: x[3 * n + j], APPROACH: before[j], DEPARTURE: -after[j], LOSS: lost}
            made += compiled(sides[0], [of[kind] for kind in kinds])
        return {output: made}

    return values


def _compared(
    kernels: Kernels, name: str, reference: tuple[Function, Array, list[int]], values: Array,
    rng: np.random.Generator,
) -> list[Checked]:  # fmt: skip
    """A kernel and those of its derivatives."""
    function, x, sizes = reference
    parts = np.split(x, np.cumsum(sizes)[:-1]) if sizes else []
    rows = [*(part[None] for part in parts), values[None]]
    point, d, e = ([mp.mpf(float(z)) for z in v] for v in (x, *rng.normal(size=(2, len(x)))))
    expected = function(point)
    values_of = dict(zip(kernels.outputs(name), kernels.call(name, *rows), strict=True))
    errors_of = [Checked(name, max(_error(values_of[a][0], v) for a, v in expected.items()))]
    if kernels.has(f"{name}_jac"):
        high, low = (function(moved(point, d, s * STEP)) for s in (1, -1))
        errors = []
        stored = kernels.call(f"{name}_jac", *rows)
        for matrix, entries in zip(kernels.outputs(f"{name}_jac"), stored, strict=True):
            at, of = kernels.pattern(f"{name}_jac", matrix), matrix.removesuffix("_D")
            slope = [(u - v) / (2 * STEP) for u, v in zip(high[of], low[of], strict=True)]
            along = np.zeros(len(slope))
            np.add.at(along, at[0], entries[0] * np.array(d, dtype=float)[at[1]])
            errors.append(_error(along, slope))
        errors_of.append(Checked(f"{name}_jac", max(errors)))
    if kernels.has(f"{name}_hess"):
        weights = {a: rng.normal(size=len(v)) for a, v in expected.items()}
        (entries,) = kernels.call(f"{name}_hess", *rows, *(w[None] for w in weights.values()))
        bent = _curvature(function, weights, (point, d, e))
        i, j = kernels.pattern(f"{name}_hess", "hess")
        v, w = (np.array(way, dtype=float) for way in (d, e))
        both = np.where(i == j, v[i] * w[j], v[i] * w[j] + v[j] * w[i])
        errors_of.append(Checked(f"{name}_hess", _error(np.array([entries[0] @ both]), [bent])))
    return errors_of


def _curvature(
    function: Function, weights: Mapping[str, Array], at: tuple[Vector, Vector, Vector]
) -> Any:
    """The second derivative of a weighted sum of results along two directions."""
    point, d, e = at
    total = mp.mpf(0)
    for s, r in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        values = function(moved(moved(point, d, s * STEP), e, r * STEP))
        pairs = [p for a, w in weights.items() for p in zip(w, values[a], strict=True)]
        total += s * r * mp.fsum(mp.mpf(float(w)) * v for w, v in pairs)
    return total / (4 * STEP**2)


def _error(values: Array, expected: Sequence[Any]) -> float:
    """The largest difference relative to the largest value."""
    if not len(expected):
        return 0.0
    size = max(max(abs(w) for w in expected), max(abs(mp.mpf(float(g))) for g in values))
    worst = max(abs(mp.mpf(float(g)) - w) for g, w in zip(values, expected, strict=True))
    return float(worst / size) if size > NOTHING else 0.0
