"""A model with its parameter values: the kernels as functions of states and steps.

This, :mod:`dmoc.mechanics.bound_kernels`, :mod:`dmoc.mechanics.friction` and
:mod:`dmoc.mechanics.cost` know the names of the kernels beside the terms of the program
(:mod:`dmoc.program.laws`) and the integrators of :mod:`dmoc.simulation`.

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

from collections.abc import Iterator, Sequence
from copy import copy
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dmoc.base.tolerances import ROUNDING, TINY
from dmoc.codegen.kernels import Array
from dmoc.mechanics.algebra import multipliers, solved, solved_transpose
from dmoc.mechanics.cost import CostModel
from dmoc.mechanics.friction import FrictionModel


class Model(FrictionModel, CostModel):
    """Kernels bound to parameter values, as functions of states and steps.

    Positions q and velocities v have the shape (..., nq), inputs u (..., nu), times t (...), in
    seconds; a step is (q_k, q_kp1, u_k, u_kp1, h, t_k, q_i) with n rows each.  Units are those of
    the model.
    """

    # Equations of motion --------------------------------------------------------------------------

    def equations(
        self, q: Array, v: Array | None = None, u: Array | None = None, t: ArrayLike = 0.0
    ) -> tuple[Array, Array]:
        """M and F of the equations of motion M q'' = F, shapes (..., nq, nq) and (..., nq)."""
        M, F = self._at("dynamics", q, self._state(v), self._input(u), t)
        return M.reshape(*F.shape, self.nq), F

    def balance(self, q: Array, v: Array, u: Array, t: Array) -> tuple[Array, Array, Array]:
        """M, F and the power Q . v - dL/dt of rows of states, shapes (n, nq, nq), (n, nq), (n,)."""
        rows = q, v, u, t, self.par
        M, F = self.kernels.call("dynamics", *rows)
        power = self.kernels.call("force", *rows)[1]
        return M.reshape(*F.shape, self.nq), F, power[:, 0]

    def mass(self, q: Array, t: ArrayLike = 0.0) -> Array:
        """M, shape (..., nq, nq)."""
        return self.equations(q, t=t)[0]

    def acceleration(
        self, q: Array, v: Array | None = None, u: Array | None = None, t: ArrayLike = 0.0
    ) -> Array:
        """M^-1 F where the joints hold, shape (..., nq); not a number where M is singular."""
        M, F = self.equations(q, v, u, t)
        if self.kept:
            bent = self.kept_accelerations(q, np.zeros_like(q) if v is None else v, t)
            F = self.with_joints(M, F, q, t, bent)
        return solved(M, F)

    def with_joints(
        self, M: Array, F: Array, q: Array, t: ArrayLike = 0.0, bent: Array | None = None
    ) -> Array:
        """Forces or impulses F with those of joints and closed grips beside them, F + J^T lam with
        J M^-1 (F + J^T lam) + bent = 0: one at each position (..., nq), or several (..., m, nq)."""
        if not self.kept:
            return F
        rows = F if F.ndim > q.ndim else F[..., None, :]
        J, lam = self.kept_slopes(q, t), self.joint_forces(M, rows, q, t, bent)
        return np.asarray((rows + lam @ J).reshape(F.shape))

    def joint_forces(
        self, M: Array, F: Array, q: Array, t: ArrayLike = 0.0, bent: Array | None = None
    ) -> Array:
        """Forces lam of joints and closed grips, shape (..., m, kept), beside several forces F
        (..., m, nq) at each position; the shortest where they say the same twice."""
        J = self.kept_slopes(q, t)
        response = solved_transpose(M, J)
        missing, A = F @ response + (0.0 if bent is None else bent[..., None, :]), J @ response
        if self.kept == 1:
            return -np.swapaxes(solved_transpose(A, missing), -1, -2)
        size = np.sqrt(np.maximum(np.diagonal(A, axis1=-2, axis2=-1), TINY))[..., None, :]
        rows = missing.reshape(-1, self.kept)
        A, size = (
            np.broadcast_to(a, shape)
            for a, shape in (
                (A[..., None, :, :], (*missing.shape, self.kept)),
                (size, missing.shape),
            )
        )
        lam = multipliers(A.reshape(-1, self.kept, self.kept), size.reshape(rows.shape), rows)
        return -lam.reshape(missing.shape)

    def responses(self, q: Array, B: Array, t: ArrayLike = 0.0) -> Array:
        """Changes M^-1 B^T of velocities by impulses B where the joints hold: of one at each
        position (..., nq) of this shape, of several (..., m, nq) as columns (..., nq, m)."""
        M = self.mass(q, t)
        impulses = self.with_joints(M, B, q, t)
        return solved(M, impulses) if B.ndim == q.ndim else solved_transpose(M, impulses)

    def equations_slopes(
        self, q: Array, v: Array | None = None, u: Array | None = None, t: ArrayLike = 0.0,
        *, a: Array,
    ) -> Array:  # fmt: skip
        """Derivatives of F - M a at accelerations a, shape (..., nq), with respect to (q, v), shape
        (..., nq, 2 nq)."""
        (R,) = self._at("residual_jac", q, self._state(v), self._input(u), t, a)
        return self._full("R_D", R)[..., : 2 * self.nq]

    def input_matrix(
        self, q: Array, v: Array | None = None, u: Array | None = None, t: ArrayLike = 0.0
    ) -> Array:
        """B = dQ/du, shape (..., nq, nu)."""
        (B,) = self._at("input_matrix", q, self._state(v), self._input(u), t)
        return B.reshape(*B.shape[:-1], self.nq, self.nu)

    # Momentum and energy --------------------------------------------------------------------------

    def momentum(self, q: Array, v: Array | None = None, t: ArrayLike = 0.0) -> Array:
        """p = dL/dv, shape (..., nq)."""
        return self._at("momentum", q, self._state(v), t)[0]

    def momentum_slopes(self, q: Array, v: Array | None = None, t: ArrayLike = 0.0) -> Array:
        """Derivatives of p with respect to (q, v, t), shape (..., nq, 2 nq + 1)."""
        return self._full("p_D", self._at("momentum_jac", q, self._state(v), t)[0])

    def energy(self, q: Array, v: Array | None = None, t: ArrayLike = 0.0) -> Array:
        """E = v . p - L, shape (...)."""
        return self._at("energy", q, self._state(v), t)[0][..., 0]

    def velocity(self, q: Array, p: Array, t: ArrayLike = 0.0) -> Array:
        """v = M^-1 (p - dL/dv(q, 0, t)), shape (..., nq); not a number where M is singular."""
        return solved(self.mass(q, t), p - self.momentum(q, t=t))

    @cached_property
    def moves_apart(self) -> tuple[bool, ...]:
        """Surfaces beside which something moves that has no mass in common with what their gaps
        depend on."""
        n, (rows, columns) = self.nq, self.kernels.pattern("momentum_jac", "p_D")
        joined, rates = np.eye(n, dtype=bool), (columns >= n) & (columns < 2 * n)
        joined[rows[rates], columns[rates] - n] = True
        joined = np.linalg.matrix_power((joined | joined.T).astype(float), n) > 0
        return tuple(not joined[list(on)].any(axis=0).all() for on in self.surface_coordinates)

    @property
    def has_force_equations(self) -> bool:
        """Whether there are the equations of accelerations and forces at a state."""
        return self.kernels.has("forces_point")

    # Surfaces -------------------------------------------------------------------------------------

    def gaps(self, q: Array, t: ArrayLike = 0.0) -> Array:
        """Gaps g <= 0, shape (..., nc)."""
        return self._values("surface", self.nc, q, t)

    def within(self, q: Array, t: ArrayLike = 0.0) -> Array:
        """Functions W, which are not negative where surfaces that have ends are, and 1 of others,
        shape (..., nc)."""
        return self._at("within", q, t)[0] if self.ends else np.ones((*q.shape[:-1], self.nc))

    def within_slopes(self, q: Array, t: ArrayLike = 0.0) -> Array:
        """Derivatives of W with respect to (q, t), shape (..., nc, nq + 1)."""
        if not self.ends:
            return np.zeros((*q.shape[:-1], self.nc, self.nq + 1))
        return self._matrix("W_D", (self.nc, self.nq + 1), q, t)

    def within_rates(self, q: Array, v: Array, t: ArrayLike = 0.0) -> Array:
        """Rates of W along a motion, shape (..., nc)."""
        if not self.ends:
            return np.zeros((*q.shape[:-1], self.nc))
        return self._at("within_rate", q, v, t)[0]

    @property
    def barrier_kernel(self) -> str:
        """The kernels of what is not positive before surfaces, and beside their ends."""
        return "barrier" if self.ends else "surface"

    def covered_gaps(self, q: Array, t: ArrayLike = 0.0) -> Array:
        """B <= 0, shape (..., nc): gaps, and of surfaces that have ends what is not positive beside
        these too."""
        return self._values("barrier", self.nc, q, t) if self.ends else self.gaps(q, t)

    def barriers(self, q: Array, t: ArrayLike = 0.0, least: Array | float = 0.0) -> Array:
        """Gaps, shape (..., nc), of surfaces that are there, with more than the ``least`` W, shape
        (nc,); minus infinity beyond their ends."""
        gaps = self.gaps(q, t)
        return np.where(self.within(q, t) > least, gaps, -np.inf) if self.ends else gaps

    def within_rounding(self, q: Array, t: float = 0.0) -> Array:
        """The W up to which a position lies at the ends of surfaces, shape (nc,)."""
        return ROUNDING * np.abs(self.within_slopes(q, t)[:, :-1]) @ np.abs(q)

    def gap_slopes(self, q: Array, t: ArrayLike = 0.0) -> Array:
        """Derivatives of the gaps with respect to (q, t), shape (..., nc, nq + 1)."""
        return self._matrix("g_D", (self.nc, self.nq + 1), q, t)

    def gap_rates(self, q: Array, v: Array, t: ArrayLike = 0.0) -> Array:
        """Rates of the gaps along a motion, shape (..., nc)."""
        return self._values("gap_rate", self.nc, q, v, t)

    def gap_accelerations(self, q: Array, v: Array, t: ArrayLike = 0.0) -> Array:
        """Second derivatives of the gaps along a motion without acceleration, shape (..., nc)."""
        return self._bent("gamma_D", self.nc, q, v, t)

    def gap_sizes(self, q: Array, t: ArrayLike = 0.0) -> Array:
        """Sizes of the gaps at positions (..., nq) and times (...), shape (..., nc): the sum of
        what each coordinate and each parameter s contributes, |dg/ds s|.

        Rounding errors of a gap are about 1e-16 of its size, whatever its unit.
        """
        return self._sizes("surface", self.nc, q, t)

    def gap_rounding(self, q: Array, t: float = 0.0) -> Array:
        """Gaps up to which a position lies on the surfaces, shape (nc,)."""
        return ROUNDING * self.gap_sizes(q, t)

    def impulse_response(self, q: Array, n: Array, t: float = 0.0) -> tuple[Array, float]:
        """Change M^-1 n of the velocity by a unit impulse along n, shape (nq,) each, and n . M^-1
        n, where the joints hold."""
        change = self.responses(q, n, t)
        return change, float(n @ change)

    def coefficients(self, restitution: Array, q: Array, v: Array, t: ArrayLike = 0.0) -> Array:
        """Coefficients of restitution (..., nc) of hits from states: the numbers (nc,), and those
        of the model's law where they are not a number."""
        by_law = np.isnan(restitution)
        if not by_law.any():
            return np.broadcast_to(restitution, (*q.shape[:-1], self.nc))
        unit = np.ones((1, self.nc))
        own = self._at("rebound", q, v, unit, t)[1]
        return np.where(by_law, own, restitution)

    # Crossings ------------------------------------------------------------------------------------

    def crossings(self, q: Array, v: Array, t: ArrayLike = 0.0) -> Array:
        """Crossing functions w, whose zeros are events, shape (..., nw)."""
        return self._values("crossing", self.nw, q, v, t)

    def crossing_slopes(self, q: Array, v: Array, t: ArrayLike = 0.0) -> Array:
        """Derivatives of the crossing functions with respect to (q, v, t), shape (..., nw, 2 nq +
        1)."""
        return self._matrix("w_D", (self.nw, 2 * self.nq + 1), q, v, t)

    def crossing_rates(self, q: Array, v: Array, a: Array, t: ArrayLike = 0.0) -> Array:
        """Rates of the crossing functions at accelerations a, shape (..., nw)."""
        slopes = self.crossing_slopes(q, v, t)
        moving = np.concatenate([v, a, np.ones((*q.shape[:-1], 1))], axis=-1)
        return np.asarray((slopes @ moving[..., None])[..., 0])

    # Friction -------------------------------------------------------------------------------------

    def tangents(self, q: Array, t: ArrayLike = 0.0) -> Array:
        """Tangential positions tau, shape (..., nt)."""
        return self._values("tangent", self.nt, q, t)

    def tangent_slopes(self, q: Array, t: ArrayLike = 0.0) -> Array:
        """Derivatives of the tangential positions with respect to (q, t), shape (..., nt, nq +
        1)."""
        return self._matrix("tau_D", (self.nt, self.nq + 1), q, t)

    def slide_accelerations(self, q: Array, v: Array, t: ArrayLike = 0.0) -> Array:
        """Second derivatives of the tangential positions along a motion without acceleration, shape
        (..., nt)."""
        return self._bent("sigma_D", self.nt, q, v, t)

    # Joints ---------------------------------------------------------------------------------------

    def joints(self, q: Array, t: ArrayLike = 0.0) -> Array:
        """Functions phi that joints keep at zero in every phase, shape (..., nj)."""
        return self._values("joint", self.nj, q, t)

    def joint_slopes(self, q: Array, t: ArrayLike = 0.0) -> Array:
        """Derivatives of phi with respect to (q, t), shape (..., nj, nq + 1). A constraint of a
        rate alone has those of the rate with respect to v, and the rate at rest."""
        return self._matrix("phi_D", (self.nj, self.nq + 1), q, t)

    @cached_property
    def joints_in_place(self) -> NDArray[np.bool_]:
        """Joints that keep a place, shape (nj,); the others keep a rate alone, and their phi is
        zero wherever they are."""
        others = self.kernels.manifest.rate_constraints
        return np.array([name not in others for name in self.kernels.joints], dtype=bool)

    def joint_rates(self, q: Array, v: Array, t: ArrayLike = 0.0) -> Array:
        """Rates of the joints along a motion, dphi/dt or c, shape (..., nj)."""
        return self._values("joint_rate", self.nj, q, v, t)

    def joint_accelerations(self, q: Array, v: Array, t: ArrayLike = 0.0) -> Array:
        """Second derivatives of phi along a motion without acceleration, shape (..., nj)."""
        return self._bent("phi_dot_D", self.nj, q, v, t)

    def joint_sizes(self, q: Array, t: ArrayLike = 0.0) -> Array:
        """Sizes of phi at positions (..., nq) and times (...), shape (..., nj), as those of
        gaps."""
        return self._sizes("joint", self.nj, q, t)

    def joint_rounding(self, q: Array, t: float = 0.0) -> Array:
        """Largest phi of positions that fit the joints up to rounding, shape (nj,)."""
        return ROUNDING * self.joint_sizes(q, t)

    # Joints, and grips that are closed ------------------------------------------------------------

    gripped: tuple[int, ...] = ()

    def gripping(self, gripped: tuple[int, ...]) -> Model:
        """The same model with places of grips, by their numbers, that are closed whatever else
        touches."""
        there = copy(self)
        there.__dict__["gripped"] = gripped
        return there

    @cached_property
    def strength(self) -> Array:
        """Forces beyond which grips with a strength let go, shape (rows of par, grips)."""
        if not self.kernels.has("strength"):
            return np.zeros((1, 0))
        return np.asarray(self.kernels.call("strength", self.par)[0])

    def spared(self, normal: Array, closed: Sequence[int]) -> Iterator[tuple[int, Array]]:
        """The first places of the grips with a strength F that are among those closed, and
        F - |R| beside forces (n, nc)."""
        for i, places in enumerate(self.contacts.of_strong):
            if places[0] in closed:
                load = np.sqrt((normal[:, list(places)] ** 2).sum(axis=1))
                yield places[0], self.strength[:, i] - load

    @property
    def kept(self) -> int:
        """Number of joints and of places of closed grips."""
        return self.nj + len(self.gripped)

    def kept_slopes(self, q: Array, t: ArrayLike = 0.0) -> Array:
        """Slopes of joints and, against the gaps, of closed grips, shape (..., kept, nq)."""
        J = self.joint_slopes(q, t)[..., :-1]
        if not self.gripped:
            return J
        own = self.gap_slopes(q, t)[..., list(self.gripped), :-1]
        return np.concatenate([J, -own], axis=-2) if self.nj else -own

    def kept_accelerations(self, q: Array, v: Array, t: ArrayLike = 0.0) -> Array:
        """Second derivatives of both along a motion without acceleration, shape (..., kept)."""
        parts = [self.joint_accelerations(q, v, t)] if self.nj else []
        if self.gripped:
            parts.append(-self.gap_accelerations(q, v, t)[..., list(self.gripped)])
        return np.concatenate(parts, axis=-1)

    # Drawing --------------------------------------------------------------------------------------

    def drawing(self, q: Array, t: ArrayLike = 0.0) -> Array:
        """Values of the shapes of the drawing, shape (..., columns)."""
        if not self.kernels.has("drawing"):
            return np.zeros((*q.shape[:-1], 0))
        return self._at("drawing", q, t)[0]

    # Steps ----------------------------------------------------------------------------------------

    def step_momenta(self, step: Sequence[Array]) -> tuple[Array, Array]:
        """Momenta at the start and at the end of steps, shape (n, nq) each."""
        return self.step_balance(step)[:2]

    def steps(self, step: Sequence[Array]) -> tuple[Array, Array, Array]:
        """Momenta at the start and at the end of steps, shape (n, nq) each, and their costs, shape
        (n,)."""
        r_minus, r_plus, cost, _ = self.kernels.call("step", *step, self.par)
        return -r_minus, r_plus, cost[:, 0]

    def step_balance(self, step: Sequence[Array]) -> tuple[Array, Array, Array]:
        """Momenta at the start and at the end of steps, shape (n, nq) each, and residuals of the
        equations of the nodes inside steps, shape (n, inside, nq)."""
        r_minus, r_plus, _, r_i = self.kernels.call("step", *step, self.par)
        return -r_minus, r_plus, r_i.reshape(len(r_i), -1, self.nq)

    # Minimal times --------------------------------------------------------------------------------

    @property
    def has_minimal_times(self) -> bool:
        """Whether there are shortest times to the surfaces: they stand still."""
        return self.kernels.has("min_time")

    def minimal_times(self, q_k: Array, q_kp1: Array, h: float, q_c: Array, a: Array) -> Array:
        """Shortest time to each surface at the acceleration a, from the middle of a phase's first
        step (q_k, q_kp1, h) to its collision q_c, shape (nc,), in seconds; all others have the
        shape (nq,)."""
        return self._at("min_time", q_k, q_kp1, h, q_c, a)[0]

    def minimal_time_slopes(
        self, q_k: Array, q_kp1: Array, h: float, q_c: Array, a: Array
    ) -> Array:
        """Derivatives of the minimal times with respect to (q_k, q_kp1, h, q_c, a), shape (nc, 4 nq
        + 1)."""
        return self._full("T_min_D", self._at("min_time_jac", q_k, q_kp1, h, q_c, a)[0])
