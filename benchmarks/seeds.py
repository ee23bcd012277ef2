"""How often the exploration of random starts misses the best known minimum: the ladder's problems,
each with many seeds of the random numbers."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from statistics import median
from typing import Any

from common import Section, clocked
from ladder_problems import BETTER, RUNGS, SOLVED, Rung

import dmoc

SEEDS = 50
STEPS, ORDER = 50, 4
SECONDS = 60.0  # limit of one solve


@dataclass(frozen=True)
class SeedAnswer:
    """What one solve says: its status or how its cost compares, starts that were tried, how many
    of them met the minimum, and seconds."""

    result: str
    starts: int
    met: int
    seconds: float

    @property
    def good(self) -> bool:
        return self.result in (SOLVED, BETTER)


def solve(rung: Rung, problem: dmoc.Problem, seed: int, **more: Any) -> SeedAnswer:
    options = {"seed": seed, "seconds": SECONDS, **more}
    seconds, solution = clocked(lambda: dmoc.solve(problem, "ipm", **options))
    status = str(solution.status)
    result = rung.compared(solution.cost, True) if status == "solved" else status
    return SeedAnswer(result, solution.starts or 1, solution.agreeing_starts or 1, seconds)


def compare(quick: bool) -> Section:
    seeds = 3 if quick else SEEDS
    section = Section(
        "Starts: how often is the best known minimum missed?",
        f"The ladder's problems, N = {STEPS}, order {ORDER}, method `ipm`, from a statement "
        f"without any guess, {seeds} seeds of the random starts each. Met: the answer is confirmed "
        "and within the tolerance of the known cost, or below it. The rules of when the "
        "exploration ends are those of `dmoc.solve`; guess: the first automatic guess alone "
        "(`starts=1`). Share: of the starts, how many lead to the minimum of the answer.",
        [
            "problem", "met", "guess", "starts: median", "least", "most", "share", "s, median",
            "missed",
        ],
    )  # fmt: skip
    missed, runs = 0, 0
    for rung in RUNGS:
        problem = rung.make(STEPS, ORDER)
        answers = [solve(rung, problem, seed) for seed in range(seeds)]
        alone = solve(rung, problem, 0, starts=1)
        good = sum(a.good for a in answers)
        missed, runs = missed + seeds - good, runs + seeds
        others = Counter(a.result for a in answers if not a.good)
        section.row(
            rung.name, f"{good}/{seeds}", "met" if alone.good else alone.result,
            f"{median(a.starts for a in answers):g}", min(a.starts for a in answers),
            max(a.starts for a in answers), f"{median(a.met / a.starts for a in answers):.2f}",
            f"{median(a.seconds for a in answers):.2f}",
            ", ".join(f"{n} {result}" for result, n in others.items()) or "-",
        )  # fmt: skip
    section.after = f"Missed in all: {missed} of {runs}."
    return section
