"""Many problems of one form: the numbers of their programs as rows."""

from __future__ import annotations

from typing import Any

import numpy as np

from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.program.arrays import ProgramData
from dmoc.program.assembly import on_limits
from dmoc.program.bounds import limits
from dmoc.program.elements import assembled, doubled
from dmoc.program.scaling import scale_of_rows
from dmoc.program.stacked import Stacked
from dmoc.program.transcription import ON_LIMIT, Transcription


@record(frozen=True, eq=False)
class RowNumbers:
    """Numbers of R programs of one form: what :class:`dmoc.program.elements.Numbers` has, with a
    leading axis for the programs where they differ.

    ``limits`` are the bounds of the unknowns in units of the problem, shape (R, n) each; ``rate``
    and ``p`` are the sizes of the rates of gaps and of momenta.
    """

    parameters: Array  # (R, npar)
    constants: Array  # (R, m)
    limits: tuple[Array, Array]
    sizes: Array  # (R, n)
    row_sizes: Array  # (R, m)
    cost: Array  # (R,)
    rate: Array  # (R, nc)
    p: Array  # (R, nq)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of the scaled unknowns, shape (R, n) each."""
        lower, upper = (limit / self.sizes for limit in self.limits)
        return lower, upper

    def physical(self, x: Array) -> Array:
        """Unknowns in units of the problem from scaled ones, shape (R, n) each, as
        :meth:`Transcription.physical` has them."""
        low, high = (limit.ravel() for limit in self.limits)
        return on_limits(x.ravel(), self.sizes.ravel(), low, high, ON_LIMIT).reshape(x.shape)


def row_numbers(problems: Stacked, nlp: Transcription, x: Array, minimum: bool) -> RowNumbers:
    """The numbers of R problems of one form, of which one has the program ``nlp``, in the sizes of
    their unknowns x, shape (R, n), of first motions or of minima."""
    lay, count = nlp.layout, len(problems.each)
    scale = scale_of_rows(problems, lay, x, minimum)
    constants = np.tile(nlp.numbers.constants, (count, 1))
    for row, values in nlp.laws.ends.constants_of(problems).items():
        constants[:, row] = values
    blocks = (*nlp.laws.equalities, *nlp.laws.inequalities)
    return RowNumbers(
        problems.parameter_values.reshape(count, -1), constants,
        limits(problems, lay, nlp.laws, scale, ()), lay.sizes(scale),
        nlp.laws.remembered.sizes(blocks, scale), np.asarray(scale.cost), scale.rate, scale.p,
    )  # fmt: skip


@record(frozen=True, eq=False)
class RowPrograms:
    """What compiled code takes of the rows of one form: a program whose numbers are those of one
    row after the other, the factors of its three passes with the numbers that they are products of,
    and the numbers of the rows."""

    data: ProgramData
    elements: list[tuple[Any, ...]]
    rows: tuple[Array, ...]

    @classmethod
    def of(cls, nlp: Transcription, numbers: RowNumbers) -> RowPrograms:
        """The programs of rows of which one has the program ``nlp``."""
        structure, own = nlp.structure, nlp.numbers
        data, at = assembled(structure, own).data, structure.form.linear
        count, n = numbers.sizes.shape
        inverse = 1 / np.concatenate([numbers.cost[:, None], numbers.row_sizes], axis=1)
        linear = own.coefficients * inverse[:, structure.linear_rows]
        constant = numbers.constants * inverse[:, 1:]
        slope = np.zeros((count, len(data.slopes.constant)))
        slope[:, n + structure.linear_slots] = linear * numbers.sizes[:, at.columns]
        sizes = np.concatenate([numbers.sizes, inverse[:, 1:], inverse[:, :1]], axis=1)
        values = np.concatenate([np.zeros((count, 1)), constant], axis=1)
        rows = *numbers.bounds, sizes, inverse, values, linear, slope, numbers.parameters
        parts = structure.once("products", structure.products)
        factors = doubled(own.factors)
        passes = data.values, data.slopes, data.curvatures
        elements = [
            (p.factors, left, right, factors[places])
            for p, (left, right, places) in zip(passes, parts, strict=True)
        ]
        return cls(data, elements, tuple(np.ascontiguousarray(row) for row in rows))
