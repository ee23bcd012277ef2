"""The table of the unknowns, the only place that knows their order.

    x = (h | q | u | lam | p_B | p_E | v_B | v_E | v_a | v_c | t | q_i | s | those of laws)

h: step sizes, one a phase that has steps; q: coordinates at the nodes, a collision node shared by
its two phases; u: inputs, in the rows of their form
(:class:`~dmoc.base.discretisation.InputForm`); p_B, p_E: momenta at both ends; v_B, v_E: velocities
at both ends, only where the problem needs them; t: times of the nodes, only where the model depends
on them; q_i: coordinates of the nodes inside the steps; s: hidden unknowns for functions with kinks
(:mod:`dmoc.symbolic.kinks`), at the points of steps.  Where a motion ends with an event, its
last phase has no steps, p_E is the momentum after the event, and v_E is its v_c.  Behind those of
laws are w, velocities at the nodes inside phases, and t_i, times of the nodes inside steps, both
only where something pushes along steps with nodes inside, then accelerations and forces that
quantities contain (:mod:`dmoc.program.force_unknowns`) or that are before lift-offs
(:mod:`dmoc.program.liftoffs`), and behind these totals and peaks of an objective, and design
parameters.
Laws that push have tables of their own: :class:`~dmoc.program.impacts.ImpactUnknowns` (lam, v_a,
v_c, in these places because files keep multipliers in this order),
:class:`~dmoc.program.contact_table.ContactUnknowns`,
:class:`~dmoc.program.hit_stages.HitUnknowns`, :class:`~dmoc.program.hit_stages.HeldUnknowns`,
:class:`~dmoc.program.joints.JointUnknowns`,
:class:`~dmoc.program.relaxed_contacts.RelaxedUnknowns`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property, partial
from typing import Self

import numpy as np

from dmoc.base.discretisation import DISCRETISATIONS, FORMS, Discretisation, InputForm
from dmoc.base.names import momentum_name, velocity_name
from dmoc.base.records import record, value_class
from dmoc.codegen.kernels import Array
from dmoc.mechanics.touch import Touch
from dmoc.program.blocks import Block, Bools, Counted, Index, Numbering, Spread
from dmoc.program.bound_kinds import BoundKind
from dmoc.program.contact_table import ContactUnknowns
from dmoc.program.force_unknowns import ForceUnknowns, Wanted
from dmoc.program.hit_stages import HeldUnknowns, HitUnknowns
from dmoc.program.impacts import ImpactUnknowns, impulses, names_of_events, velocities
from dmoc.program.joints import JointUnknowns
from dmoc.program.liftoffs import Liftoff, LiftoffUnknowns
from dmoc.program.relaxed_contacts import RelaxedUnknowns
from dmoc.program.scale import Scale
from dmoc.program.stations import Stations


@value_class(frozen=True)
class Kind:
    """Everything that a layout depends on; ``v_at_start`` and ``v_at_end`` say whether the
    velocities there are unknowns."""

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
    totals: tuple[str, ...]
    peaks: tuple[str, ...]
    design: tuple[str, ...]
    forces: Wanted
    liftoffs: tuple[Liftoff, ...]


@record(frozen=True, eq=False)
class Unknowns:
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
    index_totals: Index
    index_peaks: Index
    index_design: Index
    impact: ImpactUnknowns
    contact: ContactUnknowns
    hit: HitUnknowns
    held: HeldUnknowns
    joint: JointUnknowns
    relaxed: RelaxedUnknowns
    force: ForceUnknowns
    liftoff: LiftoffUnknowns

    @classmethod
    def numbered(cls, kind: Kind) -> Self:
        """Number the unknowns in their order."""
        form, scheme = FORMS[kind.form], DISCRETISATIONS[kind.order]
        own, touch, steps = _States(kind, form, scheme), kind.touch, kind.steps
        block, v = Numbering(), own.velocities
        at = names_of_events(kind.sequence, kind.touch.contacts.switches)
        states = [*own.of_nodes(block)]
        lam = impulses(block, touch, at)
        states += own.of_ends(block)
        v_a, v_c = velocities(block, v, at)
        states += own.of_steps(block)
        impact = ImpactUnknowns(touch, at, lam.index, v_a.index, v_c.index)
        stations = Stations(steps, scheme)
        contact = ContactUnknowns.of(block, stations, touch)
        hit = HitUnknowns.of(block, touch, v)
        joint = JointUnknowns.of(block, stations, kind.joints, touch.impacts)
        held = HeldUnknowns.of(block, touch, hit.moments, kind.joints)
        relaxed = RelaxedUnknowns.of(block, sum(steps), touch)
        states += own.of_pushes(block)
        pushing = kind.coordinates, kind.joints
        force = ForceUnknowns.of(block, kind.forces, form, stations, pushing, touch)
        liftoff = LiftoffUnknowns.numbered(block, kind.liftoffs, pushing, touch)
        states += _of_objective(block, kind)
        indices = {f"index_{b.name}": b.index for b in states}
        if not steps[-1]:
            indices["index_v_E"] = v_c.index[-1]
        return cls(
            len(kind.coordinates), len(kind.inputs), steps, form, scheme, kind.timed, touch,
            tuple(block.made), **indices, impact=impact, contact=contact, hit=hit, held=held,
            joint=joint, relaxed=relaxed, force=force, liftoff=liftoff,
        )  # fmt: skip

    @cached_property
    def size(self) -> int:
        """Number of unknowns."""
        return sum(b.count for b in self.unknowns)

    def names(self) -> list[str]:
        """Names of all unknowns in the user's words, in the order of x."""
        return [b.name_of(i) for b in self.unknowns for i in range(b.count)]

    def sizes(self, scale: Scale) -> Array:
        """Typical sizes of all unknowns, in the order of x, shape (n,)."""
        return self._spread(self.unknowns, scale)

    @cached_property
    def _spread(self) -> Spread:
        return Spread()


