"""The laws of a program: the table of its constraints (c | d), c = 0 and d >= 0, numbered once.

Equalities come node by node along the whole chain of steps, then those of events, ends and
contacts.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable, Hashable, Iterator, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.problem.problem import Problem
from dmoc.program.blocks import Block, Index, Numbering, Spread
from dmoc.program.elements import Structure
from dmoc.program.laws.ball import BallLaw
from dmoc.program.laws.breakaway import BreakawayLaw
from dmoc.program.laws.complementarity import ComplementarityLaw
from dmoc.program.laws.contact import ContactLaw
from dmoc.program.laws.crossing import CrossingLaw
from dmoc.program.laws.ends import EndsLaw, Goal
from dmoc.program.laws.force import ForceLaw
from dmoc.program.laws.friction import FrictionLaw
from dmoc.program.laws.held import HeldLaw
from dmoc.program.laws.hit import HitLaw
from dmoc.program.laws.hit_quantity import HitQuantityLaw
from dmoc.program.laws.impact import ImpactLaw, changes_of
from dmoc.program.laws.joint import JointLaw
from dmoc.program.laws.kink import KinkLaw
from dmoc.program.laws.law import Law
from dmoc.program.laws.liftoff import LiftoffLaw
from dmoc.program.laws.objective import ObjectiveLaw
from dmoc.program.laws.open_grips import OpenGripsLaw
from dmoc.program.laws.path import PathLaw
from dmoc.program.laws.quantity import QuantityLaw
from dmoc.program.laws.rolling import RollingLaw
from dmoc.program.laws.sliding import SlidingLaw
from dmoc.program.laws.step import StepLaw
from dmoc.program.laws.surface_ends import SurfaceEndsLaw
from dmoc.program.laws.tangential import TangentialLaw
from dmoc.program.laws.velocity import VelocityLaw
from dmoc.program.layout import SHARED, Layout
from dmoc.program.presolve import Settled, following_joints
from dmoc.program.scale import Scale
from dmoc.program.totals import counted

# The laws that hold numbers, and those that look at the numbers of friction.
WITH_NUMBERS = "impact", "friction", "hit", "tangential", "held"
AT_FRICTION = "breakaway", "rolling"


class Remembered:
    """The structure that follows from some laws, as long as somebody keeps it, the last
    coefficients of their entries and factors of their terms, with the numbers that these follow
    from, and how sizes spread over their rows."""

    def __init__(self) -> None:
        self.sizes = Spread()

    structure: weakref.ref[Structure] | None = None
    coefficients: tuple[Hashable, Array] | None = None
    factors: tuple[Hashable, Array] | None = None


@dataclass(eq=False, repr=False)
class Laws:
    """All laws of a program, in the order of their rows, and the blocks of all rows."""

    step: StepLaw
    path: PathLaw
    bound: PathLaw
    quantity: QuantityLaw
    velocity: VelocityLaw
    peak: PathLaw
    force: ForceLaw
    liftoff: LiftoffLaw
    objective: ObjectiveLaw
    impact: ImpactLaw
    ends: EndsLaw
    contact: ContactLaw
    friction: FrictionLaw
    sliding: SlidingLaw
    breakaway: BreakawayLaw
    rolling: RollingLaw
    hit: HitLaw
    tangential: TangentialLaw
    ball: BallLaw
    held: HeldLaw
    joint: JointLaw
    complementarity: ComplementarityLaw
    open_grips: OpenGripsLaw
    kink: KinkLaw
    crossing: CrossingLaw
    hit_quantity: HitQuantityLaw
    surface_ends: SurfaceEndsLaw
    equalities: tuple[Block, ...] = ()
    inequalities: tuple[Block, ...] = ()
    remembered: Remembered = field(default_factory=Remembered)

    @cached_property
    def n_eq(self) -> int:
        return sum(b.count for b in self.equalities)

    @cached_property
    def n_in(self) -> int:
        return sum(b.count for b in self.inequalities)

    def __iter__(self) -> Iterator[Law]:
        first = self.step, self.path, self.bound, self.quantity, self.velocity, self.peak
        left_open = self.complementarity, self.open_grips
        last = self.joint, *left_open, self.force, self.liftoff, self.objective, self.kink
        others = *self.of_contacts, *last, self.crossing, self.hit_quantity, self.surface_ends
        return iter((*first, self.impact, self.ends, *others))

    @property
    def of_contacts(self) -> tuple[Law, ...]:
        """The laws of contacts; none in a motion without contacts, where their blocks have no
        members."""
        if _is_untouched(self.contact.lay):
            return ()
        rubbing = self.friction, self.sliding, self.breakaway, self.rolling
        return self.contact, *rubbing, self.hit, self.tangential, self.ball, self.held

    def stating(self, problem: Problem) -> Laws:
        """The same rows with the numbers that another problem has for its hits and both ends, in
        names, constants and factors."""
        if (impact := self.impact.stating(problem)) is not self.impact:
            self = replace(self, impact=impact)
        if problem.kernels.quantities:
            bound, quantity = self.bound.bounding(problem), self.quantity.stating(problem)
            self = replace(self, bound=bound, quantity=quantity)
        before = self.ends
        if before.says_the_same(problem):
            return self
        ends = replace(before, problem=problem)
        same = replace(
            self,
            ends=ends,
            equalities=_again(self.equalities, before.start_velocity, ends.equations),
            inequalities=_again(self.inequalities, before.earliest, ends.inequalities),
        )
        same.n_eq, same.n_in = self.n_eq, self.n_in
        return same

    def with_numbers(self, other: Laws) -> Laws:
        """The same rows with the numbers that laws of the same facts hold."""
        if self.values == other.values:
            return self
        pairs = {name: (getattr(self, name), getattr(other, name)) for name in WITH_NUMBERS}
        own = {name: mine.with_numbers(theirs) for name, (mine, theirs) in pairs.items()}
        for name in AT_FRICTION if own["friction"] is not self.friction else ():
            own[name] = copy(getattr(self, name))
            own[name].friction = own["friction"]
        return replace(self, **own)

    @property
    def values(self) -> tuple[bytes, ...]:
        """The numbers that laws hold, on which coefficients of entries and factors of terms
        depend."""
        return tuple(part for name in WITH_NUMBERS for part in getattr(self, name).values)

    @property
    def restitution(self) -> tuple[bytes, bytes]:
        """Those on which factors of terms depend."""
        return self.impact.e.tobytes(), self.hit.e.tobytes()

    def settled(self, problem: Problem, limits: tuple[Array, Array]) -> Laws:
        """Note what of a problem its unknowns with equal lower and upper limits settle."""
        for law in self:
            law.settle(problem, limits)
        return self

    @property
    def facts(self) -> Hashable:
        """What the rows of settled laws follow from, beside what their problems have in common."""
        return tuple(law.facts for law in self)

    def numbered(self) -> Laws:
        """Number the rows of settled laws."""
        laws, block = tuple(self), Numbering()
        for law in laws:
            law.equations(block)
        count = len(block.made)
        for law in laws:
            law.inequalities(block)
        self.equalities, self.inequalities = tuple(block.made[:count]), tuple(block.made[count:])
        return self


def laws_of(
    problem: Problem,
    lay: Layout,
    scale: Scale,
    grazing: Index,
    goals: Sequence[Goal],
    pulling: bool = False,
) -> Laws:
    """The laws of a problem, without the numbers of their rows; ``goals`` are those that are
    constraints instead of bounds, the other arguments are those of the program."""
    impact = ImpactLaw.of(problem, lay, grazing)
    if _is_untouched(lay):
        of_contacts = _untouched(lay)
    else:
        contact = ContactLaw(lay, pulling)
        model, mu, mu_s = problem.model, problem.friction, problem.static_friction
        sliding = SlidingLaw(contact)
        friction = FrictionLaw(contact, sliding, mu, mu_s, model.paired, model.slows)
        hit = HitLaw.of(problem, lay, impact)
        in_hits = np.where(np.isinf(model.hit_friction), np.inf, mu[:-1])
        returning = TangentialLaw(lay, in_hits, model.tangential_restitution, impact.grazing)
        ball = BallLaw.of(lay, mu[:-1], model.tangential_restitution, impact.grazing)
        held = HeldLaw(contact, mu[:-1], impact.grazing, following_joints(problem))
        rubbing = friction, sliding, BreakawayLaw(friction), RollingLaw(contact, friction)
        of_contacts = contact, *rubbing, hit, returning, ball, held
    return Laws(
        StepLaw(problem, lay), PathLaw.of(problem, lay), PathLaw.of_quantities(problem, lay),
        QuantityLaw(problem, lay),
        VelocityLaw(lay, tuple(problem.kernels.coordinates), problem.velocity_bounds),
        PathLaw.of_peaks(problem, lay), ForceLaw(lay), LiftoffLaw(lay, pulling),
        ObjectiveLaw(
            lay, tuple(problem.model.totals_of), problem.model.hit_sums[:, 0],
            counted(problem, lay),
        ), impact,
        EndsLaw(problem, lay, tuple(goals)), *of_contacts,
        JointLaw(
            lay, tuple(problem.kernels.manifest.bent_joints),
            tuple(problem.kernels.manifest.rate_constraints),
        ),
        ComplementarityLaw(
            lay, problem.friction[0], problem.restitution_values, problem.relaxation, scale
        ),
        OpenGripsLaw(lay, problem.relaxation, scale),
        KinkLaw(problem, lay), CrossingLaw(lay, problem.model.nw),
        HitQuantityLaw.of(problem, lay), SurfaceEndsLaw(problem, lay),
    )  # fmt: skip


def _again(
    blocks: tuple[Block, ...], first: Block, number: Callable[[Numbering], None]
) -> tuple[Block, ...]:
    """Blocks with those of a law made again, from its first one on, with the same numbers."""
    i = blocks.index(first)
    numbering = Numbering(like=blocks[i:])
    number(numbering)
    return (*blocks[:i], *numbering.made, *blocks[i + len(numbering.made) :])


def rows_follow_from(problem: Problem, lay: Layout, grazing: Index) -> Hashable | None:
    """All that rows, terms and entries of a program follow from, beside which unknowns are fixed
    and, where fixed values settle rows, the facts of its laws: problems that differ in other
    numbers share them, and have coefficients of restitution of their own.  None where contacts are
    left open."""
    if lay.touch.open:
        return None
    kernels = problem.kernels
    model = *kernels.identity, *kernels.design
    low, high = problem.final_time_bounds
    ends = low == high, 0 < low < high, low < high < np.inf, *(r.kind for r in problem.relations)
    statement = ends, tuple(problem.ignored), problem.by_rates, problem.parameter_values.shape
    return (
        lay, model, statement, np.isnan(problem.restitution_values).tobytes(), grazing.tobytes(),
        problem.velocity_bounds.tobytes(), np.isfinite(problem.quantity_bounds).tobytes(),
        problem.quantity_ranges.kinds, problem.hit_quantity_bounds.tobytes(),
        changes_of(problem).tobytes(),
    )  # fmt: skip


def settles_rows(problem: Problem, lay: Layout) -> bool:
    """Whether fixed values, and not only which ones these are, settle rows of a program: of
    contacts, of constraints, of an event at the end, of gaps that periodic states make those of the
    other end."""
    held = not _is_untouched(lay) or lay.ends_with_event
    return bool(held or problem.kernels.joints or problem.relations)


def _is_untouched(lay: Layout) -> bool:
    """Whether no contact lasts and no impact has friction."""
    return lay.touch.free and not lay.hit.passages


@lru_cache(maxsize=SHARED)
def _untouched(
    lay: Layout,
) -> tuple[
    ContactLaw,
    FrictionLaw,
    SlidingLaw,
    BreakawayLaw,
    RollingLaw,
    HitLaw,
    TangentialLaw,
    BallLaw,
    HeldLaw,
]:
    """Laws of contacts where there are none: their blocks have no members, so that all programs of
    a layout share them."""
    mu, events = np.zeros((lay.phases, len(lay.touch.contacts.tangents))), len(lay.touch.surfaces)
    contact = ContactLaw(lay, False)
    contact.settled, sliding = Settled.nothing(lay), SlidingLaw(contact)
    friction = FrictionLaw(contact, sliding, mu, mu, mu[0] > 0, False)
    grazing = np.zeros(events, dtype=bool)
    hit = HitLaw(lay, (), mu[:-1], np.zeros(events), grazing)
    none = np.zeros((lay.phases, len(lay.joint.names)), dtype=bool)
    held = HeldLaw(contact, mu[:-1], grazing, none)
    returning = TangentialLaw(lay, mu[:-1], mu[0], grazing)
    breakaway, ball = BreakawayLaw(friction), BallLaw.of(lay, mu[:-1], mu[0], grazing)
    rolling = RollingLaw(contact, friction)
    laws = contact, friction, sliding, breakaway, rolling, hit, returning, ball, held
    for law in laws:
        law.equations(Numbering())
        law.inequalities(Numbering())
    return laws
