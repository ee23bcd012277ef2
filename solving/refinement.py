"""Mesh refinement: more steps until the estimated and the simulated error of the solution meet a tolerance."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from dmoc.nlp.active import ALONG_THE_WAY
from dmoc.nlp.problem import MOST_STEPS, Problem
from dmoc.solution import Mesh, Solution
from dmoc.solvers.judge import rounded
from dmoc.solvers.outcome import NOWHERE, Residuals, Status

# The error of a mesh falls by this factor at least when the steps are halved, also where inputs switch between steps.
SLOWEST_ORDER = 1.0
# The order that counts on where limits hold inputs or the motion.
LIMITED_ORDER = 2
# A quarter of the steps at once where the error is this far above the tolerance, else half of them.
FAR = 100.0
# Share of the tolerance that the barrier may take; beyond it a mesh is solved once more, sharper.
BARRIER = 0.25
# Meshes in a row without a smaller estimate that end the refinement.
IDLE_MESHES = 2
# A mesh too coarse to be solved is refined so often before the problem counts as unsolved.
COARSE_FAILURES = 3

Solve = Callable[[Problem, Solution | None, float | None], Solution]
Check = Callable[[Solution], Solution]


def refined(problem: Problem, tolerance: float, seconds: float | None, solve: Solve, check: Check) -> Solution:
    """Solve on finer and finer meshes, each from the motion of the one before.

    The error of a mesh is the largest relative change, against the mesh before, of the cost, of the durations and of the positions at common nodes,
    divided by r^p - 1 (Richardson; r is the ratio of the steps, p the order that the last three meshes show, at most that of the
    discretisation).  Where limits hold inputs or the motion, a switch falls between two nodes and the changes are irregular: p is then 2 at
    most, and no estimate falls faster from mesh to mesh than by r^p.  None is below what the solver's barrier has left of the cost.  The mesh is
    fine enough when this estimate and the errors over segments found by the independent simulation meet the tolerance.

    Parameters
    ----------
    problem : Problem
        Its steps are the first mesh.
    tolerance : float
    seconds : float, optional
        Limit.
    solve, check : callables
        Solve a problem from the motion of the mesh before or from an automatic guess, to the usual optimality or to a given one; check a solution
        by simulation.
    """
    begin, meshes, failures = time.perf_counter(), list[Mesh](), 0
    solved: list[Solution] = []
    iterations, spent = 0, dict[str, float]()

    def result(s: Solution, error: float, reason: str = "") -> Solution:
        s = replace(s, meshes=_compared(meshes, solved), error_estimate=error, iterations=iterations)
        if not reason:
            return s
        message = f"the estimated error {error:.2g} exceeds the tolerance {tolerance:g}: {reason}"
        return replace(s if s.verification else check(s), status=Status.NOT_VERIFIED, message=message)

    error = np.inf
    while True:
        s = _from_coarse(problem, solved, solve)
        iterations += s.iterations
        if s.minimum and _barrier(s) > BARRIER * tolerance:
            sharper = _from_coarse(problem, solved, solve, BARRIER * tolerance / _barrier(s) / 2 * s.optimality)
            iterations += sharper.iterations
            s = sharper if sharper.solved or sharper.status == Status.INTERRUPTED else s
        spent = {k: spent.get(k, 0.0) + v for k, v in s.seconds.items()}
        s = replace(s, seconds=spent)
        if s.status == Status.INTERRUPTED:
            return replace(result(solved[-1], error), status=s.status, message=s.message) if solved else s
        if not s.minimum:
            if solved:
                return result(
                    solved[-1], error, f"the mesh of {max(problem.phase_steps)} steps a phase ended {s.status} ({s.message})"
                )
            failures += 1
            if failures > COARSE_FAILURES or s.status == Status.TIME_LIMIT:
                return s
            problem = problem.but(steps=[2 * n for n in problem.phase_steps])
            continue
        solved.append(s)
        estimate = _estimate(solved, meshes, problem.order)
        simulated = None
        if estimate <= tolerance:
            solved[-1] = s = check(s)
            simulated = _simulated(s)
        meshes.append(Mesh(problem.phase_steps, s.cost, iterations, estimate, simulated))
        error = max(estimate, simulated or 0.0)
        if simulated is not None and (simulated <= tolerance or not s.minimum):
            return result(s, error)
        steps = [(4 if FAR * tolerance < error < np.inf else 2) * n for n in problem.phase_steps]
        if len(meshes) > IDLE_MESHES and estimate >= max(m.estimate for m in meshes[-1 - IDLE_MESHES : -1]):
            return result(s, error, "finer meshes do not make it smaller, rounding errors or the solver's tolerance outweigh it")
        if max(steps) > MOST_STEPS:
            return result(s, error, f"finer meshes than {MOST_STEPS} steps a phase are not tried")
        if seconds is not None and time.perf_counter() - begin > seconds:
            return result(s, error, "the time limit is reached")
        problem = problem.but(steps=steps)


def _from_coarse(problem: Problem, solved: list[Solution], solve: Solve, optimality: float | None = None) -> Solution:
    """Solve from the motion of the last mesh, and where that leads nowhere from an automatic guess."""
    if not solved:
        return _rounded(solve(problem, None, optimality))
    s = _rounded(solve(problem, solved[-1], optimality))
    return _rounded(solve(problem, None, optimality)) if s.status in NOWHERE else s


def _rounded(s: Solution) -> Solution:
    sharp = s.status == Status.STALLED and rounded(Residuals(s.optimality, s.max_violation))
    return replace(s, status=Status.SOLVED, message="a local minimum was found, to rounding errors") if sharp else s


def _estimate(solved: list[Solution], meshes: list[Mesh], order: int) -> float:
    """Estimated error of the last solution; infinite for the first.  Two meshes show no order: half of the discretisation's is assumed."""
    if len(solved) < 2:
        return np.inf
    ratio = _ratio(solved[-2], solved[-1])
    change = _change(solved[-2], solved[-1])
    limited = _limited(solved[-1])
    order = min(order, LIMITED_ORDER) if limited else order
    shown = order / 2
    if len(solved) > 2:
        before = _change(solved[-3], solved[-2])
        shown = _order(before / max(change, 1e-300), _ratio(solved[-3], solved[-2]), ratio, order)
    fastest = meshes[-1].estimate / ratio**order if limited and np.isfinite(meshes[-1].estimate) else 0.0
    return float(max(change / (ratio**shown - 1), fastest, _barrier(solved[-1])))


