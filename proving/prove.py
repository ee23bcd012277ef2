"""dmoc.prove: the best of all motions of a sequence, or that there is none."""

from __future__ import annotations

import os
import time
from collections.abc import Callable

import numpy as np

from dmoc.base.arguments import path, positive, whole
from dmoc.base.deadline import Deadline
from dmoc.base.errors import ProblemError
from dmoc.base.progress import Listener, listener
from dmoc.base.records import record
from dmoc.base.signatures import public
from dmoc.problem.problem import Problem
from dmoc.program.laws.impact import states_energies
from dmoc.proving.branch import MOST_WORKERS, Branch
from dmoc.proving.engine import branch_of, check_size, run
from dmoc.proving.global_proof import Claim, Proof
from dmoc.proving.linear import LinearProblem
from dmoc.proving.linear_problem import linear_problem
from dmoc.proving.paving import most_kept, paving_of
from dmoc.proving.proof_journal import continued, digest, written
from dmoc.results.solution import Solution
from dmoc.solving.request import check_problem
from dmoc.solving.solve import solve

# Seconds that the solve of the best motion has of those of the proof.
SHARE = 0.3
# Boxes between two looks at the clock.
SLICE = 64
# The gap of a bound that has a limit instead of a best motion, and boxes that are spent on the
# question whether there is a motion at all.
BOUNDED, MORE = 1e-6, 64
# Steps of a phase where neither the problem nor a motion has them, and at most.
STEPS, MOST_STEPS = 10, 30
# The gap is never less than this share of the cost that the problem would have by its sizes: a cost
# may be zero.
LEAST_GAP = 1e-9
# Motions that cost more than this, in the same size, count as none where nothing bounds the cost.
DEAR = 1e4
# A bound at the durations of a motion may be above its cost by rounding alone.
ABOVE = 1e-7
# A motion that is feasible up to the tolerance of a solve may cost less than a bound by this share.
CONTRADICTION = 1e-5


@record(frozen=True, eq=False)
class Bounding:
    """State of a proof: least cost that was met, bound of all, boxes that were looked at and that
    wait."""

    cost: float
    bound: float
    boxes: int
    waiting: int

    def __str__(self) -> str:
        return f"cost {self.cost:.6g}, at least {self.bound:.6g}, {self.waiting} boxes wait"


@public(ProblemError)
def prove(
    problem: Problem,
    gap: float = 1e-4,
    seconds: float | None = 60.0,
    *,
    seed: int = 0,
    workers: int = 1,
    journal: str | os.PathLike[str] | None = None,
    progress: Listener[Bounding] = None,
) -> Proof:
    """Prove that a motion is the best of all of its sequence, or that there is none.

    For durations that are given, the discrete program of a model that moves linearly between its
    events is a convex quadratic one, and its dual at any multipliers is a bound.  Branch and bound
    over the durations covers all of them, equation :eq:`dual-bound` of the theory; the bounds are
    computed in intervals with outward rounding.

    Parameters
    ----------
    problem : Problem
        Of a model with a constant mass matrix and forces that are affine in positions, velocities
        and inputs; surfaces of its sequence are flat, and stand or are moved by any function of the
        time without turning, also while they are touched; its cost is convex and quadratic in
        inputs, positions and velocities.  Its final time has an upper bound, and ranges of its
        start have both ends.
    gap : float
        How far the bound may stay below the cost of the motion, relative to it.
    seconds : float, optional
        Limit of all, the solve included; None for none.  Ctrl-C ends the bounding as this does.
    seed : int
        Of the random starts of the solve.
    workers : int
        Threads that bound boxes.  Bounds, boxes and journal are the same for any number of them,
        unless time runs out.
    journal : path, optional
        A file in which what is left to do is kept; a proof that finds one of the same problem goes
        on there.
    progress : callable, bool or "lines", optional
        Called with a Bounding (cost, bound, boxes, waiting) now and then.

    Returns
    -------
    Proof
        Its ``claim``: ``OPTIMAL`` within the gap, ``IMPOSSIBLE``, or ``OPEN`` where time ran out.

    Raises
    ------
    ProblemError
        If an argument does not fit, or the problem is not covered; the sentence names what is not
        linear.

    Notes
    -----
    The statement is one of the discrete program, with the law of impact in the rates of the gaps.
    Conditions that no bound takes into account are ``left_out``: a bound without them is one with
    them, but it may be far from the best cost.

    Examples
    --------
    >>> import dmoc
    >>> from dmoc.models.registry import find
    >>> reference = find("puck_table")
    >>> problem = dmoc.Problem(reference.kernels(), **reference.defaults)
    >>> proof = dmoc.prove(problem.but(sequence=["east"], steps=10))
    >>> proof.claim, round(proof.solution.cost, 3)
    (<Claim.OPTIMAL: 'optimal (proved)'>, 2.819)
    """
    check_problem(problem)
    gap = positive(gap, "gap", "expected a positive number such as 1e-4, relative to the cost")
    if seconds is not None:
        seconds = positive(seconds, "seconds", "expected a positive number, or None for no limit")
    workers = whole(workers, "workers", 1, MOST_WORKERS)
    if journal is not None:
        path(journal, "journal")
    with listener(progress, "solving and bounding ...") as tell:
        return _proved(problem, gap, seconds, seed, workers, journal, tell)


