"""Sizes of a problem's quantities, by which unknowns, constraints and cost are divided."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

from dmoc.base.names import momentum_name, velocity_name
from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.problem.problem import Problem

SINGLE = ("time", "cost", "energy")  # sizes that are numbers


@record(frozen=True, eq=False)
class Scale:
    """Sizes: time, cost and energy; coordinates, velocities and momenta (nq,), inputs (nu,);
    gaps, their rates and impulses (nc,); sliding velocities and friction impulses (nt,); path
    constraints; quantities; totals and peaks of an objective; hidden unknowns; step sizes
    (phases,); rates and impulses of the constraints of the model (nj,); crossing functions (nw,);
    quantities of hits; design parameters; ends of surfaces and their rates (nc,).  Those of several
    problems have a leading axis for them."""

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
        kernels, model = problem.kernels, problem.model
        nq, nc, nt, nj = len(kernels.coordinates), model.nc, model.nt, model.nj
        counts = {
            "q": nq, "v": nq, "p": nq, "u": len(kernels.inputs), "gap": nc, "rate": nc, "lam": nc,
            "slide": nt, "friction": nt, "path": len(kernels.manifest.path_rows),
            "quantity": len(kernels.quantities), "totals": len(model.totals_of),
            "peaks": len(model.peaks_of), "s": len(kernels.manifest.hidden), "h": problem.phases,
            "joint_rate": nj, "reaction": nj, "crossing": model.nw,
            "hit_quantity": len(kernels.hit_quantities), "design": len(problem.design),
            "within": nc, "within_rate": nc,
        }  # fmt: skip
        return cls(1.0, 1.0, 1.0, **{name: np.ones(count) for name, count in counts.items()})

    def spread(self, count: int) -> Scale:
        """The same sizes, all with a leading axis for so many problems."""
        parts = dict[str, Any]()
        for f in fields(self):
            part = np.asarray(getattr(self, f.name))
            own = part.shape[part.ndim - (f.name not in SINGLE) :]
            parts[f.name] = np.broadcast_to(part, (count, *own))
        return Scale(**parts)

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
