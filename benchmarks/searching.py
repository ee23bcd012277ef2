"""Sequences a second, and what a second worker brings."""

from __future__ import annotations

from common import Section, seed

import dmoc


def compare(quick: bool) -> Section:
    section = Section(
        "Search over sequences",
        "The seed's problem, both limiters, N = 100 in each phase, method `ipm`: every sequence up to a depth, from its parent's motion and the automatic "
        "guess, confirmed by simulation. The answer is the same for any number of workers.",
        ["collisions, at most", "sequences", "workers", "s", "sequences a second", "speed-up", "best", "cost", "verdicts"],
    )
    for depth in (2, 3) if quick else (3, 6):
        base = 0.0
        for workers in (1, 2):
            result = dmoc.search(seed(), depth, workers=workers)
            base = base or result.seconds
            name, cost = ("-", "-") if result.best is None else (result.best.name, f"{result.best.cost:.6g}")
            verdicts = ", ".join(f"{n} {v}" for v, n in result.counts.items())
            rate = len(result.nodes) / result.seconds
            row = (
                depth,
                len(result.nodes),
                workers,
                f"{result.seconds:.1f}",
                f"{rate:.1f}",
                f"{base / result.seconds:.2f}",
                name,
                cost,
                verdicts,
            )
            section.rows.append(row)
    return section
