"""The law of the forces that quantities contain: what keeps contacts, what sticks, and constraints.

::

    force      M a - F + sum N grad g - sum T grad tau - sum R grad phi = 0
               g'' = 0, tau'' = 0, phi'' = 0     of what is closed, of what sticks, of constraints
    friction   T + s mu N = 0, T + s F = 0       of what slides on surfaces and rails

at each place where the unknowns y = (a | N | T | R) stand (:mod:`dmoc.program.force_unknowns`,
equation :eq:`reaction`): these are the forces at a state with its inputs, not the impulses of the
steps.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.program.blocks import LAW, NOWHERE, Block, Index, Missed, Numbering
from dmoc.program.force_unknowns import sizes
from dmoc.program.laws.law import INPUT, Law, Pivot, key
from dmoc.program.laws.sites import arguments_along, forces_of_ends
from dmoc.program.layout import Layout
from dmoc.program.scale import Scale
from dmoc.program.terms import Places, Term

if TYPE_CHECKING:
    from dmoc.program.laws.laws import Laws


def signs_of(lay: Layout, ny: int) -> Array:
    """Directions of sliding at each row of y in each phase, shape (phases, ny); without columns
    where there are no such unknowns."""
    signs = np.zeros((lay.phases, ny))
    if ny:
        signs[:, _tangents(lay)] = lay.touch.signs
    return signs


def sizes_of_equations(s: Scale, signs: Array) -> Array:
    """Accelerations of what is held, else forces, shape (places, ny)."""
    held, ny = np.concatenate([s.p, s.rate, s.slide, s.joint_rate]) / s.time, signs.shape[1]
    return np.where(signs == 0, held[:ny], sizes(s)[:ny])


def by_kernel(lay: Layout, signs: Array, rows: Index) -> Index:
    """Rows of y in the order of the kernels: those of what holds, of what slides forth, and of what
    slides back."""
    slides = [np.where(signs == s, rows, NOWHERE)[:, _tangents(lay)] for s in (1.0, -1.0)]
    return np.hstack([np.where(signs == 0, rows, NOWHERE), *slides])


def _tangents(lay: Layout) -> slice:
    """The friction forces in y."""
    first = lay.nq + len(lay.touch.contacts.surfaces)
    return slice(first, first + len(lay.touch.contacts.tangents))


@dataclass(eq=False, repr=False)
class ForceLaw(Law):
    """Accelerations and forces along a motion and at its ends; without rows where none are
    wanted."""

    lay: Layout
    along: Block = field(init=False)
    ends: Block = field(init=False)

    @cached_property
    def _signs(self) -> Array:
        """Directions of sliding at each row of y, shape (phases, ny)."""
        return signs_of(self.lay, self.lay.force.count)

    def equations(self, block: Numbering) -> None:
        missed = Missed(LAW, lambda *_: "forces do not fit the motion")
        force, (along, ends) = self.lay.force, self._phases
        self.along = block(
            "force",
            force.y != NOWHERE,
            lambda r, j: f"equation {j} of forces {force.place(r)}",
            lambda s: self._sizes(s, along),
            missed=missed,
        )
        self.ends = block(
            "force at ends",
            force.y_ends != NOWHERE,
            lambda r, j: f"equation {j} of forces at the {('start', 'goal')[r]}",
            lambda s: self._sizes(s, ends),
            missed=missed,
        )

    def _sizes(self, s: Scale, phase: Index) -> Array:
        """Accelerations of what is held, else forces, shape (places, ny)."""
        return sizes_of_equations(s, self._signs[phase])

    @property
    def _phases(self) -> tuple[Index, Index]:
        """The phase of each place."""
        lay = self.lay
        return lay.phase_of_step[lay.force.step], np.array([0, lay.phases - 1])

    def _by_kernel(self) -> Iterator[Index]:
        """Rows along the motion and at its ends, in the order of the kernels."""
        for block, phase in zip((self.along, self.ends), self._phases, strict=True):
            yield by_kernel(self.lay, self._signs[phase], block.index)

    def terms(self, places: Places, laws: Laws) -> list[Term]:
        lay, terms = self.lay, list[Term]()
        rows, of_ends = self._by_kernel()
        if self.along.count:
            inner = np.setdiff1d(np.arange(lay.total), lay.ends)
            at, ends = arguments_along(lay, places, inner, forces=True), forces_of_ends(lay)
            if len(ends):
                own = np.full((len(at["_point"][0]), rows.shape[1]), NOWHERE)
                own[: len(ends)] = rows[ends]
                terms.append(Term("forces_point", at["_point"], (own,)))
                rows[ends] = NOWHERE
            if lay.inside:
                terms.append(Term("forces_ends", at["_ends"], (rows.reshape(lay.total, -1),)))
            elif not lay.form.width:
                terms.append(Term("forces", at[""], (rows,)))
            elif len(inner):
                terms.append(Term("forces_node", at["_node"], (rows[lay.row_u_k[inner]],)))
        if self.ends.count:
            terms += [
                Term("forces_point", places.quantities_at_end(last), (of_ends[[-last]],))
                for last in (False, True)
            ]
        return terms

    def pivots(self, laws: Laws) -> Iterator[Pivot]:
        """Each equation determines the acceleration or force of its own place."""
        force = self.lay.force
        yield Pivot(force.y, self.along.index, key(force.step, INPUT))
        yield Pivot(force.y_ends, self.ends.index, key(np.array([0, self.lay.total - 1]), INPUT))
