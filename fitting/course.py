"""A motion that follows a word: the flow of one mode after the other, each until its event.

What happens is what the word says, so that the motion is a smooth function of parameters and start
where laws would choose another mode; whether laws agree is looked at once the parameters are known.
A state may be asked for a little beyond the phase that it belongs to: there the flow of the phase
goes on, so that differences by parameters see no jump where a hit passes a sample.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dmoc.base.records import record
from dmoc.check.impact_law import ImpactLaw
from dmoc.codegen.kernels import Array
from dmoc.mechanics.contact_mode import FREE, Event, Mode
from dmoc.mechanics.contacts import NOWHERE
from dmoc.mechanics.model import Model
from dmoc.mechanics.touch import Touch, friction_changes
from dmoc.motion.friction import sticks
from dmoc.simulation.contact_modes import limits
from dmoc.simulation.flow import FIRST
from dmoc.simulation.integrator import Integrator
from dmoc.simulation.roots import crossing

# Steps that are integrated before it is looked whether an event has happened in them.
AT_ONCE = 128
# Share of a run that a motion goes on for after its last event.
AFTER = 0.02
# Doublings of a step that a phase goes back for an event that has happened before it.
BACK = 7
# Share of the time of a run to which events are located.
LOCATED = 1e-15

# A function of rows of states (n, 2 nq), inputs (n, nu) and times (n,) that is negative until an
# event happens, shape (n,).
Guard = Callable[[Array, Array, Array], Array]


@record(frozen=True, eq=False)
class Mesh:
    """Steps of a run: times (M + 1,), and inputs at both ends of each (M, nu), linear between."""

    t: Array
    u0: Array
    u1: Array

    def inputs(self, t: Array) -> Array:
        """Inputs at times, shape (n,), those of the step that begins where two meet; (n, nu)."""
        if not self.u0.shape[1]:
            return np.zeros((len(t), 0))
        k = np.searchsorted(self.t[1:-1], t, side="right")
        share = (t - self.t[k]) / (self.t[k + 1] - self.t[k])
        share = np.minimum(np.maximum(share, 0.0), 1.0)[:, None]
        return np.asarray((1 - share) * self.u0[k] + share * self.u1[k])

    def after(self, t: float) -> Mesh:
        """The steps from a time on, which is before the end."""
        k = max(int(np.searchsorted(self.t, t, side="right")) - 1, 0)
        first = self.inputs(np.array([t]))
        return Mesh(
            np.concatenate([[t], self.t[k + 1 :]]),
            np.vstack([first, self.u0[k + 1 :]]),
            self.u1[k:],
        )


@record(frozen=True, eq=False)
class Arc:
    """A phase: nodes (n,) with their states (n, 2 nq), and the places (1, nt) that what sticks
    keeps."""

    mode: Mode
    t: Array
    y: Array
    held: Array


@record(frozen=True, eq=False)
class Course:
    """A motion: its phases, as many as it reaches, and those that the word has."""

    arcs: tuple[Arc, ...]
    laws: Laws
    mesh: Mesh

    @cached_property
    def events(self) -> Array:
        """Times of the events of the word; the end of the mesh of those that do not happen. One
        that comes sooner than the one before it shows that the word has them in a wrong order."""
        times = [arc.t[-1] for arc in self.arcs[:-1]]
        missing = len(self.laws.touch.events) - len(times)
        return np.array(times + [self.mesh.t[-1]] * missing)

    @property
    def whole(self) -> bool:
        """Whether all events of the word happen."""
        return len(self.arcs) == len(self.laws.touch.modes)

    @property
    def regular(self) -> bool:
        """Whether there are phases, and each has a duration."""
        return bool(self.arcs) and all(arc.t[-1] > arc.t[0] for arc in self.arcs)

    def phases(self, t: Array) -> NDArray[np.intp]:
        """The phase of each time, that after an event at it, shape (n,)."""
        times = np.maximum.accumulate(self.events[: len(self.arcs) - 1])
        return np.searchsorted(times, t, side="right")

    def states(self, t: Array, phase: NDArray[np.intp]) -> Array:
        """States (n, 2 nq) at times, each in a phase, whose flow goes on beyond its ends."""
        rows = np.empty((len(t), 2 * self.laws.model.nq))
        for i in np.unique(phase):
            at = phase == i
            rows[at] = self._in_arc(self.arcs[min(int(i), len(self.arcs) - 1)], t[at])
        return rows

    def _in_arc(self, arc: Arc, t: Array) -> Array:
        nodes = arc.t if arc.t[-1] > arc.t[0] else arc.t[:1]
        k = np.clip(np.searchsorted(nodes, t, side="right") - 1, 0, len(nodes) - 1)
        rows, h = arc.y[k].copy(), t - arc.t[k]
        away = np.flatnonzero(h)
        if len(away):
            rows[away] = self.laws.moved(arc, rows[away], arc.t[k[away]], h[away], self.mesh)
        return rows


@record(frozen=True, eq=False)
class Laws:
    """A model with its parameters and coefficients of restitution (nc,), and the word that its
    motion follows; ``sizes`` (2 nq,) are those that errors of integration are shares of."""

    model: Model
    restitution: Array
    touch: Touch
    sizes: Array

    @cached_property
    def integrator(self) -> Integrator:
        size = np.append(self.sizes, 1.0)
        return Integrator(self.model.kernels, self.model.par, size, lambda: None)

    @cached_property
    def impacts(self) -> tuple[ImpactLaw, ...]:
        """The laws of the events."""
        pairs = zip(self.touch.events, self.touch.modes[1:], strict=True)
        return tuple(self.law_of(*pair) for pair in pairs)

    def law_of(self, event: Event, after: Mode) -> ImpactLaw:
        """The law of an event before a mode."""
        return ImpactLaw.of(self.model, self.restitution, event, after)

    def follow(self, y: Array, mesh: Mesh, until: float) -> Course:
        """The motion from a state (2 nq,) until a time, and further, to the end of the mesh, where
        events of the word have not happened then."""
        t, arcs, modes = float(mesh.t[0]), list[Arc](), self.touch.modes
        for i, mode in enumerate(modes):
            more = i + 1 < len(modes)
            end = max(until, t + AFTER * (until - float(mesh.t[0])))
            arc = self._arc(i, mode, (t, y), mesh if more else _cut(mesh, end))
            arcs.append(arc)
            if not more or arc.t[-1] >= mesh.t[-1]:
                break
            t = float(arc.t[-1])
            y = self._after(i, arc.y[-1], t)
        return Course(tuple(arcs), self, mesh)

    def _after(self, i: int, y: Array, t: float) -> Array:
        """The state after an event."""
        q, v = (np.ascontiguousarray(part) for part in np.split(y[None], 2, axis=1))
        return np.concatenate(
            [y[: len(y) // 2], self.impacts[i].after(q, v, np.array([t])).velocity[0]]
        )

    def _put(self, mode: Mode, y: Array, t: float) -> tuple[Array, Array]:
        """A state, shape (2 nq,), moved to where the conditions of a mode hold, and what they
        keep."""
        rows, held = y[None].copy(), np.zeros((1, self.model.nt))
        if mode.closed or mode.sticking or self.model.nj:
            held = self.model.tangents(
                np.ascontiguousarray(rows[:, : self.model.nq]), np.array([t])
            )
            self.integrator.project(mode, rows, np.array([t]), held)
        return rows, held

    def moved(self, arc: Arc, y: Array, t: Array, h: Array, mesh: Mesh) -> Array:
        """States (n, 2 nq) at times (n,) gone on by times (n,) in the mode of a phase."""
        rows, number = y.copy(), np.arange(len(t))
        side = t + np.where(h < 0, 1e-9, 0.0) * h  # of two steps that meet, the one that is gone
        u0, u1 = mesh.inputs(side), mesh.inputs(t + (1 - 1e-9) * h)
        held = np.repeat(arc.held, len(t), axis=0)
        self.integrator.advance(rows, number, number + 1, t, h, u0, u1, _flow(arc.mode), held)
        return rows

    # Phases ---------------------------------------------------------------------------------------

    def _arc(self, i: int, mode: Mode, start: tuple[float, Array], mesh: Mesh) -> Arc:
        """A phase from its start, a time and a state, to its event, or to the end of the mesh."""
        t, y = start
        rows, held = self._put(mode, y, t)
        times, states = [np.array([t])], [rows.copy()]
        guard = self._guard(i) if i < len(self.touch.events) else None
        rest = mesh.after(t) if t < mesh.t[-1] else None
        for first in range(0, len(rest.u0) if rest else 0, AT_ONCE):
            assert rest is not None
            last = min(first + AT_ONCE, len(rest.u0))
            part = Mesh(rest.t[first : last + 1], rest.u0[first:last], rest.u1[first:last])
            nodes = self._nodes(mode, rows, held, part)
            if guard is not None:
                arc = Arc(mode, part.t, np.vstack([states[-1][-1:], nodes]), held)
                at = self._event(guard, arc, part, first == 0)
                if at is not None:
                    k, time, there = at
                    times += [part.t[1 : k + 1], np.array([time])]
                    states += [nodes[:k], there]
                    break
            times.append(part.t[1:])
            states.append(nodes)
        return Arc(mode, np.concatenate(times), np.vstack(states), held)

    def _nodes(self, mode: Mode, rows: Array, held: Array, part: Mesh) -> Array:
        """States (n, 2 nq) at the ends of some steps; ``rows`` (1, 2 nq) go on with them."""
        n, width = len(part.u0), rows.shape[1]
        course = np.empty((n, 3 * width))
        self.integrator.advance(
            rows, FIRST, np.array([n]), part.t[:-1].copy(), np.diff(part.t), part.u0,
            part.u1.copy(), _flow(mode), held, False, course,
        )  # fmt: skip
        return course[:, 2 * width :]

    def _event(
        self, guard: Guard, arc: Arc, part: Mesh, begins: bool
    ) -> tuple[int, float, Array] | None:
        """The step, the time and the state (1, 2 nq) of the first event among steps; what begins at
        its event has to leave first."""
        u = np.vstack([part.u0[:1], part.u1])
        value = guard(arc.y, u, part.t)
        if begins and abs(value[0]) <= np.abs(value).max() * 1e-9:
            value[0] = -1.0
        elif begins and value[0] > 0:
            return self._sooner(guard, arc, part, float(value[0]))
        over = np.flatnonzero((value[:-1] < 0) & (value[1:] >= 0))
        if not len(over):
            return None
        k = int(over[0])
        t, y, h = float(part.t[k]), arc.y[k : k + 1], float(part.t[k + 1] - part.t[k])

        def state(s: float) -> Array:
            return self.moved(arc, y, np.array([t]), np.array([s]), part)

        def gap(s: float) -> float:
            here = np.array([t + s])
            return float(guard(state(s), part.inputs(here), here)[0])

        size = LOCATED * max(abs(t), float(part.t[-1] - part.t[0]))
        s = crossing(gap, (0.0, float(value[k])), (h, float(value[k + 1])), size)
        return k, t + s, state(s)

    def _sooner(
        self, guard: Guard, arc: Arc, part: Mesh, value: float
    ) -> tuple[int, float, Array] | None:
        """An event that has happened before its phase begins: the phase goes back to it, so that
        where two events happen nearly at once their order does not matter to a fit."""
        t, y = part.t[:1], arc.y[:1]

        def gap(s: float) -> float:
            return float(
                guard(self.moved(arc, y, t, np.array([s]), part), part.inputs(t + s), t + s)[0]
            )

        back = -float(part.t[1] - part.t[0])
        for _ in range(BACK):
            there = gap(back)
            if there < 0:
                s = crossing(
                    gap, (back, there), (0.0, value), LOCATED * max(abs(float(t[0])), -back)
                )
                return 0, float(t[0]) + s, self.moved(arc, y, t, np.array([s]), part)
            back *= 2
        return None

    def _guard(self, i: int) -> Guard:
        """What says that an event happens."""
        event, model, nq = self.touch.events[i], self.model, self.model.nq
        before, after = self.touch.modes[i], self.touch.modes[i + 1]
        if event.impact:
            return lambda y, u, t: model.gaps(np.ascontiguousarray(y[:, :nq]), t)[:, event.surface]
        if event.switch != NOWHERE:

            def crossed(y: Array, u: Array, t: Array) -> Array:
                q, v = (np.ascontiguousarray(part) for part in np.split(y, 2, axis=1))
                return model.crossings(q, v, t)[:, event.switch]

            return crossed
        changed = friction_changes(before, after)
        if event.off:
            return lambda y, u, t: (
                -model.within(np.ascontiguousarray(y[:, :nq]), t)[:, event.off[0]]
            )
        if event.leaves:
            return self._ending(before, event.leaves[0])
        k = next(iter(changed))
        if not sticks(before.rubbing[k]):
            sign = before.rubbing[k]

            def slides(y: Array, u: Array, t: Array) -> Array:
                q, v = (np.ascontiguousarray(part) for part in np.split(y, 2, axis=1))
                return np.asarray(-sign * model.slide_rates(q, v, t)[:, k])

            return slides
        return self._ending(before, model.nc + k)

    def _ending(self, mode: Mode, column: int) -> Guard:
        """The event at which a limit of a mode is passed."""

        def passed(y: Array, u: Array, t: Array) -> Array:
            react = self.integrator.reaction
            return -limits(self.model, react, mode, (y, u, t))[:, column]

        return passed


def _flow(mode: Mode) -> Mode | None:
    return None if mode == FREE else mode


def _cut(mesh: Mesh, end: float) -> Mesh:
    """The mesh until the first node that is not before a time."""
    last = min(max(int(np.searchsorted(mesh.t, end, side="left")), 1), len(mesh.u0))
    return Mesh(mesh.t[: last + 1], mesh.u0[:last], mesh.u1[:last])
