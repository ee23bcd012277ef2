"""Kernels beside an evaluation that shares nothing with their derivation: the functions of the
system in numbers of many digits, differences for every derivative, and a quadrature of its own.

At a random point each kernel is compared with what the definitions of the derivation say of the
Lagrangian, the forces, the cost and the surfaces.  Matrices of derivatives are compared along
random directions.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import mpmath as mp
import numpy as np
import sympy as sp

from dmoc.base.discretisation import DISCRETISATIONS
from dmoc.codegen.kernels import Array, Kernels
from dmoc.symbolic.continuous import Continuous, readable
from dmoc.symbolic.kinks import split
from dmoc.symbolic.system import MechanicalSystem

# Digits of the numbers, and the step of differences: two of them leave 1e-30 of the third
# derivative, rounding errors less.
DIGITS, STEP = 90, mp.mpf(10) ** -15
# Kernels of steps, which take hidden unknowns behind the inputs.
OF_STEPS = ("step", "impact", "path", "path_node", "path_ends", "path_point")
POINTS = 20  # random points that are tried until all functions are real there

Vector = list[Any]
Function = Callable[[Vector], dict[str, Vector]]


@dataclass(frozen=True)
class Checked:
    """The largest error of a kernel relative to the largest of the values compared."""

    kernel: str
    error: float


def checked(system: MechanicalSystem, kernels: Kernels, seed: int = 0) -> tuple[Checked, ...]:
    """Compare the kernels of a system, of any order, with an independent evaluation at random
    points and along random directions; kernels that are not listed were not compared."""
    with mp.workdps(DIGITS):
        for k in range(POINTS):
            errors = _at_random(system, kernels, np.random.default_rng([seed, k]))
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
        sizes = [size for _, size in kernels.manifest["kernels"][name]["inputs"]][:-1]
        x = rng.uniform(0.2, 0.9, sum(sizes))
        try:
            errors += _compared(kernels, name, (function, x, sizes), values, rng)
        except (TypeError, ValueError, ZeroDivisionError):
            return ()  # a function is not real there
    return tuple(errors)


def _families(system: MechanicalSystem, kernels: Kernels, values: Array) -> dict[str, Function]:
    """What the kernels compute; those of steps have hidden unknowns in the place of kinks."""
    f, unknowns = readable(system), split(system).unknowns
    smooth = f.smooth(system, [sp.Dummy(real=True) for _ in unknowns])
    kinks = replace(f, r=tuple(f.rewritten(system, [kink for _, kink in unknowns])))
    plain, of_steps, hidden = (_Definitions(g, kernels, values) for g in (f, smooth, kinks))
    families = plain.families | {name: of_steps.families[name] for name in OF_STEPS}
    return families | {"hidden": lambda x: {"s": hidden.r(x)}}


def _compared(
    kernels: Kernels, name: str, reference: tuple[Function, Array, list[int]], values: Array,
    rng: np.random.Generator,
) -> list[Checked]:  # fmt: skip
    """A kernel and those of its derivatives."""
    function, x, sizes = reference
    parts = np.split(x, np.cumsum(sizes)[:-1]) if sizes else []
    rows = [*(part[None] for part in parts), values[None]]
    point, d, e = ([mp.mpf(float(z)) for z in v] for v in (x, *rng.normal(size=(2, len(x)))))
    wanted = function(point)
    values_of = dict(zip(kernels.outputs(name), kernels.call(name, *rows), strict=True))
    errors_of = [Checked(name, max(_error(values_of[a][0], v) for a, v in wanted.items()))]
    if kernels.has(f"{name}_jac"):
        high, low = (function(_moved(point, d, s * STEP)) for s in (1, -1))
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
        weights = {a: rng.normal(size=len(v)) for a, v in wanted.items()}
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
        values = function(_moved(_moved(point, d, s * STEP), e, r * STEP))
        pairs = [p for a, w in weights.items() for p in zip(w, values[a], strict=True)]
        total += s * r * mp.fsum(mp.mpf(float(w)) * v for w, v in pairs)
    return total / (4 * STEP**2)


def _moved(x: Vector, d: Vector, share: Any) -> Vector:
    return [a + share * b for a, b in zip(x, d, strict=True)]


def _error(values: Array, wanted: Sequence[Any]) -> float:
    """The largest difference relative to the largest value."""
    if not len(wanted):
        return 0.0
    size = max(max(abs(w) for w in wanted), max(abs(mp.mpf(float(g))) for g in values))
    worst = max(abs(mp.mpf(float(g)) - w) for g, w in zip(values, wanted, strict=True))
    return float(worst / size) if size else 0.0


class _Definitions:
    """The functions of a system at fixed parameters, in numbers of many digits."""

    def __init__(self, f: Continuous, kernels: Kernels, values: Array) -> None:
        self.nq, self.nu = len(f.q), len(f.u)
        self.nc, self.nt = len(f.g), len(f.tau)
        self.scheme = DISCRETISATIONS[int(kernels.manifest["order"])]
        par = [mp.mpf(float(x)) for x in values]
        arguments = (*f.q, *f.v, *f.u, f.t)

        def numbers(expressions: Sequence[Any]) -> Callable[[Vector], Vector]:
            compiled = sp.lambdify([*arguments, *f.par], list(expressions), "mpmath")
            return lambda y: [_real(value) for value in compiled(*y, *par)]

        self.L, self.C, self.Phi = numbers([f.L]), numbers([f.C]), numbers([f.Phi])
        self.Q, self.g, self.r = numbers(f.Q), numbers(f.g), numbers(f.r)
        self.tau, self.mu = numbers(f.tau), numbers(f.mu)

    @cached_property
    def families(self) -> dict[str, Function]:
        """What the kernels compute of their inputs side by side, parameters aside."""
        n, m = self.nq, self.nu
        rest: Vector = [mp.mpf(0)] * n
        idle: Vector = [mp.mpf(0)] * m

        def place(x: Vector) -> Vector:  # (q, t)
            return [*x[:n], *rest, *idle, x[-1]]

        def state(x: Vector) -> Vector:  # (q, v, t)
            return [*x[: 2 * n], *idle, x[-1]]

        def pushed(values: Callable[[Vector], Vector], count: int) -> Callable[[Vector], Vector]:
            def sums(x: Vector) -> Vector:  # (q, lam, t)
                y, lam = place([*x[:n], x[-1]]), x[n : n + count]
                slopes = [self._slopes(values, y, i) for i in range(n)]
                return [mp.fsum(a * b for a, b in zip(s, lam, strict=True)) for s in slopes]

            return sums

        return {
            "step": self._step,
            "impact": self._energies,
            "path": lambda x: {"r_d": [r for y, *_ in self._points(x) for r in self.r(y)]},
            "path_point": lambda x: {"r": self.r(x)},
            "path_limit": lambda x: {"r_s": self.r(x)},
            "path_node": lambda x: {"r_k": self.r(self._node(x))},
            "path_ends": lambda x: {"r_e": [r for y in self._ends(x) for r in self.r(y)]},
            "dynamics": self._dynamics,
            "residual": self._residual,
            "momentum": lambda x: {"p": self._momenta(state(x))},
            "energy": lambda x: {"E": [self._energy(state(x))]},
            "input_matrix": lambda x: {
                "B": [
                    b
                    for row in zip(
                        *(self._slopes(self.Q, x, 2 * n + k) for k in range(m)), strict=True
                    )
                    for b in row
                ]
            },
            "running_cost": lambda x: {"C": self.C(x)},
            "force": lambda x: {"Q": self.Q(x), "power": [self._power(x)]},
            "moving_work": lambda x: {"W_t": [self._moving(x)]},
            "rate_work": lambda x: {"W_gamma": [self._work(x)]},
            "surface": lambda x: {"g": self.g(place(x))},
            "gap_rate": lambda x: {"gamma": self._rates(self.g, state(x))},
            "normal": lambda x: {"n": pushed(self.g, self.nc)(x)},
            "tangent": lambda x: {"tau": self.tau(place(x))},
            "slide_rate": lambda x: {"sigma": self._rates(self.tau, state(x))},
            "traction": lambda x: {"s": pushed(self.tau, self.nt)(x)},
            "friction": lambda _: {"mu": self.mu([mp.mpf(0)] * (2 * n + m + 1))},
            "terminal_cost": lambda x: {"Phi": self.Phi(state(x))},
        }

    # Derivatives ----------------------------------------------------------------------------------

    def _slopes(self, values: Callable[[Vector], Vector], y: Vector, i: int) -> Vector:
        """Derivatives of functions with respect to component i of y = (q, v, u, t)."""
        direction = [mp.mpf(k == i) for k in range(len(y))]
        return self._along(values, y, direction)

    def _along(self, values: Callable[[Vector], Vector], y: Vector, d: Vector) -> Vector:
        high, low = values(_moved(y, d, STEP)), values(_moved(y, d, -STEP))
        return [(a - b) / (2 * STEP) for a, b in zip(high, low, strict=True)]

    def _rates(self, values: Callable[[Vector], Vector], y: Vector) -> Vector:
        """Rates of functions of position and time along a velocity."""
        n = self.nq
        rest = [mp.mpf(0)] * (n + self.nu)
        return self._along(values, y, [*y[n : 2 * n], *rest, mp.mpf(1)])

    def _momenta(self, y: Vector) -> Vector:
        return [self._slopes(self.L, y, self.nq + i)[0] for i in range(self.nq)]

    def _energy(self, y: Vector) -> Any:
        v = y[self.nq : 2 * self.nq]
        work = (a * b for a, b in zip(self._momenta(y), v, strict=True))
        return mp.fsum(work) - self.L(y)[0]

    def _power(self, y: Vector) -> Any:
        """Q . v - dL/dt."""
        v = y[self.nq : 2 * self.nq]
        return mp.fdot(zip(self.Q(y), v, strict=True)) - self._slopes(self.L, y, len(y) - 1)[0]

    def _moving(self, x: Vector) -> Any:
        """Work of moving surfaces, from (q, lam, t)."""
        n, rest = self.nq, [mp.mpf(0)] * (self.nq + self.nu)
        rates = self._slopes(self.g, [*x[:n], *rest, x[-1]], 2 * n + self.nu)
        return mp.fdot(zip(x[n:-1], rates, strict=True))

    def _work(self, x: Vector) -> Any:
        """Impulses times rates of the gaps, from (q, v, lam, t)."""
        n = self.nq
        rates = self._rates(self.g, [*x[: 2 * n], *[mp.mpf(0)] * self.nu, x[-1]])
        return mp.fdot(zip(x[2 * n : -1], rates, strict=True))

    def _dynamics(self, y: Vector) -> dict[str, Vector]:
        """M, and F = dL/dq - (d2L/dq'dq) q' - d2L/dq'dt + Q."""
        n = self.nq
        mass = [self._slopes(self._momenta, y, n + j) for j in range(n)]
        along = self._rates(self._momenta, y)
        slopes = [self._slopes(self.L, y, i)[0] for i in range(n)]
        force = [a - b + c for a, b, c in zip(slopes, along, self.Q(y), strict=True)]
        return {"M": [mass[j][i] for i in range(n) for j in range(n)], "F": force}

    def _residual(self, x: Vector) -> dict[str, Vector]:
        """F - M a at x = (q, v, u, t, a)."""
        y, a = x[: -self.nq], x[-self.nq :]
        parts = self._dynamics(y)
        rows = [parts["M"][i : i + self.nq] for i in range(0, self.nq**2, self.nq)]
        moved = [mp.fdot(row, a) for row in rows]
        return {"R": [f - g for f, g in zip(parts["F"], moved, strict=True)]}

    # Steps ----------------------------------------------------------------------------------------

    @cached_property
    def _rule(self) -> tuple[Vector, Vector, Vector]:
        """Gauss points and weights, and Lobatto nodes (first, last, inside) on [0, 1]."""
        x, d = sp.Symbol("x"), self.scheme.degree
        legendre = sp.Poly(sp.legendre(d, x), x)

        def numbers(polynomial: Any) -> Vector:
            return [mp.mpf(int(c.p)) / int(c.q) for c in polynomial.all_coeffs()]

        def roots(polynomial: Any) -> Vector:
            return sorted(mp.re(r) for r in mp.polyroots(numbers(polynomial)))

        points = roots(legendre)
        slope = legendre.diff(x)
        at = [mp.polyval(numbers(slope), c) for c in points]
        weights = [1 / ((1 - c**2) * s**2) for c, s in zip(points, at, strict=True)]
        inside = roots(slope) if d > 1 else []
        nodes = [mp.mpf(0), mp.mpf(1), *((1 + c) / 2 for c in inside)]
        return [(1 + c) / 2 for c in points], weights, nodes

    def _parts(self, x: Vector) -> tuple[list[Vector], tuple[Vector, Vector], Any, Any]:
        """Nodes of a step, inputs of both sides, h and t_k."""
        n, m = self.nq, self.nu
        q_k, q_kp1 = x[:n], x[n : 2 * n]
        u_k, u_kp1 = x[2 * n : 2 * n + m], x[2 * n + m : 2 * n + 2 * m]
        h, t_k, q_i = x[2 * n + 2 * m], x[2 * n + 2 * m + 1], x[2 * n + 2 * m + 2 :]
        return [q_k, q_kp1, *(q_i[a : a + n] for a in range(0, len(q_i), n))], (u_k, u_kp1), h, t_k

    def _points(self, x: Vector) -> list[tuple[Vector, Vector, Any, Any, Vector]]:
        """States (q, v, u, t) at the quadrature points of a step with the input of the start side
        and of the end side, places, weights, and the shape functions there."""
        ways, (u_k, u_kp1), h, t_k = self._parts(x)
        states = []
        for c, b in zip(*self._rule[:2], strict=True):
            q, v, phi = self._polynomial(ways, c, h)
            if self.scheme.degree == 1:
                sides = (u_k, u_kp1)
            else:
                between = [(1 - c) * a + c * e for a, e in zip(u_k, u_kp1, strict=True)]
                sides = (between, between)
            start, end = ([*q, *v, *u, t_k + c * h] for u in sides)
            states.append((start, end, c, b, phi))
        return states

    def _polynomial(self, ways: list[Vector], c: Any, h: Any) -> tuple[Vector, Vector, Vector]:
        """Position and velocity of the polynomial of a step at a place, and the shape functions."""
        phi, high, low = (self._shapes(c + s * STEP) for s in (0, 1, -1))
        slope = [(a - b) / (2 * STEP) for a, b in zip(high, low, strict=True)]
        columns = list(zip(*ways, strict=True))
        q = [mp.fdot(zip(phi, column, strict=True)) for column in columns]
        return q, [mp.fdot(zip(slope, column, strict=True)) / h for column in columns], phi

    def _ends(self, x: Vector) -> list[Vector]:
        """(q, v, u, t) at both ends of a step, by its polynomial."""
        ways, (u_k, u_kp1), h, t_k = self._parts(x)
        sides = []
        for c, u in ((mp.mpf(0), u_k), (mp.mpf(1), u_kp1)):
            q, v, _ = self._polynomial(ways, c, h)
            sides.append([*q, *v, *u, t_k + c * h])
        return sides

    def _node(self, x: Vector) -> Vector:
        """(q, v, u, t) of a node from (q_km1, q_k, q_kp1, u_k, h, t_k)."""
        n, h = self.nq, x[-2]
        v = [(b - a) / (2 * h) for a, b in zip(x[:n], x[2 * n : 3 * n], strict=True)]
        return [*x[n : 2 * n], *v, *x[3 * n : -2], x[-1]]

    def _shapes(self, c: Any) -> Vector:
        """Lagrange's polynomials of the nodes at a place."""
        nodes = self._rule[2]
        return [mp.fprod((c - z) / (a - z) for z in nodes if z != a) for a in nodes]

    def _action(self, x: Vector) -> Vector:
        """The discrete Lagrangian L_d."""
        h = x[2 * self.nq + 2 * self.nu]
        return [h * mp.fsum(b * self.L(start)[0] for start, _, _, b, _ in self._points(x))]

    def _step(self, x: Vector) -> dict[str, Vector]:
        n, h = self.nq, x[2 * self.nq + 2 * self.nu]
        inner = 2 * n + 2 * self.nu + 2
        points = self._points(x)
        inside = range(2, self.scheme.degree + 1)
        nodes = [(0, 0), (1, n), *((a, inner + (a - 2) * n) for a in inside)]
        rows = []
        for a, first in nodes:
            for j in range(n):
                side = 1 if a == 1 else 0
                work = mp.fsum(p[3] * p[4][a] * self.Q(p[side])[j] for p in points)
                rows.append(self._slopes(self._action, x, first + j)[0] + h * work)
        cost = h * mp.fsum(b * (self.C(s)[0] + self.C(e)[0]) / 2 for s, e, _, b, _ in points)
        return {"r_minus": rows[:n], "r_plus": rows[n : 2 * n], "C_d": [cost], "r_i": rows[2 * n :]}

    def _energies(self, x: Vector) -> dict[str, Vector]:
        """Derivatives of L_d with respect to h at a fixed start and at a fixed end, with the work
        of the forces."""
        n, at = self.nq, 2 * self.nq + 2 * self.nu
        h, points = x[at], self._points(x)

        def work(side: int, share: Callable[[Any], Any]) -> Any:
            powers = ((p[3] * share(p[2]), self.Q(p[side]), p[side][n : 2 * n]) for p in points)
            return h * mp.fsum(w * mp.fdot(zip(Q, v, strict=True)) for w, Q, v in powers)

        by_h = self._slopes(self._action, x, at)[0]
        by_t = self._slopes(self._action, x, at + 1)[0]
        return {
            "e_plus": [by_h - work(1, lambda c: c)],
            "e_minus": [by_h - by_t + work(0, lambda c: 1 - c)],
        }


def _real(value: Any) -> Any:
    """A real number; raise ValueError for what is none."""
    number = mp.mpmathify(value)
    if isinstance(number, mp.mpc):
        if number.imag:
            raise ValueError
        number = number.real
    return number
