"""What is in contact in each phase, by numbers, and the unknown impulses of contacts that last."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from dmoc.base.errors import ProblemError
from dmoc.codegen.kernels import Array
from dmoc.mechanics.modes import STICK
from dmoc.problem.problem import Problem
from dmoc.program.blocks import NOWHERE, Bools, Index, Numbering
from dmoc.program.hit_stages import MOMENTS, Passage, passage_of
from dmoc.program.reactions import (
    GAPS,
    TANGENTS,
    PhaseReaction,
    members,
    place,
    rows_of_phase,
)


@dataclass(frozen=True)
class Touch:
    """Contacts of phases and events by numbers of surfaces and tangents.

    Attributes
    ----------
    surfaces, tangents : tuples of str
    surface_of : tuple of int
        The surface of each tangent; NOWHERE for rails.
    closed : tuple of tuples of int
        Surfaces of each phase.
    rubbing : tuple of tuples of pairs of int
        Tangent and friction (0 sticks, +1 and -1 slide) of each phase.
    impacts : tuple of bool
        Events at which something is hit or lands.
    landings : tuple of tuples of int
        Surfaces that land at each event.
    passages : tuple of Passage
        The ways through impacts with friction that have a course: hits, and landings during which
        sliding stops.
    """

    surfaces: tuple[str, ...]
    tangents: tuple[str, ...]
    surface_of: tuple[int, ...]
    closed: tuple[tuple[int, ...], ...]
    rubbing: tuple[tuple[tuple[int, int], ...], ...]
    impacts: tuple[bool, ...]
    landings: tuple[tuple[int, ...], ...]
    passages: tuple[Passage, ...] = ()

    @cached_property
    def free(self) -> bool:
        """Whether no contact lasts."""
        return not (any(self.closed) or any(self.rubbing))

    # Phases: rows of phases, columns of surfaces or tangents --------------------------------------

    @property
    def is_closed(self) -> Bools:
        """Shape (phases, nc)."""
        closed = np.zeros((len(self.closed), len(self.surfaces)), dtype=bool)
        for i, surfaces in enumerate(self.closed):
            closed[i, list(surfaces)] = True
        return closed

    @property
    def rubs(self) -> Bools:
        """Shape (phases, nt)."""
        rubs = np.zeros((len(self.rubbing), len(self.tangents)), dtype=bool)
        for i, pairs in enumerate(self.rubbing):
            rubs[i, [t for t, _ in pairs]] = True
        return rubs

    @property
    def signs(self) -> Array:
        """Directions of sliding, 0 for what sticks or does not rub, shape (phases, nt)."""
        signs = np.zeros((len(self.rubbing), len(self.tangents)))
        for i, pairs in enumerate(self.rubbing):
            for t, sign in pairs:
                signs[i, t] = sign
        return signs

    @property
    def sticks(self) -> Bools:
        return np.asarray(self.rubs & (self.signs == STICK))

    # Events: rows of events -----------------------------------------------------------------------

    @property
    def beside(self) -> Bools:
        """Surfaces that take an impulse P_c beside lam in an impact: those that stay closed, and
        those that land with the first one, shape (events, nc)."""
        beside = np.zeros((len(self.impacts), len(self.surfaces)), dtype=bool)
        for i, (before, after) in enumerate(pairwise(self.is_closed)):
            if self.impacts[i]:
                beside[i] = after & before
                beside[i, list(self.landings[i][1:])] = True
        return beside

    @property
    def rubs_in_impact(self) -> Bools:
        """Tangents of closed surfaces that take a tangential impulse T_c by the law of contacts
        that last, shape (events, nt)."""
        rubs_there = np.zeros((len(self.impacts), len(self.tangents)), dtype=bool)
        for i, rubs in enumerate(self.rubs[1:]):
            rubs_there[i] = rubs & (np.array(self.surface_of) >= 0) & self.impacts[i]
        return rubs_there & ~self.passes

    @property
    def turns(self) -> Bools:
        """Tangents of closed surfaces that slide in the other direction after an impact, shape
        (events, nt)."""
        return np.asarray(self.rubs_in_impact & (self.signs[:-1] * self.signs[1:] < 0))

    @property
    def passes(self) -> Bools:
        """Tangents that rub in an impact with a course, shape (events, nt)."""
        passes = np.zeros((len(self.impacts), len(self.tangents)), dtype=bool)
        for p in self.passages:
            passes[p.event, p.tangent] = True
        return passes

    @cached_property
    def passing(self) -> tuple[Index, Index]:
        """Surface and tangent of the passage of each event, 0 where there is none, shapes
        (events,)."""
        hit, rubbed = (np.zeros(len(self.impacts), dtype=np.intp) for _ in range(2))
        for p in self.passages:
            hit[p.event], rubbed[p.event] = p.surface, p.tangent
        return hit, rubbed

    @property
    def moments(self) -> Bools:
        """Moments within impacts that have velocities and impulses of their own, shape (events,
        2)."""
        moments = np.zeros((len(self.impacts), len(MOMENTS)), dtype=bool)
        for p in self.passages:
            moments[p.event, list(p.moments)] = True
        return moments


@dataclass(frozen=True, eq=False)
class ContactUnknowns:
    """Impulses of the contacts of a touch.

    Attributes
    ----------
    P, T : arrays of int, shapes (phase nodes, nc) and (phase nodes, nt)
        Normal and tangential impulses in the rows of :func:`~dmoc.program.reactions.phase_nodes`;
        of a touch where no contact lasts without rows.
    P_c, T_c : arrays of int, shapes (events, nc) and (events, nt)
        Those that closed contacts take in an impact beside lam, T_c also that of a hit with
        friction.
    """

    steps: tuple[int, ...]
    touch: Touch
    P: Index
    T: Index
    P_c: Index
    T_c: Index

    @classmethod
    def of(cls, block: Numbering, steps: tuple[int, ...], touch: Touch) -> ContactUnknowns:
        nodes = [0] * len(steps) if touch.free else [n + 1 for n in steps]
        count, surfaces, tangents = sum(steps), touch.surfaces, touch.tangents
        blocks = (
            block(
                "P",
                np.repeat(touch.is_closed, nodes, axis=0),
                lambda r, j: f"contact impulse of {surfaces[j]} {place(steps, r)}",
                lambda s: s.lam / count,
            ),
            block(
                "T",
                np.repeat(touch.rubs, nodes, axis=0),
                lambda r, j: f"friction impulse of {tangents[j]} {place(steps, r)}",
                lambda s: s.friction / count,
            ),
            block(
                "P_c",
                touch.beside,
                lambda i, j: f"impulse of {surfaces[j]} at event {i + 1}",
                lambda s: s.lam,
            ),
            block(
                "T_c",
                touch.rubs_in_impact | touch.passes,
                lambda i, j: f"friction impulse of {tangents[j]} at event {i + 1}",
                lambda s: s.friction,
            ),
        )
        return cls(steps, touch, *(b.index for b in blocks))

    def reactions(self, i: int) -> Iterator[PhaseReaction]:
        """Those of a phase: of its closed contacts, and of what rubs."""
        closed, rubbing = self.touch.closed[i], self.touch.rubbing[i]
        rows = rows_of_phase(self.steps, i)
        if closed:
            index, holds = self.P[rows][:, list(closed)], np.ones(len(closed), dtype=bool)
            names = tuple(self.touch.surfaces[j] for j in closed)
            yield PhaseReaction("normal", names, GAPS, closed, index, -1.0, holds, True, False)
        if rubbing:
            columns = tuple(k for k, _ in rubbing)
            sticks = np.array([sign == STICK for _, sign in rubbing])
            index = self.T[rows][:, list(columns)]
            names = tuple(self.touch.tangents[k] for k in columns)
            yield PhaseReaction(
                "tangential", names, TANGENTS, columns, index, 1.0, sticks, False, True
            )

    def impulses_at(self, x: Array, i: int) -> tuple[dict[str, float], dict[str, float]]:
        """Normal and tangential impulses of event i beside lam, by name."""
        return (
            {self.touch.surfaces[j]: float(x[k]) for j, k in members(self.P_c[i])},
            {self.touch.tangents[j]: float(x[k]) for j, k in members(self.T_c[i])},
        )


def touch_of(problem: Problem) -> Touch:
    """The contacts of a problem.

    Raises
    ------
    ProblemError
        If the course of a hit with friction is not said.
    """
    surfaces, tangents = problem.kernels.surfaces, problem.kernels.tangents
    for i, words in problem.open_hits.items():
        raise ProblemError(
            f"event {i + 1} ({problem.sequence[i]}) is a hit with friction, which can go in "
            f"several ways: say which, by one of {', '.join(map(repr, words))}, or let dmoc.solve "
            "try them."
        )
    return Touch(
        tuple(surfaces),
        tuple(tangents),
        tuple(surfaces.index(t) if t in surfaces else NOWHERE for t in tangents),
        tuple(tuple(surfaces.index(c) for c in mode.closed) for mode in problem.modes),
        tuple(
            tuple((tangents.index(t), sign) for t, sign in mode.rubbing.items())
            for mode in problem.modes
        ),
        tuple(bool(event.surface) for event in problem.events),
        tuple(tuple(surfaces.index(s) for s in event.lands) for event in problem.events),
        tuple(
            passage_of(
                i,
                (surfaces.index(event.surface), tangents.index(event.surface)),
                event.course,
                bool(event.lands),
            )
            for i, event in enumerate(problem.events)
            if event.course is not None
        ),
    )
