"""How much normal impulse the restitution of a hit with stages has: what each law of it says.

A hit goes through the stages of :mod:`dmoc.program.laws.hit`, in which rates are linear in the
impulses.  What ends the last one is the row "restitution", one for each hit, and its law is an
object of a class beside this one.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

from dmoc.program.blocks import Entries
from dmoc.program.hit_stages import Passage
from dmoc.program.terms import Places, Term

if TYPE_CHECKING:
    from dmoc.program.laws.hit import HitLaw


class Spent(NamedTuple):
    """The normal impulse until some moment of a hit, and its work: the integral of the rate of
    separation n dP."""

    P: float
    W: float


class Restitution(ABC):
    """A law of restitution, with its row of the program."""

    @abstractmethod
    def left(self, e: float, full: Spent, now: Spent, n: float, slope: float) -> float:
        """The normal impulse that is left after compression, ``full``, and what is spent ``now``,
        if the rate of separation n goes on with dn/dP = ``slope``."""

    def ratio(self, e: float, first: float, last: float) -> float:
        """The whole normal impulse beside that of compression, in which dn/dP is ``first``, where
        it is ``last`` in restitution."""
        full = Spent(1.0, -first / 2)
        return 1.0 + self.left(e, full, full, 0.0, last)

    @abstractmethod
    def terms(self, hit: HitLaw, passages: Sequence[Passage], places: Places) -> list[Term]:
        """Terms of the rows of hits that obey the law."""

    @abstractmethod
    def entries(self, hit: HitLaw, p: Passage) -> Iterator[Entries]:
        """Linear entries of the row of one of them."""

    def is_quadratic(self, hit: HitLaw, p: Passage) -> bool:
        """Whether the row of a hit is one of works, quadratic in impulses: it has a second root, of
        a normal impulse below zero."""
        return False
