"""Time to solve the reference problem from the same guess; where it goes; growth with N; warm
starts."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from typing import Any

import casadi_pendulum
import numpy as np
from common import (
    AS_INSTALLED,
    MEMORY,
    SAME_COST,
    Section,
    analysed,
    casadi_sizes,
    casadi_start,
    clocked,
    from_casadi,
    guess,
    kkt_layout,
    ms,
    neighbour,
    profile,
    program,
    ratio,
    seed,
    simulated,
    solves,
    violation,
)
from common import cost as own_cost
from contact_problems import floor

import dmoc

SOLVED = "Solve_Succeeded"  # as CasADi says it
PEER = "CasADi + IPOPT"
# What comes before the first iteration, as a process reports it.
ANALYSIS = ("cold patterns", "cold order", "patterns", "order")
SLOWEST = 1000  # steps up to which the peer is measured


def comparison(quick: bool) -> Section:
    problem = seed()
    x = guess(problem)
    nlp = program(problem, x)
    section = Section(
        "Solve: N = 100 + 100, same guess",
        "Median time of the solves from the automatic guess that succeeded. The program is built "
        "beforehand: CasADi's expression graph, dmoc's patterns and the analysis of its linear "
        "system, as where nothing is kept from other programs. `ipopt` and `uno` run on dmoc's "
        "kernels through Python callbacks. Scaled as dmoc: unknowns, rows and cost of CasADi's "
        "program are divided by the sizes that dmoc takes.",
        ["method", "solved", "ms", f"{PEER} takes", "iterations", "cost", "violation", "build, ms"],
    )
    reference = np.nan
    sizes = casadi_pendulum.ProgramSizes(*casadi_sizes(nlp))
    for name, compiled, scaled in (
        (PEER, False, None),
        (f"{PEER}, scaled as dmoc", False, sizes),
        (f"{PEER}, compiled C", True, None),
        (f"{PEER}, both", True, sizes),
    ):
        if quick and compiled:
            continue
        built = casadi_pendulum.program(
            casadi_pendulum.PendulumCase(alpha=problem.start["alpha"]),
            compiled=compiled,
            sizes=scaled,
        )
        start = built.start(*casadi_start(nlp, x))
        built.solve(start)
        runs = [built.solve(start) for _ in range(3 if quick else 11)]
        good = [seconds for seconds, _, _, status, _, _ in runs if status == SOLVED]
        seconds = median(good) if good else np.nan
        reference = seconds if name == PEER else reference
        _, cost, iterations, _, missed, _ = runs[-1]
        section.row(
            name, f"{len(good)}/{len(runs)}", ms(seconds), ratio(reference, seconds), iterations,
            f"{cost:.6f}", f"{missed:.0e}", ms(built.seconds),
        )  # fmt: skip
    for method, repeats in (("ipm", 51), ("slsqp", 5), ("ipopt", 5), ("uno", 1)):
        seconds, own = clocked(lambda m=method: analysed(problem, x, m))
        timing = solves(own, x, method, min(repeats, 3) if quick else repeats)
        last = timing.outcome
        section.row(
            method, timing.share, ms(timing.seconds), ratio(reference, timing.seconds),
            last.iterations, f"{own_cost(own, last):.6f}", f"{violation(own, last):.0e}",
            ms(seconds),
        )  # fmt: skip
    return section


def contact(quick: bool) -> Section:
    """What a phase in contact costs against a free one of the same block."""
    section = Section(
        "A phase in contact",
        "A block with three unknown functions (two coordinates and a force), N = 200, `ipm`: free "
        "flight against sliding and sticking on the floor, with a multiplier for each condition "
        "at each node, and a bounded force.",
        [
            "phase", "unknowns", "iterations", "factorisations", "us an iteration",
            "times the free one",
        ],
    )  # fmt: skip
    system = floor()
    slow = {"start": {"x": 0, "y": 0, "x_dot": 1}, "goal": {"x": 1}, "final_time": 0.8}
    problems = {
        "free": {"start": {"x": 0, "y": 1, "x_dot": 1}, "goal": {"x": 1}, "final_time": 0.6},
        "slides": slow | {"contacts": ["floor:slip+"]},
        "sticks": {"start": {"x": 0, "y": 0}, "contacts": ["floor"], "final_time": 0.8},
    }
    reference = np.nan
    for name, fields in problems.items():
        problem = dmoc.Problem(
            system, steps=200, controls="linear", bounds={"u": (0.1, 10)}, **fields
        )
        x = guess(problem)
        nlp = program(problem, x)
        runs = [profile(nlp, x) for _ in range(3 if quick else 51)]
        parts = sorted(runs, key=lambda r: r["seconds"])[len(runs) // 2]
        seconds = parts["seconds"] / parts["iterations"]
        reference = seconds if name == "free" else reference
        section.row(
            name, nlp.n, parts["iterations"], parts["factorisations"], f"{1e6 * seconds:.0f}",
            f"{seconds / reference:.2f} x",
        )  # fmt: skip
    return section


def answer(quick: bool) -> Section:
    """Time from a problem in memory to an answer that the simulation confirms."""
    section = Section(
        "Time to a checked answer",
        "The reference problem with N steps in each phase, from the statement to an answer that "
        "the simulation has checked: medians of `dmoc.solve` of a problem that is stated anew, "
        "kernels being built, in a process that has solved others. The first one in a process "
        "finds nothing that is kept from others, and has a column of its own. A dash stands where "
        "the best of the starts is the answer; its check is among theirs. "
        f"{PEER} gets the first automatic guess instead of "
        "starts, and its answer is checked by the same simulation; its solve is without building "
        "the graph.",
        [
            "N", "method", "solved", "guess or starts, ms", "solve, ms", "check, ms", "total, ms",
            "first, ms", f"{PEER} takes", "cost",
        ],
    )  # fmt: skip
    for steps, methods in ((100, ("ipm", "slsqp", "ipopt", "uno")), (1000, ("ipm",))):
        repeats = 1 if quick or steps > 100 else 3
        peer = _middle([_peer_answer(seed(steps=steps)) for _ in range(repeats)])
        section.row(steps, PEER, *_answer_cells(peer, peer, np.nan))
        for method in methods[: 2 if quick else None]:
            often = 1 if method == "uno" else 3 * repeats
            own = _middle([_own_answer(seed(steps=steps), method) for _ in range(often)])
            first = _first(f"answer by {method}", steps, repeats)
            section.row(steps, method, *_answer_cells(own, peer, first))
    return section


@dataclass(frozen=True)
class TimedAnswer:
    """Seconds of the parts of a way to a checked answer, whether it was confirmed, and the cost."""

    starts: float
    solve: float
    check: float
    total: float
    confirmed: bool
    cost: float


def _own_answer(problem: dmoc.Problem, method: str) -> TimedAnswer:
    total, solution = clocked(lambda: dmoc.solve(problem, method))
    starts, solve, check = (solution.seconds[part] for part in ("explore", "solve", "verify"))
    confirmed = solution.status == "solved"
    return TimedAnswer(starts, solve or np.nan, check, total, confirmed, solution.cost)


def _peer_answer(problem: dmoc.Problem) -> TimedAnswer:
    guessing, x = clocked(lambda: guess(problem))
    nlp = program(problem, x)
    case = casadi_pendulum.PendulumCase(alpha=problem.start["alpha"], steps=problem.phase_steps[0])
    built = casadi_pendulum.program(case)
    solving, cost, _, status, _, y = built.solve(built.start(*casadi_start(nlp, x)))
    checking, passed = clocked(lambda: simulated(nlp, from_casadi(nlp, x, y)))
    total = guessing + solving + checking
    return TimedAnswer(guessing, solving, checking, total, status == SOLVED and passed, cost)


def _middle(answers: list[TimedAnswer]) -> tuple[TimedAnswer, str]:
    """The answer of median time among those that were confirmed, and how many were."""
    good = sorted((a for a in answers if a.confirmed), key=lambda a: a.total)
    share = f"{len(good)}/{len(answers)}"
    return (good[len(good) // 2] if good else replace(answers[0], total=np.nan)), share


def _answer_cells(
    own: tuple[TimedAnswer, str], peer: tuple[TimedAnswer, str], first: float
) -> tuple[Any, ...]:
    answer, share = own
    parts = (answer.starts, answer.solve, answer.check, answer.total, first)
    return share, *map(ms, parts), ratio(peer[0].total, answer.total), f"{answer.cost:.6f}"


def where(quick: bool) -> Section:
    """Shares of an iteration of the interior-point method."""
    section = Section(
        "Where the time of `ipm` goes",
        "Microseconds an iteration: kernels (values, first and second derivatives, assembled), "
        "linear system (factorisations, solves, refinement), the rest (vectors, line search, one "
        "call into Python). What comes before the first iteration of the first program of its "
        "form: patterns of the derivatives and arrays of the program, then the order and the "
        "symbolic factorisation of the linear system. Cold: in a process that has done nothing "
        "before; anew: in one that has, where nothing is kept. Programs of one form share both.",
        [
            "N", "iterations", "factorisations", "kernels, us", "linear system, us", "rest, us",
            "a solve, ms", "cold: patterns, ms", "order, ms", "anew: patterns, ms", "order, ms",
            "both of a solve",
        ],
    )  # fmt: skip
    for steps in (100, 1000):
        problem = seed(steps=steps)
        x = guess(problem)
        nlp = program(problem, x)
        runs = [profile(nlp, x) for _ in range(3 if quick else 15)]
        r = sorted(runs, key=lambda r: r["seconds"])[len(runs) // 2]
        parts = (
            r["seconds_kernels"],
            r["seconds_linear"],
            r["seconds"] - r["seconds_kernels"] - r["seconds_linear"],
        )
        each = [f"{1e6 * p / r['iterations']:.0f}" for p in parts]
        runs = [_in_process("analysis", steps, 3) for _ in range(1 if quick else 5)]
        parts = [median(run[part] for run in runs) for part in ANALYSIS]
        share = f"{sum(parts[2:]) / r['seconds']:.0%}"
        section.row(
            steps, r["iterations"], r["factorisations"], *each, ms(r["seconds"]), *map(ms, parts),
            share,
        )  # fmt: skip
    return section


def growth(quick: bool, folder: Path) -> Section:
    section = Section(
        "Growth with N",
        "N steps in each of the two phases; each row in a process of its own. Memory is what a "
        f"solve adds to the largest resident size. {PEER} is measured once, up to N = "
        f"{300 if quick else SLOWEST}.",
        [
            "N", "ipm: solved", "ms", "iterations", "ms an iteration", "memory, MB",
            f"{PEER}: solved", "ms", "iterations", f"{PEER} takes",
        ],
        after="![time against N](growth.png)",
    )  # fmt: skip
    points = []
    for steps in (10, 30, 100, 300, 1000, 3000):
        own = _in_process("ipm", steps, 1 if quick else 5)
        peer = _in_process("casadi", steps, 1) if steps <= (300 if quick else SLOWEST) else None
        points.append((steps, own, peer))
        cells = ["not run", *"---"]
        if peer:
            cells = [
                peer["solved"],
                ms(peer["seconds"]),
                peer["iterations"],
                ratio(peer["seconds"], own["seconds"]),
            ]
        each = ms(own["seconds"] / own["iterations"])
        section.row(
            steps, own["solved"], ms(own["seconds"]), own["iterations"], each,
            f"{own['memory']:.1f}", *cells,
        )  # fmt: skip
    _plot(points, folder / "growth.png")
    return section


def _in_process(what: str, steps: int, repeats: int) -> dict[str, Any]:
    command = [sys.executable, __file__, what, str(steps), str(repeats)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=AS_INSTALLED)
    return dict(json.loads(done.stdout.splitlines()[-1]))


def _first(what: str, steps: int, processes: int) -> float:
    """Median seconds of something in processes of its own, which have done nothing before."""
    return median(_in_process(what, steps, 1)["seconds"] for _ in range(processes))


def _measure(what: str, steps: int, repeats: int) -> dict[str, Any]:
    problem = seed(steps=steps)
    if what.startswith("answer by "):
        answer = _own_answer(problem, what.removeprefix("answer by "))
        return {"seconds": answer.total if answer.confirmed else np.nan}
    x = guess(problem)
    if what == "analysis":
        runs = [_analysis(problem, x) for _ in range(1 + repeats)]
        return dict(
            zip(ANALYSIS, (*runs[0], *map(median, zip(*runs[1:], strict=True))), strict=True)
        )
    nlp = program(problem, x)
    if what == "ipm":
        before = _memory("VmRSS")
        Path("/proc/self/clear_refs").write_text("5")  # from here the peak is that of the solve
        solves(nlp, x, "ipm", 1)
        memory = _memory("VmHWM") - before
        timing = solves(nlp, x, "ipm", repeats)
        return {
            "seconds": timing.seconds,
            "iterations": timing.outcome.iterations,
            "solved": timing.share,
            "memory": memory,
        }
    casadi = casadi_pendulum.program(
        casadi_pendulum.PendulumCase(alpha=problem.start["alpha"], steps=steps)
    )
    seconds, _, iterations, status, _, _ = casadi.solve(casadi.start(*casadi_start(nlp, x)))
    good = status == SOLVED
    return {
        "seconds": seconds if good else np.nan,
        "iterations": iterations,
        "solved": f"{int(good)}/1",
    }


def _analysis(problem: dmoc.Problem, x: np.ndarray) -> tuple[float, float]:
    """Seconds of the patterns of a program, and of the analysis of its linear system, where nothing
    is kept from others."""
    MEMORY.clear()
    patterns, nlp = clocked(lambda: program(problem, x))
    return patterns, clocked(lambda: kkt_layout(nlp))[0]


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
        "From the solution and its multipliers (warm) against the automatic guess (cold), N = 100 "
        f"+ 100. Ends: warm and cold cost the same to {SAME_COST:g}, or how much dearer warm is.",
        [
            "change", "ipm cold: solved", "ms", "iterations", "ipm warm: solved", "ms",
            "iterations", "cold takes", "ends", "ipopt cold: solved", "iterations",
            "ipopt warm: solved", "iterations",
        ],
    )  # fmt: skip
    base = seed()
    x = guess(base)
    nlp = program(base, x)
    first = {m: solves(nlp, x, m, 1).outcome for m in ("ipm", "ipopt")}
    alpha = base.start["alpha"]
    changes = {
        "m_p": {"parameters": {"m_p": 1.05}},
        "m_c": {"parameters": {"m_c": 1.05}},
        "l": {"parameters": {"l": 0.525}},
        "start angle": {"start": {**base.start, "alpha": 1.05 * alpha}},
        "final time": {"final_time": (None, 1.05)},
    }
    for name, change in changes.items():
        problem = base.but(**change)
        start = guess(problem)
        cells: list[Any] = []
        for method, repeats in (("ipm", 3 if quick else 11), ("ipopt", 1)):
            far = program(problem, start)
            near, minimum, duals = neighbour(nlp, problem, first[method])
            cold, again = (
                solves(far, start, method, repeats),
                solves(near, minimum, method, repeats, duals),
            )
            if method == "ipm":
                dearer = own_cost(near, again.outcome) / own_cost(far, cold.outcome) - 1
                ends = "same" if abs(dearer) < SAME_COST else f"{dearer:+.1e}"
                cells = [
                    cold.share, ms(cold.seconds), cold.outcome.iterations, again.share,
                    ms(again.seconds), again.outcome.iterations, ratio(cold.seconds, again.seconds),
                    ends,
                ]  # fmt: skip
            else:
                cells += [
                    cold.share,
                    cold.outcome.iterations,
                    again.share,
                    again.outcome.iterations,
                ]
        section.row(name, *cells)
    return section


if __name__ == "__main__":
    print(json.dumps(_measure(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))))
