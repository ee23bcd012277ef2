"""Random problems of nine kinds, solved as a user would and judged by an event-driven simulation
that shares no code with dmoc.

Run:  python benchmarks/campaign.py [--problems 200]

Prints a table by kind, which `make bench` writes into its report; the exit status is 1 if any
answer with the status `solved` or `grazes` is contradicted.
"""

from __future__ import annotations

import argparse
import os
import sys
import traceback
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from campaign_kinds import KINDS, Instance
from common import Section
from event_driven import Mechanism

import dmoc

SEED = 2018
PROBLEMS = 200
SECONDS = 10.0  # of a solve
VOUCHED = ("solved", "grazes")  # statuses that say: this motion is right
SLSQP_SHARE = 5  # every fifth problem is solved by slsqp too
STEPS = {2: 40, 4: 20}
SEGMENTS = 10  # of a phase
# What an answer may miss and still be confirmed; the discretisation errs by some 1e-3 with so many
# steps.
MOST = {
    # of the motion's extent and speed, in the metric of the mass matrix, over a tenth of a phase
    "segment": 0.02,
    "law": 0.05,  # of the speed of approach
    "impulse": 0.05,  # of (1 + e) w / (n . M^-1 n)
    "gap": 1e-6,  # at a collision, of the gap's range
    "limit": 1e-6,  # of the range of an input, between nodes
    "penetration": 0.01,  # of the range of the gap
    "boundary": 1e-6,  # of the motion's range
    "window": 0.03,  # like segment, through the collision
    "cost": 1e-6,  # of the integral of the inputs
    "excess": 0.03,  # over the known optimum
}
# Speed of approach, relative to the motion's largest one in the same metric,
# below which a collision has no effect.
NO_EFFECT = 0.01
# the same for an impact that was not planned: a motion that cuts a surface between two nodes hits
# it
UNPLANNED = 0.02
SAME_TIME = (
    0.02  # of the final time; what is hit so shortly before the end changes nothing on the way
)


@dataclass
class Result:
    """One solve: how it ended, the worst of each error, and what contradicts it."""

    kind: str
    number: int
    order: int
    method: str
    status: str
    errors: dict[str, float] = field(default_factory=dict)
    against: list[str] = field(default_factory=list)


def draw(number: int) -> tuple[str, int, Instance]:
    """Kind, order and instance of a problem: they depend on the number alone."""
    names = list(KINDS)
    name = names[number % len(names)]
    order = 2 if number // len(names) % 2 == 0 else 4
    return name, order, KINDS[name](np.random.default_rng([SEED, number]))


def run_group(numbers: list[int]) -> list[Result]:
    """Problems of one model and order: the kernels and the equations of motion are made once."""
    made: dict[tuple[str, int], tuple[Any, Mechanism]] = {}
    results = []
    for number in numbers:
        kind, order, instance = draw(number)
        name = instance.description.name
        if (name, order) not in made:
            made[name, order] = (
                dmoc.build(system_of(instance), order=order),
                Mechanism(instance.description),
            )
        kernels, mechanism = made[name, order]
        for method in ("ipm", "slsqp") if number // len(KINDS) % SLSQP_SHARE == 0 else ("ipm",):
            results.append(_solved(kind, number, order, method, instance, kernels, mechanism))
    return results


def system_of(instance: Instance) -> dmoc.MechanicalSystem:
    d = instance.description
    return dmoc.MechanicalSystem(
        d.name,
        coordinates=d.coordinates,
        inputs=d.inputs,
        lagrangian=d.lagrangian,
        forces=d.forces,
        surfaces=d.surfaces,
        tangents=d.tangents,
        friction=d.friction,
        path_constraints=d.path_constraints,
        parameters=d.parameters,
        cost=sum(u**2 for u in d.inputs) / 2 if d.inputs else 1,
    )


def _solved(
    kind: str,
    number: int,
    order: int,
    method: str,
    instance: Instance,
    kernels: Any,
    mechanism: Mechanism,
) -> Result:
    result = Result(kind, number, order, method, "")
    try:
        problem = dmoc.Problem(kernels, steps=STEPS[order], **instance.problem)
        solution = dmoc.solve(problem, method, seconds=SECONDS)
    except dmoc.DmocError as error:
        result.status = f"refused: {error}"
        return result
    except Exception:  # a traceback is a finding, and the other problems go on
        result.status, result.against = (
            "traceback",
            [traceback.format_exc().strip().splitlines()[-1]],
        )
        return result
    result.status = solution.status
    if solution.status in (*VOUCHED, "not_verified"):
        judge(result, instance, solution, mechanism)
    return result


