"""Random problems with contacts that last and friction, solved as a user would and judged by an
event-driven simulation that shares no code with dmoc and finds modes, cones and impacts by itself.

Run:  python benchmarks/contact_campaign.py [--problems 100]

Prints a table by kind, which `make bench` writes into its report; the exit status is 1 if any
answer with the status `solved` or `grazes` is contradicted.
"""

from __future__ import annotations

import argparse
import os
import sys
import traceback
from collections import Counter
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from itertools import pairwise
from typing import Any

import numpy as np
from campaign import (
    SEED,
    SEGMENTS,
    VOUCHED,
    Motion,
    Result,
    _distance,
    _limits,
    read,
    system_of,
    wrong_ones,
)
from campaign_kinds import Instance
from common import Section
from contact_driven import ContactMechanism, Sizes
from contact_kinds import KINDS

import dmoc

PROBLEMS = 100
SECONDS = 60.0  # of a solve
STEPS = 40
# What an answer may miss and still be confirmed; the discretisation errs by some 1e-3 with so many
# steps.
MOST = {
    "segment": 0.02,  # of extent and speed, in the metric of the mass matrix
    "event": 0.03,  # of the speed, by the nearest outcome of the law of impact
    "impulse": 0.05,  # of the largest impulse of the motion
    "force": 0.05,  # of the largest contact force of the motion, or friction force
    "limit": 1e-6,  # of the range of an input
    "boundary": 1e-6,  # of the motion's range
    "path": 1e-3,  # of the largest value of a path constraint, at the nodes
    "cost": 1e-6,
}
COLUMNS = tuple(MOST)
SAME_TIME = 0.02  # of the final time, by which a planned event may come early
LEAST = 1e-3  # share of the largest gap, rate or sliding rate that each counts at least
EDGE = 2  # nodes beside an event at which forces, which may jump there, are not compared


def draw(number: int) -> tuple[str, Instance]:
    """Kind and instance of a problem: they depend on the number alone."""
    kind = list(KINDS)[number % len(KINDS)]
    return kind, KINDS[kind](np.random.default_rng([SEED, number]))


def run_group(numbers: list[int]) -> list[Result]:
    """Problems of one model: its kernels and equations of motion are made once."""
    made: dict[str, tuple[Any, ContactMechanism]] = {}
    results = []
    for number in numbers:
        kind, instance = draw(number)
        name = instance.description.name
        if name not in made:
            kernels = dmoc.build(system_of(instance))
            made[name] = kernels, ContactMechanism(instance.description)
        results.append(_solved(kind, number, instance, *made[name]))
    return results


def _solved(
    kind: str, number: int, instance: Instance, kernels: Any, mechanism: ContactMechanism
) -> Result:
    result = Result(kind, number, 2, "ipm", "")
    try:
        problem = dmoc.Problem(kernels, steps=STEPS, **instance.problem)
        solution = dmoc.solve(problem, "ipm", seconds=SECONDS)
        result.status = solution.status
        if solution.status in (*VOUCHED, "not_verified"):
            judge(result, instance, solution, mechanism)
    except dmoc.DmocError as error:
        result.status = f"refused: {error}"
    except Exception:  # a traceback is a finding, and the other problems go on
        result.status = "traceback"
        result.against = [traceback.format_exc().strip().splitlines()[-1]]
    return result


def judge(
    result: Result, instance: Instance, solution: dmoc.Solution, mechanism: ContactMechanism
) -> None:
    """Put the errors of a solution, and what contradicts it, into its result."""
    motion, e = read(solution, mechanism), list(solution.trajectory.restitution.values())
    sizes, worst = _sizes(motion, solution), result.errors
    worst["segment"], told = _segments(motion, solution, sizes, e)
    result.against += told
    worst["event"], worst["impulse"], told = _events(motion, solution, sizes, e)
    result.against += told
    worst["force"], told = _forces(motion, solution, sizes)
    result.against += told
    worst["limit"] = _limits(motion, instance, solution)
    worst["boundary"] = _boundary(motion, instance.problem, solution)
    worst["path"] = _path(motion, instance)
    worst["cost"] = _cost(motion, solution)
    result.against += [
        f"{name} {worst[name]:.2g}" for name in COLUMNS if not worst[name] <= MOST[name]
    ]


def _sizes(motion: Motion, solution: dmoc.Solution) -> Sizes:
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
    return Sizes(gap, rate, slide, float(motion.phases[-1]["t"][-1]))


def _passed(mechanism: ContactMechanism, solution: dmoc.Solution, i: int) -> set[int]:
    """Surfaces that hold nothing in a phase: those that are ignored and not closed in it."""
    names = set(solution.trajectory.ignored) - set(solution.phases[i].closed)
    return {mechanism.surfaces.index(name) for name in names}


