"""Sequences a second, and what a second worker brings."""

from __future__ import annotations

from typing import Any

from common import Section, seed

import dmoc


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


def _others(alone: Any, result: Any) -> int:
    answers = [{n.sequence: (n.verdict, n.cost) for n in r.nodes} for r in (alone, result)]
    return sum(
        answers[0].get(s) != answers[1].get(s) for s in answers[0].keys() | answers[1].keys()
    )
