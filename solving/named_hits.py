"""Hits that a model names and a sequence does not have: what they add is always nothing."""

from __future__ import annotations

from collections.abc import Iterator

from dmoc.base.errors import ProblemError
from dmoc.problem.problem import Problem
from dmoc.program.totals import surfaces_hit


def check_hits(problem: Problem) -> None:
    """Refuse a number beyond the hits of a surface that the sequence hits."""
    for what, surface, number, count in _named(problem):
        if number > count > 0:
            often = "once" if count == 1 else f"{count} times"
            raise ProblemError(
                f"{what} is about hit {number} of {surface!r}, which the sequence hits {often}: "
                "name a hit that there is, or add hits to the sequence."
            )


def without_hits(problem: Problem) -> str:
    """A sentence about surfaces that the model names the hits of and the sequence never hits; empty
    for none."""
    never = dict[str, list[str]]()
    for what, surface, _, count in _named(problem):
        if not count:
            never.setdefault(surface, []).append(what)
    return "; ".join(
        f"the sequence never hits {surface!r}, of which {' and '.join(dict.fromkeys(whats))} "
        f"{'has' if len(whats) == 1 else 'have'} nothing"
        for surface, whats in never.items()
    )


def _named(problem: Problem) -> Iterator[tuple[str, str, int, int]]:
    """Integrals and quantities of hits: in words, their surface, the number of the hit, 0 for all
    of them, and how often the sequence hits the surface."""
    model, kernels = problem.model, problem.kernels
    hit = [j for event in surfaces_hit(problem.touch) for j in event]
    rows = [(f"integral {kernels.integrals[i]!r}", j, n) for i, j, n in model.hit_sums.tolist()]
    rows += [(f"quantity {q!r}", j, n) for q, (j, n) in kernels.manifest.hit_quantities.items()]
    for what, j, number in rows:
        yield what, kernels.surfaces[j], number, hit.count(j)