def _segments(
    motion: Motion, solution: dmoc.Solution, sizes: Sizes, e: list[float]
) -> tuple[float, list[str]]:
    """Largest error of a simulation over a tenth of a phase, from the motion's own nodes, and
    impacts that were not planned."""
    mechanism: Any = motion.mechanism
    worst, told = 0.0, list[str]()
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
            told += [f"an impact on {s} at {t:.4g} s was not planned" for s, t in run.impacts]
            worst = max(worst, _distance(motion, run.q, run.v, p["q"][b], p["v"][b], p["t"][b]))
    return worst, told


def _events(
    motion: Motion, solution: dmoc.Solution, sizes: Sizes, e: list[float]
) -> tuple[float, float, list[str]]:
    """Largest difference of the velocity after an event, and of an impulse, to the nearest outcome
    that the laws allow."""
    mechanism: Any = motion.mechanism
    worst = impulse = 0.0
    told = list[str]()
    most = max(
        (max(c.impulses.values(), default=c.impulse) for c in solution.collisions), default=0
    )
    for i, c in enumerate(solution.collisions):
        before, after = motion.phases[i], motion.phases[i + 1]
        q, v, t = before["q"][-1], before["v"][-1], float(before["t"][-1])
        hit = [mechanism.surfaces.index(s) for s in dict.fromkeys((c.surface, *c.lands)) if s]
        if not hit:
            jump = motion.length(q, t, after["v"][0] - v) / motion.speed
            worst = max(worst, jump)
            continue
        gaps = np.abs(mechanism.gap_motion(q, v, t, motion.par)[0][hit]) / sizes.gap[hit]
        if gaps.max() > 1e-6:
            told.append(f"{c.word} is {gaps.max():.2g} off its surface")
        u = before["inputs"][2][-1]
        passed = _passed(mechanism, solution, i) - set(hit)
        elastic = [0.0 if s in c.lands else r for s, r in zip(mechanism.surfaces, e, strict=True)]
        outcomes = list(mechanism.impacts(hit, q, v, u, t, motion.par, sizes, elastic, passed))
        if not outcomes:
            told.append(f"no law gives an outcome of {c.word}")
            continue
        errors = [motion.length(q, t, after["v"][0] - o.motion) / motion.speed for o in outcomes]
        nearest = outcomes[int(np.argmin(errors))]
        worst = max(worst, min(errors))
        given = {c.surface: c.impulse, **c.impulses} if c.surface else dict(c.impulses)
        for j, name in enumerate(mechanism.surfaces):
            impulse = max(
                impulse, abs(given.get(name, 0.0) - nearest.normal[j]) / max(most, 1e-300)
            )
        for k, name in enumerate(mechanism.tangents):
            error = abs(c.tractions.get(name, 0.0) - nearest.tangential[k]) / max(most, 1e-300)
            impulse = max(impulse, error)
    return worst, impulse, told


def _forces(motion: Motion, solution: dmoc.Solution, sizes: Sizes) -> tuple[float, list[str]]:
    """Largest difference of a contact or friction force at a node to the consistent one."""
    mechanism: Any = motion.mechanism
    most = [
        max(float(np.abs(getattr(p, name)).max(initial=0.0)) for p in solution.phases)
        for name in ("normal", "tangential")
    ]
    worst, told = 0.0, list[str]()
    for i, (p, phase) in enumerate(zip(motion.phases, solution.phases, strict=True)):
        passed = _passed(mechanism, solution, i)
        for k in range(EDGE, len(p["t"]) - EDGE):
            try:
                found = mechanism.forces(
                    p["q"][k], p["v"][k], p["inputs"][1][k], p["t"][k], motion.par, sizes,
                    passed=passed,
                )  # fmt: skip
            except ArithmeticError as error:
                told.append(str(error))
                continue
            normal = dict(zip(phase.closed, phase.normal[k] if phase.closed else (), strict=True))
            rubbing = phase.tangential[k] if phase.rubbing else ()
            tangential = dict(zip(phase.rubbing, rubbing, strict=True))
            for size, planned, names, forces in (
                (most[0], normal, mechanism.surfaces, found.normal),
                (most[1], tangential, mechanism.tangents, found.tangential),
            ):
                for name, force in zip(names, forces, strict=True):
                    error = abs(planned.get(name, 0.0) - force)
                    worst = max(worst, error / max(size, LEAST * max(most), 1e-300))
    return worst, told[:3]


def _boundary(motion: Motion, problem: Mapping[str, Any], solution: dmoc.Solution) -> float:
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
    for state, given in zip(ends, (problem["start"], problem["goal"]), strict=True):
        for name, value in given.items():
            low, high = value if isinstance(value, tuple) else (value, value)
            low, high = (-np.inf if low is None else low), (np.inf if high is None else high)
            worst = max(worst, (low - state[name]) / size[name], (state[name] - high) / size[name])
    for name, source in problem.get("periodic", {}).items():
        start, difference = source if isinstance(source, tuple) else (source, 0.0)
        if difference is not None:
            error = abs(ends[1][name] - ends[0][start] - difference)
            worst = max(worst, error / size[name])
    return worst


