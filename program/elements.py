"""From terms to the plain arrays of a program: values, first and second derivatives, patterns,
units.

What says where results go, :class:`Structure`, is the same for all problems of one form and is made
once; :func:`assembled` puts the numbers of one problem into it, :class:`Numbers`, which are all
that such problems differ in.

Every term is a kernel family: ``name`` for values, ``name_jac`` and ``name_hess`` for derivatives
with respect to all its arguments.  The columns of a derivative are the arguments' positions in the
pool, where these are unknowns.  Design parameters are unknowns that kernels read among their
parameters: ``name_design_jac`` and ``name_design_hess``, where a family depends on some, have
columns for them behind those of the arguments.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Hashable, Sequence
from dataclasses import field
from functools import cached_property
from typing import Any, TypeVar

import numpy as np

from dmoc.base.records import record
from dmoc.codegen.kernels import Array, Kernels
from dmoc.program.arrays import ElementPlaces, PassData, ProgramData
from dmoc.program.assembly import products
from dmoc.program.blocks import NOWHERE, Index
from dmoc.program.sparse import SparsePattern
from dmoc.program.terms import Term


@record(frozen=True, eq=False)
class Linear:
    """The linear part of (c | d): coefficients * x[columns] added to rows."""

    rows: Index
    columns: Index


T = TypeVar("T")
# Analyses that a structure keeps.
MOST_ANALYSES = 8


@record(frozen=True, eq=False)
class Form:
    """Everything that determines the structure of a program, and what methods find about it."""

    kernels: Kernels
    parameters: Index  # (npar,): the unknowns that they are, or NOWHERE
    terms: Sequence[Term]  # with the places of their factors among those of all
    linear: Linear
    blocks: Sequence[tuple[str, Index]]  # names and places of the unknowns and of the rows
    n: int  # numbers of unknowns, of rows (c | d), of rows c, and of factors
    m: int
    equalities: int
    factors: int

    @cached_property
    def digest(self) -> bytes:
        """A digest of all that it holds."""
        names: list[Any] = [*self.kernels.identity]
        names += [self.kernels.design, self.n, self.m, self.equalities]
        arrays: list[Any] = [self.parameters, self.linear.rows, self.linear.columns]
        for name, index in self.blocks:
            names.append(name)
            arrays.append(index)
        for term in self.terms:
            names.append(term.kernel)
            arrays += (*term.arguments, *term.rows, np.asarray(term.factor))
            arrays += () if term.phase is None else (term.phase,)
        head = repr((names, [a.shape for a in arrays])).encode()
        return hashlib.sha256(b"".join([head, *[a.tobytes() for a in arrays]])).digest()


@record(frozen=True, eq=False)
class Numbers:
    """The numbers of one problem."""

    parameters: Array  # (npar,), those of one phase after the other where they change
    shares: Array  # of a step, which terms may take as arguments
    constants: Array  # of all rows, (m,)
    coefficients: Array  # of the linear part
    factors: Array  # of the terms, those of one after those of another
    lower: Array  # bounds of the scaled unknowns, (n,)
    upper: Array
    sizes: Array  # sizes of the unknowns, (n,)
    row_sizes: Array  # of the constraints, (m,)
    cost_size: float


@record(frozen=True, eq=False)
class _Part:
    """Results of a term that are added somewhere, in the shapes of the kernel's outputs: positions
    in (f | c | d) or rows of the Hessian, unknowns, and places of factors (:func:`doubled`)."""

    kernel: str
    arguments: tuple[Index, ...]
    rows: tuple[Index, ...]
    columns: tuple[Index, ...]
    factors: tuple[Index, ...]


@record(frozen=True, eq=False)
class _Elements:
    """The elements of a pass, and what their factors are made of: left[rows] * right[columns] *
    doubled[factors], those of one result after those of another."""

    places: tuple[ElementPlaces, ...]
    rows: Index
    columns: Index
    factors: Index

    @classmethod
    def of(cls, parts: Sequence[_Part], slots: Sequence[Index]) -> _Elements:
        remaining = iter(slots)
        return cls(
            tuple(
                ElementPlaces(p.kernel, p.arguments, tuple(next(remaining) for _ in p.rows))
                for p in parts
            ),
            _flat([r for p in parts for r in p.rows]),
            _flat([c for p in parts for c in p.columns]),
            _flat([f for p in parts for f in p.factors]),
        )

    def filled(
        self, left: Array, right: Array, doubled: Array
    ) -> tuple[tuple[ElementPlaces, ...], Array]:
        """The elements of one problem, and their factors."""
        return self.places, products(left, self.rows, right, self.columns, doubled, self.factors)


def _flat(arrays: Sequence[Index]) -> Index:
    return np.concatenate([np.zeros(0, np.intp), *(a.ravel() for a in arrays)])


def doubled(factors: Array) -> Array:
    """The factors of terms, shape (factors,), and behind them twice each."""
    return np.concatenate([factors, 2 * factors])


@record(frozen=True, eq=False)
class Structure:
    """Where results of kernels go, and the patterns of the derivatives."""

    form: Form
    values: _Elements
    slopes: _Elements
    curvatures: _Elements
    linear_slots: Index
    jacobian: SparsePattern
    hessian: SparsePattern
    _analyses: dict[Hashable, Any] = field(default_factory=dict)

    @cached_property
    def linear_rows(self) -> Index:
        """Rows of the linear part among (f | c | d)."""
        return 1 + self.form.linear.rows

    @property
    def additions(self) -> int:
        """Number of objects that :meth:`once` has made and keeps."""
        return len(self._analyses)

    def products(self) -> tuple[tuple[Index, ...], ...]:
        """Positions, none of which is negative, in what the factors of each pass are products of:
        of rows, or of unknowns; of unknowns; and of the factors of terms."""
        n, rows, twice = self.form.n, self.form.m + 1, 2 * self.form.factors
        sizes = (rows, 1, twice), (rows, n, twice), (n, n, twice)
        passes = self.values, self.slopes, self.curvatures
        return tuple(
            tuple(at % size for at, size in zip((e.rows, e.columns, e.factors), of, strict=True))
            for e, of in zip(passes, sizes, strict=True)
        )

    def once(self, key: Hashable, make: Callable[[], T]) -> T:
        """An object that follows from the structure and a key, made once; threads that ask at the
        same time may make it twice, and get one."""
        if key not in self._analyses and len(self._analyses) >= MOST_ANALYSES:
            return make()
        analysis: T = self._analyses.get(key) or self._analyses.setdefault(key, make())
        return analysis


@record(frozen=True, eq=False)
class Assembled:
    """A program and its structure."""

    data: ProgramData
    structure: Structure

    @property
    def jacobian(self) -> SparsePattern:
        """The pattern of d(c | d)/dx."""
        return self.structure.jacobian

    @property
    def hessian(self) -> SparsePattern:
        """The pattern of the upper triangle of the Hessian."""
        return self.structure.hessian


def structure_of(form: Form) -> Structure:
    """Analyse the terms: slots of the three passes in the patterns of the derivatives."""
    targets, multipliers = _targets(form), _multipliers(form)
    placed = [(term, _arguments(form, term), _unknowns(form, term)) for term in form.terms]
    values = [_values(term, arguments, targets) for term, arguments, _ in placed]
    slopes = [_slopes(form, *each, targets) for each in placed]
    cells = [(r - 1, c) for p in slopes for r, c in zip(p.rows, p.columns, strict=True)]
    jacobian = SparsePattern((form.m, form.n), [*cells, (form.linear.rows, form.linear.columns)])
    *slots, linear_slots = jacobian.slots
    # The gradient of f first, dense, then the entries of the Jacobian.
    at = [
        np.where(r == -1, c, np.where(k >= 0, form.n + k, NOWHERE))
        for k, (r, c) in zip(slots, cells, strict=True)
    ]
    every = (_curvatures(form, *each, multipliers) for each in placed)
    curvatures = [p for p in every if p is not None]
    hessian = SparsePattern((form.n, form.n), [(p.rows[0], p.columns[0]) for p in curvatures])
    return Structure(
        form,
        _Elements.of(values, [r for p in values for r in p.rows]),
        _Elements.of(slopes, at),
        _Elements.of(curvatures, hessian.slots),
        linear_slots,
        jacobian,
        hessian,
    )


def assembled(structure: Structure, numbers: Numbers) -> Assembled:
    """The program of one problem: its three passes over elements."""
    form, none = structure.form, np.zeros(0, dtype=np.intp)
    n, m, at = form.n, form.m, form.linear
    inverse = 1 / np.concatenate([[numbers.cost_size], numbers.row_sizes])  # of (f | c | d)
    linear, ones = numbers.coefficients * inverse[structure.linear_rows], np.ones(1)
    factors = doubled(numbers.factors)
    values = PassData(
        np.concatenate([[0.0], numbers.constants * inverse[1:]]),
        structure.linear_rows,
        at.columns,
        linear,
        *structure.values.filled(inverse, ones, factors),
    )
    constant = np.zeros(n + structure.jacobian.size)
    constant[n + structure.linear_slots] = linear * numbers.sizes[at.columns]
    slopes = structure.slopes.filled(inverse, numbers.sizes, factors)
    curvatures = structure.curvatures.filled(numbers.sizes, numbers.sizes, factors)
    zeros = np.zeros(structure.hessian.size)
    data = ProgramData(
        equalities=form.equalities,
        lower=numbers.lower,
        upper=numbers.upper,
        sizes=np.concatenate([numbers.sizes, inverse[1:], inverse[:1]]),
        pool=np.concatenate([np.zeros(n + m + 2), numbers.parameters, numbers.shares]),
        values=values,
        slopes=PassData(constant, none, none, np.zeros(0), *slopes),
        curvatures=PassData(zeros, none, none, np.zeros(0), *curvatures),
        jacobian=(structure.jacobian.indptr, structure.jacobian.indices),
        hessian=(structure.hessian.indptr, structure.hessian.indices),
    )
    return Assembled(data, structure)


def _arguments(form: Form, term: Term) -> tuple[Index, ...]:
    """Positions of the arguments in the pool, and of the parameters."""
    first, chosen = form.n + form.m + 2, form.parameters != NOWHERE
    phase = np.zeros(1, dtype=np.intp) if term.phase is None else term.phase
    own = first + phase[:, None] * len(chosen) + np.arange(len(chosen))
    n = len(term.rows[0])
    arguments = (*term.arguments, np.where(chosen, form.parameters, own))
    return tuple(
        a if len(a) == n or _consecutive(a[0]) else np.repeat(a, n, axis=0) for a in arguments
    )


def _consecutive(at: Index) -> bool:
    """Whether positions of a row are next to each other, so that all rows may share it."""
    return bool((at[1:] == at[:-1] + 1).all())


def _derivative(form: Form, term: Term, order: str) -> str:
    """The kernel of the derivatives of a term, by what it depends on."""
    by_design = f"{term.kernel}_design_{order}"
    return by_design if form.kernels.has(by_design) else f"{term.kernel}_{order}"


def _targets(form: Form) -> Index:
    """Positions in (f | c | d) by row of (c | d); where COST and NOWHERE point to, at the end,
    theirs stand."""
    return np.concatenate([np.arange(1, form.m + 1), [0, NOWHERE]])


def _multipliers(form: Form) -> Index:
    """Positions in the pool of the multipliers of rows: sigma for the cost, a zero for no row."""
    return np.arange(form.n, form.n + form.m + 2)


def _values(term: Term, arguments: tuple[Index, ...], targets: Index) -> _Part:
    rows = tuple(targets[r] for r in term.rows)
    nothing = tuple(np.zeros(r.shape, dtype=np.intp) for r in rows)
    return _Part(
        term.kernel,
        arguments,
        rows,
        nothing,
        tuple(np.broadcast_to(term.factor, r.shape) for r in rows),
    )


def _unknowns(form: Form, term: Term) -> Index:
    """The unknowns among the arguments of a term and the design parameters of its kernels, shape
    (n, sum of sizes); NOWHERE for what is none."""
    n, names = len(term.rows[0]), list(form.kernels.parameters)
    design = form.parameters[None, [names.index(name) for name in form.kernels.design]]
    parts = (a if len(a) == n else np.repeat(a, n, axis=0) for a in (*term.arguments, design))
    at = np.hstack(list(parts))
    return np.where(at < form.n, at, NOWHERE)


def _slopes(
    form: Form, term: Term, arguments: tuple[Index, ...], unknowns: Index, targets: Index
) -> _Part:
    kernel = _derivative(form, term, "jac")
    rows, columns, factors = [], [], []
    for output, at in zip(form.kernels.outputs(kernel), term.rows, strict=True):
        i, j = form.kernels.pattern(kernel, output)
        column = unknowns[:, j]
        row = np.where(column == NOWHERE, NOWHERE, targets[at[:, i]])
        rows.append(row)
        columns.append(column)
        factors.append(np.broadcast_to(term.factor, row.shape))
    return _Part(kernel, arguments, tuple(rows), tuple(columns), tuple(factors))


def _curvatures(
    form: Form, term: Term, arguments: tuple[Index, ...], unknowns: Index, multipliers: Index
) -> _Part | None:
    """Second derivatives of a term, weighted with the multipliers of its rows.

    Two arguments may be one unknown (inputs that are constant in a step): their mixed derivative
    counts twice on the diagonal.
    """
    kernel = _derivative(form, term, "hess")
    i, j = form.kernels.pattern(kernel, "hess")
    if not len(i):
        return None
    a, b = unknowns[:, i], unknowns[:, j]
    twice = form.factors * ((a == b) & (i != j))
    arguments = (*arguments, *(multipliers[r] for r in term.rows))
    # The smaller of both is NOWHERE where one of them is.
    rows, columns = np.minimum(a, b), np.maximum(a, b)
    return _Part(kernel, arguments, (rows,), (columns,), (twice + term.factor,))
