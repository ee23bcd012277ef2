"""The judge of the campaigns: what a solution may miss and still be confirmed by the event-driven
simulation of `event_simulation.py`, which is told no mode."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
import sympy as sp
from campaign_kinds import Instance
from contact_equations import ContactSizes
from event_simulation import ContactMechanism

import dmoc

SEGMENTS = 10  # of a phase
# What an answer may miss and still be confirmed; the discretisation errs by some 1e-3 with so many
# steps.
MOST = {
    "segment": 0.02,  # of extent and speed, in the metric of the mass matrix
    "event": 0.03,  # of the speed, by the nearest outcome of the law of impact
    "law": 0.05,  # of the rate of approach, at a hit without friction: Newton's
    "impulse": 0.05,  # of the largest impulse of the motion, and of its own at such a hit
    "force": 0.05,  # of the largest contact force of the motion, or friction force
    "gap": 1e-6,  # of the gap's range, at an event
    "limit": 1e-6,  # of the range of an input
    "boundary": 1e-6,  # of the motion's range
    "path": 1e-3,  # of the largest value of a path constraint, at the nodes
    "cost": 1e-6,
    "excess": 0.03,  # over the optimum, where it is known
}
# Rate of approach, of the largest one of the gap, below which a collision has no effect.
NO_EFFECT = 0.01
SAME_TIME = 0.02  # of the final time, by which a planned event may come early
LEAST = 1e-3  # share of the largest gap, rate or sliding rate that each counts at least
EDGE = 2  # nodes beside an event at which forces, which may jump there, are not compared


@dataclass
class JudgedSolve:
    """One solve: how it ended, the worst of each error, and what contradicts it."""

    kind: str
    number: int
    order: int
    method: str
    status: str
    errors: dict[str, float] = field(default_factory=dict)
    against: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class JudgedMotion:
    """A solution as plain arrays, with the velocities that the judge finds from the momenta."""

    mechanism: ContactMechanism
    par: np.ndarray
    phases: list[dict[str, Any]]
    extent: float
    speed: float

    def length(self, q: np.ndarray, t: float, a: np.ndarray) -> float:
        """Length of a vector of coordinates or velocities in the metric of the mass matrix."""
        M = self.mechanism.motion(
            q, np.zeros(len(q)), np.zeros(self.phases[0]["inputs"][1].shape[1]), t, self.par
        )[0]
        return float(np.sqrt(max(a @ M @ a, 0.0)))


def judged_motion(solution: dmoc.Solution, mechanism: ContactMechanism) -> JudgedMotion:
    par = np.array(list(solution.trajectory.parameters.values()))
    phases = []
    for p in solution.trajectory.phases:
        first, last = solution.trajectory.input_ends(p)
        u = np.vstack([first, last[-1:]])
        v = np.array([mechanism.velocity(*row, par) for row in zip(p.q, p.p, u, p.t, strict=True)])
        phases.append(
            {"t": p.t, "q": p.q, "v": v, "inputs": (p.t, np.asarray(first), np.asarray(last))}
        )
    bare = JudgedMotion(mechanism, par, phases, 1.0, 1.0)
    middle = np.vstack([p["q"] for p in phases]).mean(axis=0)
    rows = [(q, t, v) for p in phases for q, t, v in zip(p["q"], p["t"], p["v"], strict=True)]
    extent = max(bare.length(q, t, q - middle) for q, t, _ in rows)
    speed = max(bare.length(q, t, v) for q, t, v in rows)
    return JudgedMotion(mechanism, par, phases, extent, speed)


def judge(
    result: JudgedSolve, instance: Instance, solution: dmoc.Solution, mechanism: ContactMechanism
) -> None:
    """Put the errors of a solution, and what contradicts it, into its result."""
    motion, e = judged_motion(solution, mechanism), list(solution.trajectory.restitution.values())
    sizes, worst = _sizes(motion, solution), result.errors
    worst["segment"], unplanned = _segments(motion, solution, sizes, e)
    errors, outside = _events(motion, solution, sizes, e)
    worst.update(errors)
    worst["force"], inconsistent = _forces(motion, solution, sizes)
    result.against += [*unplanned, *outside, *inconsistent]
    worst["limit"] = _limits(motion, instance, solution)
    worst["boundary"] = _boundary(motion, instance.problem, solution)
    worst["path"] = _path(motion, instance)
    worst["cost"] = _cost(motion, solution)
    if instance.known_cost is not None:
        worst["excess"] = solution.cost / instance.known_cost - 1
    result.against += [f"{name} {x:.2g}" for name, x in worst.items() if not x <= MOST[name]]


def _sizes(motion: JudgedMotion, solution: dmoc.Solution) -> ContactSizes:
    """Of the gaps, their rates and the sliding rates of a motion."""
    mechanism: Any = motion.mechanism
    rows = [row for p in motion.phases for row in zip(p["q"], p["v"], p["t"], strict=True)]
    gaps = np.array([mechanism.gap_motion(q, v, t, motion.par)[:2] for q, v, t in rows])
    slides = np.array([mechanism.slide_motion(q, v, t, motion.par)[1] for q, v, t in rows])
    speeds = [np.abs(v).max() for _, v, _ in rows]
    # What does not move counts by a share of what moves most.
    extent = max(float(np.ptp([q for q, _, _ in rows], axis=0).max()), 1e-9)
    gap = np.maximum(np.ptp(gaps[:, 0], axis=0), LEAST * extent)
    rate = np.maximum(np.abs(gaps[:, 1]).max(axis=0), LEAST * max(speeds))
    slide = np.maximum(np.abs(slides).max(axis=0), LEAST * max(speeds))
    return ContactSizes(gap, rate, slide, float(motion.phases[-1]["t"][-1]))


def _passed(mechanism: ContactMechanism, solution: dmoc.Solution, i: int) -> set[int]:
    """Surfaces that hold nothing in a phase: those that are ignored and not closed in it."""
    names = set(solution.trajectory.ignored) - set(solution.phases[i].closed)
    return {mechanism.surfaces.index(name) for name in names}


def _segments(
    motion: JudgedMotion, solution: dmoc.Solution, sizes: ContactSizes, e: list[float]
) -> tuple[float, list[str]]:
    """Largest error of a simulation over a tenth of a phase, from the motion's own nodes, and
    impacts that were not planned."""
    mechanism: Any = motion.mechanism
    worst, objections = 0.0, list[str]()
    for i, p in enumerate(motion.phases):
        ends = np.unique(np.linspace(0, len(p["t"]) - 1, SEGMENTS + 1).round().astype(int))
        event = solution.collisions[i] if i < len(solution.collisions) else None
        names = {event.surface, *event.lands} if event else set()
        final = float(p["t"][-1])

        def planned(j: int, t: float, names: set[str] = names, final: float = final) -> bool:
            near = t > final - SAME_TIME * sizes.time
            last = final > sizes.time * (1 - 1e-9)
            return near and (last or mechanism.surfaces[j] in names)

        for a, b in pairwise(ends):
            run = mechanism.run(
                p["inputs"], p["t"][a], p["t"][b], p["q"][a], p["v"][a], motion.par, sizes, e,
                planned, _passed(mechanism, solution, i),
            )  # fmt: skip
            objections += [f"an impact on {s} at {t:.4g} s was not planned" for s, t in run.impacts]
            worst = max(worst, _distance(motion, run.q, run.v, p["q"][b], p["v"][b], p["t"][b]))
    return worst, objections


def _distance(
    motion: JudgedMotion,
    q: np.ndarray,
    v: np.ndarray,
    q_goal: np.ndarray,
    v_goal: np.ndarray,
    t: float,
) -> float:
    place = motion.length(q_goal, t, q - q_goal) / motion.extent
    return max(place, motion.length(q_goal, t, v - v_goal) / motion.speed)


def _events(
    motion: JudgedMotion, solution: dmoc.Solution, sizes: ContactSizes, e: list[float]
) -> tuple[dict[str, float], list[str]]:
    """Largest differences of the velocity after an event, and of an impulse, to the nearest outcome
    that the laws allow, largest gap there, and what no law allows."""
    mechanism: Any = motion.mechanism
    worst, objections = dict.fromkeys(("event", "law", "impulse", "gap"), 0.0), list[str]()

    def put(name: str, error: float) -> None:
        worst[name] = max(worst[name], float(error))

    impulses = [max(c.impulses.values(), default=c.impulse) for c in solution.collisions]
    most = max([*impulses, 1e-300])
    for i, c in enumerate(solution.collisions):
        before, after = motion.phases[i], motion.phases[i + 1]["v"][0]
        q, v, t = before["q"][-1], before["v"][-1], float(before["t"][-1])

        def off(
            velocity: np.ndarray, q: np.ndarray = q, t: float = t, after: np.ndarray = after
        ) -> float:
            return motion.length(q, t, after - velocity) / motion.speed

        hit = [mechanism.surfaces.index(s) for s in dict.fromkeys((c.surface, *c.lands)) if s]
        if not hit:
            put("event", off(v))
            continue
        u, passed = before["inputs"][2][-1], _passed(mechanism, solution, i) - set(hit)
        gaps, rates, normals, _ = mechanism.gap_motion(q, v, t, motion.par)
        put("gap", np.max(np.abs(gaps[hit]) / sizes.gap[hit]))
        least = NO_EFFECT * sizes.rate[hit[0]]
        M = mechanism.motion(q, v, u, t, motion.par)[0]
        push = motion.length(q, t, np.linalg.solve(M, normals[hit[0]]) * c.impulse)
        if not c.lands and abs(rates[hit[0]]) < least and push < NO_EFFECT * motion.speed:
            if solution.status == "solved":
                objections.append(f"{c.word} has no effect")
            continue
        if not c.lands and rates[hit[0]] < 0:
            objections.append(f"{c.word} departs before it hits")
        elastic = [0.0 if s in c.lands else r for s, r in zip(mechanism.surfaces, e, strict=True)]
        outcomes = list(mechanism.impacts(hit, q, v, u, t, motion.par, sizes, elastic, passed))
        if not outcomes:
            objections.append(f"no law gives an outcome of {c.word}")
            continue
        nearest = min(outcomes, key=lambda o: off(o.motion))
        put("event", off(nearest.motion))
        smooth = not c.lands and not c.tractions
        if smooth:
            rate, (j, *_) = mechanism.gap_motion(q, after, t, motion.par)[1], hit
            put("law", abs(rate[j] + elastic[j] * rates[j]) / max(abs(rates[j]), least))
        size = max(abs(nearest.normal[hit[0]]), NO_EFFECT * most) if smooth else most
        planned_impulses = {c.surface: c.impulse, **c.impulses} if c.surface else dict(c.impulses)
        for names, planned, lawful in (
            (mechanism.surfaces, planned_impulses, nearest.normal),
            (mechanism.tangents, c.tractions, nearest.tangential),
        ):
            for name, value in zip(names, lawful, strict=True):
                put("impulse", abs(planned.get(name, 0.0) - value) / size)
    return worst, objections


def _forces(
    motion: JudgedMotion, solution: dmoc.Solution, sizes: ContactSizes
) -> tuple[float, list[str]]:
    """Largest difference of a contact or friction force at a node to the consistent one."""
    mechanism: Any = motion.mechanism
    most = [
        max(float(np.abs(getattr(p, name)).max(initial=0.0)) for p in solution.phases)
        for name in ("normal", "tangential")
    ]
    worst, objections = 0.0, list[str]()
    for i, (p, phase) in enumerate(zip(motion.phases, solution.phases, strict=True)):
        passed = _passed(mechanism, solution, i)
        for k in range(EDGE, len(p["t"]) - EDGE):
            try:
                consistent = mechanism.forces(
                    p["q"][k], p["v"][k], p["inputs"][1][k], p["t"][k], motion.par, sizes,
                    passed=passed,
                )  # fmt: skip
            except ArithmeticError as error:
                objections.append(str(error))
                continue
            normal = dict(zip(phase.closed, phase.normal[k] if phase.closed else (), strict=True))
            rubbing = phase.tangential[k] if phase.rubbing else ()
            tangential = dict(zip(phase.rubbing, rubbing, strict=True))
            for size, planned, names, forces in (
                (most[0], normal, mechanism.surfaces, consistent.normal),
                (most[1], tangential, mechanism.tangents, consistent.tangential),
            ):
                for name, force in zip(names, forces, strict=True):
                    error = abs(planned.get(name, 0.0) - force)
                    worst = max(worst, error / max(size, LEAST * max(most), 1e-300))
    return worst, objections[:3]


def _limits(motion: JudgedMotion, instance: Instance, solution: dmoc.Solution) -> float:
    """Largest violation of an input's limits anywhere in a step, relative to their range: linear
    inputs are largest at its ends."""
    worst = 0.0
    for j, u in enumerate(solution.trajectory.inputs):
        low, high = instance.problem.get("bounds", {}).get(u, (-np.inf, np.inf))
        if np.isfinite(high - low):
            values = np.concatenate(
                [
                    np.concatenate([p["inputs"][1][:, j], p["inputs"][2][:, j]])
                    for p in motion.phases
                ]
            )
            worst = max(
                worst, float(max(values.max() - high, low - values.min(), 0.0) / (high - low))
            )
    return worst


def _boundary(motion: JudgedMotion, problem: Mapping[str, Any], solution: dmoc.Solution) -> float:
    """Largest error of a value that is given at the start or the goal, and of a periodic state."""
    names, worst = solution.trajectory.coordinates, 0.0
    ends = []
    for p, k in ((motion.phases[0], 0), (motion.phases[-1], -1)):
        ends.append(dict(zip(names, p["q"][k], strict=True)))
        ends[-1] |= {f"{n}_dot": x for n, x in zip(names, p["v"][k], strict=True)}
    span = {n: float(np.ptp([q for p in motion.phases for q in p["q"][:, i]]))
            for i, n in enumerate(names)}  # fmt: skip
    most = max(float(np.abs(p["v"]).max()) for p in motion.phases)
    size = {n: max(span.values()) for n in names} | {f"{n}_dot": most for n in names}
    start = problem["start"]
    if not problem.get("periodic"):  # at rest where nothing else is said
        start = {f"{n}_dot": 0.0 for n in names} | start
    for state, bounds in zip(ends, (start, problem["goal"]), strict=True):
        for name, value in bounds.items():
            low, high = value if isinstance(value, tuple) else (value, value)
            low, high = (-np.inf if low is None else low), (np.inf if high is None else high)
            worst = max(worst, (low - state[name]) / size[name], (state[name] - high) / size[name])
    for name, source in problem.get("periodic", {}).items():
        start, difference = source if isinstance(source, tuple) else (source, 0.0)
        if difference is not None:
            error = abs(ends[1][name] - ends[0][start] - difference)
            worst = max(worst, error / size[name])
    return worst


def _path(motion: JudgedMotion, instance: Instance) -> float:
    """Largest violation of a path constraint at a node, relative to its largest value."""
    d, worst = instance.description, 0.0
    for relation in d.path_constraints.values():
        value = sp.lambdify([*d.coordinates], relation.lts - relation.gts)
        values = np.array([value(*q) for p in motion.phases for q in p["q"]])
        worst = max(worst, float(values.max() / np.abs(values).max()))
    return worst


def _cost(motion: JudgedMotion, solution: dmoc.Solution) -> float:
    """Difference of the cost to the integral of u^2 / 2, or, where there is no input, to the time.

    Inputs that are linear in a step count by the trapezoid rule at order 2, else exactly.
    """
    total, between = 0.0, 0 if solution.trajectory.order == 2 else 1
    for p in motion.phases:
        t, a, b = p["inputs"]
        squares = (a**2 + between * a * b + b**2) / (2 + between)
        total += float((np.diff(t)[:, None] * squares).sum()) / 2
    if not solution.trajectory.inputs:
        total = solution.final_time
    return abs(solution.cost - total) / max(abs(total), 1e-300)
