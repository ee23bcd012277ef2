"""The functions of a system in bare symbols: the common start of the derivation shown to people and
of the kernels.

The functions below use nothing but arithmetic and ``.diff``; they work on SymPy expressions, which
people read, and on nodes of a graph, which become kernels.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from dmoc.base.names import name_of, unit_constraint, velocity_name
from dmoc.motion.impact_laws import BALL, second_of
from dmoc.symbolic.contact_references import forces_of
from dmoc.symbolic.conversion import plain_nodes, to_nodes
from dmoc.symbolic.definitions import rate_of, rate_symbol, symbols_of
from dmoc.symbolic.drawing import values_of
from dmoc.symbolic.expressions import approach_speed, atoms_of, coefficients_of, sliding_speed
from dmoc.symbolic.graph import Graph, GraphNode, gradient
from dmoc.symbolic.kinks import split
from dmoc.symbolic.rest import has_roots, powers_at_rest, with_limits

if TYPE_CHECKING:
    from dmoc.symbolic.system import MechanicalSystem


@dataclass(frozen=True)
class Continuous:
    """A system in bare symbols: q, v = q', u, time t, parameters; L, Q, C, terminal cost Phi, gaps
    g_j, ``within`` >= 0 where surfaces with ends are, the surfaces ``ends`` of these, path
    constraints r_j, tangents tau_j, their friction mu_j and mu_s_j where they stick, constraints
    phi_j, looks: the values of the drawing; coefficients of restitution e_j, of all surfaces or
    none, and of tangential restitution e_t, of all tangents or none; quantities z, integrands c;
    symbols x of definitions with their rates x_dot and their values x_of, and the dissipation R of
    which Q lacks the forces. Nodes have neither. Kernels have derivatives by the parameters
    ``design``, too. Accelerations and forces y, where quantities contain forces. Crossing functions
    w, whose zeros are events. Where cost or integrands are split at kinks: hidden unknowns s, their
    limits l >= 0, and the terms C_s of the cost that contain them. Those of the constraints that
    are the ``spheres`` of quaternions."""

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
    e: tuple[Any, ...] = ()
    z: tuple[Any, ...] = ()
    e_t: tuple[Any, ...] = ()
    c: tuple[Any, ...] = ()
    R: Any = sp.S.Zero
    x: tuple[Any, ...] = ()
    x_dot: tuple[Any, ...] = ()
    x_of: tuple[Any, ...] = ()
    design: tuple[Any, ...] = ()
    y: tuple[Any, ...] = ()
    mu_s: tuple[Any, ...] = ()
    s: tuple[Any, ...] = ()
    l: tuple[Any, ...] = ()
    C_s: Any = sp.S.Zero
    w: tuple[Any, ...] = ()
    within: tuple[Any, ...] = ()
    ends: tuple[int, ...] = ()
    spheres: tuple[int, ...] = ()

    @classmethod
    def of(
        cls,
        system: MechanicalSystem,
        q: Sequence[Any],
        v: Sequence[Any],
        u: Sequence[Any],
        t: Any,
        par: Sequence[Any],
        x: Sequence[Any] = (),
        x_dot: Sequence[Any] = (),
        y: Sequence[Any] = (),
    ) -> Continuous:
        """Rewrite the functions of ``system`` in the given SymPy symbols; ``x`` and ``x_dot`` are
        those of its definitions and their rates, ``y`` accelerations and forces."""
        table = _table(system, q, v, u, t, par, x, x_dot)
        table |= dict(zip(forces_of(system), y[len(q) :], strict=False))
        forces, R = system.force_vector, sp.S.Zero
        # Nodes have derivatives where those of SymPy are 0/0 or complex.
        damping = system.dissipation
        if atoms_of(damping) & symbols_of(system.definitions) or has_roots(damping):
            forces = tuple(system.forces.get(s, sp.S.Zero) for s in system.coordinates)
            R = damping

        def rewrite(expression: Any) -> Any:
            # All at once, from the outside: a velocity contains its coordinate, that the time, and
            # a symbol of the model may look like a given one.
            return expression.xreplace(table)

        stated = friction_of(system)
        coefficients = [coefficients_of(stated.get(n, sp.S.Zero)) for n in system.tangents]
        static, kinetic = (tuple(rewrite(pair[i]) for pair in coefficients) for i in (0, 1))
        return cls(
            tuple(q),
            tuple(v),
            tuple(u),
            t,
            tuple(par),
            rewrite(system.lagrangian),
            tuple(rewrite(e) for e in forces),
            rewrite(system.cost),
            rewrite(system.terminal_cost),
            tuple(rewrite(e) for e in system.gaps.values()),
            tuple(rewrite(e) for e in system.path_functions.values()),
            tuple(rewrite(e) for e in system.tangents.values()),
            kinetic,
            tuple(rewrite(e) for e in system.constraints.values()),
            tuple(rewrite(e) for part in system.shapes for e in values_of(part)),
            tuple(rewrite(e) for e in coefficients_of_restitution(system)),
            tuple(rewrite(e) for e in system.quantities_along.values()),
            tuple(rewrite(e) for e in coefficients_of_tangential_restitution(system)),
            tuple(rewrite(e) for e in system.integrands.values()),
            rewrite(R),
            tuple(x),
            tuple(x_dot),
            tuple(rewrite(e) for e in system.definitions.values()),
            y=tuple(y),
            mu_s=static,
            w=tuple(rewrite(e) for e in system.switches.values()),
            within=tuple(rewrite(e) for functions in system.inside.values() for e in functions),
            spheres=tuple(
                j
                for j, name in enumerate(system.constraints)
                if name in map(unit_constraint, system.attitudes)
            ),
            ends=tuple(
                j
                for name, own in system.inside.items()
                for j in [list(system.surfaces).index(name)] * len(own)
            ),
        )

    def smooth(self, system: MechanicalSystem, hidden: Sequence[Any]) -> Continuous:
        """The same system with hidden unknowns, a smooth cost, smooth integrands and smooth path
        constraints."""
        parts = split(system)
        table = self._table(system)
        table |= dict(zip((own.symbol for own in parts.unknowns), hidden, strict=True))

        def each(expressions: Iterable[Any]) -> tuple[Any, ...]:
            return tuple(e.xreplace(table) for e in expressions)

        return replace(
            self,
            C=parts.cost.xreplace(table),
            c=each(parts.integrals.values()),
            r=each(r for _, r in parts.rows),
            s=tuple(hidden),
            l=each(limit for own in parts.unknowns for limit in own.limits),
            C_s=parts.lifted.xreplace(table),
        )

    def rewritten(self, system: MechanicalSystem, functions: Sequence[Any]) -> list[Any]:
        """More functions of the system in these symbols."""
        table = self._table(system)
        return [e.xreplace(table) for e in functions]

    def _table(self, system: MechanicalSystem) -> dict[Any, Any]:
        return _table(system, self.q, self.v, self.u, self.t, self.par, self.x, self.x_dot)

    def as_nodes(
        self,
        functions: Sequence[Any],
        graph: Graph,
        constants: Mapping[Any, GraphNode] | None = None,
    ) -> list[GraphNode]:
        """More functions in these symbols as nodes, and those of some constants, which are exact
        then."""
        speeds = approach_speed, sliding_speed
        symbols = (*self.q, *self.v, *self.u, self.t, *self.par, *speeds, *self.y, *self.s)
        table = {s: graph.symbol(s.name) for s in symbols} | dict(constants or {})
        rates = dict(zip((table[q] for q in self.q), (table[v] for v in self.v), strict=True))
        rates[table[self.t]] = graph.one
        for x, x_dot, value in zip(self.x, self.x_dot, self.x_of, strict=True):
            (table[x],) = plain_nodes(graph, [value], table)
            table[x_dot] = rate_of(table[x], rates)
        powers = dict[Any, Any]()
        for power in powers_at_rest(functions, (*self.v, *self.x_dot), self.u):
            (base,) = plain_nodes(graph, [power.base.xreplace(powers)], table)
            powers[power] = sp.Dummy()
            table[powers[power]] = with_limits(base, float(power.exp))
        return to_nodes(graph, [e.xreplace(powers) for e in functions], table)

    def to_nodes(self, graph: Graph) -> Continuous:
        """The same functions as nodes of a graph, whose symbols have the same names."""
        functions = [e for name in FUNCTIONS for e in as_tuple(getattr(self, name))]
        nodes = iter(self.as_nodes(functions, graph))

        def each(values: Any) -> Any:
            return tuple(next(nodes) for _ in values) if isinstance(values, tuple) else next(nodes)

        q, v, u, par, y, s = (
            tuple(graph.symbol(s.name) for s in part)
            for part in (self.q, self.v, self.u, self.par, self.y, self.s)
        )
        made = {name: each(getattr(self, name)) for name in FUNCTIONS}
        damping = gradient(made["R"], v)
        made["Q"] = tuple(force - slope for force, slope in zip(made["Q"], damping, strict=True))
        made["R"] = graph.zero
        t = graph.symbol(self.t.name)
        return Continuous(q, v, u, t, par, **made, y=y, s=s, ends=self.ends, spheres=self.spheres)


# The functions of a Continuous, which are one expression or several.
FUNCTIONS = (
    "L", "Q", "C", "Phi", "g", "r", "tau", "mu", "mu_s", "phi", "looks", "e", "z", "e_t", "c", "R",
    "l", "C_s", "w", "within",
)  # fmt: skip


def coefficients_of_restitution(system: MechanicalSystem) -> tuple[Any, ...]:
    """Coefficients of all surfaces, zero where none is stated; empty where the system states
    none."""
    stated = system.restitution
    return tuple(stated.get(name, sp.S.Zero) for name in system.gaps) if stated else ()


def friction_of(system: MechanicalSystem) -> dict[str, Any]:
    """Friction of all tangents that have some: of a tangent with two directions in both."""
    stated = dict(system.friction)
    for name, law in system.impact_laws.items():
        if law == BALL and name in stated:
            stated[second_of(name)] = stated[name]
    return stated


def coefficients_of_tangential_restitution(system: MechanicalSystem) -> tuple[Any, ...]:
    """Coefficients of all tangents, -1 where none is stated; empty where the system states
    none.  A contact with two directions has that of the first, 0 where none is stated."""
    stated = dict(system.tangential_restitution)
    for name, law in system.impact_laws.items():
        if law == BALL:
            stated.setdefault(name, sp.S.Zero)
    return tuple(stated.get(n, sp.S.NegativeOne) for n in system.tangents) if stated else ()


def as_tuple(value: Any) -> tuple[Any, ...]:
    return value if isinstance(value, tuple) else (value,)


def _table(
    system: MechanicalSystem, q: Sequence[Any], v: Sequence[Any], u: Sequence[Any], t: Any,
    par: Sequence[Any], x: Sequence[Any], x_dot: Sequence[Any],
) -> dict[Any, Any]:  # fmt: skip
    """The symbols of a system and others in their place."""
    table = dict(zip(system.velocities, v, strict=True))
    table |= dict(zip(map(rate_symbol, system.definitions), x_dot, strict=True))
    table |= dict(zip(system.definitions, x, strict=True))
    table |= dict(zip(system.coordinates, q, strict=True))
    table |= dict(zip(system.inputs, u, strict=True))
    table |= dict(zip(system.parameters, par, strict=True))
    table[dynamicsymbols._t] = t
    return table


def readable(system: MechanicalSystem) -> Continuous:
    """Return the functions of ``system`` in symbols that carry the user's names."""
    names = [name_of(q) for q in system.coordinates]
    defined = [name_of(x) for x in system.definitions]
    return Continuous.of(
        system,
        sp.symbols(names, real=True),
        sp.symbols([velocity_name(n) for n in names], real=True),
        sp.symbols([name_of(u) for u in system.inputs], real=True),
        sp.Symbol("t", real=True),
        list(system.parameters),
        sp.symbols(defined, real=True),
        sp.symbols([velocity_name(n) for n in defined], real=True),
        sp.symbols([*(f"a_{n}" for n in names), *forces_of(system).values()], real=True),
    )


