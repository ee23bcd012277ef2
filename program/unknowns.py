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
quantities contain (:mod:`dmoc.program.force_unknowns`), and behind these totals and peaks of an
objective, and design parameters.
Laws that push have tables of their own: :class:`~dmoc.program.impacts.ImpactUnknowns` (lam, v_a,
v_c, in these places because files keep multipliers in this order),
:class:`~dmoc.program.contact_table.ContactUnknowns`,
:class:`~dmoc.program.hit_stages.HitUnknowns`, :class:`~dmoc.program.hit_stages.HeldUnknowns`,
:class:`~dmoc.program.joints.JointUnknowns`,
:class:`~dmoc.program.relaxed_contacts.RelaxedUnknowns`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from dmoc.base.discretisation import DISCRETISATIONS, FORMS, Discretisation, InputForm
from dmoc.base.names import momentum_name, velocity_name
from dmoc.codegen.kernels import Array
from dmoc.mechanics.touch import Touch
from dmoc.program.blocks import Block, Bools, Counted, Index, Numbering
from dmoc.program.bound_kinds import BoundKind
from dmoc.program.contact_table import ContactUnknowns
from dmoc.program.force_unknowns import ForceUnknowns, Wanted
from dmoc.program.hit_stages import HeldUnknowns, HitUnknowns
from dmoc.program.impacts import ImpactUnknowns, impulses, names_of_events, velocities
from dmoc.program.joints import JointUnknowns
from dmoc.program.relaxed_contacts import RelaxedUnknowns
from dmoc.program.scale import Scale
from dmoc.program.stations import Stations


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
    totals: tuple[str, ...]
    peaks: tuple[str, ...]
    design: tuple[str, ...]
    forces: Wanted


@dataclass(frozen=True, eq=False)
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

    @classmethod
    def numbered(cls, kind: Kind) -> Self:
        """Number the unknowns in their order."""
        names, u, steps = kind.coordinates, kind.inputs, kind.steps
        form, scheme = FORMS[kind.form], DISCRETISATIONS[kind.order]
        nq, total = len(names), sum(steps)
        touch = kind.touch
        p, v = [momentum_name(c) for c in names], [velocity_name(c) for c in names]
        at = names_of_events(kind.sequence)
        row_steps = steps_of_rows(form, steps)
        rows_at_start = frozenset(first_rows(form, steps).tolist())

        def place_of_input(k: int) -> str:
            if form.jumps:
                return f"at the {'start' if k in rows_at_start else 'end'} of step {row_steps[k]}"
            return f"in node {k}" if form.shared else f"in step {row_steps[k]}"

        def place_inside(j: int) -> str:
            return f"at inner node {j} of" if scheme.inside > 1 else "inside"

        places, ns = hidden_places(form, scheme), len(kind.hidden)
        block = Numbering()
        of_steps = (
            block(
                "h",
                (int(np.count_nonzero(steps)),),
                lambda i: f"step size of phase {i}",
                lambda s: s.h,
            ),
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
                (total, places * ns),
                lambda k, i: f"{kind.hidden[i % ns]} at point {i // ns} of step {k}",
                lambda s: np.tile(s.s, places),
            ),
        )
        indices = {f"index_{b.name}": b.index for b in (*of_steps, *of_ends, *inner)}
        if not steps[-1]:
            indices["index_v_E"] = v_c.index[-1]
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
        force = ForceUnknowns.of(block, kind.forces, form, stations, (names, kind.joints), touch)
        totals, peaks, design = (
            block("totals", (len(kind.totals),), lambda i: kind.totals[i], lambda s: s.totals),
            block("peaks", (len(kind.peaks),), lambda i: kind.peaks[i], lambda s: s.peaks),
            block("design", (len(kind.design),), lambda i: kind.design[i], lambda s: s.design),
        )
        return cls(
            nq, len(u), steps, form, scheme, kind.timed, touch, tuple(block.made),
            **indices, index_w=index_w, index_t_i=index_t_i,
            index_totals=totals.index, index_peaks=peaks.index, index_design=design.index,
            impact=impact, contact=contact, hit=hit, held=held, joint=joint, relaxed=relaxed,
            force=force,
        )  # fmt: skip

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
