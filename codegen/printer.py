"""Scheduled expressions to text: one formatting method per kind of node.

Numbers are printed with 17 significant digits.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import ClassVar

from dmoc.base.errors import GenerationError
from dmoc.codegen.schedule import MANY, Schedule, is_unit, schedule
from dmoc.symbolic import graph
from dmoc.symbolic.graph import GraphNode
from dmoc.symbolic.spec import FunctionSpec, Input, KernelSpec, Output

_SUM, _PRODUCT, _ATOM = 1, 2, 3  # how tightly a text binds
LONG = 8  # letters of a number from which on it has a name, where it stands several times


@dataclass(frozen=True)
class Listing:
    """A kernel as straight-line code: constants with their names; values with theirs, and other
    statements, which have none; the places of results with their values; the inputs that are
    read."""

    constants: tuple[tuple[str, str], ...]
    statements: tuple[tuple[str, str], ...]
    results: tuple[tuple[tuple[str, ...], str], ...]
    read: frozenset[str]


class Printer:
    """Prints the nodes of a schedule in one language; subclasses say how it writes statements,
    functions and conditions."""

    functions: ClassVar[Mapping[str, str]]
    conditional: ClassVar[str]  # a value by a condition
    words: ClassVar[Mapping[str, str]]  # between conditions
    component: ClassVar[str]  # of an input or output
    call: ClassVar[tuple[str, ...]]  # of a function of its own

    def __init__(self, plan: Schedule, names: Mapping[GraphNode, str]) -> None:
        self.plan, self.statements = plan, list[tuple[str, str]]()
        self._texts = {node: (name, _ATOM) for node, name in names.items()}
        self._calls: dict[tuple[FunctionSpec, tuple[GraphNode, ...]], str] = {}
        self._terms: dict[GraphNode, list[tuple[bool, str]]] = {}  # of sums without a name
        self._values = 0
        self.constants = _long_numbers(plan)
        for node in plan.order:
            if node not in self._texts:
                self._texts[node] = self._kept(node)

    @classmethod
    def name_of(cls, argument: Input | Output, i: int) -> str:
        return cls.component.format(name=argument.name, i=i)

    def text(self, node: GraphNode) -> str:
        return self._texts[node][0]

    def _kept(self, node: GraphNode) -> tuple[str, int]:
        """What stands for a node: a name where several read it, or its text."""
        text, binds = self._print(node)
        if self.plan.uses[node] < 2 and node not in self.plan.definitions:
            return text, binds
        if node.kind in (graph.NUMBER, graph.RESULT, graph.RELATION, graph.JUNCTION):
            return text, binds
        self._terms.pop(node, None)
        name = node.value if node.kind == graph.SYMBOL else f"w{self._values}"
        self._values += node.kind != graph.SYMBOL
        self.statements.append((name, text))
        return name, _ATOM

    def _print(self, node: GraphNode) -> tuple[str, int]:
        if node.kind == graph.NUMBER:
            sign = "" if node.value >= 0 else "-"
            return sign + self._number(abs(node.value)), _SUM if sign else _ATOM
        if node.kind == graph.SYMBOL:
            if node not in self.plan.definitions:
                raise GenerationError(f"the symbol {node.value} is no input of the kernel.")
            return self.text(self.plan.definitions[node]), _ATOM
        if node.kind == graph.SUM:
            return self._sum(node)
        if node.kind == graph.PRODUCT:
            return self._product(node)
        if node.kind == graph.RESULT:
            return self._result(node), _ATOM
        texts = [self.text(part) for part in node.parts]
        if node.kind == graph.CALL:
            return f"{self.functions[node.value]}({', '.join(texts)})", _ATOM
        if node.kind == graph.CALLED:
            return f"{node.value.name}({', '.join(texts)})", _ATOM
        if node.kind == graph.RELATION:
            return f"({texts[0]} {node.value} {texts[1]})", _ATOM
        if node.kind == graph.JUNCTION:
            return f"({self.words[node.value].join(texts)})", _ATOM
        otherwise = texts[-1]
        for value, condition in list(zip(texts[:-1:2], texts[1::2], strict=True))[::-1]:
            otherwise = self.conditional.format(
                value=value, condition=condition, otherwise=otherwise
            )
        return otherwise, _ATOM

    def _number(self, magnitude: float) -> str:
        return self.constants.get(magnitude) or _number(magnitude)

    def _sum(self, node: GraphNode) -> tuple[str, int]:
        terms: list[tuple[bool, str]] = []  # whether negative, magnitude
        if node.value:
            terms.append((node.value < 0, self._number(abs(node.value))))
        for part, c in node.parts:
            if abs(c) != 1:
                terms.append((c < 0, f"{self._number(abs(c))}*{self._wrap(part, _ATOM)}"))
            elif part in self._terms:
                terms += [((c < 0) != negative, text) for negative, text in self._terms[part]]
            else:
                terms.append((c < 0, self._wrap(part, _PRODUCT)))
        terms.sort(key=lambda term: term[0])  # positive terms come first
        self._terms[node] = terms
        text = "".join((" - " if negative else " + ") + term for negative, term in terms)
        first = ("-" if terms[0][0] else "") + text[3:]
        return first, _PRODUCT if len(terms) == 1 and not terms[0][0] else _SUM

    def _product(self, node: GraphNode) -> tuple[str, int]:
        factors = self.plan.factors[node]
        if is_unit(node):
            (base,) = factors
            if node.parts[0][1] == 0.5:
                return f"{self.functions['sqrt']}({self.text(base)})", _ATOM
            return f"1.0/{self._wrap(base, _ATOM)}", _PRODUCT
        above = [f for f in factors if not self._divides(f)]
        below = [self.plan.factors[f][0] for f in factors if self._divides(f)]
        text = "*".join(self._wrap(f, _ATOM) for f in above) or "1.0"
        if below:
            divisor = "*".join(self._wrap(f, _ATOM) for f in below)
            text += f"/{divisor}" if len(below) == 1 else f"/({divisor})"
        return text, _PRODUCT

    def _divides(self, factor: GraphNode) -> bool:
        """Whether it is the inverse of something, which nobody else needs."""
        return is_unit(factor) and factor.parts[0][1] == -1 and self.plan.uses[factor] == 1

    def _result(self, node: GraphNode) -> str:
        function, place = self.plan.functions[node]
        key = function, node.parts
        if key not in self._calls:
            number = self._calls[key] = str(len(self._calls))
            arguments = ", ".join(self.text(a) for a in node.parts)
            lines = (
                line.format(
                    number=number, name=function.name, arguments=arguments, size=function.size,
                    constants=function.constants.name,
                )
                for line in self.call
            )  # fmt: skip
            self.statements.append(("", "\n".join(lines)))
        return f"d{self._calls[key]}[{place}]"

    def _wrap(self, node: GraphNode, at_least: int) -> str:
        text, binds = self._texts[node]
        return text if binds >= at_least else f"({text})"


class CPrinter(Printer):
    """C11 with <math.h>."""

    functions: ClassVar[Mapping[str, str]] = {
        n: n
        for n in "sin cos tan asin acos atan atan2 sinh cosh tanh asinh acosh atanh log exp sqrt "
        "pow".split()
    }
    conditional = "({condition} ? {value} : {otherwise})"
    words: ClassVar[Mapping[str, str]] = {"And": " && ", "Or": " || "}
    component = "{name}[{i}]"
    call = (
        "const double z{number}[] = {{{arguments}}};",
        "double d{number}[{size}];",
        "{name}(z{number}, {constants}, d{number});",
    )


class NumPyPrinter(Printer):
    """NumPy on whole columns: every symbol is an array over the rows of a call."""

    functions: ClassVar[Mapping[str, str]] = {
        **{n: f"np.{n}" for n in "sin cos tan sinh cosh tanh log exp sqrt".split()},
        **{n: f"np.arc{n[1:]}" for n in "asin acos atan atan2 asinh acosh atanh".split()},
        "pow": "np.power",
    }
    conditional = "np.where({condition}, {value}, {otherwise})"
    words: ClassVar[Mapping[str, str]] = {"And": " & ", "Or": " | "}
    component = "{name}[..., {i}]"
    call = ("d{number} = {name}([{arguments}], {constants})",)


class ArgumentPrinter(NumPyPrinter):
    """A printer for a function of a list of columns that returns another list."""

    @classmethod
    def name_of(cls, argument: Input | Output, i: int) -> str:
        listed = argument.name in ("z", "d")
        return f"{argument.name}[{i}]" if listed else super().name_of(argument, i)


def listing(
    spec: KernelSpec, printer: type[Printer], functions: Iterable[FunctionSpec] = ()
) -> Listing:
    """Print a kernel: values that several others need as ``w0, w1, ...``, outputs; nothing that
    no output needs."""
    expressions = [e for output in spec.outputs for e in output.expressions]
    plan = schedule(expressions, dict(spec.definitions), functions)
    names = {
        s: printer.name_of(argument, i)
        for argument in spec.inputs
        for i, s in enumerate(argument.symbols)
    }
    code = printer(plan, names)
    stored = [printer.name_of(o, i) for o in spec.outputs for i in range(o.size)]
    values = map(code.text, plan.results)
    results: list[tuple[tuple[str, ...], str]] = [
        ((place,), value) for place, value in zip(stored, values, strict=True)
    ]
    if len(stored) <= MANY:
        places: dict[str, tuple[str, ...]] = {}
        for place, value in results:
            places[value] = (*places.get(value, ()), *place)
        results = [(own, value) for value, own in places.items()]
    read = frozenset(a.name for a in spec.inputs if any(s in plan.uses for s in a.symbols))
    read |= {f.constants.name for f, _ in plan.functions.values()}
    constants = tuple((name, _number(value)) for value, name in code.constants.items())
    return Listing(constants, tuple(code.statements), tuple(results), read)


def _long_numbers(plan: Schedule) -> dict[float, str]:
    """Names of long numbers that stand at several places."""
    count: Counter[float] = Counter()
    for node in plan.order:
        if node.kind == graph.NUMBER:
            count[abs(node.value)] += plan.uses[node]
        elif node.kind == graph.SUM:
            count.update(abs(c) for c in (node.value, *(c for _, c in node.parts)))
    several = (value for value, times in count.items() if times > 1)
    return {v: f"k{i}" for i, v in enumerate(v for v in several if len(_number(v)) >= LONG)}


def _number(value: float) -> str:
    text = f"{value:.17g}"
    return text if set(text) & set(".e") else text + ".0"
