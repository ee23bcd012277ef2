"""What kernels compute of a system, in numbers of many digits: by differences and by a quadrature
of its own."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import mpmath as mp
import sympy as sp

from dmoc.inspection.reference_functions import (
    STEP,
    ReferenceFunctions,
    Values,
    Vector,
    moved,
)

Function = Callable[[Vector], dict[str, Vector]]


class ReferenceValues(ReferenceFunctions):
    """What the kernels of a system compute at fixed parameters."""

    @cached_property
    def families(self) -> dict[str, Function]:
        """Functions that the kernels compute of their inputs side by side, parameters aside."""
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
            "momentum": lambda x: {"p": self._momenta(self._state(x))},
            "energy": lambda x: {"E": [self._energy(self._state(x))]},
            "input_matrix": self._input_matrix,
            "running_cost": lambda x: {"C": self.C(x)},
            "force": lambda x: {"Q": self.Q(x), "power": [self._power(x)]},
            **self._of_contacts,
            **self._of_friction,
            "terminal_cost": lambda x: {"Phi": self.Phi(self._state(x))},
        }

    @property
    def _of_contacts(self) -> dict[str, Function]:
        return {
            "moving_work": lambda x: {"W_t": [self._moving(x)]},
            "rate_work": lambda x: {"W_gamma": [self._work(x)]},
            "surface": lambda x: {"g": self.g(self._place(x))},
            "gap_rate": lambda x: {"gamma": self._rates(self.g, self._state(x))},
            "within": lambda x: {"W": self._within(self._place(x))},
            "within_rate": lambda x: {"omega": self._rates(self._within, self._state(x))},
            "barrier": lambda x: {"B": self._behind(self._place(x))},
            "gap_work": self._gap_work,
            "rebound": self._rebound,
            "normal": lambda x: {"n": self._pushed(self.g, self.nc, x)},
            "crossing": lambda x: {"w": self.w(self._state(x))},
            "crossing_rate": self._crossing_rate,
        }

    @property
    def _of_friction(self) -> dict[str, Function]:
        origin, still = [mp.mpf(0)] * (2 * self.nq + self.nu + 1), [mp.mpf(0)] * self.nt
        return {
            "tangent": lambda x: {"tau": self.tau(self._place(x))},
            "slide_rate": lambda x: {"sigma": self._rates(self.tau, self._state(x))},
            "slip_work": self._slip_work,
            "traction": lambda x: {"s": self._pushed(self.tau, self.nt, x)},
            "friction": lambda _: {k: c(origin, still) for k, c in self.constant.items()},
            "bearing": lambda x: {"bears": self._bears(x)},
            "holding": lambda x: {"holds": self._bears(x, "mu_s")},
            "dragging": self._drags,
            "bearing_work": self._bearing_work,
            "tangential": lambda _: {"e_t": self.e_t(origin)},
        }

    def _place(self, x: Vector) -> Vector:
        """(q, 0, 0, t) of (q, t)."""
        return [*x[: self.nq], *[mp.mpf(0)] * (self.nq + self.nu), x[-1]]

    def _state(self, x: Vector) -> Vector:
        """(q, v, 0, t) of (q, v, t)."""
        return [*x[: 2 * self.nq], *[mp.mpf(0)] * self.nu, x[-1]]

    def _input_matrix(self, y: Vector) -> dict[str, Vector]:
        columns = (self._slopes(self.Q, y, 2 * self.nq + k) for k in range(self.nu))
        return {"B": [b for row in zip(*columns, strict=True) for b in row]}

    # Contacts -------------------------------------------------------------------------------------

    def _pushed(self, values: Values, count: int, x: Vector) -> Vector:
        """Sums of slopes by coordinates, of (q, lam, t)."""
        n = self.nq
        y, lam = self._place([*x[:n], x[-1]]), x[n : n + count]
        slopes = [self._slopes(values, y, i) for i in range(n)]
        return [mp.fsum(a * b for a, b in zip(s, lam, strict=True)) for s in slopes]

    def _within(self, y: Vector) -> Vector:
        """Functions W of all surfaces, 1 of those without ends."""
        own, pairs = dict[int, Any](), zip(self._f.ends, self.within(y), strict=True)
        for j, w in pairs:
            own[j] = own[j] + w - mp.hypot(own[j], w) if j in own else w
        return [own.get(j, mp.mpf(1)) for j in range(self.nc)]

    def _behind(self, y: Vector) -> Vector:
        """Functions B of all surfaces, the gaps of those without ends."""
        pairs = enumerate(zip(self.g(y), self._within(y), strict=True))
        return [g + w - mp.hypot(g, w) if j in self._f.ends else g for j, (g, w) in pairs]

    def _gap_work(self, x: Vector) -> dict[str, Vector]:
        """Works W_g of gaps from (q, lam, t)."""
        gaps = self._behind(self._place([*x[: self.nq], x[-1]]))
        return {"W_g": [a * b for a, b in zip(x[self.nq : -1], gaps, strict=True)]}

    def _rebound(self, x: Vector) -> dict[str, Vector]:
        """Rates, impulses and work of restitution from (q, v, lam, t)."""
        y, lam = self._state([*x[: 2 * self.nq], x[-1]]), x[2 * self.nq : -1]
        rates = self._rates(self.g, y)
        e = self.coefficients(y, rates)
        kept = [a * b for a, b in zip(lam, e, strict=True)]
        works = [mp.fdot(zip(kept, rates, strict=True))]
        back = [a * b for a, b in zip(e, rates, strict=True)]
        return {"gamma_e": back, "P_e": kept, "W_e": works}

    def _crossing_rate(self, x: Vector) -> dict[str, Vector]:
        """Rates of crossing functions of (q_k, q, v, h, t): along the motion with the acceleration
        that the mean velocity of the step shows."""
        n, h = self.nq, x[-2]
        q_k, q, v = x[:n], x[n : 2 * n], x[2 * n : 3 * n]
        a = [2 * (c - (d - b) / h) / h for b, d, c in zip(q_k, q, v, strict=True)]

        def later(s: Any) -> Vector:
            return self.w(self._state([*moved(q, v, s), *moved(v, a, s), x[-1] + s]))

        pairs = zip(later(STEP), later(-STEP), strict=True)
        return {"w_dot": [(late - early) / (2 * STEP) for late, early in pairs]}

    # Friction -------------------------------------------------------------------------------------

    def _slip_work(self, x: Vector) -> dict[str, Vector]:
        """Works W_tau of sliding from (q_k, q_kp1, T, t_k, t_kp1)."""
        n = self.nq
        early = self.tau(self._place([*x[:n], x[-2]]))
        late = self.tau(self._place([*x[n : 2 * n], x[-1]]))
        forces = x[2 * n : -2]
        return {"W_tau": [T * (b - a) for T, a, b in zip(forces, early, late, strict=True)]}

    def _between(self, x: Vector) -> tuple[Vector, Vector]:
        """u and N of (u_k, u_kp1, c, N)."""
        m = self.nu
        c, *N = x[2 * m :]
        return [(1 - c) * a + c * b for a, b in zip(x[:m], x[m : 2 * m], strict=True)], N

    def _bears(self, x: Vector, kind: str = "mu") -> Vector:
        """Largest friction from (q, sigma, u_k, u_kp1, c, N, t)."""
        n = self.nq
        u, N = self._between(x[n + self.nt : -1])
        y = [*x[:n], *[mp.mpf(0)] * n, *u, x[-1]]
        values = self.varying[kind](y, x[n : n + self.nt])
        return [a * b for a, b in zip(N, values, strict=True)]

    def _drags(self, x: Vector) -> dict[str, Vector]:
        """Friction of sliding from (q, around, d, h, s, u_k, u_kp1, c, N, t)."""
        n, count = self.nq, max(self.scheme.degree, 2) + 1
        around, more = x[n : (count + 1) * n], x[(count + 1) * n :]
        d, h, s = more[:count], more[count], more[count + 1 : count + 1 + self.nt]
        u, N = self._between(more[count + 1 + self.nt : -1])
        v = [mp.fdot(zip(d, around[i::n], strict=True)) / h for i in range(n)]
        rates = self._rates(self.tau, y := [*x[:n], *v, *u, x[-1]])
        speeds = [a * b for a, b in zip(s, rates, strict=True)]
        values = self.varying["mu"](y, speeds)
        return {"drags": [a * b for a, b in zip(N, values, strict=True)]}

    def _bearing_work(self, x: Vector) -> dict[str, Vector]:
        """Works W_mu of friction from the arguments of ``_bears``, then (q_k, q_kp1, t_k,
        t_kp1)."""
        n = self.nq
        of_bears, (q_k, q_kp1, t_k, t_kp1) = x[: -2 * n - 2], _ends_in(x[-2 * n - 2 :], n)
        early, late = (self.tau(self._place([*q, t])) for q, t in ((q_k, t_k), (q_kp1, t_kp1)))
        parts = zip(self._bears(of_bears), early, late, strict=True)
        return {"W_mu": [a * (after - before) for a, before, after in parts]}

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


def _ends_in(x: Vector, n: int) -> tuple[Vector, Vector, Any, Any]:
    """(q_k, q_kp1, t_k, t_kp1) side by side."""
    return x[:n], x[n : 2 * n], x[-2], x[-1]
