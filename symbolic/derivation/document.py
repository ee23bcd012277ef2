"""The derivation of a system as a document: equations in sections, as text, as LaTeX, and in
notebooks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import sympy as sp

from dmoc.base.errors import OutputError
from dmoc.base.signatures import public
from dmoc.symbolic.derivation.symbols import DisplayNames, latex_symbol

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


@public(OutputError)
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


def upright(text: str) -> str:
    """A name as a subscript."""
    return f"{{\\mathrm{{{_escape(text)}}}}}"


def _latex_equation(equation: Equation) -> str:
    """An equation in LaTeX: one line, or a sum broken into lines where it is long."""
    right = equation.right
    text = latex_of(right)
    if len(text) <= LATEX_WIDTH or isinstance(right, sp.MatrixBase):
        return f"{equation.latex_name} = {text}"
    lines = [""]
    for term in sp.Add.make_args(sp.expand(right)):
        piece = latex_of(term)
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


def latex_of(expression: Any) -> str:
    """An expression in LaTeX, with names as they are printed."""
    names = {s: latex_symbol(s.name) for s in expression.free_symbols}
    return str(sp.latex(expression, symbol_names=names))


def _text(equation: Equation) -> str:
    head, lines = f"  {equation.name} = ", list[str]()
    if _least_width(equation.right) + len(head) <= WIDTH:
        pretty = sp.pretty(equation.right, use_unicode=False, wrap_line=False, num_columns=10_000)
        lines = pretty.split("\n")
    if not lines or max(map(len, lines)) + len(head) > WIDTH:
        return f"{head}{sp.sstr(equation.right)}"
    middle = len(lines) // 2
    return "\n".join(
        (head if i == middle else " " * len(head)) + line for i, line in enumerate(lines)
    ) + ("\n" if len(lines) > 1 else "")


def _least_width(expression: Any) -> int:
    """Letters that an expression has in a row at least: terms stand beside each other, factors may
    stand above each other."""
    if isinstance(expression, sp.Add):
        return sum(_least_width(e) + 3 for e in expression.args) - 3
    if isinstance(expression, sp.Mul):
        return max(map(_least_width, expression.args))
    return _least_width(expression.base) if isinstance(expression, sp.Pow) else 1


def definition(
    own: DisplayNames, name: str, latex: str, right: Any, meaning: str = LEFT
) -> Equation:
    """An equation whose left side has a name of its own."""
    own_name = own(name, meaning)
    marks = len(own_name) - len(name)
    return Equation(own_name, "\\tilde{" * marks + latex + "}" * marks, right)


def definitions(
    own: DisplayNames,
    letter: str,
    names: Sequence[str],
    tex: Sequence[str],
    values: Sequence[Any],
    latex: str | None = None,
) -> list[Equation]:
    """Equations that define a letter's values, one for each coordinate."""
    head = latex or letter
    return [
        definition(own, f"{letter}_{n}", f"{head}{{}}_{{{t}}}" if latex else f"{letter}_{{{t}}}", v)
        for n, t, v in zip(names, tex, values, strict=True)
    ]
