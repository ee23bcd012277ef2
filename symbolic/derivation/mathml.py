"""Expressions as MathML, which browsers and notebooks show without a network."""

from __future__ import annotations

from html import escape
from typing import Any

import sympy as sp
from sympy.printing.mathml import MathMLPresentationPrinter

from dmoc.symbolic.derivation.symbols import MARK

# Words of a name that are marks over the letter before them; full stops, because accents touch the
# letter where there is no font for mathematics.
OVER = {"dot": ".", "ddot": "..", "bar": "\u00af"}
ABOVE = {"plus": "+", "minus": "\u2212"}
GREEK = frozenset(
    "alpha beta gamma delta epsilon zeta eta theta kappa lambda mu nu xi rho sigma tau phi chi "
    "psi omega Gamma Delta Theta Lambda Xi Pi Sigma Phi Psi Omega".split()
)
# Terms of a sum that stand in one line, by the length of their text; a line of an equation.
LINE = 110


def math(body: str) -> str:
    """A formula from its MathML."""
    shown = 'display="block" style="width:fit-content;margin:0"'
    return f'<math xmlns="http://www.w3.org/1998/Math/MathML" {shown}>{body}</math>'


def symbol(name: str) -> str:
    """A name of the derivation: alpha_dot_kp1 is an alpha with a dot and the subscript k + 1,
    r_plus_x an r with + above and x below."""
    plain = name.rstrip(MARK)
    head, *rest = plain.split("_")
    letter, above, below = _letter({"lam": "lambda"}.get(head, head)), "", []
    for part in rest:
        if part in OVER:
            letter = f"<mover>{letter}<mo>{OVER[part]}</mo></mover>"
        elif part in ABOVE:
            above = f"<mo>{ABOVE[part]}</mo>"
        else:
            below.append("<mi>k</mi><mo>+</mo><mn>1</mn>" if part == "kp1" else _letter(part))
    for _ in range(len(name) - len(plain)):
        letter = f"<mover>{letter}<mo>~</mo></mover>"
    under = f"<mrow>{'<mo>,</mo>'.join(below)}</mrow>" if below else ""
    if above and under:
        return f"<msubsup>{letter}{under}{above}</msubsup>"
    if above:
        return f"<msup>{letter}{above}</msup>"
    return f"<msub>{letter}{under}</msub>" if under else letter


def _letter(word: str) -> str:
    if word.isdigit():
        return f"<mn>{word}</mn>"
    if word in GREEK:
        return f"<mi>{sp.pretty(sp.Symbol(word), use_unicode=True)}</mi>"
    return f"<mi>{escape(word)}</mi>"


class _MathMLPrinter(MathMLPresentationPrinter):  # type: ignore[misc]
    """SymPy's printer with the names of the derivation."""

    def _print_Symbol(self, expr: Any, style: str = "plain") -> Any:
        from xml.dom.minidom import parseString

        return parseString(symbol(expr.name)).documentElement


def expression(value: Any) -> str:
    """MathML of an expression."""
    printer = _MathMLPrinter({"mul_symbol": "\u2062"})
    text = str(printer._print(sp.sympify(value)).toxml())
    return text.replace("<mo>-</mo>", "<mo>\u2212</mo>")


def equation(left: str, right: Any) -> str:
    """A formula left = right, ``left`` as MathML; a long sum goes on in further lines."""
    first = f"{left}<mo>=</mo>"
    lines = [""]
    length = 0
    terms = sp.Add.make_args(right) if isinstance(right, sp.Expr) else (right,)
    wide = isinstance(right, sp.Add) and len(sp.sstr(right)) > LINE
    if not wide:
        return math(f"<mrow>{first}{expression(right)}</mrow>")
    for term in terms:
        size = len(sp.sstr(term))
        if lines[-1] and length + size > LINE:
            lines.append("")
            length = 0
        sign = "<mo>+</mo>" if (lines[-1] or len(lines) > 1) else ""
        if term.could_extract_minus_sign():
            sign, term = "<mo>\u2212</mo>", -term
        body = expression(term)
        lines[-1] += sign + (f"<mo>(</mo>{body}<mo>)</mo>" if term.is_Add else body)
        length += size
    rows = "".join(
        f'<mtr><mtd style="text-align:right">{first if not k else ""}</mtd>'
        f'<mtd style="text-align:left"><mrow>{line}</mrow></mtd></mtr>'
        for k, line in enumerate(lines)
    )
    return math(f'<mtable displaystyle="true">{rows}</mtable>')
