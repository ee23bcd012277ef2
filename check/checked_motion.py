"""A motion that is to be checked: its data beside the flow of its model."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence, Sized
from dataclasses import replace
from functools import cached_property, partial
from itertools import groupby, pairwise
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from dmoc.base.arguments import check_known
from dmoc.base.deadline import Deadline
from dmoc.base.discretisation import DISCRETISATIONS
from dmoc.base.errors import SimulationError
from dmoc.base.records import record
from dmoc.check.arcs import allowance, arcs_of
from dmoc.check.passages import EventPassage, passage_of
from dmoc.codegen.kernels import Array, Kernels
from dmoc.mechanics.coefficients import check_coefficients
from dmoc.mechanics.contact_mode import Mode, mode_by_names
from dmoc.mechanics.contacts import RAIL
from dmoc.mechanics.model import Model
from dmoc.mechanics.model_values import parameter_rows, restitution_row
from dmoc.mechanics.phase_models import PhaseModels, check_geometry
from dmoc.motion.trajectory import Phase, Trajectory
from dmoc.simulation.flow import Flow, Steps
from dmoc.simulation.sizes import Nodes, Sizes, inertia_along, nodes_of, sizes_of

SEGMENTS = 10  # of a phase
T = TypeVar("T")


class OutOfTimeError(SimulationError):
    """The check was not finished in its time."""


def out_of_time(deadline: Deadline) -> None:
    """End a check whose deadline has passed."""
    if deadline.passed:
        raise OutOfTimeError("the time for the check was used up: raise it, or take fewer steps.")


@record(frozen=True, eq=False)
class ModeSpan:
    """Phases one after the other in the same mode: their numbers, the places of their steps among
    those of the motion, and these."""

    mode: Mode
    numbers: tuple[int, ...]
    places: slice
    steps: Steps


class PlannedNodes(NamedTuple):
    """The nodes of a phase, and behind them those inside its steps: positions, velocities, times,
    the inputs before and after each, and the planned forces of closed contacts, of what rubs and of
    joints."""

    q: Array
    v: Array
    t: Array
    inputs: tuple[Array, Array]
    normal: Array
    tangential: Array
    reaction: Array


class HeldNodes(NamedTuple):
    """The nodes of a motion, those of phases that have steps moved to where the conditions of their
    modes hold: states (n, 2 nq), the tangential positions that they keep (n, nt), and by how much
    their momenta have changed (n, nq)."""

    y: Array
    anchors: Array
    moved: Array


@record(frozen=True, eq=False)
class Motion:
    """A motion, its models with the parameters of the phases, its nodes and sizes, its steps, the
    places of the first step of each phase and of the end, its phases as modes, and the flow it is
    compared with: where parameters change, model and flow are those of one phase, ``own``."""

    trajectory: Trajectory
    models: PhaseModels
    model: Model
    nodes: Nodes
    sizes: Sizes
    flow: Flow
    run: Steps
    begins: NDArray[np.intp]
    modes: tuple[Mode, ...]
    check_time: Callable[[], None]
    own: int | None = None

    @classmethod
    def of(cls, trajectory: Trajectory, kernels: Kernels, deadline: Deadline) -> Motion:
        """Read a motion that is to be checked until a deadline."""

        check_time = partial(out_of_time, deadline)
        check_shapes(trajectory)
        restitution = restitution_row(kernels, trajectory.restitution, SimulationError)
        stated = kernels, trajectory.parameters, len(trajectory.phases), SimulationError
        models = PhaseModels(kernels, parameter_rows(*stated))
        check_geometry(models, SimulationError)
        model = models[0]
        for there in models.different:
            check_coefficients(there, SimulationError)
        same = dict[Mode, Mode]()  # one of those that are alike, to be entered once
        every = (_mode_of(phase, model) for phase in trajectory.phases)
        modes = tuple(same.setdefault(mode, mode) for mode in every)
        nodes = nodes_of(trajectory, models)
        sizes = sizes_of(trajectory, nodes)
        arcs = arcs_of(trajectory, nodes, sizes)
        run = Steps(nodes.t[nodes.starts], nodes.h, *nodes.inputs)
        begins = nodes.begins - np.arange(len(nodes.begins))
        passed = tuple(model.surface_numbers[name] for name in trajectory.ignored)
        allowed = allowance(arcs, model.nc, (*passed, *model.contacts.of_grips))
        flow = Flow(model, sizes, restitution, allowed, check_time)
        return cls(trajectory, models, model, nodes, sizes, flow, run, begins, modes, check_time)

    def within(self, i: int) -> Motion:
        """The motion with the model and the flow of phase i."""
        return self._each[i] if self.models.change else self

    @cached_property
    def _each(self) -> tuple[Motion, ...]:
        flow, models = self.flow, [self.models[i] for i in range(len(self.modes))]
        flows = [
            Flow(model, self.sizes, flow.restitution, flow.allowance, self.check_time)
            for model in models
        ]
        every = enumerate(zip(models, flows, strict=True))
        return tuple(replace(self, model=model, flow=f, own=i) for i, (model, f) in every)

    def by_values(self, courses: Sequence[T]) -> Iterator[tuple[Motion, Sequence[T]]]:
        """The parts of the motion that have the same parameters, with what belongs to their pieces:
        nothing of a last phase that has no steps."""
        if not self.models.change:
            yield self, courses
            return
        for piece, course in zip(self.pieces, courses, strict=True):
            yield self.within(piece.numbers[0]), [course]
        if self.stepped < len(self.modes):
            yield self.within(-1), []

    @property
    def last_node(self) -> Iterator[tuple[Mode, Phase]]:
        """The mode and the last phase where this has no steps, of a part where it is its own."""
        if self.stepped < len(self.modes) and self.own in (None, self.stepped):
            yield self.modes[-1], self.trajectory.phases[-1]

    def steps_of(self, i: int) -> slice:
        """The places of the steps of a phase."""
        return slice(int(self.begins[i]), int(self.begins[i + 1]))

    @cached_property
    def steps(self) -> tuple[Steps, ...]:
        """The steps of each phase."""
        return tuple(self.run.part(self.steps_of(i)) for i in range(len(self.modes)))

    @cached_property
    def upper(self) -> Array:
        """Gaps that no step exceeds without a contact, at its places, as :meth:`Flow.upper` has
        them, shape (N, places, nc)."""
        return self.flow.upper(self.run)

    @cached_property
    def needed_inputs(self) -> Array:
        """Inputs that accelerate as much as the forces of the motion, shape (nu,); infinite for one
        that does not."""
        nodes = self.nodes
        if not self.model.nu:
            return np.zeros(0)
        B = nodes.model.input_matrix(nodes.q, nodes.v, t=nodes.t)
        inertia = inertia_along(nodes, np.swapaxes(B, 1, 2))
        return np.asarray(self.sizes.acceleration / np.sqrt(inertia))

    @cached_property
    def passages(self) -> tuple[EventPassage, ...]:
        """The events between the phases."""
        joined = zip(self.trajectory.collisions, pairwise(self.trajectory.phases), strict=True)
        sizes, restitution = np.concatenate([self.sizes.q, self.sizes.v]), self.flow.restitution
        ends = self.nodes.begins[1:-1] - 1
        (before, after), timed = self.nodes.u, self.has_modes
        inputs = [
            None if timed or c.switch else np.array([before[k], after[k + 1]])
            for k, c in zip(ends, self.trajectory.collisions, strict=True)
        ]
        return tuple(
            passage_of((self.models[i], self.models[i + 1]), restitution, *part, own, (sizes, u))
            for i, (part, own, u) in enumerate(zip(joined, self.modes[1:], inputs, strict=True))
        )

    @cached_property
    def nodes_inside(self) -> Array:
        """Places in a step of the nodes inside it."""
        return DISCRETISATIONS[self.trajectory.order].nodes[2:]

    @cached_property
    def places(self) -> tuple[PlannedNodes, ...]:
        """The nodes of each phase, and those inside its steps."""
        return tuple(map(self._places, range(len(self.modes))))

    def _places(self, i: int) -> PlannedNodes:
        phase, steps, nq = self.trajectory.phases[i], self.steps[i], self.model.nq
        q = phase.q_inside.reshape(-1, nq)
        shares = self.nodes_inside if len(q) else self.nodes_inside[:0]
        t = (steps.t[:, None] + shares * steps.h[:, None]).ravel()
        inputs = np.zeros((len(steps.t), len(shares), self.model.nu))
        for a, share in enumerate(shares):
            inputs[:, a] = steps.inputs(share)
        u = inputs.reshape(len(t), self.model.nu)
        before, after = self.trajectory.input_sides(phase)
        v = self.models[i].velocity(q, phase.p_inside.reshape(-1, nq), t) if len(q) else q

        def forces(kind: str, names: Sized) -> Array:
            if not names:
                return np.zeros((len(phase.t) + len(t), 0))
            inside = phase.inside(kind).reshape(-1, len(names))
            return np.concatenate([getattr(phase, kind), inside])

        return PlannedNodes(
            np.concatenate([phase.q, q]),
            np.concatenate([phase.v, v]),
            np.concatenate([phase.t, t]),
            (np.concatenate([before, u]), np.concatenate([after, u])),
            forces("normal", phase.closed),
            forces("tangential", phase.rubbing),
            forces("reaction", phase.joints),
        )

    @cached_property
    def held(self) -> HeldNodes:
        """The nodes in the modes of their phases; of a phase of its own, those of this one."""
        nodes, nq, model = self.nodes, self.model.nq, self.model
        y, anchors, moved = (
            nodes.y.copy(),
            np.zeros((len(nodes.t), model.nt)),
            np.zeros_like(nodes.p),
        )
        for piece in self.pieces:
            at = slice(*nodes.begins[[piece.numbers[0], piece.numbers[-1] + 1]].tolist())
            if holds(self, piece.mode):
                y[at], anchors[at] = put(self, piece.mode, nodes.y[at], nodes.t[at])
                p = model.momentum(y[at, :nq], y[at, nq:], nodes.t[at])
                moved[at] = p - nodes.momentum[at]
        return HeldNodes(y, anchors, moved)

    @cached_property
    def rubbing(self) -> tuple[Model, ...]:
        """The model with its friction at the places of each phase that has steps, with the inputs
        before each and after it, shape (2, n, nt), or (nt,) where it does not vary."""
        return tuple(map(self._rubbing, range(self.stepped)))

    def _rubbing(self, i: int) -> Model:
        at, model = self.places[i], self.models[i]
        if not model.varying_friction:
            return model
        sides = [model.with_friction_at(at.q, at.v, u, at.t) for u in at.inputs]
        shape = 2, len(at.t), model.nt
        kinds = ([s.friction for s in sides], [s.static_friction for s in sides])
        by_place = [np.stack([np.broadcast_to(mu, shape[1:]) for mu in kind]) for kind in kinds]
        return model.with_coefficients(*by_place)

    @cached_property
    def watched(self) -> NDArray[np.bool_]:
        """Surfaces that hold back a motion that comes to them, neither ignored nor places of grips,
        shape (nc,)."""
        surfaces = self.model.kernels.surfaces
        ignored = np.array([name in self.trajectory.ignored for name in surfaces], dtype=bool)
        return ~(ignored | self.model.contacts.pull)

    @cached_property
    def has_modes(self) -> bool:
        """Whether phases go on as they are planned: contacts last or something rubs, or should, as
        rails do always and surfaces with friction where they are hit, or parameters change."""
        trajectory, model = self.trajectory, self.model
        events = [c for c in trajectory.collisions if not c.switch]
        hit = {model.surface_numbers[c.surface] for c in events if c.surface}
        return (
            self.models.change
            or not all(phase.free for phase in trajectory.phases)
            or any(
                c.lands or c.leaves or not (c.surface or c.switch) for c in trajectory.collisions
            )
            or any(
                j in (RAIL, *hit)
                for j, mu in zip(model.supports, model.hit_friction, strict=True)
                if mu
            )
        )

    @cached_property
    def stepped(self) -> int:
        """Number of phases that have steps: all, or all but the last."""
        return sum(phase.steps > 0 for phase in self.trajectory.phases)

    @cached_property
    def pieces(self) -> tuple[ModeSpan, ...]:
        """The phases that have steps, those one after the other in the same mode and with the same
        parameters together; of a phase of its own, this one."""
        phases = range(self.stepped) if self.own is None else [self.own][: self.own < self.stepped]
        change = self.models.change
        together = groupby(phases, key=lambda i: (self.modes[i], change and i))
        return tuple(self._piece(mode, list(numbers)) for (mode, _), numbers in together)

    def _piece(self, mode: Mode, numbers: list[int]) -> ModeSpan:
        places = slice(int(self.begins[numbers[0]]), int(self.begins[numbers[-1] + 1]))
        return ModeSpan(mode, tuple(numbers), places, self.run.part(places))

    def errors(self, y: Array, t: Array, q_wanted: Array, p_wanted: Array) -> Array:
        """Relative errors of the positions and momenta (n, 2 nq) of rows y = (q | v ...) at times
        (n,), from those that are wanted, shape (n, nq) each."""
        nq, off = self.model.nq, np.empty((len(y), 2 * self.model.nq))
        q, v = y[:, :nq], y[:, nq : 2 * nq]
        off[:, :nq] = (q - q_wanted) / self.sizes.q
        off[:, nq:] = (self.model.momentum(q, v, t) - p_wanted) / self.sizes.p
        return np.abs(off)


def put(motion: Motion, mode: Mode, y: Array, t: Array) -> tuple[Array, Array]:
    """Rows (q | v ...), shape (n, 2 nq or more), at times (n,), moved to where the conditions of a
    mode hold, and the tangential positions that they keep, shape (n, nt)."""
    if not holds(motion, mode):
        return y, np.zeros((len(y), motion.model.nt))
    y = y.copy()
    anchors = motion.model.tangents(np.ascontiguousarray(y[:, : motion.model.nq]), t)
    motion.flow.integrator.project(mode, y, t, anchors)
    return y, anchors


def holds(motion: Motion, mode: Mode) -> bool:
    """Whether a mode has conditions that hold positions."""
    return bool(mode.closed or mode.sticking or motion.model.nj)


def check_shapes(trajectory: Trajectory) -> None:
    """Refuse arrays that do not fit together."""
    phases, events = len(trajectory.phases), len(trajectory.collisions)
    if events != phases - 1:
        raise SimulationError(
            f"the motion has {phases} phases and {events} events: expected an event between any "
            "two phases."
        )
    for i, phase in enumerate(trajectory.phases):
        if not phase.steps and not 0 < i == events:
            raise SimulationError(
                f"phase {i} of the motion has no steps: expected some, but in the last of several "
                "phases."
            )
        rows = trajectory.input_form.rows(phase.steps)
        inside = DISCRETISATIONS[trajectory.order].inside * phase.steps
        nq = len(trajectory.coordinates)
        for name, shape in (
            *((name, (phase.steps + 1, nq)) for name in "qpv"),
            ("u", (rows, len(trajectory.inputs))),
            *((f"{name}_inside", (inside, nq)) for name in "qp" if inside),
        ):
            if getattr(phase, name).shape != shape:
                raise SimulationError(
                    f"{name} of the phase from {phase.t[0]:.4g} s on has the shape "
                    f"{getattr(phase, name).shape}: expected {shape} for its {phase.steps} steps."
                )


def _mode_of(phase: Phase, model: Model) -> Mode:
    """The mode of a phase."""
    for kind, names, numbers, what in (
        ("normal", phase.closed, model.surface_numbers, "closed surface"),
        ("tangential", phase.rubbing, model.tangent_numbers, "rubbing tangent"),
        ("reaction", phase.joints, model.kernels.joints, "constraint"),
    ):
        for name in names:
            check_known(name, numbers, what, error=SimulationError)
        rows, inside = len(phase.t), len(phase.q_inside)
        for forces, count in ((getattr(phase, kind), rows), (phase.inside(kind), inside)):
            shape = (count, len(names))
            if names and count and forces.shape != shape:
                raise SimulationError(
                    f"{kind} forces of the phase from {phase.t[0]:.4g} s on have the shape "
                    f"{forces.shape}: expected {shape}, a column for each of {', '.join(names)}."
                )
    return mode_by_names(model.contacts, phase.closed, phase.rubbing)


def nodes_of_segments(steps: int) -> NDArray[np.intp]:
    """First nodes of the segments of a phase, and its last node."""
    segments = min(SEGMENTS, steps)
    return (np.arange(segments + 1) * (steps / segments)).round().astype(np.intp)
