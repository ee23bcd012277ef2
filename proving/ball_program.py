"""A nonlinear program in balls: its values and derivatives with rounding errors counted.

The numbers of the program that were rounded when it was scaled are balls, too: what is enclosed is
the program in the problem's units, divided by the sizes of its unknowns and rows.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.program.arrays import ElementData, PassData
from dmoc.program.blocks import Index
from dmoc.program.transcription import Transcription
from dmoc.proving.balls import ENLARGED, LEAST, ROUNDED, Ball, BallFunctions
from dmoc.proving.kernel_text import kernels_over

# Products of up to four numbers stand in the factors of elements and in constants.
OF_FACTORS = 4 * ROUNDED


class BallProgram:
    """The passes of a program (:mod:`dmoc.program.arrays`) over balls."""

    def __init__(self, nlp: Transcription) -> None:
        self.nlp, self.data = nlp, nlp.assembled.data
        self.kernels = kernels_over(nlp.kernels, BallFunctions)

    def values(self, pool: Ball) -> Ball:
        """(f | c | d), shape (1 + m,)."""
        return self._pass(self.data.values, pool)

    def slopes(self, pool: Ball) -> Ball:
        """The gradient of f, then the entries of d(c | d)/dx, shape (n + entries,)."""
        return self._pass(self.data.slopes, pool)

    def curvatures(self, pool: Ball) -> Ball:
        """The upper triangle of the Hessian of f + y . (c | d), shape (entries,)."""
        return self._pass(self.data.curvatures, pool)

    def pool(self, x: Ball, y: Ball, held: Array) -> Ball:
        """What the elements read at scaled unknowns x, shape (n,), and multipliers y, shape (m,);
        where ``held``, shape (n,), is a number, the unknown is that in the problem's units."""
        both = Ball(np.concatenate([x.m, y.m, [1.0]]), np.concatenate([x.r, y.r, [0.0]]))
        ours = both * Ball(self.data.sizes, self._inverse)
        at, fixed = len(self.data.sizes), ~np.isnan(held)
        pool = Ball(self.data.pool.copy(), np.zeros(len(self.data.pool)))
        pool[:at] = ours
        pool[: len(held)][fixed] = Ball(held[fixed], np.zeros(fixed.sum()))
        return pool

    @cached_property
    def _inverse(self) -> Array:
        """Errors of the sizes: those of rows are inverses that were rounded."""
        errors = ROUNDED * self.data.sizes
        errors[: self.nlp.n] = 0.0
        return errors

    def _pass(self, data: PassData, pool: Ball) -> Ball:
        size = len(data.constant)
        total = Sum(size)
        constant = np.flatnonzero(data.constant)
        total.add(
            constant, Ball(data.constant[constant], OF_FACTORS * np.abs(data.constant[constant]))
        )
        if len(data.rows):
            factors = Ball(data.coefficients, OF_FACTORS * np.abs(data.coefficients))
            total.add(data.rows, pool[data.columns] * factors)
        for element in data.elements:
            self._add(element, pool, total)
        return total.result

    def _add(self, element: ElementData, pool: Ball, total: Sum) -> None:
        arguments = [pool[at] for at in element.arguments]
        results = [Ball(np.zeros(at.shape), np.zeros(at.shape)) for at in element.slots]
        getattr(self.kernels, element.kernel)(*arguments, *results)
        for result, at, factor in zip(results, element.slots, element.factors, strict=True):
            kept = at >= 0
            total.add(at[kept], result[kept] * _factors(factor[kept]))


def _factors(values: Array) -> Ball:
    return Ball(values, OF_FACTORS * np.abs(values))


class Sum:
    """Sums of balls into slots."""

    def __init__(self, size: int) -> None:
        self._m, self._r, self._most = np.zeros(size), np.zeros(size), np.zeros(size)
        self._count = np.zeros(size)

    def add(self, at: Index, terms: Ball) -> None:
        size = len(self._m)
        self._m += np.bincount(at, terms.m, size)
        self._r += np.bincount(at, terms.r, size)
        self._most += np.bincount(at, np.abs(terms.m), size)
        self._count += np.bincount(at, minlength=size)

    @property
    def result(self) -> Ball:
        """The error of a sum is at most that of so many additions of the magnitudes."""
        count = self._count + 2
        r = self._r + count * ROUNDED * self._most
        return Ball(self._m, r * (1 + count * ROUNDED) * ENLARGED + LEAST)
