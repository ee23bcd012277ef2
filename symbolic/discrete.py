"""The step element: discrete Lagrangian, forces, momenta, energies and cost of one step (Galerkin
variational integrators); equations :eq:`interpolation` to :eq:`midpoint` of the theory.

A step of size h from t_k carries a polynomial q(c) of degree d through its nodes, c in [0, 1], and
every integral over the step is taken by Gauss quadrature with points c_i and weights b_i.  With the
shape functions phi_a of the nodes a::

    q_i = sum_a phi_a(c_i) q_a      v_i = sum_a phi_a'(c_i) q_a / h      t_i = t_k + c_i h
    L_d = h sum_i b_i L(q_i, v_i, t_i)      fd_a = h sum_i b_i phi_a(c_i) Q_i
    r_a = D_a L_d + fd_a:   r_minus (first node) = -p at the step's start,
                            r_plus (last node) = p at its end,   r_i (inside) = 0
    e_plus = D_h L_d - h sum_i b_i c_i Q_i . v_i           at fixed t_k:      -(energy) at the end
    e_minus = D_h L_d + h sum_i b_i (1 - c_i) Q_i . v_i    at fixed t_k + h:  -(energy) at the start
    C_d = h sum_i b_i C_i

Hidden unknowns in the place of kinks have a value at every point, s_i.

d = 1 with one point is the midpoint rule (Kern & Gross 2018), of order 2; its forces and cost take
the input u_k at the start and u_kp1 at the end of the step, fd_minus = h/2 Q(u_k), fd_plus = h/2
Q(u_kp1), C_d = h/2 (C(u_k) + C(u_kp1)), so that inputs linear in a step have no null space.  d = 2
with Lobatto nodes (start, middle, end) and two points is of order 4; inputs are linear in the step,
from u_k at its start to u_kp1 at its end, so that limits of both hold everywhere in between.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any

import sympy as sp

from dmoc.base.discretisation import DISCRETISATIONS, known_order
from dmoc.symbolic.arrangement import flat
from dmoc.symbolic.continuous import Continuous, dot, sum_of
from dmoc.symbolic.graph import gradient
from dmoc.symbolic.quadrature import lobatto_nodes, quadrature, shape_functions
from dmoc.symbolic.slopes import slope


@dataclass(frozen=True)
class QuadraturePoint:
    """A quadrature point: its place c and weight b, the shape functions and their derivatives at
    c by node (first, last, inside), and the functions of the system in the symbols of the point,
    with the input of the step's start side and of its end side."""

    c: Any
    b: Any
    phi: tuple[Any, ...]
    slope: tuple[Any, ...]
    start: Continuous
    end: Continuous

    def mean(self, value: Callable[[Continuous], Any]) -> Any:
        """A function of the system, the mean of both sides where their inputs differ."""
        return (
            value(self.start)
            if self.start is self.end
            else (value(self.start) + value(self.end)) / 2
        )


