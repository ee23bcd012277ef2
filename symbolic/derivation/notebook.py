"""A system and a derivation as notebooks and pages show them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from html import escape
from typing import TYPE_CHECKING, Any

import sympy as sp

from dmoc.base.names import name_of
from dmoc.base.table import Table, html_of
from dmoc.symbolic.continuous import Continuous, keeps_rate, readable
from dmoc.symbolic.derivation import mathml
from dmoc.symbolic.derivation.symbols import latex_symbol

if TYPE_CHECKING:
    from dmoc.symbolic.derivation.document import Derivation, Equation, Section
    from dmoc.symbolic.system import MechanicalSystem

_SLOT = re.compile(r"D([123])_Ld(?:_(.+))?")
_SLOPE = re.compile(r"d([\w~]+)/d([\w~]+)")
_NORMAL = re.compile(r"(grad )?(g_\w+)")
_WIDE = "overflow-x:auto;overflow-y:hidden;padding:.35em 0"


def system_table(system: MechanicalSystem) -> Table:
    """A system in plain text: names, parameters, and its functions as SymPy writes them."""
    f = readable(system)
    named = [(name, sp.sstr(value)) for name, _, value in _functions(system, f)]
    facts = [(name, text) for name, text in _facts(system) if text]
    return Table((*facts, *named), title=f"model {system.name}")


def system_html(system: MechanicalSystem) -> str:
    """A system as a table of its names and as formulas."""
    facts = tuple((name, text) for name, text in _facts(system) if text)
    formulas = "".join(
        f'<div style="{_WIDE}">{mathml.equation(left, right)}</div>'
        for _, left, right in _functions(system, readable(system))
    )
    return html_of(Table(facts, title=f"model {system.name}")) + formulas


def system_latex(system: MechanicalSystem) -> str:
    """The functions of a system as aligned formulas."""
    f = readable(system)
    own = (*f.q, *f.v, *f.u, *f.par, f.t, *f.x, *f.x_dot)
    names = {s: latex_symbol(s.name) for s in own}
    left = {x.name: latex_symbol(x.name) for x in f.x}
    lines = [
        f"{left.get(name) or _latex_left(name)} &= {sp.latex(value, symbol_names=names)}"
        for name, _, value in _functions(system, f)
    ]
    return "$\\displaystyle\\begin{aligned}" + r" \\ ".join(lines) + "\\end{aligned}$"


def _latex_left(name: str) -> str:
    head, _, tail = name.partition("_")
    head = {"tau": r"\tau", "mu": r"\mu", "Phi": r"\Phi"}.get(head, head)
    below = tail.replace("_", r"\_")
    return f"{head}_{{\\mathrm{{{below}}}}}" if tail else head


def _facts(system: MechanicalSystem) -> Iterator[tuple[str, str]]:
    yield "title", system.title
    for what, symbols in (("coordinates", system.coordinates), ("inputs", system.inputs)):
        names = map(name_of, symbols)
        units = system.units
        yield what, ", ".join(f"{n} [{units[n]}]" if n in units else n for n in names) or "none"
    yield (
        "parameters",
        ", ".join(
            f"{name_of(s)} = {'to be given' if value is None else format(value, 'g')}"
            for s, value in system.parameters.items()
        ),
    )
    yield "surfaces", ", ".join(system.surfaces)
    if system.grips:
        yield "grips", ", ".join(system.grips)
    if system.constraints:
        yield "constraints", ", ".join(system.constraints)
    if system.switches:
        yield "switches", ", ".join(system.switches)
    if system.quantities:
        yield "quantities", ", ".join(system.quantities)


def _functions(system: MechanicalSystem, f: Continuous) -> Iterator[tuple[str, str, Any]]:
    """Functions of a system: their names in text and in MathML, and their expressions."""
    names = [name_of(q) for q in system.coordinates]
    for x, value in zip(f.x, f.x_of, strict=True):
        yield x.name, mathml.symbol(x.name), value
    yield "L", mathml.symbol("L"), f.L
    if f.R != 0:
        yield "R", mathml.symbol("R"), f.R
    for name, force in zip(names, f.Q, strict=True):
        if force != 0:
            yield f"Q_{name}", mathml.symbol(f"Q_{name}"), force
    of_rates = {n for n, c in zip(system.constraints, f.phi, strict=True) if keeps_rate(f, c)}
    slides = {n for n, tau in zip(system.tangents, f.tau, strict=True) if keeps_rate(f, tau)}
    laws = {
        "mu": system.friction, "e": system.restitution, "e_t": system.tangential_restitution,
        "mu_s": [n for n, mu in system.friction.items() if isinstance(mu, sp.Tuple)],
        "phi": {*system.constraints} - of_rates, "c": of_rates,
        "tau": {*system.tangents} - slides, "sigma": slides,
    }  # fmt: skip
    for letter, owners, values in (
        ("g", system.gaps, f.g),
        ("tau", system.tangents, f.tau),
        ("sigma", system.tangents, f.tau),
        ("mu", system.tangents, f.mu),
        ("mu_s", system.tangents, f.mu_s),
        ("e", system.gaps if f.e else (), f.e),
        ("e_t", system.tangents if f.e_t else (), f.e_t),
        ("phi", system.constraints, f.phi),
        ("c", system.constraints, f.phi),
        ("r", system.path_constraints, f.r),
        ("z", system.quantities_along, f.z),
        ("I", system.integrals, f.c),
        ("w", system.switches, f.w),
    ):
        for name, value in zip(owners, values, strict=True):
            if name in laws.get(letter, owners):
                yield f"{letter}_{name}", mathml.symbol(f"{letter}_{name}"), value
    if f.C != 0:
        yield "C", mathml.symbol("C"), f.C
    if f.Phi != 0:
        yield "Phi", mathml.symbol("Phi"), f.Phi
    if system.objective != 0:
        yield "J", mathml.symbol("J"), system.objective


def derivation_html(derivation: Derivation) -> str:
    """All sections of a derivation; those with many formulas can be opened."""
    sections = "".join(section_html(section) for section in derivation.sections)
    return f'<div class="dmoc"><h2>{escape(derivation.title)}</h2>{sections}</div>'


def section_html(section: Section) -> str:
    """A section: what is done, and its formulas."""
    pattern = "\n".join(section.pattern)
    text = f"<h3>{escape(section.title)}</h3><p>{escape(section.text)}</p>"
    if pattern:
        text += f'<pre style="overflow-x:auto;font-family:monospace">{escape(pattern)}</pre>'
    formulas = "".join(
        f'<div style="{_WIDE}">{mathml.equation(left_of(e), e.right)}</div>'
        for e in section.equations
    )
    if not pattern:
        return text + formulas
    return (
        f"{text}<details><summary>{len(section.equations)} formulas</summary>{formulas}</details>"
    )


def left_of(equation: Equation) -> str:
    """The left side of an equation as MathML."""
    name = equation.name
    if isinstance(equation.left, tuple):
        a, b = (f"<mo>\u2202</mo>{mathml.expression(s)}" for s in equation.left)
        return f"<mfrac><msup><mo>\u2202</mo><mn>2</mn></msup><mrow>{a}{b}</mrow></mfrac>"
    if equation.left is not None:
        return mathml.expression(equation.left)
    if name.startswith("0 "):
        return f"<mn>0</mn><mspace width='.4em'/><mtext>{escape(name[2:])}</mtext>"
    if slot := _SLOT.fullmatch(name):
        number = f"<msub><mi>D</mi><mn>{slot[1]}</mn></msub>"
        below = mathml.symbol(slot[2]) if slot[2] else ""
        inner = "<msub><mi>L</mi><mi>d</mi></msub>"
        return f"{number}{f'<msub><mrow>{inner}</mrow>{below}</msub>' if below else inner}"
    if slope := _SLOPE.fullmatch(name):
        above, below = (f"<mrow><mo>\u2202</mo>{mathml.symbol(s)}</mrow>" for s in slope.groups())
        return f"<mfrac>{above}{below}</mfrac>"
    if name == "delta W":
        return "<mi>\u03b4</mi><mi>W</mi>"
    if name.startswith("fd_"):
        side, _, tail = name[3:].partition("_")
        return mathml.symbol(f"f_d_{side}_{tail}")
    if normal := _NORMAL.fullmatch(name):
        return ("<mo>\u2207</mo>" if normal[1] else "") + mathml.symbol(normal[2])
    if name.replace("_", "").replace("~", "").isalnum():
        return mathml.symbol(name)
    return f"<mtext>{escape(name)}</mtext>"