def _proved(
    problem: Problem, gap: float, seconds: float | None, seed: int, workers: int,
    journal: str | os.PathLike[str] | None, tell: Callable[[Bounding], object] | None,
) -> Proof:  # fmt: skip
    """The proof of a problem, from arguments that fit."""
    begun, deadline = time.monotonic(), Deadline.after(seconds)
    check_size(linear_problem(_on_mesh(problem, None)))  # what is not covered is refused at once
    motion = _solved(problem, seconds, seed)
    stated = _on_mesh(problem, motion)
    problem = stated.in_rates()
    linear = linear_problem(problem)
    motion = None if motion is None else _along(problem, motion)
    size = _size_of_cost(linear)
    limit = _largest_cost(linear)
    beyond = limit if np.isfinite(limit) else DEAR * size
    best = np.inf if motion is None else motion.cost
    beyond += ABOVE * (beyond + size)  # what is nearly as dear as can be is a motion still
    least, kept = LEAST_GAP * size, most_kept(linear)
    most = beyond if motion is None else max(beyond, motion.cost)
    known = digest(linear, beyond, gap)
    # What follows in sum tells quickly that there is no motion, and no more where there is one.
    linear = linear if motion is None else linear.without_sums
    branch = branch_of(linear)(linear, best, most, gap / 2, least, size, kept, workers)
    continued(journal, branch, known)
    going_on = True
    try:
        while going_on and not deadline.passed:
            branch, going_on = run(branch, SLICE)
            if tell:
                tell(Bounding(branch.best, branch.bound, branch.boxes, branch.waiting))
    except KeyboardInterrupt:
        going_on = True  # what was bounded until then is the answer
    written(journal, branch, known)
    if motion is None or branch.best < motion.cost - gap / 4 * abs(motion.cost):
        motion = _best(motion, _at(problem, branch, seed))
    return Proof(
        _claim(branch, motion, (gap, least, beyond), going_on), motion, branch.bound, gap, least,
        np.inf if np.isfinite(limit) else beyond,
        tuple((float(a), float(b)) for a, b in linear.durations),
        linear.final_time, tuple(phase.steps for phase in linear.phases), problem.order,
        states_energies(stated), linear.left_out, branch.boxes, branch.waiting,
        time.monotonic() - begun, paving_of(branch, linear, beyond),
    )  # fmt: skip


def lower_bound(
    problem: Problem, limit: float, until: Deadline, growing: bool = False, workers: int = 1
) -> tuple[float, float, bool]:
    """A number that no motion of a problem with steps costs less than, as far as it takes to see
    that none costs less than a limit; and what a motion costs at most, beyond which a bound shows
    that there is none, infinite where nothing bounds it; and whether either was seen.  ``growing``
    asks for a cost that no part of a motion lowers.  ``workers`` are threads."""
    problem = problem.in_rates()
    linear = linear_problem(problem)
    check_size(linear)
    lowered = (
        linear.soft.any()
        or len(linear.goal_cost.b)
        or any(phase.c.any() or phase.c_0 < 0 or phase.cost >= 0 for phase in linear.phases)
    )
    if growing and lowered:
        return -np.inf, np.inf, False
    size, most = _size_of_cost(linear), _largest_cost(linear)
    most += ABOVE * (most + size)  # what is nearly as dear as can be is a motion still
    limit -= LEAST_GAP * size
    asked = min(limit, DEAR * size if np.isinf(most) else most)
    cheap = linear.without_sums
    branch = branch_of(cheap)(cheap, np.inf, asked, BOUNDED, LEAST_GAP * size, size, 0, workers)
    going_on = True
    while going_on and not until.passed and branch.best >= limit:  # none is known that costs less
        branch, going_on = run(branch, SLICE)
    if limit < most < np.inf and branch.bound >= limit and np.isinf(branch.best):
        # It costs too much: is there any?
        beyond = branch_of(linear)(
            linear, np.inf, most, BOUNDED, LEAST_GAP * size, size, 0, workers
        )
        going_on = not until.passed
        if going_on:
            beyond, going_on = run(beyond, MORE)
        if not going_on and np.isinf(beyond.best):
            return max(branch.bound, beyond.bound), most, True
    return branch.bound, most, branch.bound >= min(limit, most)


