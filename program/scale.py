"""Sizes of a problem's quantities, by which unknowns, constraints and cost are divided."""

from __future__ import annotations

import numpy as np

from dmoc.base.names import momentum_name, velocity_name
from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.problem.problem import Problem


@record(frozen=True, eq=False)
class Scale:
    """Sizes: time, cost and energy; coordinates, velocities and momenta (nq,), inputs (nu,);
    gaps, their rates and impulses (nc,); sliding velocities and friction impulses (nt,); path
    constraints; quantities; totals and peaks of an objective; hidden unknowns; step sizes
    (phases,); rates and impulses of the constraints of the model (nj,); crossing functions (nw,);
    quantities of hits; design parameters; ends of surfaces and their rates (nc,)."""

    time: float
    cost: float
    energy: float
    q: Array
    v: Array
    p: Array
    u: Array
    gap: Array
    rate: Array
    lam: Array
    slide: Array
    friction: Array
    path: Array
    quantity: Array
    totals: Array
    peaks: Array
    s: Array
    h: Array
    joint_rate: Array
    reaction: Array
    crossing: Array
    hit_quantity: Array
    design: Array
    within: Array
    within_rate: Array

    @classmethod
    def none(cls, problem: Problem) -> Scale:
        """Everything counts in its own unit."""
        kernels = problem.kernels
        nq, nu, nc = (
            np.ones(len(names)) for names in (kernels.coordinates, kernels.inputs, kernels.surfaces)
        )
        path, s = np.ones(len(kernels.manifest.path_rows)), np.ones(len(kernels.manifest.hidden))
        quantity = np.ones(len(kernels.quantities))
        totals, peaks = (np.ones(len(a)) for a in (problem.model.totals_of, problem.model.peaks_of))
        nt, h = np.ones(len(kernels.tangents)), np.ones(problem.phases)
        nj = np.ones(len(kernels.joints))
        return cls(
            1.0,
            1.0,
            1.0,
            nq,
            nq,
            nq,
            nu,
            nc,
            nc,
            nc,
            nt,
            nt,
            path,
            quantity,
            totals,
            peaks,
            s,
            h,
            nj,
            nj,
            np.ones(problem.model.nw),
            np.ones(len(kernels.hit_quantities)),
            np.ones(len(problem.design)),
            nc,
            nc,
        )

    def named(self, problem: Problem) -> dict[str, float]:
        """Sizes by name, as results show them."""
        kernels = problem.kernels
        by_name = {"time": self.time, "cost": self.cost}
        for name, sizes in ((str, self.q), (velocity_name, self.v), (momentum_name, self.p)):
            by_name |= dict(zip(map(name, kernels.coordinates), sizes.tolist(), strict=True))
        by_name |= dict(zip(kernels.inputs, self.u.tolist(), strict=True))
        by_name |= dict(zip(problem.design, self.design.tolist(), strict=True))
        by_name |= {
            f"gap to {s}": size for s, size in zip(kernels.surfaces, self.gap.tolist(), strict=True)
        }
        return by_name
