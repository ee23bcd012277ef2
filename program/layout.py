"""The table of the unknowns, the only place that knows their order.

    x = (h | q | u | lam | p_B | p_E | v_B | v_E | v_a | v_c | t | q_i | s | those of laws)

h: step sizes, one a phase; q: coordinates at the nodes, a collision node shared by its two phases;
u: inputs, in the rows of their form (:class:`~dmoc.base.discretisation.InputForm`); p_B, p_E:
momenta at both ends; v_B, v_E: velocities at both ends, only where the problem needs them; t: times
of the nodes, only where the model depends on them; q_i: coordinates of the nodes inside the steps;
s: hidden unknowns for functions with kinks (:mod:`dmoc.symbolic.kinks`), in the rows of the inputs.
Behind those of laws are w, velocities at the nodes inside phases, and t_i, times of the nodes
inside steps, both only where something pushes along steps with nodes inside.
Laws that push have tables of their own: :class:`~dmoc.program.impacts.ImpactUnknowns` (lam, v_a,
v_c, in these places because files keep multipliers in this order),
:class:`~dmoc.program.contact_table.ContactUnknowns`,
:class:`~dmoc.program.hit_stages.HitUnknowns`, :class:`~dmoc.program.hit_stages.HeldUnknowns`,
:class:`~dmoc.program.joints.JointUnknowns`,
:class:`~dmoc.program.relaxed_contacts.RelaxedUnknowns`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import accumulate

import numpy as np

from dmoc.base.discretisation import DISCRETISATIONS, FORMS, Discretisation, InputForm
from dmoc.base.errors import ProblemError
from dmoc.base.names import momentum_name, velocity_name
from dmoc.codegen.kernels import Array
from dmoc.mechanics.touch import Touch
from dmoc.problem.problem import Problem
from dmoc.program.blocks import NOWHERE, Block, Bools, Counted, Index, Numbering
from dmoc.program.bound_kinds import BoundKind
from dmoc.program.contact_table import ContactUnknowns
from dmoc.program.hit_stages import HeldUnknowns, HitUnknowns
from dmoc.program.impacts import ImpactUnknowns, impulses, names_of_events, velocities
from dmoc.program.joints import JointUnknowns
from dmoc.program.reactions import EventImpulses, PhaseReaction
from dmoc.program.relaxed_contacts import RelaxedUnknowns
from dmoc.program.scale import Scale
from dmoc.program.stations import Stations

# Layouts that are remembered, and the steps of one that is not.
SHARED, MOST_SHARED = 32, 5_000


@dataclass(frozen=True, eq=False)
class Layout:
    """Sizes and index sets of the unknowns.

    ``index_a`` is an integer array of the shape of ``a`` that holds the positions of its entries in
    x, so that ``x[index_a]`` is a; ``unknowns`` is the table with names and sizes.  ``touch`` says
    what is in contact; ``impact``, ``contact``, ``hit``, ``held``, ``joint`` and ``relaxed`` are
    the unknowns of laws that push.
    """

    nq: int
    nu: int
    steps: tuple[int, ...]
    form: InputForm
    scheme: Discretisation
    timed: bool
    touch: Touch
    unknowns: tuple[Block, ...]
    index_h: Index
    index_q: Index
    index_u: Index
    index_p_B: Index
    index_p_E: Index
    index_v_B: Index
    index_v_E: Index
    index_t: Index
    index_q_i: Index
    index_s: Index
    index_w: Index
    index_t_i: Index
    impact: ImpactUnknowns
    contact: ContactUnknowns
    hit: HitUnknowns
    held: HeldUnknowns
    joint: JointUnknowns
    relaxed: RelaxedUnknowns

    @classmethod
    def of(cls, problem: Problem) -> Layout:
        _check_courses(problem)
        kernels = problem.kernels
        turning = {name for r in problem.relations for name in (r.start, r.end)}
        turns = any(velocity_name(c) in turning for c in kernels.coordinates)
        joined = bool(kernels.joints)
        free = [mode.free and not joined for mode in problem.touch.modes]
        at_start = turns or not (free[0] or problem.start_bounds.is_state)
        at_goal = turns or not free[-1] or bool(kernels.manifest["terminal_velocity"])
        for row in kernels.manifest["path_rows"]:
            if row["velocities"] and (FORMS[problem.control_form].shared or not row["inputs"]):
                at_start |= row["inputs"] or not problem.start_bounds.is_state
                at_goal = True
        kind = Kind(
            tuple(kernels.coordinates),
            tuple(kernels.inputs),
            tuple(kernels.manifest["hidden"]),
            problem.phase_steps,
            problem.control_form,
            problem.order,
            problem.explicit_time,
            tuple(problem.sequence),
            problem.start_bounds.needs_velocity or at_start,
            problem.goal_bounds.needs_velocity or at_goal,
            problem.touch,
            tuple(kernels.joints),
        )
        return (_shared if sum(kind.steps) <= MOST_SHARED else _laid_out)(kind)

    @cached_property
    def size(self) -> int:
        """Number of unknowns."""
        return sum(b.count for b in self.unknowns)

    def names(self) -> list[str]:
        """Names of all unknowns in the user's words, in the order of x."""
        return [b.name_of(i) for b in self.unknowns for i in range(b.count)]

    def units(self, scale: Scale) -> Array:
        """Typical sizes of all unknowns, in the order of x."""
        return np.concatenate([b.sizes(scale) for b in self.unknowns if b.count])

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
    def total(self) -> int:
        """Number of steps of all phases."""
        return sum(self.steps)

    @property
    def inside(self) -> int:
        """Number of nodes inside a step."""
        return self.scheme.inside

    @cached_property
    def phase_of_step(self) -> Index:
        return np.repeat(np.arange(self.phases), self.steps)

    @cached_property
    def ends(self) -> Index:
        """First node of each phase, and the last node of all."""
        return np.concatenate([[0], np.cumsum(self.steps)])

    @property
    def stations(self) -> Stations:
        """Where impulses act."""
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
        velocities[self.collision_nodes] = self.impact.v_a
        for node, index in ((0, self.index_v_B), (-1, self.index_v_E)):
            if len(index):
                velocities[node] = index
        return velocities

    def put_times(self, x: Array) -> None:
        """Put the times that follow from the step sizes into the unknowns x."""
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
        """What pushes along phase i, of all laws."""
        return (*self.contact.reactions(i), *self.joint.reactions(i))

    def impulses(self, i: int) -> tuple[EventImpulses, ...]:
        """What pushes at event i, of all laws."""
        return (*self.contact.impulses(i), *self.impact.impulses(i), *self.joint.impulses(i))

    @cached_property
    def collision_nodes(self) -> Index:
        return self.ends[1:-1]

    @cached_property
    def row_u_k(self) -> Index:
        """Row of u at the start of each step."""
        return _first_rows(self.form, self.steps)

    @property
    def row_u_kp1(self) -> Index:
        """Row of u at the end of each step: the same row for inputs constant in a step."""
        return self.row_u_k + self.form.width

    @cached_property
    def step_of_input(self) -> Index:
        """The last step that each row of u enters."""
        return _steps_of_rows(self.form, self.steps)

    @cached_property
    def index_step(self) -> Index:
        """Unknowns x_k = (q_k, q_kp1, u_k, u_kp1, h, t_k, q_i) of each step; t_k is nowhere in a
        model without explicit time."""
        return np.hstack(
            [
                self.index_q[:-1],
                self.index_q[1:],
                self.of_kernels[self.row_u_k],
                self.of_kernels[self.row_u_kp1],
                self.index_h[self.phase_of_step][:, None],
                self.time_columns[:-1],
                self.index_q_i,
            ]
        )

    @cached_property
    def of_kernels(self) -> Index:
        """Rows of u with the hidden unknowns behind them, as kernels of steps take them."""
        return np.hstack([self.index_u, self.index_s])

    @cached_property
    def time_columns(self) -> Index:
        """Unknown t of each node, shape (total + 1, 1); nowhere in a model without explicit
        time."""
        return self.index_t[:, None] if self.timed else np.full((self.total + 1, 1), NOWHERE)

    def times(self, x: Array) -> Array:
        """Times of the nodes, shape (total + 1,)."""
        h = x[self.index_h][self.phase_of_step]
        return np.concatenate([[0.0], np.cumsum(h)])

    def split(self, x_k: Index) -> list[Index]:
        """Split the unknowns of steps into q_k, q_kp1, u_k, u_kp1, h, t_k and q_i."""
        u = self.of_kernels.shape[1]
        sizes = (self.nq, self.nq, u, u, 1, 1)
        ends = list(accumulate(sizes))  # np.split takes ten times as long
        return [x_k[:, a:b] for a, b in zip([0, *ends], [*ends, x_k.shape[1]], strict=True)]

    def step_inputs(self, x: Array) -> list[Array]:
        """Return q_k, q_kp1, u_k, u_kp1, h, t_k and q_i of every step as arrays of shape (total,
        size)."""
        parts = [np.ascontiguousarray(x[at]) for at in self.split(self.index_step)]
        if not self.timed:
            parts[5] = np.zeros((self.total, 1))
        return parts