@dataclass(frozen=True)
class Motion:
    """A solution as plain arrays, with the velocities that the judge finds from the momenta."""

    mechanism: Mechanism
    par: np.ndarray
    phases: list[dict[str, Any]]
    extent: float
    speed: float
    gap_ranges: np.ndarray

    def length(self, q: np.ndarray, t: float, a: np.ndarray) -> float:
        """Length of a vector of coordinates or velocities in the metric of the mass matrix."""
        M = self.mechanism.motion(
            q, np.zeros(len(q)), np.zeros(self.phases[0]["inputs"][1].shape[1]), t, self.par
        )[0]
        return float(np.sqrt(max(a @ M @ a, 0.0)))


def read(solution: dmoc.Solution, mechanism: Mechanism) -> Motion:
    par = np.array(list(solution.trajectory.parameters.values()))
    phases = []
    for p in solution.trajectory.phases:
        first, last = solution.trajectory.input_ends(p)
        u = np.vstack([first, last[-1:]])
        v = np.array([mechanism.velocity(*row, par) for row in zip(p.q, p.p, u, p.t, strict=True)])
        phases.append(
            {"t": p.t, "q": p.q, "v": v, "inputs": (p.t, np.asarray(first), np.asarray(last))}
        )
    gaps = np.array(
        [mechanism.gaps(q, t, par) for p in phases for q, t in zip(p["q"], p["t"], strict=True)]
    )
    bare = Motion(mechanism, par, phases, 1.0, 1.0, np.ptp(gaps, axis=0))
    middle = np.vstack([p["q"] for p in phases]).mean(axis=0)
    rows = [(q, t, v) for p in phases for q, t, v in zip(p["q"], p["t"], p["v"], strict=True)]
    extent = max(bare.length(q, t, q - middle) for q, t, _ in rows)
    speed = max(bare.length(q, t, v) for q, t, v in rows)
    return Motion(mechanism, par, phases, extent, speed, bare.gap_ranges)


def judge(
    result: Result, instance: Instance, solution: dmoc.Solution, mechanism: Mechanism
) -> None:
    motion = read(solution, mechanism)
    e = [float(solution.trajectory.restitution[s]) for s in mechanism.surfaces]
    worst = result.errors
    worst["segment"], deepest, unplanned = _segments(motion, solution, e)
    result.against += unplanned
    worst["penetration"] = max(deepest, 0.0) / float(motion.gap_ranges.max())
    worst["limit"] = _limits(motion, instance, solution)
    worst["boundary"] = _boundary(motion, instance, solution)
    worst["cost"] = _cost(motion, solution)
    if instance.known_cost is not None:
        worst["excess"] = solution.cost / instance.known_cost - 1
    for i, collision in enumerate(solution.collisions):
        _collision(result, motion, i, collision, e)
    result.against += [
        f"{name} {value:.2g}"
        for name, value in worst.items()
        if name in MOST and not value <= MOST[name]
    ]


def _segments(
    motion: Motion, solution: dmoc.Solution, e: list[float]
) -> tuple[float, float, list[str]]:
    """Largest error of a free flight over a tenth of a phase, the largest gap on the way, and
    impacts that were not planned."""
    worst, deepest, unplanned = 0.0, -np.inf, list[str]()
    final = float(motion.phases[-1]["t"][-1])
    for i, p in enumerate(motion.phases):
        planned = solution.collisions[i].surface if i < len(solution.collisions) else ""
        ends = np.unique(np.linspace(0, len(p["t"]) - 1, SEGMENTS + 1).round().astype(int))
        for a, b in pairwise(ends):
            flight = partial(
                motion.mechanism.fly,
                p["inputs"],
                p["t"][a],
                p["t"][b],
                p["q"][a],
                p["v"][a],
                motion.par,
            )
            free = flight()
            worst = max(worst, _distance(motion, free.q, free.v, p["q"][b], p["v"][b], p["t"][b]))
            deepest = max(deepest, free.deepest)
            if free.deepest <= 0:
                continue
            for met in flight(e, UNPLANNED * motion.speed).impacts:
                close = met.time > p["t"][-1] - SAME_TIME * final
                if not (close and (met.surface == planned or not planned)):
                    unplanned.append(
                        f"an impact on {met.surface} at {met.time:.4g} s was not planned"
                    )
    return worst, deepest, unplanned


def _distance(
    motion: Motion, q: np.ndarray, v: np.ndarray, q_goal: np.ndarray, v_goal: np.ndarray, t: float
) -> float:
    place = motion.length(q_goal, t, q - q_goal) / motion.extent
    return max(place, motion.length(q_goal, t, v - v_goal) / motion.speed)


def _limits(motion: Motion, instance: Instance, solution: dmoc.Solution) -> float:
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


