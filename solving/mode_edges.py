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
from functools import cached_property
from itertools import chain, pairwise

import numpy as np

from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.mechanics.contact_mode import Mode, mode_in_words
from dmoc.mechanics.contacts import Contacts
from dmoc.mechanics.sequence_words import word_between
from dmoc.motion.friction import friction_word
from dmoc.problem.problem import Problem
from dmoc.program.active_constraints import NO_FORCE
from dmoc.program.blocks import NOWHERE, Bools, Index
from dmoc.program.laws.law import Edge
from dmoc.program.transcription import Transcription
from dmoc.results.proposal import CLOSED, OPEN, Proposal, Stay
from dmoc.solvers.kkt import cost_size
from dmoc.solvers.outcome import Outcome

# Steps of a stay, at least: in a single one a row may be active by the mesh alone.
FEWEST = 2
# What another mode may save to first order, relative to the cost, for a stay to be told.
WORTH = 1e-3


def proposal_of(nlp: Transcription, outcome: Outcome) -> Proposal | None:
    """Proposal of another sequence than that of a minimum; None where no contact stays at an
    edge."""
    lay, problem = nlp.layout, nlp.problem
    if lay.touch.free:
        return None
    t, edges = lay.times(nlp.physical(outcome.x)), _Edges(nlp, outcome)
    stays, modes, names = list[Stay](), list[list[Mode]](), lay.touch.contacts
    for i, mode in enumerate(problem.touch.modes):
        in_steps = [mode] * lay.steps[i]
        for edge, steps in edges.of_phase(i):
            begin, end = (float(t[lay.ends[i] + k]) for k in (steps.start, steps.stop))
            states = [friction_word(s) for s in edge.friction or ()] or [CLOSED, OPEN]
            stays.append(Stay(i, edge.name, begin, end, *states))
            for k in steps:
                in_steps[k] = _beyond(edge, in_steps[k], names)
        if i and in_steps and problem.touch.events[i - 1].course and mode.closed:
            in_steps[0] = mode  # what the impact ends with
        modes.append(in_steps)
    if not stays:
        return None
    events = list(_events(problem, modes, t))
    start = modes[0][0]
    contacts = () if start.free else tuple(mode_in_words(names, start).split())
    return Proposal(
        tuple(stays),
        tuple(word for word, _ in events),
        tuple(time for _, time in events),
        None if start == problem.touch.modes[0] else contacts,
    )


def _beyond(edge: Edge, mode: Mode, contacts: Contacts) -> Mode:
    """The mode beyond an edge of another one; the same where the contact that rubs has left."""
    if edge.friction is None:
        return mode.opening(edge.number, contacts)
    if edge.number not in mode.rubbing:
        return mode
    return mode.with_friction({edge.number: edge.friction[1]})


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
    if not modes[-1]:  # the event that ends the motion
        last = problem.touch.modes[-1], problem.touch.events[-1]
        yield word_between(problem.model.contacts, of_step[-1], *last), float(t[-1])


@record(frozen=True, eq=False)
class _Edges:
    """A minimum with its multipliers, and what contacts would save beyond the edges of their
    modes."""

    nlp: Transcription
    outcome: Outcome

    def of_phase(self, i: int) -> Iterator[tuple[Edge, range]]:
        """Edges of phase i at which contacts stay where the mode beyond would cost less, with the
        steps of the phase."""
        lay = self.nlp.layout
        if not lay.steps[i]:
            return
        last = i == lay.phases - 1
        for edge in chain.from_iterable(law.edges(i) for law in self.nlp.laws):
            saved = self._saved(edge)
            free_end = last and edge.gives[-1, -1] != NOWHERE
            for steps in _runs(self._at_edge(edge)):
                part = saved[steps.start : steps.stop]
                if edge.friction is None:
                    lifts = _lifts(len(steps), bool(free_end) and steps.stop == len(saved))
                    most = (lifts @ part).max()
                else:
                    most = np.maximum(part[:-1], 0.0).sum()
                if most > self._least:
                    yield edge, steps

    def _at_edge(self, edge: Edge) -> Bools:
        """Steps at an edge."""
        if edge.friction is None:
            x, z = self.outcome.x[edge.active], self.outcome.duals.z[edge.active]
            active = np.asarray(z > np.maximum(x, NO_FORCE))
        else:
            active = self._active(edge.active)
        if active.size == edge.gives.size:
            return np.asarray(active.reshape(edge.gives.shape).all(axis=1))
        return active if len(active) == len(edge.gives) else active[:-1] & active[1:]

    def _saved(self, edge: Edge) -> Array:
        """Costs that the other mode saves in each step, to the node after it, shape (steps,), in
        units of the cost: by all of the friction that could turn, else at the typical rate."""
        saved = edge.sign * self.outcome.duals.y[edge.gives]
        if edge.turning is not None:
            size = self.nlp.sizes[edge.turning] / self.nlp.row_sizes[edge.gives]
            saved = saved * 2 * np.abs(self.outcome.x[edge.turning]) * size
        return np.asarray(np.where(edge.gives == NOWHERE, 0.0, saved).sum(axis=1))

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


def _runs(active: Bools) -> list[range]:
    """Steps that follow each other, enough to count as a stay."""
    ends = np.flatnonzero(np.diff(active, prepend=False, append=False)).reshape(-1, 2)
    return [range(a, b) for a, b in ends if b - a >= FEWEST]


def _lifts(n: int, free_end: bool) -> Array:
    """Gaps after each of n steps, a row for each way to leave and come back at a rate of about 1 a
    step at most: within all steps, within half of them and, where the end is free, never."""
    s = np.arange(1, n + 1) / n
    spans = ((0.0, 1.0), (0.0, 0.5), (0.5, 1.0))
    parts = [(np.clip((s - a) / (b - a), 0, 1), n * (b - a)) for a, b in spans]
    lifts = [steps * (4 * x * (1 - x)) ** 2 / 3 for x, steps in parts]
    return np.array([*lifts, n * s**2 / 2] if free_end else lifts)
