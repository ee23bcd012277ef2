"""What proofs do not cover, by name."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dmoc.base.errors import ProblemError
from dmoc.mechanics.contacts import NOWHERE
from dmoc.problem.problem import Problem


def check_covered(problem: Problem) -> None:
    """Refuse a problem that proofs do not cover, by the first reason there is."""
    for reason in (*_of_statement(problem), *_of_events(problem)):
        raise ProblemError(f"proofs do not cover {reason}.")


def _of_statement(p: Problem) -> Iterator[str]:
    facts, ranges = p.kernels.manifest, p.quantity_ranges
    if not np.isfinite(p.final_time_bounds[1]):
        yield "a final time without an upper bound; give final_time=(low, high)"
    if p.design:
        yield "parameters that the solver chooses"
    if p.models.change:
        yield "parameters with a value for each phase"
    if p.kernels.joints:
        yield f"constraints of the model ({p.kernels.joints[0]})"
    if p.model.totals_of or p.model.peak_names:
        yield "objectives of quantities, integrals or peaks"
    if np.isfinite(ranges.start).any() or np.isfinite(ranges.goal).any():
        yield "quantities at the start or at the goal"
    if facts.hidden:
        yield f"functions with kinks ({facts.hidden[0]})"


def _of_events(p: Problem) -> Iterator[str]:
    names, touch = p.kernels.surfaces, p.touch
    rough = [names[j] for j in p.model.rough]
    for name in (names[j] for j in touch.contacts.in_space if touch.is_closed[:, j].any()):
        yield f"contacts with two tangential directions that last: {name}"
    for i, event in enumerate(touch.events):
        at = f"event {i + 1} ({p.sequence[i]})"
        hit = names[event.hit] if event.hit != NOWHERE else ""
        if (
            any(names[j] in p.kernels.manifest.grips for j in event.lands)
            or event.switch != NOWHERE
        ):
            yield f"grips and switches: {at}"
        if event.off:
            yield f"ends of surfaces: {at}"
        if hit in rough:
            yield f"hits with friction: {at}"
        if event.course is not None:
            yield f"landings in which sliding stops or turns: {at}"