def _solved(problem: Problem, seconds: float | None, seed: int) -> Solution | None:
    """A motion of the problem, if a solve finds one."""
    limit = None if seconds is None else SHARE * seconds
    solution = solve(problem, seed=seed, seconds=limit)
    return solution if solution.converged else None


def _on_mesh(problem: Problem, motion: Solution | None) -> Problem:
    """The problem with numbers of steps: its own, those of a motion, or the usual ones."""
    if problem.steps is not None:
        return problem
    steps = (STEPS,) if motion is None else motion.steps
    last = problem.phases - 1 if problem.ends_with_event else problem.phases
    own = [*(min(n, MOST_STEPS) for n in np.resize(steps, last))]
    return problem.but(steps=[*own, *[0] * (problem.phases - last)])


def _along(problem: Problem, motion: Solution) -> Solution | None:
    """The motion of a problem from another one."""
    solution = solve(problem, guess=motion, starts=1)
    return solution if solution.converged else None


def _at(problem: Problem, branch: Branch, seed: int) -> Solution | None:
    """The motion of the durations at which the least cost was met."""
    if not np.isfinite(branch.best) or not branch.durations.any():
        return None
    guess = {"durations": branch.durations.tolist()}
    solution = solve(problem, guess=guess, starts=1, seed=seed)
    return solution if solution.converged else None


def _best(*motions: Solution | None) -> Solution | None:
    """The one that costs least."""
    return min((m for m in motions if m is not None), key=lambda m: m.cost, default=None)


def _claim(
    branch: Branch, motion: Solution | None, asked: tuple[float, float, float], going_on: bool
) -> Claim:
    """What is shown by the bound of all durations; asked are the gap, the least one, and the cost
    beyond which there is no motion.  Boxes that cannot be halved are left with lower bounds."""
    gap, least, beyond = asked
    if going_on:
        return Claim.OPEN
    if motion is None:
        none = np.isinf(branch.best) and branch.bound >= beyond
        return Claim.IMPOSSIBLE if none else Claim.OPEN
    if branch.bound > motion.cost + CONTRADICTION * abs(motion.cost) + least:
        raise ProblemError(
            f"a motion costs {motion.cost:.9g}, below the bound {branch.bound:.9g} of all: the "
            "program is not the linear one that was read from it; please report this problem."
        )
    within = branch.bound >= motion.cost - max(gap * abs(motion.cost), least)
    return Claim.OPTIMAL if within else Claim.OPEN


def _largest_cost(linear: LinearProblem) -> float:
    """What the inputs within their bounds cost at most; infinite where nothing bounds them, or
    where states cost something."""
    of_end = linear.soft.any() or len(linear.goal_cost.b)
    of_states = of_end or any(phase.cost >= 0 for phase in linear.phases)
    most = np.inf if of_states else 0.0
    for phase in linear.phases:
        reach = np.maximum(np.abs(phase.lower), np.abs(phase.upper))
        own = np.where(np.diag(phase.R) > 0, reach, 0.0)
        with np.errstate(invalid="ignore"):
            curved = float(np.abs(phase.R) @ own @ own / 2) if np.isfinite(own).all() else np.inf
            slanted = float(np.abs(phase.c) @ np.where(phase.c != 0, reach, 0.0))
        most = max(most, curved + slanted + max(phase.c_0, 0.0))
    return float(most * linear.final_time[1])


def _size_of_cost(linear: LinearProblem) -> float:
    """What a motion may cost by the sizes of the problem: forces that move its coordinates by their
    sizes in the time of a phase."""
    latest = linear.final_time[1]
    share = latest / len(linear.phases)
    size = 0.0
    for phase in linear.phases:
        R = np.abs(np.diag(phase.R))[: len(phase.R) - phase.squares].max(initial=0.0)
        size = max(size, R * linear.force(share) ** 2 / 2 + phase.heavy + np.abs(phase.c_0))
    return float(size * latest) or 1.0
