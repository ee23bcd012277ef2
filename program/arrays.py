"""A nonlinear program as plain arrays: what the compiled program reads, and all that it reads.

Values, first and second derivatives are three passes over elements.  An element is n rows of one
kernel, whose arguments are collected from one vector, the pool::

    pool = (x | y | sigma | 0 | parameters | shares of a step)

with the unknowns x, the multipliers y of (c | d) and the weight sigma of the cost, each multiplied
by its unit.  Results times their factors are added to slots of the target.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dmoc.base.records import record
from dmoc.codegen.kernels import Array

Positions = NDArray[np.intp]
Pattern = tuple[NDArray[np.int32], NDArray[np.int32]]


@record(frozen=True, eq=False)
class ElementPlaces:
    """n rows of a kernel: where its arguments are, and where its results go."""

    kernel: str
    # Where each argument stands in the pool, (n, size); one row of consecutive positions (1, size)
    # serves all n.
    arguments: tuple[Positions, ...]
    slots: tuple[Positions, ...]  # (n, size): what each result is added to; -1 drops a value


@record(frozen=True, eq=False)
class ElementData(ElementPlaces):
    """Element places and the factors of their values."""

    factors: tuple[Array, ...]  # (n, size)


@record(frozen=True, eq=False)
class PassData:
    """target = constant + linear part + elements; target[rows] += coefficients * pool[columns].

    Problems of one form share places; ``factors`` are those of all results, one after the other.
    """

    constant: Array
    rows: Positions
    columns: Positions
    coefficients: Array
    places: tuple[ElementPlaces, ...]
    factors: Array

    @cached_property
    def elements(self) -> tuple[ElementData, ...]:
        """The elements one by one."""
        elements, at = [], 0
        for place in self.places:
            cut = []
            for slot in place.slots:
                cut.append(self.factors[at : at + slot.size].reshape(slot.shape))
                at += slot.size
            elements.append(ElementData(place.kernel, place.arguments, place.slots, tuple(cut)))
        return tuple(elements)


@record(frozen=True, eq=False)
class ProgramData:
    """Minimise f subject to c = 0, d >= 0, lower <= x <= upper."""

    equalities: int  # rows c; the others of the m rows (c | d) are inequalities
    lower: Array  # (n,), as upper
    upper: Array
    # What x, y and sigma are multiplied by (n + m + 1,): the sizes of the unknowns, the inverse
    # sizes of the constraints and that of the cost.
    sizes: Array
    pool: Array  # as it is before the first evaluation: zeros, parameters, and shares
    values: PassData  # to (f | c | d)
    slopes: PassData  # to the gradient of f, dense, and the entries of d(c | d)/dx
    curvatures: PassData  # to the upper triangle of the Hessian of sigma f + y . (c | d)
    # Patterns of d(c | d)/dx and of the Hessian in CSR form: starts of the rows, columns.
    jacobian: Pattern
    hessian: Pattern

    @property
    def n(self) -> int:
        return len(self.lower)

    @property
    def m(self) -> int:
        return len(self.values.constant) - 1

    @property
    def first_parameter(self) -> int:
        """Where the parameters begin in the pool."""
        return self.n + self.m + 2
