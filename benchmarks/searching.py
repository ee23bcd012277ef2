"""Sequences a second, what a second worker brings, and a method that needs no sequence."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import nosnoc_puck
import numpy as np
from common import Section, seed

import dmoc
from dmoc.models.registry import find

STAGES = (15, 20, 30)  # of nosnoc


def compare(quick: bool) -> Section:
    section = Section(
        "Search over sequences",
        "The reference problem, both limiters, N = 100 in each phase, method `ipm`: every sequence "
        "up to a depth, on a coarse mesh from its parent's motion, an automatic guess and random "
        "motions, the best one refined and confirmed by simulation. Failed: sequences without a "
        "verdict, their solves having met a limit or an "
        "error. Other answers: sequences whose verdict or cost is another than with one worker.",
        [
            "collisions, at most", "sequences", "workers", "s", "sequences a second", "speed-up",
            "best", "cost", "failed", "other answers", "verdicts",
        ],
    )  # fmt: skip
    for depth in (2, 3) if quick else (3, 6):
        alone = dmoc.search(seed(), depth)
        for result in (alone, dmoc.search(seed(), depth, workers=2)):
            name, cost = (
                ("-", "-") if result.best is None else (result.best.name, f"{result.best.cost:.6g}")
            )
            counts = {str(verdict): n for verdict, n in result.counts.items() if n}
            verdicts = ", ".join(f"{n} {v}" for v, n in counts.items())
            seconds, count = result.seconds, len(result.nodes)
            section.row(
                depth, count, 1 if result is alone else 2, f"{seconds:.1f}",
                f"{count / seconds:.1f}", f"{alone.seconds / seconds:.2f}", name, cost,
                counts.get("failed", 0), _others(alone, result), verdicts,
            )  # fmt: skip
    return section


def puck(quick: bool) -> Section:
    """The search on the puck's table, beside complementarity conditions."""
    version = nosnoc_puck.version()
    section = Section(
        "Puck among four walls: the search and nosnoc",
        "Which walls, in which order? The search solves every sequence up to three collisions "
        "(N = 40 a phase, method `ipm`, one worker). nosnoc takes no sequence: elastic walls by "
        "time freezing in Stewart's form, homotopy by IPOPT from its own start; its seconds are "
        "without building. Miss: largest difference to the goal, in m and m/s, when the inputs act "
        "between exact walls. The best is 0.415 (closed form).",
        ["method", "status", "walls", "cost", "miss", "s"],
        after="" if version else "nosnoc is not installed: `pip install --no-deps nosnoc`.",
    )
    reference = find("puck_table")
    problem = dmoc.Problem(reference.kernels(), **{**reference.defaults, "sequence": ()})
    found = dmoc.search(problem, 3)
    best = found.best
    section.row(
        f"search, {len(found.nodes)} sequences",
        "nothing found" if best is None else str(best.verdict), "-" if best is None else best.name,
        "-" if best is None else f"{best.cost:.5f}",
        "-" if best is None else f"{_miss(best.solution, reference.defaults):.1e}",
        f"{found.seconds:.1f}",
    )  # fmt: skip
    for stages in (STAGES[:1] if quick else STAGES) if version else ():
        section.row(f"nosnoc {version}, {stages} stages", *_peer(stages))
    return section


def _miss(solution: dmoc.Solution, data: Mapping[str, Any]) -> float:
    times = np.concatenate([np.diff(phase.t) for phase in solution.phases])
    return nosnoc_puck.missed(data, times, np.concatenate([phase.u for phase in solution.phases]))


def _peer(stages: int) -> tuple[str, ...]:
    found = nosnoc_puck.solved(stages)
    if "cost" not in found:
        return found["status"], "-", "-", "-", "-"
    return (
        found["status"],
        ", ".join(found["walls"]) or "none",
        f"{found['cost']:.5f}",
        f"{found['missed']:.1e}",
        f"{found['seconds']:.1f}",
    )


def _others(alone: Any, result: Any) -> int:
    answers = [{n.sequence: (n.verdict, n.cost) for n in r.nodes} for r in (alone, result)]
    return sum(
        answers[0].get(s) != answers[1].get(s) for s in answers[0].keys() | answers[1].keys()
    )
