"""Balls: arrays of real numbers, each known up to a radius, with rounding errors counted.

A ball (m, r) stands for all numbers from m - r to m + r.  What is made of balls contains what is
made of any numbers in them.  The middle of a result is what floating point makes of the middles;
its radius is what the radii can change, and more than the rounding error.  A result without bounds
(a root of what may be negative, a division by what may be zero) has an infinite radius or is no
number, and so has everything that is made of it.
"""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import numpy as np

# The rounding error of an operation is at most this share of its result, in whichever direction
# the processor rounds.
ROUNDED = 2.0**-52
# Radii are computed with rounding errors, too: a few operations, each within half of the above.
ENLARGED = 1 + 2.0**-48
# More than what is lost where a result is too small to have all its digits.
LEAST = 2.0**-1000
# Errors of functions of the C library and of NumPy, of which at most four units in the last place
# are known, relative to the result, or absolute for sine and cosine.
OF_FUNCTIONS = 2.0**-49
# A constant with more than 24 digits was rounded, and those that were made of it once more.
OF_CONSTANTS = 2.0**-50

Operand: TypeAlias = "Ball | float"


class Ball:
    """An array of balls: middles and radii, which broadcast to one shape."""

    __slots__ = ("m", "r")
    __array_ufunc__ = None  # so that numbers of NumPy leave operations to balls

    def __init__(self, m: Any, r: Any = 0.0) -> None:
        self.m, self.r = m, r

    @classmethod
    def of(cls, value: Operand) -> Ball:
        """A ball as it is, or one around a constant."""
        if isinstance(value, Ball):
            return value
        return cls(value, rounding_of(value))

    @classmethod
    def rounded(cls, m: Any, r: Any, error: float = ROUNDED) -> Ball:
        """A result whose middle has a relative error."""
        return cls(m, (r + np.abs(m) * error) * ENLARGED + LEAST)

    @property
    def most(self) -> Any:
        """No number in it is larger in magnitude."""
        return (np.abs(self.m) + self.r) * ENLARGED

    @property
    def low(self) -> Any:
        """No number in it is smaller."""
        return below(self.m - self.r)

    @property
    def high(self) -> Any:
        """No number in it is larger."""
        return -below(-self.m - self.r)

    def __getitem__(self, at: Any) -> Ball:
        return Ball(self.m[at], self.r[at])

    def __setitem__(self, at: Any, value: Operand) -> None:
        value = Ball.of(value)
        self.m[at], self.r[at] = value.m, value.r

    def __neg__(self) -> Ball:
        return Ball(-self.m, self.r)

    def __add__(self, other: Operand) -> Ball:
        other = Ball.of(other)
        return Ball.rounded(self.m + other.m, self.r + other.r)

    def __sub__(self, other: Operand) -> Ball:
        other = Ball.of(other)
        return Ball.rounded(self.m - other.m, self.r + other.r)

    def __rsub__(self, other: float) -> Ball:
        return -self + other

    def __mul__(self, other: Operand) -> Ball:
        other = Ball.of(other)
        size = np.abs(other.m) + other.r
        return Ball.rounded(self.m * other.m, np.abs(self.m) * other.r + self.r * size)

    def __truediv__(self, other: Operand) -> Ball:
        return _divided(self, Ball.of(other))

    def __rtruediv__(self, other: float) -> Ball:
        return _divided(Ball.of(other), self)

    __radd__, __rmul__ = __add__, __mul__

    def __lt__(self, other: Operand) -> Truth:
        apart, off = self._apart(other)
        return Truth(apart < -off, apart >= off)

    def __le__(self, other: Operand) -> Truth:
        apart, off = self._apart(other)
        return Truth(apart <= -off, apart > off)

    def __gt__(self, other: Operand) -> Truth:
        return Ball.of(other) < self

    def __ge__(self, other: Operand) -> Truth:
        return Ball.of(other) <= self

    def __eq__(self, other: Any) -> Truth:  # type: ignore[override]
        apart, off = self._apart(other)
        return Truth((apart == 0) & (off == 0), np.abs(apart) > off)

    def __ne__(self, other: Any) -> Truth:  # type: ignore[override]
        same = self == other
        return Truth(same.never, same.always)

    def _apart(self, other: Operand) -> tuple[Any, Any]:
        """How far two middles are apart, and more than what both radii and rounding can change of
        it, which is nothing where there are no radii."""
        other = Ball.of(other)
        return self.m - other.m, (self.r + other.r) * ENLARGED

    __hash__ = None  # type: ignore[assignment]


class Truth:
    """Conditions on balls: where they hold for all numbers, and where for none."""

    __slots__ = ("always", "never")

    def __init__(self, always: Any, never: Any) -> None:
        self.always, self.never = always, never

    def __and__(self, other: Truth) -> Truth:
        return Truth(self.always & other.always, self.never | other.never)

    def __or__(self, other: Truth) -> Truth:
        return Truth(self.always | other.always, self.never & other.never)


def rounding_of(constant: float) -> float:
    """What rounding may have taken from a constant of the text."""
    few_digits = (math.frexp(constant)[0] * 2.0**24).is_integer()
    return 0.0 if few_digits else abs(constant) * OF_CONSTANTS