def _barrier(s: Solution) -> float:
    """What the solver's barrier has left of the cost, relative to it."""
    return s.duality_gap / max(abs(s.cost), _little(s))


def _little(s: Solution) -> float:
    """A cost that is next to none."""
    return 1e-10 * s.scale.get("cost", 1.0)


def _limited(s: Solution) -> bool:
    """Whether limits hold inputs or the motion along the way, and not only the times."""
    return any(b.kind in ALONG_THE_WAY for b in s.active_bounds)


def _order(quotient: float, first: float, second: float, order: int) -> float:
    """The order p that two successive changes with a quotient show, (first^p - 1) second^p / (second^p - 1), by bisection."""
    low, high = SLOWEST_ORDER, float(order)

    def predicted(p: float) -> float:
        return float((first**p - 1) * second**p / (second**p - 1))

    if quotient >= predicted(high):
        return high
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (middle, high) if predicted(middle) < quotient else (low, middle)
    return low


def _ratio(coarse: Solution, fine: Solution) -> float:
    return fine.phases[0].steps / coarse.phases[0].steps


def _change(coarse: Solution, fine: Solution) -> float:
    """Largest relative difference of cost, durations and positions at common nodes."""
    step = round(_ratio(coarse, fine))
    cost = abs(fine.cost - coarse.cost) / max(abs(fine.cost), _little(fine))
    pairs = list(zip(coarse.phases, fine.phases, strict=True))
    duration = max(abs(b.duration - a.duration) for a, b in pairs) / fine.final_time
    spread = np.ptp(np.vstack([p.q for p in fine.phases]), axis=0)
    scale = np.maximum(spread, 1e-6 * np.array([fine.scale.get(name, 1.0) for name in fine.trajectory.coordinates]))
    place = max(float((np.abs(b.q[::step] - a.q) / scale).max(initial=0.0)) for a, b in pairs)
    return float(max(cost, duration, place))


def _simulated(s: Solution) -> float:
    return float(s.verification["max_segment_defect"]) if s.verification else np.inf


def _compared(meshes: list[Mesh], solved: list[Solution]) -> tuple[Mesh, ...]:
    """The meshes, each with its difference to the finest, which tells whether the estimates are honest."""
    pairs = zip(meshes, solved, strict=True)
    return tuple(replace(m, difference=_change(s, solved[-1]) if s is not solved[-1] else None) for m, s in pairs)
