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

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain, pairwise

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.modes import FRICTION, STICK, PhaseMode, word_between
from dmoc.motion.trajectory import FRICTION_WORDS, mode_word
from dmoc.problem.problem import Problem
from dmoc.program.active_constraints import NO_FORCE
from dmoc.program.blocks import NOWHERE, Bools, Index
from dmoc.program.transcription import Transcription
from dmoc.results.proposal import CLOSED, OPEN, Proposal, Stay
from dmoc.solvers.kkt import cost_size
from dmoc.solvers.outcome import Outcome

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
    stays, modes = list[Stay](), list[list[PhaseMode]]()
    for i, mode in enumerate(problem.modes):
        in_steps = [mode] * lay.steps[i]
        for contact, word, cheaper, steps in edges.of_phase(i):
            begin, end = (float(t[lay.ends[i] + k]) for k in (steps.start, steps.stop))
            stays.append(Stay(i, contact, begin, end, word, cheaper))
            for k in steps:
                in_steps[k] = _changed(in_steps[k], contact, cheaper)
        if i and problem.events[i - 1].course and mode.closed:
            in_steps[0] = mode  # what the impact ends with
        modes.append(in_steps)
    if not stays:
        return None
    events = list(_events(problem, modes, t))
    start = modes[0][0]
    contacts = tuple(mode_word(start.closed, start.rubbing).split()) if not start.free else ()
    return Proposal(
        tuple(stays),
        tuple(word for word, _ in events),
        tuple(time for _, time in events),
        None if start == problem.modes[0] else contacts,
    )


def _changed(mode: PhaseMode, contact: str, cheaper: str) -> PhaseMode:
    """A mode in which one contact does something else."""
    if cheaper == OPEN:
        rubbing = {t: s for t, s in mode.rubbing.items() if t != contact}
        return PhaseMode(tuple(c for c in mode.closed if c != contact), rubbing)
    if contact not in mode.rubbing:  # it leaves in this step
        return mode
    return replace(mode, rubbing={**mode.rubbing, contact: FRICTION[cheaper]})


def _events(
    problem: Problem, modes: Sequence[Sequence[PhaseMode]], t: Array
) -> Iterator[tuple[str, float]]:
    """Words and times of the events of phases that have a mode in every step; one at which nothing
    happens any more is none."""
    ends = np.cumsum([len(of_phase) for of_phase in modes])
    of_step = list(chain.from_iterable(modes))
    for k, (before, after) in enumerate(pairwise(of_step), start=1):
        (at,) = np.nonzero(ends == k)
        word = word_between(before, after, problem.events[at[0]] if len(at) else None)
        if word:
            yield word, float(t[k])


@dataclass(frozen=True)
class _Edges:
    """A minimum with its multipliers, and what contacts would save beyond the edges of their
    modes."""

    nlp: Transcription
    outcome: Outcome

    def of_phase(self, i: int) -> Iterator[tuple[str, str, str, range]]:
        """Contacts that stay at an edge in phase i: contact, what it does, what would cost less,
        and the steps of the phase."""
        touch = self.nlp.layout.touch
        for j in touch.closed[i]:
            for steps in self._unloaded(i, j):
                yield touch.surfaces[j], CLOSED, OPEN, steps
        for k, s in touch.rubbing[i]:
            name, word = touch.tangents[k], FRICTION_WORDS[s]
            if s == STICK:
                for side, way in enumerate((-1, 1)):
                    for steps in self._worth(*self._at_limit(i, k, side, way)):
                        yield name, word, FRICTION_WORDS[way], steps
            else:
                for steps in self._worth(*self._at_rest(i, k, s)):
                    yield name, word, FRICTION_WORDS[STICK], steps

    # Steps at an edge, and what the other mode saves at the node after each, in units of the cost.

    def _at_rest(self, i: int, k: int, s: int) -> tuple[Bools, Array]:
        """All of the friction could turn."""
        lay, law, nodes = self.nlp.layout, self.nlp.laws.contact, self._nodes(i)[1:]
        held = self._active(law.direction.index[lay.ends[i] : lay.ends[i + 1], k])
        force, law = lay.contact.T[nodes, k], law.sliding.index[nodes, k]
        most = 2 * np.abs(self.outcome.x[force]) * self.nlp.unit[force] / self.nlp.row_unit[law]
        return held, s * self.outcome.duals.y[law] * most

    def _at_limit(self, i: int, k: int, side: int, way: int) -> tuple[Bools, Array]:
        """It could slide at the typical rate."""
        law, nodes = self.nlp.laws.contact, self._nodes(i)
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