def _boundary(motion: Motion, instance: Instance, solution: dmoc.Solution) -> float:
    """Largest error of a fixed position or velocity at the start or goal."""
    worst = 0.0
    first, last = motion.phases[0], motion.phases[-1]
    for given, q, v, t in (
        (instance.problem["start"], first["q"][0], first["v"][0], first["t"][0]),
        (instance.problem["goal"], last["q"][-1], last["v"][-1], last["t"][-1]),
    ):
        names = solution.trajectory.coordinates
        dq = np.array(
            [
                q[i] - given[n] if np.ndim(given.get(n, ())) == 0 else 0.0
                for i, n in enumerate(names)
            ]
        )
        rest = 0.0 if given is instance.problem["start"] else ()
        dv = np.array(
            [
                v[i] - w if np.ndim(w := given.get(f"{n}_dot", rest)) == 0 else 0.0
                for i, n in enumerate(names)
            ]
        )
        worst = max(
            worst, motion.length(q, t, dq) / motion.extent, motion.length(q, t, dv) / motion.speed
        )
    return worst


def _cost(motion: Motion, solution: dmoc.Solution) -> float:
    """Difference of the cost to the integral of u^2 / 2 over inputs linear in each step."""
    total = 0.0
    for p in motion.phases:
        t, a, b = p["inputs"]
        total += float((np.diff(t)[:, None] * (a**2 + a * b + b**2)).sum()) / 6
    return abs(solution.cost - total) / max(abs(total), 1e-300)


def _collision(result: Result, motion: Motion, i: int, collision: Any, e: list[float]) -> None:
    """The law of impact at a planned collision, and a simulation from the segment before it to
    the segment after it."""
    before, after = motion.phases[i], motion.phases[i + 1]
    j, t, q = motion.mechanism.surfaces.index(collision.surface), before["t"][-1], before["q"][-1]
    _, w = motion.mechanism.approach(j, q, before["v"][-1], t, motion.par)
    n, w_plus = motion.mechanism.approach(j, q, after["v"][0], t, motion.par)
    M = motion.mechanism.motion(q, before["v"][-1], before["inputs"][2][-1], t, motion.par)[0]
    mobility = float(n @ np.linalg.solve(M, n))
    # The largest speed of approach that the kinetic energy allows.
    speed = np.sqrt(mobility) * motion.speed
    wanted = (1 + e[j]) * w / mobility
    worst = result.errors
    worst["gap"] = max(
        worst.get("gap", 0.0),
        abs(float(motion.mechanism.gaps(q, t, motion.par)[j])) / float(motion.gap_ranges[j]),
    )
    if (
        abs(w) < NO_EFFECT * speed
        and abs(collision.impulse) * np.sqrt(mobility) < NO_EFFECT * motion.speed
    ):
        worst["without effect"] = worst.get("without effect", 0) + 1
        if result.status == "solved":
            result.against.append(f"collision {i} has no effect")
        return
    if w < 0:
        result.against.append(f"collision {i} departs before it hits")
    worst["law"] = max(
        worst.get("law", 0.0), abs(w_plus + e[j] * w) / max(abs(w), NO_EFFECT * speed)
    )
    worst["impulse"] = max(
        worst.get("impulse", 0.0),
        abs(collision.impulse - wanted)
        / max(abs(wanted), NO_EFFECT * motion.speed / np.sqrt(mobility)),
    )
    _window(result, motion, i, collision, e, NO_EFFECT * motion.speed)


def _window(
    result: Result, motion: Motion, i: int, collision: Any, e: list[float], least: float
) -> None:
    before, after = motion.phases[i], motion.phases[i + 1]
    a, b = (
        len(before["t"]) - 1 - (len(before["t"]) - 1) // SEGMENTS,
        (len(after["t"]) - 1) // SEGMENTS,
    )
    inputs = tuple(
        np.concatenate([x[:-1] if k == 0 else x, y])
        for k, (x, y) in enumerate(zip(before["inputs"], after["inputs"], strict=True))
    )
    flight = motion.mechanism.fly(
        inputs, before["t"][a], after["t"][b], before["q"][a], before["v"][a], motion.par, e, least
    )  # type: ignore[arg-type]
    met = [m for m in flight.impacts if m.surface == collision.surface]
    if not met:
        result.against.append(f"the simulation misses collision {i}")
        return
    if len(flight.impacts) > 1:
        result.against.append(
            f"the simulation meets {len(flight.impacts)} impacts at collision {i}"
        )
    if abs(met[0].time - collision.time) > SAME_TIME * motion.phases[-1]["t"][-1]:
        result.against.append(f"collision {i} comes {abs(met[0].time - collision.time):.2g} s off")
    error = _distance(motion, flight.q, flight.v, after["q"][b], after["v"][b], after["t"][b])
    result.errors["window"] = max(result.errors.get("window", 0.0), error)


# Report -------------------------------------------------------------------------------------------