@dataclass(frozen=True)
class StepElement:
    """The element in the symbols of its quadrature points, which the total derivative :meth:`D`
    resolves."""

    points: tuple[QuadraturePoint, ...]
    q_k: tuple[Any, ...]
    q_kp1: tuple[Any, ...]
    q_i: tuple[Any, ...]
    u_k: tuple[Any, ...]
    u_kp1: tuple[Any, ...]
    h: Any
    t_k: Any

    @property
    def x_k(self) -> tuple[Any, ...]:
        """The unknowns of the step, (q_k, q_kp1, u_k, u_kp1, h, t_k, q_i), in this order
        everywhere."""
        return (*self.q_k, *self.q_kp1, *self.u_k, *self.u_kp1, self.h, self.t_k, *self.q_i)

    @property
    def inside(self) -> int:
        """Number of nodes inside the step."""
        return len(self.q_i) // len(self.q_k)

    @property
    def at_h(self) -> int:
        """Position of h in x_k."""
        return len(self.x_k) - len(self.q_i) - 2

    @property
    def nodes(self) -> tuple[tuple[Any, ...], ...]:
        """Coordinates of the nodes in the order of the shape functions."""
        n = len(self.q_k)
        return (self.q_k, self.q_kp1, *(self.q_i[i : i + n] for i in range(0, len(self.q_i), n)))

    @property
    def definitions(self) -> tuple[tuple[Any, Any], ...]:
        """Position, velocity and time of the quadrature points in terms of x_k."""
        values = []
        for p in self.points:
            f = p.start
            columns = list(zip(*self.nodes, strict=True))
            values += [(s, dot(p.phi, column)) for s, column in zip(f.q, columns, strict=True)]
            values += [
                (s, dot(p.slope, column) / self.h) for s, column in zip(f.v, columns, strict=True)
            ]
            values.append((f.t, self.t_k + p.c * self.h))
        return tuple(values)

    @property
    def symbols(self) -> tuple[Any, ...]:
        """Symbols of the expressions: positions, velocities and times of the points, inputs, h."""
        states = (s for p in self.points for s in (*p.start.q, *p.start.v, p.start.t))
        return (*states, *self.u_k, *self.u_kp1, self.h)

    def D(self, expression: Any, i: int) -> Any:
        """Total derivative of an expression in :attr:`symbols` with respect to ``x_k[i]``."""
        return self._total(lambda s: slope(expression, s), i)

    def chain(self, partial: Callable[[Sequence[Any]], list[Any]]) -> list[Any]:
        """Total derivatives with respect to all of x_k from the partial ones by
        :attr:`symbols`."""
        by = dict(zip(self.symbols, partial(self.symbols), strict=True))
        return [self._total(by.__getitem__, i) for i in range(len(self.x_k))]

    def spread(self, partial: Callable[[Sequence[Any]], list[Any]]) -> list[Any]:
        """Total derivatives by x_k, written as sums without sums in them, which others share."""
        by = dict(zip(self.symbols, partial(self.symbols), strict=True))
        return [flat(self._parts(by.__getitem__, i)) for i in range(len(self.x_k))]

    def _total(self, by: Callable[[Any], Any], i: int) -> Any:
        return sum_of(factor * value for factor, value in self._parts(by, i))

    def _parts(self, by: Callable[[Any], Any], i: int) -> list[tuple[Any, Any]]:
        """Factors and partial derivatives whose products make the total derivative by
        ``x_k[i]``."""
        node, j = self._node(i)
        if node is not None:
            return [
                part
                for p in self.points
                for part in (
                    (p.phi[node], by(p.start.q[j])),
                    (p.slope[node] / self.h, by(p.start.v[j])),
                )
            ]
        if i < self.at_h:
            return [(1, by(self.x_k[i]))]
        times = [by(p.start.t) for p in self.points]
        if i > self.at_h:
            return [(1, slope) for slope in times]
        return [
            (1, by(self.h)),
            *((p.c, slope) for p, slope in zip(self.points, times, strict=True)),
            *((-v / self.h, by(v)) for p in self.points for v in p.start.v),
        ]

    def _node(self, i: int) -> tuple[int | None, int]:
        """Node and coordinate that ``x_k[i]`` is; no node for inputs, h and t_k."""
        n = len(self.q_k)
        if i < 2 * n:
            return i // n, i % n
        inside = i - self.at_h - 2
        return (2 + inside // n, inside % n) if inside >= 0 else (None, 0)

    def gradient(self, expression: Any, begin: int = 0) -> list[Any]:
        """Total derivatives with respect to x_k from a place on; nodes share partial ones."""
        by = cache(lambda s: slope(expression, s))
        return [self._total(by, i) for i in range(begin, len(self.x_k))]

    def jacobian(self, expressions: Sequence[Any]) -> list[list[Any]]:
        return [self.gradient(e) for e in expressions]

    def hessian(self, expression: Any) -> list[list[Any]]:
        """Upper triangle of the second total derivative of an expression of SymPy; the strict lower
        triangle is zero.  Nodes share partial derivatives, of the second order too."""
        first = cache(lambda a: slope(expression, a))
        second = cache(lambda a, b: slope(first(a), b))

        def row(i: int) -> list[Any]:
            parts = [(sp.sympify(c), a) for c, a in self._parts(lambda a: a, i)]

            @cache
            def by(b: Any) -> Any:
                own = [c * second(a, b) for c, a in parts]
                return sum_of(own + [c.diff(b) * first(a) for c, a in parts if c.has(b)])

            return [self._total(by, j) for j in range(i, len(self.x_k))]

        return [[0] * i + row(i) for i in range(len(self.x_k))]

    def _sum(self, value: Callable[[QuadraturePoint], Any]) -> Any:
        """h sum_i b_i value_i."""
        return sum_of(self.h * p.b * value(p) for p in self.points)

    @cached_property
    def L_d(self) -> Any:
        return self._sum(lambda p: p.start.L)

    @cached_property
    def _slopes(self) -> list[Any]:
        """Total derivatives of L_d."""
        return self.chain(lambda symbols: gradient(self.L_d, symbols))

    def _force(self, node: int, side: Callable[[QuadraturePoint], Continuous]) -> list[Any]:
        def component(j: int) -> Any:
            return self._sum(lambda p: p.phi[node] * side(p).Q[j])

        return [component(j) for j in range(len(self.q_k))]

    @cached_property
    def fd_minus(self) -> list[Any]:
        return self._force(0, lambda p: p.start)

    @cached_property
    def fd_plus(self) -> list[Any]:
        return self._force(1, lambda p: p.end)

    def _momentum(self, node: int, force: list[Any]) -> list[Any]:
        n = len(self.q_k)
        first = node * n if node < 2 else self.at_h + 2 + (node - 2) * n
        return [self._slopes[first + j] + f for j, f in enumerate(force)]

    @cached_property
    def r_minus(self) -> list[Any]:
        return self._momentum(0, self.fd_minus)

    @cached_property
    def r_plus(self) -> list[Any]:
        return self._momentum(1, self.fd_plus)

    @cached_property
    def r_i(self) -> list[Any]:
        """Equations of the nodes inside the step."""
        nodes = range(2, len(self.nodes))
        return [
            r for node in nodes for r in self._momentum(node, self._force(node, lambda p: p.start))
        ]

    @cached_property
    def e_plus(self) -> Any:
        return self._slopes[self.at_h] - self._sum(lambda p: p.c * dot(p.end.Q, p.end.v))

    @cached_property
    def e_minus(self) -> Any:
        at_fixed_end = self._slopes[self.at_h] - self._slopes[self.at_h + 1]
        return at_fixed_end + self._sum(lambda p: (1 - p.c) * dot(p.start.Q, p.start.v))

    def integral(self, value: Callable[[Continuous], Any]) -> Any:
        """The integral of a function of the system over the step."""
        return self._sum(lambda p: p.mean(value))

    @cached_property
    def C_d(self) -> Any:
        return self.integral(lambda f: f.C)

    @property
    def sides(self) -> list[Continuous]:
        """The system at all points, on both sides where their inputs differ."""
        return [
            f for p in self.points for f in ((p.start,) if p.start is p.end else (p.start, p.end))
        ]

    @property
    def s(self) -> tuple[Any, ...]:
        """Hidden unknowns of the step: those of one side of a point after those of another."""
        return tuple(s for f in self.sides for s in f.s)

    @property
    def l_d(self) -> list[Any]:
        """Limits of the hidden unknowns, in the same order."""
        return [limit for f in self.sides for limit in f.l]

    @property
    def r_d(self) -> list[Any]:
        """Path constraints at the points."""
        return [r for p in self.points for r in p.start.r]


def step_element(
    f: Continuous, order: int, make: Callable[[str], Any], exact: Callable[[Any], Any]
) -> StepElement:
    """Build the element of ``f``; ``make(name)`` makes a symbol and ``exact(number)`` a number
    of the expression type in use."""
    n, m = len(f.q), len(f.u)
    order = known_order(order)
    degree = DISCRETISATIONS[order].degree
    (places, weights), nodes = quadrature(degree), lobatto_nodes(degree)

    def vector(name: str, count: int) -> tuple[Any, ...]:
        return tuple(make(f"{name}_{i}") for i in range(count))

    u_k, u_kp1 = vector("u_k", m), vector("u_kp1", m)
    points = []
    for i, (c, b) in enumerate(zip(places, weights, strict=True)):
        here = f if len(places) == 1 else _renamed(f, i + 1, make)
        if len(places) == 1:
            start, end = (
                _with_inputs(_with_hidden(here, side, make), u)
                for side, u in enumerate((u_k, u_kp1))
            )
        else:
            here = _with_hidden(here, i, make)
            start = end = _with_inputs(here, _between(u_k, u_kp1, c, exact))
        points.append(_point(nodes, c, exact, start, end, b))
    q_i = vector("q_i", n * (len(nodes) - 2))
    return StepElement(
        tuple(points), vector("q_k", n), vector("q_kp1", n), q_i, u_k, u_kp1, make("h"), make("t_k")
    )


def at_ends(
    f: Continuous, e: StepElement, make: Callable[[str], Any], exact: Callable[[Any], Any]
) -> StepElement:
    """The element with the ends of the step instead of its quadrature points, at which the inputs
    have their values; with all of its nodes, in the order of time, where there are forces."""
    nodes, points = lobatto_nodes(e.inside + 1), []
    for i, c in enumerate(sorted(nodes, key=float) if f.y else nodes[:2]):
        u = {sp.S.Zero: e.u_k, sp.S.One: e.u_kp1}.get(c) or _between(e.u_k, e.u_kp1, c, exact)
        side = _with_inputs(_renamed(f, i + 1, make), u)
        points.append(_point(nodes, c, exact, side, side))
    return replace(e, points=tuple(points))


def _between(
    start: tuple[Any, ...], end: tuple[Any, ...], c: Any, exact: Callable[[Any], Any]
) -> tuple[Any, ...]:
    """Inputs at the place c of a step in which they are linear."""
    return tuple(exact(1 - c) * a + exact(c) * b for a, b in zip(start, end, strict=True))


def _point(
    nodes: Sequence[Any], c: Any, exact: Callable[[Any], Any], start: Continuous, end: Continuous,
    b: Any = 0,
) -> QuadraturePoint:  # fmt: skip
    """The place c of a step of nodes."""
    phi, slope = (tuple(exact(s) for s in shape_functions(tuple(nodes), c, d)) for d in (0, 1))
    return QuadraturePoint(exact(c), exact(b), phi, slope, start, end)


def _renamed(f: Continuous, number: int, make: Callable[[str], Any]) -> Continuous:
    """The functions in symbols of their own for one quadrature point."""
    old = (*f.q, *f.v, f.t, *f.x, *f.x_dot, *f.y)
    table = {s: make(f"{s}_{number}") for s in old}
    return replace(
        _substituted(f, table),
        q=tuple(table[s] for s in f.q),
        v=tuple(table[s] for s in f.v),
        t=table[f.t],
        y=tuple(table[s] for s in f.y),
    )


def _with_inputs(f: Continuous, u: tuple[Any, ...]) -> Continuous:
    return replace(_substituted(f, dict(zip(f.u, u, strict=True))), u=u)


def _with_hidden(f: Continuous, place: int, make: Callable[[str], Any]) -> Continuous:
    """The functions with hidden unknowns of their own at one place."""
    own = tuple(make(f"s_{place * len(f.s) + j}") for j in range(len(f.s)))
    return replace(_substituted(f, dict(zip(f.s, own, strict=True))), s=own)


def _substituted(f: Continuous, table: dict[Any, Any]) -> Continuous:
    def each(values: Sequence[Any]) -> tuple[Any, ...]:
        return tuple(v.subs(table) if table else v for v in values)

    L, C, C_s = each((f.L, f.C, f.C_s))
    own = {name: each(getattr(f, name)) for name in ("Q", "r", "z", "c", "mu", "l", "phi", "tau")}
    return replace(f, L=L, C=C, C_s=C_s, **own)