def _path(motion: Motion, instance: Instance) -> float:
    """Largest violation of a path constraint at a node, relative to its largest value."""
    import sympy as sp

    d, worst = instance.description, 0.0
    for relation in d.path_constraints.values():
        value = sp.lambdify([*d.coordinates], relation.lts - relation.gts)
        values = np.array([value(*q) for p in motion.phases for q in p["q"]])
        worst = max(worst, float(values.max() / np.abs(values).max()))
    return worst


def _cost(motion: Motion, solution: dmoc.Solution) -> float:
    """Difference of the cost to the integral of u^2 / 2 over inputs linear in each step, or, where
    there is no input, to the time."""
    total = 0.0
    for p in motion.phases:
        t, a, b = p["inputs"]
        total += float((np.diff(t)[:, None] * (a**2 + b**2)).sum()) / 4
    if not solution.trajectory.inputs:
        total = solution.final_time
    return abs(solution.cost - total) / max(abs(total), 1e-300)


# Report -------------------------------------------------------------------------------------------

TEXT = """{problems} random problems of {kinds} kinds (seed {seed}), {steps} steps a phase, by `ipm`
with the sequence given: {judged} `solved` or `grazes`, {confirmed} of them confirmed,
{contradicted} contradicted, {broken} tracebacks.

The judge (`benchmarks/contact_driven.py`) is told no mode: from the motion's own nodes it looks for
consistent contact and friction forces, follows them through lift-off, sticking and sliding, and
compares impacts with the nearest outcome of Newton's law without friction, of Poisson's law for one
contact with friction, or of plastic impacts of several. An answer is confirmed if no error exceeds:
{limits}. `doubted` are answers with the status `not_verified` that the judge finds right."""


def rows(results: list[Result]) -> Iterator[list[Any]]:
    """A line of the table for each kind."""
    for kind in KINDS:
        own = [r for r in results if r.kind == kind]
        judged = [r for r in own if r.status in VOUCHED]
        bad = sum(bool(r.against) for r in judged)
        doubted = sum(r.status == "not_verified" and not r.against for r in own)
        ends = Counter(str(r.status).split(":")[0] for r in own).most_common()
        worst = [max((r.errors[c] for r in judged if c in r.errors), default=None) for c in COLUMNS]
        shown = ("-" if w is None else f"{w:.1e}" for w in worst)
        told = ", ".join(f"{n} {s}" for s, n in ends)
        yield [kind, len(own), told, len(judged) - bad, bad, doubted, *shown]


def section(results: list[Result], problems: int) -> Section:
    judged = [r for r in results if r.status in VOUCHED]
    wrong = wrong_ones(results)
    contradicted = sum(bool(r.against) for r in judged)
    text = TEXT.format(
        problems=problems,
        kinds=len(KINDS),
        seed=SEED,
        steps=STEPS,
        judged=len(judged),
        confirmed=len(judged) - contradicted,
        contradicted=contradicted,
        broken=sum(r.status == "traceback" for r in results),
        limits=", ".join(f"{name} {value:g}" for name, value in MOST.items()),
    )
    header = ["kind", "solves", "statuses", "confirmed", "contradicted", "doubted", *COLUMNS]
    lines = [f"- {r.kind}, problem {r.number}, {r.status}: {'; '.join(r.against)}" for r in wrong]
    after = "\n".join(["Contradicted:", "", *lines]) if lines else ""
    return Section(
        "Campaign: contacts and friction under another simulation",
        text,
        header,
        list(rows(results)),
        after,
    )


def judged_by_simulation(problems: int) -> list[Result]:
    groups = [list(range(k, problems, len(KINDS))) for k in reversed(range(len(KINDS)))]
    with ProcessPoolExecutor(max_workers=os.cpu_count()) as pool:
        results = [r for part in pool.map(run_group, groups) for r in part]
    return sorted(results, key=lambda r: (list(KINDS).index(r.kind), r.number))


def campaign(quick: bool) -> Section:
    problems = len(KINDS) if quick else PROBLEMS
    return section(judged_by_simulation(problems), problems)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--problems", type=int, default=PROBLEMS)
    parser.add_argument("--verbose", action="store_true", help="a line for each problem")
    given = parser.parse_args()
    results = judged_by_simulation(given.problems)
    if given.verbose:
        for r in results:
            errors = ", ".join(f"{n} {x:.1e}" for n, x in r.errors.items())
            sys.stdout.write(f"{r.kind} {r.number} {r.status}: {'; '.join(r.against)} [{errors}]\n")
    sys.stdout.write(section(results, given.problems).markdown())
    return int(bool(wrong_ones(results)))


if __name__ == "__main__":
    sys.exit(main())
