"""Problems of one form, solved as rows, from one solution or each from its own guess: their
structure is made once, their numbers are rows of arrays.

A row that ends in a strict minimum is what a solve of its own finds, and so is what the check makes
of it.  Ends of other kinds are left to a solve of their own.
"""

from __future__ import annotations

import time
from collections.abc import Hashable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dmoc.base.deadline import Deadline
from dmoc.base.discretisation import DISCRETISATIONS
from dmoc.base.records import record
from dmoc.check.checked_motion import OutOfTimeError, out_of_time
from dmoc.check.compiled import MOST, FreeMotion, has_room, is_free
from dmoc.check.limit_functions import bounds_among
from dmoc.codegen.kernels import Array
from dmoc.mechanics.model import Model
from dmoc.problem.problem import Problem
from dmoc.program.blocks import Index
from dmoc.program.extraction import collected_multipliers
from dmoc.program.free_rows import FreeRows
from dmoc.program.laws.step import StepLaw
from dmoc.program.rows import RowNumbers, row_numbers
from dmoc.program.scaling import scale_of
from dmoc.program.stacked import Stacked
from dmoc.program.transcription import Transcription
from dmoc.results.solution import Solution
from dmoc.solvers.ipm import STATUSES
from dmoc.solvers.outcome import Duals, Ending, Options, Outcome, Residuals, Status
from dmoc.solvers.row_solves import RowEnds, solve_rows
from dmoc.solving.attempts import Attempt
from dmoc.solving.beginning import Beginning
from dmoc.solving.checked_solution import NO_MOTION, checked, solution_of
from dmoc.solving.grazing import SUSPECT
from dmoc.solving.keywords import Keywords
from dmoc.solving.methods import COMPILED_METHOD
from dmoc.solving.row import Row, row_of
from dmoc.solving.starts import InitialGuess, Starts, starts_of

Bools = NDArray[np.bool_]
# What the compiled check says of a row that passes; 0 of one that needs another look.
PASSES, UNSEEN = 1, 2
# Rows for which it is worth while to lay out what they have in common.
FEWEST = 2
# Ends that say nothing of a problem, but of the share of the time that its solve had.
NO_END = Status.TIME_LIMIT, Status.INTERRUPTED
# Share of the time that is left for solves whose ends are checked: what is not checked is lost.
FOR_SOLVES = 0.5


def solved_rows(
    problems: Sequence[tuple[int, Problem]],
    keywords: Keywords,
    guess: InitialGuess,
    deadline: Deadline,
    keep: bool = False,
) -> Iterator[Row | Beginning]:
    """Rows of the problems, with their numbers, that are of one form and end in a strict minimum
    where they start first, with their solutions if these are kept; of others of one form where
    their solves go on."""
    for places in _forms(problems).values():
        first = problems[places[0]][1]
        fits = _asks_for_it(first, keywords) and _is_free(first)
        if len(places) < FEWEST or not fits or deadline.passed:
            continue
        begin = time.perf_counter()
        with np.errstate(all="ignore"):
            starts = _RowStarts.of([problems[k] for k in places], guess, deadline)
            if len(starts.numbers) < FEWEST:
                continue
            rows = _Rows.of(starts, keywords, deadline)
        each = (time.perf_counter() - begin) / len(starts.numbers)
        yield from rows.answers(each, keep)
        yield from rows.others(each)


def _forms(problems: Sequence[tuple[int, Problem]]) -> dict[Hashable, list[int]]:
    """The places of the problems that have one form, but for what their bounds fix or leave
    open."""
    places: dict[Hashable, list[int]] = {}
    for k, (_, problem) in enumerate(problems):
        arrays = problem.restitution_values, problem.velocity_bounds
        form = (
            id(problem.kernels), problem.sequence, problem.phase_steps, problem.control_form,
            tuple(problem.contacts), tuple(problem.ignored), problem.minimal_times,
            problem.by_rates, tuple(problem.design), *(r.kind for r in problem.relations),
            problem.steps is None, len(problem.parameter_values),
            *(array.tobytes() for array in arrays),
        )  # fmt: skip
        places.setdefault(form, []).append(k)
    return places


