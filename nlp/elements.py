"""From terms to the plain arrays of a program: values, first and second derivatives, patterns,
units.

Every term is a kernel family: ``name`` for values, ``name_jac`` and ``name_hess`` for derivatives
with respect to all its arguments.  The columns of a derivative are the arguments' positions in the
pool, where these are unknowns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dmoc.codegen.kernels import Array, Kernels
from dmoc.nlp.program import ElementData, PassData, ProgramData
from dmoc.nlp.sparse import SparsePattern
from dmoc.nlp.tables import NOWHERE, Index
from dmoc.nlp.terms import COST, Term


@dataclass(frozen=True, eq=False)
class Linear:
    """The linear part of (c | d): factors * x[columns] added to rows, and constants of all rows."""

    rows: Index
    columns: Index
    factors: Array
    constants: Array


@dataclass(frozen=True, eq=False)
class Statement:
    """What a program is made of.

    Attributes
    ----------
    kernels : Kernels
    parameters : array, shape (npar,)
    terms : sequence of Term
    linear : Linear
    equalities : int
        Number of rows c.
    lower, upper : arrays, shape (n,)
        Bounds of the scaled unknowns.
    unit : array, shape (n,)
        Sizes of the unknowns.
    row_unit : array, shape (m,)
        Sizes of the constraints.
    cost_unit : float
    """

    kernels: Kernels
    parameters: Array
    terms: Sequence[Term]
    linear: Linear
    equalities: int
    lower: Array
    upper: Array
    unit: Array
    row_unit: Array
    cost_unit: float

    @property
    def n(self) -> int:
        return len(self.unit)

    @property
    def m(self) -> int:
        return len(self.row_unit)

    @property
    def inverse(self) -> Array:
        """Inverse sizes of (f | c | d)."""
        return 1 / np.concatenate([[self.cost_unit], self.row_unit])


@dataclass(frozen=True, eq=False)
class Assembled:
    """A program and the patterns of its derivatives."""

    data: ProgramData
    jacobian: SparsePattern
    hessian: SparsePattern


@dataclass(frozen=True, eq=False)
class _Part:
    """Derivatives of a term before their slots are known: positions in (f | c | d) or rows of
    the Hessian, columns, factors, for each result."""

    kernel: str
    arguments: tuple[Index, ...]
    rows: tuple[Index, ...]
    columns: tuple[Index, ...]
    factors: tuple[Array, ...]


def assembled(s: Statement) -> Assembled:
    """Lay the program out: its three passes over elements, with slots in patterns that are
    analysed here."""
    inverse, none = s.inverse, np.zeros(0, dtype=np.intp)
    linear = s.linear.factors * inverse[1 + s.linear.rows]
    values = PassData(
        np.concatenate([[0.0], s.linear.constants * inverse[1:]]),
        1 + s.linear.rows,
        s.linear.columns,
        linear,
        tuple(_values(s, term, inverse) for term in s.terms),
    )
    slopes = [_slopes(s, term, inverse) for term in s.terms]
    cells = [(r - 1, c) for p in slopes for r, c in zip(p.rows, p.columns, strict=True)]
    jacobian = SparsePattern((s.m, s.n), [*cells, (s.linear.rows, s.linear.columns)])
    *slots, linear_slots = jacobian.slots
    constant = np.zeros(s.n + jacobian.size)
    constant[s.n + linear_slots] = linear * s.unit[s.linear.columns]
    # The gradient of f first, dense, then the entries of the Jacobian.
    at = [
        np.where(r == -1, c, np.where(k >= 0, s.n + k, NOWHERE))
        for k, (r, c) in zip(slots, cells, strict=True)
    ]
    to_slopes = PassData(constant, none, none, np.zeros(0), _elements(slopes, at))
    curvatures = [p for p in (_curvatures(s, term) for term in s.terms) if p is not None]
    hessian = SparsePattern((s.n, s.n), [(p.rows[0], p.columns[0]) for p in curvatures])
    to_curvatures = PassData(
        np.zeros(hessian.size), none, none, np.zeros(0), _elements(curvatures, hessian.slots)
    )
    data = ProgramData(
        equalities=s.equalities,
        lower=s.lower,
        upper=s.upper,
        unit=np.concatenate([s.unit, inverse[1:], inverse[:1]]),
        pool=np.concatenate([np.zeros(s.n + s.m + 2), s.parameters]),
        values=values,
        slopes=to_slopes,
        curvatures=to_curvatures,
        jacobian=(jacobian.indptr, jacobian.indices),
        hessian=(hessian.indptr, hessian.indices),
    )
    return Assembled(data, jacobian, hessian)


def _parameters(s: Statement) -> Index:
    """Positions of the parameters in the pool."""
    first = s.n + s.m + 2
    return np.arange(first, first + len(s.parameters))[None]


def _targets(rows: Index) -> Index:
    """Positions in (f | c | d) of rows of (c | d)."""
    return np.where(rows == COST, 0, np.where(rows == NOWHERE, NOWHERE, rows + 1))


def _values(s: Statement, term: Term, inverse: Array) -> ElementData:
    slots = tuple(_targets(r) for r in term.rows)
    factors = tuple(np.broadcast_to(term.factor, t.shape) * inverse[t] for t in slots)
    return ElementData(term.kernel, (*term.arguments, _parameters(s)), slots, factors)


def _unknowns(s: Statement, term: Term) -> Index:
    """The unknowns among the arguments of a term, shape (n, sum of sizes); NOWHERE for what is
    none."""
    n = len(term.rows[0])
    at = np.hstack([np.broadcast_to(a, (n, a.shape[1])) for a in term.arguments])
    return np.where(at < s.n, at, NOWHERE)


def _slopes(s: Statement, term: Term, inverse: Array) -> _Part:
    kernel, unknowns = f"{term.kernel}_jac", _unknowns(s, term)
    rows, columns, factors = [], [], []
    for output, targets in zip(s.kernels.outputs(kernel), map(_targets, term.rows), strict=True):
        i, j = s.kernels.pattern(kernel, output)
        column = unknowns[:, j]
        row = np.where(column == NOWHERE, NOWHERE, targets[:, i])
        rows.append(np.where(row == NOWHERE, NOWHERE, row))
        columns.append(column)
        factors.append(np.broadcast_to(term.factor, row.shape) * inverse[row] * s.unit[column])
    return _Part(
        kernel, (*term.arguments, _parameters(s)), tuple(rows), tuple(columns), tuple(factors)
    )


def _curvatures(s: Statement, term: Term) -> _Part | None:
    """Second derivatives of a term, weighted with the multipliers of its rows.

    Two arguments may be one unknown (inputs that are constant in a step): their mixed derivative
    counts twice on the diagonal.
    """
    kernel, unknowns = f"{term.kernel}_hess", _unknowns(s, term)
    i, j = s.kernels.pattern(kernel, "hess")
    if not len(i):
        return None
    a, b = unknowns[:, i], unknowns[:, j]
    lost = (a == NOWHERE) | (b == NOWHERE)
    factor = (
        np.broadcast_to(term.factor, a.shape)
        * np.where((a == b) & (i != j), 2.0, 1.0)
        * s.unit[a]
        * s.unit[b]
    )
    arguments = (*term.arguments, _parameters(s), *(_multipliers(s, r) for r in term.rows))
    rows = np.where(lost, NOWHERE, np.minimum(a, b))
    return _Part(kernel, arguments, (rows,), (np.maximum(a, b),), (factor,))


def _multipliers(s: Statement, rows: Index) -> Index:
    """Positions of the multipliers of rows: sigma for the cost, a zero where there is no row."""
    sigma, zero = s.n + s.m, s.n + s.m + 1
    return np.where(rows == COST, sigma, np.where(rows == NOWHERE, zero, s.n + rows))


def _elements(parts: Sequence[_Part], slots: Sequence[Index]) -> tuple[ElementData, ...]:
    remaining = iter(slots)
    return tuple(
        ElementData(p.kernel, p.arguments, tuple(next(remaining) for _ in p.rows), p.factors)
        for p in parts
    )
