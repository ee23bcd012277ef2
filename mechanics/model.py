"""A model with its parameter values: the kernels as functions of states and steps.

This is the one place that knows the names of the kernels and of their outputs beside the terms of
the program (:mod:`dmoc.program.rows`, :mod:`dmoc.program.laws.impact`) and the integrators of
:mod:`dmoc.simulation`.

Shapes
------
Positions ``q``, velocities ``v`` and momenta ``p`` have the shape (nq,) for one state or (n, nq)
for rows of states, inputs ``u`` (nu,) or (n, nu), times ``t`` () or (n,); results have the leading
axis of ``q``.  One row beside n others serves all.  Velocities and inputs that are not given
are zero, as is the time.  A step is the list of its n rows (q_k, q_kp1, u_k, u_kp1, h, t_k, q_i),
each of shape (n, size) or (1, size); its derivatives are those with respect to x_k, the same
quantities side by side.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dmoc.codegen.kernels import Array, Kernels
from dmoc.mechanics.algebra import solved

# Matrix outputs that are read here, and their kernels.
MATRICES = {
    "M_D": "dynamics_jac",
    "F_D": "dynamics_jac",
    "g_D": "surface_jac",
    "gamma_D": "gap_rate_jac",
    "tau_D": "tangent_jac",
    "sigma_D": "slide_rate_jac",
    "p_D": "momentum_jac",
    "C_d_D": "step_jac",
    "r_d_D": "path_jac",
    "r_s_D": "path_limit_jac",
    "s_D": "hidden_jac",
    "Phi_D": "terminal_cost_jac",
    "T_min_D": "min_time_jac",
}
# A point lies on a surface up to this share of the gap's own size: what rounding leaves of
# coordinates that were computed.
ROUNDING = 1e-12
# Relative change of a coordinate or parameter that tells how much of a gap comes from it.
NUDGE = 1e-3

Index = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Model:
    """Kernels bound to parameter values.

    Attributes
    ----------
    kernels : Kernels
    par : array of shape (1, npar)
        As :func:`dmoc.mechanics.model_values.parameter_row` reads them.
    """

    kernels: Kernels
    par: Array

    @cached_property
    def nq(self) -> int:
        """Number of coordinates."""
        return len(self.kernels.coordinates)

    @cached_property
    def nu(self) -> int:
        """Number of inputs."""
        return len(self.kernels.inputs)

    @cached_property
    def nc(self) -> int:
        """Number of surfaces."""
        return len(self.kernels.surfaces)

    @cached_property
    def nt(self) -> int:
        """Number of tangents."""
        return len(self.kernels.tangents)

    # Equations of motion --------------------------------------------------------------------------

    def equations(
        self, q: Array, v: Array | None = None, u: Array | None = None, t: ArrayLike = 0.0
    ) -> tuple[Array, Array]:
        """M and F of the equations of motion M q'' = F, shapes (..., nq, nq) and (..., nq)."""
        M, F = self._at("dynamics", q, self._state(v), self._input(u), _column(t))
        return M.reshape(*F.shape, self.nq), F

    def balance(self, q: Array, v: Array, u: Array, t: Array) -> tuple[Array, Array, Array]:
        """M, F and the power Q . v - dL/dt of rows of states, shapes (n, nq, nq), (n, nq), (n,)."""
        rows = (_rows(q), _rows(v), _rows(u), _column(t), self.par)
        M, F = self.kernels.call("dynamics", *rows)
        power = self.kernels.call("force", *rows)[1]
        return M.reshape(*F.shape, self.nq), F, power[:, 0]

    def mass(self, q: Array, t: ArrayLike = 0.0) -> Array:
        """M, shape (..., nq, nq)."""
        return self.equations(q, t=t)[0]

    def acceleration(
        self, q: Array, v: Array | None = None, u: Array | None = None, t: ArrayLike = 0.0
    ) -> Array:
        """M^-1 F, shape (..., nq); not a number where M is singular."""
        return solved(*self.equations(q, v, u, t))

    def equations_slopes(
        self, q: Array, v: Array | None = None, u: Array | None = None, t: ArrayLike = 0.0
    ) -> tuple[Array, Array]:
        """Derivatives of M and F with respect to (q, v), shapes (..., nq, nq, 2 nq), (..., nq, 2
        nq)."""
        M, F = self._at("dynamics_jac", q, self._state(v), self._input(u), _column(t))
        state = slice(2 * self.nq)  # the derivatives with respect to u and t follow
        forces = self._full("F_D", F)[..., state]
        return self._full("M_D", M)[..., state].reshape(
            *forces.shape[:-1], *forces.shape[-2:]
        ), forces

    def input_matrix(
        self, q: Array, v: Array | None = None, u: Array | None = None, t: ArrayLike = 0.0
    ) -> Array:
        """B = dQ/du, shape (..., nq, nu)."""
        (B,) = self._at("input_matrix", q, self._state(v), self._input(u), _column(t))
        return B.reshape(*B.shape[:-1], self.nq, self.nu)

    # Momentum and energy --------------------------------------------------------------------------

    def momentum(self, q: Array, v: Array | None = None, t: ArrayLike = 0.0) -> Array:
        """p = dL/dv, shape (..., nq)."""
        return self._at("momentum", q, self._state(v), _column(t))[0]

    def momentum_slopes(self, q: Array, v: Array | None = None, t: ArrayLike = 0.0) -> Array:
        """Derivatives of p with respect to (q, v, t), shape (..., nq, 2 nq + 1)."""
        return self._full("p_D", self._at("momentum_jac", q, self._state(v), _column(t))[0])

    def energy(self, q: Array, v: Array | None = None, t: ArrayLike = 0.0) -> Array:
        """E = v . p - L, shape (...)."""
        return self._at("energy", q, self._state(v), _column(t))[0][..., 0]

    def velocity(self, q: Array, p: Array, t: ArrayLike = 0.0) -> Array:
        """v = M^-1 (p - dL/dv(q, 0, t)), shape (..., nq); not a number where M is singular."""
        return solved(self.mass(q, t), p - self.momentum(q, t=t))

    # Surfaces -------------------------------------------------------------------------------------

    def gaps(self, q: Array, t: ArrayLike = 0.0) -> Array:
        """Gaps g <= 0, shape (..., nc)."""
        return self._at("surface", q, _column(t))[0] if self.nc else np.zeros((*q.shape[:-1], 0))

    def gap_slopes(self, q: Array, t: ArrayLike = 0.0) -> Array:
        """Derivatives of the gaps with respect to (q, t), shape (..., nc, nq + 1)."""
        if not self.nc:
            return np.zeros((*q.shape[:-1], 0, self.nq + 1))
        return self._full("g_D", self._at("surface_jac", q, _column(t))[0])

    def gap_rates(self, q: Array, v: Array, t: ArrayLike = 0.0) -> Array:
        """Rates of the gaps along a motion, shape (..., nc)."""
        return (
            self._at("gap_rate", q, _rows(v), _column(t))[0]
            if self.nc
            else np.zeros((*q.shape[:-1], 0))
        )

    def gap_sizes(self, q: Array, t: float = 0.0) -> Array:
        """Sizes of the gaps at one position, shape (nc,): the sum of what each coordinate and each
        parameter s contributes, |dg/ds s|.

        Rounding errors of a gap are about 1e-16 of its size, whatever its unit.
        """
        known = np.concatenate([q, self.par[0]])
        nudges = 1 + NUDGE * np.vstack([np.zeros(known.size), np.eye(known.size)])
        places, values = np.split(nudges * known, [self.nq], axis=1)
        rows = (np.ascontiguousarray(places), _column(t), np.ascontiguousarray(values))
        gaps = self.kernels.call("surface", *rows)[0] if self.nc else np.zeros((2, 0))
        return np.asarray(np.abs(gaps[1:] - gaps[0]).sum(axis=0) / NUDGE)

    def gap_rounding(self, q: Array, t: float = 0.0) -> Array:
        """Gaps up to which a position lies on the surfaces, shape (nc,)."""
        return ROUNDING * self.gap_sizes(q, t)

    def impulse_response(self, q: Array, n: Array, t: float = 0.0) -> tuple[Array, float]:
        """Change M^-1 n of the velocity by a unit impulse along n, shape (nq,), and n . M^-1 n."""
        change = solved(self.mass(q, t), n)
        return change, float(n @ change)

    def gap_accelerations(self, q: Array, v: Array, t: ArrayLike = 0.0) -> Array:
        """Second derivatives of the gaps along a motion without acceleration, shape (..., nc)."""
        return self._bent("gap_rate", "gamma_D", self.nc, q, v, t)

    # Friction -------------------------------------------------------------------------------------

    @cached_property
    def friction(self) -> Array:
        """Coefficients mu of surfaces and largest forces of rails, in the order of the tangents,
        shape (nt,)."""
        return self.kernels.call("friction", self.par)[0][0] if self.nt else np.zeros(0)

    def tangents(self, q: Array, t: ArrayLike = 0.0) -> Array:
        """Tangential positions tau, shape (..., nt)."""
        return self._at("tangent", q, _column(t))[0] if self.nt else np.zeros((*q.shape[:-1], 0))

    def tangent_slopes(self, q: Array, t: ArrayLike = 0.0) -> Array:
        """Derivatives of the tangential positions with respect to (q, t), shape (..., nt, nq +
        1)."""
        if not self.nt:
            return np.zeros((*q.shape[:-1], 0, self.nq + 1))
        return self._full("tau_D", self._at("tangent_jac", q, _column(t))[0])

    def slide_rates(self, q: Array, v: Array, t: ArrayLike = 0.0) -> Array:
        """Sliding velocities sigma, shape (..., nt)."""
        if not self.nt:
            return np.zeros((*q.shape[:-1], 0))
        return self._at("slide_rate", q, _rows(v), _column(t))[0]

    def slide_accelerations(self, q: Array, v: Array, t: ArrayLike = 0.0) -> Array:
        """Second derivatives of the tangential positions along a motion without acceleration, shape
        (..., nt)."""
        return self._bent("slide_rate", "sigma_D", self.nt, q, v, t)

    def _bent(self, kernel: str, slopes: str, size: int, q: Array, v: Array, t: ArrayLike) -> Array:
        """What a rate changes by along v and with the time."""
        if not size:
            return np.zeros((*q.shape[:-1], 0))
        rate_D = self._full(slopes, self._at(f"{kernel}_jac", q, _rows(v), _column(t))[0])
        bent = (rate_D[..., : self.nq] @ v[..., None])[..., 0]
        return np.asarray(bent + rate_D[..., 2 * self.nq])

    # Drawing --------------------------------------------------------------------------------------

    def drawing(self, q: Array, t: ArrayLike = 0.0) -> Array:
        """Values of the shapes of the drawing, shape (..., columns)."""
        if not self.kernels.has("drawing"):
            return np.zeros((*q.shape[:-1], 0))
        return self._at("drawing", q, _column(t))[0]

    # Costs ----------------------------------------------------------------------------------------

    def running_cost(self, q: Array, v: Array | None, u: Array, t: ArrayLike = 0.0) -> Array:
        """The integrand of the cost, shape (...)."""
        return self._at("running_cost", q, self._state(v), _rows(u), _column(t))[0][..., 0]

    def running_cost_curvatures(
        self, q: Array, v: Array | None, u: Array, t: ArrayLike = 0.0
    ) -> Array:
        """Second derivatives of the integrand in each input, shape (..., nu)."""
        return self._at("running_cost", q, self._state(v), _rows(u), _column(t))[1]

    def terminal_cost(self, q: Array, v: Array, t: ArrayLike) -> Array:
        """The cost of the state and the time at the end, shape (...)."""
        if not self.kernels.has("terminal_cost"):
            return np.zeros(q.shape[:-1])
        return self._at("terminal_cost", q, _rows(v), _column(t))[0][..., 0]

    def terminal_cost_slopes(self, q: Array, v: Array, t: ArrayLike) -> Array:
        """Its derivatives with respect to (q, v, t), shape (..., 2 nq + 1)."""
        if not self.kernels.has("terminal_cost"):
            return np.zeros((*q.shape[:-1], 2 * self.nq + 1))
        (slopes,) = self._at("terminal_cost_jac", q, _rows(v), _column(t))
        return self._full("Phi_D", slopes)[..., 0, :]

    # Steps ----------------------------------------------------------------------------------------

    def step_momenta(self, step: Sequence[Array]) -> tuple[Array, Array]:
        """Momenta at the start and at the end of steps, shape (n, nq) each."""
        r_minus, r_plus, _, _ = self.kernels.call("step", *step, self.par)
        return -r_minus, r_plus

    def step_costs(self, step: Sequence[Array]) -> Array:
        """Costs of steps, shape (n,)."""
        return self.kernels.call("step", *step, self.par)[2][:, 0]

    def step_cost_slopes(self, step: Sequence[Array]) -> Array:
        """Derivatives of the costs of steps with respect to x_k, shape (n, size of x_k)."""
        return self._full("C_d_D", self.kernels.call("step_jac", *step, self.par)[2])[:, 0]

    def step_cost_curvatures(self, step: Sequence[Array]) -> Array:
        """Second derivatives of the costs of steps in each entry of x_k, of its shape."""
        inside = step[-1].shape[1]
        weights = (
            np.zeros((1, self.nq)),
            np.zeros((1, self.nq)),
            np.ones((1, 1)),
            np.zeros((1, inside)),
        )
        (stored,) = self.kernels.call("step_hess", *step, self.par, *weights)
        rows, columns = self.kernels.pattern("step_hess", "hess")
        found = np.zeros((len(stored), sum(part.shape[1] for part in step)))
        found[:, rows[rows == columns]] = stored[:, rows == columns]
        return found

    def path(self, step: Sequence[Array]) -> Array:
        """Path constraints of steps, shape (n, nr), those of one place within the step after the
        other."""
        return self.kernels.call("path", *step, self.par)[0]

    def path_slopes(self, step: Sequence[Array]) -> Array:
        """Their derivatives with respect to x_k, shape (n, nr, size of x_k)."""
        return self._full("r_d_D", self.kernels.call("path_jac", *step, self.par)[0])

    def path_at(self, q: Array, v: Array, u: Array, t: ArrayLike) -> Array:
        """Path constraints of states, shape (..., nr)."""
        return self._at("path_limit", q, _rows(v), _rows(u), _column(t))[0]

    def path_slopes_at(self, q: Array, v: Array, u: Array, t: ArrayLike) -> Array:
        """Their derivatives with respect to (q, v, u, t), shape (..., nr, 2 nq + nu + 1)."""
        return self._full("r_s_D", self._at("path_limit_jac", q, _rows(v), _rows(u), _column(t))[0])

    def path_terms(self, q: Array, v: Array, u: Array, t: ArrayLike) -> Array:
        """Sums of the absolute values of the terms of the path constraints, shape (..., nr)."""
        (terms,) = self._at("path_terms", q, _rows(v), _rows(u), _column(t))
        counts = [row["terms"] for row in self.kernels.manifest["path_limits"]]
        begins = np.cumsum([0, *counts[:-1]])
        return np.asarray(np.add.reduceat(np.abs(terms), begins, axis=-1))

    # Hidden unknowns ------------------------------------------------------------------------------

    def hidden(self, q: Array, v: Array, u: Array, t: ArrayLike) -> Array:
        """What the hidden unknowns are at a minimum, shape (..., ns)."""
        if not self.kernels.has("hidden"):
            return np.zeros((*q.shape[:-1], 0))
        return self._at("hidden", q, _rows(v), _rows(u), _column(t))[0]

    def hidden_slopes(self, q: Array, v: Array, u: Array, t: ArrayLike) -> Array:
        """Their derivatives with respect to (q, v, u, t), shape (..., ns, 2 nq + nu + 1)."""
        if not self.kernels.has("hidden"):
            return np.zeros((*q.shape[:-1], 0, 2 * self.nq + self.nu + 1))
        return self._full("s_D", self._at("hidden_jac", q, _rows(v), _rows(u), _column(t))[0])

    # Minimal times --------------------------------------------------------------------------------

    @property
    def has_minimal_times(self) -> bool:
        """Whether there are shortest times to the surfaces: they stand still."""
        return self.kernels.has("min_time")

    def minimal_times(self, q_k: Array, q_kp1: Array, h: float, q_c: Array, a: Array) -> Array:
        """Shortest time to each surface at the acceleration a, from the middle of a phase's
        first step (q_k, q_kp1, h) to its collision q_c, shape (nc,)."""
        return self._at("min_time", q_k, _rows(q_kp1), _column(h), _rows(q_c), _rows(a))[0]

    def minimal_time_slopes(
        self, q_k: Array, q_kp1: Array, h: float, q_c: Array, a: Array
    ) -> Array:
        """Its derivatives with respect to (q_k, q_kp1, h, q_c, a), shape (nc, 4 nq + 1)."""
        rows = (_rows(q_kp1), _column(h), _rows(q_c), _rows(a))
        return self._full("T_min_D", self._at("min_time_jac", q_k, *rows)[0])

    # Rows -----------------------------------------------------------------------------------------

    def _at(self, kernel: str, q: Array, *rows: Array) -> tuple[Array, ...]:
        """Results of a kernel at rows of states, or at a single one without the leading axis."""
        found = self.kernels.call(kernel, _rows(q), *rows, self.par)
        return found if q.ndim > 1 else tuple([a[0] for a in found])

    def _state(self, v: Array | None) -> Array:
        return self._rest if v is None else _rows(v)

    def _input(self, u: Array | None) -> Array:
        return self._idle if u is None else _rows(u)

    @cached_property
    def _rest(self) -> Array:
        return np.zeros((1, self.nq))

    @cached_property
    def _idle(self) -> Array:
        return np.zeros((1, self.nu))

    @cached_property
    def _places(self) -> dict[str, tuple[list[int], Index, Index]]:
        """Shape, rows and columns of the stored entries of each matrix."""
        found = {}
        for name, kernel in MATRICES.items():
            if self.kernels.has(kernel):
                outputs = self.kernels.manifest["kernels"][kernel]["outputs"]
                (shape,) = (o["shape"] for o in outputs if o["name"] == name)
                found[name] = (shape, *self.kernels.pattern(kernel, name))
        return found

    def _full(self, matrix: str, stored: Array) -> Array:
        """Matrices from their stored entries, shape (..., rows, columns)."""
        shape, rows, columns = self._places[matrix]
        full = np.zeros((*stored.shape[:-1], *shape))
        full[..., rows, columns] = stored
        return full


def _rows(a: Array) -> Array:
    """Rows as kernels take them; a vector is one row."""
    a = np.ascontiguousarray(a)
    return a if a.ndim > 1 else a[None]


def _column(t: ArrayLike) -> Array:
    """Times, or other numbers one a row, as kernels take them."""
    return np.ascontiguousarray(t, dtype=float)[:, None]
