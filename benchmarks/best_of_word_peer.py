"""The peer of the words: the ladder's collocation with CasADi and IPOPT from random straight lines,
with contacts that last, friction, periodic states and goals of quantities.

In a phase with contacts, the equations of motion are solved together with the accelerations of what
is held: M a = f + B l, A a = -A' v, where rows of A are gradients of closed gaps and of tangents
that stick.  Limits of the forces l and directions of sliding are further path constraints.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from copy import copy
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from best_of_word_problems import STEPS, Word
from common import Mode
from ladder_casadi import (
    CasadiModel,
    CasadiTranscription,
    InitialGuess,
    NodeState,
    StraightLine,
    transcribed,
)

import dmoc

POSITIVE, NEGATIVE = (0.0, np.inf), (-np.inf, 0.0)
SUCCEEDED = ("Solve_Succeeded", "Solved_To_Acceptable_Level")
# Sliding speeds may be so negative: where sliding begins and ends they are zero by an equation.
SLACK = 1e-6
LONGEST = 5.0  # times the natural one, where a final time has no upper bound


class NotStatedError(Exception):
    """What this collocation does not know."""


@dataclass(frozen=True)
class RandomLine:
    """Straight lines from the start through random places to the goal, with random durations and
    without inputs.  The places are at the events, or half way where there are none."""

    places: np.ndarray  # shape (lines + 1, nq)
    seconds: np.ndarray  # of the phases
    nu: int

    @classmethod
    def of(cls, problem: dmoc.Problem, rng: np.random.Generator) -> RandomLine:
        line, phases = StraightLine.of(problem), problem.phases
        low, high = problem.final_time_bounds
        high = high if np.isfinite(high) else LONGEST * line.time
        low = low if low > 0 else high / LONGEST
        time = float(np.exp(rng.uniform(np.log(low), np.log(high)))) if low < high else high
        shares = rng.dirichlet(np.full(phases, 2.0))
        seconds = np.clip(time * shares, *problem.duration_bounds.T)
        ends = np.array([line.begin, line.end])
        wide = np.maximum(np.abs(np.diff(ends, axis=0)), 1.0)
        shape = max(phases, 2) - 1, problem.nq
        inner = rng.uniform(ends.min(axis=0) - wide / 2, ends.max(axis=0) + wide / 2, shape)
        places = np.vstack([ends[:1], inner, ends[1:]]).clip(*problem.coordinate_bounds.T)
        return cls(places, seconds, problem.nu)

    def durations(self, phases: int) -> np.ndarray:
        return self.seconds

    def state(self, phase: int, share: float) -> tuple[np.ndarray, np.ndarray]:
        lines, phases = len(self.places) - 1, len(self.seconds)
        along = (phase + share) * lines / phases  # in lines
        line = min(int(along), lines - 1)
        begin, end = self.places[line : line + 2]
        seconds = self.seconds[phase] * phases / lines
        velocity = (end - begin) / seconds if seconds > 0 else np.zeros_like(begin)
        return begin + (along - line) * (end - begin), velocity

    def inputs(self, phase: int, share: float) -> np.ndarray:
        return np.zeros(self.nu)

    def after(self, hit: int) -> tuple[np.ndarray, float]:
        return self.state(hit + 1, 0.0)[1], 0.0


def in_mode(base: CasadiModel, problem: dmoc.Problem, mode: Mode) -> CasadiModel:
    """The model with contacts and friction: its acceleration, and their limits as rows of its path
    constraints; ``forces`` are those of what is held, normal ones first."""
    if mode.free:
        return base
    q, v = ca.SX.sym("q", base.nq), ca.SX.sym("v", base.nq)
    u, t = ca.SX.sym("u", base.nu), ca.SX.sym("t")
    supports = problem.touch.contacts.supports
    normals, along = base.normals(q, v, u, t), base.along(q, v, u, t)
    mass, free = base.mass(q, v, u, t), base.acceleration(q, v, u, t)
    rates = ca.vertcat(
        *(base.rates(q, v, u, t)[j] for j in mode.closed),
        *(base.slips(q, v, u, t)[k] for k in mode.sticking),
    )
    held = ca.jacobian(rates, v)
    pushes = [-normals[j, :].T for j in mode.closed]
    rails = ca.SX.zeros(base.nq)
    for k, sign in mode.sliding:
        if supports[k] in mode.closed:
            pushes[mode.closed.index(supports[k])] -= sign * base.friction[k] * along[k, :].T
        else:
            rails -= sign * base.friction[k] * along[k, :].T
    pushes += [along[k, :].T for k in mode.sticking]
    B, bent = ca.horzcat(*pushes), ca.jtimes(rates, q, v) + ca.jacobian(rates, t)
    loose = free + ca.solve(mass, rails)
    forces = ca.SX(0, 1)
    if rates.numel():
        forces = ca.solve(held @ ca.solve(mass, B), -bent - held @ loose)
        loose += ca.solve(mass, B @ forces)
    limits = [forces[i] for i in range(len(mode.closed))]
    for i, k in enumerate(mode.sticking):
        most = base.static_friction[k]
        if supports[k] in mode.closed:
            most *= forces[mode.closed.index(supports[k])]
        force = forces[len(mode.closed) + i]
        limits += [most - force, most + force]
    limits += [sign * base.slips(q, v, u, t)[k] + SLACK for k, sign in mode.sliding]
    own = copy(base)
    own.acceleration = ca.Function("a", [q, v, u, t], [loose])
    own.path = ca.Function("r", [q, v, u, t], [ca.vertcat(base.path(q, v, u, t), *limits)])
    own.forces = ca.Function("l", [q, v, u, t], [forces])
    own.pushes = ca.Function("B", [q, t], [ca.substitute(B, v, 0)])
    own.held = ca.Function("A", [q, v, t], [rates])
    return own


class WordTranscription(CasadiTranscription):
    """The program of a word; it notes what its unknowns are, for other starts and for the motion
    that they are in the end."""

    def __init__(self, model: CasadiModel, problem: dmoc.Problem, start: InitialGuess) -> None:
        super().__init__(model, problem, start)
        self.free, self.u = model, ca.SX(0)
        self.starts: list[Callable[[InitialGuess], Any]] = []
        self.rows: list[tuple[str, int, slice]] = []  # kind, phase, place among the unknowns

    def _note(self, kind: str, phase: int, begin: Callable[[InitialGuess], Any]) -> None:
        size = np.size(begin(self.start))
        first = self.rows[-1][2].stop if self.rows else 0
        self.rows.append((kind, phase, slice(first, first + size)))
        self.starts.append(begin)

    def durations(self) -> ca.SX:
        phases = self.problem.phases
        self._note("T", 0, lambda line: line.durations(phases))
        T = super().durations()
        if self.problem.ends_with_event:
            self.x_bounds[-1] = self.x_bounds[-1].copy()
            self.x_bounds[-1][-1] = 0.0
        return T

    def node(self, phase: int, share: float) -> NodeState:
        self._note("node", phase, lambda line: np.concatenate(line.state(phase, share)))
        return super().node(phase, share)

    def inputs(self) -> ca.SX:
        phase, share = self.phase, self.share
        self._note("inputs", phase, lambda line: line.inputs(phase, share))
        return super().inputs()

    def enter(self, phase: int, state: NodeState, t: ca.SX) -> None:
        mode = self.problem.touch.modes[phase]
        self.model = in_mode(self.free, self.problem, mode)
        if phase == 0 and not mode.free and not self.problem.relations:  # else the end says so
            for j in mode.closed:
                self.demand(self.free.gaps(*state, 0, t)[j])
            self.demand(self.model.held(*state, t))

    def outside(self, state: NodeState, t: ca.SX) -> None:
        problem, phase = self.problem, self.phase
        for j, name in enumerate(problem.kernels.surfaces):
            if j not in problem.touch.modes[phase].closed and name not in problem.ignored:
                self.demand(self.free.gaps(*state, 0, t)[j], NEGATIVE)

    def simpson(self, *step: Any) -> tuple[ca.SX, ca.SX]:
        more, self.u = super().simpson(*step)
        return more, self.u

    def collision(self, hit: int, before: NodeState, t: ca.SX) -> NodeState:
        """The state after an event: a hit without friction, or what lands, leaves, sticks and
        slides from here on."""
        problem, event = self.problem, self.problem.touch.events[hit]
        old, new = problem.touch.modes[hit : hit + 2]
        self._via(hit, before, t)
        self._breaks_away(old, new, before, t)
        at_rails = [k for k in new.sticking if k not in old.sticking and not event.lands]
        for k in at_rails:
            self.demand(self.free.slips(*before, 0, t)[k])
        if event.lands:
            return self._landing(hit, before, t)
        if not event.impact:
            return before
        if event.course is not None or new.closed:
            raise NotStatedError("hits with friction, or with contacts that stay closed")
        self._note("after", hit, lambda line: line.after(hit)[0])
        self._note("impulse", hit, lambda line: line.after(hit)[1])
        return self.bounce(hit, event.hit, before, t)

    def _breaks_away(self, old: Mode, new: Mode, state: NodeState, t: ca.SX) -> None:
        """Where static friction is larger than kinetic friction, sliding begins at its limit."""
        supports, signs = self.problem.touch.contacts.supports, dict(new.sliding)
        forces = self.model.forces(*state, self.u, t) if old.sticking else None
        for i, k in enumerate(old.sticking):
            most, least = self.free.static_friction[k], self.free.friction[k]
            if k in signs and most > least:
                if supports[k] in old.closed:
                    most *= forces[old.closed.index(supports[k])]
                self.demand(forces[len(old.closed) + i] + signs[k] * most)

    def _landing(self, hit: int, before: NodeState, t: ca.SX) -> NodeState:
        """A plastic impact after which everything that is closed is held."""
        (q, v), model, event = before, self.free, self.problem.touch.events[hit]
        mode = self.problem.touch.modes[hit + 1]
        held = in_mode(model, self.problem, mode)
        self._note("after", hit, lambda line: line.after(hit)[0])
        after = self.unknown("v_after", self.start.after(hit)[0], (-np.inf, np.inf))
        count = len(mode.closed) + sum(self._on_ground(k) for k in mode.sticking)
        self._note("impulse", hit, lambda line: np.zeros(count))
        impulse = self.unknown("impulse", np.zeros(count), (-np.inf, np.inf))
        jump = model.momentum(q, after, 0, t) - model.momentum(q, v, 0, t)
        self.demand(jump - held.pushes(q, t)[:, :count] @ impulse)
        self.demand(held.held(q, after, t))
        for j in event.lands:
            self.demand(model.gaps(q, v, 0, t)[j])
        for i in range(len(mode.closed)):
            self.demand(impulse[i], POSITIVE)
        for i, k in enumerate(k for k in mode.sticking if self._on_ground(k)):
            support = self.problem.touch.contacts.supports[k]
            most = model.static_friction[k] * impulse[mode.closed.index(support)]
            for sign in (-1, 1):
                self.demand(most + sign * impulse[len(mode.closed) + i], POSITIVE)
        for j in event.leaves:
            self.demand(model.rates(q, after, 0, t)[j], NEGATIVE)
        return q, after

    def _on_ground(self, tangent: int) -> bool:
        return self.problem.touch.contacts.supports[tangent] >= 0

    def _via(self, hit: int, state: NodeState, t: ca.SX) -> None:
        for i in np.flatnonzero(np.isfinite(self.problem.via_bounds[hit]).any(axis=1)):
            self.demand(state[0][int(i)], self.problem.via_bounds[hit][i])

    def ends(self, first: NodeState, last: NodeState, t: ca.SX) -> None:
        problem, names = self.problem, self.problem.states
        ranges = problem.quantity_ranges.goal
        values = self.free.quantities(*last, self.u, t)
        for i in np.flatnonzero(np.isfinite(ranges).any(axis=1)):
            self.demand(values[int(i)], ranges[i])
        begin = ca.vertcat(*first, self.free.momentum(*first, 0, 0))
        end = ca.vertcat(*last, self.free.momentum(*last, 0, t))
        for r in problem.relations:
            source = sum(factor * begin[names.index(name)] for name, factor in r.terms)
            self.demand(end[names.index(r.end)] - source, (r.low, r.high))
        super().ends(first, last, t)

    def begin(self, line: InitialGuess) -> np.ndarray:
        """The unknowns along a line."""
        return np.concatenate([np.ravel(start(line)) for start in self.starts])

    def motion(self, x: np.ndarray) -> list[dict[str, Any]]:
        """Keyframes of each phase that has steps, as `dmoc.solve` takes them."""
        kernels, nq, nu = self.problem.kernels, self.problem.nq, self.problem.nu
        nodes, inputs = (
            [(p, x[at]) for k, p, at in self.rows if k == kind] for kind in ("node", "inputs")
        )
        guess, end = list[dict[str, Any]](), nodes[0][1][:nq]
        for phase, steps in enumerate(self.problem.phase_steps):
            if not steps:
                continue
            q = np.array([end, *(row[:nq] for p, row in nodes[1:] if p == phase)])
            rows = [row for p, row in inputs if p == phase]
            u = np.reshape(rows, (len(rows), nu))
            end = q[-1]
            courses = dict(zip(kernels.coordinates, q.T.tolist(), strict=True))
            courses |= dict(zip(kernels.inputs, u.T.tolist(), strict=True))
            guess.append({**courses, "durations": [float(x[phase])]})
        return guess


@dataclass(frozen=True)
class PeerMotion:
    """A motion that IPOPT takes for a minimum, the cost that it claims, and the CPU seconds from
    the first start on."""

    cost: float
    cpu: float
    guess: list[dict[str, Any]]


def motions(word: Word, seconds: float, starts: int, seed: int = 0) -> Iterator[PeerMotion]:
    """Minima from random straight lines, as many as there is CPU time for; building takes none."""
    problem = word.problem
    problem = problem.meshed(STEPS) if problem.steps is None else problem
    _check(problem)
    made = list[WordTranscription]()

    def kind(*parts: Any) -> WordTranscription:
        made.append(WordTranscription(*parts))
        return made[0]

    limits = {"max_cpu_time": seconds, "max_wall_time": 1e6}
    rng = np.random.default_rng(seed)
    solver = transcribed(
        word.statement, problem, seconds, RandomLine.of(problem, rng), kind, **limits
    )
    program, spent = made[0], 0.0
    for _ in range(starts):
        x0, begin = program.begin(RandomLine.of(problem, rng)), time.process_time()
        status, result = solver.solve(x0=x0)
        spent += time.process_time() - begin
        if spent > seconds:
            return
        if status in SUCCEEDED:
            x = np.array(result["x"]).ravel()
            yield PeerMotion(float(result["f"]), spent, program.motion(x))


def _check(problem: dmoc.Problem) -> None:
    """Refuse what the program does not have."""
    if problem.model.has_objective or problem.kernels.integrals:
        raise NotStatedError("an objective beside the integral of the cost")
    if np.isfinite(problem.velocity_bounds).any() or np.isfinite(problem.quantity_bounds).any():
        raise NotStatedError("bounds of velocities or quantities along the way")
    if problem.open_hits:
        raise NotStatedError("hits with friction")
