"""Values and derivatives of a program at scaled unknowns; the last point is remembered."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from copy import copy
from functools import cached_property
from typing import Any, Self, TypeAlias

import numpy as np

from dmoc.codegen.kernels import Array, Kernels
from dmoc.program.assembly import Program
from dmoc.program.elements import Assembled

Matrix: TypeAlias = Any  # a SciPy CSR matrix; SciPy ships no type information


class Evaluator(ABC):
    """Evaluates (f | c | d)(x) of a program and its derivatives.

    Unknowns x have the shape (n,), multipliers y (n_eq,) and w (n_in,); all are scaled.  A subclass
    says what the program is made of.
    """

    kernels: Kernels
    n: int
    n_eq: int
    n_in: int

    @abstractmethod
    def assemble(self) -> Assembled:
        """Lay the program out."""

    @cached_property
    def assembled(self) -> Assembled:
        """The program and the patterns of its derivatives."""
        return self.assemble()

    @cached_property
    def program(self) -> Program:
        """The program in the form of the compiled method."""
        data = self.assembled.data

        def made() -> Program:
            return Program(self.kernels, data)

        first = self.assembled.structure.once("program", made)
        return first if first.data is data else Program(self.kernels, data, first)

    def beside(self) -> Self:
        """The same program for another thread."""
        other = copy(self)
        other.__dict__.pop("_memory", None)
        other.__dict__["program"] = Program(self.kernels, self.assembled.data, self.program)
        return other

    @cached_property
    def analyses(self) -> dict[str, Any]:
        """Results of the methods' analyses of the program's structure, by the names of the
        methods."""
        return {}

    @cached_property
    def _memory(self) -> dict[str, tuple[bytes, Array]]:
        """The last point of each function, by its digits, and what was found there."""
        return {}

    def _remembered(self, name: str, evaluate: Callable[[Array], Array], x: Array) -> Array:
        last, point = self._memory.get(name), x.tobytes()
        if last is None or last[0] != point:
            value = evaluate(np.ascontiguousarray(x))
            value.flags.writeable = False
            last = self._memory[name] = point, value
        return last[1]

    def values(self, x: Array) -> Array:
        """(f | c | d)(x), shape (1 + n_eq + n_in,), at x, shape (n,); read-only."""
        return self._remembered("values", self.program.values, x)

    def slopes(self, x: Array) -> Array:
        """The gradient of f at x, shape (n,), then the entries of d(c | d)/dx by rows, shape (n +
        entries,); read-only."""
        return self._remembered("slopes", self.program.slopes, x)

    def cost(self, x: Array) -> float:
        """Scaled cost f at x, shape (n,)."""
        return float(self.values(x)[0])

    def cost_gradient(self, x: Array) -> Array:
        """Gradient of f at x, shape (n,)."""
        return self.slopes(x)[: self.n]

    def equality(self, x: Array) -> Array:
        """c(x), shape (n_eq,)."""
        return self.values(x)[1 : 1 + self.n_eq]

    def equality_slopes(self, x: Array) -> Array:
        """Entries of dc/dx at x, shape (n,), by rows, shape (entries of dc/dx,)."""
        pattern = self.assembled.jacobian
        return self.slopes(x)[self.n :][: pattern.indptr[self.n_eq]]

    def equality_jacobian(self, x: Array) -> Matrix:
        """dc/dx, shape (n_eq, n)."""
        return self.assembled.jacobian.matrix(self.slopes(x)[self.n :], 0, self.n_eq)

    def inequality(self, x: Array) -> Array:
        """d(x) >= 0, shape (n_in,)."""
        return self.values(x)[1 + self.n_eq :]

    def inequality_slopes(self, x: Array) -> Array:
        """Entries of dd/dx at x, shape (n,), by rows, shape (entries of dd/dx,)."""
        pattern = self.assembled.jacobian
        return self.slopes(x)[self.n :][pattern.indptr[self.n_eq] :]

    def inequality_jacobian(self, x: Array) -> Matrix:
        """dd/dx, shape (n_in, n)."""
        return self.assembled.jacobian.matrix(self.slopes(x)[self.n :], self.n_eq)

    def lagrangian_gradient(self, x: Array, y: Array, w: Array) -> Array:
        """Gradient of f + y . c - w . d, shape (n,)."""
        pattern, slopes = self.assembled.jacobian, self.slopes(x)
        return slopes[: self.n] + pattern.transposed_times(
            slopes[self.n :], np.concatenate([y, -w])
        )

    def lagrangian_hessian(self, x: Array, y: Array, w: Array, sigma: float = 1.0) -> Matrix:
        """Upper triangle of the Hessian of sigma f + y . c - w . d, shape (n, n)."""
        values = self.program.curvatures(np.ascontiguousarray(x), np.concatenate([y, -w]), sigma)
        return self.assembled.hessian.matrix(values)
