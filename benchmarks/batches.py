"""Many instances of one problem at once: solves a second, beside CasADi and IPOPT in as many
processes as there are processors."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from typing import Any

import casadi_pendulum
import numpy as np
from common import Section, casadi_start, clocked, ratio, seed
from ladder_casadi import transcribed
from ladder_smooth import quadrotor

import dmoc

PEER = "CasADi + IPOPT"
SECONDS = 20.0  # of one solve of the peer at most
SEED = 2018
SOLVED = "Solve_Succeeded"  # as CasADi says it
# A start in the neighbouring minimum, as IPOPT's manual advises.
NEAR = {
    "tol": 1e-8, "warm_start_init_point": "yes", "mu_init": 1e-5,
    "warm_start_bound_push": 1e-8, "warm_start_mult_bound_push": 1e-8,
}  # fmt: skip
# Numbers of an instance, relative to those of the nominal problem.
Instance = tuple[float, ...]
Peer = Callable[[Instance], bool]

PENDULUM, QUADROTOR = "cart-pendulum, one hit", "planar quadrotor"
STEPS = {PENDULUM: 100, QUADROTOR: 200}


def instances(count: int) -> list[Instance]:
    """Three numbers within 2 % of one for each instance."""
    numbers = 1 + 0.02 * np.random.default_rng(SEED).uniform(-1, 1, (count, 3))
    return [tuple(row) for row in numbers.tolist()]


# The same instances for both: start angle, limit of the force and of the time; distance, height
# and largest thrust.


def nominal(name: str) -> dmoc.Problem:
    if name == PENDULUM:
        return seed(steps=STEPS[name])
    statement = quadrotor()
    return dmoc.Problem(statement.system, **{**statement.data, "steps": STEPS[name]})


def varied(name: str, base: dmoc.Problem, instance: Instance) -> dmoc.Problem:
    a, b, c = instance
    if name == PENDULUM:
        return base.but(
            start={**base.start, "alpha": a * base.start["alpha"]},
            bounds={**base.bounds, "F": (-200.0 * b, 200.0 * b)}, final_time=(None, c),
        )  # fmt: skip
    return base.but(
        goal={**base.goal, "y": 5.0 * a, "z": 2.5 * b}, bounds={"thrust": (0.0, 45.9 * c)}
    )


def peer_pendulum() -> Peer:
    """CasADi's program with the minimum of the nominal problem, in this process."""
    base = nominal(PENDULUM)
    case = casadi_pendulum.PendulumCase(alpha=base.start["alpha"], steps=STEPS[PENDULUM])
    built = casadi_pendulum.program(case, **NEAR)
    nlp, x = _first(base)
    minimum = built.solver(x0=built.start(*casadi_start(nlp, x)), **built.bounds)
    n, q = 2 * STEPS[PENDULUM], 2
    first, inputs = q, q + 2 * (n + 1)  # of the angle at the start, and of the forces

    def solve(instance: Instance) -> bool:
        a, b, c = instance
        bounds = {key: value.copy() for key, value in built.bounds.items()}
        for key, sign in (("lbx", -1.0), ("ubx", 1.0)):
            bounds[key][first] = a * case.alpha
            bounds[key][inputs : inputs + n] = sign * b * case.force
        bounds["lbx"][:q] = 1e-3 * c
        bounds["ubg"][-1] = c
        built.solver(x0=minimum["x"], lam_x0=minimum["lam_x"], lam_g0=minimum["lam_g"], **bounds)
        return str(built.solver.stats()["return_status"]) == SOLVED

    return solve


def _first(base: dmoc.Problem) -> tuple[Any, np.ndarray]:
    from common import guess, program

    x = guess(base)
    return program(base, x), x


def peer_quadrotor() -> Peer:
    statement, base = quadrotor(), nominal(QUADROTOR)
    solver = transcribed(statement, base, SECONDS, **NEAR)
    _, minimum = solver.solve()
    thrust = solver.bounds["ubx"] == 45.9

    def solve(instance: Instance) -> bool:
        a, b, c = instance
        bounds = {key: value.copy() for key, value in solver.bounds.items()}
        bounds["ubx"][thrust] = 45.9 * c
        for key in ("lbg", "ubg"):  # y, z and their rates are the last rows
            bounds[key][-4:-2] = 5.0 * a, 2.5 * b
        status, _ = solver.solve(
            x0=minimum["x"], lam_x0=minimum["lam_x"], lam_g0=minimum["lam_g"], **bounds
        )
        return status == SOLVED

    return solve


PEERS: dict[str, Callable[[], Peer]] = {PENDULUM: peer_pendulum, QUADROTOR: peer_quadrotor}
_peer: dict[str, Peer] = {}  # that of this process


def _prepare(name: str) -> None:
    _peer[name] = PEERS[name]()


def _solve(name: str, instance: Instance) -> bool:
    return _peer[name](instance)


def by_peer(name: str, every: Sequence[Instance], cores: int) -> tuple[float, int]:
    """Seconds of all solves, without building the programs, and how many succeeded."""
    fresh = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(cores, fresh, _prepare, (name,)) as pool:
        list(pool.map(partial(_solve, name), every[:cores] * 4))  # builds the programs
        seconds, good = clocked(lambda: list(pool.map(partial(_solve, name), every, chunksize=8)))
    return seconds, sum(good)


def by_dmoc(name: str, every: Sequence[Instance], cores: int, checked: bool) -> tuple[float, int]:
    """Seconds of all solves, and how many succeeded; statements are made beforehand."""
    base = nominal(name)
    first = dmoc.solve(base, "ipm")
    problems = [varied(name, base, instance) for instance in every]
    options = {"guess": first, "workers": cores, "verify": checked}
    dmoc.solve_many(problems[:cores], "ipm", **options)
    seconds, batch = clocked(lambda: dmoc.solve_many(problems, "ipm", **options))
    return seconds, batch.status.count("solved")


def compare(quick: bool) -> Section:
    """Both in one run."""
    cores, section = os.cpu_count() or 1, Section(
        "Batches",
        "Instances of a problem of which three numbers differ by up to 2 %, each from the minimum "
        "of the nominal one with its multipliers, tolerance 1e-8. CasADi: one program for each "
        "process, built beforehand, bounds exchanged; nothing is checked. dmoc: "
        "`solve_many(..., guess=solution)` with `verify=False`, and with the simulation's check.",
        ["problem", "instances", "processes", f"{PEER}: solved", "a second", "dmoc: solved",
         "a second", f"{PEER} takes", "dmoc, checked: solved", "a second"],
    )  # fmt: skip
    for name, count in ((PENDULUM, 2000), (QUADROTOR, 400)):
        every = instances(count // 20 if quick else count)
        for workers in dict.fromkeys((1, cores)):
            some = every if workers == cores else every[: len(every) // 4]
            peer, peer_solved = by_peer(name, some, workers)
            bare, solved = by_dmoc(name, some, workers, False)
            whole, passed = by_dmoc(name, some, workers, True)
            section.row(
                name, len(some), workers, peer_solved, f"{len(some) / peer:.0f}", solved,
                f"{len(some) / bare:.0f}", ratio(peer, bare), passed, f"{len(some) / whole:.0f}",
            )  # fmt: skip
    return section
