"""The derivation of a system, step by step, as text, as LaTeX, and in notebooks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import sympy as sp

from dmoc.base.discretisation import DISCRETISATIONS, known_order
from dmoc.base.names import name_of, velocity_name
from dmoc.symbolic.continuous import (
    Continuous,
    dot,
    energy,
    gradient,
    impact_work,
    input_matrix,
    mass_matrix,
    momenta,
    readable,
    right_hand_side,
)
from dmoc.symbolic.derivation.symbols import MARK, DisplayNames, latex_symbol
from dmoc.symbolic.discrete import StepElement, step_element
from dmoc.symbolic.families import approach, first_root
from dmoc.symbolic.system import MechanicalSystem, check_system

LATEX_WIDTH = 220  # characters of source in a line of an equation, about the width of a page
LEFT = "left side"  # what a name stands for
# of a line of text; wider equations are printed on one logical line, without two-dimensional layout
WIDTH = 110


@dataclass(frozen=True)
class Equation:
    """``left`` = ``right``; the left side is a name, in text and in LaTeX."""

    name: str
    latex_name: str
    right: Any
    # The left side where it is an expression, or a pair of what is differentiated by.
    left: Any = None


@dataclass(frozen=True)
class Section:
    """A step of the derivation: what is done, and its equations."""

    title: str
    text: str
    equations: tuple[Equation, ...]
    pattern: tuple[str, ...] = ()  # lines that mark where a matrix is not identically zero


@dataclass(frozen=True)
class Derivation:
    """The steps from the Lagrangian to the derivatives of the discrete equations."""

    title: str
    sections: tuple[Section, ...]

    def __repr__(self) -> str:
        return f"<{self.title}: {len(self.sections)} sections>"

    def __str__(self) -> str:
        parts = [self.title, "=" * len(self.title)]
        for number, section in enumerate(self.sections, 1):
            head = f"{number}. {section.title}"
            parts += ["", head, "-" * len(head)]
            parts += [section.text, *section.pattern]
            parts += [_text(equation) for equation in section.equations]
        return "\n".join(parts) + "\n"

    def latex(self) -> str:
        """Return a complete LaTeX document; equations wider than the page are scaled to it."""
        body = []
        for section in self.sections:
            body.append(f"\\section{{{_escape(section.title)}}}")
            body.append(_escape(section.text))
            if section.pattern:
                body.append(
                    "\\begin{verbatim}\n" + "\n".join(section.pattern) + "\n\\end{verbatim}"
                )
            body += [f"\\equationline{{{_latex_equation(e)}}}" for e in section.equations]
        return _DOCUMENT.replace("TITLE", _escape(self.title)).replace("BODY", "\n\n".join(body))

    def _repr_html_(self) -> str:
        """Display in a notebook."""
        from dmoc.symbolic.derivation.notebook import derivation_html

        return derivation_html(self)

    def _repr_latex_(self) -> str:
        """Display where formulas are LaTeX."""
        parts = [f"\\textbf{{{_escape(self.title)}}}"]
        for section in self.sections:
            parts.append(f"\\textbf{{{_escape(section.title)}}}: {_escape(section.text)}")
            parts += [f"$${_latex_equation(e)}$$" for e in section.equations]
        return "\n\n".join(parts)


_DOCUMENT = r"""\documentclass[11pt]{article}
\usepackage[a4paper,margin=22mm]{geometry}
\usepackage{amsmath,graphicx}
\newsavebox{\equationbox}
\newcommand{\equationline}[1]{\par\smallskip\noindent\sbox{\equationbox}{$\displaystyle #1$}%
  \ifdim\wd\equationbox>\linewidth\resizebox{\linewidth}{!}{\usebox{\equationbox}}\else\usebox{\equationbox}\fi\par}
\title{TITLE}
\date{}
\begin{document}
\maketitle
BODY
\end{document}
"""


def _escape(text: str) -> str:
    for character in "&%#_":
        text = text.replace(character, f"\\{character}")
    return (
        text.replace("^", r"\^{}")
        .replace("~", r"\~{}")
        .replace("<=", r"$\le$")
        .replace(">=", r"$\ge$")
    )


def _latex_equation(equation: Equation) -> str:
    """One line, or a sum broken into lines where it is long."""
    right = equation.right
    text = _latex(right)
    if len(text) <= LATEX_WIDTH or isinstance(right, sp.MatrixBase):
        return f"{equation.latex_name} = {text}"
    lines = [""]
    for term in sp.Add.make_args(sp.expand(right)):
        piece = _latex(term)
        piece = piece if piece.startswith("-") else f"+ {piece}"
        if lines[-1] and len(lines[-1]) + len(piece) > LATEX_WIDTH:
            lines.append("")
        lines[-1] += piece
    lines[0] = lines[0].removeprefix("+ ")
    return (
        f"\\begin{{aligned}} {equation.latex_name} ={{}}& "
        + r" \\ & ".join(lines)
        + r" \end{aligned}"
    )


def _latex(expression: Any) -> str:
    names = {s: latex_symbol(s.name) for s in expression.free_symbols}
    return str(sp.latex(expression, symbol_names=names))


def _text(equation: Equation) -> str:
    pretty = sp.pretty(equation.right, use_unicode=False, wrap_line=False, num_columns=10_000)
    lines = pretty.split("\n")
    head = f"  {equation.name} = "
    if max(map(len, lines)) + len(head) > WIDTH:
        return f"{head}{sp.sstr(equation.right)}"
    middle = len(lines) // 2
    return "\n".join(
        (head if i == middle else " " * len(head)) + line for i, line in enumerate(lines)
    ) + ("\n" if len(lines) > 1 else "")


def derive(system: MechanicalSystem, order: int = 2) -> Derivation:
    """Derive a system; see :func:`dmoc.derive`."""
    check_system(system)
    order = known_order(order)
    f = readable(system)
    names = DisplayNames.beside(system)
    element = _readable_element(system, order, names)
    sections = [
        *_continuous_sections(system, f, names),
        *_discrete_sections(system, element, names),
        *_collision_sections(system, f, element, names),
        *_cost_sections(system, f, element, names),
        *_feasibility_section(system, f, names),
        *_derivative_sections(element, names),
    ]
    if names.marked:
        note = (
            f" {', '.join(names.marked)} with {MARK} are quantities of the derivation: the name "
            "without it is taken."
        )
        sections[0] = replace(sections[0], text=sections[0].text + note)
    return Derivation(f"Derivation of the model {system.name}", tuple(sections))


def tangents(normal: Sequence[Any]) -> list[list[Any]]:
    """Return nq - 1 vectors t with t . normal = 0 identically, for a gradient that is nowhere
    zero in one component."""
    pivot = next((i for i, n in enumerate(normal) if n.is_nonzero), None)
    if pivot is None:
        pivot = next(i for i, n in enumerate(normal) if n != 0)
    vectors = []
    for i in range(len(normal)):
        if i != pivot:
            t = [sp.S.Zero] * len(normal)
            t[i], t[pivot] = sp.S.One, -normal[i] / normal[pivot]
            vectors.append(t)
    return vectors


def _continuous_sections(
    system: MechanicalSystem, f: Continuous, own: DisplayNames
) -> Iterable[Section]:
    names = [str(q) for q in f.q]
    tex = [latex_symbol(str(q)) for q in f.q]
    accelerations = [own.symbol(f"{n}_ddot", "acceleration") for n in names]
    time = ", t" if f.L.has(f.t) else ""
    yield Section(
        "Lagrangian",
        f"L(q, q'{time}) with the coordinates q = (" + ", ".join(names) + ").",
        (_equation(own, "L", "L", f.L),),
    )
    yield Section("Momenta", "p = dL/dq'.", tuple(_each(own, "p", names, tex, momenta(f))))
    yield Section(
        "Mass matrix", "M = d2L/dq'2.", (_equation(own, "M", "M", sp.Matrix(mass_matrix(f))),)
    )
    yield Section("Energy", "E = p . q' - L.", (_equation(own, "E", "E", sp.expand(energy(f))),))
    work = dot(f.Q, [own.symbol(f"delta_{n}", "variation") for n in names])
    forces = [Equation("delta W", r"\delta W", work), *_each(own, "Q", names, tex, f.Q)]
    if f.u:
        forces.append(Equation("dQ/du", r"\partial Q / \partial u", sp.Matrix(input_matrix(f))))
    yield Section("Virtual work and generalised forces", "delta W = Q . delta q.", tuple(forces))
    left = sp.Matrix(mass_matrix(f)) * sp.Matrix(accelerations)
    motion = [
        Equation(sp.sstr(a), _latex(a), b, a) for a, b in zip(left, right_hand_side(f), strict=True)
    ]
    partial = " - d2L/dq'dt" if time else ""
    yield Section(
        "Equations of motion", f"M q'' = dL/dq - (d2L/dq'dq) q'{partial} + Q.", tuple(motion)
    )
    if f.g:
        equations = []
        for name, g in zip(system.surfaces, f.g, strict=True):
            equations.append(_equation(own, f"g_{name}", f"g_{{\\mathrm{{{_escape(name)}}}}}", g))
            equations.append(
                Equation(
                    f"grad g_{name}",
                    f"\\nabla g_{{\\mathrm{{{_escape(name)}}}}}",
                    sp.Matrix([gradient(g, f.q)]),
                )
            )
            if g.has(f.t):
                equations.append(
                    Equation(
                        f"dg_{name}/dt",
                        f"\\partial_t g_{{\\mathrm{{{_escape(name)}}}}}",
                        g.diff(f.t),
                    )
                )
        yield Section(
            "Unilateral constraints",
            "g <= 0; the gradient points out of the admissible set.",
            tuple(equations),
        )
    if f.tau:
        equations = []
        for name, tau, mu in zip(system.tangents, f.tau, f.mu, strict=True):
            tag = f"{{\\mathrm{{{_escape(name)}}}}}"
            equations.append(_equation(own, f"tau_{name}", rf"\tau_{tag}", tau))
            letter, symbol = ("mu", r"\mu") if name in system.surfaces else ("F", "F")
            equations.append(_equation(own, f"{letter}_{name}", f"{symbol}_{tag}", mu))
        yield Section(
            "Friction",
            "Tangential positions tau. A contact that sticks keeps tau, with a tangential impulse "
            "|T| <= mu P and P the normal one; one that slides with the sign s has T = -s mu P. A "
            "rail has the largest force F instead of mu P/h.",
            tuple(equations),
        )


def _discrete_sections(
    system: MechanicalSystem, e: StepElement, own: DisplayNames
) -> Iterable[Section]:
    n = len(e.q_k)
    names = [name_of(q) for q in system.coordinates]
    tex = [latex_symbol(x) for x in names]
    middle = len(e.points) == 1
    place = "Midpoint" if middle else "Quadrature points"
    text = (
        "Coordinates and velocities of the midpoint rule"
        if middle
        else (
            f"Coordinates and velocities at the {len(e.points)} Gauss points of the polynomial "
            f"through the nodes k (start), {', '.join(_inner(e.inside))} (inside) and k+1 (end)"
        )
    )
    used = {
        s
        for p in e.points
        for f in (p.start, p.end)
        for part in (f.L, *f.Q, f.C, *f.r)
        for s in part.free_symbols
    }
    times = {p.start.t for p in e.points}
    yield Section(
        f"{place} of a step",
        f"{text}, in the step from node k to node k+1 of size h.",
        tuple(
            Equation(str(s), latex_symbol(str(s)), value)
            for s, value in e.definitions
            if s in used or s not in times
        ),
    )
    slots = [e.D(e.L_d, i) for i in range(2 * n)]
    yield Section(
        "Discrete Lagrangian",
        "L_d, the quadrature of L over the step, with its derivatives in the first, second and "
        "third slot.",
        (
            _equation(own, "L_d", "L_d", e.L_d),
            *_each(own, "D1_Ld", names, tex, slots[:n], "D_1 L_d"),
            *_each(own, "D2_Ld", names, tex, slots[n:], "D_2 L_d"),
            _equation(own, "D3_Ld", "D_3 L_d", e.D(e.L_d, e.at_h)),
        ),
    )
    yield Section(
        "Discrete forces",
        "fd_minus = h/2 Q with the input u_k, fd_plus = h/2 Q with the input u_kp1."
        if middle
        else "The virtual work of Q at the quadrature points on the first and the last node; "
        "inputs are linear in the step, from u_k to u_kp1.",
        (
            *_each(own, "fd_minus", names, tex, e.fd_minus, "f_d^-"),
            *_each(own, "fd_plus", names, tex, e.fd_plus, "f_d^+"),
        ),
    )
    inside = "" if middle else " Nodes inside the step: r_i = 0."
    yield Section(
        "Discrete Euler-Lagrange equations",
        "r_minus = D1_Ld + fd_minus is -p at the step's start, r_plus = D2_Ld + fd_plus is p at "
        "its end. Interior nodes: r_plus(k-1) + r_minus(k) = 0. Start: r_minus(0) + p_B = 0. End: "
        f"r_plus(N-1) - p_E = 0.{inside}",
        (
            *_each(own, "r_minus", names, tex, e.r_minus, "r^-"),
            *_each(own, "r_plus", names, tex, e.r_plus, "r^+"),
            *(
                equation
                for a, tag in enumerate(_inner(e.inside))
                for equation in _each(
                    own, f"r_{tag}", names, tex, e.r_i[a * n : (a + 1) * n], f"r^{{{tag}}}"
                )
            ),
        ),
    )


def _collision_sections(
    system: MechanicalSystem, f: Continuous, e: StepElement, own: DisplayNames
) -> Iterable[Section]:
    if not f.g:
        return
    names = [str(q) for q in f.q]
    before = [own.symbol(f"r_plus_{n}", LEFT) for n in names]
    after = [own.symbol(f"r_minus_{n}", LEFT) for n in names]
    lam = own.symbol("lam", "impulse")
    equations = []
    for name, g in zip(system.surfaces, f.g, strict=True):
        normal = gradient(g, f.q)
        tag = f"\\mathrm{{{_escape(name)}}}"
        momentum = sp.Matrix(
            [a + b - lam * c for a, b, c in zip(before, after, normal, strict=True)]
        )
        equations.append(Equation(f"0 (position, {name})", f"0_{{{tag}}}", g))
        equations.append(Equation(f"0 (momentum, {name})", f"0_{{{tag}}}", momentum))
        for t in tangents(normal):
            total = [a + b for a, b in zip(before, after, strict=True)]
            equations.append(
                Equation(f"0 (tangential momentum, {name})", f"0_{{{tag}}}", dot(t, total))
            )
    impulses = [own.symbol(f"lam_{n}", "impulse") for n in system.surfaces]
    equations.append(_equation(own, "e_plus", "e^+", e.e_plus))
    equations.append(_equation(own, "e_minus", "e^-", e.e_minus))
    moving, rate = impact_work(f, impulses)
    equations.append(_equation(own, "W_t", "W_t", moving))
    equations.append(_equation(own, "W_gamma", r"W_\gamma", rate))
    yield Section(
        "Collision conditions",
        "At a collision node q_c: g(q_c) = 0; only the normal part of the momentum jumps, "
        "r_plus(before) + r_minus(after) = lam grad g, or, without the impulse lam >= 0, its "
        "projection on the tangents vanishes. With the coefficient of restitution e and the rate "
        "gamma = grad g . q' + dg/dt of the gap after the collision, e (e_plus(before) - "
        "e_minus(after) - W_t) = (1 - e)/2 W_gamma with W_t = lam dg/dt and W_gamma = lam gamma: "
        "the mean of the balance of energy (e = 1) and of the plastic impact gamma = 0 (e = 0), "
        "which is Newton's law gamma = -e gamma(before).",
        tuple(equations),
    )


def _cost_sections(
    system: MechanicalSystem, f: Continuous, e: StepElement, own: DisplayNames
) -> Iterable[Section]:
    middle = len(e.points) == 1
    text = (
        "C_d = h/2 (C with u_k + C with u_kp1) at the midpoint."
        if middle
        else "C_d, the quadrature of C over the step."
    )
    yield Section("Discrete cost", text, (_equation(own, "C_d", "C_d", e.C_d),))
    if f.Phi != 0:
        yield Section(
            "Terminal cost",
            "Phi at the final time is added to the cost.",
            (_equation(own, "Phi", r"\Phi", f.Phi),),
        )
    if e.r_d:
        names = list(system.path_constraints) * len(e.points)
        paths = [
            _equation(own, f"r_{n}", f"r_{{\\mathrm{{{_escape(n)}}}}}", r, "path")
            for n, r in zip(names, e.r_d, strict=True)
        ]
        yield Section("Path constraints", "r_d >= 0 in every step.", tuple(paths))


def _feasibility_section(
    system: MechanicalSystem, f: Continuous, own: DisplayNames
) -> Iterable[Section]:
    if not f.g or any(g.has(f.t) for g in f.g):
        return
    a = [own.symbol(f"{q}_ddot_bar", "averaged") for q in f.q]
    half_way = {q: own.symbol(f"{q}_bar", "half-way") for q in f.q}
    equations = []
    for name, g in zip(system.surfaces, f.g, strict=True):
        tag = f"\\mathrm{{{_escape(name)}}}"
        equations.append(
            _equation(
                own, f"T_min_{name}", f"T_{{\\min,{tag}}}", first_root(*approach(g, f, a, half_way))
            )
        )
    yield Section(
        "Minimal collision time",
        "First root of g + g' t + g'' t^2/2. The accelerations (_ddot_bar) are constant: M q'' = "
        "F at averaged coefficients, half-way (_bar) between the phase's start and its collision, "
        "with the inputs at the bounds that drive towards the surface.",
        tuple(equations),
    )


def _derivative_sections(e: StepElement, own: DisplayNames) -> Iterable[Section]:
    n = len(e.q_k)
    rows = {f"r_minus_{i}": r for i, r in enumerate(e.r_minus)} | {
        f"r_plus_{i}": r for i, r in enumerate(e.r_plus)
    }
    rows |= {f"r_i_{i}": r for i, r in enumerate(e.r_i)}
    rows |= {"e_plus": e.e_plus, "e_minus": e.e_minus, "C_d": e.C_d}
    equations, pattern = [], []
    for name, row in rows.items():
        derivatives = e.gradient(row)
        pattern.append(f"  {name:>10}  " + " ".join("x" if d != 0 else "." for d in derivatives))
        equations += [
            Equation(
                f"d{name}/d{z}", f"\\partial {_row_tex(name)} / \\partial {latex_symbol(str(z))}", d
            )
            for z, d in zip(e.x_k, derivatives, strict=True)
            if d != 0
        ]
    columns = "x_k = (" + ", ".join(map(str, e.x_k)) + ")"
    yield Section(
        "First derivatives",
        f"Columns {columns}; x marks what is not identically zero.",
        tuple(equations),
        tuple(pattern),
    )
    mu = (
        [own.symbol(f"mu_minus_{i}", "weight") for i in range(n)],
        [own.symbol(f"mu_plus_{i}", "weight") for i in range(n)],
    )
    mu_i = [own.symbol(f"mu_i_{i}", "weight") for i in range(len(e.r_i))]
    sigma, w_plus, w_minus = (own.symbol(name, "weight") for name in ("sigma", "w_plus", "w_minus"))
    weighted = [
        ("step", sigma * e.C_d + dot(mu[0], e.r_minus) + dot(mu[1], e.r_plus) + dot(mu_i, e.r_i)),
        ("energy", w_plus * e.e_plus + w_minus * e.e_minus),
    ]
    for title, expression in weighted:
        hessian = e.hessian(expression)
        grid = ["  " + " ".join("x" if d != 0 else "." for d in row) for row in hessian]
        second = [
            Equation(
                f"d2/d{a}d{b}",
                f"\\partial^2/\\partial {latex_symbol(str(a))}\\,\\partial {latex_symbol(str(b))}",
                hessian[i][j],
                (a, b),
            )
            for i, a in enumerate(e.x_k)
            for j, b in enumerate(e.x_k)
            if j >= i and hessian[i][j] != 0
        ]
        inside = " + mu_i . r_i" if e.r_i else ""
        what = (
            f"sigma C_d + mu_minus . r_minus + mu_plus . r_plus{inside}"
            if title == "step"
            else "w_plus e_plus + w_minus e_minus"
        )
        yield Section(
            f"Second derivatives ({title})",
            f"Upper triangle for {what}.",
            tuple(second),
            tuple(grid),
        )


def _row_tex(name: str) -> str:
    return {"e_plus": "e^+", "e_minus": "e^-", "C_d": "C_d"}.get(
        name, name.replace("r_minus_", "r^-_").replace("r_plus_", "r^+_")
    )


def _equation(
    own: DisplayNames, name: str, latex: str, right: Any, meaning: str = LEFT
) -> Equation:
    """An equation whose left side has a name of its own."""
    given = own(name, meaning)
    marks = len(given) - len(name)
    return Equation(given, "\\tilde{" * marks + latex + "}" * marks, right)


def _each(
    own: DisplayNames,
    letter: str,
    names: Sequence[str],
    tex: Sequence[str],
    values: Sequence[Any],
    latex: str | None = None,
) -> list[Equation]:
    """One equation for each coordinate."""
    head = latex or letter
    return [
        _equation(own, f"{letter}_{n}", f"{head}{{}}_{{{t}}}" if latex else f"{letter}_{{{t}}}", v)
        for n, t, v in zip(names, tex, values, strict=True)
    ]


def _inner(nodes: int) -> list[str]:
    """Names of the nodes inside a step."""
    return ["i"] if nodes == 1 else [f"i{a + 1}" for a in range(nodes)]


def _readable_element(system: MechanicalSystem, order: int, own: DisplayNames) -> StepElement:
    """The step element in symbols with the user's names: alpha_k, alpha_kp1, alpha_m (midpoint)
    or alpha_1, alpha_2, F_k, F_kp1, h."""
    names = [name_of(q) for q in system.coordinates]
    inputs = [name_of(u) for u in system.inputs]
    table = {
        f"{part}_{i}": f"{n}_{part[2:]}" for part in ("q_k", "q_kp1") for i, n in enumerate(names)
    }
    inner = [f"{n}_{tag}" for tag in _inner(DISCRETISATIONS[order].inside) for n in names]
    table |= {f"q_i_{i}": name for i, name in enumerate(inner)}
    table |= {
        f"{part}_{i}": f"{n}_{part[2:]}" for part in ("u_k", "u_kp1") for i, n in enumerate(inputs)
    }

    def point(name: str) -> Any:
        return own.symbol(f"{name}_m", "midpoint") if order == 2 else sp.Symbol(name)

    f = Continuous.of(
        system,
        [point(n) for n in names],
        [point(velocity_name(n)) for n in names],
        [own.symbol(f"{n}_free", "input") for n in inputs],
        point("t"),
        list(system.parameters),
    )
    return step_element(f, order, lambda name: own.symbol(table.get(name, name), name), sp.sympify)