def _check_courses(problem: Problem) -> None:
    """Refuse hits with friction whose course is not said."""
    for i, words in problem.open_hits.items():
        raise ProblemError(
            f"event {i + 1} ({problem.sequence[i]}) is a hit with friction, which can go in "
            f"several ways: say which, by one of {', '.join(map(repr, words))}, or let dmoc.solve "
            "try them."
        )


def _first_rows(form: InputForm, steps: tuple[int, ...]) -> Index:
    """Row of u at the start of each step."""
    before = np.cumsum([0, *map(form.rows, steps[:-1])])
    return np.concatenate([first + form.starts(n) for first, n in zip(before, steps, strict=True)])


def _steps_of_rows(form: InputForm, steps: tuple[int, ...]) -> Index:
    """The last step that each row of u enters."""
    step = np.zeros(sum(map(form.rows, steps)), dtype=np.intp)
    first, numbers = _first_rows(form, steps), np.arange(sum(steps))
    step[first + form.width] = numbers
    step[first] = numbers
    return step


@dataclass(frozen=True)
class Kind:
    """What a layout depends on; ``v_at_start`` and ``v_at_end`` say whether the velocities there
    are unknowns."""

    coordinates: tuple[str, ...]
    inputs: tuple[str, ...]
    hidden: tuple[str, ...]
    steps: tuple[int, ...]
    form: str
    order: int
    timed: bool
    sequence: tuple[str, ...]
    v_at_start: bool
    v_at_end: bool
    touch: Touch
    joints: tuple[str, ...]