def _asks_for_it(problem: Problem, keywords: Keywords) -> bool:
    """Whether one solve by the compiled method on the mesh of a problem is asked for."""
    once = keywords.starts == 1 and keywords.tolerance is None and problem.steps is not None
    return once and keywords.method == COMPILED_METHOD.name


def _is_free(problem: Problem) -> bool:
    """Whether a problem is that of a motion that is free between hits, and has nothing else that a
    solve would look at."""
    kernels, touch = problem.kernels, problem.touch
    facts = kernels.manifest
    if not is_free(kernels) or _has_quantities(problem) or facts.hidden or facts.attitudes:
        return False
    if problem.nu and not facts.inputs_enter_linearly:
        return False
    others = problem.open_hits or problem.models.change
    if others or touch.open or not touch.free or problem.ends_with_event:
        return False
    return all(e.hit >= 0 and not (e.lands or e.leaves or e.friction or e.course)
               for e in touch.events)  # fmt: skip


def _has_quantities(problem: Problem) -> bool:
    """Whether a problem says something of quantities of its model."""
    quantities, ranges = {*problem.kernels.quantities}, problem.quantity_ranges
    related = any(quantities & {r.end, *r.starts} for r in problem.relations)
    said = problem.quantity_bounds, ranges.start, ranges.goal, ranges.via
    return related or any(bool(np.isfinite(one).any()) for one in said)


@record(frozen=True, eq=False)
class _RowStarts:
    """Where problems of one form, with their numbers in a batch, start: all starts of each, and its
    first unknowns, shape (R, n)."""

    numbers: Sequence[int]
    problems: Stacked
    of_each: Sequence[Starts]
    x: Array

    @classmethod
    def of(
        cls, problems: Sequence[tuple[int, Problem]], guess: InitialGuess, deadline: Deadline
    ) -> _RowStarts:
        """The starts of those problems that a guess fits, until a deadline."""
        numbers, every, of_each = list[int](), list[Problem](), list[Starts]()
        starts = Starts(())
        for number, problem in problems:
            if deadline.passed:
                break
            same = isinstance(guess, Solution) and starts.multipliers is not None
            with suppress(Exception):  # that of a single problem is its row
                starts = starts if same else starts_of(problem, guess, deadline)
                numbers.append(number)
                every.append(problem)
                of_each.append(starts)
        return cls(numbers, Stacked(every), of_each, np.array([s.points[0] for s in of_each]))

    @property
    def minimum(self) -> bool:
        """Whether the starts are those of minima."""
        return self.of_each[-1].minimum

    @property
    def near(self) -> bool:
        """Whether these minima are on another mesh."""
        return self.of_each[-1].near

    @property
    def multipliers(self) -> Mapping[str, Array] | None:
        """Multipliers by kind where all start at one solution."""
        return self.of_each[-1].multipliers


