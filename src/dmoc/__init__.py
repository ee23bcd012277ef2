"""dmoc: discrete mechanics and optimal control for mechanical systems with collisions.

The public names are loaded when they are first used, so that solving with built kernels imports no
SymPy.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dmoc.base.errors import DmocError as DmocError
    from dmoc.check.check import verify as verify
    from dmoc.control.disturbance import Disturbance as Disturbance
    from dmoc.export.loaded_solver import load_solver as load_solver
    from dmoc.export.page import generate_page as generate_page
    from dmoc.export.solver import generate_solver as generate_solver
    from dmoc.fitting.fit import fit as fit
    from dmoc.fitting.fit import identifiable as identifiable
    from dmoc.fitting.result import Fit as Fit
    from dmoc.inspection.system_derivation import derive as derive
    from dmoc.models.registry import build as build
    from dmoc.models.registry import load as load
    from dmoc.motion.attitude import Attitude as Attitude
    from dmoc.motion.attitude import attitude as attitude
    from dmoc.planning.planner import Planner as Planner
    from dmoc.problem.problem import Problem as Problem
    from dmoc.proving.certify import certify as certify
    from dmoc.proving.prove import prove as prove
    from dmoc.report.animation import animate as animate
    from dmoc.results.batch import Batch as Batch
    from dmoc.results.feedback import feedback as feedback
    from dmoc.results.simulation import Simulation as Simulation
    from dmoc.results.simulation import simulate as simulate
    from dmoc.results.solution import Solution as Solution
    from dmoc.robots.robot import read_robot as read_robot
    from dmoc.sequences.search import search as search
    from dmoc.solving.many import solve_many as solve_many
    from dmoc.solving.sensitivity import sensitivities as sensitivities
    from dmoc.solving.solve import solve as solve
    from dmoc.solving.sweep import sweep as sweep
    from dmoc.symbolic import planar as planar
    from dmoc.symbolic import spatial as spatial
    from dmoc.symbolic.contact_references import normal as normal
    from dmoc.symbolic.contact_references import reaction as reaction
    from dmoc.symbolic.contact_references import traction as traction
    from dmoc.symbolic.drawing import Box as Box
    from dmoc.symbolic.drawing import Contact as Contact
    from dmoc.symbolic.drawing import Disc as Disc
    from dmoc.symbolic.drawing import Link as Link
    from dmoc.symbolic.drawing import Point as Point
    from dmoc.symbolic.drawing import Spring as Spring
    from dmoc.symbolic.drawing import Wall as Wall
    from dmoc.symbolic.event_sums import approach as approach
    from dmoc.symbolic.event_sums import departure as departure
    from dmoc.symbolic.event_sums import impulse as impulse
    from dmoc.symbolic.event_sums import loss as loss
    from dmoc.symbolic.expressions import approach_speed as approach_speed
    from dmoc.symbolic.expressions import final_time as final_time
    from dmoc.symbolic.expressions import sliding_speed as sliding_speed
    from dmoc.symbolic.objectives import at_end as at_end
    from dmoc.symbolic.objectives import at_start as at_start
    from dmoc.symbolic.objectives import largest as largest
    from dmoc.symbolic.objectives import peak as peak
    from dmoc.symbolic.objectives import total as total
    from dmoc.symbolic.system import MechanicalSystem as MechanicalSystem

    __version__: str

_PLACES = {
    "Attitude": "dmoc.motion.attitude",
    "Batch": "dmoc.results.batch",
    "Box": "dmoc.symbolic.drawing",
    "Contact": "dmoc.symbolic.drawing",
    "Disc": "dmoc.symbolic.drawing",
    "Disturbance": "dmoc.control.disturbance",
    "DmocError": "dmoc.base.errors",
    "Fit": "dmoc.fitting.result",
    "Link": "dmoc.symbolic.drawing",
    "MechanicalSystem": "dmoc.symbolic.system",
    "Planner": "dmoc.planning.planner",
    "Point": "dmoc.symbolic.drawing",
    "Problem": "dmoc.problem.problem",
    "Simulation": "dmoc.results.simulation",
    "Solution": "dmoc.results.solution",
    "Spring": "dmoc.symbolic.drawing",
    "Wall": "dmoc.symbolic.drawing",
    "animate": "dmoc.report.animation",
    "approach": "dmoc.symbolic.event_sums",
    "approach_speed": "dmoc.symbolic.expressions",
    "at_end": "dmoc.symbolic.objectives",
    "at_start": "dmoc.symbolic.objectives",
    "attitude": "dmoc.motion.attitude",
    "build": "dmoc.models.registry",
    "departure": "dmoc.symbolic.event_sums",
    "final_time": "dmoc.symbolic.expressions",
    "impulse": "dmoc.symbolic.event_sums",
    "largest": "dmoc.symbolic.objectives",
    "loss": "dmoc.symbolic.event_sums",
    "normal": "dmoc.symbolic.contact_references",
    "reaction": "dmoc.symbolic.contact_references",
    "traction": "dmoc.symbolic.contact_references",
    "peak": "dmoc.symbolic.objectives",
    "total": "dmoc.symbolic.objectives",
    "certify": "dmoc.proving.certify",
    "prove": "dmoc.proving.prove",
    "feedback": "dmoc.results.feedback",
    "fit": "dmoc.fitting.fit",
    "generate_page": "dmoc.export.page",
    "generate_solver": "dmoc.export.solver",
    "load_solver": "dmoc.export.loaded_solver",
    "identifiable": "dmoc.fitting.fit",
    "derive": "dmoc.inspection.system_derivation",
    "load": "dmoc.models.registry",
    "read_robot": "dmoc.robots.robot",
    "search": "dmoc.sequences.search",
    "sensitivities": "dmoc.solving.sensitivity",
    "simulate": "dmoc.results.simulation",
    "sliding_speed": "dmoc.symbolic.expressions",
    "solve": "dmoc.solving.solve",
    "solve_many": "dmoc.solving.many",
    "sweep": "dmoc.solving.sweep",
    "verify": "dmoc.check.check",
}
_MODULES = {"planar": "dmoc.symbolic.planar", "spatial": "dmoc.symbolic.spatial"}
__all__ = [*_PLACES, *_MODULES]


def __getattr__(name: str) -> Any:
    if name == "__version__":  # stands in pyproject.toml alone
        from importlib.metadata import version

        return version("dmoc")
    if name in _PLACES:
        return getattr(import_module(_PLACES[name]), name)
    if name in _MODULES:
        return import_module(_MODULES[name])
    raise AttributeError(f"module 'dmoc' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*__all__, *(name for name in globals() if name.startswith("__")), "__version__"])
