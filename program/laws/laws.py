"""The laws of a program: the table of its constraints (c | d), c = 0 and d >= 0, numbered once.

Equalities come node by node along the whole chain of steps, then those of events, ends and
contacts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.problem.problem import Problem
from dmoc.program.blocks import Block, Numbering
from dmoc.program.laws.contact import ContactLaw
from dmoc.program.laws.ends import EndsLaw, Goal
from dmoc.program.laws.hit import HitLaw
from dmoc.program.laws.impact import ImpactLaw
from dmoc.program.laws.law import Law
from dmoc.program.laws.path import PathLaw
from dmoc.program.laws.step import StepLaw
from dmoc.program.layout import SHARED, Layout


@dataclass(frozen=True, eq=False)
class Laws:
    """All laws of a program, in the order of their rows, and the blocks of all rows."""

    step: StepLaw
    path: PathLaw
    impact: ImpactLaw
    ends: EndsLaw
    contact: ContactLaw
    hit: HitLaw
    equalities: tuple[Block, ...]
    inequalities: tuple[Block, ...]

    @property
    def n_eq(self) -> int:
        return sum(b.count for b in self.equalities)

    @property
    def n_in(self) -> int:
        return sum(b.count for b in self.inequalities)

    def __iter__(self) -> Iterator[Law]:
        return iter((self.step, self.path, self.impact, self.ends, self.contact, self.hit))


def laws_of(
    problem: Problem,
    lay: Layout,
    impact: ImpactLaw,
    limits: tuple[Array, Array],
    goals: Sequence[Goal],
) -> Laws:
    """The laws of a problem, whose unknowns have limits; ``goals`` are those that are constraints
    instead of bounds."""
    free = limits[0] != limits[1]
    ends = (free[lay.index_q[0]], free[lay.index_q[-1]])
    step, path = StepLaw(problem, lay, ends), PathLaw.of(problem, lay, limits)
    at_ends = EndsLaw(problem, lay, tuple(goals))
    numbered: tuple[Law, ...] = step, path, impact, at_ends
    if lay.touch.free and not lay.touch.passages:
        contact, hit = _untouched(lay)
    else:
        contact = ContactLaw.of(problem, lay, limits)
        hit = HitLaw.of(problem, lay, impact)
        numbered = *numbered, contact, hit
    block = Numbering()
    for law in numbered:
        law.equations(block)
    count = len(block.made)
    for law in numbered:
        law.inequalities(block)
    made = tuple(block.made)
    return Laws(step, path, impact, at_ends, contact, hit, made[:count], made[count:])


@lru_cache(maxsize=SHARED)
def _untouched(lay: Layout) -> tuple[ContactLaw, HitLaw]:
    """Laws of contacts where none lasts and no impact has friction: their blocks have no members,
    so that all programs of a layout share them."""
    mu, events = np.zeros(len(lay.touch.tangents)), len(lay.surfaces)
    laws = (
        ContactLaw.of_none(lay, mu),
        HitLaw(lay, (), mu, np.zeros(events), np.zeros(events, bool)),
    )
    for law in laws:
        law.equations(Numbering())
        law.inequalities(Numbering())
    return laws
