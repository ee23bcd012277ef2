"""Forward simulation by the variational integrator with the collision time step."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dmoc.base.arguments import array, function, positive, shown, whole
from dmoc.base.errors import SimulationError
from dmoc.base.records import record
from dmoc.base.tolerances import ROUNDING
from dmoc.codegen.kernels import Array, Kernels
from dmoc.mechanics.coefficients import check_coefficients
from dmoc.mechanics.model import Model
from dmoc.mechanics.model_values import (
    ParameterValue,
    parameter_rows,
    restitution_row,
)
from dmoc.mechanics.phase_models import PhaseModels, check_geometry
from dmoc.motion.trajectory import Collision
from dmoc.simulation.contact_modes import names_without_effect
from dmoc.simulation.contact_motion import node, on_surfaces, start
from dmoc.simulation.given_inputs import nodes
from dmoc.simulation.grips import Grasp, grasps_of
from dmoc.simulation.impact_orders import Undecided, notes_of, undecided_of
from dmoc.simulation.mode_choice import Setting
from dmoc.simulation.motion_record import (
    ContactState,
    ModeChange,
    MotionRecord,
    Rows,
    Stretch,
    phases_at,
)
from dmoc.simulation.simultaneous_impacts import Lasting
from dmoc.simulation.start_state import state_of
from dmoc.simulation.steered import Control, steered
from dmoc.simulation.stepper import Stepper
from dmoc.simulation.tolerances import RATE

# Steps of a run: more take weeks.
MOST_STEPS = 10**12
# Memory for the recorded nodes.
MOST_BYTES = 4 * 10**9
# Steps of a flight that resolve it: what comes to rest is followed more closely from there on.
RESOLVED = 20
SECONDS = "expected a positive number of seconds, and a finite time of all steps"
# A gap that is what sines and cosines leave of zero, where a surface goes through the origin and no
# coordinate has a size to compare it with.
LEFT_OF_ZERO = 1e-14


@record(frozen=True, eq=False)
class Run:
    """What a simulation has recorded: the fields of :class:`dmoc.Simulation` but for its
    trajectory, and what that is made of."""

    t: Array
    q: Array
    v: Array
    p: Array
    energy: Array
    u: Array  # of the steps, (steps, nu)
    collisions: tuple[Collision, ...]
    contacts: tuple[Stretch, ...]
    rubbing: tuple[Stretch, ...]
    normal: Array
    tangential: Array
    notes: tuple[str, ...]
    # Impacts and changes of the mode, where contacts last or something rubs.
    marks: tuple[ModeChange, ...]
    models: PhaseModels
    changes: Array  # times of events behind which parameters are others
    restitution: Array
    step_size: float

    @property
    def model(self) -> Model:
        """The model at the start; what does not change by phase is that of all phases."""
        return self.models[0]

    def model_of(self, t: float, after: bool) -> Model:
        """The model before or after what happens at a time."""
        if not self.models.change:
            return self.models[0]
        return self.models[min(int(phases_at(self.changes, t, after)), len(self.models.par) - 1)]


def simulate(
    kernels: Kernels,
    position: Mapping[str, float] | ArrayLike | None,
    velocity: Mapping[str, float] | ArrayLike | None = None,
    *,
    step_size: float | None,
    steps: int | None,
    inputs: ArrayLike | Callable[[float], ArrayLike] | None = None,
    parameters: Mapping[str, ParameterValue] | None = None,
    restitution: float | Mapping[str, float] | None = None,
    grips: Mapping[str, Any] | Sequence[Grasp] | None = None,
    every: int = 1,
    control: Control | None = None,
) -> Run:
    """Simulate a system through its collisions, lasting contacts and friction.
    :func:`dmoc.simulate` says what the arguments are, with shapes (nq,), (nq,) and (steps, nu) of
    ``position``, ``velocity`` and ``inputs``, and that what is left out is refused. A control
    decides on the inputs of each step when it begins."""
    if not isinstance(kernels, Kernels):
        raise SimulationError(
            f"kernels = {shown(kernels)}: expected a MechanicalSystem, or the kernels of a model "
            "from dmoc.build(system) or dmoc.load(name)."
        )
    nq, nu = len(kernels.coordinates), len(kernels.inputs)
    steps = whole(steps, "steps", 1, MOST_STEPS, SimulationError)
    every = whole(every, "every", 1, MOST_STEPS, SimulationError)
    h = positive(step_size, "step_size", SECONDS, SimulationError)
    if not h * steps < np.inf:
        raise SimulationError(f"step_size = {h:g}: {SECONDS}.")
    _check_room(steps, every, nq, len(kernels.surfaces) + len(kernels.tangents))
    stated = {} if parameters is None else parameters
    models = PhaseModels(kernels, parameter_rows(kernels, stated, None, SimulationError))
    check_geometry(models, SimulationError)
    model = models[0]
    q, v = state_of(kernels, position, velocity)
    u = _inputs(inputs, h, steps, nu) if control is None else np.zeros((steps, nu))
    e = restitution_row(kernels, restitution, SimulationError)
    for there in models.different:
        check_coefficients(there, SimulationError)
    run = _SimulationTask(models, u, h, every, control, grasps_of(model, grips))
    with np.errstate(all="ignore"):  # what overflows has no solution, and is told as that
        _check_start(model, q, v, u[0])
        held = model.has_friction.any() or model.rubs_in_hits or model.nj or model.ends
        if control or held or model.contacts.grips or models.change:
            states = run.recorded(q, model.momentum(q, v))
            journal = _through_contacts(run, e, q, v, 0, states)
        else:
            states, journal = _from_impact_to_impact(run, e, q, model.momentum(q, v))
        there = journal.model_at(models, states.t)
        velocities = there.velocity(states.q, states.p, states.t)
        if not np.isfinite(velocities).all():
            raise SimulationError(
                "the mass matrix is singular where the motion ends: check the parameters, and stop "
                "before it."
            )
        energy = there.energy(states.q, velocities, states.t)
    journal.note(model, None, h * steps)
    return Run(
        states.t, states.q, velocities, states.p, energy, u,
        tuple(_with_rates(models, journal)),
        tuple(s for s in journal.stretches if s.friction is None),
        tuple(s for s in journal.stretches if s.friction is not None),
        states.normal, states.tangential,
        (*_notes(model, journal.marks), *notes_of(model, journal.undecided)),
        tuple(journal.marks), models, np.array(journal.changes), e, h,
    )  # fmt: skip


def _notes(model: Model, marks: list[ModeChange]) -> Iterator[str]:
    """Notes on what the laws of contact and friction do not determine, each mode once."""
    for mode, mark in {mark.mode: mark for mark in reversed(marks)}.items():
        at = mark.after
        q = at.y[: model.nq]
        there = model.with_friction_at(q[None], t=at.t)
        closed, stuck = names_without_effect(there, mode, q, at.t)
        forces = [
            f"{what} of {' and '.join(map(repr, names))}"
            for what, names in (("the contact forces", closed), ("the friction", stuck))
            if names
        ]
        if forces:
            yield (
                f"{' and '.join(forces)} from {at.t:.6g} s on are not unique (statically "
                "indeterminate): other forces hold the same motion, those shown are borne by the "
                "contacts"
            )


@record(frozen=True, eq=False)
class _Recorded:
    """Recorded nodes, filled one by one; ``p`` are velocities until the momenta are known."""

    t: Array
    q: Array
    p: Array
    normal: Array
    tangential: Array

    def put(self, row: int, of: Rows) -> None:
        """Put nodes from a row on."""
        (y, normal, tangential), nq, at = of, self.q.shape[1], slice(row, row + len(of[0]))
        self.q[at], self.p[at] = y[:, :nq], y[:, nq : 2 * nq]
        self.normal[at], self.tangential[at] = normal, tangential

    def momenta_from(self, row: int, journal: MotionRecord, models: PhaseModels) -> None:
        """Put the momenta of the nodes from a row on in the place of their velocities."""
        q, v, t = self.q[row:], self.p[row:], self.t[row:]
        if len(t):
            self.p[row:] = journal.model_at(models, t).momentum(q, v, t)


@record(frozen=True, eq=False)
class _SimulationTask:
    """The model of each phase, inputs of all steps (steps, nu), the size of a step, how many go by
    between recorded nodes, what decides on the inputs on the way, if something does, and when grips
    close and let go."""

    models: PhaseModels
    u: Array
    h: float
    every: int
    control: Control | None = None
    grasps: tuple[Grasp, ...] = ()

    @property
    def model(self) -> Model:
        """The model at the start."""
        return self.models[0]

    def recorded(self, q: Array, p: Array) -> _Recorded:
        """Arrays for the nodes, of which the first one has the position q and the momenta p, shape
        (nq,)."""
        rows, model = len(self.u) // self.every + 1, self.model
        times = np.arange(rows, dtype=float) * (self.h * self.every)
        states = _Recorded(
            times, np.empty((rows, model.nq)),
            np.empty((rows, model.nq)), *self.forces(rows),
        )  # fmt: skip
        states.q[0], states.p[0] = q, p
        return states

    def forces(self, rows: int) -> tuple[Array, Array]:
        """Zero contact forces, shape (rows, nc), and friction, shape (rows, nt)."""
        return np.zeros((rows, self.model.nc)), np.zeros((rows, self.model.nt))


def _from_impact_to_impact(
    run: _SimulationTask, e: Array, q: Array, p: Array
) -> tuple[_Recorded, MotionRecord]:
    """The motion by the variational integrator, as far as that goes."""
    model = run.model
    stepper = Stepper(model.kernels, model.par, e)
    try:
        states = stepper.run(q, p, run.u, run.h, run.every)
    except Lasting:
        last, before_it = stepper.unfinished
        first = _before_dying(last, [c[0] for c in stepper.collisions])
        if first > 0:
            to_there = Stepper(model.kernels, model.par, e)
            _, ways, momenta = to_there.run(q, p, run.u[:first], run.h, first)
            q, p = ways[-1], momenta[-1]
        recorded = _Recorded(*before_it, *run.forces(len(before_it[0])))
        v = model.velocity(q, p, first * run.h)
        journal = _through_contacts(run, e, q, v, first, recorded)
        before = [c for c in stepper.collisions if c[0] < first]
        journal.collisions[:0] = _collisions(model, before)
        journal.undecided[:0] = _undecided(model, stepper, first)
        return recorded, journal
    journal = MotionRecord(list(_collisions(model, stepper.collisions)))
    journal.undecided += _undecided(model, stepper, len(run.u))
    return _Recorded(*states, *run.forces(len(states[0]))), journal


def _before_dying(last: int, struck: list[int]) -> int:
    """The step from which on collisions, each in its step, follow one another up to the last
    one so closely that steps do not resolve the flights in between."""
    for step in reversed(struck):
        if last - step > RESOLVED:
            break
        last = step
    return last


def _collisions(model: Model, records: list[list[Any]]) -> Iterator[Collision]:
    for _, time, j, lam, at, before, after in records:
        yield Collision(model.kernels.surfaces[j], time, at, float(lam), before, after)


def _undecided(model: Model, stepper: Stepper, steps: int) -> Iterator[Undecided]:
    """The moments within the first steps at which the order of impacts decides."""
    for step, t, q, p, impacts in stepper.undecided:
        if step < steps:
            yield undecided_of(model, (q, model.velocity(q, p, t), t), impacts)


def _with_rates(models: PhaseModels, journal: MotionRecord) -> Iterator[Collision]:
    """The collisions with the rates of their gaps on both sides."""
    collisions = journal.collisions
    if not collisions:
        return
    model = journal.model_at(models, np.array([c.time for c in collisions]), after=False)
    q, t = np.array([c.position for c in collisions]), np.array([c.time for c in collisions])
    sides = [c.momentum_before for c in collisions], [c.momentum_after for c in collisions]
    before, after = (model.gap_rates(q, model.velocity(q, np.array(p), t), t) for p in sides)
    for i, c in enumerate(collisions):
        j = model.surface_numbers[c.surface]
        yield replace(c, rate_before=float(before[i, j]), rate_after=float(after[i, j]))


def _through_contacts(
    run: _SimulationTask, e: Array, q: Array, v: Array, first: int, states: _Recorded
) -> MotionRecord:
    """The motion from the step ``first`` on by the continuous equations of its modes."""
    setting, journal = Setting(run.model, e, run.h, run.models.different[1:]), MotionRecord()
    t = first * run.h
    y = on_surfaces(setting, np.concatenate([q, v]), t, ROUNDING)
    journal.last = ContactState(t, y, np.zeros(run.model.nc), np.zeros(run.model.nt))
    ways = (
        steered(setting, y, run.u, run.control, journal, run.grasps)
        if run.control
        else nodes(setting, y, run.u, first, journal, run.grasps)
    )
    k = first
    for rows in ways:
        ends, normal, tangential = (of[-(k + 1) % run.every :: run.every] for of in rows)
        states.put(k // run.every + 1, (ends, normal, tangential))
        k += len(rows[0])
    if first % run.every == 0:
        mode = start(setting, y, run.u[first], t)
        states.put(first // run.every, node(setting, mode, y, run.u[first], t).rows)
    states.momenta_from(-(-first // run.every), journal, run.models)
    return journal


def _check_start(model: Model, q: Array, v: Array, u: Array) -> None:
    """Refuse a position behind a surface, a state that its joints do not allow, and one without
    forces."""
    if not np.isfinite(model.equations(q, v, u)[1]).all():
        raise SimulationError(
            "the forces at the start are not numbers: something divides by 0 there, or takes a "
            "root or a logarithm of what has none; start elsewhere, or state forces that have a "
            "value there."
        )
    gaps = model.barriers(q, 0.0, model.within_rounding(q))
    gaps[model.contacts.pull] = 0.0
    for name, gap, near in zip(model.kernels.surfaces, gaps, model.gap_rounding(q), strict=True):
        if gap > max(near, LEFT_OF_ZERO):
            raise SimulationError(
                f"position lies behind surface {name!r} by {gap:g}: expected a start in "
                "front of it, or on it."
            )
    slopes = np.abs(model.joint_slopes(q))
    sizes = model.joint_rounding(q), RATE * (slopes @ np.append(np.abs(v), 1.0))
    values = model.joints(q), model.joint_rates(q, v)
    for what, off, size in zip(("position", "velocity"), values, sizes, strict=True):
        for name, by, near in zip(model.kernels.joints, off, size, strict=True):
            if not abs(by) <= max(near, LEFT_OF_ZERO):
                raise SimulationError(
                    f"{what} does not fit joint {name!r}, which is off by {by:g}: expected a start "
                    "that keeps it at zero."
                )


# What a user gives --------------------------------------------------------------------------------


def _check_room(steps: int, every: int, nq: int, forces: int) -> None:
    """Refuse what the recorded nodes, their mass matrices among it, would not fit into, before
    anything is allocated."""
    size = 8 * (steps // every + 1) * (2 + 6 * nq + nq * nq + forces)
    if size > MOST_BYTES:
        raise SimulationError(
            f"steps = {steps} with every = {every}: recording {steps // every + 1} nodes needs "
            f"{size / 1e9:.3g} GB of memory, at most "
            f"{MOST_BYTES / 1e9:.3g} GB are used; record fewer nodes, with every = "
            f"{-(-every * size // MOST_BYTES)} or more."
        )


def _inputs(
    values: ArrayLike | Callable[[float], ArrayLike] | None, h: float, steps: int, nu: int
) -> Array:
    """Inputs of all steps, shape (steps, nu); a row that serves all steps is not copied."""
    if values is None:
        return np.broadcast_to(np.zeros(nu), (steps, nu))
    shapes: tuple[tuple[int, ...], ...] = ((nu,), (steps, nu))
    expected = f"numbers of shape ({steps}, {nu}) or ({nu},)"
    if callable(values):
        shapes, expected = ((steps, nu),), f"a function of the time that returns {nu} numbers"
        call = function(values, "inputs", "the time")
        values = [np.ravel(call((k + 0.5) * h)) for k in range(steps)]
    u = array(values)
    if u is None or u.shape not in shapes:
        raise SimulationError(f"inputs: expected {expected}.")
    if not np.isfinite(u).all():
        raise SimulationError("inputs contain a value that is not finite: expected finite numbers.")
    return np.broadcast_to(u, (steps, nu))
