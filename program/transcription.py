"""The nonlinear program of a problem: from its tables of unknowns and rows to values and
derivatives.

Everything here works on scaled unknowns and returns scaled values (:mod:`dmoc.program.scaling`): x
of :class:`Transcription` is x divided by ``sizes``, a row of (c | d) by its ``row_sizes``;
:meth:`Transcription.physical` and :meth:`Transcription.scaled` convert.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable, Hashable, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property, partial
from itertools import chain
from typing import Self

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.problem.derived import once
from dmoc.problem.problem import Problem
from dmoc.program.assembly import on_limits
from dmoc.program.blocks import NOWHERE, Block, Index
from dmoc.program.bounds import goal_rows, limits
from dmoc.program.elements import (
    Assembled,
    Form,
    Linear,
    Numbers,
    Structure,
    assembled,
    structure_of,
)
from dmoc.program.evaluator import Evaluator
from dmoc.program.iterate import Iterate
from dmoc.program.laws.ends import Goal
from dmoc.program.laws.laws import Laws, laws_of, rows_follow_from, settles_rows
from dmoc.program.layout import Layout
from dmoc.program.scale import Scale
from dmoc.program.structure_cache import MEMORY, MOST_REMEMBERED
from dmoc.program.terms import Places, apart, shares_of

# A value this close to a limit, relative to it, is the limit but for rounding.
ON_LIMIT = 4 * float(np.finfo(float).eps)


class Transcription(Evaluator):
    """The nonlinear program of a :class:`Problem`.

    Attributes
    ----------
    layout : Layout
        The table of the unknowns.
    laws : Laws
        The table of the constraints.
    scale : Scale
        Sizes; none by default, so that x and r are in units of the problem.
    sizes, row_sizes : arrays, shape (n,), (n_eq + n_in,)
        Sizes of the unknowns and of the constraints.
    lower, upper : arrays, shape (n,)
        Bounds of the scaled unknowns; ``limits`` are those of the unknowns.
    goal_as_rows : bool
        Values of the goal are constraints instead of bounds of the unknowns, so that they can be
        missed by some amount.
    grazing : sequence of int
        Collisions that graze their surface without an impulse.
    pulling : bool
        Closed contacts may pull, to see how strongly they would have to.
    """

    def __init__(
        self,
        problem: Problem,
        scale: Scale | None = None,
        goal_as_rows: bool = False,
        grazing: Sequence[int] | Index = (),
        pulling: bool = False,
    ) -> None:
        self.problem, self.kernels, self.goal_as_rows = problem, problem.kernels, goal_as_rows
        self.scale = Scale.none(problem) if scale is None else scale
        self.par = problem.parameter_values
        self.layout = Layout.of(problem)
        grazes = np.asarray(grazing, dtype=np.intp)
        goals = goal_rows(problem, self.layout) if goal_as_rows else []
        make = partial(laws_of, problem, self.layout, self.scale, grazes, goals, pulling)
        few = self.layout.is_shared and self.layout.size <= MOST_REMEMBERED
        form = rows_follow_from(problem, self.layout, grazes) if few and not goals else None
        self.laws, self.limits = self._laws_within(make, (form, pulling), goals)
        self.n = self.layout.size
        self.n_eq, self.n_in = self.laws.n_eq, self.laws.n_in
        self.scaled_by_sizes = scale is not None
        self.sizes = self.layout.sizes(self.scale) if self.scaled_by_sizes else np.ones(self.n)
        self.lower, self.upper = (limit / self.sizes for limit in self.limits)

    def _laws_within(
        self, make: Callable[[], Laws], of: tuple[Hashable | None, bool], goals: Sequence[Goal]
    ) -> tuple[Laws, tuple[Array, Array]]:
        """The laws with their rows, and the limits of the unknowns."""
        problem, lay, form = self.problem, self.layout, of[0]
        own = form is None or settles_rows(problem, lay)
        # One solve makes several programs of a problem, in other sizes.
        made = once(problem, _no_laws).setdefault(of, {}) if own and form is not None else {}
        laws = next(iter(made.values()), None) or MEMORY.bounding.of(None if own else form, make)
        within = limits(problem, lay, laws, self.scale, goals)
        fixed = (within[0] == within[1]).tobytes()
        if fixed in made:
            return made[fixed], within
        if not own:
            shared = MEMORY.laws.of(
                (form, fixed), lambda: make().settled(problem, within).numbered()
            )
            return shared.stating(problem), within
        laws = (make() if made else laws).settled(problem, within)
        shared = MEMORY.laws.of(form and (form, fixed, laws.facts), laws.numbered)
        made[fixed] = shared.stating(problem).with_numbers(laws)
        return made[fixed], within

    @cached_property
    def row_sizes(self) -> Array:
        """Sizes of the rows (c | d), shape (n_eq + n_in,)."""
        if not self.scaled_by_sizes:
            return np.ones(self.n_eq + self.n_in)
        laws = self.laws
        rows = laws.remembered.sizes((*laws.equalities, *laws.inequalities), self.scale)
        more = self.inequalities[len(laws.inequalities) :]
        return np.concatenate([rows, *(b.sizes(self.scale) for b in more)]) if more else rows

    @property
    def structure(self) -> Structure:
        """The structure that the program shares with those of all problems of its form."""
        return self._parts[0]

    @cached_property
    def numbers(self) -> Numbers:
        """All that the programs of one structure differ in."""
        m = self.laws.n_eq + self.laws.n_in
        constants = np.zeros(m)
        for law in self.laws:
            for row, constant in law.constants():
                constants[row] = constant
        return Numbers(
            self.par.ravel(), shares_of(self.layout.scheme), constants, *self._parts[1], self.lower,
            self.upper, self.sizes, self.row_sizes[:m], self.scale.cost,
        )  # fmt: skip

    def assemble(self) -> Assembled:
        return assembled(self.structure, self.numbers)

    @cached_property
    def _parts(self) -> tuple[Structure, tuple[Array, Array]]:
        """The structure, and the coefficients and factors of the laws."""
        if self.n > MOST_REMEMBERED:
            form, numbers = self._form()
            return structure_of(form), numbers
        laws, remembered = self.laws, self.laws.remembered
        structure = remembered.structure() if remembered.structure else None
        values, restitution = laws.values, laws.restitution
        last, before = remembered.coefficients, remembered.factors
        if structure is not None and before is not None and before[0] == restitution:
            if last is None or last[0] != values:
                last = remembered.coefficients = values, self._entries()[-1]
            return structure, (last[1], before[1])
        form, numbers = self._form()
        structure = structure or MEMORY.structures.of_form(form)
        remembered.structure = weakref.ref(structure)
        remembered.coefficients = values, numbers[0]
        remembered.factors = restitution, numbers[1]
        return structure, numbers

    def _entries(self) -> tuple[Index, Index, Array]:
        """Rows, unknowns and coefficients of the linear part."""
        entries = chain.from_iterable(law.entries(self.laws) for law in self.laws)
        rows, columns, coefficients = (np.concatenate(part) for part in zip(*entries, strict=True))
        return rows, columns, coefficients

    def _form(self) -> tuple[Form, tuple[Array, Array]]:
        """The form of the program, and the coefficients and factors of the laws."""
        laws, kernels, m = self.laws, self.kernels, self.laws.n_eq + self.laws.n_in
        rows, columns, coefficients = self._entries()
        places = Places(
            self.layout,
            self.n + m + 1,
            len(kernels.surfaces),
            self.n + m + 2 + self.par.size,
            self.problem.models.change,
        )
        terms = chain.from_iterable(law.terms(places, laws) for law in laws)
        entering = [t for t in terms if kernels.has(t.kernel) and t.enters]
        if self.problem.models.change:
            entering = [term.in_phases(self.layout) for term in entering]
        entering, factors = apart(entering)
        unknowns = dict(zip(self.problem.design, self.layout.index_design.tolist(), strict=True))
        chosen = np.array([unknowns.get(name, NOWHERE) for name in kernels.parameters], np.intp)
        blocks = chain(self.layout.unknowns, laws.equalities, laws.inequalities)
        form = Form(
            kernels, chosen, entering, Linear(rows, columns), [(b.name, b.index) for b in blocks],
            self.n, m, laws.n_eq, len(factors),
        )  # fmt: skip
        return form, (coefficients, factors)

    @property
    def equalities(self) -> Sequence[Block]:
        """Blocks of c, in the order of their rows."""
        return self.laws.equalities

    @property
    def inequalities(self) -> Sequence[Block]:
        """Blocks of d, in the order of their rows."""
        return self.laws.inequalities

    @property
    def minimal_times(self) -> Index:
        """Positions in d of the minimal times of phases, shape (phases with one,); a plain program
        has none."""
        return np.zeros(0, dtype=np.intp)

    def physical(self, x: Array) -> Array:
        """Unknowns in units of the problem from scaled ones, shape (n,) each; read-only. An unknown
        at a limit up to rounding is put on it."""
        return self._remembered("physical", self._physical, x)

    def _physical(self, x: Array) -> Array:
        return on_limits(x, self.sizes, *self.limits, ON_LIMIT)

    def scaled(self, y: Array) -> Array:
        """Scaled unknowns from those in units of the problem, shape (n,) each."""
        return np.asarray(y / self.sizes)

    def iterate(self, y: Array) -> Iterate:
        """Values of the unknowns in units of the problem, shape (n,)."""
        return Iterate(self.layout.problem_at(self.problem, y), self.layout, y)

    def momenta(self, x: Array) -> tuple[Array, Array]:
        """Return p at the start and at the end of every step in units of the problem, shape
        (total, nq) each."""
        at = self.iterate(self.physical(x))
        return at.model.step_momenta(at.steps)

    def relaxed_by(self, eps: float) -> Self:
        """The same program whose contacts are relaxed by another eps."""
        other, law, grips = copy(self), copy(self.laws.complementarity), copy(self.laws.open_grips)
        law.eps = grips.eps = eps
        other.laws = replace(self.laws, complementarity=law, open_grips=grips)
        for name in ("assembled", "program", "analyses", "numbers", "_memory"):
            other.__dict__.pop(name, None)
        return other

    def designed(self, x: Array) -> Self:
        """The same program, whose problem has the design of the scaled unknowns x, shape (n,)."""
        if not self.layout.index_design.size:
            return self
        problem = self.layout.problem_at(self.problem, self.physical(x))
        if problem is self.problem:
            return self
        other = copy(self)
        other.problem = problem
        return other


def _no_laws(problem: Problem) -> dict[Hashable, dict[bytes, Laws]]:
    """The laws of a problem before it has any."""
    return {}
