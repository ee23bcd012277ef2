"""Mesh refinement: more steps until the estimated and the simulated error of the solution meet a
tolerance."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from dmoc.nlp.problem import MOST_STEPS, Problem
from dmoc.solution import Mesh, Solution
from dmoc.solvers.judge import rounded
from dmoc.solvers.outcome import NOWHERE, Residuals, Status
from dmoc.solving.mesh_error import barrier, change, compared, estimate
from dmoc.solving.meshes import finer

# A quarter of the steps at once where the error is this far above the tolerance, else half of them.
FAR = 100.0
# Share of the tolerance that the barrier may take; beyond it a mesh is solved once more, sharper.
BARRIER = 0.25
# Meshes in a row without a smaller estimate that end the refinement.
IDLE_MESHES = 2
# Meshes that the simulation may contradict before finer ones are not tried.
CONTRADICTED = 2
# A motion that differs from that of the mesh before by so many times its error is another one.
OTHER = 10.0
# A mesh too coarse to be solved is refined so often before the problem counts as unsolved.
COARSE_FAILURES = 3

Solve = Callable[[Problem, Solution | None, float | None], Solution]
Check = Callable[[Solution], Solution]


@dataclass(frozen=True)
class History:
    """Meshes that were solved, each with its solution; how many were not, the answer of the first
    one that has no feasible motion; and what all tries have taken."""

    solved: tuple[Solution, ...] = ()
    meshes: tuple[Mesh, ...] = ()
    failures: int = 0
    infeasible: Solution | None = None
    iterations: int = 0
    seconds: Mapping[str, float] = field(default_factory=dict)

    @property
    def error(self) -> float:
        """The error of the last mesh: the estimate, or what the simulation has found."""
        if not self.meshes:
            return np.inf
        return max(self.meshes[-1].estimate, self.meshes[-1].simulated or 0.0)


def refined(
    problem: Problem, tolerance: float, seconds: float | None, solve: Solve, check: Check
) -> Solution:
    """Solve on finer and finer meshes, each from the motion of the one before.

    The error of a mesh is the largest relative change, against the mesh before, of the cost, of the
    durations and of the positions at common nodes, divided by r^p - 1 (Richardson; r is the ratio
    of the steps, p the order that the last three meshes show, at most that of the discretisation).
    Where limits hold inputs or the motion, a switch falls between two nodes and the changes are
    irregular: p is then 2 at most, and no estimate falls faster from mesh to mesh than by r^p.
    None is below what the solver's barrier has left of the cost.  The mesh is fine enough when this
    estimate and the errors over segments found by the independent simulation meet the tolerance.  A
    finer mesh that leads to a dearer minimum than one that the simulation confirms ends the
    refinement without it.

    Parameters
    ----------
    problem : Problem
        Its steps are the first mesh.
    tolerance : float
    seconds : float, optional
        Limit.
    solve, check : callables
        Solve a problem from the motion of the mesh before or from an automatic guess, to the usual
        optimality or to a given one; check a solution by simulation.
    """
    begin, past = time.perf_counter(), History()
    while True:
        s, past = _solved(problem, past, tolerance, solve)
        if s.status == Status.INTERRUPTED:
            return replace(_result(past), status=s.status, message=s.message) if past.solved else s
        if not s.minimum and past.solved:
            reason = (
                f"the mesh of {max(problem.phase_steps)} steps a phase ended {s.status} "
                f"({s.message})"
            )
            return _unmet(past, tolerance, check, reason)
        if not s.minimum:
            infeasible = s if s.status == Status.INFEASIBLE else None
            past = replace(
                past, failures=past.failures + 1, infeasible=past.infeasible or infeasible
            )
            if s.status == Status.TIME_LIMIT:
                return s
            if past.failures > COARSE_FAILURES:
                return past.infeasible or s
            problem = problem.meshed([2 * n for n in problem.phase_steps])
            continue
        if _dearer(past, s):
            before = check(past.solved[-1])
            if before.minimum:
                reason = (
                    f"the mesh of {max(problem.phase_steps)} steps a phase led to another minimum, "
                    f"which costs {s.cost:.6g}"
                )
                past = replace(past, solved=(*past.solved[:-1], before))
                return _unmet(past, tolerance, check, reason)
        past = _measured(past, s, problem, tolerance, check)
        simulated = past.meshes[-1].simulated
        if simulated is not None and simulated <= tolerance and past.solved[-1].minimum:
            return _result(past)
        factor = 4 if FAR * tolerance < past.error < np.inf else 2
        known = s.steps
        steps = finer([p.duration for p in s.phases], known, [factor * n for n in known])
        late = seconds is not None and time.perf_counter() - begin > seconds
        reason = _why_not_finer(past, max(steps), late)
        if reason:
            return _unmet(past, tolerance, check, reason)
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
    seconds = {name: past.seconds.get(name, 0.0) + spent for name, spent in s.seconds.items()}
    return replace(s, seconds=seconds), replace(past, iterations=iterations, seconds=seconds)


def _from_coarse(
    problem: Problem, past: History, solve: Solve, optimality: float | None = None
) -> Solution:
    """Solve from the motion of the last mesh, and where that leads nowhere from an automatic
    guess."""
    if not past.solved:
        return _rounded(solve(problem, None, optimality))
    s = _rounded(solve(problem, past.solved[-1], optimality))
    return _rounded(solve(problem, None, optimality)) if s.status in NOWHERE else s


def _dearer(past: History, s: Solution) -> bool:
    """Whether a mesh has led to another minimum than the one before, which costs more: the motion
    has changed by far more than its error."""
    if not past.solved:
        return False
    last = past.solved[-1]
    return s.cost > last.cost and change(last, s) > OTHER * past.error


def _rounded(s: Solution) -> Solution:
    sharp = s.status == Status.STALLED and rounded(Residuals(s.optimality, s.max_violation))
    return (
        replace(s, status=Status.SOLVED, message="a local minimum was found, to rounding errors")
        if sharp
        else s
    )


def _measured(
    past: History, s: Solution, problem: Problem, tolerance: float, check: Check
) -> History:
    """The history with a mesh that was solved; it is simulated where the estimate meets the
    tolerance."""
    solved, simulated = (*past.solved, s), None
    error = estimate(solved, past.meshes, problem.order)
    if error <= tolerance:
        s = check(s)
        solved, simulated = (*past.solved, s), _simulated(s)
    mesh = Mesh(s.steps, s.cost, past.iterations, error, simulated)
    return replace(past, solved=solved, meshes=(*past.meshes, mesh))


def _simulated(s: Solution) -> float:
    return s.verification.max_segment_defect if s.verification else np.inf


def _why_not_finer(past: History, steps: int, late: bool) -> str:
    """What speaks against a mesh of so many steps a phase."""
    contradicted = [s for s in past.solved if s.status is Status.NOT_VERIFIED]
    if len(contradicted) > CONTRADICTED and contradicted[-1].verification:
        message = contradicted[-1].verification.message.removesuffix(", take more steps")
        return f"the simulation contradicts finer and finer meshes ({message})"
    before = past.meshes[-1 - IDLE_MESHES : -1]
    if len(past.meshes) > IDLE_MESHES and past.meshes[-1].estimate >= max(
        m.estimate for m in before
    ):
        return (
            "finer meshes do not make it smaller, rounding errors or the solver's tolerance "
            "outweigh it"
        )
    if steps > MOST_STEPS:
        return f"finer meshes than {MOST_STEPS} steps a phase are not tried"
    return "the time limit is reached" if late else ""


def _result(past: History) -> Solution:
    """The solution on the finest mesh, with all meshes."""
    meshes = compared(past.meshes, past.solved)
    return replace(
        past.solved[-1], meshes=meshes, error_estimate=past.error, iterations=past.iterations
    )


def _unmet(past: History, tolerance: float, check: Check, reason: str) -> Solution:
    """The solution on the finest mesh, which does not meet the tolerance, and why."""
    s = _result(past)
    s = s if s.verification else check(s)
    unmet = f"the estimated error {past.error:.2g} exceeds the tolerance {tolerance:g}"
    if len(past.meshes) == 1:
        unmet = "one mesh was solved, which gives no estimate of its error"
    if s.verification and not s.verification.passed:
        found = s.verification.message
        contradicted = f"an independent simulation contradicts the finest mesh ({found})"
        met = past.error <= tolerance
        unmet = contradicted if met else f"{unmet}, and {contradicted}"
    return replace(s, status=Status.NOT_VERIFIED, message=f"{unmet}: {reason}")