def below(x: Any) -> Any:
    """Numbers below those whose rounded values are x."""
    return x - (np.abs(x) * (2 * ROUNDED) + LEAST)


def _divided(a: Ball, b: Ball) -> Ball:
    # x/y - a/b = (x - a)/y - (a/b) (y - b)/y
    m, least = a.m / b.m, np.abs(b.m) - b.r
    r = np.where(least > 0, (a.r + np.abs(m) * b.r) / least, np.inf)
    return Ball.rounded(m, r)


def _root(x: Ball) -> Ball:
    m = np.sqrt(x.m)
    # |sqrt x - sqrt m| = |x - m|/(sqrt x + sqrt m)
    r = np.where(x.r == 0, 0.0, x.r / m)
    return Ball.rounded(m, np.where(x.m >= x.r, r, np.inf))


def _steepest(m: Any, x: Ball, slope: Any, error: float = OF_FUNCTIONS) -> Ball:
    """A function whose slope over the ball x is at most ``slope``, where that is a number."""
    return Ball.rounded(m, np.where(x.r == 0, 0.0, x.r * slope), error)


def _wave(m: Any, x: Ball) -> Ball:
    return Ball(m, (x.r + OF_FUNCTIONS) * ENLARGED)


def _within(x: Ball) -> Any:
    """The least 1 - x^2 over a ball, 0 where that may be negative."""
    most = x.most
    return np.maximum(below((1 - most) * (1 + most)), 0.0)


class BallFunctions:
    """The functions that generated NumPy kernels call, of balls."""

    @staticmethod
    def where(condition: Truth, value: Operand, otherwise: Operand) -> Ball:
        a, b = Ball.of(value), Ball.of(otherwise)
        hull = np.maximum(np.abs(b.m - a.m) * ENLARGED + b.r, a.r)  # around a
        m = np.where(condition.never, b.m, a.m)
        r = np.where(condition.always, a.r, np.where(condition.never, b.r, hull * ENLARGED))
        return Ball(m, r + LEAST)

    @staticmethod
    def sqrt(x: Ball) -> Ball:
        return _root(x)

    @staticmethod
    def sin(x: Ball) -> Ball:
        return _wave(np.sin(x.m), x)

    @staticmethod
    def cos(x: Ball) -> Ball:
        return _wave(np.cos(x.m), x)

    @classmethod
    def tan(cls, x: Ball) -> Ball:
        return cls.sin(x) / cls.cos(x)

    @staticmethod
    def arcsin(x: Ball) -> Ball:
        return _steepest(np.arcsin(x.m), x, 1 / np.sqrt(_within(x)))

    @staticmethod
    def arccos(x: Ball) -> Ball:
        return _steepest(np.arccos(x.m), x, 1 / np.sqrt(_within(x)))

    @staticmethod
    def arctan(x: Ball) -> Ball:
        return _steepest(np.arctan(x.m), x, 1.0)

    @staticmethod
    def arctan2(y: Operand, x: Operand) -> Ball:
        a, b = Ball.of(y), Ball.of(x)
        off = np.hypot(a.r, b.r) * ENLARGED
        apart = below(below(np.hypot(a.m, b.m)) - off)  # from the origin
        jumps = (b.low <= 0) & (a.low <= 0) & (a.high >= 0)
        r = np.where((apart > 0) & ~jumps, off / apart, np.inf)
        return Ball.rounded(np.arctan2(a.m, b.m), r, OF_FUNCTIONS)

    @staticmethod
    def sinh(x: Ball) -> Ball:
        return _steepest(np.sinh(x.m), x, np.cosh(x.most) * (1 + OF_FUNCTIONS))

    @staticmethod
    def cosh(x: Ball) -> Ball:
        return _steepest(np.cosh(x.m), x, np.cosh(x.most) * (1 + OF_FUNCTIONS))

    @staticmethod
    def tanh(x: Ball) -> Ball:
        return _steepest(np.tanh(x.m), x, 1.0)

    @staticmethod
    def arcsinh(x: Ball) -> Ball:
        return _steepest(np.arcsinh(x.m), x, 1.0)

    @staticmethod
    def arccosh(x: Ball) -> Ball:
        least = np.maximum(below((x.low - 1) * (x.low + 1)), 0.0)
        least = np.where(x.low > 1, least, 0.0)
        return _steepest(np.arccosh(x.m), x, 1 / np.sqrt(least))

    @staticmethod
    def arctanh(x: Ball) -> Ball:
        return _steepest(np.arctanh(x.m), x, 1 / _within(x))

    @staticmethod
    def exp(x: Ball) -> Ball:
        return _steepest(np.exp(x.m), x, np.exp(x.high) * (1 + OF_FUNCTIONS))

    @staticmethod
    def log(x: Ball) -> Ball:
        return _steepest(np.log(x.m), x, 1 / np.maximum(x.low, 0.0))

    @classmethod
    def power(cls, base: Operand, exponent: Operand) -> Ball:
        if isinstance(exponent, Ball) or exponent != int(exponent):
            return cls.exp(cls.log(Ball.of(base)) * exponent)
        power, n = Ball.of(1.0), int(abs(exponent))
        for digit in f"{n:b}":
            power = power * power
            if digit == "1":
                power = power * base
        return power if exponent > 0 else 1.0 / power