def groups(problems: int) -> Iterator[list[int]]:
    """Problems by model and order, the largest models first."""
    chosen: dict[tuple[int, str, int], list[int]] = {}
    for number in range(problems):
        _, order, instance = draw(number)
        key = (-order * len(instance.description.coordinates), instance.description.name, order)
        chosen.setdefault(key, []).append(number)
    yield from (chosen[key] for key in sorted(chosen))


COLUMNS = (
    "law",
    "impulse",
    "limit",
    "penetration",
    "segment",
    "window",
    "boundary",
    "cost",
    "excess",
)


def rows(results: list[Result]) -> Iterator[list[Any]]:
    """A line of the table for each kind and method."""
    for kind in KINDS:
        for method in ("ipm", "slsqp"):
            own = [r for r in results if (r.kind, r.method) == (kind, method)]
            if not own:
                continue
            judged = [r for r in own if r.status in VOUCHED]
            bad = sum(bool(r.against) for r in judged)
            doubted = sum(r.status == "not_verified" and not r.against for r in own)
            ends = ", ".join(
                f"{n} {s}" for s, n in Counter(r.status.split(":")[0] for r in own).most_common()
            )
            worst = [
                max((r.errors[c] for r in judged if c in r.errors), default=None) for c in COLUMNS
            ]
            shown = ("-" if w is None else f"{w:.1e}" for w in worst)
            yield [kind, method, len(own), ends, len(judged) - bad, bad, doubted, *shown]


TEXT = """{problems} random problems of {kinds} kinds (seed {seed}), restitution 1, 0.8, 0.5 and
0, orders 2 and 4 in turn with {coarse} and {fine} steps a phase, by `ipm`, and every {share}th of
a kind by `slsqp` too, as a user would solve them: {solves} solves, {judged} of them `solved` or
`grazes`, {confirmed} confirmed, {contradicted} contradicted, {broken} ended in a traceback.

The judge is an event-driven simulation with equations of motion of its own
(`benchmarks/event_driven.py`). An answer is confirmed if no error exceeds: {limits}.

Segments (tenths of a phase) and windows (from a tenth before a collision to a tenth after it) are
simulated from the motion's own nodes; their errors are measured in the metric of the mass matrix.
No segment may meet an impact that was not planned. `excess` is the cost above the optimum, for
the kind where it is known. A collision whose approach is below {effect:g} of the motion's speed
has no effect, and `solved` must not count it as one.
`doubted` are answers with the status `not_verified` that the judge finds right. The columns after
it show the worst of all answers that are `solved` or `grazes`."""


def wrong_ones(results: list[Result]) -> list[Result]:
    """Answers that are vouched for and contradicted, and tracebacks."""
    return [r for r in results if r.against and r.status != "not_verified"]


def section(results: list[Result], problems: int) -> Section:
    judged = [r for r in results if r.status in VOUCHED]
    contradicted = sum(bool(r.against) for r in judged)
    wrong = [
        f"- {r.kind}, problem {r.number}, order {r.order}, {r.method}, {r.status}: "
        f"{'; '.join(r.against)}"
        for r in wrong_ones(results)
    ]
    text = TEXT.format(
        problems=problems,
        kinds=len(KINDS),
        seed=SEED,
        coarse=STEPS[2],
        fine=STEPS[4],
        share=SLSQP_SHARE,
        solves=len(results),
        judged=len(judged),
        confirmed=len(judged) - contradicted,
        contradicted=contradicted,
        effect=NO_EFFECT,
        broken=sum(r.status == "traceback" for r in results),
        limits=", ".join(f"{name} {value:g}" for name, value in MOST.items()),
    )
    header = [
        "kind",
        "method",
        "solves",
        "statuses",
        "confirmed",
        "contradicted",
        "doubted",
        *COLUMNS,
    ]
    after = "\n".join(["Contradicted:", "", *wrong]) if wrong else ""
    return Section(
        "Campaign: random problems under another simulation",
        text,
        header,
        list(rows(results)),
        after,
    )


def judged_by_simulation(problems: int) -> list[Result]:
    with ProcessPoolExecutor(max_workers=os.cpu_count()) as pool:
        results = [r for part in pool.map(run_group, groups(problems)) for r in part]
    return sorted(results, key=lambda r: (list(KINDS).index(r.kind), r.method, r.number))


def campaign(quick: bool) -> Section:
    problems = 2 * len(KINDS) if quick else PROBLEMS
    return section(judged_by_simulation(problems), problems)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--problems", type=int, default=PROBLEMS)
    given = parser.parse_args()
    results = judged_by_simulation(given.problems)
    sys.stdout.write(section(results, given.problems).markdown())
    return int(bool(wrong_ones(results)))


if __name__ == "__main__":
    sys.exit(main())
