"""The unknowns as the laws take them: of steps, nodes, places and phases."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property, lru_cache
from itertools import accumulate

import numpy as np

from dmoc.base.discretisation import FORMS
from dmoc.base.errors import ProblemError
from dmoc.base.names import momentum_name, velocity_name
from dmoc.codegen.kernels import Array
from dmoc.codegen.manifest import FunctionFacts
from dmoc.mechanics.model import Model
from dmoc.problem.derived import once
from dmoc.problem.design import designed, moves_by_design
from dmoc.problem.problem import Problem
from dmoc.program.blocks import NOWHERE, Index
from dmoc.program.force_unknowns import Wanted
from dmoc.program.liftoffs import liftoffs_of
from dmoc.program.reactions import EventImpulses, PhaseReaction
from dmoc.program.stations import Stations
from dmoc.program.unknowns import Kind, Unknowns, first_rows, steps_of_rows

# Layouts that are remembered, and the steps of one that is not.
SHARED, MOST_SHARED = 32, 5_000


class Layout(Unknowns):
    """Where the unknowns of steps, nodes, places and phases lie in x, shape (n,)."""

    @classmethod
    def of(cls, problem: Problem) -> Layout:
        """The layout of a problem."""
        return once(problem, cls._of)

    @classmethod
    def _of(cls, problem: Problem) -> Layout:
        _check_courses(problem)
        kernels = problem.kernels
        turning = {name for r in problem.relations for name in (*r.starts, r.end)}
        moving = [row["name"] for row in kernels.quantity_rows if row["velocities"]]
        turns = bool(turning & {*map(velocity_name, kernels.coordinates), *moving})
        joined = bool(kernels.joints)
        free = [mode.free and not joined for mode in problem.touch.modes]
        start = problem.start_bounds
        start_fixed = start.is_state and not moves_by_design(problem, start)
        at_start = turns or not (free[0] or start_fixed)
        at_goal = turns or not free[-1] or kernels.manifest.terminal_velocity
        if np.isfinite(problem.velocity_bounds).any():
            at_start |= not start_fixed
            at_goal = True
        rates = kernels.manifest.objective_velocities
        at_start, at_goal = at_start or rates[0], at_goal or rates[1]
        ranges = problem.quantity_ranges
        at_start |= any(row["velocities"] for row in _ranged_rows(problem, ranges.start))
        at_goal |= any(row["velocities"] for row in _ranged_rows(problem, ranges.goal))
        along = _ranged_rows(problem, problem.quantity_bounds)
        for j, _ in problem.model.peaks_of:
            row = kernels.quantity_rows[j]
            at_start, at_goal = at_start or row["velocities"], at_goal or row["velocities"]
        shared = FORMS[problem.control_form].shared
        for row in (*kernels.manifest.path_rows, *along):
            pushed = row.get("forces") and problem.scheme.inside
            if row["velocities"] and (shared or pushed or not row["inputs"]):
                at_start |= row["inputs"] or not start_fixed
                at_goal = True
        kind = Kind(
            tuple(kernels.coordinates),
            tuple(kernels.inputs),
            problem.model.hidden_names,
            problem.phase_steps,
            problem.control_form,
            problem.order,
            problem.explicit_time,
            tuple(problem.sequence),
            problem.start_bounds.needs_velocity or at_start,
            (problem.goal_bounds.needs_velocity or at_goal) and not problem.ends_with_event,
            problem.touch,
            tuple(kernels.joints),
            tuple(problem.model.totals_of),
            tuple(problem.model.peak_names),
            tuple(problem.design),
            _wanted_forces(problem, turning),
            liftoffs_of(problem),
        )
        return (_shared if sum(kind.steps) <= MOST_SHARED else cls.numbered)(kind)

    @property
    def is_shared(self) -> bool:
        """Whether problems of its kind have the same one."""
        return self.total <= MOST_SHARED

    def problem_at(self, problem: Problem, x: Array) -> Problem:
        """A problem with the design of the unknowns x, shape (n,)."""
        return designed(problem, x[self.index_design])

    def model_of_steps(self, problem: Problem) -> Model:
        """The model of a problem with rows of parameters for all steps."""
        return problem.models.along(self.phase_of_step)

    def zeros(self, problem: Problem) -> Array:
        """Unknowns that are zero, but for the design, which is that of a problem; shape (n,)."""
        x = np.zeros(self.size)
        x[self.index_design] = problem.design_values
        return x

    def states(self, names: list[str]) -> dict[str, tuple[int, int]]:
        """Unknowns that are a state at the start and at the end, by name of the state."""
        states: dict[str, tuple[int, int]] = {}
        for naming, start, end in (
            (str, self.index_q[0], self.index_q[-1]),
            (momentum_name, self.index_p_B, self.index_p_E),
            (velocity_name, self.index_v_B, self.index_v_E),
        ):
            pairs = zip(map(naming, names), start, end, strict=False)
            states |= {name: (int(a), int(b)) for name, a, b in pairs}
        return states

    @property
    def phases(self) -> int:
        return len(self.steps)

    @property
    def stepped(self) -> int:
        """Number of phases that have steps: all, or all but the last."""
        return len(self.index_h)

    @property
    def ends_with_event(self) -> bool:
        """Whether the last phase has no steps."""
        return self.stepped < self.phases

    @property
    def total(self) -> int:
        """Number of steps of all phases."""
        return sum(self.steps)

    @property
    def inside(self) -> int:
        """Number of nodes inside a step."""
        return self.scheme.inside

    @cached_property
    def phase_of_step(self) -> Index:
        """Phase of each step, shape (total,)."""
        return np.repeat(np.arange(self.phases), self.steps)

    @cached_property
    def phase_of_unknown(self) -> Index:
        """The phase that each unknown belongs to, shape (n,): what is at an event, to the one that
        it ends, what is behind it, to the next one. That of places and times of events, which both
        have, is i - phases, and -2 phases that of what belongs to none."""
        phase = np.full(self.size + 1, -2 * self.phases)  # NOWHERE is the last
        steps, events = self.phase_of_step, np.arange(self.phases - 1)
        nodes = np.append(steps, self.phases - 1)
        nodes[self.collision_nodes] = events - self.phases
        impact, hit, held, at = self.impact, self.hit, self.held, self.stations.phase
        along = (
            (self.index_h, np.arange(self.stepped)), (self.index_q, nodes), (self.index_t, nodes),
            (self.index_w, nodes), (self.index_u, steps[self.step_of_input]),
            (self.index_q_i, steps), (self.index_s, steps), (self.index_t_i, steps),
            (self.index_v_B, np.zeros(len(self.index_v_B), np.intp)),
            (self.index_v_E, np.full(len(self.index_v_E), self.phases - 1)),
            (self.contact.P, at), (self.contact.T, at), (self.joint.R, at),
            (self.force.y, steps[self.force.step]),
            (self.force.y_ends, np.array([0, self.phases - 1])), (impact.v_c, events + 1),
        )  # fmt: skip
        at_events = (
            impact.lam, impact.v_a, self.contact.P_c, self.contact.T_c, self.joint.R_c, hit.v_h,
            hit.P_h, hit.T_h, held.P_b, held.T_b, held.R_b, self.liftoff.y_lift_off,
        )  # fmt: skip
        for index, of_rows in (*along, *((index, events) for index in at_events)):
            if index.size:
                phase[index] = of_rows.reshape(-1, *[1] * (index.ndim - 1))
        return phase[:-1]

    def phase_of_rows(self, arguments: Sequence[Index], count: int) -> Index:
        """The phase of each of so many rows of a term that depend on some unknowns, shape (count,):
        what belongs to one says it, at an event the phase that it ends does."""
        phases, every = self.phases, np.append(self.phase_of_unknown, -2 * self.phases)
        rows = [every[np.minimum(a, self.size)].max(axis=1) for a in arguments if a.shape[1]]
        latest = np.max([np.broadcast_to(row, count) for row in rows], axis=0)
        return np.where(latest < -phases, 0, np.where(latest < 0, latest + phases, latest))

    @cached_property
    def ends(self) -> Index:
        """First node of each phase, and the last node of all, shape (phases + 1,)."""
        return np.concatenate([[0], np.cumsum(self.steps)])

    @property
    def stations(self) -> Stations:
        """Stations at which impulses act."""
        return self.joint.stations

    @cached_property
    def index_places(self) -> Index:
        """Coordinates of all places, nodes and those inside the steps, in the order of time, shape
        (degree * total + 1, nq)."""
        within = self.index_q_i.reshape(self.total, -1, self.nq)
        steps = np.concatenate([self.index_q[:-1, None], within], axis=1)
        return np.vstack([steps.reshape(-1, self.nq), self.index_q[-1:]])

    @cached_property
    def time_places(self) -> Index:
        """Unknown t of each place, shape (degree * total + 1, 1); nowhere where there is none."""
        within = np.full((self.total, self.inside), NOWHERE)
        within[:, :] = self.index_t_i if self.index_t_i.size else NOWHERE
        steps = np.hstack([self.time_columns[:-1], within])
        return np.append(steps, self.time_columns[-1])[:, None]

    def places_of_phase(self, i: int) -> slice:
        """The places of phase i, those of its ends among them."""
        d = self.scheme.degree
        return slice(d * self.ends[i], d * self.ends[i + 1] + 1)

    @cached_property
    def velocities(self) -> Index:
        """Unknown velocities at the nodes, at events those before them, shape (total + 1, nq);
        nowhere where they are no unknowns."""
        velocities = self.index_w.copy()
        for node, index in ((0, self.index_v_B), (-1, self.index_v_E)):
            if len(index):
                velocities[node] = index
        velocities[self.collision_nodes] = self.impact.v_a
        return velocities

    def put_times(self, x: Array) -> None:
        """Put the times that follow from the step sizes into the unknowns x, shape (n,), in
        place."""
        t = self.place_times(x)
        if self.timed:
            x[self.index_t] = t[:: self.scheme.degree]
        if self.index_t_i.size:
            x[self.index_t_i] = t[:-1].reshape(self.total, -1)[:, 1:]

    def place_times(self, x: Array) -> Array:
        """Times of the places, shape (degree * total + 1,)."""
        h, number = x[self.index_h][self.phase_of_step], np.sort(self.scheme.nodes)[:-1]
        t = self.times(x)
        return np.append(t[:-1, None] + h[:, None] * number, t[-1])

    def reactions(self, i: int) -> tuple[PhaseReaction, ...]:
        """Impulses of all laws along phase i."""
        return self._reactions[i]

    def impulses(self, i: int) -> tuple[EventImpulses, ...]:
        """Impulses of all laws at event i."""
        return self._impulses[i]

    @cached_property
    def _reactions(self) -> list[tuple[PhaseReaction, ...]]:
        laws = self.contact, self.joint
        return [tuple(r for law in laws for r in law.reactions(i)) for i in range(self.phases)]

    @cached_property
    def _impulses(self) -> list[tuple[EventImpulses, ...]]:
        laws, events = (self.contact, self.impact, self.joint), range(self.phases - 1)
        return [tuple(r for law in laws for r in law.impulses(i)) for i in events]

    @cached_property
    def collision_nodes(self) -> Index:
        """Node of each event, shape (events,)."""
        return self.ends[1:-1]

    @property
    def begins_open(self) -> Iterator[tuple[int, list[int]]]:
        """Steps that begin with a lift-off, and the surfaces that leave there."""
        for one in self.liftoff.of:
            step = int(self.collision_nodes[one.event])
            if step < self.total:
                yield step, list(one.surfaces)

    @cached_property
    def row_u_k(self) -> Index:
        """Row of u at the start of each step, shape (total,)."""
        return first_rows(self.form, self.steps)

    @property
    def row_u_kp1(self) -> Index:
        """Row of u at the end of each step, shape (total,): the same row for inputs constant in a
        step."""
        return self.row_u_k + self.form.width

    @cached_property
    def step_of_input(self) -> Index:
        """The last step that each row of u enters, shape (rows of u,)."""
        return steps_of_rows(self.form, self.steps)

    @cached_property
    def index_step(self) -> Index:
        """Unknowns x_k = (q_k, q_kp1, u_k, u_kp1, h, t_k, q_i) of each step, shape (total, size);
        t_k is nowhere in a model without explicit time."""
        return np.hstack(
            [
                self.index_q[:-1],
                self.index_q[1:],
                self.index_u[self.row_u_k],
                self.index_u[self.row_u_kp1],
                self.index_h[self.phase_of_step][:, None],
                self.time_columns[:-1],
                self.index_q_i,
            ]
        )

    @cached_property
    def hidden_of_kernels(self) -> Index:
        """The hidden unknowns of each step as kernels take them, shape (total, size): where both
        sides of a point have the same inputs, once for each."""
        both = 2 if self.scheme.points == 1 and not self.form.width else 1
        return np.tile(self.index_s, (1, both))

    @cached_property
    def time_columns(self) -> Index:
        """Unknown t of each node, shape (total + 1, 1); nowhere in a model without explicit
        time."""
        return self.index_t[:, None] if self.timed else np.full((self.total + 1, 1), NOWHERE)

    def durations(self, x: Array) -> Array:
        """Durations of the phases, shape (..., phases), of unknowns of shape (..., n)."""
        h = x[..., self.index_h]
        none = np.zeros((*h.shape[:-1], self.phases - self.stepped))
        return np.concatenate([h, none], axis=-1) * self.steps

    def step_sizes(self, durations: Array) -> Array:
        """Step sizes of the phases that have steps, shape (..., phases with steps), from durations
        of all, shape (..., phases); in seconds."""
        return np.asarray(durations[..., : self.stepped] / np.array(self.steps[: self.stepped]))

    def times(self, x: Array) -> Array:
        """Times of the nodes, shape (total + 1,)."""
        h = x[self.index_h][self.phase_of_step]
        return np.concatenate([[0.0], np.cumsum(h)])

    @cached_property
    def _index_of_parts(self) -> list[Index]:
        """The unknowns of all steps by their parts."""
        return [np.ascontiguousarray(part) for part in self.split(self.index_step)]

    def split(self, x_k: Index) -> list[Index]:
        """Split the unknowns of steps, shape (k, size), into q_k, q_kp1, u_k, u_kp1, h, t_k and
        q_i, which have their sizes in columns."""
        sizes = (self.nq, self.nq, self.nu, self.nu, 1, 1)
        ends = list(accumulate(sizes))  # np.split takes ten times as long
        return [x_k[:, a:b] for a, b in zip([0, *ends], [*ends, x_k.shape[1]], strict=True)]

    def step_inputs(self, x: Array) -> list[Array]:
        """Return q_k, q_kp1, u_k, u_kp1, h, t_k and q_i of every step of unknowns x, shape (...,
        n), as arrays of shape (..., total, size)."""
        *before, t_k, q_i = (x.take(at, axis=-1) for at in self._index_of_parts)
        return [*before, t_k if self.timed else np.zeros((*x.shape[:-1], self.total, 1)), q_i]


def _ranged_rows(problem: Problem, ranges: Array) -> list[FunctionFacts]:
    """Facts about the quantities that ``ranges``, shape (nz, 2), bound on some side."""
    rows = problem.kernels.quantity_rows
    if not rows:
        return []
    return [rows[j] for j in np.flatnonzero(np.isfinite(ranges).any(axis=1))]


def _wanted_forces(problem: Problem, turning: set[str]) -> Wanted:
    """Where the forces of quantities are unknowns; those that the motion does not determine are
    refused."""
    rows = problem.kernels.quantity_rows
    on = np.array([bool(row.get("forces")) for row in rows], dtype=bool)
    if not on.any():
        return Wanted()
    ranges, peaks = problem.quantity_ranges, {j for j, _ in problem.model.peaks_of}
    named = np.array([row["name"] in turning for row in rows])
    along = np.isfinite(problem.quantity_bounds).any(axis=1) | np.isin(np.arange(len(on)), [*peaks])
    start, goal = (np.isfinite(r).any(axis=1) | named for r in (ranges.start, ranges.goal))
    wanted = Wanted(True, *(bool((on & part).any()) for part in (along, start, goal)))
    used = on & (along | start | goal)
    for i, follows in enumerate(problem.redundant if used.any() else ()):
        if follows.pressing or follows.rubbing:
            name = rows[int(np.argmax(used))]["name"]
            raise ProblemError(
                f"quantity {name!r} contains forces, and the motion determines only sums of those "
                f"of {', '.join((*follows.pressing, *follows.rubbing))} in phase {i}: remove its "
                "bound, or what holds the motion twice."
            )
    return wanted


def _check_courses(problem: Problem) -> None:
    """Refuse hits with friction whose course is not said."""
    for i, words in problem.open_hits.items():
        raise ProblemError(
            f"event {i + 1} ({problem.sequence[i]}) is a hit with friction, which can go in "
            f"several ways: say which, by one of {', '.join(map(repr, words))}, or let dmoc.solve "
            "try them."
        )


_shared = lru_cache(maxsize=SHARED)(Layout.numbered)
