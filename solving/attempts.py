"""From the starts to one outcome: a method from one start, from several, and what is done where it
ends without a solution."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeAlias

from dmoc.base.records import record
from dmoc.base.tolerances import SAME_COST
from dmoc.codegen.kernels import Array
from dmoc.program.transcription import Transcription
from dmoc.solvers.curvature import Curvature, Landscape, SecondOrder
from dmoc.solvers.inflection import falling_inputs
from dmoc.solvers.judge import INFEASIBLE, judged, rounded
from dmoc.solvers.outcome import NOWHERE, Duals, Ending, Options, Outcome, Status
from dmoc.solving.grazing import pays, pushed, suspects
from dmoc.solving.indeterminacy import left_open_along
from dmoc.solving.methods import COMPILED_METHOD, METHODS, Judged, Method
from dmoc.solving.programs import Programs
from dmoc.solving.starts import Starts

# A method that ends so far from a motion tells nothing of whether there is one.
UNDECIDED = (Status.STALLED, Status.ITERATION_LIMIT)
# Stationary points that are no minima, which a solve goes on from one after the other at most.
MOST_SADDLES = 4
LAST_SADDLE = f"the last of {MOST_SADDLES + 1}"

Minimise: TypeAlias = Callable[[Transcription, Array, Options], Outcome]


@record(frozen=True, eq=False)
class Attempt:
    """The program that was solved last, its outcome, and what conflicts in it."""

    nlp: Transcription
    outcome: Outcome
    conflicts: tuple[str, ...] = ()
    leaves_open: str = ""

    @property
    def status(self) -> Status:
        return self.outcome.status

    def cost(self) -> float:
        """The scaled cost."""
        return self.nlp.cost(self.outcome.x)

    def counting(self, iterations: int) -> Attempt:
        """The same attempt with another number of iterations."""
        return replace(self, outcome=replace(self.outcome, iterations=iterations))

    def after(self, iterations: int) -> Attempt:
        """The same attempt with iterations before its own."""
        return self.counting(iterations + self.outcome.iterations)

    def ending(self, status: Status) -> Attempt:
        """The same attempt with another status."""
        return replace(self, outcome=replace(self.outcome, status=status))

    def saying(self, more: str) -> Attempt:
        """The same attempt with something more in the detail of its message."""
        detail = "; ".join(filter(None, (self.outcome.detail, more)))
        return replace(self, outcome=replace(self.outcome, detail=detail))


def attempted(
    programs: Programs,
    starts: Starts,
    method: Method,
    form: str,
    options: Options,
    end: Ending | None = None,
) -> Attempt:
    """Solve by a method, and by what takes over from it; say what conflicts where nothing helps.
    ``end`` is where the method comes from the first start, if that is known."""
    nlp = programs.program(method.guided)
    points = [nlp.scaled(x) for x in starts.points]
    minimise = _with(method.minimise(form), starts.duals(nlp))
    if starts.near and method.name == COMPILED_METHOD.name:
        points = [points[0], *points]  # once with a small barrier
        minimise = minimise if end is not None else _near(method.minimise(form))
    solver = LocalSolver(programs, minimise if end is None else _after(end, minimise))
    second = METHODS[method.falls_back_on] if method.falls_back_on and programs.compiled else None
    reserve = options.iterations // 2 if second is not None else 0  # for what takes over
    first = replace(options, iterations=options.iterations - reserve)
    attempt = solver.from_points(nlp, points, first)
    if not programs.compiled:
        return attempt
    if second is not None and attempt.status in (*NOWHERE, Status.ITERATION_LIMIT):
        attempt = _taken_over(programs, attempt, points, options, (method, second))
    lost = attempt.status in UNDECIDED and attempt.outcome.left.violation > INFEASIBLE
    if attempt.status is Status.INFEASIBLE or lost:
        left = options.after(0 if lost else attempt.outcome.iterations)
        attempt = _explained(solver, attempt, starts.points[0], left)
    return attempt


def _with(driver: Judged, duals: Duals | None) -> Minimise:
    """A driver with the multipliers of its first start, which serve the programs that have as many
    constraints: not one in which collisions have become grazes."""

    def minimise(nlp: Transcription, x: Array, options: Options) -> Outcome:
        fits = duals is not None and (len(duals.y), len(duals.w)) == (nlp.n_eq, nlp.n_in)
        return driver(nlp, x, options, duals if fits else None)

    return minimise


def _near(driver: Judged) -> Minimise:
    """A driver that begins with a small barrier, and takes its usual one from then on: where the
    first does not lead to a minimum, that may."""
    small = [True]

    def minimise(nlp: Transcription, x: Array, options: Options) -> Outcome:
        none = Duals.none(nlp.n_eq, nlp.n_in, nlp.n)
        return driver(nlp, x, options, none if small and small.pop() else None)

    return minimise


def _after(end: Ending, minimise: Minimise) -> Minimise:
    """A driver whose first end is known."""
    known = [end]

    def minimised(nlp: Transcription, x: Array, options: Options) -> Outcome:
        return judged(nlp, known.pop(), options) if known else minimise(nlp, x, options)

    return minimised


def _taken_over(
    programs: Programs,
    before: Attempt,
    points: Sequence[Array],
    options: Options,
    methods: tuple[Method, Method],
) -> Attempt:
    """The attempt of a second method after a first one; the first end where that gets nowhere."""
    first, second = methods
    count = before.outcome.iterations
    solver = LocalSolver(programs, _with(second.minimise(), None))
    again = solver.from_points(programs.program(second.guided), points, options.after(count))
    if again.status in (Status.SOLVED, Status.TIME_LIMIT, Status.INTERRUPTED):
        detail = f"{first.name} ended {before.status}, the compiled method took over"
        return again.saying(detail).after(count)
    return before.after(again.outcome.iterations)


def _explained(solver: LocalSolver, before: Attempt, x: Array, options: Options) -> Attempt:
    """Say what conflicts; if nothing does, the search for it has found a feasible motion to solve
    from, and an end without a minimum is none of an infeasible problem.  A method that came to no
    end is told so, unless the least violation is one."""
    from dmoc.solvers.diagnosis import diagnose  # here, because most problems have a solution

    nlp, count = before.nlp, before.outcome.iterations
    try:
        diagnosis = diagnose(nlp.problem, nlp.scale, x, options)
    except KeyboardInterrupt:
        return before.ending(Status.INTERRUPTED)
    if diagnosis.violation <= INFEASIBLE:
        if count < options.iterations:
            left = options.after(count)
            again = Attempt(nlp, solver.minimise(nlp, nlp.scaled(diagnosis.x), left))
            if again.status is not Status.INFEASIBLE:
                return solver.ascertained(again, left).after(count)
        if before.status in UNDECIDED:
            return before
        detail = "there is a motion that keeps all constraints, from which no minimum was reached"
        return before.ending(Status.STALLED).saying(detail)
    if before.status in UNDECIDED and not diagnosis.least:
        return before
    # the motion that the conflicts are those of
    none = Duals.none(nlp.n_eq, nlp.n_in, nlp.n)
    end = Ending(Status.INFEASIBLE, "", nlp.scaled(diagnosis.x), none, count)
    return Attempt(nlp, judged(nlp, end, options), diagnosis.sentences).ending(Status.INFEASIBLE)


@record(frozen=True, eq=False)
class LocalSolver:
    """A method on the programs of a problem, from scaled unknowns to a minimum near them."""

    programs: Programs
    minimise: Minimise

    @classmethod
    def compiled(cls, programs: Programs) -> LocalSolver:
        """A solver by the compiled method, from starts without multipliers."""
        return cls(programs, _with(COMPILED_METHOD.minimise(), None))

    def from_points(self, nlp: Transcription, points: Sequence[Array], options: Options) -> Attempt:
        """Solve from one start after the other until one succeeds or a limit is reached; else
        return the least violation."""
        tried, count = list[Attempt](), 0
        for x in points:
            attempt = self.minimum(nlp, x, options.after(count))
            count += attempt.outcome.iterations
            end = attempt.outcome
            if end.status is Status.STALLED and end.left.violation <= options.violation:
                # What holds the motion is known there: a fresh barrier often gets on from it.
                again = self.minimum(attempt.nlp, end.x, options.after(count))
                count += again.outcome.iterations
                attempt = again if again.status is Status.SOLVED else attempt
            lost = attempt.status in (*NOWHERE, Status.STATIONARY)
            if not lost or count >= options.iterations:
                return attempt.counting(count)
            tried.append(attempt)
        return min(tried, key=lambda t: t.outcome.left.violation).counting(count)

    def minimum(self, nlp: Transcription, x: Array, options: Options) -> Attempt:
        """Solve from one start x, shape (n,), to a point that is a minimum to second order, too."""
        return self.ascertained(self.minimised(nlp, x, options), options)

    def ascertained(
        self, attempt: Attempt, options: Options, saddles: int = MOST_SADDLES
    ) -> Attempt:
        """A solution that is a minimum: where motions beside it cost less, the one that they lead
        to.

        If they lead to none, or from one saddle to the next for too long, it stays what it is, and
        is called stationary.
        """
        nlp, outcome = attempt.nlp, attempt.outcome
        sharp = outcome.status is Status.STALLED and rounded(outcome.left)
        if outcome.status is not Status.SOLVED and not sharp:
            return attempt
        plain, duals = self._plain(attempt)
        second = SecondOrder(plain, outcome.x, duals)
        falling = falling_inputs(plain, outcome.x, duals)
        beside = [] if falling is None else second.cheaper(Curvature.inflection(falling))
        if not beside:
            around = second.curvature()
            if around.shape is Landscape.VALLEY:
                return replace(attempt, leaves_open=left_open_along(plain, around.direction))
            beside = second.cheaper(around)
        if not beside:
            return attempt
        left = options.after(outcome.iterations)
        lower = self._lower(attempt, beside if saddles else [], left).after(outcome.iterations)
        if lower.status is not Status.SOLVED:
            return lower
        cost = attempt.cost() * nlp.scale.cost
        lower = lower.saying(f"motions beside a stationary one of cost {cost:.6g} led to it")
        return self.ascertained(lower, options, saddles - 1)

    def past_inflection(self, attempt: Attempt, options: Options) -> Attempt:
        """A solution whose cost falls in third order, ascertained; any other end as it is."""
        if attempt.status is not Status.SOLVED:
            return attempt
        plain, duals = self._plain(attempt)
        falling = falling_inputs(plain, attempt.outcome.x, duals)
        return attempt if falling is None else self.ascertained(attempt, options)

    def _plain(self, attempt: Attempt) -> tuple[Transcription, Duals]:
        """The program of an attempt without minimal times, and the multipliers of its rows."""
        plain, duals = self.programs.free(attempt.nlp), attempt.outcome.duals
        return plain, Duals(duals.y, duals.w[: plain.n_in], duals.z)

    def _lower(self, saddle: Attempt, beside: Sequence[Array], options: Options) -> Attempt:
        """The cheaper minimum of those that motions beside a saddle lead to: the compiled method
        gets there, the method itself has the last word where it keeps the minimum."""
        nlp, count, ends = saddle.nlp, 0, list[Attempt]()
        compiled = self.programs.compiled
        solver = LocalSolver.compiled(self.programs) if compiled else self
        for z in beside:
            start = self.programs.free(nlp) if compiled else nlp
            ends.append(solver.minimised(start, z, options.after(count)))
            count += ends[-1].outcome.iterations
            if ends[-1].status is Status.INTERRUPTED:
                return ends[-1].counting(count)
        minima = [end for end in ends if end.status is Status.SOLVED]
        best = min(minima, key=Attempt.cost, default=saddle)
        if best.cost() >= saddle.cost():
            named = " and ".join(dict.fromkeys(str(end.status) for end in ends))
            detail = f"from there a solve ended {named}" if ends else LAST_SADDLE
            return saddle.ending(Status.STATIONARY).counting(count).saying(detail)
        if not compiled:
            return best.counting(count)
        again = self.minimised(nlp, best.outcome.x, options.after(count))
        count += again.outcome.iterations
        within = again.cost() <= best.cost() + SAME_COST * abs(best.cost())
        confirmed = again.status is Status.SOLVED and within
        return (again if confirmed or again.status is Status.INTERRUPTED else best).counting(count)

    def minimised(self, nlp: Transcription, x: Array, options: Options) -> Attempt:
        """Solve from one start x, shape (n,), and settle what has come of it."""
        return self.settled(nlp, self.minimise(nlp, x, options), options)

    def settled(self, nlp: Transcription, outcome: Outcome, options: Options) -> Attempt:
        """Go on from an outcome: an estimated minimal time that limits the solution is dropped,
        because the dynamics decide and not the estimate, and collisions without effect become
        grazes."""

        def continued(nlp: Transcription, before: Outcome) -> Outcome:
            """Solve another program of the same unknowns from where one has ended."""
            again = self.minimise(nlp, before.x, options.after(before.iterations))
            return replace(again, iterations=before.iterations + again.iterations)

        if _limited_by_times(nlp, outcome, options.violation):
            nlp = self.programs.free(nlp)
            outcome = continued(nlp, outcome)
        plain = Attempt(nlp, outcome)
        if outcome.status not in (Status.SOLVED, *NOWHERE):
            return plain
        at = suspects(nlp, outcome.x)
        if not len(at):
            return plain
        grazing = self.programs.grazes(nlp, at)
        grazed = continued(grazing, outcome)
        if grazed.status in (Status.INTERRUPTED, Status.TIME_LIMIT):
            return plain.ending(grazed.status)
        if grazed.status is not Status.SOLVED:
            return plain.counting(grazed.iterations)
        if not pays(grazing, grazed):
            return Attempt(grazing, grazed)
        again = continued(nlp, replace(grazed, x=pushed(nlp, grazed.x, at)))
        cheaper = outcome.status is not Status.SOLVED or nlp.cost(again.x) <= nlp.cost(outcome.x)
        if again.status is Status.SOLVED and cheaper:
            return Attempt(nlp, again)
        return plain.counting(again.iterations)


def _limited_by_times(nlp: Transcription, outcome: Outcome, violation: float) -> bool:
    """Whether an estimated minimal time holds a solution, or may be what has no solution."""
    timed = nlp.minimal_times
    if outcome.status is Status.SOLVED:
        return bool((outcome.duals.w[timed] > 0).any())
    short = nlp.inequality(outcome.x)[timed] < violation
    return outcome.status is Status.INFEASIBLE and bool(short.any())
