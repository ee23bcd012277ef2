"""What decides on the inputs of a simulated motion: what steers by measured states, or the motion's
own inputs, and what pushes it."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from hashlib import sha256
from typing import Any, Protocol, runtime_checkable

import numpy as np

from dmoc.base.arguments import shown
from dmoc.base.errors import SimulationError
from dmoc.base.names import velocity_name
from dmoc.base.records import record
from dmoc.codegen.kernels import Array, Kernels
from dmoc.control.disturbance import Disturbed, read_disturbance
from dmoc.mechanics.contact_mode import Mode, names_of
from dmoc.mechanics.model import Model
from dmoc.mechanics.model_values import parameter_rows
from dmoc.mechanics.phase_models import PhaseModels, check_one_for_all
from dmoc.motion.trajectory import Collision, Trajectory
from dmoc.simulation.replay import moved, replay, replay_steps
from dmoc.simulation.start_state import state_of

# The motion of a phase goes on past its events for this share of its duration: so early
# may contacts open and friction change.
BEYOND = 0.2
# So much earlier a contact may land: what trembles as it opens does not land yet.
SOONER = 0.5


@dataclass(eq=False)
class Pushed:
    """The motion's own inputs (steps, nu), and pushes."""

    model: Model
    h: float
    disturbed: Disturbed
    inputs: Array

    def pushed(self, k: int, y: Array) -> Array:
        """The state y, shape (2 nq,), after the pushes of step k."""
        nq = self.model.nq
        for time, impulse in self.disturbed.pushes:
            if k * self.h <= time < (k + 1) * self.h:
                change = self.model.responses(y[:nq], impulse, k * self.h)
                y = np.concatenate([y[:nq], y[nq : 2 * nq] + change])
        return y

    def input(self, k: int, y: Array) -> Array:
        """The inputs of step k, shape (nu,), at a state y, shape (2 nq,)."""
        return np.asarray(self.inputs[k])

    def feel(self, k: int, collisions: Sequence[Collision], mode: Mode) -> None:
        """Nobody does."""


@record(frozen=True, eq=False)
class Measured:
    """A state y = (q | v) with its time and the phase that it was measured in."""

    phase: int
    time: float
    y: Array


@runtime_checkable
class Steers(Protocol):
    """A device that decides on inputs from measured states: a feedback, a planner. ``events`` are
    those that are expected, ``bounds`` those of the inputs, shape (nu, 2)."""

    @property
    def events(self) -> Sequence[Collision]: ...

    @property
    def bounds(self) -> Array: ...

    def begin(self) -> Steers:
        """The device at the beginning of the motion."""

    def fits(self, motion: Trajectory) -> bool:
        """Whether the device is made for a motion."""

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
    hits: list[str] = field(default_factory=list)  # felt since the phase began
    opened: set[str] = field(default_factory=set)  # surfaces that were open since then
    measured: deque[Measured] = field(default_factory=deque)
    below: set[str] = field(default_factory=set)  # switches that were below zero since then
    above: set[str] = field(default_factory=set)  # those that are not, by the state measured last

    def __post_init__(self) -> None:
        self.random = np.random.default_rng(self.disturbed.seed)

    def input(self, k: int, y: Array) -> Array:
        """The inputs of step k, shape (nu,), at a state y, shape (2 nq,), which is measured."""
        noise, t = self.disturbed.noise, k * self.h
        seen = y + noise * self.random.standard_normal(len(y)) if noise.any() else y
        self.measured.append(Measured(self.phase, t, seen))
        self._look(seen, t)
        arrived = len(self.measured) > self.disturbed.delay
        u = self.steers.steer(self.phase, t, self.h, self.measured.popleft() if arrived else None)
        return np.clip(u, self.steers.bounds[:, 0], self.steers.bounds[:, 1])

    def _look(self, y: Array, t: float) -> None:
        """Note on which side of zero the switches are in a state, shape (2 nq,)."""
        names = self.model.contacts.switches
        if names:
            q, v = np.split(y, 2)
            w = self.model.crossings(q, v, t)
            self.above = {name for name, value in zip(names, w, strict=False) if value >= 0}
            self.below |= {*names} - self.above

    def feel(self, k: int, collisions: Sequence[Collision], mode: Mode) -> None:
        """Go on to the next phases where their events have happened: of those that come from
        inputs, one."""
        closed, rubbing = names_of(self.model.contacts, mode)
        self.hits += [c.surface for c in collisions]
        self.opened |= {*self.model.contacts.surfaces} - {*closed}
        t, events = (k + 1) * self.h, self.steers.events
        while self.phase < len(events):
            event = events[self.phase]
            if not self._happened(event, t, closed, rubbing):
                return
            self.phase += 1
            self.opened = {*self.model.contacts.surfaces} - {*closed}
            self.below.clear()
            if event.surface not in self.hits:
                self.hits.clear()
                return
            del self.hits[: self.hits.index(event.surface) + 1]

    def _happened(
        self, c: Collision, t: float, closed: Sequence[str], rubbing: Mapping[str, int]
    ) -> bool:
        """Whether the event that is expected next has happened: hits are felt at any time, landings
        not before the half of the phase, and of what was open in it, nor switches, by measured
        states, of what was below zero in it; contacts that open and friction that changes come from
        the inputs, so that they are felt near their time, and taken as happened at it."""
        begin, end = self.steers.span(self.phase)
        late = t >= end - SOONER * (end - begin)
        if c.switch:
            return late and c.switch in self.below & self.above
        if c.lands:
            return late and {*c.lands} <= {*closed} and {*c.lands} <= self.opened
        if c.surface:
            return c.surface in self.hits
        if t < end - BEYOND * (end - begin) or t >= end:
            return t >= end
        changed = {name: s for name, s in c.friction.items() if name not in c.leaves}
        return not set(c.leaves) & set(closed) and all(
            rubbing.get(name) == s for name, s in changed.items()
        )