def jacobian(expressions: Sequence[Any], symbols: Sequence[Any]) -> list[list[Any]]:
    return [gradient(e, symbols) for e in expressions]


def dot(a: Sequence[Any], b: Sequence[Any]) -> Any:
    return sum_of(x * y for x, y in zip(a, b, strict=True))


def sum_of(terms: Iterable[Any]) -> Any:
    """The sum of nodes, or of expressions of SymPy."""
    terms = list(terms)
    if terms and isinstance(terms[0], GraphNode):
        return terms[0].graph.sum((term, 1.0) for term in terms)
    return sp.Add(*terms) if all(isinstance(term, sp.Basic) for term in terms) else sum(terms)


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


def keeps_rate(f: Continuous, constraint: Any) -> bool:
    """Whether a constraint is of velocities, c(q, v, t) = 0, and not of a place, phi(q, t) = 0."""
    return bool(constraint.free_symbols & {*f.v, *f.x_dot})


def own_rates(f: Continuous, functions: Sequence[Any]) -> list[Any]:
    """Derivatives of functions of (q, t) along the motion; of rates, these themselves."""
    return [e if keeps_rate(f, e) else rates(f, [e])[0] for e in functions]


def constraint_rates(f: Continuous) -> list[Any]:
    """Rates that all constraints keep at zero along the motion: dphi/dt of those of places, or
    c."""
    return own_rates(f, f.phi)


def impact_work(f: Continuous, lam: Sequence[Any]) -> tuple[Any, Any]:
    """W_t = lam . dg/dt and W_gamma = lam . gamma with the rates gamma of the gaps after the
    collision.

    The law of restitution is e (E+ - E- - W_t) = (1 - e)/2 W_gamma.  In the continuous theory
    E+ - E- = lam (dg/dt - (gamma- + gamma)/2), so that the difference of both sides is
    -lam (gamma + e gamma-)/2: Newton's law as the mean of the balance of energy (e = 1) and of the
    plastic impact (e = 0), with a simple root for every e.
    """
    return dot(lam, [g.diff(f.t) for g in f.g]), dot(lam, gap_rates(f))


def input_matrix(f: Continuous) -> list[list[Any]]:
    """B = dQ/du, shape (nq, nu)."""
    return jacobian(f.Q, f.u)
