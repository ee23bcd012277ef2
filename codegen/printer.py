"""Expressions to text: shared subexpressions per kernel, then one formatting method per kind of
node.

The text does not depend on hash seeds, because the terms of sums and products are sorted by their
text; numbers are printed with 17 significant digits.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import symengine as se

from dmoc.base.errors import GenerationError
from dmoc.symbolic.spec import KernelSpec

_SUM, _PRODUCT, _ATOM = 1, 2, 3  # how tightly a text binds
CONDITIONS = ("StrictLessThan", "LessThan", "Equality", "Unequality", "And", "Or")


@dataclass(frozen=True)
class Listing:
    """A kernel as straight-line code: local assignments, then one right-hand side per stored
    output value."""

    locals: tuple[tuple[str, str], ...]
    outputs: tuple[tuple[str, tuple[str, ...]], ...]


class Printer:
    """Prints expressions in one language; subclasses say how it writes calls and conditions."""

    functions: ClassVar[Mapping[str, str]]
    choice: ClassVar[str]  # of a value by a condition
    words: ClassVar[Mapping[str, str]]  # between conditions

    def __init__(self, names: Mapping[str, str]) -> None:
        self._names = dict(names)

    def text(self, expression: Any) -> str:
        return self._print(expression)[0]

    def call(self, function: str, *arguments: str) -> str:
        return f"{self.functions[function]}({', '.join(arguments)})"

    def integer_power(self, base: str, exponent: int) -> str:
        """Small powers are functions that the templates define."""
        return f"power{exponent}({base})"

    def conditional(self, branches: Sequence[tuple[str, str]], otherwise: str) -> str:
        """Choose the value of the first (value, condition) that holds."""
        for value, condition in reversed(branches):
            otherwise = self.choice.format(value=value, condition=condition, otherwise=otherwise)
        return otherwise

    # One method per kind of node ------------------------------------------------------------------

    def _print(self, e: Any) -> tuple[str, int]:
        if e.is_Symbol:
            try:
                return self._names[str(e)], _ATOM
            except KeyError:
                raise GenerationError(f"the symbol {e} is no input of the kernel.") from None
        if e.is_Number or e in (se.pi, se.E):
            return self._number(e)
        kind = type(e).__name__
        if e.is_Add:
            return self._add(e)
        if e.is_Mul:
            return self._mul(e)
        if e.is_Pow:
            return self._pow(e)
        if kind == "Piecewise":
            return self._piecewise(e)
        if kind in self.functions:
            return self.call(kind, *(self.text(a) for a in e.args)), _ATOM
        raise GenerationError(
            f"the expression {e} ({kind}) cannot be printed as {type(self).__name__[:-7]} code."
        )

    def _number(self, e: Any) -> tuple[str, int]:
        value = float(e)
        if value != value or value in (float("inf"), float("-inf")):
            raise GenerationError(f"the constant {e} is not finite.")
        text = f"{value:.17g}"
        if not set(text) & set(".e"):
            text += ".0"
        return text, (_ATOM if value >= 0 else _SUM)

    def _add(self, e: Any) -> tuple[str, int]:
        terms = sorted((self._signed(a) for a in e.args), key=lambda t: (t[0], t[1]))
        first, *rest = terms  # positive terms come first
        text = ("-" if first[0] else "") + first[1]
        for negative, term in rest:
            text += (" - " if negative else " + ") + term
        return text, _SUM

    def _signed(self, e: Any) -> tuple[bool, str]:
        """Split a term into its sign and the text of its magnitude."""
        coefficient = (
            e.args[0] if e.is_Mul and e.args[0].is_Number else (e if e.is_Number else None)
        )
        if coefficient is not None and float(coefficient) < 0:
            return True, self._wrap(-e, _PRODUCT)
        return False, self._wrap(e, _PRODUCT)

    def _mul(self, e: Any) -> tuple[str, int]:
        factors: list[str] = []
        divisors: list[str] = []
        number = ""
        for a in e.args:
            if a.is_Number:
                if float(a) < 0:
                    return f"-{self._wrap(-e, _PRODUCT)}", _SUM
                number = self._number(a)[0]
            elif a.is_Pow and a.args[1].is_Number and float(a.args[1]) < 0:
                divisors.append(self._wrap(1 / a, _ATOM))
            else:
                factors.append(self._wrap(a, _ATOM))
        product = "*".join(([number] if number else []) + sorted(factors)) or "1.0"
        if not divisors:
            return product, _PRODUCT
        below = "*".join(sorted(divisors))
        return f"{product}/{below}" if len(divisors) == 1 else f"{product}/({below})", _PRODUCT

    def _pow(self, e: Any) -> tuple[str, int]:
        base, exponent = e.args
        if base == se.E:
            return self.call("exp", self.text(exponent)), _ATOM
        if exponent.is_Number and float(exponent) < 0:
            return f"1.0/{self._wrap(1 / e, _ATOM)}", _PRODUCT
        if exponent == se.Rational(1, 2):
            return self.call("sqrt", self.text(base)), _ATOM
        if exponent.is_Integer and int(exponent) <= 4:
            return self.integer_power(self.text(base), int(exponent)), _ATOM
        return self.call("pow", self.text(base), self.text(exponent)), _ATOM

    def _piecewise(self, e: Any) -> tuple[str, int]:
        branches: list[tuple[str, str]] = []
        for value, condition in zip(e.args[::2], e.args[1::2], strict=True):
            kind = type(condition).__name__
            if kind == "BooleanTrue":
                return self.conditional(branches, self.text(value)), _ATOM
            if kind != "BooleanFalse":
                branches.append((self.text(value), self.condition(condition)))
        raise GenerationError(
            f"the Piecewise {e} has no value elsewhere: end it with (value, True)."
        )

    def condition(self, c: Any) -> str:
        kind = type(c).__name__
        signs = {"StrictLessThan": "<", "LessThan": "<=", "Equality": "==", "Unequality": "!="}
        if kind in signs:
            a, b = c.args
            for flag, other in ((a, b), (b, a)):  # a shared condition x comes back as x == True
                if type(flag).__name__ == "BooleanTrue":
                    return self.text(other)
            return f"({self.text(a)} {signs[kind]} {self.text(b)})"
        if kind in ("And", "Or"):
            return f"({self.words[kind].join(sorted(self.condition(a) for a in c.args))})"
        raise GenerationError(f"the condition {c} ({kind}) cannot be printed.")

    def _wrap(self, e: Any, at_least: int) -> str:
        text, binds = self._print(e)
        return text if binds >= at_least else f"({text})"


class CPrinter(Printer):
    """C11 with <math.h>; the template defines the small integer powers."""

    functions: ClassVar[Mapping[str, str]] = {
        n: n
        for n in "sin cos tan asin acos atan atan2 sinh cosh tanh asinh acosh atanh log exp sqrt "
        "pow".split()
    }

    choice = "({condition} ? {value} : {otherwise})"
    words: ClassVar[Mapping[str, str]] = {"And": " && ", "Or": " || "}


class NumPyPrinter(Printer):
    """NumPy on whole columns: every symbol is an array over the rows of a call."""

    functions: ClassVar[Mapping[str, str]] = {
        **{n: f"np.{n}" for n in "sin cos tan sinh cosh tanh log exp sqrt".split()},
        **{n: f"np.arc{n[1:]}" for n in "asin acos atan atan2 asinh acosh atanh".split()},
        "pow": "np.power",
    }

    choice = "np.where({condition}, {value}, {otherwise})"
    words: ClassVar[Mapping[str, str]] = {"And": " & ", "Or": " | "}


def listing(spec: KernelSpec, printer: type[Printer], component: str) -> Listing:
    """Print a kernel: definitions, shared subexpressions as ``w0, w1, ...``, outputs; nothing that
    no output needs.

    ``component`` is the format of an input component, for instance ``"{name}[{i}]"``.
    """
    names = {
        str(s): component.format(name=argument.name, i=i)
        for argument in spec.inputs
        for i, s in enumerate(argument.symbols)
    }
    wanted = [e for output in spec.outputs for e in output.expressions]
    shared, reduced = se.cse(wanted) if wanted else ([], [])
    defined = {symbol for symbol, _ in spec.definitions}
    assignments: list[tuple[str, str]] = []
    temporaries = 0
    for symbol, expression in _needed([*spec.definitions, *shared], reduced):
        write = printer(names)
        if type(expression).__name__ in CONDITIONS:  # a condition has no local of its own
            names[str(symbol)] = write.condition(expression)
            continue
        text = write.text(expression)
        if symbol in defined:
            names[str(symbol)] = str(symbol)
        else:
            names[str(symbol)] = f"w{temporaries}"
            temporaries += 1
        assignments.append((names[str(symbol)], text))
    write = printer(names)
    values = iter(reduced)
    outputs = tuple(
        (o.name, tuple(write.text(next(values)) for _ in o.expressions)) for o in spec.outputs
    )
    return Listing(tuple(assignments), outputs)


def _needed(steps: Sequence[tuple[Any, Any]], results: Sequence[Any]) -> list[tuple[Any, Any]]:
    """The assignments that results depend on: terms that cancel leave others behind."""
    live = set().union(set(), *(e.free_symbols for e in results))
    needed = []
    for symbol, expression in reversed(steps):
        if symbol in live:
            live |= expression.free_symbols
            needed.append((symbol, expression))
    return needed[::-1]
