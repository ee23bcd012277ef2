"""Mesh refinement: more steps until the estimated and the simulated error of the solution meet a
tolerance."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field, replace

import numpy as np

from dmoc.base.deadline import Deadline
from dmoc.base.records import record
from dmoc.problem.problem import Problem
from dmoc.problem.ranges import MOST_STEPS
from dmoc.program.layout import Layout
from dmoc.results.notes import Note, Topic
from dmoc.results.solution import Mesh, Solution, broken_off, ending, saying
from dmoc.solvers.judge import rounded
from dmoc.solvers.outcome import NOWHERE, Residuals, Status
from dmoc.solving.indeterminacy import telling, undetermined
from dmoc.solving.mesh.error import UNKNOWN, Errors, barrier, changes, compared, estimates
from dmoc.solving.mesh_steps import finer

# A quarter of the steps at once where the error is this far above the tolerance, else half of them.
FAR = 100.0
# Share of the tolerance that the barrier may take; beyond it a mesh is solved once more, sharper.
BARRIER = 0.25
# Meshes in a row without a smaller error that end the refinement.
IDLE_MESHES = 2
# Meshes that the simulation may contradict before finer ones are not tried.
CONTRADICTED = 2
# A cost that exceeds that of the mesh before by so many times its error is that of another minimum.
OTHER = 10.0
# A mesh too coarse to be solved is refined so often before the problem counts as unsolved.
COARSE_FAILURES = 3
# Unknowns of the finest mesh: an iteration takes about a fifth of a second there, and a refinement
# some minutes at most.
MOST_UNKNOWNS = 100_000

# From the motion of the mesh before or an automatic guess, to the usual optimality or a given one.
Solve = Callable[[Problem, Solution | None, float | None], Solution]
Check = Callable[[Solution], Solution]


@record(frozen=True, eq=False)
class Level:
    """A mesh that was solved: the solution, its estimated errors, and the iterations up to it."""

    solution: Solution
    errors: Errors
    iterations: int

    @property
    def simulated(self) -> float | None:
        """The error that the simulation has seen; infinite where it could not follow."""
        s = self.solution
        if s.verification:
            return max(s.verification.max_segment_defect, s.verification.cost_error)
        return None if s.minimum else np.inf

    @property
    def path_excess(self) -> float:
        """Largest excess of path constraints, between the nodes too, where that is known; else
        zero."""
        v = self.solution.verification
        return np.nan_to_num(v.path_excess) if v else 0.0

    def checked(self, check: Check) -> Level:
        """The same level with the result of the simulation."""
        return self if self.simulated is not None else replace(self, solution=check(self.solution))


@record(frozen=True, eq=False)
class History:
    """Meshes that were solved; how many were not, the answer of the first one that has no feasible
    motion; what all tries have taken; and what the problem leaves open, in a sentence."""

    levels: tuple[Level, ...] = ()
    failures: int = 0
    infeasible: Solution | None = None
    iterations: int = 0
    seconds: Mapping[str, float] = field(default_factory=dict)
    leaves_open: Note | None = None

    @property
    def last(self) -> Level:
        return self.levels[-1]

    @property
    def solved(self) -> tuple[Solution, ...]:
        return tuple(level.solution for level in self.levels)

    def ending_with(self, level: Level) -> History:
        return replace(self, levels=(*self.levels[:-1], level))

    def estimate(self, level: Level) -> float:
        """The estimated error of what the problem determines: of the cost always."""
        return level.errors.cost if self.leaves_open else level.errors.largest

    def error(self, level: Level) -> float:
        """The estimate, or what the check has seen."""
        return max(self.estimate(level), self.seen(level))

    def seen(self, level: Level) -> float:
        """The error that the check has seen, of the motion or beyond a path constraint."""
        return max(level.simulated or 0.0, level.path_excess)

    def is_idle(self, tolerance: float) -> bool:
        """Whether finer meshes have not made smaller what exceeds a tolerance: estimates are those
        of all meshes, the check has seen some."""
        checked = [level for level in self.levels if level.simulated is not None]
        estimates, seen = map(self.estimate, self.levels), map(self.seen, checked)
        return any(e[-1:] > [tolerance] and _idle(e) for e in map(list, (estimates, seen)))

    def meets(self, tolerance: float) -> bool:
        """Whether the last mesh is confirmed and its error meets a tolerance."""
        met = self.error(self.last) <= tolerance
        return met and self.last.simulated is not None and self.last.solution.minimum


def refined(
    problem: Problem, tolerance: float, deadline: Deadline, solve: Solve, check: Check
) -> Solution:
    """Solve on finer and finer meshes, each from the motion of the one before.

    The error of a mesh is the largest relative change, against the mesh before, of the cost, of the
    durations and of the positions at common nodes, each divided by r^p - 1 (Richardson; r is the
    ratio of the steps, p the order that the last three meshes show, at most that of the
    discretisation).  Where limits hold inputs or the motion, a switch falls between two nodes and
    the changes are irregular: p is then 2 at most, and no estimate falls faster from mesh to mesh
    than by r^p.  None is below what the solver's barrier has left of the cost.  Durations and
    positions that the problem leaves open do not count.  The mesh is fine enough when this estimate
    and the errors over segments found by the independent simulation meet the tolerance.

    Where a finer mesh is not solved, leads to a dearer minimum, or makes nothing better, the finest
    mesh that the simulation confirms is the answer, and its message says what the finer one did.
    Its error is then at most its difference to the finest mesh and the error of that.
    """
    past = History()
    while True:
        s, past = _solved(problem, past, tolerance, solve)
        if s.status == Status.INTERRUPTED:
            return broken_off(_result(past)) if past.levels else s
        mesh = f"the mesh of {max(problem.phase_steps)} steps a phase"
        if not s.minimum and past.levels:
            reason = f"{mesh} ended {s.status} ({s.message})"
            return _best(_with_coarser(past, problem, solve), problem, tolerance, check, reason)
        if not s.minimum:
            past = _failed(past, s)
            if s.status == Status.TIME_LIMIT:
                return s
            if past.failures > COARSE_FAILURES:
                return past.infeasible or s
            problem = problem.meshed([2 * n for n in problem.phase_steps])
            continue
        if _dearer(past, s, tolerance):
            past = past.ending_with(past.last.checked(check))
            if past.last.solution.minimum:
                reason = f"{mesh} led to another minimum, which costs {s.cost:.6g}"
                return _best(past, problem, tolerance, check, reason)
        past = _measured(past, s, problem, tolerance, check, timed=deadline.ends)
        if past.meets(tolerance):
            return _result(past)
        reason, steps = _next(past, tolerance, problem)
        if not reason and deadline.passed:
            reason = "the time limit is reached"
        if reason:
            return _best(past, problem, tolerance, check, reason)
        problem = problem.meshed(steps)


def _solved(
    problem: Problem, past: History, tolerance: float, solve: Solve
) -> tuple[Solution, History]:
    """Solve on the next mesh, once more where the barrier takes too much of the tolerance; count
    what that takes."""
    s = _from_coarse(problem, past, solve)
    iterations = past.iterations + s.iterations
    if s.minimum and barrier(s) > BARRIER * tolerance:
        sharper = _from_coarse(
            problem, past, solve, BARRIER * tolerance / barrier(s) / 2 * s.optimality
        )
        iterations += sharper.iterations
        s = sharper if sharper.solved or sharper.status == Status.INTERRUPTED else s
    seconds = {**past.seconds, **s.seconds}  # kernels are built once
    for name in past.seconds.keys() & s.seconds.keys() - {"build"}:
        seconds[name] += past.seconds[name]
    return replace(s, seconds=seconds), replace(past, iterations=iterations, seconds=seconds)


def _from_coarse(
    problem: Problem, past: History, solve: Solve, optimality: float | None = None
) -> Solution:
    """Solve from the motion of the last mesh, and where that leads nowhere from an automatic guess
    as long as meshes are coarse: a fine one that a neighbour does not lead to has no other start
    that were worth its time."""
    if not past.levels:
        return _rounded(solve(problem, None, optimality))
    s = _rounded(solve(problem, past.last.solution, optimality))
    if s.status in NOWHERE and len(past.levels) <= IDLE_MESHES:
        return _rounded(solve(problem, None, optimality))
    return s


def _rounded(s: Solution) -> Solution:
    sharp = s.status == Status.STALLED and rounded(Residuals(s.optimality, s.max_violation))
    return ending(s, Status.SOLVED, "a local minimum was found, to rounding errors") if sharp else s


def _failed(past: History, s: Solution) -> History:
    infeasible = s if s.status == Status.INFEASIBLE else None
    return replace(past, failures=past.failures + 1, infeasible=past.infeasible or infeasible)


def _dearer(past: History, s: Solution, tolerance: float) -> bool:
    """Whether a mesh has led to another minimum than the one before, which costs more: by far more
    than the error of the cost, and than anyone has asked for."""
    if not past.levels:
        return False
    last, error = past.last.solution, past.last.errors.cost
    return s.cost > last.cost and changes(last, s).cost > max(OTHER * error, tolerance)


def _measured(
    past: History, s: Solution, problem: Problem, tolerance: float, check: Check, *, timed: bool
) -> History:
    """The history with a mesh that was solved.

    It is simulated where its cost meets the tolerance, and where the motion then does not it is
    seen whether the problem determines it at all.  With a time limit every mesh is simulated, so
    that one is confirmed when the time is up.
    """
    before = past.last.errors if past.levels else UNKNOWN
    level = Level(s, estimates((*past.solved, s), before, problem.order), past.iterations)
    resolved = level.errors.cost <= tolerance
    if resolved or timed:
        level = level.checked(check)
    past = replace(past, levels=(*past.levels, level))
    confirmed = level.solution.minimum and level.simulated is not None
    if resolved and confirmed and level.errors.motion > tolerance >= (level.simulated or 0.0):
        past = replace(past, leaves_open=past.leaves_open or _left_open(past, problem))
    return past


def _left_open(past: History, problem: Problem) -> Note | None:
    """A note on what the problem leaves open of a motion whose cost is resolved. Where nothing is
    seen to be open, it is about durations and positions that finer and finer meshes do not
    resolve."""
    fine, coarse = past.last.solution, past.levels[-2].solution
    note = undetermined(problem, fine, coarse)
    if note or not _idle([level.errors.motion for level in past.levels]):
        return note
    return Note(
        Topic.DRIFT,
        "the problem hardly determines durations and positions, which change by "
        f"{changes(coarse, fine).motion:.1g} at the same cost on finer and finer meshes",
    )


def _idle(errors: list[float]) -> bool:
    """Whether the last ones have not become smaller."""
    return len(errors) > IDLE_MESHES and errors[-1] >= max(errors[-1 - IDLE_MESHES : -1])


def _next(past: History, tolerance: float, problem: Problem) -> tuple[str, list[int]]:
    """The reason against a finer mesh, empty for none, and the steps of that mesh."""
    resolved = [level.solution for level in past.levels if level.errors.cost <= tolerance]
    contradicted = [s.verification for s in resolved if s.status is Status.NOT_VERIFIED]
    if len(contradicted) > CONTRADICTED and contradicted[-1]:
        wrong = contradicted[-1].message
        return f"the simulation contradicts finer and finer meshes ({wrong})", []
    if past.is_idle(tolerance):
        reason = "finer meshes do not make it smaller, rounding errors or the solver's tolerance "
        return f"{reason}outweigh it", []
    far = FAR * tolerance < past.error(past.last) < np.inf
    s, factor = past.last.solution, 4 if far else 2
    steps = finer([p.duration for p in s.phases], s.steps, [factor * n for n in s.steps])
    if max(steps) > MOST_STEPS:
        return f"finer meshes than {MOST_STEPS} steps a phase are not tried", []
    unknowns = Layout.of(problem).size * sum(steps) // sum(s.steps)
    if unknowns > MOST_UNKNOWNS:
        return f"finer meshes than {MOST_UNKNOWNS} unknowns are not tried", []
    return "", steps


def _with_coarser(past: History, problem: Problem, solve: Solve) -> History:
    """The history with a coarser mesh before it, which gives an estimate of the error, where one
    mesh alone was solved."""
    steps = past.last.solution.steps
    if len(past.levels) > 1 or any(n % 2 or n < 4 for n in steps):
        return past
    coarse = problem.meshed([n // 2 for n in steps])
    s = _rounded(solve(coarse, past.last.solution, None))
    if not s.minimum:
        return past
    errors = estimates((s, past.last.solution), UNKNOWN, problem.order)
    levels = (Level(s, UNKNOWN, past.iterations), replace(past.last, errors=errors))
    return replace(past, levels=levels, iterations=past.iterations + s.iterations)


def _result(past: History) -> Solution:
    """The solution on the finest mesh, with all meshes."""
    meshes = tuple(
        Mesh(
            level.solution.steps,
            level.solution.cost,
            level.iterations,
            past.estimate(level),
            level.simulated,
        )
        for level in past.levels
    )
    return replace(
        telling(past.last.solution, past.leaves_open),
        meshes=compared(meshes, past.solved, not past.leaves_open),
        error_estimate=past.error(past.last),
        iterations=past.iterations,
    )


def _best(past: History, problem: Problem, tolerance: float, check: Check, reason: str) -> Solution:
    """The solution on the finest mesh that the simulation confirms, and why there is no finer one;
    it is not verified where it does not meet the tolerance."""
    finest, past = past.last, _seen_open(past, problem, tolerance)
    past = _confirmed(past, check) or past.ending_with(past.last.checked(check))
    if past.last.solution.steps != finest.solution.steps:
        past = past.ending_with(_beside(past.last, finest))
    s = _result(past)
    if past.meets(tolerance):
        return saying(s, reason)
    if s.status is Status.TIME_LIMIT:
        return s
    unmet = f"the estimated error {past.error(past.last):.2g} exceeds the tolerance {tolerance:g}"
    if past.error(past.last) == np.inf and len(past.levels) == 1:
        unmet = "one mesh was solved, which gives no estimate of its error"
    if s.verification and not s.verification.passed:
        contradicted = (
            f"an independent simulation contradicts the finest mesh ({s.verification.told})"
        )
        met = past.error(past.last) <= tolerance
        unmet = contradicted if met else f"{unmet}, and {contradicted}"
    return ending(s, Status.NOT_VERIFIED, f"{unmet}: {reason}")


def _seen_open(past: History, problem: Problem, tolerance: float) -> History:
    """The history with what the problem leaves open, where durations and positions change by more
    than the cost on finer and finer meshes, whether the simulation confirms the finest or not."""
    errors = past.last.errors
    if past.leaves_open or len(past.levels) < 2:
        return past
    if not max(tolerance, errors.cost) < errors.motion < np.inf:
        return past
    fine, coarse = past.last.solution, past.levels[-2].solution
    meshed = problem.meshed(list(fine.steps))
    resolved = errors.cost <= tolerance
    note = _left_open(past, meshed) if resolved else undetermined(meshed, fine, coarse)
    return replace(past, leaves_open=note)


def _beside(level: Level, finest: Level) -> Level:
    """A mesh that is confirmed beside the finest one, which is not: it is off by what it differs
    from that, and that is off, whatever the meshes up to it could tell."""
    seen, left, own = changes(level.solution, finest.solution), finest.errors, level.errors
    cost, motion = seen.cost + left.cost, seen.motion + left.motion
    return replace(level, errors=Errors(min(own.cost, cost), min(own.motion, motion)))


def _confirmed(past: History, check: Check) -> History | None:
    """The history up to the finest mesh that the simulation confirms."""
    levels = past.levels
    while levels:
        last = levels[-1].checked(check)
        if last.solution.minimum:
            return replace(past, levels=(*levels[:-1], last))
        levels = levels[:-1]
    return None
