"""Contacts that stay at the edges of their modes, where the mode beyond would cost less.

A mode ends where its inequalities do: a contact that slides comes to rest, one that sticks reaches
the limit of its friction, one that is closed does not press.  A minimum of a sequence may stay
there for a while.  Its motion is then one of the mode beyond the edge, too, in which an equation of
the first mode is an inequality::

    slides, at rest         T + s mu P = 0               sticks:   s (T + s mu P) >= 0
    sticks, at its limit    tau_k - tau_km1 = 0          slides:   s (tau_k - tau_km1) >= 0
    closed, without force   g(q_k) = 0                   leaves:   -g(q_k) >= 0

By the multipliers y of these rows the cost falls at the rates s y, s y and -y where they give way:
while one of them is positive, the motion is no minimum of the sequence with the other mode.  A
contact leaves without a jump of its rate, so that no node near the end of a stay rises by itself,
whatever its multiplier says: what counts is the sum over gaps that grow and vanish smoothly.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import chain, pairwise
from typing import TypeAlias

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.contact_mode import STICK, Mode, mode_in_words
from dmoc.mechanics.modes import word_between
from dmoc.motion.trajectory import FRICTION_WORDS
from dmoc.problem.problem import Problem
from dmoc.program.active_constraints import NO_FORCE
from dmoc.program.blocks import NOWHERE, Bools, Index
from dmoc.program.transcription import Transcription
from dmoc.results.proposal import CLOSED, OPEN, Proposal, Stay
from dmoc.solvers.kkt import cost_size
from dmoc.solvers.outcome import Outcome

Change: TypeAlias = Callable[[Mode], Mode]
# Steps of a stay, at least: in a single one a row may be active by the mesh alone.
FEWEST = 2
# What another mode may save to first order, relative to the cost, for a stay to be told.
WORTH = 1e-3


def proposal_of(nlp: Transcription, outcome: Outcome) -> Proposal | None:
    """What to try instead of the sequence of a minimum; None where no contact stays at an edge."""
    lay, problem = nlp.layout, nlp.problem
    if lay.touch.free:
        return None
    t, edges = lay.times(nlp.physical(outcome.x)), _Edges(nlp, outcome)
    stays, modes = list[Stay](), list[list[Mode]]()
    for i, mode in enumerate(problem.touch.modes):
        in_steps = [mode] * lay.steps[i]
        for change, words, steps in edges.of_phase(i):
            contact, word, cheaper = words
            begin, end = (float(t[lay.ends[i] + k]) for k in (steps.start, steps.stop))
            stays.append(Stay(i, contact, begin, end, word, cheaper))
            for k in steps:
                in_steps[k] = change(in_steps[k])
        if i and problem.touch.events[i - 1].course and mode.closed:
            in_steps[0] = mode  # what the impact ends with
        modes.append(in_steps)
    if not stays:
        return None
    events = list(_events(problem, modes, t))
    start = modes[0][0]
    names = lay.touch.contacts
    contacts = () if start.free else tuple(mode_in_words(names, start).split())
    return Proposal(
        tuple(stays),
        tuple(word for word, _ in events),
        tuple(time for _, time in events),
        None if start == problem.touch.modes[0] else contacts,
    )


def _opened(supports: tuple[int, ...], surface: int, mode: Mode) -> Mode:
    """A mode in which a contact has left."""
    rubbing = {k: s for k, s in mode.rubbing.items() if supports[k] != surface}
    return Mode.of([j for j in mode.closed if j != surface], rubbing)


def _rubbing(tangent: int, friction: int, mode: Mode) -> Mode:
    """A mode in which a tangent rubs otherwise; the same where its contact has left."""
    rubbing = mode.rubbing
    return Mode.of(mode.closed, {**rubbing, tangent: friction}) if tangent in rubbing else mode


def _events(
    problem: Problem, modes: Sequence[Sequence[Mode]], t: Array
) -> Iterator[tuple[str, float]]:
    """Words and times of the events of phases that have a mode in every step; one at which nothing
    happens any more is none."""
    ends = np.cumsum([len(of_phase) for of_phase in modes])
    of_step = list(chain.from_iterable(modes))
    for k, (before, after) in enumerate(pairwise(of_step), start=1):
        (at,) = np.nonzero(ends == k)
        event = problem.touch.events[at[0]] if len(at) else None
        word = word_between(problem.model.contacts, before, after, event)
        if word:
            yield word, float(t[k])


@dataclass(frozen=True)
class _Edges:
    """A minimum with its multipliers, and what contacts would save beyond the edges of their
    modes."""

    nlp: Transcription
    outcome: Outcome

    def of_phase(self, i: int) -> Iterator[tuple[Change, tuple[str, str, str], range]]:
        """Contacts that stay at an edge in phase i: the change of the mode that would cost less;
        contact, what it does, and what it would do then; and the steps of the phase."""
        mode, names = self.nlp.layout.touch.modes[i], self.nlp.layout.touch.contacts
        for j in mode.closed:
            for steps in self._unloaded(i, j):
                change = partial(_opened, names.supports, j)
                yield change, (names.surfaces[j], CLOSED, OPEN), steps
        for k, s in mode.rubbing.items():
            edges = [(STICK, self._at_rest(i, k, s))]
            if s == STICK:
                edges = [(way, self._at_limit(i, k, n, way)) for n, way in enumerate((-1, 1))]
            for way, edge in edges:
                for steps in self._worth(*edge):
                    words = names.tangents[k], FRICTION_WORDS[s], FRICTION_WORDS[way]
                    yield partial(_rubbing, k, way), words, steps

    # Steps at an edge, and what the other mode saves at the node after each, in units of the cost.

    def _at_rest(self, i: int, k: int, s: int) -> tuple[Bools, Array]:
        """All of the friction could turn."""
        lay, law, nodes = self.nlp.layout, self.nlp.laws.friction, self._nodes(i)[1:]
        held = self._active(law.direction.index[lay.ends[i] : lay.ends[i + 1], k])
        force, law = lay.contact.T[nodes, k], law.sliding.index[nodes, k]
        most = 2 * np.abs(self.outcome.x[force]) * self.nlp.unit[force] / self.nlp.row_unit[law]
        return held, s * self.outcome.duals.y[law] * most

    def _at_limit(self, i: int, k: int, side: int, way: int) -> tuple[Bools, Array]:
        """It could slide at the typical rate."""
        law, nodes = self.nlp.laws.friction, self._nodes(i)
        held = self._active(law.cone.index[nodes, k, side])
        stuck = law.stuck.index[nodes[1:], k]
        return held[:-1] & held[1:], way * self.outcome.duals.y[stuck]

    def _unloaded(self, i: int, j: int) -> Iterator[range]:
        """It could leave at the typical rate."""
        nodes = self._nodes(i)
        P, closed = (
            self.nlp.layout.contact.P[nodes, j],
            self.nlp.laws.contact.closed.index[nodes[1:], j],
        )
        held = self.outcome.duals.z[P] > np.maximum(self.outcome.x[P], NO_FORCE)
        saved = np.where(closed == NOWHERE, 0.0, -self.outcome.duals.y[closed])
        free_end = (
            nodes[-1] + 1 == len(self.nlp.laws.contact.closed.index) and closed[-1] != NOWHERE
        )
        for steps in _runs(held[:-1] & held[1:]):
            lifts = _lifts(len(steps), free_end and steps.stop == len(saved))
            if (lifts @ saved[steps.start : steps.stop]).max() > self._least:
                yield steps

    def _nodes(self, i: int) -> Index:
        """Rows of the nodes of phase i among those of all phases."""
        ends = self.nlp.layout.ends
        return np.arange(ends[i], ends[i + 1] + 1) + i

    @cached_property
    def _distances(self) -> Array:
        return self.nlp.inequality(self.outcome.x)

    def _active(self, rows: Index) -> Bools:
        numbers = np.where(rows == NOWHERE, self.nlp.n_in, rows - self.nlp.n_eq)
        d, w = (np.append(values, 0.0) for values in (self._distances, self.outcome.duals.w))
        return np.asarray(w[numbers] > np.maximum(d[numbers], NO_FORCE))

    @cached_property
    def _least(self) -> float:
        return WORTH * cost_size(self.nlp, self.outcome.x)

    def _worth(self, held: Bools, saved: Array) -> Iterator[range]:
        """Runs of steps in which something that counts is saved at the nodes between them."""
        for steps in _runs(held):
            if np.maximum(saved[steps.start : steps.stop - 1], 0.0).sum() > self._least:
                yield steps


def _runs(held: Bools) -> list[range]:
    """Steps that follow each other, enough to count as a stay."""
    ends = np.flatnonzero(np.diff(held, prepend=False, append=False)).reshape(-1, 2)
    return [range(a, b) for a, b in ends if b - a >= FEWEST]


def _lifts(n: int, free_end: bool) -> Array:
    """Gaps after each of n steps, a row for each way to leave and come back at a rate of about 1 a
    step at most: within all steps, within half of them and, where the end is free, never."""
    s = np.arange(1, n + 1) / n
    spans = ((0.0, 1.0), (0.0, 0.5), (0.5, 1.0))
    parts = [(np.clip((s - a) / (b - a), 0, 1), n * (b - a)) for a, b in spans]
    lifts = [steps * (4 * x * (1 - x)) ** 2 / 3 for x, steps in parts]
    return np.array([*lifts, n * s**2 / 2] if free_end else lifts)
