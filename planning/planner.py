"""dmoc.Planner: the rest of a motion, planned again every few milliseconds."""

from __future__ import annotations

import time as clock
from collections.abc import Iterator, Sequence
from copy import copy
from typing import Any

import numpy as np

from dmoc.base.arguments import choice, number, positive, shown, whole
from dmoc.base.deadline import Deadline
from dmoc.base.errors import ProblemError
from dmoc.base.signatures import public
from dmoc.codegen.kernels import Array
from dmoc.control.controller import Measured, digest_of
from dmoc.guess.transfer import pieces_of, unknowns_along
from dmoc.mechanics.attitudes import facing
from dmoc.motion.trajectory import Collision, Trajectory
from dmoc.planning.measured_state import arrival, consistent, is_over, read_state
from dmoc.planning.plan import (
    LastPlan,
    Plan,
    from_phase,
    from_state,
    next_event,
    place_at,
    time_left,
)
from dmoc.planning.rest import check_recedes, planned, rest_of
from dmoc.problem.problem import Problem
from dmoc.program.bounds import SHORTEST_PHASE
from dmoc.program.extraction import trajectory
from dmoc.program.scale import Scale
from dmoc.program.scaling import scale_of
from dmoc.program.transcription import Transcription
from dmoc.results.solution import Solution
from dmoc.solvers.ipm import solve_ipm
from dmoc.solvers.judge import judged
from dmoc.solvers.outcome import Duals, Options, Outcome, Status
from dmoc.solving.programs import at_solution
from dmoc.solving.request import check_problem
from dmoc.solving.sensitivity import as_solved, check_minimum
from dmoc.solving.solve import solve

HORIZONS = ("shrinks", "recedes")
# A point that is cut off by a limit is a plan if it violates nothing by more than this share of
# its size, which the next plan corrects.
FEASIBLE = 1e-4
# Iterations of a plan: a neighbouring one takes some ten.
ITERATIONS = 60
# Seconds between plans, about what one takes.
EVERY = 5e-3
# So many times as long before the end the last one goes on.
LAST = 3
# An event that is nearer than this share of what is left of the motion is about to happen, and not
# planned any more.
NEARLY = 2 * SHORTEST_PHASE
# A late event is taken to come as the state moves, or after this share of what is left.
LATE = 0.5


