"""The functions of a system and their derivatives in numbers of many digits, by differences."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import mpmath as mp
import sympy as sp

from dmoc.base.discretisation import DISCRETISATIONS
from dmoc.codegen.kernels import Array, Kernels
from dmoc.symbolic.continuous import Continuous
from dmoc.symbolic.expressions import approach_speed, sliding_speed

# Digits of the numbers, and the step of differences: two of them leave 1e-30 of the third
# derivative, rounding errors less.
DIGITS, STEP = 90, mp.mpf(10) ** -15

Vector = list[Any]
Values = Callable[[Vector], Vector]  # of (q, v, u, t)
Frictions = Callable[[Vector, Vector], Vector]  # of (q, v, u, t) and sliding speeds


def moved(x: Vector, d: Vector, share: Any) -> Vector:
    return [a + share * b for a, b in zip(x, d, strict=True)]


class ReferenceFunctions:
    """The functions of a system at fixed parameters, of y = (q, v, u, t)."""

    def __init__(self, f: Continuous, kernels: Kernels, values: Array) -> None:
        self.nq, self.nu = len(f.q), len(f.u)
        self.nc, self.nt = len(f.g), len(f.tau)
        self.scheme = DISCRETISATIONS[kernels.manifest.order]
        self._f, self._par = f, [mp.mpf(float(x)) for x in values]
        self._definitions = [self._compiled([e], f.x[:i]) for i, e in enumerate(f.x_of)]
        self.L, self.C, self.Phi = map(self._numbers, ([f.L], [f.C], [f.Phi]))
        self.g, self.r, self.c = map(self._numbers, (f.g, f.r, f.c))
        self.tau, self.e_t, self.w = map(self._numbers, (f.tau, f.e_t, f.w))
        self.within = self._numbers(f.within)
        self.Q = self._forces()
        self._e = self._compiled(f.e, (*f.x, *f.x_dot, approach_speed))
        self.constant, self.varying = map(self._frictions, (False, True))

    def _compiled(self, expressions: Sequence[Any], more: Sequence[Any]) -> Callable[..., Any]:
        f = self._f
        function: Callable[..., Any] = sp.lambdify(
            [*f.q, *f.v, *f.u, f.t, *f.par, *more], list(expressions), "mpmath"
        )
        return function

    def _places(self, y: Vector) -> Vector:
        """Values of the names for places."""
        x: Vector = []
        for definition in self._definitions:
            x += definition(*y, *self._par, *x)
        return x

    def _defined(self, y: Vector) -> Vector:
        """Values of the definitions for places, and their rates."""
        return [*self._places(y), *self._rates(self._places, y)] if self._f.x else []

    def _numbers(self, expressions: Sequence[Any]) -> Values:
        function = self._compiled(expressions, (*self._f.x, *self._f.x_dot))

        def values(y: Vector) -> Vector:
            return [_real(value) for value in function(*y, *self._par, *self._defined(y))]

        return values

    def _forces(self) -> Values:
        """Q with what the dissipation R makes of it."""
        forces, R = self._numbers(self._f.Q), self._numbers([self._f.R])

        def damped(y: Vector) -> Vector:
            slopes = (self._slopes(R, y, self.nq + i)[0] for i in range(self.nq))
            return [a - b for a, b in zip(forces(y), slopes, strict=True)]

        return forces if self._f.R == 0 else damped

    def function(
        self, expressions: Sequence[Any], more: Sequence[Any]
    ) -> Callable[[Vector, Vector], Vector]:
        """Functions of y and of more symbols."""
        compiled = self._compiled(expressions, (*self._f.x, *self._f.x_dot, *more))

        def values(y: Vector, own: Vector) -> Vector:
            return [_real(value) for value in compiled(*y, *self._par, *self._defined(y), *own)]

        return values

    def gap_rates(self, y: Vector) -> Vector:
        """Rates of the gaps."""
        return self._rates(self.g, y)

    def coefficients(self, y: Vector, rates: Vector) -> Vector:
        """Coefficients of restitution at rates of the gaps."""
        defined = self._defined(y)
        values = [self._e(*y, *self._par, *defined, rate) for rate in rates]
        return [_real(row[j]) for j, row in enumerate(values)]

    # Friction -------------------------------------------------------------------------------------

    def _frictions(self, varying: bool) -> dict[str, Frictions]:
        """Coefficients of friction of each kind that vary along a motion, or that do not; those of
        other tangents are zero."""
        f = self._f
        along = {*f.q, *f.v, *f.u, f.t, *f.x, sliding_speed}
        kinds = {"mu": f.mu} | ({"mu_s": f.mu_s} if f.mu_s != f.mu else {})
        pairs = zip(f.mu, f.mu_s, strict=True)
        varies = [bool((mu.free_symbols | mu_s.free_symbols) & along) for mu, mu_s in pairs]
        return {
            name: self._friction(
                [mu if v is varying else 0 * mu for mu, v in zip(kind, varies, strict=True)]
            )
            for name, kind in kinds.items()
        }

    def _friction(self, chosen: Sequence[Any]) -> Frictions:
        """Coefficients at sliding speeds, below zero continued along their tangents there."""
        mu = self._compiled(chosen, (*self._f.x, *self._f.x_dot, sliding_speed))

        def at_speeds(y: Vector, speeds: Vector) -> Vector:
            defined = self._defined(y)

            def at(j: int, speed: Any) -> Any:
                return _real(mu(*y, *self._par, *defined, speed)[j])

            def along(j: int, speed: Any) -> Any:
                slope = (at(j, STEP) - at(j, -STEP)) / (2 * STEP)
                return at(j, speed) if speed >= 0 else at(j, 0) + slope * speed

            return [along(j, speed) for j, speed in enumerate(speeds)]

        return at_speeds

    # Derivatives ----------------------------------------------------------------------------------

    def _slopes(self, values: Values, y: Vector, i: int) -> Vector:
        """Derivatives of functions with respect to component i of y = (q, v, u, t)."""
        direction = [mp.mpf(k == i) for k in range(len(y))]
        return self._along(values, y, direction)

    def _along(self, values: Values, y: Vector, d: Vector) -> Vector:
        high, low = values(moved(y, d, STEP)), values(moved(y, d, -STEP))
        return [(a - b) / (2 * STEP) for a, b in zip(high, low, strict=True)]

    def _rates(self, values: Values, y: Vector) -> Vector:
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


def _real(value: Any) -> Any:
    """A real number; raise ValueError for what is none."""
    number = mp.mpmathify(value)
    if isinstance(number, mp.mpc):
        if number.imag:
            raise ValueError
        number = number.real
    return number
