"""What a model minimises and keeps within limits: its cost, path constraints, quantities, totals
and objective, as functions of states and steps in the shapes of :mod:`dmoc.mechanics.model`."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dmoc.codegen.kernels import Array
from dmoc.mechanics.bound_kernels import BoundKernels


class CostModel(BoundKernels):
    """Kernels bound to parameter values, and what is minimised and kept within limits."""

    # Costs ----------------------------------------------------------------------------------------

    def running_cost(self, q: Array, v: Array | None, u: Array, t: ArrayLike = 0.0) -> Array:
        """The integrand of the cost, shape (...)."""
        return self._at("running_cost", q, self._state(v), u, t)[0][..., 0]

    def running_cost_curvatures(
        self, q: Array, v: Array | None, u: Array, t: ArrayLike = 0.0
    ) -> Array:
        """Second derivatives of the integrand in each input, shape (..., nu)."""
        return self._at("running_cost", q, self._state(v), u, t)[1]

    @property
    def has_terminal_cost(self) -> bool:
        """Whether there is a cost of the end."""
        return self.kernels.has("terminal_cost")

    def terminal_cost(self, q: Array, v: Array, t: ArrayLike) -> Array:
        """The cost of the state and the time at the end, shape (...)."""
        size = int(self.kernels.has("terminal_cost"))
        cost = self._values("terminal_cost", size, q, v, t)
        return np.asarray(cost.sum(axis=-1))

    def terminal_cost_slopes(self, q: Array, v: Array, t: ArrayLike) -> Array:
        """Derivatives of the terminal cost with respect to (q, v, t), shape (..., 2 nq + 1)."""
        size = int(self.kernels.has("terminal_cost"))
        slopes = self._matrix("Phi_D", (size, 2 * self.nq + 1), q, v, t)
        return np.asarray(slopes.sum(axis=-2))

    def step_costs(self, step: Sequence[Array]) -> Array:
        """Costs of steps, shape (n,)."""
        return self.kernels.call("step", *step, self.par)[2][:, 0]

    def step_cost_slopes(self, step: Sequence[Array]) -> Array:
        """Derivatives of the costs of steps with respect to x_k, shape (n, size of x_k)."""
        return self._full("C_d_D", self.kernels.call("step_jac", *step, self.par)[2])[:, 0]

    def step_cost_curvatures(self, step: Sequence[Array]) -> Array:
        """Second derivatives of the costs of steps in each entry of x_k, shape (n, size of x_k)."""
        inside = step[-1].shape[1]
        weights = (
            np.zeros((1, self.nq)),
            np.zeros((1, self.nq)),
            np.ones((1, 1)),
            np.zeros((1, inside)),
        )
        (stored,) = self.kernels.call("step_hess", *step, self.par, *weights)
        rows, columns = self.kernels.pattern("step_hess", "hess")
        curvatures = np.zeros((len(stored), sum(part.shape[1] for part in step)))
        curvatures[:, rows[rows == columns]] = stored[:, rows == columns]
        return curvatures

    # Hidden unknowns ------------------------------------------------------------------------------

    def hidden(self, q: Array, v: Array, u: Array, t: ArrayLike) -> Array:
        """Values of the hidden unknowns at a minimum, shape (..., ns)."""
        return self._values("hidden", self.ns, q, v, u, t)

    def lifted_costs(self, step: Sequence[Array]) -> Array:
        """Costs of the hidden unknowns, which stand behind x_k, in each step, shape (n,)."""
        if not self.ns:
            return np.zeros(len(step[0]))
        return self.kernels.call("lifted", *step, self.par)[0][:, 0]

    def lifted_cost_slopes(self, step: Sequence[Array]) -> Array:
        """Derivatives of the costs of hidden unknowns with respect to the step, shape (n, size of
        the step)."""
        return self._full("C_s_d_D", self.kernels.call("lifted_jac", *step, self.par)[0])[:, 0]

    def hidden_slopes(self, q: Array, v: Array, u: Array, t: ArrayLike) -> Array:
        """Derivatives of the hidden unknowns with respect to (q, v, u, t), shape (..., ns, 2 nq +
        nu + 1)."""
        shape = self.ns, 2 * self.nq + self.nu + 1
        return self._matrix("s_D", shape, q, v, u, t)

    # Path constraints, quantities -----------------------------------------------------------------

    def path(self, step: Sequence[Array], kind: str = "path") -> Array:
        """Path constraints of steps, or the "quantity" there, shape (n, nr), one place within the
        step after the other. Behind x_k of a quantity come the forces at its points, if quantities
        contain any."""
        return self.kernels.call(kind, *step, self.par)[0]

    def path_slopes(self, step: Sequence[Array], kind: str = "path") -> Array:
        """Derivatives of path constraints, or quantities, with respect to the step, shape (n, nr,
        size of the step)."""
        (slopes,) = self.kernels.call(f"{kind}_jac", *step, self.par)
        return self._full({"path": "r_d_D", "quantity": "z_d_D"}[kind], slopes)

    def path_at(self, q: Array, v: Array, u: Array, t: ArrayLike) -> Array:
        """Path constraints of states, shape (..., nr)."""
        return self._at("path_limit", q, v, u, t)[0]

    def path_slopes_at(self, q: Array, v: Array, u: Array, t: ArrayLike) -> Array:
        """Derivatives of path constraints with respect to (q, v, u, t), shape (..., nr, 2 nq + nu +
        1)."""
        (slopes,) = self._at("path_limit_jac", q, v, u, t)
        return self._full("r_s_D", slopes)

    def path_terms(self, q: Array, v: Array, u: Array, t: ArrayLike) -> Array:
        """Sums of the absolute values of the terms of the path constraints, shape (..., nr)."""
        (terms,) = self._at("path_terms", q, v, u, t)
        counts = [row["terms"] for row in self.kernels.manifest.path_limits]
        begins = np.cumsum([0, *counts[:-1]])
        return np.asarray(np.add.reduceat(np.abs(terms), begins, axis=-1))

    @property
    def nz(self) -> int:
        """Number of quantities."""
        return len(self.kernels.quantities)

    def quantities(
        self, q: Array, v: Array, u: Array, t: ArrayLike, y: Array | None = None
    ) -> Array:
        """Quantities of states with accelerations and forces y (..., ny), shape (..., nz)."""
        rows = v, u, t, *self._pushed(y)
        return self._values("quantity_value", self.nz, q, *rows)

    def quantity_slopes(
        self, q: Array, v: Array, u: Array, t: ArrayLike, y: Array | None = None
    ) -> Array:
        """Derivatives of quantities with respect to (q, v, u, t, y), shape (..., nz, 2 nq + nu + 1
        + ny)."""
        shape = self.nz, 2 * self.nq + self.nu + 1 + self.ny
        rows = v, u, t, *self._pushed(y)
        return self._matrix("z_s_D", shape, q, *rows)

    def _pushed(self, y: Array | None) -> tuple[Array, ...]:
        """Accelerations and forces as kernels of quantities take them; none are zero."""
        if not self.ny:
            return ()
        return (np.zeros((1, self.ny)) if y is None else y,)

    # Totals, objective ---------------------------------------------------------------------------

    @cached_property
    def totals_of(self) -> list[str]:
        """Names of the totals: of the integrals, and of the final time where the objective has
        it."""
        return list(self.kernels.manifest.totals)

    def integrands(self, q: Array, v: Array, u: Array, t: ArrayLike) -> Array:
        """Integrands of the integrals as they were stated, shape (..., number)."""
        number = len(self.kernels.integrals)
        return self._values("integrand", number, q, v, u, t)

    @cached_property
    def hit_sums(self) -> NDArray[np.intp]:
        """What hits add to the integrals: rows of the integral, the surface, and the number of the
        hit, 0 for all of them, shape (terms, 3)."""
        rows = np.array(self.kernels.manifest.hit_sums, dtype=np.intp)
        return np.asarray(rows.reshape(-1, 3))

    def hit_terms(self, q: Array, v_a: Array, v_c: Array, lam: Array, t: ArrayLike) -> Array:
        """What hits would add to integrals, from places (n, nq), velocities before and after them
        (n, nq) and impulses of all surfaces (n, nc), shape (n, terms)."""
        return self._values("hit_sum", len(self.hit_sums), q, v_a, v_c, lam, t)

    def counting(self, surfaces: Sequence[Sequence[int]]) -> NDArray[np.bool_]:
        """Which of these terms the events count, from the surfaces that each hits or lands, shape
        (events, terms)."""
        return self._counting(surfaces, self.hit_sums[:, 1:])

    def _counting(
        self, surfaces: Sequence[Sequence[int]], of: NDArray[np.intp]
    ) -> NDArray[np.bool_]:
        """Which of some surfaces and numbers of hits, shape (terms, 2), each event is."""
        counts = np.zeros((len(surfaces), len(of)), dtype=bool)
        if not len(of):
            return counts
        so_far = np.zeros(self.nc, dtype=int)
        for row, hit in zip(counts, surfaces, strict=True):
            so_far[list(hit)] += 1
            for i, (j, number) in enumerate(of):
                row[i] = j in hit and number in (0, so_far[j])
        return counts

    @cached_property
    def _hits_of_quantities(self) -> NDArray[np.intp]:
        """The surface of each quantity of hits, and the number of the hit, 0 for all of them."""
        rows = np.array(list(self.kernels.manifest.hit_quantities.values()), dtype=np.intp)
        return np.asarray(rows.reshape(-1, 2))

    def hit_quantities(self, q: Array, v_a: Array, v_c: Array, lam: Array, t: ArrayLike) -> Array:
        """What the quantities of hits would be, from states as :meth:`hit_terms` has them, shape
        (n, number)."""
        return self._values("hit_value", len(self._hits_of_quantities), q, v_a, v_c, lam, t)

    def hits_of_quantities(self, surfaces: Sequence[Sequence[int]]) -> NDArray[np.bool_]:
        """Which quantities of hits the events have, from the surfaces that each hits or lands,
        shape (events, number)."""
        return self._counting(surfaces, self._hits_of_quantities)

    @property
    def hit_peaks_of(self) -> list[tuple[int, bool]]:
        """Quantities of hits whose peaks the objective has, and whether of both signs."""
        return [(int(j), bool(both)) for j, both in self.kernels.manifest.hit_peaks]

    @cached_property
    def peaks_of(self) -> list[tuple[int, bool]]:
        """Quantities whose peaks the objective has, and whether of both signs."""
        return [(int(j), bool(both)) for j, both in self.kernels.manifest.peaks]

    @cached_property
    def peak_names(self) -> list[str]:
        """Names of the peaks, those of hits last."""
        along, at_hits = self.kernels.quantities, self.kernels.hit_quantities
        peaks = [(along[j], both) for j, both in self.peaks_of]
        peaks += [(at_hits[j], both) for j, both in self.hit_peaks_of]
        return [f"{'largest' if both else 'peak'} {name}" for name, both in peaks]

    def integrals(self, step: Sequence[Array]) -> Array:
        """Parts of the totals in each step, with its hidden unknowns behind x_k, shape (n,
        number)."""
        if not self.totals_of:
            return np.zeros((len(step[0]), 0))
        return self.kernels.call("integral", *step, self.par)[0]

    def totals(self, step: Sequence[Array]) -> Array:
        """The totals over steps, shape (number,)."""
        return np.asarray(self.integrals(step).sum(axis=0))

    def hit_peaks(self, values: Array, there: NDArray[np.bool_]) -> Array:
        """The peaks of quantities of hits, from values and where these are there, shape (events,
        number) each; zero where none is."""
        here = np.where(there, values, 0.0)
        return np.array(
            [
                (np.abs(here) if both else here)[:, j].max(initial=0.0)
                for j, both in self.hit_peaks_of
            ]
        )

    def peaks(self, step: Sequence[Array]) -> Array:
        """The peaks over steps, at their points, shape (number,), without those of hits."""
        if not self.peaks_of:
            return np.zeros(0)
        z = self.path(step, "quantity").reshape(-1, self.nz)
        return np.array([(np.abs(z) if both else z)[:, j].max() for j, both in self.peaks_of])

    @property
    def has_objective(self) -> bool:
        """Whether something is minimised beside the cost."""
        return self.kernels.has("objective")

    def objective(
        self, totals: Array, peaks: Array, start: tuple[Array, Array], end: tuple[Array, Array]
    ) -> float:
        """The objective of totals, shape (number,), peaks, shape (peaks,), and positions and
        velocities at both ends, shape (nq,) each."""
        if not self.has_objective:
            return 0.0
        rows = totals, peaks, *start, *end, self.par
        return float(self.kernels.call("objective", *rows)[0][0, 0])
