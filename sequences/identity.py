"""What tells a journal from those of other searches: a digest of all that the answer of a node
depends on."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import fields
from importlib import metadata

from dmoc.base.options import options_of
from dmoc.problem.problem import Problem
from dmoc.problem.ranges import Boundary
from dmoc.sequences.keywords import PROPOSING
from dmoc.sequences.settings import Settings

# Fields of a problem that the search sets itself, node by node.
SEARCHED = ("sequence", "durations")


def _end(bounds: Boundary) -> object:
    return [part.tolist() for part in (bounds.position, bounds.velocity, bounds.momentum)]


# Fields that can be stated in several ways, and what they come to.
MEANING: Mapping[str, Callable[[Problem], object]] = {
    "kernels": lambda p: (p.kernels.manifest.fingerprint, p.kernels.backend),
    "start": lambda p: (_end(p.start_bounds), p.quantity_ranges.start.tolist()),
    "goal": lambda p: (
        _end(p.goal_bounds),
        p.quantity_ranges.goal.tolist(),
        p.total_bounds.tolist(),
    ),
    "final_time": lambda p: p.final_time_bounds,
    "bounds": lambda p: (p.input_bounds.tolist(), p.coordinate_bounds.tolist(), p.limits),
    "parameters": lambda p: p.parameter_values.tolist(),
    "design": lambda p: (list(p.design), p.design_bounds.tolist()),
    "controls": lambda p: p.control_form,
    "restitution": lambda p: p.restitution_values.tolist(),
}


def facts(problem: Problem, settings: Settings) -> dict[str, object]:
    """All that the answer of a node depends on, by field."""
    values: dict[str, object] = {"version": metadata.version("dmoc")}
    for field in fields(Problem):
        if field.name not in SEARCHED:
            meaning = MEANING.get(field.name)
            values[f"problem.{field.name}"] = (
                meaning(problem) if meaning else getattr(problem, field.name)
            )
    for name, option in options_of(Settings).items():
        if option.decides:
            values[f"settings.{name}"] = getattr(settings, name)
    values["proposing"] = settings.strategy in PROPOSING  # their nodes have fewer starts
    return values


def identity(problem: Problem, settings: Settings) -> str:
    """The digest of these facts."""
    return hashlib.sha256(repr(facts(problem, settings)).encode()).hexdigest()
