"""dmoc: discrete mechanics and optimal control for mechanical systems with collisions.

The public names are loaded when they are first used, so that solving with built kernels imports no
SymPy.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dmoc.base.errors import DmocError
    from dmoc.check.check import verify
    from dmoc.inspection.system_derivation import derive
    from dmoc.models.registry import build, load
    from dmoc.problem.problem import Problem
    from dmoc.report.animation import animate
    from dmoc.results.batch import Batch
    from dmoc.results.simulation import Simulation, simulate
    from dmoc.results.solution import Solution
    from dmoc.sequences.search import search
    from dmoc.solving.many import solve_many
    from dmoc.solving.sensitivity import sensitivities
    from dmoc.solving.solve import solve
    from dmoc.solving.sweep import sweep
    from dmoc.symbolic.drawing import Box, Contact, Disc, Link, Point, Spring, Wall
    from dmoc.symbolic.system import MechanicalSystem

    __version__: str

__all__ = [
    "Batch",
    "Box",
    "Contact",
    "Disc",
    "DmocError",
    "Link",
    "MechanicalSystem",
    "Point",
    "Problem",
    "Simulation",
    "Solution",
    "Spring",
    "Wall",
    "animate",
    "build",
    "derive",
    "load",
    "search",
    "sensitivities",
    "simulate",
    "solve",
    "solve_many",
    "sweep",
    "verify",
]

_PLACES = {
    "Batch": "dmoc.results.batch",
    "Box": "dmoc.symbolic.drawing",
    "Contact": "dmoc.symbolic.drawing",
    "Disc": "dmoc.symbolic.drawing",
    "DmocError": "dmoc.base.errors",
    "Link": "dmoc.symbolic.drawing",
    "MechanicalSystem": "dmoc.symbolic.system",
    "Point": "dmoc.symbolic.drawing",
    "Problem": "dmoc.problem.problem",
    "Simulation": "dmoc.results.simulation",
    "Solution": "dmoc.results.solution",
    "Spring": "dmoc.symbolic.drawing",
    "Wall": "dmoc.symbolic.drawing",
    "animate": "dmoc.report.animation",
    "build": "dmoc.models.registry",
    "derive": "dmoc.inspection.system_derivation",
    "load": "dmoc.models.registry",
    "search": "dmoc.sequences.search",
    "sensitivities": "dmoc.solving.sensitivity",
    "simulate": "dmoc.results.simulation",
    "solve": "dmoc.solving.solve",
    "solve_many": "dmoc.solving.many",
    "sweep": "dmoc.solving.sweep",
    "verify": "dmoc.check.check",
}


def __getattr__(name: str) -> Any:
    if name == "__version__":  # stands in pyproject.toml alone
        from importlib.metadata import version

        return version("dmoc")
    if name in _PLACES:
        return getattr(import_module(_PLACES[name]), name)
    raise AttributeError(f"module 'dmoc' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*__all__, *(name for name in globals() if name.startswith("__")), "__version__"])
