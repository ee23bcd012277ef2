"""What decides on the inputs of a simulated motion: what steers by measured states, or the motion's
own inputs, and what pushes it."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.control.disturbance import Disturbed
from dmoc.mechanics.contact_mode import Mode, names_of
from dmoc.mechanics.model import Model
from dmoc.motion.trajectory import Collision, Trajectory

# The motion of a phase goes on past its events for this share of its duration: so early
# may contacts open and friction change.
BEYOND = 0.2


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


@dataclass(frozen=True, eq=False)
class Measured:
    """A state y = (q | v) with its time and the phase that it was measured in."""

    phase: int
    time: float
    y: Array


@runtime_checkable
class Steers(Protocol):
    """What decides on inputs from measured states: a feedback, a planner.

    ``events`` are those that are expected, ``bounds`` those of the inputs, shape (nu, 2).
    """

    @property
    def events(self) -> Sequence[Collision]: ...

    @property
    def bounds(self) -> Array: ...

    def begin(self) -> Steers:
        """The same at the beginning of the motion."""

    def fits(self, motion: Trajectory) -> bool:
        """Whether it is one of a motion."""

    def span(self, phase: int) -> tuple[float, float]:
        """When a phase is expected to begin and to end."""

    def steer(self, phase: int, t: float, h: float, measured: Measured | None) -> Array:
        """The inputs of a phase from a time on, for h seconds, by what was measured last."""


@dataclass(eq=False)
class Controller(Pushed):
    """What steers by states that are measured in each step, with noise and a delay, and by the
    phase that follows on the events it has felt."""

    steers: Steers
    phase: int = 0
    hits: list[str] = field(default_factory=list)
    measured: deque[Measured] = field(default_factory=deque)

    def __post_init__(self) -> None:
        self.random = np.random.default_rng(self.disturbed.seed)

    def input(self, k: int, y: Array) -> Array:
        """The inputs of step k."""
        noise, t = self.disturbed.noise, k * self.h
        seen = y + noise * self.random.standard_normal(len(y)) if noise.any() else y
        self.measured.append(Measured(self.phase, t, seen))
        known = len(self.measured) > self.disturbed.delay
        u = self.steers.steer(self.phase, t, self.h, self.measured.popleft() if known else None)
        return np.clip(u, self.steers.bounds[:, 0], self.steers.bounds[:, 1])

    def feel(self, k: int, collisions: Sequence[Collision], mode: Mode) -> None:
        """Go on to the next phases where their events have happened."""
        self.hits += [c.surface for c in collisions]
        events = self.steers.events
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
        t, (begin, end) = (k + 1) * self.h, self.steers.span(self.phase)
        if t < end - BEYOND * (end - begin) or t >= end:
            return t >= end
        changed = {name: s for name, s in c.friction.items() if name not in c.leaves}
        return not set(c.leaves) & set(closed) and all(
            rubbing.get(name) == s for name, s in changed.items()
        )