@public(ProblemError)
class Planner:
    """Plans the rest of a motion from measured states.

    Each plan is the problem of what is left: phases that are over are dropped, the state that was
    measured is the start, and the time that has passed is taken off the final time and the
    durations.  Steps and sizes stay those of the solution, and each plan starts from the last one,
    with its multipliers.

    Parameters
    ----------
    problem : Problem
    solution : Solution, optional
        Its solution; solved for where it is not given.
    horizon : {"shrinks", "recedes"}
        Whether the final time stays where it was, or is as far away as at the beginning.
    iterations : int
        Of a plan, at most.
    every : float
        Seconds between plans where :func:`dmoc.simulate` runs it as ``feedback``.
    tolerance : float
        Share of their sizes by which states that are fixed at the end may be missed: what inputs do
        not reach, as the momentum of a flight, would leave no plan from a state that is off.

    Attributes
    ----------
    plan : Plan
        The last one; at first the solution.
    solution : Solution

    Raises
    ------
    ProblemError
        If the problem has no solution, or the one that is given is another one's, its kernels are
        not compiled, its model depends on the time, or its objective or bounds look at the whole
        motion.

    Notes
    -----
    Which event is over is read from the state where the caller does not say: what is hit or lands
    is left or at rest, near its surface; what leaves or slides otherwise does so at its time.  A
    measured state is moved onto closed contacts and constraints, and in front of surfaces.

    Examples
    --------
    >>> import dmoc
    >>> from dmoc.models.registry import find
    >>> reference = find("puck_table")
    >>> problem = dmoc.Problem(reference.kernels(), **reference.defaults)
    >>> planner = dmoc.Planner(problem.but(sequence=["east"], steps=20))
    >>> late = planner.plan.at(0.1)
    >>> plan = planner.replan(0.1, {"x": late["x"] + 0.01, "y": late["y"], "x_dot": late["x_dot"]})
    >>> plan.new, plan.phase, len(plan.input(0.12))
    (True, 0, 2)
    """

    def __init__(
        self,
        problem: Problem,
        solution: Solution | None = None,
        *,
        horizon: str = "shrinks",
        iterations: int = ITERATIONS,
        every: float = EVERY,
        tolerance: float = 0.0,
    ) -> None:
        check_problem(problem)
        if not (solution is None or isinstance(solution, Solution)):
            raise ProblemError(f"solution = {shown(solution)}: expected a Solution, or None.")
        self.shrinks = choice(horizon, "horizon", HORIZONS) == HORIZONS[0]
        self.iterations = whole(iterations, "iterations", 1, 10**6)
        self.every = positive(every, "every", "expected a positive number of seconds")
        missed = number(tolerance, "tolerance")
        if not 0 <= missed < 1:
            raise ProblemError(f"tolerance = {missed:g}: expected a share from 0 to 1.")
        if not self.shrinks:
            check_recedes(problem)
        solution = solve(problem) if solution is None else solution
        if not solution.converged:
            raise ProblemError(
                f"the problem has no solution to begin with ({solution.message}): a Planner keeps "
                "to its sequence and its mesh, so give a solution."
            )
        check_minimum(as_solved(problem, solution), solution)
        self.problem, motion = planned(problem, solution, missed), solution.trajectory
        self.solution, duals = solution, None
        self._scales = dict[int, Scale]()
        if not (problem.relations or missed):  # else its rest has other constraints or unknowns
            nlp, duals = at_solution(self.problem, solution)
            self._scales[0] = nlp.scale
        self._first = LastPlan(0, motion, 0.0, 0.0, duals)
        self._planned = Plan(
            0.0, 0, solution.status, solution.message, motion, 0.0, solution.cost, 0.0, 0, True
        )
        self._start()

    def _start(self) -> None:
        """Go to the beginning of the motion."""
        self.scales = dict(self._scales)
        self._last, self.plan, self._measured, self._due = self._first, self._planned, 0.0, 0.0

    def replan(
        self, time: float, state: Any, *, phase: int | None = None, seconds: float | None = None
    ) -> Plan:
        """Plan from a state that was measured at a time.

        Parameters
        ----------
        time : float
            Seconds from the beginning of the motion, not before those of the last plan.
        state : mapping or array
            Coordinates and velocities by name, of which those that are not given are zero, or as
            an array of shape (2 nq,) or a pair of shape (nq,) each.
        phase : int, optional
            Number of the phase, where it is known, as by a switch at a stop; events before it are
            over.
        seconds : float, optional
            How long it may take: then the best that is feasible so far is the plan, or the last one
            goes on.

        Returns
        -------
        Plan
            Also kept as ``plan``.
        """
        begin, deadline = clock.perf_counter(), Deadline.after(_limit(seconds))
        now = number(time, "time")
        if now < self._measured:
            raise ProblemError(
                f"time = {now:g}: expected a time from {self._measured:.6g} s on, that of the last "
                "state."
            )
        near = place_at(self._last, now)
        measured = facing(self.problem.kernels, *read_state(self.problem, state), near)
        reached = self._phase(phase, measured, now)
        before, self._measured = self._last, now
        if reached != before.phase:
            before = from_phase(before, reached, now)
        ended: Outcome | None = None
        try:
            at = consistent(self.problem, self.problem.touch.modes[reached], measured)
            self._check_far(before, at, now)
            rest = rest_of(self.problem, reached, at, now, before.begun, self.shrinks)
            nlp, x = self._program(rest, reached, before, at, now)
            ended = self._solved(nlp, x, before.duals, deadline)
            status, message = ended.status, _message(ended)
        except ProblemError as error:  # there is nothing left, or the state is none of the model
            status, message = Status.INFEASIBLE, str(error)
        good = ended is not None and _is_plan(ended)
        if good and ended is not None:
            motion = trajectory(nlp, ended.x)
            self._last = LastPlan(reached, motion, now, before.begun, ended.duals)
            cost, count = motion.cost, ended.iterations
        else:
            self._last = before
            motion, cost, count = self.plan.trajectory, self.plan.cost, 0
        taken = clock.perf_counter() - begin
        origin = now if good else self.plan.origin
        self.plan = Plan(now, reached, status, message, motion, origin, cost, taken, count, good)
        return self.plan

    def rests(self) -> Iterator[tuple[float, Transcription, Array, Outcome]]:
        """Rests of the planned motion, for each phase with steps: when the phase begins, the
        program of the rest from there, the unknowns from which it starts, shape (n,), and how it
        ends."""
        for i, phase in enumerate(self._first.motion.phases):
            if phase.steps:
                begin = float(phase.t[0])
                before = from_phase(self._first, i, begin) if i else self._first
                state = consistent(
                    self.problem, self.problem.touch.modes[i], (phase.q[0], phase.v[0])
                )
                rest = rest_of(self.problem, i, state, begin, begin, self.shrinks)
                nlp, x = self._program(rest, i, before, state, begin)
                yield begin, nlp, x, self._solved(nlp, x, before.duals, Deadline.after(None))

    # What dmoc.simulate asks of a feedback --------------------------------------------------------

    @property
    def events(self) -> Sequence[Collision]:
        """The events of the motion."""
        return self._planned.trajectory.collisions

    @property
    def bounds(self) -> Array:
        """Bounds of the inputs, shape (nu, 2)."""
        return self.problem.input_bounds

    def begin(self) -> Planner:
        """The same planner at the beginning of the motion."""
        other = copy(self)
        other._start()
        return other

    def fits(self, motion: Trajectory) -> bool:
        """Whether the planner begins with a motion."""
        return digest_of(motion) == digest_of(self._planned.trajectory)

    def span(self, phase: int) -> tuple[float, float]:
        """When the plan has a phase begin and end."""
        own = self._last.motion.phases[max(phase - self._last.phase, 0)]
        return self._last.origin + float(own.t[0]), self._last.origin + float(own.t[-1])

    def steer(self, phase: int, t: float, h: float, measured: Measured | None) -> Array:
        """The inputs of the plan, shape (nu,), in the middle of the h seconds from t on. Where one
        is due, a new plan is made before: not at the very end, where it would answer to noise
        alone."""
        due = t >= self._due - h / 2 and self.plan.final_time - t >= LAST * self.every
        if measured is not None and measured.time > 0 and due:
            reached = max(measured.phase, self._last.phase)
            self.replan(measured.time, np.split(measured.y, 2), phase=reached)
            self._due = t + self.every
        return self.plan.input(t + h / 2)

    def _phase(self, stated: int | None, state: tuple[Array, Array], now: float) -> int:
        """The phase that a state is in."""
        last = self._last
        if stated is not None:
            reached = whole(stated, "phase", last.phase, self.problem.phases - 1)
            return reached
        reached = last.phase
        while reached < self.problem.phases - 1:
            k, step = reached - last.phase, now - self._measured
            event = last.motion.collisions[k]
            late = now - last.origin - event.time
            began = last.begun if k == 0 else last.origin + last.motion.collisions[k - 1].time
            lasts = last.origin + event.time - began
            if not is_over(self.problem, event, state, late, lasts, step):
                break
            reached += 1
        return reached

    def _check_far(self, before: LastPlan, state: tuple[Array, Array], now: float) -> None:
        """Refuse a state from which the next event comes sooner than a phase may last."""
        event = next_event(before)
        arrives = arrival(self.problem, event, state)
        if event is not None and arrives < NEARLY * time_left(before, now):
            raise ProblemError(
                f"the next event ({event.word}) is {arrives:.2g} s away, less than a phase may "
                "last."
            )

    def _program(
        self, rest: Problem, phase: int, before: LastPlan, state: tuple[Array, Array], now: float
    ) -> tuple[Transcription, Array]:
        """The program of the rest, and where it starts: along the last plan from now on."""
        pieces = pieces_of(before.motion)
        left, time = time_left(before, now), now - before.origin
        late = min(arrival(self.problem, next_event(before), state), LATE * left)
        pieces[0] = from_state(pieces[0], time, state, NEARLY * left, late)
        impulses = [c.impulse for c in before.motion.collisions]
        x = unknowns_along(rest, pieces, impulses)
        if phase not in self.scales:
            self.scales[phase] = scale_of(rest, x, minimum=True)
        nlp = Transcription(rest, self.scales[phase])
        return nlp, nlp.scaled(x)

    def _solved(
        self, nlp: Transcription, x: Array, duals: Duals | None, deadline: Deadline
    ) -> Outcome:
        """Solved with the multipliers of the last plan; without them where that leads nowhere."""
        options = Options(iterations=self.iterations, deadline=deadline)
        fits = (
            duals is not None and len(duals.z) == nlp.n and len(duals.rows) == nlp.n_eq + nlp.n_in
        )
        with np.errstate(all="ignore"):
            if fits:
                ended = judged(nlp, solve_ipm(nlp, x, options, duals), options)
                if _is_plan(ended) or deadline.passed:
                    return ended
            return judged(nlp, solve_ipm(nlp, x, options), options)


def _limit(seconds: float | None) -> float | None:
    if seconds is None:
        return None
    return positive(seconds, "seconds", "expected a positive number")


def _is_plan(ended: Outcome) -> bool:
    """Whether a point can be followed."""
    if ended.status is Status.SOLVED:
        return True
    return ended.status is not Status.INFEASIBLE and ended.left.violation <= FEASIBLE


def _message(ended: Outcome) -> str:
    detail = f" ({ended.detail})" if ended.detail else ""
    return ended.status.sentence + detail
