"""An exported solver beside Python's call and other tools: cold, warm, bytes, and batches."""

from __future__ import annotations

import os
import subprocess
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import Any, TypeAlias

import casadi_pendulum
import fatrop_pendulum
import numpy as np
from batches import NEAR, PENDULUM, instances, varied
from common import Section, casadi_start, guess, ms, program, ratio, seed

import dmoc

PEER, FATROP = "CasADi + IPOPT", "CasADi + FATROP"
NEIGHBOUR = 1.02  # of the start angle
# Median seconds of some solves, and iterations of the last one.
Timed: TypeAlias = tuple[float, int]
# Medians of solves from the first motion, and of those to and from a neighbour.
DRIVER = r"""
#define _POSIX_C_SOURCE 199309L
#include "carried.h"
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static double memory[CARRIED_MEMORY];
static double seconds(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9*(double)t.tv_nsec;
}
static int order(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}
int main(int count, char **words)
{
    const int n = atoi(words[1]);
    const double near = atof(words[count - 1]);
    double *times = malloc(sizeof(double)*(size_t)n);
    dmoc_solver *s = dmoc_solver_begin(&carried_problem, memory, sizeof memory);
    for (int warm = 0; warm < 2; ++warm) {
        int solved = 0;
        const double angle = dmoc_solver_get(s, CARRIED_START_ALPHA);
        for (int i = 0; i < n; ++i) {
            if (warm)
                dmoc_solver_set(s, CARRIED_START_ALPHA, i % 2 ? angle : near*angle);
            else
                dmoc_solver_from_first_motion(s);
            const double begin = seconds();
            solved += dmoc_solver_solve(s, NULL) == DMOC_SOLVED;
            times[i] = seconds() - begin;
        }
        qsort(times, (size_t)n, sizeof *times, order);
        printf("%d %.9g %d\n", solved, times[n/2], dmoc_solver_end(s).iterations);
    }
    return 0;
}
"""


def timed(run: Callable[[], Any], repeats: int) -> tuple[float, Any]:
    """Median seconds of the processor of several runs, after one that does not count, and the last
    result."""
    run()
    times = list[float]()
    for _ in range(repeats):
        begin = time.process_time()
        result = run()
        times.append(time.process_time() - begin)
    return median(times), result


def exported(steps: int, folder: Path) -> dmoc.Problem:
    problem = seed(steps=steps)
    dmoc.generate_solver(problem, folder)
    return problem


def in_c(folder: Path, runs: int) -> tuple[Timed, Timed]:
    """Cold and warm in C."""
    (folder / "driver.c").write_text(DRIVER, encoding="utf-8")
    flags = ["-O2", "-std=c11", "-ffp-contract=off", "-w"]
    sources = [p.name for p in folder.glob("*.c") if p.name not in ("main.c", "test.c")]
    command = [os.environ.get("CC", "cc"), *flags, *sources, "-lm", "-o", "driver"]
    subprocess.run(command, cwd=folder, check=True)
    run = subprocess.run(
        ["./driver", str(runs), str(NEIGHBOUR)], cwd=folder, check=True, capture_output=True,
        text=True,
    )  # fmt: skip
    cold, warm = (line.split() for line in run.stdout.splitlines())
    assert int(cold[0]) == int(warm[0]) == runs, run.stdout
    return (float(cold[1]), int(cold[2])), (float(warm[1]), int(warm[2]))


def by_casadi(problem: dmoc.Problem, steps: int, runs: int) -> tuple[Timed, Timed]:
    """The same transcription by hand, with IPOPT."""
    case = casadi_pendulum.PendulumCase(alpha=problem.start["alpha"], steps=steps)
    cold, warm = (casadi_pendulum.program(case, **options) for options in ({}, NEAR))
    x = guess(problem)
    start = cold.start(*casadi_start(program(problem, x), x))
    near = {key: value.copy() for key, value in warm.bounds.items()}
    for key in ("lbx", "ubx"):  # behind two durations the angle at the start
        near[key][2] *= NEIGHBOUR
    return _twice(cold.solver, warm.solver, start, (cold.bounds, near), runs)


def by_fatrop(problem: dmoc.Problem, steps: int, runs: int) -> tuple[Timed, Timed]:
    """The same in stages, with FATROP."""
    case = casadi_pendulum.PendulumCase(alpha=problem.start["alpha"], steps=steps)
    near = {"mu_init": 1e-5}
    (cold, bounds), (warm, others) = (
        fatrop_pendulum.solver(c, **options)
        for c, options in ((case, {}), (replace(case, alpha=NEIGHBOUR * case.alpha), near))
    )
    x = guess(problem)
    start = fatrop_pendulum.start_of(*casadi_start(program(problem, x), x))
    return _twice(cold, warm, start, (bounds, others), runs)


def _twice(
    cold: Any, warm: Any, start: np.ndarray, bounds: tuple[Any, Any], runs: int
) -> tuple[Timed, Timed]:
    """From a start, and a neighbour from the minimum and its multipliers."""
    seconds, minimum = timed(lambda: cold(x0=start, **bounds[0]), runs)
    first = _ended(cold, seconds)
    point = {"x0": minimum["x"], "lam_x0": minimum["lam_x"], "lam_g0": minimum["lam_g"]}
    seconds, _ = timed(lambda: warm(**point, **bounds[1]), runs)
    return first, _ended(warm, seconds)


