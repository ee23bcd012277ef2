"""Time to solve the seed's problem, from the same guess to the same cost; where the time goes; growth with the number of steps."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path
from statistics import median
from typing import Any

import casadi_pendulum
import numpy as np
from common import Section, casadi_start, guess, ms, program, seed, solve, timed, violation
from common import cost as own_cost

import dmoc
from dmoc.nlp.motion import given_multipliers, named_multipliers
from dmoc.nlp.transcription import Transcription
from dmoc.solvers.ipm import profile
from dmoc.solvers.kkt_layout import kkt_layout
from dmoc.solvers.outcome import Duals, Options, Outcome

OPTIONS = Options(iterations=1000, seconds=600.0)


def comparison(quick: bool) -> Section:
    problem = seed()
    x = guess(problem)
    nlp = program(problem, x)
    section = Section(
        "Solve: N = 100 + 100, same guess",
        "Median time of a solve from the automatic guess. The program is built beforehand: CasADi's expression graph, dmoc's patterns. dmoc's time "
        "includes the analysis of the linear system. `ipopt` and `uno` run on dmoc's kernels through Python callbacks.",
        ["method", "ms", "CasADi + IPOPT takes", "iterations", "cost", "violation", "build, ms"],
    )
    casadi = casadi_pendulum.program(casadi_pendulum.Case(alpha=problem.start["alpha"]))
    start = casadi.start(*casadi_start(nlp, x))
    reference, (_, cost, iterations, status, missed, _) = timed(lambda: casadi.solve(start), 3 if quick else 11)
    rows = [("CasADi + IPOPT", reference, iterations, cost, missed, ms(casadi.seconds), status)]
    if not quick:
        compiled = casadi_pendulum.program(casadi_pendulum.Case(alpha=problem.start["alpha"]), compiled=True)
        seconds, (_, cost, iterations, status, missed, _) = timed(lambda: compiled.solve(start), 11)
        rows.append(("CasADi + IPOPT, compiled C", seconds, iterations, cost, missed, ms(compiled.seconds), status))
    for method, repeats in (("ipm", 51), ("slsqp", 5), ("ipopt", 5), ("uno", 1)):
        begin = time.perf_counter()
        own = program(problem, x, method)
        built = time.perf_counter() - begin
        runs = [solve(own, x, method, OPTIONS) for _ in range(3 if quick and repeats > 3 else repeats)]
        seconds, outcome = median(s for s, _ in runs), runs[-1][1]
        rows.append(
            (method, seconds, outcome.iterations, own_cost(own, outcome), violation(own, outcome), ms(built), outcome.status.name)
        )
    for name, seconds, iterations, cost, missed, built, status in rows:
        good = status in ("SOLVED", "Solve_Succeeded")
        cells = (f"{iterations}", f"{cost:.6f}", f"{missed:.0e}") if good else (status.lower(), "-", "-")
        section.rows.append((name, ms(seconds), f"{reference / seconds:.2g} x", *cells, built))
    return section


def where(quick: bool) -> Section:
    """Shares of an iteration of the interior-point method."""
    section = Section(
        "Where the time of `ipm` goes",
        "Microseconds an iteration: kernels (values, first and second derivatives, assembled), linear system (factorisations, solves, refinement), "
        "the rest (vectors, line search, one call into Python).",
        ["N", "iterations", "factorisations", "kernels, us", "linear system, us", "rest, us", "analysis before the first, ms"],
    )
    for steps in (100, 1000):
        problem = seed(steps=steps)
        x = guess(problem)
        nlp = program(problem, x)
        begin = time.perf_counter()
        K = kkt_layout(nlp)
        analysis = time.perf_counter() - begin
        runs = [profile(nlp, nlp.scaled(x), OPTIONS, K) for _ in range(3 if quick else 15)]
        r = sorted(runs, key=lambda r: r["seconds"])[len(runs) // 2]
        parts = (r["seconds_kernels"], r["seconds_linear"], r["seconds"] - r["seconds_kernels"] - r["seconds_linear"])
        each = [f"{1e6 * p / r['iterations']:.0f}" for p in parts]
        section.rows.append((steps, r["iterations"], r["factorisations"], *each, ms(analysis)))
    return section


def growth(quick: bool, folder: Path) -> Section:
    section = Section(
        "Growth with N",
        "N steps in each of the two phases; each row in a process of its own. Memory is what a solve adds to the largest resident size.",
        [
            "N",
            "ipm: ms",
            "iterations",
            "ms an iteration",
            "memory, MB",
            "CasADi + IPOPT: ms",
            "iterations",
            "CasADi + IPOPT takes",
        ],
        after="![time against N](growth.png)",
    )
    points = []
    for steps in (10, 30, 100, 300, 1000, 3000):
        own = _in_process("ipm", steps, 1 if quick else 5)
        peer = _in_process("casadi", steps, 1) if steps <= (300 if quick else 1000) else None
        points.append((steps, own, peer))
        cells = (
            (ms(peer["seconds"]), peer["iterations"], f"{peer['seconds'] / own['seconds']:.0f} x")
            if peer
            else ("not run", "-", "-")
        )
        section.rows.append(
            (steps, ms(own["seconds"]), own["iterations"], ms(own["seconds"] / own["iterations"]), f"{own['memory']:.1f}", *cells)
        )
    _plot(points, folder / "growth.png")
    return section


def _in_process(what: str, steps: int, repeats: int) -> dict[str, Any]:
    command = [sys.executable, __file__, what, str(steps), str(repeats)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return dict(json.loads(done.stdout.splitlines()[-1]))


def _measure(what: str, steps: int, repeats: int) -> dict[str, Any]:
    problem = seed(steps=steps)
    x = guess(problem)
    nlp = program(problem, x)
    if what == "ipm":
        before = _memory("VmRSS")
        Path("/proc/self/clear_refs").write_text("5")  # from here the peak is that of the solve
        _, outcome = solve(nlp, x, "ipm", OPTIONS)
        memory = _memory("VmHWM") - before
        seconds = median(solve(nlp, x, "ipm", OPTIONS)[0] for _ in range(repeats))
        return {"seconds": seconds, "iterations": outcome.iterations, "cost": own_cost(nlp, outcome), "memory": memory}
    casadi = casadi_pendulum.program(casadi_pendulum.Case(alpha=problem.start["alpha"], steps=steps))
    seconds, cost, iterations, _, _, _ = casadi.solve(casadi.start(*casadi_start(nlp, x)))
    return {"seconds": seconds, "iterations": iterations, "cost": cost}


def _memory(name: str) -> float:
    """A size of this process in MB, as /proc/self/status names it."""
    lines = Path("/proc/self/status").read_text(encoding="utf-8").splitlines()
    return next(float(line.split()[1]) / 1024 for line in lines if line.startswith(name))


def _plot(points: list[Any], path: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6.4, 4.2), layout="constrained")
    steps = np.array([n for n, _, _ in points])
    own = np.array([o["seconds"] / o["iterations"] for _, o, _ in points])
    axes.loglog(steps, 1e3 * own, "o-", label="dmoc ipm")
    peers = [(n, p["seconds"] / p["iterations"]) for n, _, p in points if p]
    axes.loglog([n for n, _ in peers], [1e3 * s for _, s in peers], "s-", label="CasADi + IPOPT")
    axes.loglog(steps, 1e3 * own[2] * steps / steps[2], ":", color="0.5", label="linear in N")
    axes.set_xlabel("steps of each phase, N")
    axes.set_ylabel("time of an iteration [ms]")
    axes.legend(frameon=False)
    axes.grid(alpha=0.3)
    figure.savefig(path, dpi=120)
    plt.close(figure)


def warm(quick: bool) -> Section:
    section = Section(
        "Solving again after a change of 5 %",
        "From the solution and its multipliers (warm) against the automatic guess (cold), N = 100 + 100; every solve ends at the same cost.",
        [
            "change",
            "ipm cold: ms",
            "iterations",
            "ipm warm: ms",
            "iterations",
            "cold takes",
            "ipopt cold: iterations",
            "warm: iterations",
        ],
    )
    base = seed()
    x = guess(base)
    nlp = program(base, x)
    solved = {m: solve(nlp, x, m, OPTIONS)[1] for m in ("ipm", "ipopt")}
    alpha = base.start["alpha"]
    changes = {
        "m_p": {"parameters": {"m_p": 1.05}}, "m_c": {"parameters": {"m_c": 1.05}}, "l": {"parameters": {"l": 0.525}},
        "start angle": {"start": {**base.start, "alpha": 1.05 * alpha}}, "final time": {"final_time": (None, 1.05)},
    }  # fmt: skip
    for name, change in changes.items():
        problem = base.but(**change)
        cold_start = guess(problem)
        near = program(problem, cold_start)
        colds = [solve(near, cold_start, "ipm", OPTIONS) for _ in range(3 if quick else 11)]
        starts = {m: _neighbour(nlp, problem, outcome) for m, outcome in solved.items()}
        warms = [solve(starts["ipm"][0], starts["ipm"][1], "ipm", OPTIONS, starts["ipm"][2]) for _ in range(3 if quick else 11)]
        cold, again = (median(s for s, _ in runs) for runs in (colds, warms))
        a, b = colds[-1][1], warms[-1][1]
        c = solve(near, cold_start, "ipopt", OPTIONS)[1]
        d = solve(starts["ipopt"][0], starts["ipopt"][1], "ipopt", OPTIONS, starts["ipopt"][2])[1]
        same = abs(own_cost(near, a) - own_cost(starts["ipm"][0], b)) < 1e-6 * own_cost(near, a)
        section.rows.append(
            (name, ms(cold), a.iterations, ms(again), f"{b.iterations}{'' if same else ' (other minimum)'}", f"{cold / again:.1f} x", c.iterations,
             d.iterations)
        )  # fmt: skip
    return section


def _neighbour(nlp: Transcription, problem: dmoc.Problem, outcome: Outcome) -> tuple[Transcription, np.ndarray, Duals]:
    """The program of a neighbouring problem with a minimum and its multipliers to start from."""
    x = nlp.physical(outcome.x)
    near = program(problem, x, minimum=True)
    named = named_multipliers(nlp, outcome.duals.y, outcome.duals.w, outcome.duals.z)
    return near, x, Duals(*given_multipliers(near, named))


if __name__ == "__main__":
    print(json.dumps(_measure(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))))