def _laid_out(kind: Kind) -> Layout:
    names, u, steps = kind.coordinates, kind.inputs, kind.steps
    form, scheme = FORMS[kind.form], DISCRETISATIONS[kind.order]
    nq, total = len(names), sum(steps)
    touch = kind.touch
    p, v = [momentum_name(c) for c in names], [velocity_name(c) for c in names]
    phases, at = len(steps), names_of_events(kind.sequence)
    row_steps = _steps_of_rows(form, steps)
    rows_at_start = frozenset(_first_rows(form, steps).tolist())

    def place_of_input(k: int) -> str:
        if form.jumps:
            return f"at the {'start' if k in rows_at_start else 'end'} of step {row_steps[k]}"
        return f"in node {k}" if form.shared else f"in step {row_steps[k]}"

    def place_inside(j: int) -> str:
        return f"at inner node {j} of" if scheme.inside > 1 else "inside"

    block = Numbering()
    of_steps = (
        block("h", (phases,), lambda i: f"step size of phase {i}", lambda s: s.h),
        block(
            "q",
            (total + 1, nq),
            lambda k, i: f"{names[i]} at node {k}",
            lambda s: s.q,
            counted=Counted(BoundKind.COORDINATE, names, np.arange(total + 1)),
        ),
        block(
            "u",
            (len(row_steps), len(u)),
            lambda k, i: f"{u[i]} {place_of_input(k)}",
            lambda s: s.u,
            counted=Counted(BoundKind.INPUT, u, row_steps),
        ),
    )
    lam = impulses(block, touch, at)
    of_ends = (
        block("p_B", (nq,), lambda i: f"{p[i]} at the start", lambda s: s.p),
        block("p_E", (nq,), lambda i: f"{p[i]} at the goal", lambda s: s.p),
        block(
            "v_B",
            (nq * kind.v_at_start,),
            lambda i: f"{v[i]} at the start",
            lambda s: s.v[: nq * kind.v_at_start],
        ),
        block(
            "v_E",
            (nq * kind.v_at_end,),
            lambda i: f"{v[i]} at the goal",
            lambda s: s.v[: nq * kind.v_at_end],
        ),
    )
    v_a, v_c = velocities(block, v, at)
    inner = (
        block(
            "t",
            ((total + 1) * kind.timed,),
            lambda k: f"time of node {k}",
            lambda s: s.time,
        ),
        block(
            "q_i",
            (total, scheme.inside * nq),
            lambda k, i: f"{names[i % nq]} {place_inside(i // nq)} step {k}",
            lambda s: np.tile(s.q, scheme.inside),
        ),
        block(
            "s",
            (len(row_steps), len(kind.hidden)),
            lambda k, i: f"{kind.hidden[i]} {place_of_input(k)}",
            lambda s: s.s,
        ),
    )
    indices = {f"index_{b.name}": b.index for b in (*of_steps, *of_ends, *inner)}
    impact = ImpactUnknowns(touch, at, lam.index, v_a.index, v_c.index)
    stations = Stations(steps, scheme)
    contact = ContactUnknowns.of(block, stations, touch)
    hit = HitUnknowns.of(block, touch, v)
    joint = JointUnknowns.of(block, stations, kind.joints, touch.impacts)
    held = HeldUnknowns.of(block, touch, hit.moments, kind.joints)
    relaxed = RelaxedUnknowns.of(block, total, touch)
    passed = _passed(kind, scheme)
    index_w = block(
        "w",
        np.repeat(passed[:, None], nq, axis=1),
        lambda k, i: f"{v[i]} at node {k}",
        lambda s: s.v,
    ).index
    index_t_i = block(
        "t_i",
        (total, scheme.inside * (kind.timed and (not touch.free or bool(kind.joints)))),
        lambda k, i: f"time {place_inside(i)} step {k}",
        lambda s: s.time,
    ).index
    return Layout(
        nq, len(u), steps, form, scheme, kind.timed, touch, tuple(block.made),
        **indices, index_w=index_w, index_t_i=index_t_i, impact=impact, contact=contact, hit=hit,
        held=held, joint=joint, relaxed=relaxed,
    )  # fmt: skip


def _passed(kind: Kind, scheme: Discretisation) -> Bools:
    """Nodes inside phases at which steps have impulses of their own; shape (nodes,).  Rates that
    vanish there tell those of the step before from those of the step after."""
    passed, first = np.zeros(sum(kind.steps) + 1, dtype=bool), 0
    for n, mode in zip(kind.steps, kind.touch.modes, strict=True):
        pushes = bool(kind.joints) or not mode.free
        passed[first + 1 : first + n] = pushes and scheme.inside > 0
        first += n
    return passed


_shared = lru_cache(maxsize=SHARED)(_laid_out)