def digest_of(motion: Trajectory) -> str:
    """Digest of a motion: of its model, parameters, nodes and inputs."""
    digest = sha256(motion.fingerprint.encode())
    digest.update(repr(sorted(motion.parameters.items())).encode())
    for phase in motion.phases:
        for rows in (phase.t, phase.q, phase.v, phase.u):
            digest.update(np.ascontiguousarray(rows).tobytes())
    return digest.hexdigest()


def controlled(
    motion: Trajectory,
    kernels: Kernels,
    changes: Mapping[str, Any],
    mesh: Mapping[str, Any],
    feedback: Any,
    disturb: Any,
) -> dict[str, Any]:
    """A motion with a feedback, or disturbed, as arguments of a simulation, some of them
    changed."""
    for name, value in (*mesh.items(), ("inputs", changes.get("inputs"))):
        if value is not None:
            raise SimulationError(
                f"{name} = {shown(value)}: expected none beside feedback or disturb, whose "
                '"sampling" is the size of a step.'
            )
    if feedback is not None:
        _check_feedback(feedback, motion)
    states = (*motion.coordinates, *map(velocity_name, motion.coordinates))
    disturbed = read_disturbance(disturb, states, motion.final_time)
    count = replay_steps(motion, disturbed.sampling, None)
    stated = replay(motion, kernels, changes, None, count)
    values = parameter_rows(kernels, stated["parameters"], None, SimulationError)
    models = PhaseModels(kernels, values)
    check_one_for_all(models, "feedback and disturb go with one model", SimulationError)
    there = models[0]
    if disturbed.start.any():
        at = np.concatenate(state_of(kernels, stated["position"], stated["velocity"]))
        start = moved(there, motion, at + disturbed.start)
        stated |= {"position": start[: there.nq], "velocity": start[there.nq :]}
    parts = there, stated["step_size"], disturbed, stated.pop("inputs")
    control = Pushed(*parts) if feedback is None else Controller(*parts, feedback.begin())
    return {**stated, "control": control}


def _check_feedback(feedback: Any, motion: Trajectory) -> None:
    """Refuse what does not steer a motion."""
    if isinstance(feedback, type) or not isinstance(feedback, Steers):
        raise SimulationError(
            f"feedback = {shown(feedback)}: expected one from dmoc.feedback(solution), or a "
            "dmoc.Planner."
        )
    if not feedback.fits(motion):
        raise SimulationError(
            "the feedback is that of another motion: make one of this solution, with "
            "dmoc.feedback(solution) or dmoc.Planner(problem, solution)."
        )