@record(frozen=True, eq=False)
class _States:
    """The unknowns of states and inputs, in their words."""

    kind: Kind
    form: InputForm
    scheme: Discretisation

    @property
    def total(self) -> int:
        return sum(self.kind.steps)

    @property
    def velocities(self) -> list[str]:
        return [velocity_name(c) for c in self.kind.coordinates]

    def of_nodes(self, block: Numbering) -> Iterator[Block]:
        """Step sizes, coordinates and inputs."""
        names, u, steps = self.kind.coordinates, self.kind.inputs, self.kind.steps
        row_steps = steps_of_rows(self.form, steps)
        place = self._places_of_inputs(row_steps)
        yield block(
            "h",
            (int(np.count_nonzero(steps)),),
            lambda i: f"step size of phase {i}",
            lambda s: s.h,
        )
        yield block(
            "q",
            (self.total + 1, len(names)),
            lambda k, i: f"{names[i]} at node {k}",
            lambda s: s.q,
            counted=Counted(BoundKind.COORDINATE, names, np.arange(self.total + 1)),
        )
        yield block(
            "u",
            (len(row_steps), len(u)),
            lambda k, i: f"{u[i]} {place(k)}",
            lambda s: s.u,
            counted=Counted(BoundKind.INPUT, u, row_steps),
        )

    def _places_of_inputs(self, row_steps: Index) -> Callable[[int], str]:
        """Where a row of inputs acts, in words."""
        form, at_start = self.form, frozenset(first_rows(self.form, self.kind.steps).tolist())

        def place(k: int) -> str:
            if form.jumps:
                return f"at the {'start' if k in at_start else 'end'} of step {row_steps[k]}"
            return f"in node {k}" if form.shared else f"in step {row_steps[k]}"

        return place

    def _inside(self, j: int) -> str:
        return f"at inner node {j} of" if self.scheme.inside > 1 else "inside"

    def of_ends(self, block: Numbering) -> Iterator[Block]:
        """Momenta and velocities at the start and at the goal."""
        p, v = [momentum_name(c) for c in self.kind.coordinates], self.velocities
        at_start, at_end = (
            len(v) * is_one for is_one in (self.kind.v_at_start, self.kind.v_at_end)
        )
        yield block("p_B", (len(p),), lambda i: f"{p[i]} at the start", lambda s: s.p)
        yield block("p_E", (len(p),), lambda i: f"{p[i]} at the goal", lambda s: s.p)
        v_B, v_E = (partial(_first, count) for count in (at_start, at_end))
        yield block("v_B", (at_start,), lambda i: f"{v[i]} at the start", v_B)
        yield block("v_E", (at_end,), lambda i: f"{v[i]} at the goal", v_E)

    def of_steps(self, block: Numbering) -> Iterator[Block]:
        """Times of nodes, coordinates inside steps, and hidden unknowns."""
        kind, names, inside = self.kind, self.kind.coordinates, self.scheme.inside
        nq, hidden, places = len(names), kind.hidden, hidden_places(self.form, self.scheme)
        yield block(
            "t",
            ((self.total + 1) * kind.timed,),
            lambda k: f"time of node {k}",
            lambda s: s.time,
        )
        yield block(
            "q_i",
            (self.total, inside * nq),
            lambda k, i: f"{names[i % nq]} {self._inside(i // nq)} step {k}",
            lambda s: np.tile(s.q, inside),
        )
        yield block(
            "s",
            (self.total, places * len(hidden)),
            lambda k, i: f"{hidden[i % len(hidden)]} at point {i // len(hidden)} of step {k}",
            lambda s: np.tile(s.s, places),
        )

    def of_pushes(self, block: Numbering) -> Iterator[Block]:
        """Velocities at nodes and times inside steps along which something pushes."""
        kind, v, passed = self.kind, self.velocities, _passed(self.kind, self.scheme)
        timed = kind.timed and (not kind.touch.free or bool(kind.joints))
        yield block(
            "w",
            np.repeat(passed[:, None], len(v), axis=1),
            lambda k, i: f"{v[i]} at node {k}",
            lambda s: s.v,
        )
        yield block(
            "t_i",
            (self.total, self.scheme.inside * timed),
            lambda k, i: f"time {self._inside(i)} step {k}",
            lambda s: s.time,
        )


