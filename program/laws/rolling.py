"""Contacts with two tangential directions that last: they stick, which of a ball is rolling.

Both directions stick by the rows of the law of friction (:mod:`dmoc.program.laws.friction`); those
that are sliding velocities, which are of no place, vanish within steps, at their quadrature points,
as constraints of velocities do (equations :eq:`rates-within` and :eq:`rolling` of the theory)::

    stuck      h sigma(q_i, v_i, t_i) = 0
    cone       (mu P_k)^2 - T_k.T_k >= 0          at the nodes, and in a landing

The square of the cone has a slope wherever the contact presses; that it does, P_k >= 0, is a bound.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.program.blocks import NOWHERE, Block, Bools, Counted, Index, Numbering
from dmoc.program.bound_kinds import BoundKind
from dmoc.program.laws.contact import LawAtContacts
from dmoc.program.laws.friction import FrictionLaw
from dmoc.program.scale import Scale
from dmoc.program.terms import Places, Term

if TYPE_CHECKING:
    from dmoc.program.laws.laws import Laws


@dataclass(eq=False, repr=False)
class RollingLaw(LawAtContacts):
    """The contacts with two tangential directions that stick in phases of a problem.

    Attributes
    ----------
    contact : ContactLaw
    friction : FrictionLaw
    """

    friction: FrictionLaw
    cone: Block = field(init=False)
    cone_of_impact: Block = field(init=False)

    def _first(self, of_tangents: Bools) -> Bools:
        """Values of first directions, shape (..., pairs), from those of tangents, (..., nt)."""
        return np.asarray(of_tangents[..., [k for k, _ in self.touch.contacts.rolling]])

    def inequalities(self, block: Numbering) -> None:
        """Cones have a column for each contact with two directions."""
        touch, friction, at = self.touch, self.friction, self.along.at
        names = [name for name, _ in touch.contacts.pairs]
        of_impacts = touch.drags & touch.sticks[1:] & (friction.in_impacts != 0)
        self.cone = block(
            "cone of two directions",
            self._first(self.along.along(friction.sticking)),
            lambda r, j: f"friction cone of {names[j]} {at.label(r)}",
            lambda s: self._squares(s, s.friction / self.lay.total * at.size),
            at.step if at.own else at.place,
            counted=Counted(BoundKind.CONE, names, at.place),
        )
        self.cone_of_impact = block(
            "cone of two directions in an impact",
            self._first(of_impacts),
            lambda i, j: f"friction cone of {names[j]} at event {i + 1}",
            lambda s: self._squares(s, s.friction),
        )

    def _squares(self, s: Scale, friction: Array) -> Array:
        return np.asarray(friction[..., [k for k, _ in self.touch.contacts.rolling]] ** 2)

    def terms(self, places: Places, laws: Laws) -> list[Term]:
        if self.touch.free or not self.touch.contacts.pairs:
            return []
        return [*self._within(places), *self._cones(places)]

    def _within(self, places: Places) -> list[Term]:
        """Sliding velocities within steps, in the rows of what sticks."""
        lay, skids = self.lay, ~self.touch.contacts.in_place
        rows = np.where(skids, self.friction.stuck.index, NOWHERE)[~self.along.at.begins]
        if not (rows != NOWHERE).any():
            return []
        step = places.step(np.arange(lay.total))
        return [Term("slide_step", step, (rows.reshape(lay.total, -1),))]

    def _cones(self, places: Places) -> list[Term]:
        lay, contact, nodes = self.lay, self.lay.contact, self.lay.collision_nodes
        q, t = self.along.state(places)
        T, P = places.or_zero(contact.T), places.or_zero(contact.P)
        terms = [Term("cone", (q, T, P, t), (self.cone.index,))]
        if len(nodes):
            at = lay.index_q[nodes], places.times(nodes)
            T, P = places.or_zero(contact.T_c), places.or_zero(self._pressing)
            terms.append(Term("cone", (at[0], T, P, at[1]), (self.cone_of_impact.index,)))
        return terms

    @property
    def _pressing(self) -> Index:
        """Normal impulses of impacts, shape (events, nc): of what is hit or lands first that of its
        own law."""
        touch, P_c = self.touch, self.lay.contact.P_c.copy()
        events = np.flatnonzero(touch.impacts)
        P_c[events, touch.surfaces[events]] = self.lay.impact.lam[events]
        return P_c
