"""Constraints phi(q, t) = 0 that hold in every phase: closed loops, rods, coordinates that depend
on each other.

Each has an impulse R_k at every node of a phase, the ends among them, and R_c in every impact::

    momentum   ... + sum R_k grad phi(q_k) = 0        also of arrival, departure
    place      phi(q_k) = 0                         at the nodes after the first one of a phase
    at rest    phi_dot(q_N, v-) = 0                   at the end of each phase, and at the start
    turn       sum_i d_i phi(q_k) d_i phi(q_kp1) / M_ii >= 0      in every step
    stays      phi_dot(q_c, v+) = 0                   after an impact, with the impulse R_c

with the rate phi_dot.  A constraint of velocities, c(q, v, t) = 0, pushes with R_k dc/dv, has c for
its rate, and in the place of the rows of its places those of its rates within steps, at their
quadrature points (equation :eq:`rates-within`)::

    within     h c(q_i, v_i, t_i) = 0

This is the law of a closed contact that may pull, in steps with nodes inside too
(:mod:`dmoc.program.laws.contact`), but for the turn from one place to the next: where the equations
of a step have two solutions, as a circle and a line, the one of them lies beyond the body.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.problem.problem import Problem
from dmoc.program.blocks import NOWHERE, Block, Index, Numbering
from dmoc.program.laws.impact import ends_motion
from dmoc.program.laws.law import AT_REST, Law, Pivot, key
from dmoc.program.laws.phase_nodes import PhaseNodes, end_of_phase
from dmoc.program.layout import Layout
from dmoc.program.presolve import JointsSettled, joints_settled
from dmoc.program.terms import Places, Term

if TYPE_CHECKING:
    from dmoc.program.laws.laws import Laws


@dataclass(eq=False, repr=False)
class JointLaw(Law):
    """The constraints of a model; where there are none the law has no rows.

    Attributes
    ----------
    lay : Layout
    bent : tuple of str
        Constraints whose gradients change along a motion.
    by_rate : tuple of str
        Constraints of velocities.
    settled : JointsSettled
        What holds by itself.
    """

    lay: Layout
    bent: tuple[str, ...]
    by_rate: tuple[str, ...]
    settled: JointsSettled = field(init=False)
    place: Block = field(init=False)
    at_rest: Block = field(init=False)
    stays: Block = field(init=False)
    turn: Block = field(init=False)

    @property
    def names(self) -> tuple[str, ...]:
        return self.lay.joint.names

    @cached_property
    def _along(self) -> PhaseNodes:
        return PhaseNodes(self.lay, True)

    def settle(self, problem: Problem, limits: tuple[Array, Array]) -> None:
        if self.names:
            self.settled = joints_settled(problem, self.lay, limits)

    def equations(self, block: Numbering) -> None:
        if not self.names:
            return
        lay, names, along = self.lay, self.names, self._along
        places, rates, follows = self.settled
        rests = np.vstack([~follows[:1], ~follows])
        rests[[0, -1]] &= ~rates
        self.place = block(
            "place",
            along.places(~follows, places),
            lambda r, j: f"constraint {names[j]} {along.at.label(r)}",
            lambda s: along.in_a_step(s.joint_rate, s),
        )
        self.at_rest = block(
            "constraint at rest",
            along.rates(~follows, rests),
            lambda k, j: f"rate of constraint {names[j]} {end_of_phase(lay, k)}",
            lambda s: s.joint_rate,
        )
        self.stays = block(
            "constraint stays",
            (lay.joint.R_c != NOWHERE) & ~(follows[1:] | ends_motion(lay)[:, None] & rates[-1]),
            lambda i, j: f"rate of constraint {names[j]} after event {i + 1}",
            lambda s: s.joint_rate,
        )

    def inequalities(self, block: Numbering) -> None:
        """Of two places that fit, a step leads to the one on the side that it comes from."""
        if not self.names:
            return
        names, bent = self.names, [name in self.bent for name in self.names]
        d, total = self.lay.scheme.degree, self.lay.total
        self.turn = block(
            "turn",
            np.tile(np.array(bent, dtype=bool), (d * total, 1)),
            lambda k, j: f"direction of constraint {names[j]} in step {k // d}",
            lambda s: s.joint_rate / s.reaction,
            np.repeat(np.arange(total), d),
        )

    def terms(self, places: Places, laws: Laws) -> list[Term]:
        lay, along, unknowns = self.lay, self._along, self.lay.joint
        if not self.names:
            return []
        terms = list(along.pushes("reaction", unknowns.R, 1.0, places, laws))
        nodes = lay.collision_nodes
        if len(nodes):
            q, t, v = lay.index_q[nodes], places.times(nodes), lay.impact.v_c
            R_c = places.or_zero(unknowns.R_c)
            terms += [
                Term("reaction", (q, R_c, t), (laws.step.momentum.index[nodes],)),
                Term("joint_rate", (q, v, t), (self.stays.index,)),
            ]
        q, at = lay.index_places, np.arange(len(lay.index_places) - 1)
        ends = q[:-1], q[1:], places.times_of(at), places.times_of(at + 1)
        terms.append(Term("joint_turn", ends, (self.turn.index,)))
        rests = along.rests("joint_rate", self.at_rest.index, places)
        rates = np.array([name in self.by_rate for name in self.names])
        at_places = np.where(rates, NOWHERE, self.place.index)
        terms += [Term("joint", along.state(places), (at_places,)), *rests]
        if self.by_rate:
            within = np.where(rates, self.place.index, NOWHERE)[~along.at.begins]
            step = places.step(np.arange(lay.total))
            terms.append(Term("joint_step", step, (within.reshape(lay.total, -1),)))
        return terms

    def pivots(self, laws: Laws) -> Iterator[Pivot]:
        """Places and rates determine the impulses."""
        if self.names:
            unknowns = self.lay.joint
            yield from self._along.pivots(unknowns.R, self.place.index, self.at_rest.index)
            after = key(self.lay.collision_nodes, AT_REST)
            yield Pivot(unknowns.R_c, self.stays.index, after)

    def loose(self) -> Iterator[tuple[Index, Index]]:
        if self.names:
            unknowns = self.lay.joint
            yield from self._along.loose(unknowns.R, unknowns.R_c, self.settled.follows)