def _first(count: int, scale: Scale) -> Array:
    """Sizes of the first velocities."""
    return scale.v[..., :count]


def _of_objective(block: Numbering, kind: Kind) -> Iterator[Block]:
    """Totals and peaks, and the design."""
    yield block("totals", (len(kind.totals),), lambda i: kind.totals[i], lambda s: s.totals)
    yield block("peaks", (len(kind.peaks),), lambda i: kind.peaks[i], lambda s: s.peaks)
    yield block("design", (len(kind.design),), lambda i: kind.design[i], lambda s: s.design)


def hidden_places(form: InputForm, scheme: Discretisation) -> int:
    """How many values a hidden unknown has in a step: one at each point, or one for the inputs of
    each side of the one point."""
    return max(scheme.points, 1 + (form.width > 0 and scheme.points == 1))


def first_rows(form: InputForm, steps: tuple[int, ...]) -> Index:
    """Row of u at the start of each step."""
    before = np.cumsum([0, *map(form.rows, steps[:-1])])
    return np.concatenate([first + form.starts(n) for first, n in zip(before, steps, strict=True)])


def steps_of_rows(form: InputForm, steps: tuple[int, ...]) -> Index:
    """The last step that each row of u enters."""
    step = np.zeros(sum(map(form.rows, steps)), dtype=np.intp)
    first, numbers = first_rows(form, steps), np.arange(sum(steps))
    step[first + form.width] = numbers
    step[first] = numbers
    return step


def _passed(kind: Kind, scheme: Discretisation) -> Bools:
    """Nodes inside phases at which steps have impulses of their own; shape (nodes,).  Rates that
    vanish there tell those of the step before from those of the step after."""
    passed, first = np.zeros(sum(kind.steps) + 1, dtype=bool), 0
    for n, mode in zip(kind.steps, kind.touch.modes, strict=True):
        pushes = bool(kind.joints) or not mode.free
        passed[first + 1 : first + n] = pushes and scheme.inside > 0
        first += n
    return passed
