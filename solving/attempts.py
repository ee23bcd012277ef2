"""From the starts to one outcome: a method from one start, from several, and what is done where it
ends without a solution."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

from dmoc.codegen.kernels import COMPILED, Array
from dmoc.program.transcription import Transcription
from dmoc.solvers.curvature import Landscape, SecondOrder
from dmoc.solvers.diagnosis import diagnose
from dmoc.solvers.judge import INFEASIBLE, rounded
from dmoc.solvers.outcome import NOWHERE, Duals, Options, Outcome, Status
from dmoc.solving.indeterminacy import along
from dmoc.solving.methods import METHODS, Judged, Method
from dmoc.solving.programs import Programs
from dmoc.solving.starts import Starts
from dmoc.solving.touches import pays, pushed, suspects

# A method that ends so far from a motion tells nothing of whether there is one.
UNDECIDED = (Status.STALLED, Status.ITERATION_LIMIT)
# Stationary points that are no minima, which a solve goes on from one after the other at most.
MOST_SADDLES = 4
# Relative difference of the costs of one minimum that two methods have ended in.
SAME = 1e-5

Minimise: TypeAlias = Callable[[Transcription, Array, Options], Outcome]


@dataclass(frozen=True)
class Attempt:
    """The program that was solved last, its outcome, and what conflicts in it."""

    nlp: Transcription
    outcome: Outcome
    conflicts: tuple[str, ...] = ()

    def cost(self) -> float:
        """The scaled cost."""
        return self.nlp.cost(self.outcome.x)

    def counting(self, iterations: int) -> Attempt:
        """The same with another number of iterations."""
        return replace(self, outcome=replace(self.outcome, iterations=iterations))

    def saying(self, more: str) -> Attempt:
        """The same with something more in the detail of its message."""
        detail = "; ".join(filter(None, (self.outcome.detail, more)))
        return replace(self, outcome=replace(self.outcome, detail=detail))


def attempted(
    programs: Programs, starts: Starts, method: Method, form: str, options: Options
) -> Attempt:
    """Solve by a method, and by what takes over from it; say what conflicts where nothing helps."""
    nlp = programs.program(method.guided)
    points = [nlp.scaled(x) for x in starts.points]
    minimise = _with(method.minimise(form), starts.duals(nlp))
    compiled = programs.problem.kernels.backend == COMPILED
    second = METHODS[method.falls_back_on] if compiled and method.falls_back_on else None
    kept = options.iterations // 2 if second is not None else 0  # for what takes over
    found = _first_success(
        programs, nlp, points, replace(options, iterations=options.iterations - kept), minimise
    )
    if not compiled:
        return found
    if second is not None and found.outcome.status in (*NOWHERE, Status.ITERATION_LIMIT):
        left = options.after(found.outcome.iterations)
        found = _taken_over(programs, found, points, left, (method, second))
    ended = found.outcome.status
    lost = ended in UNDECIDED and found.outcome.left.violation > INFEASIBLE
    if ended is Status.INFEASIBLE or lost:
        left = options.after(0 if lost else found.outcome.iterations)
        found = _explained(programs, found, starts.points[0], left, minimise)
    return found


def _with(driver: Judged, duals: Duals | None) -> Minimise:
    """A driver with the multipliers of its first start, which serve the programs that have as many
    constraints: not one in which collisions have become touches."""

    def minimise(nlp: Transcription, x: Array, options: Options) -> Outcome:
        fits = duals is not None and (len(duals.y), len(duals.w)) == (nlp.n_eq, nlp.n_in)
        return driver(nlp, x, options, duals if fits else None)

    return minimise


def _first_success(
    programs: Programs,
    nlp: Transcription,
    points: Sequence[Array],
    options: Options,
    minimise: Minimise,
) -> Attempt:
    """Solve from one start after the other until one succeeds or a limit is reached; else return
    the least violation."""
    tried, count = list[Attempt](), 0
    for x in points:
        left = options.after(count)
        found = minimum(programs, nlp, x, left, minimise)
        count += found.outcome.iterations
        end = found.outcome
        if end.status is Status.STALLED and end.left.violation <= options.violation:
            # What holds the motion is known there: a fresh barrier often gets on from it.
            left = options.after(count)
            again = minimum(programs, found.nlp, end.x, left, minimise)
            count += again.outcome.iterations
            found = again if again.outcome.status is Status.SOLVED else found
        lost = found.outcome.status in (*NOWHERE, Status.STATIONARY)
        if not lost or count >= options.iterations:
            return found.counting(count)
        tried.append(found)
    return min(tried, key=lambda t: t.outcome.left.violation).counting(count)


def _taken_over(
    programs: Programs,
    before: Attempt,
    points: Sequence[Array],
    options: Options,
    methods: tuple[Method, Method],
) -> Attempt:
    """What a second method finds after a first; the end as it was where that finds nothing."""
    first, second = methods
    outcome, minimise = before.outcome, _with(second.minimise(), None)
    again = _first_success(programs, programs.program(second.guided), points, options, minimise)
    count = outcome.iterations + again.outcome.iterations
    if again.outcome.status in (Status.SOLVED, Status.TIME_LIMIT, Status.INTERRUPTED):
        said = f"{first.name} ended {outcome.status}, the compiled method took over"
        return again.saying(said).counting(count)
    return before.counting(count)


def _explained(
    programs: Programs, before: Attempt, x: Array, options: Options, minimise: Minimise
) -> Attempt:
    """Say what conflicts; if nothing does, the search for it has found a feasible motion to solve
    from, and an end without a minimum is none of an infeasible problem.  A method that came to no
    end is told so, unless the least violation is one."""
    nlp, outcome = before.nlp, before.outcome
    try:
        diagnosis = diagnose(nlp.problem, nlp.scale, x, options)
    except KeyboardInterrupt:
        return Attempt(nlp, replace(outcome, status=Status.INTERRUPTED))
    if diagnosis.violation <= INFEASIBLE and outcome.iterations < options.iterations:
        left = options.after(outcome.iterations)
        again = Attempt(nlp, minimise(nlp, nlp.scaled(diagnosis.x), left))
        if again.outcome.status is not Status.INFEASIBLE:
            found = ascertained(programs, again, left, minimise)
            return found.counting(outcome.iterations + found.outcome.iterations)
    if diagnosis.violation <= INFEASIBLE:
        stalled = Attempt(nlp, replace(outcome, status=Status.STALLED))
        said = "there is a motion that keeps all constraints, from which no minimum was reached"
        return before if outcome.status in UNDECIDED else stalled.saying(said)
    if outcome.status in UNDECIDED:
        if not diagnosis.least:
            return before
        outcome = replace(outcome, status=Status.INFEASIBLE)
    return Attempt(nlp, outcome, diagnosis.sentences)


def minimum(
    programs: Programs, nlp: Transcription, x: Array, options: Options, minimise: Minimise
) -> Attempt:
    """Solve from one start to a point that is a minimum to second order, too."""
    attempt = minimised(programs, nlp, x, options, minimise)
    return ascertained(programs, attempt, options, minimise)


def ascertained(
    programs: Programs,
    attempt: Attempt,
    options: Options,
    minimise: Minimise,
    saddles: int = MOST_SADDLES,
) -> Attempt:
    """A solution that is a minimum: where motions beside it cost less, the one that they lead to.

    If they lead to none, or from one saddle to the next for too long, it stays what it is, and is
    called stationary.
    """
    nlp, outcome = attempt.nlp, attempt.outcome
    if outcome.status is not Status.SOLVED and not (
        outcome.status is Status.STALLED and rounded(outcome.left)
    ):
        return attempt
    plain = programs.free(nlp)
    second = SecondOrder(plain, outcome.x, replace(outcome.duals, w=outcome.duals.w[: plain.n_in]))
    around = second.curvature()
    if around.shape is Landscape.VALLEY:
        return attempt.saying(along(plain, around.direction))
    beside = second.cheaper(around)
    if not beside:
        return attempt
    left = options.after(outcome.iterations)
    lower = _lower(programs, attempt, beside if saddles else [], left, minimise)
    lower = lower.counting(outcome.iterations + lower.outcome.iterations)
    if lower.outcome.status is not Status.SOLVED:
        return lower
    cost = attempt.cost() * nlp.scale.cost
    lower = lower.saying(f"motions beside a stationary one of cost {cost:.6g} led to it")
    return ascertained(programs, lower, options, minimise, saddles - 1)


def _lower(
    programs: Programs,
    saddle: Attempt,
    beside: Sequence[Array],
    options: Options,
    minimise: Minimise,
) -> Attempt:
    """The cheaper minimum of those that motions beside a saddle lead to: the compiled method gets
    there, the method itself has the last word where it keeps the minimum."""
    nlp, count = saddle.nlp, 0
    compiled = programs.problem.kernels.backend == COMPILED
    way = _with(METHODS["ipm"].minimise(), None) if compiled else minimise
    ends: list[Attempt] = []
    for z in beside:
        start = programs.free(nlp) if compiled else nlp
        ends.append(minimised(programs, start, z, options.after(count), way))
        count += ends[-1].outcome.iterations
        if ends[-1].outcome.status is Status.INTERRUPTED:
            return ends[-1].counting(count)
    minima = [end for end in ends if end.outcome.status is Status.SOLVED]
    best = min(minima, key=Attempt.cost, default=saddle)
    if best.cost() >= saddle.cost():
        stationary = replace(saddle, outcome=replace(saddle.outcome, status=Status.STATIONARY))
        named = " and ".join(dict.fromkeys(str(end.outcome.status) for end in ends))
        said = f"from there a solve ended {named}" if ends else f"the last of {MOST_SADDLES + 1}"
        return stationary.counting(count).saying(said)
    if not compiled:
        return best.counting(count)
    again = minimised(programs, nlp, best.outcome.x, options.after(count), minimise)
    count += again.outcome.iterations
    ended = again.outcome.status
    kept = ended is Status.SOLVED and again.cost() <= best.cost() + SAME * abs(best.cost())
    return (again if kept or ended is Status.INTERRUPTED else best).counting(count)


def minimised(
    programs: Programs, nlp: Transcription, x: Array, options: Options, minimise: Minimise
) -> Attempt:
    """Solve from one start; an estimated minimal time that limits the solution is dropped, because
    the dynamics decide and not the estimate, and collisions without effect become touches."""
    outcome = minimise(nlp, x, options)

    def continued(nlp: Transcription, before: Outcome) -> Outcome:
        """Solve another program of the same unknowns from where one has ended."""
        again = minimise(nlp, before.x, options.after(before.iterations))
        return replace(again, iterations=before.iterations + again.iterations)

    if _limited_by_times(nlp, outcome, options.violation):
        nlp = programs.free(nlp)
        outcome = continued(nlp, outcome)
    at = suspects(nlp, outcome.x)
    if not len(at) or outcome.status not in (Status.SOLVED, *NOWHERE):
        return Attempt(nlp, outcome)
    touching = programs.touches(nlp, at)
    touched = continued(touching, outcome)
    if touched.status in (Status.INTERRUPTED, Status.TIME_LIMIT):
        return Attempt(nlp, replace(outcome, status=touched.status))
    if touched.status is not Status.SOLVED:
        return Attempt(nlp, outcome).counting(touched.iterations)
    if not pays(touching, touched):
        return Attempt(touching, touched)
    again = continued(nlp, replace(touched, x=pushed(nlp, touched.x, at)))
    cheaper = outcome.status is not Status.SOLVED or nlp.cost(again.x) <= nlp.cost(outcome.x)
    if again.status is Status.SOLVED and cheaper:
        return Attempt(nlp, again)
    return Attempt(nlp, outcome).counting(again.iterations)


def _limited_by_times(nlp: Transcription, outcome: Outcome, violation: float) -> bool:
    """Whether an estimated minimal time holds a solution, or may be what has no solution."""
    timed = nlp.minimal_times
    if outcome.status is Status.SOLVED:
        return bool((outcome.duals.w[timed] > 0).any())
    short = nlp.inequality(outcome.x)[timed] < violation
    return outcome.status is Status.INFEASIBLE and bool(short.any())