def _ended(solver: Any, seconds: float) -> Timed:
    stats = solver.stats()
    return (seconds if stats["success"] else np.nan), int(stats["iter_count"])


def compare(quick: bool) -> Section:
    section = Section(
        "A solver to carry away",
        "The reference problem with N steps in each phase. Cold: from the first automatic guess, "
        f"without multipliers. Warm: the start angle goes up by {NEIGHBOUR - 1:.0%} and back, from "
        "the last minimum with its multipliers. C: the exported folder, compiled with -O2, medians "
        "in C. Python: the same folder by `dmoc.load_solver`, and `dmoc.solve` by `ipm` with "
        "`starts=1`, without its check. CasADi has the same transcription by hand, in stages for "
        "FATROP, which takes no multipliers of bounds to start from. Bytes are work memory and "
        "constants. Times are those of the processor.",
        [
            "N", "tool", "cold, ms", "iterations", "warm: ms", "iterations", "C takes, cold",
            "C takes, warm", "bytes",
        ],
    )  # fmt: skip
    for steps in (50, 100):
        with tempfile.TemporaryDirectory() as work:
            _rows(section, steps, Path(work) / "carried", quick)
    return section


def _rows(section: Section, steps: int, folder: Path, quick: bool) -> None:
    runs = 5 if quick else 101
    problem = exported(steps, folder)
    text = (folder / "README.md").read_text(encoding="utf-8")
    size = sum(
        int(line.split("|")[2].split()[0]) for line in text.splitlines()
        if line.startswith(("| work memory", "| constants"))
    )  # fmt: skip
    reference = in_c(folder, runs)

    def row(tool: str, cold: Timed, warm: Timed, size: str = "") -> None:
        takes = ratio(cold[0], reference[0][0]), ratio(warm[0], reference[1][0])
        section.row(steps, tool, ms(cold[0]), cold[1], ms(warm[0]), warm[1], *takes, size)

    row("dmoc, exported C", *reference, f"{size:,}")
    solver, start, turn = dmoc.load_solver(folder), problem.start["alpha"], [0]

    def again() -> Any:
        turn[0] = 1 - turn[0]
        solver.set(start={"alpha": start * (NEIGHBOUR if turn[0] else 1)})
        return solver.solve()

    seconds, end = timed(lambda: solver.solve("first"), runs)
    later, last = timed(again, runs)
    row("dmoc.load_solver", (seconds, end.iterations), (later, last.iterations))
    near = problem.but(start={**problem.start, "alpha": NEIGHBOUR * start})
    options: dict[str, Any] = {"starts": 1, "verify": False}
    seconds, own = timed(lambda: dmoc.solve(problem, "ipm", **options), max(runs // 5, 3))
    later, next_ = timed(lambda: dmoc.solve(near, "ipm", guess=own, **options), max(runs // 5, 3))
    row("dmoc.solve", (seconds, own.iterations), (later, next_.iterations))
    row(PEER, *by_casadi(problem, steps, 3 if quick else 11))
    row(FATROP, *by_fatrop(problem, steps, 3 if quick else 11))


def batch(quick: bool) -> Section:
    """Solves a second of neighbours of the exported solver."""
    section = Section(
        "Batches of an exported solver",
        "Neighbours of the reference problem, N = 100 + 100: start angle, largest force and "
        "largest time differ by up to 2 %. Each starts from the nominal minimum with its "
        "multipliers. "
        "`LoadedSolver.solve_many` in one thread, `dmoc.solve_many` in one process without its "
        "check, by seconds of the processor.",
        ["tool", "instances", "solved", "a second", "exported takes"],
    )
    some = instances(100 if quick else 2000)
    with tempfile.TemporaryDirectory() as work:
        problem = exported(100, Path(work) / "carried")
        solver = dmoc.load_solver(Path(work) / "carried")
    angle = problem.start["alpha"]
    numbers = [
        {"start": {"alpha": a * angle}, "bounds": {"F": (-200 * b, 200 * b)},
         "final_time": (None, c)}
        for a, b, c in some
    ]  # fmt: skip
    own = dmoc.solve(problem, "ipm")
    few = [varied(PENDULUM, problem, one) for one in some[: len(some) // 5]]
    begin = time.process_time()
    ends = solver.solve_many(numbers)
    middle = time.process_time()
    batch = dmoc.solve_many(few, "ipm", guess=own, verify=False)
    each = (middle - begin) / len(some), (time.process_time() - middle) / len(few)
    statuses = [end.status for end in ends], batch.status
    for tool, seconds, status in zip(
        ("dmoc, exported C", "dmoc.solve_many"), each, statuses, strict=True
    ):
        section.row(
            tool, len(status), status.count("solved"), f"{1 / seconds:.0f}",
            ratio(seconds, each[0]),
        )  # fmt: skip
    return section
