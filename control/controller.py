"""What decides on the inputs of a simulated motion: a feedback that measures, or the motion's own
inputs, and what pushes it."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.control.disturbance import Disturbed
from dmoc.control.feedback import BEYOND, Feedback, follow
from dmoc.mechanics.contact_mode import Mode, names_of
from dmoc.mechanics.model import Model
from dmoc.motion.trajectory import Collision


@dataclass(eq=False)
class Pushed:
    """The motion's own inputs (steps, nu), and pushes."""

    model: Model
    h: float
    disturbed: Disturbed
    inputs: Array

    def pushed(self, k: int, y: Array) -> Array:
        """The state after the pushes of step k."""
        nq = self.model.nq
        for time, impulse in self.disturbed.pushes:
            if k * self.h <= time < (k + 1) * self.h:
                change = self.model.responses(y[:nq], impulse, k * self.h)
                y = np.concatenate([y[:nq], y[nq : 2 * nq] + change])
        return y

    def input(self, k: int, y: Array) -> Array:
        """The inputs of step k."""
        return np.asarray(self.inputs[k])

    def feel(self, k: int, collisions: Sequence[Collision], mode: Mode) -> None:
        """Nobody does."""


@dataclass(eq=False)
class Controller(Pushed):
    """A feedback that is sampled in each step.  The phase that it follows is the one that follows
    on the events it has felt; the input is that of the motion at the time, and the deviation the
    one that was measured before the delay."""

    feedback: Feedback
    phase: int = 0
    hits: list[str] = field(default_factory=list)
    deviations: deque[Array] = field(default_factory=deque)

    def __post_init__(self) -> None:
        self.random = np.random.default_rng(self.disturbed.seed)

    def input(self, k: int, y: Array) -> Array:
        """The inputs of step k."""
        feedback, noise = self.feedback, self.disturbed.noise
        guide = feedback.phases[self.phase]
        reference, _, K = follow(guide, k * self.h)
        u = follow(guide, (k + 0.5) * self.h)[1]
        measured = y + noise * self.random.standard_normal(len(y)) if noise.any() else y
        self.deviations.append(measured - reference)
        if len(self.deviations) > self.disturbed.delay:
            u = u - K @ self.deviations.popleft()
        return np.clip(u, feedback.bounds[:, 0], feedback.bounds[:, 1])

    def feel(self, k: int, collisions: Sequence[Collision], mode: Mode) -> None:
        """Go on to the next phases where their events have happened."""
        self.hits += [c.surface for c in collisions]
        events = self.feedback.events
        while self.phase < len(events) and self._happened(events[self.phase], k, mode):
            self.phase += 1

    def _happened(self, c: Collision, k: int, mode: Mode) -> bool:
        """Whether the event that is expected next has happened: hits and landings are felt, at any
        time; contacts that open and friction that changes come from the inputs, so that they are
        felt near their time, and taken as happened at it."""
        closed, rubbing = names_of(self.model.contacts, mode)
        if c.surface:
            landed = bool(c.lands) and set(c.lands) <= set(closed)
            if c.surface in self.hits:
                del self.hits[: self.hits.index(c.surface) + 1]
                return True
            return landed
        guide = self.feedback.phases[self.phase]
        t = (k + 1) * self.h
        if t < guide.end - BEYOND * (guide.end - guide.begin) or t >= guide.end:
            return t >= guide.end
        changed = {name: s for name, s in c.friction.items() if name not in c.leaves}
        return not set(c.leaves) & set(closed) and all(
            rubbing.get(name) == s for name, s in changed.items()
        )
