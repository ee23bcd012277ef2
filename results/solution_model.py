"""The model of a solution: its kernels, whether they are those that it was made with, and the
solution as a motion of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dmoc.base.arguments import shown
from dmoc.base.deadline import Deadline
from dmoc.base.errors import DmocError, ModelError, SimulationError, SolutionFileError
from dmoc.check.checked_motion import Motion
from dmoc.codegen.kernels import Kernels
from dmoc.mechanics.phase_models import check_one_for_all
from dmoc.motion.trajectory import Trajectory

if TYPE_CHECKING:
    from dmoc.results.solution import Solution


def kernels_of_file(solution: Solution) -> Kernels:
    """The kernels of a solution: its own, or, where it comes from a file, those of a shipped
    model."""
    if solution.kernels is not None:
        return solution.kernels
    from dmoc.models.registry import load_for_file

    return load_for_file(solution.reference or solution.trajectory.model, solution.trajectory.order)


def kernels_for(solution: Solution, kernels: Any, error: type[DmocError]) -> Kernels:
    """The kernels that are given with a solution, or its own."""
    if kernels is None:
        return kernels_of_file(solution)
    if not isinstance(kernels, Kernels):
        raise error(
            f"the model of the solution = {shown(kernels)}: expected kernels from "
            "dmoc.build(system) or dmoc.load(name)."
        )
    return kernels


def check_same_model(solution: Solution, kernels: Kernels) -> None:
    """Raise SolutionFileError unless the kernels are those of the solution's model."""
    fingerprint, theirs = solution.trajectory.fingerprint, kernels.manifest.fingerprint
    if fingerprint != theirs:
        raise SolutionFileError(
            f"the solution was made for another version of model {solution.trajectory.model!r} "
            f"than {kernels.name!r} as it is now: solve again, or give the model it was made for."
        )


def linearised(solution: Solution, kernels: Kernels | None, what: str) -> Motion:
    """A solution as a motion to linearise.

    Raises
    ------
    SimulationError
        If the solver did not converge.
    """
    kernels = kernels_for(solution, kernels, ModelError)
    check_same_model(solution, kernels)
    check_names(solution.trajectory, kernels)
    if not solution.converged:
        raise SimulationError(
            f"the status of the solution is {str(solution.status)!r}: {what} is that of a motion; "
            "solve until the solver converges."
        )
    motion = Motion.of(solution.trajectory, kernels, Deadline.after(None))
    check_one_for_all(motion.models, f"{what} is that of a motion of one model", SimulationError)
    return motion


def check_names(motion: Trajectory, kernels: Kernels) -> None:
    """Refuse a motion of the model of some kernels that has other names than the model."""
    if motion.fingerprint != kernels.manifest.fingerprint:
        return  # the check of a motion says so
    for what, names, expected in (
        ("coordinates", motion.coordinates, kernels.coordinates),
        ("inputs", motion.inputs, kernels.inputs),
        ("parameters", motion.parameters, kernels.parameters),
        ("surfaces", motion.restitution, kernels.surfaces),
    ):
        if list(names) != list(expected):
            raise SolutionFileError(
                f"the solution has the {what} {', '.join(names) or 'none'}, its model "
                f"{kernels.name!r} {', '.join(expected) or 'none'}: the file is damaged, solve "
                "again."
            )
