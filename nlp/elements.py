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
from dmoc.nlp.terms import Term


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
    targets, multipliers = _targets(s), _multipliers(s)
    linear = s.linear.factors * inverse[1 + s.linear.rows]
    values = PassData(
        np.concatenate([[0.0], s.linear.constants * inverse[1:]]),
        1 + s.linear.rows,
        s.linear.columns,
        linear,
        tuple(_values(s, term, targets, inverse) for term in s.terms),
    )
    unknowns = [_unknowns(s, term) for term in s.terms]
    placed = list(zip(s.terms, unknowns, strict=True))
    slopes = [_slopes(s, term, at, targets, inverse) for term, at in placed]
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
    every = (_curvatures(s, term, at, multipliers) for term, at in placed)
    curvatures = [p for p in every if p is not None]
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


def _targets(s: Statement) -> Index:
    """Positions in (f | c | d) by row of (c | d); where COST and NOWHERE point to, at the end,
    theirs stand."""
    return np.concatenate([np.arange(1, s.m + 1), [0, NOWHERE]])


def _multipliers(s: Statement) -> Index:
    """Positions in the pool of the multipliers of rows: sigma for the cost, a zero for no row."""
    return np.arange(s.n, s.n + s.m + 2)


def _values(s: Statement, term: Term, targets: Index, inverse: Array) -> ElementData:
    slots = tuple(targets[r] for r in term.rows)
    factors = tuple(inverse[t] * term.factor for t in slots)
    return ElementData(term.kernel, (*term.arguments, _parameters(s)), slots, factors)


def _unknowns(s: Statement, term: Term) -> Index:
    """The unknowns among the arguments of a term, shape (n, sum of sizes); NOWHERE for what is
    none."""
    n = len(term.rows[0])
    parts = (a if len(a) == n else np.repeat(a, n, axis=0) for a in term.arguments)
    at = np.hstack(list(parts))
    return np.where(at < s.n, at, NOWHERE)


def _slopes(s: Statement, term: Term, unknowns: Index, targets: Index, inverse: Array) -> _Part:
    kernel = f"{term.kernel}_jac"
    rows, columns, factors = [], [], []
    for output, at in zip(s.kernels.outputs(kernel), term.rows, strict=True):
        i, j = s.kernels.pattern(kernel, output)
        column = unknowns[:, j]
        row = np.where(column == NOWHERE, NOWHERE, targets[at[:, i]])
        rows.append(row)
        columns.append(column)
        factors.append(inverse[row] * s.unit[column] * term.factor)
    arguments = (*term.arguments, _parameters(s))
    return _Part(kernel, arguments, tuple(rows), tuple(columns), tuple(factors))


def _curvatures(s: Statement, term: Term, unknowns: Index, multipliers: Index) -> _Part | None:
    """Second derivatives of a term, weighted with the multipliers of its rows.

    Two arguments may be one unknown (inputs that are constant in a step): their mixed derivative
    counts twice on the diagonal.
    """
    kernel = f"{term.kernel}_hess"
    i, j = s.kernels.pattern(kernel, "hess")
    if not len(i):
        return None
    a, b = unknowns[:, i], unknowns[:, j]
    twice = np.where((a == b) & (i != j), 2.0, 1.0)
    arguments = (*term.arguments, _parameters(s), *(multipliers[r] for r in term.rows))
    # The smaller of both is NOWHERE where one of them is.
    rows, columns = np.minimum(a, b), np.maximum(a, b)
    return _Part(
        kernel, arguments, (rows,), (columns,), (twice * s.unit[a] * s.unit[b] * term.factor,)
    )


def _elements(parts: Sequence[_Part], slots: Sequence[Index]) -> tuple[ElementData, ...]:
    remaining = iter(slots)
    return tuple(
        ElementData(p.kernel, p.arguments, tuple(next(remaining) for _ in p.rows), p.factors)
        for p in parts
    )
