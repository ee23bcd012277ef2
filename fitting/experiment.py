"""One run as a function of the unknowns: the motion that follows its word, and what its sensors say
of it."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dmoc.base.names import momentum_name, velocity_name
from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.fitting.course import Course, Laws, Mesh
from dmoc.fitting.data import Run, Samples
from dmoc.fitting.parameters import (
    MODEL,
    RESTITUTION,
    RIGHT,
    SENSOR,
    START,
    Parameter,
    state_size,
)
from dmoc.mechanics.contact_forces import accelerations_and_forces
from dmoc.mechanics.model import Model
from dmoc.mechanics.sequence_words import words_along
from dmoc.mechanics.touch import Touch
from dmoc.problem.problem import Problem

Places = NDArray[np.intp]


@record(frozen=True, eq=False)
class Prediction:
    """What the sensors of a run say by the model: its motion, the values in the order of the
    measured ones, and the phase that each belongs to, shapes (n,)."""

    course: Course
    values: Array
    phases: Places


@record(frozen=True, eq=False)
class Experiment:
    """A run, the word that its motion follows, and the unknowns that it depends on; ``start`` is
    the known part of the state (2 nq,) that it begins with, not a number elsewhere."""

    problem: Problem
    run: Run
    touch: Touch
    parameters: tuple[Parameter, ...]
    start: Array

    @cached_property
    def words(self) -> tuple[str, ...]:
        return words_along(self.touch)

    # What is measured -----------------------------------------------------------------------------

    @cached_property
    def measured(self) -> Array:
        """All measured values (n,): those of the sensors, one after the other, then times of
        events."""
        parts = [s.y for s in self.run.sensors.values()]
        return np.concatenate([*parts, [time for _, time in self.run.events]])

    @cached_property
    def sigma(self) -> Array:
        """Standard deviations (n,), not a number where they are to be estimated."""
        parts = [s.sigma for s in self.run.sensors.values()]
        return np.concatenate([*parts, np.full(len(self.run.events), self.run.sigma_events)])

    @cached_property
    def times(self) -> Array:
        """Times of the measured values, shape (n,)."""
        parts = [s.t for s in self.run.sensors.values()]
        return np.concatenate([*parts, [time for _, time in self.run.events]])

    @cached_property
    def slices(self) -> dict[str, slice]:
        """Where the values of each sensor stand, and those of events."""
        places, begin = dict[str, slice](), 0
        for name, s in self.run.sensors.items():
            places[name] = slice(begin, begin + len(s.y))
            begin += len(s.y)
        if self.run.events:
            places["event"] = slice(begin, begin + len(self.run.events))
        return places

    @cached_property
    def event_numbers(self) -> Places:
        """The number of each measured event among those of the word: the same surface, in its
        order; -1 for one that the word does not have."""
        left, numbers = list(enumerate(self.words)), list[int]()
        for word, _ in self.run.events:
            at = next((k for k, (_, own) in enumerate(left) if _same(word, own)), None)
            numbers.append(-1 if at is None else left[at][0])
            left = left if at is None else left[at + 1 :]
        return np.array(numbers, dtype=np.intp)

    # What the model says --------------------------------------------------------------------------

    def laws(self, x: Array) -> Laws:
        """The laws at values of the unknowns, shape (number,)."""
        kernels, par = self.problem.kernels, self.problem.parameter_values.copy()
        values, names = list(zip(self.parameters, x, strict=True)), list(kernels.parameters)
        for p, value in values:
            if p.kind == MODEL:
                par[0, names.index(p.of)] = value
        model, e = Model(kernels, par), self.problem.restitution_values.copy()
        for p, value in sorted(values, key=lambda pair: bool(pair[0].of)):  # that of all first
            if p.kind == RESTITUTION:
                e[model.surface_numbers[p.of] if p.of else ~model.contacts.pull] = value
        return Laws(model, e, self.touch, self.sizes)

    @cached_property
    def sizes(self) -> Array:
        """Sizes of the state (2 nq,) that errors of integration are shares of."""
        names = self.problem.kernels.coordinates
        states = (*names, *map(velocity_name, names))
        own = np.array([state_size(self.run, name) for name in states])
        known = np.abs(np.nan_to_num(self.start))
        return np.asarray(np.maximum(own, known))

    def sensed(self, name: str, x: Array) -> tuple[float, float, float]:
        """Bias, gain and delay of a sensor."""
        values = dict(RIGHT)
        for p, value in zip(self.parameters, x, strict=True):
            if p.kind in SENSOR and p.of == name:
                values[p.kind] = float(value)
        return values["bias"], values["gain"], values["delay"]

    def begin(self, x: Array) -> Array:
        """The state that the run begins with, shape (2 nq,)."""
        y, names = self.start.copy(), self.problem.kernels.coordinates
        states = [*names, *map(velocity_name, names)]
        for p, value in zip(self.parameters, x, strict=True):
            if p.kind == START:
                y[states.index(p.of)] = value
        return y

    def course(self, x: Array) -> Course:
        """The motion at values of the unknowns."""
        sensed = {name: self.sensed(name, x) for name in self.run.inputs}
        mesh = self._still if not self._shifts else self.run.mesh(self.problem.kernels, sensed)
        return self.laws(x).follow(self.begin(x), mesh, self.run.end)

    @cached_property
    def _shifts(self) -> bool:
        """Whether unknowns change the inputs."""
        return any(p.kind in SENSOR and p.of in self.run.inputs for p in self.parameters)

    @cached_property
    def _still(self) -> Mesh:
        right = dict.fromkeys(self.run.inputs, (0.0, 1.0, 0.0))
        return self.run.mesh(self.problem.kernels, right)

    def predict(
        self, x: Array, phases: Places | None = None, near: Array | None = None
    ) -> Prediction:
        """What the sensors say; each value in the phase of ``phases``, if these are given.  Values
        within times ``near``, shape (events,), of an event are those of the side that fits better.
        """
        course = self.course(x)
        own = self._own_phases(course, x) if phases is None else phases
        if near is not None and phases is None:
            own = self._better(course, x, own, near)
        return Prediction(course, self._values(course, x, own), own)

    def _sampled(self, name: str, s: Samples, x: Array) -> Array:
        """Times at which a sensor sees what it tells."""
        late = self.sensed(name, x)[2]
        return s.t - late if late else s.t

    def _own_phases(self, course: Course, x: Array) -> Places:
        parts = [course.phases(self._sampled(n, s, x)) for n, s in self.run.sensors.items()]
        return np.concatenate([*parts, np.zeros(len(self.run.events), dtype=np.intp)]).astype(
            np.intp
        )

    def _better(self, course: Course, x: Array, own: Places, near: Array) -> Places:
        """Phases on the side of near events where the residual is smaller."""
        own, values = own.copy(), self._values(course, x, own)
        for i in range(len(course.arcs) - 1):
            away = np.abs(self.times - course.events[i]) <= near[i]
            for side in (i, i + 1):
                at = np.flatnonzero(away & (own == 2 * i + 1 - side))
                if len(at):
                    other = own.copy()
                    other[at] = side
                    there = self._values(course, x, other)
                    closer = np.abs(there - self.measured) < np.abs(values - self.measured)
                    own[at[closer[at]]], values[at[closer[at]]] = side, there[at[closer[at]]]
        return own

    def _values(self, course: Course, x: Array, phases: Places) -> Array:
        """Predicted values in some phases, shape (n,)."""
        values, whole = np.empty(len(self.measured)), dict[bytes, Array]()
        for name, s in self.run.sensors.items():
            at = self.slices[name]
            t, own = self._sampled(name, s, x), np.ascontiguousarray(phases[at])
            key = t.tobytes() + own.tobytes()
            if key not in whole:
                whole[key] = course.states(t, own)
            bias, gain, _ = self.sensed(name, x)
            values[at] = gain * self._sense(course, name, t, whole[key], own) + bias
        if self.run.events:
            numbers, times = self.event_numbers, course.events
            late = np.where(numbers >= 0, numbers, 0)
            at = self.slices["event"]
            values[at] = times[late] if len(times) else self.run.end
            values[at][numbers < 0] = course.mesh.t[-1]
        return values

    def _sense(self, course: Course, name: str, t: Array, y: Array, phases: Places) -> Array:
        """What a sensor that is right sees of states (n, 2 nq), shape (n,)."""
        names, nq = self.problem.kernels.coordinates, self.problem.nq
        if name in names:
            return y[:, names.index(name)]
        rates = [*map(velocity_name, names)]
        if name in rates:
            return y[:, nq + rates.index(name)]
        q, v, model = y[:, :nq].copy(), y[:, nq:].copy(), course.laws.model
        momenta = [*map(momentum_name, names)]
        if name in momenta:
            return model.momentum(q, v, t)[:, momenta.index(name)]
        return self._quantity(course, name, (q, v, course.mesh.inputs(t), t), phases)

    def _quantity(
        self, course: Course, name: str, state: tuple[Array, Array, Array, Array], phases: Places
    ) -> Array:
        model, values = course.laws.model, np.empty(len(phases))
        column = self.problem.kernels.quantities.index(name)
        for i in np.unique(phases):
            at, mode = phases == i, self.touch.modes[int(i)]
            q, v, u, t = (np.ascontiguousarray(x[at]) for x in state)
            pushed = accelerations_and_forces(model, mode, (q, v, u, t)) if model.ny else None
            values[at] = model.quantities(q, v, u, t, pushed)[:, column]
        return values


def _same(word: str, own: str) -> bool:
    """Whether an event that was seen may be one of a word: "floor" is any hit of it."""
    return word == own or own.split(":")[0] == word
