"""Motions of relaxed programs: from random starts that are folded at the surfaces, with what may
touch left open, for eps that falls.

The hits of a start may be none in the end, and contacts may close and rub at any node
(:mod:`dmoc.program.laws.complementarity`).  A start takes some milliseconds, a hundredth of what
its sequence costs in a node.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from itertools import cycle, islice, pairwise, product, zip_longest

import numpy as np

from dmoc.base.deadline import Deadline
from dmoc.codegen.kernels import Array
from dmoc.guess.automatic import natural_time
from dmoc.guess.folded import Folded, folded_motions
from dmoc.mechanics.algebra import solved, solved_transpose
from dmoc.mechanics.contacts import RAIL
from dmoc.mechanics.touch import Open
from dmoc.problem.derived import relaxed
from dmoc.problem.problem import Problem
from dmoc.program.laws.complementarity import OF_HITS
from dmoc.program.scale import Scale
from dmoc.program.scaling import scale_of
from dmoc.program.transcription import Transcription
from dmoc.sequences.relaxed_motion import RelaxedMotion
from dmoc.sequences.settings import Settings
from dmoc.solvers.ipm import solve_ipm
from dmoc.solvers.judge import judged
from dmoc.solvers.outcome import Options, Status
from dmoc.solving.multistart.parallel import free_threads

# What complementarity is relaxed by, one after the other: from far where contacts may close at any
# node, from near of starts with hits, which a large one would turn into contacts that last.
EVERY = (1.0, 1e-1, 3e-2, 1e-2, 1e-3, 1e-4)
# The barrier parameter that each eps begins with: with less, motions of legs keep to the contacts
# of the eps before, and take many iterations to leave them.
BARRIER = 1e-2
# Steps of a relaxed motion, those where no start has led to one, and of a phase between its hits at
# least: on half of the steps large systems, as walkers with five links, have motions in far fewer
# iterations.
STEPS, COARSER, FEWEST = 40, 20, 10
# Random motions that are solved together, and at most, and those of which they are chosen: folded
# ones may stay beyond a surface, or have too many hits.
MOTIONS, MOST_MOTIONS, DRAWN = 8, 24, 128
# Of two times as many as are solved together, those that touch at least.
BENT = 4
# Iterations of a start for the first eps, and for each of the others: what has begun well is worth
# more.
ITERATIONS, FURTHER = 400, 800
# Of the starts' costs, the share below that which measures the cost, as some begin with no inputs;
# and on fewer steps, where some cost so much that, measured by it, that of a minimum is nothing.
TYPICAL, LOWER = 0.7, 0.4

Point = tuple[tuple[str, ...], Array]


def _repeated(order: Sequence[int]) -> int:
    """Number of times that a surface follows itself."""
    return sum(a == b for a, b in pairwise(order))


@dataclass
class Relaxation:
    """The relaxed programs of a problem.

    ``left_open`` is what may touch for some time, ``mirrors`` are the surfaces that may be hit.
    """

    problem: Problem
    left_open: Open
    mirrors: tuple[int, ...]
    cost: float = 0.0  # a size of it, that of the starts
    steps: int = STEPS
    _problems: dict[tuple[str, ...], Problem] = field(default_factory=dict)
    _scales: dict[tuple[str, ...], Scale] = field(default_factory=dict)
    _made: dict[tuple[int, tuple[str, ...]], list[Transcription]] = field(default_factory=dict)

    @classmethod
    def of(cls, problem: Problem, settings: Settings) -> Relaxation:
        """What no sequence says: surfaces with restitution are hit, others close, and grips; where
        the model has tangents, or a surface is closed at the start, all surfaces may close.  Beside
        what is closed at the start surfaces with friction are feet, which land."""
        contacts, mode, rubs = (
            problem.touch.contacts,
            problem.touch.modes[0],
            problem.model.has_friction,
        )
        stands = [j for j in mode.closed if not contacts.pull[j]]
        lasts, e = bool(contacts.tangents or stands), problem.restitution_values
        named = [s for s in settings.surfaces if s not in problem.ignored]
        places = [s for g in named if g in contacts.grip_names for s in contacts.places(g)]
        can = [contacts.surface_numbers[s] for s in named if s not in contacts.grip_names]
        grips = (*(contacts.surface_numbers[s] for s in places), *mode.closed)
        lasting = [j for j in can if j not in contacts.in_space]
        closing = tuple(j for j in lasting if lasts or e[j] == 0)  # a law is no number
        closing += tuple(j for j in dict.fromkeys(grips) if contacts.pull[j])
        on = (RAIL, *closing)
        rubbing = tuple(k for k, j in enumerate(contacts.supports) if j in on and rubs[k])
        feet = (*stands, *problem.model.rough) if stands else ()
        mirrors = tuple(j for j in can if e[j] != 0 and j not in feet)
        return cls(problem, Open(closing, rubbing, mode.closed), mirrors)

    @property
    def passed(self) -> tuple[str, ...]:
        """Surfaces that are ignored where others of the same model may close."""
        return tuple(self.problem.ignored) if self._closes else ()

    @property
    def nothing_touches(self) -> bool:
        return not (self.left_open.surfaces or self.left_open.tangents or self.mirrors)

    def motions(
        self, most: int, seed: int, deadline: Deadline
    ) -> Iterator[list[RelaxedMotion | None]]:
        """Motions from random starts, which have ``most`` hits each at most, some together and in
        their order; None for a start that leads to none."""
        led, starts, named = False, self._starts(most, seed), self._named(most, seed)
        for k in range(0, 2 * MOST_MOTIONS, MOTIONS):
            some = list(islice(starts if k < MOST_MOTIONS else named, MOTIONS))
            if deadline.passed or (led and k >= MOST_MOTIONS):
                return
            if not some:
                continue
            points = [self._begun(start) for start in some]
            if not self.cost:
                costs = [scale_of(self._relaxed(hits), x).cost for hits, x in points]
                share = TYPICAL if self.steps == STEPS else LOWER
                self.cost = sorted(costs)[int(share * len(costs))]
            motions = self._solved(points, deadline)
            yield motions
            led = led or any(motions)
            if not led and self.steps == STEPS:
                self.steps, self.cost = COARSER, 0.0
                for kept in (self._problems, self._scales, self._made):
                    kept.clear()

    def _begun(self, start: Folded) -> Point:
        """The hits of a start, and its unknowns."""
        return start.hits, start.unknowns(self._relaxed(start.hits))

    def beside(self, motion: Folded, most: int, deadline: Deadline) -> list[RelaxedMotion | None]:
        """Motions from one that is bent to one hit more, of each surface in each of its phases, and
        where contacts close from the motion itself; whatever they keep of its hits."""
        motion = motion.between_hits()
        more = self.mirrors if len(motion.hits) < most else ()
        places = product(range(len(motion.pieces)), more)
        bent = [motion.hitting(self.problem, i, j) for i, j in places]
        starts = [*([motion] if self._closes else []), *bent]
        return self._solved([self._begun(start) for start in starts], deadline)

    @property
    def _closes(self) -> bool:
        """Whether anything may touch for some time."""
        return bool(self.left_open.surfaces or self.left_open.tangents)

    def _starts(self, most: int, seed: int) -> Iterator[Folded]:
        """Random motions with hits; every other one has none where contacts close as well, else the
        first alone."""
        plain = self._relaxed(())
        for k in range(0, DRAWN, 2 * MOTIONS):
            numbers = range(k, k + 2 * MOTIONS)
            folded = folded_motions(plain, self.mirrors, numbers, seed)
            touching = self._touching(list(folded), most)
            if not (self._closes or k == 0):
                yield from touching
                continue
            others = range(DRAWN + k, DRAWN + k + 2 * MOTIONS) if self._closes else range(1)
            smooth = folded_motions(plain, (), others, seed)
            pairs = zip_longest(smooth, touching)
            yield from (m for pair in pairs for m in pair if m is not None)

    def _touching(self, folded: Sequence[Folded], most: int) -> list[Folded]:
        """The folded motions with hits, at most ``most`` each. Where these are few, others are bent
        to one hit: a motion that falls freely is hardly ever folded."""
        touching = [m for m in folded if 1 <= len(m.hits) <= most]
        others = (m for m in folded if not m.hits and most)
        bent = (m.hitting(self.problem, 0, j) for m, j in zip(others, cycle(self.mirrors)))
        return touching + list(islice(bent, max(BENT - len(touching), 0)))

    def _named(self, most: int, seed: int) -> Iterator[Folded]:
        """Random motions bent to two hits and more, in every order, first of different surfaces one
        after the other: what is moved by hits alone, as a ball by a cue and a cushion, is folded to
        the right order by chance."""
        orders = [
            order for n in range(2, most + 1)
            for order in sorted(product(self.mirrors, repeat=n), key=_repeated)
        ]  # fmt: skip
        smooth = folded_motions(self._relaxed(()), (), range(2 * MOST_MOTIONS), seed)
        for motion, order in zip(smooth, orders, strict=False):
            for i, j in enumerate(order):
                motion = motion.hitting(self.problem, i, j)
            yield motion

    def _relaxed(self, hits: tuple[str, ...]) -> Problem:
        if hits not in self._problems:
            steps = max(FEWEST, -(-self.steps // (len(hits) + 1)))
            self._problems[hits] = relaxed(self.problem, self.left_open, hits, steps, EVERY[0])
        return self._problems[hits]

    def _solved(self, points: Sequence[Point], deadline: Deadline) -> list[RelaxedMotion | None]:
        """Solve from some starts, in threads."""
        for hits, x in points:  # the same sizes in all threads, those of the first start
            if hits not in self._scales:
                self._scales[hits] = self._scale(self._relaxed(hits), x)
        stopped, count = threading.Event(), max(1, min(free_threads(), len(points)))
        ends: list[RelaxedMotion | None] = [None] * len(points)
        turns = iter(range(len(points)))  # a thread takes the next one as soon as it is free

        def every(k: int) -> None:
            for i in turns:
                if deadline.passed or stopped.is_set():
                    return
                with np.errstate(all="ignore"):
                    ends[i] = self._followed(k, *points[i], deadline, stopped)

        if count == 1:
            every(0)
            return ends
        with ThreadPoolExecutor(count) as pool:
            try:
                list(pool.map(every, range(count)))
            finally:
                stopped.set()
        return ends

    def _followed(
        self,
        thread: int,
        hits: tuple[str, ...],
        x: Array,
        deadline: Deadline,
        stopped: threading.Event,
    ) -> RelaxedMotion | None:
        """Follow one start as eps falls, until it is stopped; each motion begins with the one
        before."""
        programs = self._programs(thread, hits)
        z, duals = programs[0].scaled(x), None
        for nlp in programs:
            most = ITERATIONS if nlp is programs[0] else FURTHER
            options = Options(iterations=most, deadline=deadline)
            outcome = judged(nlp, solve_ipm(nlp, z, options, duals, BARRIER), options)
            if outcome.status is Status.INTERRUPTED:
                raise KeyboardInterrupt
            if outcome.status is not Status.SOLVED or stopped.is_set():
                return None
            z, duals = outcome.x, outcome.duals
        return RelaxedMotion(nlp, nlp.physical(z), nlp.cost(z) * nlp.scale.cost)

    def _programs(self, thread: int, hits: tuple[str, ...]) -> list[Transcription]:
        """Programs for some hits, for eps that falls; a thread has its own."""
        if (thread, hits) not in self._made:
            scale = self._scales[hits]
            near = bool(hits) or not self._closes
            every = [eps for eps in EVERY if eps <= OF_HITS] if near else EVERY
            first = Transcription(self._relaxed(hits), scale)
            self._made[thread, hits] = [first.relaxed_by(eps) for eps in every]
        return self._made[thread, hits]

    def _carried(self, lam: Array, time: float) -> Array:
        """Sizes of impulses (nc,), those of grips from what they would have to carry at the start,
        one size for all places of a grip."""
        model, q, sizes = self.problem.model, self.problem.start_position, lam.copy()
        contacts, slopes = model.contacts, model.gap_slopes(q)[:, :-1]
        M, F = model.equations(q)
        push = np.abs(slopes @ solved(M, F))
        square = np.einsum("ji,ij->j", slopes, solved_transpose(M, slopes))
        weight = push * time / np.where(square > 0, square, 1.0)
        for _, names in contacts.grips:
            places = [contacts.surface_numbers[name] for name in names]
            sizes[places] = np.maximum(lam, weight)[places].max()
        return sizes

    def _scale(self, relaxed: Problem, x: Array) -> Scale:
        """Sizes of a start, but those by which complementarity is measured: they are of the
        problem, that a random motion may exceed by far."""
        problem, model, reach = self.problem, self.problem.model, self.problem.reach
        latest, q = problem.final_time_bounds[1], problem.start_position
        time = latest if np.isfinite(latest) else natural_time(problem)
        mass = model.mass(q)

        def sizes(slopes: Array) -> tuple[Array, Array, Array]:
            place = np.abs(slopes) @ reach
            square = np.einsum("ji,ij->j", slopes, solved_transpose(mass, slopes))
            place = np.where(place > 0, place, 1.0)
            return place, place / time, place / time / np.where(square > 0, square, 1.0)

        gap, rate, lam = sizes(model.gap_slopes(q)[:, :-1])
        _, slide, friction = sizes(model.tangent_slopes(q)[:, :-1])
        lam = self._carried(lam, time)
        return replace(
            scale_of(relaxed, x), time=time, cost=self.cost, gap=gap, rate=rate, lam=lam,
            slide=slide, friction=friction,
        )  # fmt: skip