@record(frozen=True, eq=False)
class _Rows:
    """Solved rows, of which the first one has the program ``nlp``, and their motions."""

    starts: _RowStarts
    keywords: Keywords
    deadline: Deadline
    nlp: Transcription
    numbers: RowNumbers
    ends: RowEnds
    motions: FreeRows

    @classmethod
    def of(cls, starts: _RowStarts, keywords: Keywords, deadline: Deadline) -> _Rows:
        problems, x, minimum = starts.problems, starts.x, starts.minimum
        first, duals = problems.first, None
        nlp = Transcription(first, scale_of(first, x[0], minimum))
        numbers = row_numbers(problems, nlp, x, minimum)
        if starts.multipliers is not None:
            rows, z = collected_multipliers(nlp, starts.multipliers)
            y = rows / (numbers.cost[:, None] / numbers.row_sizes)
            z = z / (numbers.cost[:, None] / numbers.sizes)
            duals = Duals(y[:, : nlp.n_eq], y[:, nlp.n_eq :], z)
        elif starts.near:
            duals = Duals.none(nlp.n_eq, nlp.n_in, nlp.n, len(x))
        until = deadline.share(FOR_SOLVES) if keywords.verify else deadline
        options = Options(keywords.optimality, keywords.violation, keywords.iterations, until)
        ends = solve_rows(nlp, numbers, x / numbers.sizes, duals, options)
        at = numbers.physical(ends.x)
        motions = FreeRows.of(first, nlp.layout, numbers.parameters, at)
        return cls(starts, keywords, deadline, nlp, numbers, ends, motions)

    @property
    def problems(self) -> Stacked:
        return self.starts.problems

    @cached_property
    def minima(self) -> Bools:
        """Rows of one form that have ended in a strict minimum of which nothing else is to be
        told."""
        m = self.motions
        still = (m.impulse > 0).any(axis=1) & m.still(NO_MOTION * self.numbers.p)
        # of a cost below zero it is asked where it ends
        plain = self.ends.strict & self._alike & (m.cost > 0) & ~still & ~m.grazes.any(axis=1)
        return np.asarray(plain & ~self._suspected)

    @cached_property
    def _alike(self) -> Bools:
        """Rows of which the same is fixed as of the first one, and with the same kinds of ends."""
        low, high = self.numbers.limits
        kinds = [low == high, *self.problems.kinds]
        alike = np.asarray(np.all([(k == k[0]).all(axis=1) for k in kinds], axis=0))
        return alike & self._returns_alike if self.problems.first.relations else alike

    @property
    def _returns_alike(self) -> Bools:
        """Rows of periodic states that settle the same gaps at the ends as those of the first
        one."""
        each, lay, first = self.problems.each, self.nlp.layout, self.nlp.laws.step.gaps
        steps = [StepLaw(problem, lay) for problem in each]
        for step, problem, low, high in zip(steps, each, *self.numbers.limits, strict=True):
            step.settle(problem, (low, high))
        return np.array([bool((step.gaps == first).all()) for step in steps])

    @property
    def _suspected(self) -> Bools:
        """Rows in which a hit hardly approaches its surface, or hardly pushes it (grazing.py)."""
        lay, m, par = self.nlp.layout, self.motions, self.motions.par
        model, suspected = Model(self.nlp.kernels, par), np.zeros(len(par), dtype=bool)
        for i, j in enumerate(lay.touch.surfaces.tolist()):
            at = m.begins[i + 1]
            rates = model.gap_rates(m.q[:, at], m.arrivals[:, i], m.t[:, at])[:, j]
            faint = rates <= SUSPECT * self.numbers.rate[:, j]
            suspected |= faint | (self.ends.x[:, lay.impact.lam[i]] <= SUSPECT)
        return suspected

    def answers(self, seconds: float, keep: bool) -> Iterator[Row]:
        """The rows that have ended in a minimum, until the time is over; after Ctrl-C those that
        have passed the check before.  Kept solutions are checked one by one, for their numbers."""
        which, interrupted = np.flatnonzero(self.minima), False
        begin, verdicts = time.perf_counter(), np.full(len(which), UNSEEN, np.uint8)
        try:
            if not keep:
                self._judge(which, verdicts)
        except OutOfTimeError:
            pass
        except KeyboardInterrupt:
            interrupted = True
        each = seconds + (time.perf_counter() - begin) / max(len(which), 1)
        kept = self._kept(which, each)
        for k, row, verdict in zip(which.tolist(), kept, verdicts.tolist(), strict=True):
            if verdict == PASSES:
                yield row
            elif not interrupted and not self.deadline.passed:
                begin = time.perf_counter()
                other = self._solution(k, seconds)
                yield row_of(row.number, other, each + time.perf_counter() - begin, keep)
        if interrupted:
            raise KeyboardInterrupt

    def others(self, seconds: float) -> Iterator[Beginning]:
        """Where the solves of other rows of one form go on: of those that had their turn."""
        left = (self.ends.status >= 0) & self._alike & ~self.minima
        for k in np.flatnonzero(left).tolist():
            status, starts = STATUSES[self.ends.status[k]], self.starts
            if status not in NO_END:
                end = Ending(status, "", *self._point(k), int(self.ends.iterations[k]))
                problem = starts.problems.each[k]
                yield Beginning(starts.numbers[k], problem, starts.of_each[k], end, seconds)

    def _point(self, k: int) -> tuple[Array, Duals]:
        """Where a row has ended, scaled, with its multipliers."""
        ends = self.ends
        return ends.x[k].copy(), Duals.of_rows(self.nlp.n_eq, ends.y[k].copy(), ends.z[k].copy())

    def _judge(self, which: Index, verdicts: NDArray[np.uint8]) -> None:
        """Find out which of some rows pass the compiled check, as far as the time allows."""
        problem, kernels = self.problems.first, self.nlp.kernels
        if not self.keywords.verify:
            verdicts[:] = PASSES
            return
        if not self._is_checked:
            return
        both = self.problems.coordinate_bounds, self.problems.input_bounds
        boxes = (box.take(which, axis=0) for box in both)
        motions = (
            *self.motions.states(which, self.nlp.layout.touch.surfaces), *boxes,
            problem.restitution_values, *self._watched, not self.nlp.layout.form.width,
        )  # fmt: skip
        par, claims = self.motions.par[which], self.motions.cost[which]
        check = FreeMotion(kernels, DISCRETISATIONS[problem.order])
        check_time = partial(out_of_time, self.deadline)
        check_time()
        with np.errstate(all="ignore"):
            check.judge(par, motions, claims, MOST, verdicts, check_time)

    @cached_property
    def _is_checked(self) -> bool:
        """Whether compiled code checks such motions."""
        problem, kernels = self.problems.first, self.nlp.kernels
        few = has_room(kernels, len(bounds_among(problem.limits, kernels)), self.nlp.layout.total)
        return bool(few and (problem.restitution_values > 0).all())

    @cached_property
    def _watched(self) -> tuple[Any, Array]:
        """The surfaces that a check watches, and bounds of velocities, as compiled code has
        them."""
        problem, kernels = self.problems.first, self.nlp.kernels
        watched = np.array([s not in problem.ignored for s in kernels.surfaces], dtype=np.uint8)
        bounds = bounds_among(problem.limits, kernels)
        rates = np.array([(b.place, b.sign, b.value) for b in bounds], dtype=float)
        return watched, rates.reshape(-1, 3)

    def _kept(self, which: Index, seconds: float) -> Iterator[Row]:
        """What a batch keeps of some rows that are solved."""
        m, words = self.motions, self.problems.first.words
        check, status = "passed" if self.keywords.verify else "", str(Status.SOLVED)
        numbers = [self.starts.numbers[k] for k in which.tolist()]
        columns = m.cost, m.final_time, m.event_times, m.impulse, self.ends.iterations, m.design
        for number, *values in zip(numbers, *(c[which].tolist() for c in columns), strict=True):
            cost, final_time, times, impulses, iterations, chosen = values
            design = dict(zip(self.problems.design, chosen, strict=True))
            yield Row(
                number, status, Status.SOLVED.sentence, cost, final_time, words, tuple(times),
                tuple(impulses), iterations, check, design, seconds=seconds,
            )  # fmt: skip

    def _solution(self, k: int, seconds: float) -> Solution:
        """The solution of a row, checked if it shall be."""
        problem, ends = self.problems.each[k], self.ends
        with np.errstate(all="ignore"):
            scale = scale_of(problem, self.starts.x[k], self.starts.minimum)
            nlp = Transcription(problem, scale)
            left = Residuals(float(ends.optimality[k]), float(ends.violation[k]))
            count = int(ends.iterations[k])
            outcome = Outcome(Status.SOLVED, "", *self._point(k), count, left)
            spent = {"build": problem.kernels.seconds, "guess": 0.0, "solve": seconds}
            solution = solution_of(Attempt(nlp, outcome), COMPILED_METHOD.name, spent)
        verify = self.keywords.verify and solution.minimum
        return checked(solution, self.deadline) if verify else solution
