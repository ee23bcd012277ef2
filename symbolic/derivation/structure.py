"""The derivation of a large system: what it is made of has names, and nothing is written out.

Momenta, masses and forces come from the graph that kernels are made of; what follows from them is
written in functions of which only the names and the names of their derivatives are known.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import sympy as sp

from dmoc.symbolic.continuous import Continuous, dot, input_matrix
from dmoc.symbolic.derivation.continuous_sections import held_sections
from dmoc.symbolic.derivation.document import (
    LEFT,
    Equation,
    Section,
    definition,
    definitions,
    upright,
)
from dmoc.symbolic.derivation.named_nodes import NamedNodes
from dmoc.symbolic.derivation.symbols import DisplayNames, latex_symbol
from dmoc.symbolic.discrete import StepElement, step_element
from dmoc.symbolic.graph import Graph, GraphNode, reverse
from dmoc.symbolic.system import MechanicalSystem
from dmoc.symbolic.traversal import operations

MARKED = (
    "Names of the sections above, with the same index, are their values there: of L, p, f and of "
    "definitions."
)
LARGE = 300  # operations of the second derivatives of a Lagrangian that is not written out


def is_large(f: Continuous) -> bool:
    """Whether a system is shown by its structure."""
    if f.x:
        return True
    nodes = f.to_nodes(Graph())
    states = (*nodes.q, *nodes.v)
    slopes = reverse(nodes.L, states)
    second = [s.diff(z) for i, s in enumerate(slopes) for z in states[i:]]
    return operations(second) >= LARGE


class Named(sp.Function):  # type: ignore[misc]
    """A function of which only names are known: its own, and those of its slopes."""

    name: str
    slopes: tuple[str, ...]  # by argument, empty where it does not depend on it
    bases: tuple[str, ...]  # names of the arguments without the marks of a point
    own: DisplayNames

    def fdiff(self, argindex: int = 1) -> Any:
        slope = self.slopes[argindex - 1]
        return self.own.symbol(slope + self.mark, "slope") if slope else sp.S.Zero

    @property
    def mark(self) -> str:
        """What its arguments have behind their names."""
        return str(self.args[0])[len(self.bases[0]) :]

    @property
    def symbol(self) -> Any:
        return self.own.symbol(self.name + self.mark, "value" if self.mark else LEFT)


@dataclass(frozen=True)
class NamedStructure:
    """A system with its functions on a graph, and the names that are given."""

    system: MechanicalSystem
    f: Continuous
    nodes: Continuous
    own: DisplayNames
    names: NamedNodes
    stated: GraphNode  # L in the nodes that have names
    damping: list[GraphNode]  # slopes by the velocities of a dissipation that contains definitions
    defined: list[tuple[Any, Any]]

    @classmethod
    def of(cls, system: MechanicalSystem, f: Continuous, own: DisplayNames) -> NamedStructure:
        graph, defined = Graph(), _defined(f)
        symbols = (*f.q, *f.v, *f.u, f.t, *f.par, *(x for x, _ in defined))
        *named, L, R = f.as_nodes([*symbols, f.L, f.R], graph)
        names = NamedNodes(own, zip(named, symbols, strict=True))
        nodes = f.to_nodes(graph)
        damping = reverse(R, nodes.v) if f.R != 0 else []
        return cls(system, f, nodes, own, names, L, damping, defined)

    def written(
        self, results: Sequence[GraphNode], equations: Callable[[list[Any]], Iterable[Equation]]
    ) -> tuple[Equation, ...]:
        """Equations of results, behind those of the names that they need."""
        new, values = self.names.write(results)
        return (*new, *equations(values))

    def opaque(self, f: Continuous) -> Continuous:
        """The system with a Lagrangian and gaps of which only names are known, in the symbols of
        ``f``; they are made first in its own."""
        n = [str(q) for q in self.f.q]
        L, g = self.nodes.L, self.nodes.g
        slopes = [*(f"f_{q}" for q in n), *(f"p_{q}" for q in n), "L_t"]
        by = [*reverse(L, (*self.nodes.q, *self.nodes.v)), L.diff(self.nodes.t)]
        arguments = (*self.f.q, *self.f.v, self.f.t)
        lagrangian = self._named("L", arguments, slopes, by)
        places = (*self.f.q, self.f.t)
        gaps = [
            self._named(f"g_{name}", places, [f"n_{name}_{q}" for q in (*n, "t")], by)
            for name, by in (
                (name, [node.diff(s) for s in (*self.nodes.q, self.nodes.t)])
                for name, node in zip(self.system.gaps, g, strict=True)
            )
        ]
        at = dict(zip(arguments, (*f.q, *f.v, f.t), strict=True))
        Q = f.Q
        if self.damping:
            names = [f"R_{q}" for q in n]
            Q = tuple(
                force - self._named(name, arguments, [""] * len(arguments), ()).xreplace(at)
                for force, name in zip(Q, names, strict=True)
            )
        L_at, *g_at = (e.xreplace(at) for e in (lagrangian, *gaps))
        return replace(f, L=L_at, g=tuple(g_at), Q=Q)

    def _named(
        self, name: str, arguments: Sequence[Any], slopes: Sequence[str], by: Sequence[GraphNode]
    ) -> Any:
        kept = [s if d is not d.graph.zero else "" for s, d in zip(slopes, by, strict=False)]
        kept = kept or [""] * len(arguments)
        facts = {"name": name, "slopes": tuple(kept), "bases": tuple(map(str, arguments))}
        return type(f"Named_{name}", (Named,), {**facts, "own": self.own})(*arguments)


def with_names(sections: Iterable[Section]) -> Iterator[Section]:
    """Sections with the names of functions in the place of their values."""
    for i, section in enumerate(sections):
        equations = tuple(replace(e, right=_shown(sp.sympify(e.right))) for e in section.equations)
        text = section.text if i else f"{section.text} {MARKED}"
        yield replace(section, text=text, equations=equations)


def _shown(right: Any) -> Any:
    return right.xreplace({e: e.symbol for e in right.atoms(Named)})


def structure_sections(s: NamedStructure) -> Iterator[Section]:
    """Sections of what is continuous."""
    f, nodes, own = s.f, s.nodes, s.own
    names = [str(q) for q in f.q]
    tex = [latex_symbol(n) for n in names]
    if f.x:
        yield Section(
            "Definitions",
            "Names for places and velocities, and the velocities of places.",
            tuple(Equation(x.name, latex_symbol(x.name), e) for x, e in s.defined),
        )
    yield Section(
        "Lagrangian",
        f"L(q, q'{', t' if s.nodes.t in s.nodes.L.free_symbols else ''}) with the coordinates q = "
        f"({', '.join(names)}). z_1, z_2, ... are what several expressions share.",
        (definition(own, "L", "L", f.L),)
        if f.x
        else s.written([s.stated], lambda values: [definition(own, "L", "L", values[0])]),
    )
    p = reverse(nodes.L, nodes.v)
    yield Section(
        "Momenta",
        "p = dL/dq'.",
        s.written(p, lambda values: definitions(own, "p", names, tex, values)),
    )
    places = [(i, j) for i in range(len(names)) for j in range(i, len(names))]
    mass = [(i, j, p[i].diff(nodes.v[j])) for i, j in places]
    mass = [entry for entry in mass if entry[2] is not entry[2].graph.zero]
    yield Section(
        "Mass matrix",
        "M = d2L/dq'2, the entries of its upper triangle that are not zero.",
        s.written(
            [m for *_, m in mass],
            lambda values: (
                definition(own, f"M_{names[i]}_{names[j]}", f"M_{{{tex[i]},{tex[j]}}}", value)
                for (i, j, _), value in zip(mass, values, strict=True)
            ),
        ),
    )
    momenta = [own.symbol(f"p_{n}", LEFT) for n in names]
    energy = dot(momenta, f.v) - own.symbol("L", LEFT)
    yield Section("Energy", "E = p . q' - L.", (definition(own, "E", "E", energy),))
    yield _force_section(s, names, tex)
    slopes = reverse(nodes.L, nodes.q)
    yield Section(
        "Equations of motion",
        "dp/dt = f + Q with f = dL/dq.",
        s.written(slopes, lambda values: definitions(own, "f", names, tex, values)),
    )
    yield from _surface_section(s)
    yield from held_sections(s.system, f, own)


def _defined(f: Continuous) -> list[tuple[Any, Any]]:
    """Definitions, and the rates of those of which expressions contain the rates."""
    rates = dict(zip((*f.q, *f.x, f.t), (*f.v, *f.x_dot, sp.S.One), strict=True))
    used: set[Any] = set().union(
        *(e.free_symbols for e in (f.L, *f.Q, f.C, *f.r, f.Phi, f.R, *f.x_of))
    )
    made: list[tuple[Any, Any]] = []
    for x, value in reversed(list(zip(f.x, f.x_of, strict=True))):
        if rates[x] in used:
            moving = sorted(value.free_symbols & set(rates), key=str)
            rate = sum(value.diff(a) * rates[a] for a in moving)
            made.append((rates[x], sp.sympify(rate)))
            used |= made[-1][1].free_symbols
        made.append((x, value))
    return made[::-1]


def _force_section(s: NamedStructure, names: Sequence[str], tex: Sequence[str]) -> Section:
    f, own = s.f, s.own
    forces: list[Equation] = []
    Q = f.Q
    if s.damping:
        forces.append(definition(own, "R", "R", f.R))
        forces += s.written(s.damping, lambda values: definitions(own, "R", names, tex, values))
        Q = tuple(e - own.symbol(f"R_{n}", LEFT) for n, e in zip(names, Q, strict=True))
    work = dot(Q, [own.symbol(f"delta_{n}", "variation") for n in names])
    forces += [Equation("delta W", r"\delta W", work), *definitions(own, "Q", names, tex, Q)]
    if f.u:
        forces.append(Equation("dQ/du", r"\partial Q / \partial u", sp.Matrix(input_matrix(f))))
    return Section("Virtual work and generalised forces", "delta W = Q . delta q.", tuple(forces))


def _surface_section(s: NamedStructure) -> Iterator[Section]:
    """Gaps, and the entries of their gradients that are not zero."""
    if not s.f.g:
        return
    equations: list[Equation] = []
    for name, g, node in zip(s.system.gaps, s.f.g, s.nodes.g, strict=True):
        equations.append(definition(s.own, f"g_{name}", f"g_{upright(name)}", g))
        slopes = ((str(q), node.diff(q)) for q in (*s.nodes.q, s.nodes.t))
        by = {q: slope for q, slope in slopes if slope is not slope.graph.zero}
        new, values = s.names.write(list(by.values()))
        equations += new
        for q, value in zip(by, values, strict=True):
            tag = f"n_{{{upright(name)},{latex_symbol(q)}}}"
            equations.append(definition(s.own, f"n_{name}_{q}", tag, value, "slope"))
    yield Section(
        "Unilateral constraints",
        "g <= 0; the gradient n = dg/dq points out of the admissible set.",
        tuple(equations),
    )


def pattern_sections(s: NamedStructure, order: int, shown: StepElement) -> Iterator[Section]:
    """Sections on the derivatives of a step that are not identically zero."""
    g = s.nodes.L.graph
    e = step_element(s.nodes, order, g.symbol, float)
    step = {"r_minus": e.r_minus, "r_plus": e.r_plus, "r_i": e.r_i}
    energies, cost = {"e_plus": [e.e_plus], "e_minus": [e.e_minus]}, {"C_d": [e.C_d]}
    lines = []
    for name, rows in (step | energies | cost).items():
        for i, row in enumerate(rows):
            label = f"{name}_{i}" if name in step else name
            lines.append(f"  {label:>10}  {_marks(e, row)}")
    columns = f"Columns x_k = ({', '.join(map(str, shown.x_k))})"
    text = (
        f"{columns}; x marks what is not identically zero. The entries are written out on demand."
    )
    yield Section("First derivatives", text, (), tuple(lines))
    for title, results in (("step", step | cost), ("energy", energies)):
        entries = [r for rows in results.values() for r in rows]
        weighted = g.sum((g.symbol(f"w_{i}") * r, 1.0) for i, r in enumerate(entries))
        slopes = e.chain(partial(reverse, weighted))
        text = f"Upper triangle for the weighted sum of all rows of `{title}`."
        marks = tuple(f"  {_marks(e, slope, first=i)}" for i, slope in enumerate(slopes))
        yield Section(f"Second derivatives ({title})", text, (), marks)


def _marks(e: StepElement, expression: GraphNode, first: int = 0) -> str:
    """An x for each component of x_k that an expression depends on, from the first one."""
    zero = expression.graph.zero
    by = e.chain(lambda symbols: [s if s.symbols & expression.symbols else zero for s in symbols])
    return " ".join("." if d is zero or i < first else "x" for i, d in enumerate(by))
