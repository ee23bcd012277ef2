"""The functions of a system and what kernels compute of them, in numbers of many digits: by
differences and by a quadrature of its own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
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
Function = Callable[[Vector], dict[str, Vector]]


def moved(x: Vector, d: Vector, share: Any) -> Vector:
    return [a + share * b for a, b in zip(x, d, strict=True)]


class ReferenceValues:
    """The functions of a system at fixed parameters, in numbers of many digits."""

    def __init__(self, f: Continuous, kernels: Kernels, values: Array) -> None:
        self.nq, self.nu = len(f.q), len(f.u)
        self.nc, self.nt = len(f.g), len(f.tau)
        self.scheme = DISCRETISATIONS[int(kernels.manifest["order"])]
        par = [mp.mpf(float(x)) for x in values]
        arguments = (*f.q, *f.v, *f.u, f.t)

        def compiled(expressions: Sequence[Any], more: Sequence[Any]) -> Callable[..., Any]:
            function: Callable[..., Any] = sp.lambdify(
                [*arguments, *f.par, *more], list(expressions), "mpmath"
            )
            return function

        definitions = [compiled([e], f.x[:i]) for i, e in enumerate(f.x_of)]

        def places(y: Vector) -> Vector:
            x: Vector = []
            for definition in definitions:
                x += definition(*y, *par, *x)
            return x

        def numbers(expressions: Sequence[Any]) -> Callable[[Vector], Vector]:
            function = compiled(expressions, (*f.x, *f.x_dot))

            def values(y: Vector) -> Vector:
                defined = [*places(y), *self._rates(places, y)] if f.x else []
                return [_real(value) for value in function(*y, *par, *defined)]

            return values

        self.L, self.C, self.Phi = numbers([f.L]), numbers([f.C]), numbers([f.Phi])
        self.g, self.r, self.c = numbers(f.g), numbers(f.r), numbers(f.c)
        forces, R = numbers(f.Q), numbers([f.R])

        def damped(y: Vector) -> Vector:
            slopes = (self._slopes(R, y, self.nq + i)[0] for i in range(self.nq))
            return [a - b for a, b in zip(forces(y), slopes, strict=True)]

        self.Q = forces if f.R == 0 else damped
        e = compiled(f.e, (*f.x, *f.x_dot, approach_speed))

        def coefficients(y: Vector, rates: Vector) -> Vector:
            defined = [*places(y), *self._rates(places, y)] if f.x else []
            values = [e(*y, *par, *defined, rate) for rate in rates]
            return [_real(row[j]) for j, row in enumerate(values)]

        self.coefficients = coefficients
        self.tau, self.e_t = numbers(f.tau), numbers(f.e_t)
        along = {*f.q, *f.v, *f.u, f.t, *f.x, sliding_speed}
        kinds = {"mu": f.mu} | ({"mu_s": f.mu_s} if f.mu_s != f.mu else {})

        pairs = zip(f.mu, f.mu_s, strict=True)
        varies = [bool((mu.free_symbols | mu_s.free_symbols) & along) for mu, mu_s in pairs]

        def frictions(chosen: Sequence[Any]) -> Callable[[Vector, Vector], Vector]:
            mu = compiled(chosen, (*f.x, *f.x_dot, sliding_speed))

            def at_speeds(y: Vector, speeds: Vector) -> Vector:
                defined = [*places(y), *self._rates(places, y)] if f.x else []

                def at(j: int, speed: Any) -> Any:
                    return _real(mu(*y, *par, *defined, speed)[j])

                def along(j: int, speed: Any) -> Any:
                    slope = (at(j, STEP) - at(j, -STEP)) / (2 * STEP)
                    return at(j, speed) if speed >= 0 else at(j, 0) + slope * speed

                return [along(j, speed) for j, speed in enumerate(speeds)]

            return at_speeds

        self.constant, self.varying = (
            {
                name: frictions(
                    [m if v is side else 0 * m for m, v in zip(kind, varies, strict=True)]
                )
                for name, kind in kinds.items()
            }
            for side in (False, True)
        )

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

        def gap_work(x: Vector) -> dict[str, Vector]:  # (q, lam, t)
            gaps = self.g(place([*x[:n], x[-1]]))
            return {"W_g": [a * b for a, b in zip(x[n:-1], gaps, strict=True)]}

        def rebound(x: Vector) -> dict[str, Vector]:  # (q, v, lam, t)
            y, lam = state([*x[: 2 * n], x[-1]]), x[2 * n : -1]
            rates = self._rates(self.g, y)
            e = self.coefficients(y, rates)
            kept = [a * b for a, b in zip(lam, e, strict=True)]
            works = [mp.fdot(zip(kept, rates, strict=True))]
            back = [a * b for a, b in zip(e, rates, strict=True)]
            return {"gamma_e": back, "P_e": kept, "W_e": works}

        def slip_work(x: Vector) -> dict[str, Vector]:  # (q_k, q_kp1, T, t_k, t_kp1)
            early = self.tau(place([*x[:n], x[-2]]))
            late = self.tau(place([*x[n : 2 * n], x[-1]]))
            forces = x[2 * n : -2]
            return {"W_tau": [T * (b - a) for T, a, b in zip(forces, early, late, strict=True)]}

        def between(x: Vector) -> tuple[Vector, Vector]:  # u and N of (u_k, u_kp1, c, N)
            c, *N = x[2 * m :]
            return [(1 - c) * a + c * b for a, b in zip(x[:m], x[m : 2 * m], strict=True)], N

        def bears(x: Vector, kind: str = "mu") -> Vector:  # (q, sigma, u_k, u_kp1, c, N, t)
            u, N = between(x[n + self.nt : -1])
            values = self.varying[kind]([*x[:n], *rest, *u, x[-1]], x[n : n + self.nt])
            return [a * b for a, b in zip(N, values, strict=True)]

        def drags(x: Vector) -> dict[str, Vector]:  # (q, around, d, h, s, u_k, u_kp1, c, N, t)
            count = max(self.scheme.degree, 2) + 1
            around, more = x[n : (count + 1) * n], x[(count + 1) * n :]
            d, h, s = more[:count], more[count], more[count + 1 : count + 1 + self.nt]
            u, N = between(more[count + 1 + self.nt : -1])
            v = [mp.fdot(zip(d, around[i::n], strict=True)) / h for i in range(n)]
            rates = self._rates(self.tau, y := [*x[:n], *v, *u, x[-1]])
            speeds = [a * b for a, b in zip(s, rates, strict=True)]
            values = self.varying["mu"](y, speeds)
            return {"drags": [a * b for a, b in zip(N, values, strict=True)]}

        def bearing_work(x: Vector) -> dict[str, Vector]:  # the same, q_k, q_kp1, t_k, t_kp1
            rest, (q_k, q_kp1, t_k, t_kp1) = x[: -2 * n - 2], _ends_in(x[-2 * n - 2 :], n)
            early, late = (self.tau(place([*q, t])) for q, t in ((q_k, t_k), (q_kp1, t_kp1)))
            parts = zip(bears(rest), early, late, strict=True)
            return {"W_mu": [a * (after - before) for a, before, after in parts]}

        return {
            "step": self._step,
            "impact": self._energies,
            "path": lambda x: {"r_d": [r for y, *_ in self.points(x) for r in self.r(y)]},
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
            "gap_work": gap_work,
            "rebound": rebound,
            "normal": lambda x: {"n": pushed(self.g, self.nc)(x)},
            "tangent": lambda x: {"tau": self.tau(place(x))},
            "slide_rate": lambda x: {"sigma": self._rates(self.tau, state(x))},
            "slip_work": slip_work,
            "traction": lambda x: {"s": pushed(self.tau, self.nt)(x)},
            "friction": lambda _: {
                k: c([mp.mpf(0)] * (2 * n + m + 1), [mp.mpf(0)] * self.nt)
                for k, c in self.constant.items()
            },
            "bearing": lambda x: {"bears": bears(x)},
            "holding": lambda x: {"holds": bears(x, "mu_s")},
            "dragging": drags,
            "bearing_work": bearing_work,
            "tangential": lambda _: {"e_t": self.e_t([mp.mpf(0)] * (2 * n + m + 1))},
            "terminal_cost": lambda x: {"Phi": self.Phi(state(x))},
        }

    # Derivatives ----------------------------------------------------------------------------------

    def _slopes(self, values: Callable[[Vector], Vector], y: Vector, i: int) -> Vector:
        """Derivatives of functions with respect to component i of y = (q, v, u, t)."""
        direction = [mp.mpf(k == i) for k in range(len(y))]
        return self._along(values, y, direction)

    def _along(self, values: Callable[[Vector], Vector], y: Vector, d: Vector) -> Vector:
        high, low = values(moved(y, d, STEP)), values(moved(y, d, -STEP))
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
        q_i = q_i[: self.scheme.inside * n]  # hidden unknowns may stand behind
        return [q_k, q_kp1, *(q_i[a : a + n] for a in range(0, len(q_i), n))], (u_k, u_kp1), h, t_k

    def points(self, x: Vector) -> list[tuple[Vector, Vector, Any, Any, Vector]]:
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
        return [h * mp.fsum(b * self.L(start)[0] for start, _, _, b, _ in self.points(x))]

    def _step(self, x: Vector) -> dict[str, Vector]:
        n, h = self.nq, x[2 * self.nq + 2 * self.nu]
        inner = 2 * n + 2 * self.nu + 2
        points = self.points(x)
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
        h, points = x[at], self.points(x)

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


def _ends_in(x: Vector, n: int) -> tuple[Vector, Vector, Any, Any]:
    """(q_k, q_kp1, t_k, t_kp1) side by side."""
    return x[:n], x[n : 2 * n], x[-2], x[-1]
