"""The functions of a system in bare symbols: the common start of the derivation shown to people and
of the kernels.

The functions below use nothing but arithmetic and ``.diff``; they work on SymPy expressions, which
people read, and on SymEngine expressions, which become kernels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import symengine as se
import sympy as sp
from sympy.functions.elementary.piecewise import ExprCondPair
from sympy.logic.boolalg import Boolean
from sympy.physics.mechanics import dynamicsymbols

from dmoc.base.errors import GenerationError
from dmoc.base.names import name_of, velocity_name
from dmoc.symbolic.drawing import values_of
from dmoc.symbolic.kinks import split
from dmoc.symbolic.spec import FUNCTIONS
from dmoc.symbolic.system import MechanicalSystem


@dataclass(frozen=True)
class Continuous:
    """A system in bare symbols: q, v = q', u, time t, parameters; L, Q, C, terminal cost Phi,
    gaps g_j, path constraints r_j, tangents tau_j and their friction mu_j, constraints phi_j,
    looks: the values of the drawing."""

    q: tuple[Any, ...]
    v: tuple[Any, ...]
    u: tuple[Any, ...]
    t: Any
    par: tuple[Any, ...]
    L: Any
    Q: tuple[Any, ...]
    C: Any
    Phi: Any
    g: tuple[Any, ...]
    r: tuple[Any, ...]
    tau: tuple[Any, ...]
    mu: tuple[Any, ...]
    phi: tuple[Any, ...]
    looks: tuple[Any, ...]

    @classmethod
    def of(
        cls,
        system: MechanicalSystem,
        q: Sequence[Any],
        v: Sequence[Any],
        u: Sequence[Any],
        t: Any,
        par: Sequence[Any],
    ) -> Continuous:
        """Rewrite the functions of ``system`` in the given SymPy symbols."""
        table = _table(system, q, v, u, t, par)

        def rewrite(expression: Any) -> Any:
            # All at once, from the outside: a velocity contains its coordinate, that the time, and
            # a symbol of the model may look like a given one.
            return expression.xreplace(table)

        return cls(
            tuple(q),
            tuple(v),
            tuple(u),
            t,
            tuple(par),
            rewrite(system.lagrangian),
            tuple(rewrite(e) for e in system.force_vector),
            rewrite(system.cost),
            rewrite(system.terminal_cost),
            tuple(rewrite(e) for e in system.gaps.values()),
            tuple(rewrite(e) for e in system.path_functions.values()),
            tuple(rewrite(e) for e in system.tangents.values()),
            tuple(rewrite(system.friction[name]) for name in system.tangents),
            tuple(rewrite(e) for e in system.constraints.values()),
            tuple(rewrite(e) for part in system.shapes for e in values_of(part)),
        )

    def smooth(self, system: MechanicalSystem, hidden: Sequence[Any]) -> Continuous:
        """The same system with hidden unknowns behind its inputs, and a smooth cost and smooth path
        constraints."""
        parts = split(system)
        table = _table(system, self.q, self.v, self.u, self.t, self.par)
        table |= dict(zip((s for s, _ in parts.unknowns), hidden, strict=True))
        return replace(
            self,
            u=(*self.u, *hidden),
            C=parts.cost.xreplace(table),
            r=tuple(r.xreplace(table) for _, r in parts.rows),
        )

    def with_rows(self, system: MechanicalSystem, functions: Sequence[Any]) -> Continuous:
        """The same system with other functions as path constraints."""
        table = _table(system, self.q, self.v, self.u, self.t, self.par)
        return replace(self, r=tuple(e.xreplace(table) for e in functions))

    def to_symengine(self) -> Continuous:
        """Return the same functions as SymEngine expressions."""

        def convert(expression: Any) -> Any:
            return se.sympify(_elementary(expression))

        def each(values: Sequence[Any]) -> tuple[Any, ...]:
            return tuple(convert(value) for value in values)

        return Continuous(
            each(self.q),
            each(self.v),
            each(self.u),
            convert(self.t),
            each(self.par),
            convert(self.L),
            each(self.Q),
            convert(self.C),
            convert(self.Phi),
            each(self.g),
            each(self.r),
            each(self.tau),
            each(self.mu),
            each(self.phi),
            each(self.looks),
        )


def _table(
    system: MechanicalSystem, q: Sequence[Any], v: Sequence[Any], u: Sequence[Any], t: Any,
    par: Sequence[Any],
) -> dict[Any, Any]:  # fmt: skip
    """The symbols of a system and others in their place."""
    table = dict(zip(system.velocities, v, strict=True))
    table |= dict(zip(system.coordinates, q, strict=True))
    table |= dict(zip(system.inputs, u, strict=True))
    table |= dict(zip(system.parameters, par, strict=True))
    table[dynamicsymbols._t] = t
    return table


def readable(system: MechanicalSystem) -> Continuous:
    """Return the functions of ``system`` in symbols that carry the user's names."""
    names = [name_of(q) for q in system.coordinates]
    return Continuous.of(
        system,
        sp.symbols(names, real=True),
        sp.symbols([velocity_name(n) for n in names], real=True),
        sp.symbols([name_of(u) for u in system.inputs], real=True),
        sp.Symbol("t", real=True),
        list(system.parameters),
    )


