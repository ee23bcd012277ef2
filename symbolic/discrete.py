"""The step element of the midpoint rule: discrete Lagrangian, forces, momenta, energies and cost of one step.

With qm = (q_k + q_kp1)/2, v = (q_kp1 - q_k)/h and the inputs u_k at the start and u_kp1 at the end of the step::

    L_d = h L(qm, v)      fd_minus = h/2 Q(qm, v, u_k)      fd_plus = h/2 Q(qm, v, u_kp1)
    r_minus = D1 L_d + fd_minus   (= -p at the step's start)
    r_plus  = D2 L_d + fd_plus    (=  p at the step's end)
    e_plus  = D3 L_d - fd_plus . v      e_minus = D3 L_d + fd_minus . v
    C_d = h/2 (C(qm, v, u_k) + C(qm, v, u_kp1))

An input that is constant in a step has u_k = u_kp1; then C_d = h C(qm, v, u_k).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from dmoc.symbolic.continuous import Continuous, dot


@dataclass(frozen=True)
class StepElement:
    """The element in the symbols of its midpoint, ``f.q`` = qm and ``f.v`` = v, which the total derivative :meth:`D` resolves.

    ``f.u`` must be ``u_k``; ``rational`` makes exact constants of the expression type in use.
    """

    f: Continuous
    q_k: tuple[Any, ...]
    q_kp1: tuple[Any, ...]
    u_kp1: tuple[Any, ...]
    h: Any
    half: Any

    @property
    def z(self) -> tuple[Any, ...]:
        """Local unknowns (q_k, q_kp1, u_k, u_kp1, h), in this order everywhere."""
        return (*self.q_k, *self.q_kp1, *self.f.u, *self.u_kp1, self.h)

    @property
    def definitions(self) -> tuple[tuple[Any, Any], ...]:
        """The midpoint in terms of z."""
        pairs = list(zip(self.q_k, self.q_kp1, strict=True))
        qm = [(s, self.half * (a + b)) for s, (a, b) in zip(self.f.q, pairs, strict=True)]
        v = [(s, (b - a) / self.h) for s, (a, b) in zip(self.f.v, pairs, strict=True)]
        return (*qm, *v)

    def D(self, expression: Any, i: int) -> Any:
        """Total derivative of an expression in (qm, v, u_k, u_kp1, h) with respect to ``z[i]``."""
        n = len(self.q_k)
        if i < 2 * n:
            j = i % n
            sign = -1 if i < n else 1
            return self.half * expression.diff(self.f.q[j]) + sign * expression.diff(self.f.v[j]) / self.h
        explicit = expression.diff(self.z[i])
        if i < len(self.z) - 1:
            return explicit
        return explicit - sum((v / self.h * expression.diff(v) for v in self.f.v), start=0 * self.h)

    def gradient(self, expression: Any) -> list[Any]:
        return [self.D(expression, i) for i in range(len(self.z))]

    def jacobian(self, expressions: Sequence[Any]) -> list[list[Any]]:
        return [self.gradient(e) for e in expressions]

    def hessian(self, expression: Any) -> list[list[Any]]:
        """Upper triangle of the second total derivative; the strict lower triangle is zero."""
        size = len(self.z)
        first = self.gradient(expression)
        return [[self.D(first[i], j) if j >= i else 0 for j in range(size)] for i in range(size)]

    def _at_end(self, expression: Any) -> Any:
        """Exchange u_k for u_kp1."""
        for a, b in zip(self.f.u, self.u_kp1, strict=True):
            expression = expression.subs({a: b})
        return expression

    @cached_property
    def L_d(self) -> Any:
        return self.h * self.f.L

    @cached_property
    def fd_minus(self) -> list[Any]:
        return [self.half * self.h * Q for Q in self.f.Q]

    @cached_property
    def fd_plus(self) -> list[Any]:
        return [self._at_end(f) for f in self.fd_minus]

    @cached_property
    def r_minus(self) -> list[Any]:
        return [self.D(self.L_d, i) + f for i, f in enumerate(self.fd_minus)]

    @cached_property
    def r_plus(self) -> list[Any]:
        n = len(self.q_k)
        return [self.D(self.L_d, n + i) + f for i, f in enumerate(self.fd_plus)]

    @cached_property
    def e_plus(self) -> Any:
        return self.D(self.L_d, len(self.z) - 1) - dot(self.fd_plus, self.f.v)

    @cached_property
    def e_minus(self) -> Any:
        return self.D(self.L_d, len(self.z) - 1) + dot(self.fd_minus, self.f.v)

    @cached_property
    def C_d(self) -> Any:
        return self.half * self.h * (self.f.C + self._at_end(self.f.C))


def step_element(f: Continuous, make: Any, half: Any) -> StepElement:
    """Build the element of ``f``; ``make(name)`` makes a symbol of the expression type in use."""
    n, m = len(f.q), len(f.u)

    def vector(name: str, size: int) -> tuple[Any, ...]:
        return tuple(make(f"{name}_{i}") for i in range(size))

    at_start = vector("u_k", m)
    swap = dict(zip(f.u, at_start, strict=True))

    def started(e: Any) -> Any:
        return e.subs(swap) if swap else e

    element = replace(
        f, u=at_start, Q=tuple(map(started, f.Q)), C=started(f.C), r=tuple(map(started, f.r))
    )  # fmt: skip
    return StepElement(element, vector("q_k", n), vector("q_kp1", n), vector("u_kp1", m), make("h"), half)
