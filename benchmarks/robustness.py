"""Random instances of the reference problem: how often, how soon and how cheaply each driver ends,
from the same guess."""

from __future__ import annotations

import os
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from statistics import mean, median
from typing import Any

import casadi_pendulum
import numpy as np
from common import (
    ITERATIONS,
    Options,
    Section,
    Status,
    casadi_sizes,
    casadi_start,
    from_casadi,
    guess,
    ms,
    program,
    refined,
    seed,
    simulated,
    solve,
)
from common import cost as own_cost
from threadpoolctl import threadpool_limits

import dmoc
from dmoc.base.deadline import Deadline

SEED = 2018
INSTANCES = 200
SECONDS = 20.0
# Uniformly drawn: masses, length, start angle (rad), force bound (N), bound of the final time (s).
RANGES = {
    "m_p": (0.5, 2.0), "m_c": (0.5, 2.0), "l": (0.4, 0.8), "alpha": (0.4, 1.2), "F": (60.0, 200.0),
    "T": (0.7, 1.2),
}  # fmt: skip
METHODS = {
    "ipm": INSTANCES,
    "ipopt": INSTANCES,
    "CasADi + IPOPT": INSTANCES,
    "CasADi + IPOPT, scaled as dmoc": INSTANCES,
    "slsqp": INSTANCES,
    "uno": 40,
}  # uno takes seconds an instance
FINER = (4, 16)  # times the steps, where the simulation contradicts a motion
CLOSE = 0.1  # relative change of the cost by a refinement that is still the same motion
SAME = 1e-5  # relative difference of two costs that are the same minimum


@dataclass(frozen=True)
class Trial:
    instance: int
    method: str
    status: str
    verified: bool
    iterations: int
    seconds: float
    cost: float


def draw(instance: int) -> dict[str, float]:
    rng = np.random.default_rng([SEED, instance])
    return {name: float(rng.uniform(*limits)) for name, limits in RANGES.items()}


def problem(instance: int) -> dmoc.Problem:
    d = draw(instance)
    base = seed()
    return base.but(
        parameters={k: d[k] for k in ("m_p", "m_c", "l")},
        start={**base.start, "alpha": d["alpha"]},
        final_time=(None, d["T"]),
        bounds={**base.bounds, "F": (-d["F"], d["F"])},
    )


def run(task: tuple[int, str]) -> Trial:
    """Solve one instance with one method and confirm a success by simulation."""
    instance, method = task
    p = problem(instance)
    with threadpool_limits(1):
        x = guess(p)
        if method.startswith("CasADi"):
            return _peer(instance, method, p, x)
        nlp = program(p, x, method)
        seconds, outcome = solve(
            nlp, x, method, Options(iterations=ITERATIONS, deadline=Deadline.after(SECONDS))
        )
        solved = outcome.status is Status.SOLVED
        passed = solved and confirmed(p, nlp.physical(outcome.x))
        return Trial(
            instance, method, outcome.status.name.lower(), passed, outcome.iterations, seconds,
            own_cost(nlp, outcome),
        )  # fmt: skip


def confirmed(p: dmoc.Problem, x: np.ndarray) -> bool:
    """Whether the independent simulation passes, if need be after refining the same motion to 4 and
    16 times the steps.

    An inverted pendulum amplifies the error of an open-loop run a thousandfold: what fails at N =
    100 may be a good motion all the same.
    """
    coarse = program(p, x)
    if simulated(coarse, x):
        return True
    paid = coarse.cost(coarse.scaled(x)) * coarse.scale.cost
    for factor in FINER:
        fine, start = refined(coarse, x, factor)
        _, outcome = solve(
            fine, start, "ipm", Options(iterations=300, deadline=Deadline.after(SECONDS))
        )
        near = outcome.status is Status.SOLVED and abs(
            own_cost(fine, outcome) - paid
        ) < CLOSE * own_cost(fine, outcome)
        if near and simulated(fine, fine.physical(outcome.x)):
            return True
    return False


def _peer(instance: int, method: str, p: dmoc.Problem, x: np.ndarray) -> Trial:
    d = draw(instance)
    case = casadi_pendulum.PendulumCase(
        d["m_p"], d["m_c"], d["l"], alpha=d["alpha"], force=d["F"], final_time=d["T"]
    )
    nlp = program(p, x)
    sizes = casadi_pendulum.ProgramSizes(*casadi_sizes(nlp)) if "scaled" in method else None
    peer = casadi_pendulum.program(case, sizes=sizes, max_cpu_time=SECONDS)
    seconds, cost, iterations, status, _, y = peer.solve(peer.start(*casadi_start(nlp, x)))
    solved = status == "Solve_Succeeded"
    passed = solved and confirmed(p, from_casadi(nlp, x, y))
    return Trial(
        instance, method, "solved" if solved else status.lower(), passed, iterations,
        seconds, cost,
    )  # fmt: skip


def compare(quick: bool) -> Section:
    instances = 20 if quick else INSTANCES
    methods = {
        m: min(n, instances) for m, n in METHODS.items() if not quick or m in ("ipm", "ipopt")
    }
    tasks = [(i, m) for m, n in methods.items() for i in range(n)]
    with ProcessPoolExecutor(max_workers=os.cpu_count()) as pool:
        results = list(pool.map(run, tasks, chunksize=2))
    by = {(r.instance, r.method): r for r in results}
    costs = {
        i: [r.cost for r in results if r.instance == i and r.status == "solved"]
        for i in range(instances)
    }
    ranges = ", ".join(f"{name} {low:g} to {high:g}" for name, (low, high) in RANGES.items())
    section = Section(
        f"Robustness: {instances} random instances",
        f"N = 100 + 100, one collision on one limiter; drawn uniformly (seed {SEED}): "
        f"{ranges}. One start each, the first automatic guess, at most {ITERATIONS} iterations and "
        f"{SECONDS:g} s; as many processes as cores. Confirmed: the independent simulation passes, "
        "where N is too coarse for it after refining the same motion to "
        f"{' or '.join(map(str, FINER))} times the steps. Best: no other driver found a lower "
        "minimum.",
        [
            "method", "solved", "confirmed", "best", "iterations, mean", "median",
            "ms, mean of solved", "median", "not solved",
        ],
    )  # fmt: skip
    for method, count in methods.items():
        own = [by[i, method] for i in range(count)]
        good = [r for r in own if r.status == "solved"]
        best = sum(r.cost <= min(costs[r.instance]) * (1 + SAME) for r in good)
        ends: Any = (
            ", ".join(
                f"{n} {s}"
                for s, n in Counter(r.status for r in own if r.status != "solved").items()
            )
            or "-"
        )
        numbers = ["-"] * 4
        if good:
            numbers = [
                f"{mean(r.iterations for r in good):.1f}",
                f"{median(r.iterations for r in good):g}",
                ms(mean(r.seconds for r in good)),
                ms(median(r.seconds for r in good)),
            ]
        section.row(
            method, f"{len(good)}/{count}", sum(r.verified for r in good), best, *numbers, ends
        )
    return section