def _elementary(expression: Any) -> Any:
    """Write functions with a kink as Piecewise, which can be differentiated, and refuse what no
    printer knows."""
    kinks = (sp.Abs, sp.sign, sp.Max, sp.Min, sp.Heaviside)
    if expression.has(*kinks):
        expression = sp.piecewise_fold(
            expression.replace(lambda e: isinstance(e, kinks), lambda e: e.rewrite(sp.Piecewise))
        )
    for node in sp.preorder_traversal(expression):
        if not _is_printable(node):
            raise GenerationError(
                f"{sp.sstr(node)} cannot be turned into C: use +, -, *, /, powers, Abs, sign, Min, "
                "Max, Piecewise and "
                f"{', '.join(sorted(FUNCTIONS))}, exp, sqrt."
            )
    return expression


def _is_printable(node: Any) -> bool:
    if isinstance(
        node,
        (sp.Add, sp.Mul, sp.Pow, sp.Symbol, sp.exp, sp.Piecewise, Boolean, sp.Rational, sp.Float),
    ):
        return not isinstance(node, (sp.Not, sp.Xor, sp.ITE))
    if isinstance(node, ExprCondPair) or node in (sp.pi, sp.E):
        return True
    return isinstance(node, sp.Function) and type(node).__name__ in FUNCTIONS


def gradient(expression: Any, symbols: Sequence[Any]) -> list[Any]:
    return [expression.diff(s) for s in symbols]


def jacobian(expressions: Sequence[Any], symbols: Sequence[Any]) -> list[list[Any]]:
    return [gradient(e, symbols) for e in expressions]


def dot(a: Sequence[Any], b: Sequence[Any]) -> Any:
    return sum((x * y for x, y in zip(a, b, strict=True)), start=0 * (a[0] if a else 0))


def momenta(f: Continuous) -> list[Any]:
    """p = dL/dv."""
    return gradient(f.L, f.v)


def mass_matrix(f: Continuous) -> list[list[Any]]:
    """M(q) = d2L/dv2."""
    return jacobian(momenta(f), f.v)


def energy(f: Continuous) -> Any:
    """E = v . dL/dv - L."""
    return dot(f.v, momenta(f)) - f.L


def right_hand_side(f: Continuous) -> list[Any]:
    """F in M q'' = F: dL/dq - (d2L/dv dq) v - d2L/dv dt + Q(q, v, u, t)."""
    return [
        lq - dot(gradient(pi, f.q), f.v) - pi.diff(f.t) + qi
        for lq, pi, qi in zip(gradient(f.L, f.q), momenta(f), f.Q, strict=True)
    ]  # fmt: skip


def gap_rates(f: Continuous) -> list[Any]:
    """dg/dt along the motion: grad g . v + the partial derivative with respect to t."""
    return rates(f, f.g)


def rates(f: Continuous, places: Sequence[Any]) -> list[Any]:
    """Derivatives of functions of (q, t) along the motion."""
    return [dot(gradient(g, f.q), f.v) + g.diff(f.t) for g in places]


def impact_work(f: Continuous, lam: Sequence[Any]) -> tuple[Any, Any]:
    """W_t = lam . dg/dt and W_gamma = lam . gamma with the rates gamma of the gaps after the
    collision.

    The law of restitution is e (E+ - E- - W_t) = (1 - e)/2 W_gamma.  In the continuous theory
    E+ - E- = lam (dg/dt - (gamma- + gamma)/2), so that the difference of both sides is
    -lam (gamma + e gamma-)/2: Newton's law as the mean of the balance of energy (e = 1) and of the
    plastic impact (e = 0), with a simple root for every e.
    """
    moving = [s * g.diff(f.t) for s, g in zip(lam, f.g, strict=True)]
    rates = [s * w for s, w in zip(lam, gap_rates(f), strict=True)]
    return sum(moving[1:], start=moving[0]), sum(rates[1:], start=rates[0])


def input_matrix(f: Continuous) -> list[list[Any]]:
    """B = dQ/du, shape (nq, nu)."""
    return jacobian(f.Q, f.u)
