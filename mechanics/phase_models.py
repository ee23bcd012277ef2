"""The model of a motion in each of its phases: parameters may have other values in each of them.

An event belongs to the phase that it ends: positions and velocities pass a change of parameters
unchanged, after an impact by the values before it.  Where nothing stands still in a change, as
gaps, what slides and constraints, parameters have one value (:func:`check_geometry`).
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dmoc.base.arguments import ErrorKind
from dmoc.base.records import record
from dmoc.codegen.kernels import Array, Kernels
from dmoc.mechanics.bound_kernels import Index
from dmoc.mechanics.model import Model

# Kernels that have one form in all phases, and what they say.
IN_ALL_PHASES = {
    "surface": "the gaps to surfaces",
    "within": "the ends of surfaces",
    "tangent": "tangential positions",
    "joint": "the constraints",
    "joint_rate": "the constraints",
    "crossing": "the switches",
    "tangential": "the tangential restitution",
    "objective": "the objective",
}
# The phases that ends of a motion lie in.
ENDS = {"start": 0, "goal": -1}
# States at which these are compared.
SAMPLES = 4


@record(frozen=True, eq=False)
class PhaseModels:
    """Models with values by phase, shape (phases, npar), or with one row of them for all."""

    kernels: Kernels
    par: Array

    @property
    def change(self) -> bool:
        """Whether each phase has values of its own."""
        return len(self.par) > 1

    @property
    def changing(self) -> list[str]:
        """Names of the parameters that have other values in some phases."""
        if not self.change:
            return []
        names, values = list(self.kernels.parameters), self.par.T
        return [n for n, column in zip(names, values, strict=True) if np.ptp(column) > 0]

    def changes(self, events: int) -> NDArray[np.bool_]:
        """Which of so many events may begin a phase with other values, shape (events,)."""
        return np.full(events, self.change)

    @cached_property
    def different(self) -> tuple[Model, ...]:
        """The model of each phase, or the one of all."""
        return tuple(Model(self.kernels, row[None]) for row in self.par)

    def __getitem__(self, phase: int) -> Model:
        """The model of a phase, as a list has it: -1 is the last one."""
        return self.different[phase if self.change else 0]

    def along(self, phases: Index) -> Model:
        """The model of rows of states in some phases, shape (n,)."""
        return Model(self.kernels, self.par[phases]) if self.change else self[0]

    def friction(self, phases: int) -> tuple[Array, Array]:
        """Coefficients of friction and static ones in so many phases, shape (phases, nt) each."""
        there = [self[i] for i in range(phases)]
        return (
            np.array([model.friction for model in there]),
            np.array([model.static_friction for model in there]),
        )

    @property
    def values(self) -> dict[str, float | tuple[float, ...]]:
        """Values by name: a number, or one for each phase of those that change."""
        every = zip(self.kernels.parameters, self.par.T.tolist(), strict=True)
        changing = self.changing
        return {n: tuple(column) if n in changing else column[0] for n, column in every}


def check_one_for_all(models: PhaseModels, why: str, error: ErrorKind) -> None:
    """Refuse parameters that have a value for each phase where one for all is needed."""
    if models.change:
        names = models.changing
        which = f"parameter {', '.join(names)} has" if names else "a parameter has"
        raise error(f"{which} a value for each phase: expected one for all, because {why}.")


def check_geometry(models: PhaseModels, error: ErrorKind) -> None:
    """Refuse parameters that change by phase where something that is the same in all phases depends
    on them: gaps would jump at events, and nothing would say where a contact is."""
    if not models.change:
        return
    _check_friction(models, error)
    for kernel, what in IN_ALL_PHASES.items():
        for name in models.changing if models.kernels.has(kernel) else ():
            if _depends(models, kernel, name):
                raise error(
                    f"parameter {name} has a value for each phase, and is part of {what}: expected "
                    "one value for all phases; model what changes by an expression of the "
                    "coordinates, or by another parameter."
                )


def _check_friction(models: PhaseModels, error: ErrorKind) -> None:
    """Refuse friction that is zero in some phases alone: words say whether something rubs."""
    rubs = np.array([model.has_friction for model in models.different])
    for k in np.flatnonzero(rubs.any(axis=0) & ~rubs.all(axis=0)).tolist():
        raise error(
            f"the friction of {models.kernels.tangents[k]!r} is zero in some phases and not in "
            "others: expected some in all of them; a small one counts for little."
        )


def _depends(models: PhaseModels, kernel: str, name: str) -> bool:
    """Whether results of a kernel change with the values of a parameter."""
    kernels, at = models.kernels, list(models.kernels.parameters).index(name)
    inputs = kernels.manifest.kernels[kernel]["inputs"]
    rng, results = np.random.default_rng(0), list[Iterable[Array]]()
    states = [rng.random((SAMPLES, size)) for _, size in inputs[:-1]]
    for value in np.unique(models.par[:, at]):
        row = models.par[:1].copy()
        row[0, at] = value
        results.append(kernels.call(kernel, *states, row))
    first, *others = results
    return not all(
        np.array_equal(a, b, equal_nan=True)
        for other in others
        for a, b in zip(first, other, strict=True)
    )
