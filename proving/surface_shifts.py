"""How surfaces move: what is left of their gaps, and of the rates of these, where all coordinates
and velocities are zero, as operations on the time.

They are read from the text of the kernels, which runs on terms instead of numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np

from dmoc.base.errors import ProblemError
from dmoc.codegen.kernels import Array
from dmoc.problem.problem import Problem
from dmoc.proving.balls import rounding_of
from dmoc.proving.branch import LIMITS_OF_SHIFTS, OPERATIONS, enclosed
from dmoc.proving.kernel_text import kernels_over
from dmoc.proving.linear import Shifts

# Parts of the time in which the operations of a shift must have bounds.
PARTS = 256
# What an operation is called that is none on intervals.
UNKNOWN = "unknown"

Operand: TypeAlias = "Term | float"


class Term:
    """The result of an operation on the time: its code and arguments, or bounds of a constant."""

    __slots__ = ("arguments", "bounds", "code")

    def __init__(
        self, code: str, *arguments: Term, bounds: tuple[float, float] = (0.0, 0.0)
    ) -> None:
        self.code, self.arguments, self.bounds = code, arguments, bounds

    @classmethod
    def of(cls, value: Operand) -> Term:
        """A term as it is, or a constant of the text, which may have been rounded."""
        if isinstance(value, Term):
            return value
        off = rounding_of(value)
        return constant(value - off, value + off)

    @property
    def is_zero(self) -> bool:
        return self.code == "constant" and self.bounds == (0.0, 0.0)

    def __neg__(self) -> Term:
        return self if self.is_zero else Term("negative", self)

    def __add__(self, other: Operand) -> Term:
        other = Term.of(other)
        if self.is_zero or other.is_zero:
            return other if self.is_zero else self
        return Term("sum", self, other)

    def __sub__(self, other: Operand) -> Term:
        return self + -Term.of(other)

    def __rsub__(self, other: float) -> Term:
        return -self + other

    def __mul__(self, other: Operand) -> Term:
        other = Term.of(other)
        if self.is_zero or other.is_zero:
            return constant(0.0, 0.0)
        return Term("square", self) if self is other else Term("product", self, other)

    def __truediv__(self, other: Operand) -> Term:
        return self * Term("inverse", Term.of(other))

    def __rtruediv__(self, other: float) -> Term:
        return Term.of(other) / self

    __radd__, __rmul__ = __add__, __mul__

    def _kink(self, _: Any) -> Term:
        return Term(UNKNOWN)

    __lt__ = __le__ = __gt__ = __ge__ = __and__ = __or__ = _kink


def constant(low: float, high: float) -> Term:
    return Term("constant", bounds=(float(low), float(high)))


class TermFunctions:
    """The functions that generated NumPy kernels call, of terms."""

    def __getattr__(self, name: str) -> Callable[..., Term]:
        return lambda *arguments: Term(UNKNOWN)

    @staticmethod
    def sqrt(x: Operand) -> Term:
        return Term("root", Term.of(x))

    @staticmethod
    def sin(x: Operand) -> Term:
        return Term("sine", Term.of(x))

    @staticmethod
    def cos(x: Operand) -> Term:
        return Term("cosine", Term.of(x))

    @staticmethod
    def exp(x: Operand) -> Term:
        return Term("exponential", Term.of(x))

    @staticmethod
    def log(x: Operand) -> Term:
        return Term("logarithm", Term.of(x))

    @staticmethod
    def arctan(x: Operand) -> Term:
        return Term("arctangent", Term.of(x))

    @classmethod
    def tan(cls, x: Operand) -> Term:
        return cls.sin(x) / cls.cos(x)

    @classmethod
    def arcsin(cls, x: Operand) -> Term:
        x = Term.of(x)
        return cls.arctan(x / cls.sqrt((1.0 - x) * (1.0 + x)))

    @classmethod
    def arccos(cls, x: Operand) -> Term:
        return np.pi / 2 - cls.arcsin(x)

    @classmethod
    def sinh(cls, x: Operand) -> Term:
        x = Term.of(x)
        return (cls.exp(x) - cls.exp(-x)) * 0.5

    @classmethod
    def cosh(cls, x: Operand) -> Term:
        x = Term.of(x)
        return (cls.exp(x) + cls.exp(-x)) * 0.5

    @classmethod
    def tanh(cls, x: Operand) -> Term:
        return 1.0 - 2.0 / (cls.exp(Term.of(x) * 2.0) + 1.0)

    @classmethod
    def arcsinh(cls, x: Operand) -> Term:
        x = Term.of(x)
        return cls.log(x + cls.sqrt(x * x + 1.0))

    @classmethod
    def arccosh(cls, x: Operand) -> Term:
        x = Term.of(x)
        return cls.log(x + cls.sqrt((x - 1.0) * (x + 1.0)))

    @classmethod
    def arctanh(cls, x: Operand) -> Term:
        x = Term.of(x)
        return cls.log((1.0 + x) / (1.0 - x)) * 0.5

    @classmethod
    def power(cls, base: Operand, exponent: Operand) -> Term:
        if isinstance(exponent, Term):
            return cls.exp(cls.log(Term.of(base)) * exponent)
        if exponent != int(exponent):
            return Term("power", Term.of(base), Term.of(exponent))
        power, n = Term.of(1.0), int(abs(exponent))
        for digit in f"{n:b}":
            power = power * power
            if digit == "1":
                power = power * base
        return power if exponent > 0 else 1.0 / power


class Numbers(list[Term]):
    """An argument or a result of a kernel, which is read as one of NumPy is, x[..., i]."""

    def __getitem__(self, at: Any) -> Any:
        return super().__getitem__(at[1])

    def __setitem__(self, at: Any, value: Operand) -> None:  # type: ignore[override]
        super().__setitem__(at[1], Term.of(value))


def terms_of(problem: Problem) -> tuple[list[tuple[Term, Term]], list[tuple[Term, Term]]]:
    """What the gap to each surface and its rate are where nothing else moves, and the same of
    tangents."""
    model, found = problem.model, list[list[tuple[Term, Term]]]()
    kernels = ("surface", "gap_rate", model.nc), ("tangent", "slide_rate", model.nt)
    names = [name for *both, _ in kernels for name in both]
    text = kernels_over(problem.kernels, TermFunctions(), names)
    still = Numbers([constant(0.0, 0.0)] * problem.nq)
    time, par = Numbers([Term("time")]), Numbers([constant(x, x) for x in model.par[0].tolist()])
    for of_place, of_rate, count in kernels:
        places, rates = (Numbers([constant(0.0, 0.0)] * count) for _ in range(2))
        if count:
            getattr(text, of_place)(still, time, par, places)
            getattr(text, of_rate)(still, still, time, par, rates)
        found.append(list(zip(list.__iter__(places), list.__iter__(rates), strict=True)))
    return found[0], found[1]


def _in_order(terms: Sequence[Term]) -> list[Term]:
    """All terms that some are made of, each behind its arguments."""
    ordered, left = dict[int, Term](), list(terms)
    while left:
        new = [a for a in left[-1].arguments if id(a) not in ordered]
        left += new
        if not new:
            term = left.pop()
            ordered[id(term)] = term
    return list(ordered.values())


def rates_of(terms: Sequence[Term]) -> list[Term]:
    """The derivatives of some terms by the time."""
    rates, F = dict[int, Term](), TermFunctions
    slopes: dict[str, Callable[..., Operand]] = {
        "negative": lambda _, a: -1.0,
        "square": lambda _, a: 2.0 * a,
        "inverse": lambda f, a: -(f * f),
        "root": lambda f, a: 0.5 / f,
        "sine": lambda _, a: F.cos(a),
        "cosine": lambda _, a: -F.sin(a),
        "exponential": lambda f, a: f,
        "logarithm": lambda _, a: 1.0 / a,
        "arctangent": lambda _, a: 1.0 / (1.0 + a * a),
        "power": lambda _, a, p: p * Term("power", a, p - 1.0),
    }
    for term in _in_order(terms):
        inner, own = term.arguments, [rates[id(a)] for a in term.arguments]
        match term.code:
            case "time":
                rate = Term.of(1.0)
            case "sum":
                rate = own[0] + own[1]
            case "product":
                rate = own[0] * inner[1] + inner[0] * own[1]
            case "constant":
                rate = Term.of(0.0)
            case code:
                rate = slopes[code](term, *inner) * own[0]
        rates[id(term)] = rate
    return [rates[id(term)] for term in terms]


def shifts_of(terms: Sequence[Term]) -> Shifts | None:
    """Some terms as operations; None where one of them is none on intervals."""
    numbers, rows, bounds = dict[int, int](), list[tuple[int, int, int]](), list[Any]()
    alike = dict[tuple[Any, ...], int]()
    for term in _in_order(terms):
        if term.code not in OPERATIONS:
            return None
        first, second = (*(numbers[id(a)] for a in term.arguments), 0, 0)[:2]
        row = OPERATIONS.index(term.code), first, second
        if (row, term.bounds) not in alike:
            alike[row, term.bounds] = len(rows)
            rows.append(row)
            bounds.append(term.bounds)
        numbers[id(term)] = alike[row, term.bounds]
    results = np.array([numbers[id(term)] for term in terms], dtype=int)
    operations = np.array(rows, dtype=int).reshape(-1, 3)
    return Shifts(operations, np.array(bounds, dtype=float).reshape(-1, 2), results)


def check_bounded(shifts: Shifts | None, name: str, latest: float) -> None:
    """Refuse what moves, with shifts that are its place and its speed, if they are no operations on
    intervals, or have no bounds.  Those of the first part of the time may be missing but for the
    place: derivatives of t**(3/2) have none at zero, where nothing is hit."""
    if shifts is None:
        raise ProblemError(
            f"the gap to {name} changes with the time by a function that proofs have no bounds of, "
            "such as Abs, Piecewise or atan2: they cover sums, products, quotients, powers, "
            "exponential, trigonometric and hyperbolic functions and their inverses."
        )
    check_size(shifts, name)
    times = np.linspace(0, latest, PARTS + 1).tolist()
    for low, high in pairwise(times):
        bounds = enclosed(shifts, low, high)
        if not np.isfinite(bounds if low > 0 else bounds[0, 3]).all():
            raise ProblemError(
                f"the motion of {name} has no bounds from {low:.4g} to {high:.4g} s: proofs need "
                "intervals that contain its place and three derivatives by the time, until the "
                "latest final time."
            )


def check_size(shifts: Shifts, name: str) -> None:
    """Refuse what takes more operations or shifts than there is room for."""
    most, operations = LIMITS_OF_SHIFTS
    if len(shifts.operations) > operations or len(shifts.results) > most:
        raise ProblemError(
            f"the motion of {name} takes {len(shifts.operations)} operations: proofs take at most "
            f"{operations} of all surfaces that move, and {most // 2} such surfaces."
        )


def values_of(shifts: Shifts, time: float) -> Array:
    """The shifts at a time, shape (shifts,)."""
    with np.errstate(invalid="ignore"):  # a speed may have no bounds at the start
        return np.asarray(enclosed(shifts, time, time)[:, 0].mean(axis=1))
