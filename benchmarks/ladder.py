"""Published problems from the automatic start: who solves which, at what cost, and how soon there
is a checked answer.

make ladder                                     everything, into benchmarks/results/ladder.md
python benchmarks/run.py --only ladder --quick  ipm and the default, N = 50
python benchmarks/ladder.py --rung acrobot --method ipm --steps 50 --order 4
                                                prints rows as they come
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

import ladder_casadi
import numpy as np
from common import DEFAULT, Section, clocked, filled, ms, table
from ladder_problems import BETTER, RUNGS, SOLVED, Rung

import dmoc

METHODS = ("ipm", "slsqp", "ipopt", "uno")
PEER = "CasADi + IPOPT"
EXPLORED = f"{PEER}, explored"  # from the motion that dmoc has found on a coarse mesh
PEERS = (PEER, EXPLORED)
COARSE = 24  # steps a phase of that mesh, which is the one of dmoc's own exploration
STEPS = (50, 100, 200)
ORDERS = (2, 4)
SECONDS = 60.0  # limit of one solve with its guess and check
NOT_RUN = "not run"
ABOUT_PEER = (
    f" {PEER} transcribes the same equations directly (midpoint rule; Hermite and Simpson's) and "
    "starts from a straight line without inputs; explored: from the minimum that dmoc finds with "
    f"N = {COARSE}. Its answers are not checked: one far below the known cost does not count, and "
    "its time is that of the solve, without building, and with dmoc's on the coarse mesh."
)
HEADER = (
    "problem", "order", "N", "method", "result", "cost", "against known", "explore", "guess",
    "solve", "check", "total",
)  # fmt: skip


@dataclass(frozen=True)
class Try:
    """One solve: how it ended, its cost, and the seconds of its parts."""

    rung: Rung
    order: int
    steps: int
    method: str
    result: str
    cost: float = np.nan
    explore: float = np.nan
    guess: float = np.nan
    solve: float = np.nan
    check: float = np.nan
    total: float = np.nan

    @property
    def met(self) -> bool:
        return self.result in (SOLVED, BETTER)

    @property
    def parts(self) -> tuple[float, ...]:
        return self.explore, self.guess, self.solve, self.check, self.total

    @property
    def row(self) -> tuple[Any, ...]:
        reference = self.rung.least_cost
        ended = np.isfinite(self.cost)
        return (
            self.rung.name, self.order, self.steps, self.method,
            self.result if self.met else f"**{self.result}**", f"{self.cost:.6g}" if ended else "-",
            f"{(self.cost - reference) / abs(reference):+.1e}" if ended else "-",
            *(ms(part) for part in self.parts),
        )  # fmt: skip


def own(rung: Rung, order: int, steps: int, method: str) -> Try:
    """Solve by dmoc."""
    problem = rung.make(steps, order)
    total, solution = clocked(lambda: dmoc.solve(problem, method, seconds=SECONDS))
    status, spent = str(solution.status), solution.seconds
    return Try(
        rung, order, steps, method,
        rung.compared(solution.cost, True) if status == "solved" else status, solution.cost,
        spent.get("explore", np.nan), spent["guess"], spent["solve"], spent.get("verify", np.nan),
        total,
    )  # fmt: skip


def peer(rung: Rung, order: int, steps: int, method: str) -> Try:
    """Solve by CasADi and IPOPT; nothing is checked, and the seconds of building are left out."""
    start, explore = None, 0.0
    if method == EXPLORED:
        coarse = rung.make(COARSE, order)
        explore, solution = clocked(lambda: dmoc.solve(coarse, "ipm", seconds=SECONDS))
        start = ladder_casadi.SolvedMotion(solution)
    answer = ladder_casadi.solve(rung.state(), rung.make(steps, order), SECONDS, start)
    return Try(
        rung, order, steps, method,
        rung.compared(answer.cost, False) if answer.succeeded else answer.status, answer.cost,
        explore=explore or np.nan, solve=answer.solve, total=explore + answer.solve,
    )  # fmt: skip


def tries(
    rungs: Sequence[Rung],
    methods: Sequence[str],
    orders: Sequence[int] = ORDERS,
    steps: Sequence[int] = STEPS,
) -> Iterator[Try]:
    """Every rung with every method; one that has run out of time is not run with more steps."""
    for rung in rungs:
        for order in orders:
            for method in methods:
                late = False
                for n in sorted(steps):
                    if late:
                        yield Try(rung, order, n, method, NOT_RUN)
                        continue
                    solve = peer if method in PEERS else own
                    one = solve(rung, order, n, method)
                    late = one.total >= SECONDS
                    yield one


def ladder(quick: bool, folder: Path) -> Section:
    methods = tuple(dict.fromkeys(("ipm", DEFAULT))) if quick else (*METHODS, *PEERS)
    steps = STEPS[:1] if quick else STEPS
    results = list(tries(RUNGS, methods, steps=steps))
    section = Section(
        "Published problems from the automatic start",
        f"Orders 2 and 4 with N = {', '.join(map(str, steps))} steps a phase, from a statement "
        "without any guess: how many end within the tolerance of the known cost (or below it) and "
        f"are confirmed by the simulation; `{DEFAULT}` is the default. Times are medians over what "
        f"was solved, kernels being built; where the exploration ends on the mesh itself, there is "
        f"no further guess and solve. A solve has {SECONDS:.0f} s; after one that took longer "
        f"there is none with more steps.{ABOUT_PEER if PEER in methods else ''}",
        ["problem", "known cost", "source", *methods],
    )
    for rung in RUNGS:
        own_tries = [t for t in results if t.rung is rung]
        shares = (_share([t for t in own_tries if t.method == m]) for m in methods)
        section.row(rung.name, f"{rung.least_cost:.8g}", rung.source, *shares)
    for order in ORDERS:
        groups = ([t for t in results if (t.method, t.order) == (m, order)] for m in methods)
        section.row(f"all of order {order}", "", "", *map(_share, groups))
    for part in ("explore", "guess", "solve", "check", "total"):
        medians = (_median([t for t in results if t.met and t.method == m], part) for m in methods)
        section.row(f"{part}, ms", "", "", *medians)
    section.after = _failures(results, methods)
    text = f"# The ladder\n\n{section.markdown()}\n{_every(results)}"
    (folder / "ladder.md").write_text(text, encoding="utf-8")
    return section


def _share(group: Sequence[Try]) -> str:
    met = sum(t.met for t in group)
    return f"{met}/{len(group)}" if met == len(group) else f"**{met}/{len(group)}**"


def _median(group: Sequence[Try], part: str) -> str:
    values = [getattr(t, part) for t in group]
    return ms(median(values)) if values else "-"


def _failures(results: Sequence[Try], methods: Sequence[str]) -> str:
    """What dmoc's own methods missed, by name."""
    own_methods = [m for m in methods if m in ("ipm", DEFAULT)]
    lines = []
    for method in dict.fromkeys(own_methods):
        missed = [
            f"{t.rung.name} (order {t.order}, N = {t.steps}: {t.result})"
            for t in results
            if t.method == method and not t.met
        ]
        lines.append(f"Missed by `{method}`: {'; '.join(missed) or 'nothing'}.")
    return "\n\n".join(lines)


def _every(results: Sequence[Try]) -> str:
    text = (
        "## Every solve\n\nA result in bold is a failure: *dearer* than the known cost by more "
        "than the tolerance, *below* it without a check, or the status; times are in ms."
    )
    sections = []
    for rung in dict.fromkeys(t.rung for t in results):
        rows = [t.row[1:] for t in results if t.rung is rung]
        sections.append(f"### {rung.name}\n\n{table(HEADER[1:], rows)}\n")
    return filled(text) + "\n\n" + "\n".join(sections)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rung", default="", help="part of the name of a problem")
    parser.add_argument(
        "--method", nargs="+", choices=(*METHODS, *PEERS), default=(*METHODS, *PEERS)
    )
    parser.add_argument("--steps", nargs="+", type=int, default=STEPS)
    parser.add_argument("--order", nargs="+", type=int, choices=ORDERS, default=ORDERS)
    options = parser.parse_args()
    rungs = [rung for rung in RUNGS if options.rung in rung.name]
    sys.stdout.write("| " + " | ".join(HEADER) + " |\n" + len(HEADER) * "|---" + "|\n")
    for one in tries(rungs, options.method, options.order, options.steps):
        sys.stdout.write("| " + " | ".join(map(str, one.row)) + " |\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
