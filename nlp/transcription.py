"""The nonlinear program of a problem: cost, constraints, derivatives and bounds, assembled from step elements.

Equality constraints (c = 0), node by node along the whole chain of steps::

    momentum   r_plus(k-1) + r_minus(k) - lam grad g(q_c) [+ p_B at the start, - p_E at the end] = 0
    energy     e_plus(last step before) - e_minus(first step after) = 0            at each collision
    contact    g(q_c) = 0                                                          at each collision
    velocity   p_B - dL/dv(q_0, v_B) = 0, p_E - dL/dv(q_N, v_E) = 0                where velocities are bounded

Inequality constraints (d >= 0): gaps -g(q_k) at every node, path constraints r_d of every step, bounds of the final time, and
T_i - T_min of each phase before a collision.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dmoc.codegen.kernels import Array
from dmoc.nlp.feasibility import minimal_time
from dmoc.nlp.labels import Block, equality_blocks, inequality_blocks
from dmoc.nlp.layout import Index, Layout
from dmoc.nlp.problem import Problem
from dmoc.nlp.sparse import SparsePattern

Matrix: TypeAlias = Any  # a SciPy CSR matrix; SciPy ships no type information
NDBool = NDArray[np.bool_]
# The smallest step that is distinguishable from none: shorter steps divide rounding errors by h^2.
SMALLEST_STEP = 1e-7
# Where collisions would rather merge, a phase between them shrinks to nothing and its equations with it: share of the largest final time
# that a phase between collisions keeps.
SHORTEST_PHASE = 1e-3


class Transcription:
    """The nonlinear program of a :class:`Problem`.

    Attributes
    ----------
    layout : Layout
    lower, upper : arrays of shape (n,)
        Bounds of the unknowns.
    equalities, inequalities : lists of Block
    """

    def __init__(self, problem: Problem, minimal_times: bool | None = None) -> None:
        self.problem = problem
        self.layout = Layout.of(problem)
        self.par = problem.parameter_values
        self.minimal_times = problem.minimal_times if minimal_times is None else minimal_times
        self.surfaces = np.array([problem.kernels.surfaces.index(s) for s in problem.sequence], dtype=np.intp)
        self.lower, self.upper = self._bounds()

    # Constraints by name ---------------------------------------------------------------------------------------------

    @cached_property
    def equalities(self) -> list[Block]:
        return equality_blocks(self.problem, self.layout)

    @cached_property
    def inequalities(self) -> list[Block]:
        return inequality_blocks(self.problem, self.layout, self.gap_constraints, self._timed)

    @property
    def n(self) -> int:
        return self.layout.size

    @cached_property
    def n_eq(self) -> int:
        return sum(len(b.rows) for b in self.equalities)

    @cached_property
    def n_in(self) -> int:
        return sum(len(b.rows) for b in self.inequalities)

    def equality_rows(self, name: str) -> Index:
        return next(b.rows for b in self.equalities if b.name == name)

    def inequality_rows(self, name: str) -> Index:
        return next(b.rows for b in self.inequalities if b.name == name)

    @cached_property
    def gap_constraints(self) -> tuple[Index, Index]:
        """Node and surface of each gap constraint: all but those that hold with equality at collisions."""
        keep = np.ones((self.layout.total + 1, len(self.problem.kernels.surfaces)), dtype=bool)
        keep[self.layout.collision_nodes, self.surfaces] = False
        return np.nonzero(keep)  # type: ignore[return-value]

    @cached_property
    def _timed(self) -> list[int]:
        """Phases with a minimal time: those before a collision, where every input is bounded."""
        bounded = self.problem.nu > 0 and bool(np.isfinite(self.problem.input_bounds).all())
        return list(range(len(self.surfaces))) if self.minimal_times and bounded else []

    # Bounds ----------------------------------------------------------------------------------------------------------

    def _bounds(self) -> tuple[Array, Array]:
        lay, problem = self.layout, self.problem
        box = np.tile((-np.inf, np.inf), (lay.size, 1))
        latest = problem.final_time_bounds[1]
        shortest = SHORTEST_PHASE * latest if len(problem.sequence) and np.isfinite(latest) else 0.0
        durations = np.maximum(problem.duration_bounds, [shortest, 0.0]) / np.array(lay.steps)[:, None]
        box[lay.index_h] = np.maximum(durations, SMALLEST_STEP)
        box[lay.index_q] = problem.coordinate_bounds
        box[lay.index_u] = problem.input_bounds
        box[lay.index_lam, 0] = 0.0
        for node, boundary, p, v in (
            (0, problem.start_bounds, lay.index_p_B, lay.index_v_B),
            (-1, problem.goal_bounds, lay.index_p_E, lay.index_v_E),
        ):
            at = lay.index_q[node]
            box[at, 0] = np.maximum(box[at, 0], boundary.position[:, 0])
            box[at, 1] = np.minimum(box[at, 1], boundary.position[:, 1])
            box[p] = boundary.momentum
            if len(v):
                box[v] = boundary.velocity
        return box[:, 0].copy(), box[:, 1].copy()

    # Cost ------------------------------------------------------------------------------------------------------------

    def cost(self, x: Array) -> float:
        return float(self._step(x)[2].sum())

    def cost_gradient(self, x: Array) -> Array:
        values = self.problem.kernels.call("step_jac", *self._arguments(x))[2]
        columns = self.layout.index_z[:, self._columns("step_jac", "C_d_D_z")]
        return np.bincount(columns.ravel(), weights=values.ravel(), minlength=self.n).astype(float)

    # Equality constraints --------------------------------------------------------------------------------------------

    def equality(self, x: Array) -> Array:
        """c(x), shape (n_eq,)."""
        lay = self.layout
        r_minus, r_plus, _ = self._step(x)
        momentum = np.zeros((lay.total + 1, lay.nq))
        momentum[:-1] += r_minus
        momentum[1:] += r_plus
        momentum[0] += x[lay.index_p_B]
        momentum[-1] -= x[lay.index_p_E]
        parts = [momentum]
        if len(self.surfaces):
            at = self._collision_positions(x)
            momentum[lay.collision_nodes] -= self.problem.kernels.call("normal", at, self._impulses(x), self.par)[0]
            gaps = self.problem.kernels.call("surface", at, self.par)[0]
            parts += [self._energies(x), gaps[np.arange(len(at)), self.surfaces]]
        for _, node, p, v in self._velocity_ends:
            parts.append(x[p] - self.problem.kernels.call("legendre", x[lay.index_q[node]][None], x[v][None], self.par)[0])
        return np.concatenate([part.ravel() for part in parts])

    def equality_jacobian(self, x: Array) -> Matrix:
        """dc/dx, shape (n_eq, n)."""
        kernels = self.problem.kernels
        r_minus, r_plus, _ = kernels.call("step_jac", *self._arguments(x))
        one = np.ones(self.layout.nq)
        values = [r_minus, r_plus, one, -one]
        if len(self.surfaces):
            at = self._collision_positions(x)
            before, after = self._collision_steps(x)
            values.append(-kernels.call("normal_jac", at, self._impulses(x), self.par)[0][self._normal_entries])
            values.append(kernels.call("impact_jac", *before)[0])
            values.append(-kernels.call("impact_jac", *after)[1])
            values.append(kernels.call("surface_jac", at, self.par)[0][self._active_gradients])
        for _, node, p, v in self._velocity_ends:
            state = (x[self.layout.index_q[node]][None], x[v][None])
            values += [np.ones(len(p)), -kernels.call("legendre_jac", *state, self.par)[0]]
        return self._equality_pattern.matrix(values)

    @cached_property
    def _equality_pattern(self) -> SparsePattern:
        lay, kernels = self.layout, self.problem.kernels
        node_rows = self.equality_rows("momentum").reshape(lay.total + 1, lay.nq)
        blocks = []
        for output, rows in (("r_minus_D_z", node_rows[:-1]), ("r_plus_D_z", node_rows[1:])):
            r, c = kernels.pattern("step_jac", output)
            blocks.append((rows[:, r], lay.index_z[:, c]))
        blocks.append((node_rows[0], lay.index_p_B))
        blocks.append((node_rows[-1], lay.index_p_E))
        if len(self.surfaces):
            nodes = lay.collision_nodes
            r, c = kernels.pattern("normal_jac", "n_D_ql")
            unknowns = self._normal_unknowns
            blocks.append((node_rows[nodes][:, r][self._normal_entries], unknowns[:, c][self._normal_entries]))
            energy = self.equality_rows("energy")[:, None]
            blocks.append((energy, lay.index_z[nodes - 1][:, self._columns("impact_jac", "e_plus_D_z")]))
            blocks.append((energy, lay.index_z[nodes][:, self._columns("impact_jac", "e_minus_D_z")]))
            _, c = kernels.pattern("surface_jac", "g_D_q")
            contact = np.broadcast_to(self.equality_rows("contact")[:, None], (len(nodes), len(c)))
            blocks.append((contact[self._active_gradients], lay.index_q[nodes][:, c][self._active_gradients]))
        for rows, node, p, v in self._velocity_ends:
            r, c = kernels.pattern("legendre_jac", "p_D_s")
            blocks += [(rows, p), (rows[r], np.concatenate([lay.index_q[node], v])[c])]
        return SparsePattern((self.n_eq, self.n), blocks)

    # Inequality constraints ------------------------------------------------------------------------------------------

    def inequality(self, x: Array) -> Array:
        """d(x) >= 0, shape (n_in,)."""
        lay, kernels = self.layout, self.problem.kernels
        parts = []
        if kernels.has("surface"):
            parts.append(-kernels.call("surface", x[lay.index_q], self.par)[0][self.gap_constraints])
        if kernels.has("path"):
            parts.append(kernels.call("path", *self._arguments(x))[0])
        time = x[lay.index_h] @ np.array(lay.steps)
        low, high = self.problem.final_time_bounds
        parts.append(np.array(([time - low] if low > 0 else []) + ([high - time] if np.isfinite(high) else [])))
        parts.append(np.array([self._time_reserve(x, i)[0] for i in self._timed]))
        return np.concatenate([part.ravel() for part in parts])

    def inequality_jacobian(self, x: Array) -> Matrix:
        """dd/dx, shape (n_in, n)."""
        lay, kernels = self.layout, self.problem.kernels
        values = []
        if kernels.has("surface"):
            values.append(-kernels.call("surface_jac", x[lay.index_q], self.par)[0][self._gap_entries])
        if kernels.has("path"):
            values.append(kernels.call("path_jac", *self._arguments(x))[0])
        for name, sign in (("final time >=", 1.0), ("final time <=", -1.0)):
            for _ in self.inequality_rows(name):
                values.append(sign * np.array(lay.steps, dtype=float))
        values += [self._time_reserve(x, i)[1] for i in self._timed]
        return self._inequality_pattern.matrix(values)

    @cached_property
    def _inequality_pattern(self) -> SparsePattern:
        lay, kernels = self.layout, self.problem.kernels
        blocks = []
        if kernels.has("surface"):
            row_of = np.full((lay.total + 1, len(kernels.surfaces)), -1)
            row_of[self.gap_constraints] = self.inequality_rows("gap")
            r, c = kernels.pattern("surface_jac", "g_D_q")
            blocks.append((row_of[:, r][self._gap_entries], lay.index_q[:, c][self._gap_entries]))
        if kernels.has("path"):
            r, c = kernels.pattern("path_jac", "r_d_D_z")
            rows = self.inequality_rows("path").reshape(lay.total, -1)
            blocks.append((rows[:, r], lay.index_z[:, c]))
        for name in ("final time >=", "final time <="):
            for row in self.inequality_rows(name):
                blocks.append((row, lay.index_h))
        for row, i in zip(self.inequality_rows("minimal time"), self._timed, strict=True):
            blocks.append((row, self._time_unknowns(i)))
        return SparsePattern((self.n_in, self.n), blocks)

    # Hessian of the Lagrangian ---------------------------------------------------------------------------------------

    def lagrangian_hessian(self, x: Array, y: Array, w: Array, sigma: float = 1.0) -> Matrix:
        """Upper triangle of the Hessian of sigma f + y . c + w . d, shape (n, n)."""
        lay, kernels = self.layout, self.problem.kernels
        mu = y[self.equality_rows("momentum")].reshape(lay.total + 1, lay.nq)
        arguments = self._arguments(x)
        parts = [kernels.call("step_hess", *arguments, np.array([[sigma]]), mu[:-1], mu[1:])[0]]
        if len(self.surfaces):
            at = self._collision_positions(x)
            before, after = self._collision_steps(x)
            energy = y[self.equality_rows("energy")]
            weight = np.zeros((2, len(energy), 2))
            weight[0, :, 0], weight[1, :, 1] = energy, -energy
            parts.append(kernels.call("impact_hess", *before, weight[0])[0])
            parts.append(kernels.call("impact_hess", *after, weight[1])[0])
            second = kernels.call("normal_hess", at, self._impulses(x), self.par, mu[lay.collision_nodes])[0]
            parts.append(-second[self._normal_hess_entries])
        if kernels.has("surface"):
            weights = np.zeros((lay.total + 1, len(kernels.surfaces)))
            weights[self.gap_constraints] = -w[self.inequality_rows("gap")]
            if len(self.surfaces):
                weights[lay.collision_nodes, self.surfaces] = y[self.equality_rows("contact")]
            parts.append(kernels.call("surface_hess", x[lay.index_q], self.par, weights)[0])
        if kernels.has("path"):
            weights = w[self.inequality_rows("path")].reshape(lay.total, -1)
            parts.append(kernels.call("path_hess", *arguments, weights)[0])
        for rows, node, _, v in self._velocity_ends:
            state = (x[lay.index_q[node]][None], x[v][None])
            parts.append(-kernels.call("legendre_hess", *state, self.par, y[rows][None])[0])
        for row, i in zip(self.inequality_rows("minimal time"), self._timed, strict=True):
            parts.append(w[row] * self._time_hessian(x, i)[np.triu_indices(3 * lay.nq + 1)])
        # Two local unknowns may be one global unknown (inputs constant in a step): then both triangles fall on the diagonal.
        return self._hessian_pattern.matrix([p.ravel() * f for p, f in zip(parts, self._hessian_factors, strict=True)])

    @cached_property
    def _hessian_blocks(self) -> list[tuple[Index, Index]]:
        lay, kernels = self.layout, self.problem.kernels

        def pairs(kernel: str, unknowns: Index) -> tuple[Index, Index]:
            r, c = kernels.pattern(kernel, "hess")
            return unknowns[:, r].ravel(), unknowns[:, c].ravel()

        blocks = [pairs("step_hess", lay.index_z)]
        nodes = lay.collision_nodes
        if len(self.surfaces):
            blocks.append(pairs("impact_hess", lay.index_z[nodes - 1]))
            blocks.append(pairs("impact_hess", lay.index_z[nodes]))
            r, c = kernels.pattern("normal_hess", "hess")
            unknowns, keep = self._normal_unknowns, self._normal_hess_entries
            blocks.append((unknowns[:, r][keep], unknowns[:, c][keep]))
        if kernels.has("surface"):
            blocks.append(pairs("surface_hess", lay.index_q))
        if kernels.has("path"):
            blocks.append(pairs("path_hess", lay.index_z))
        for _, node, _, v in self._velocity_ends:
            blocks.append(pairs("legendre_hess", np.concatenate([lay.index_q[node], v])[None]))
        for i in self._timed:
            r, c = np.triu_indices(3 * lay.nq + 1)
            unknowns = self._time_unknowns(i)
            blocks.append((unknowns[r], unknowns[c]))
        return blocks

    @cached_property
    def _hessian_factors(self) -> list[Array]:
        """2 where an off-diagonal entry of an element falls on the diagonal.

        Only inputs that are constant in a step do that: their two local unknowns u_k and u_kp1 are one.
        """
        factors = [np.ones(len(r)) for r, _ in self._hessian_blocks]
        kernels = self.problem.kernels
        for block, name in enumerate(self._hessian_kernels):
            if name in ("step_hess", "impact_hess", "path_hess"):
                r, c = kernels.pattern(name, "hess")
                rows, columns = self._hessian_blocks[block]
                local = np.tile(r != c, len(rows) // max(len(r), 1))
                factors[block][(rows == columns) & local] = 2.0
        return factors

    @property
    def _hessian_kernels(self) -> list[str]:
        """The kernel of each block, in order."""
        kernels = self.problem.kernels
        names = ["step_hess"]
        names += ["impact_hess", "impact_hess", "normal_hess"] if len(self.surfaces) else []
        names += [n for n in ("surface_hess", "path_hess") if kernels.has(n)]
        return names + ["legendre_hess"] * len(self._velocity_ends) + ["min_time"] * len(self._timed)

    @cached_property
    def _hessian_pattern(self) -> SparsePattern:
        blocks = [(np.minimum(r, c), np.maximum(r, c)) for r, c in self._hessian_blocks]
        return SparsePattern((self.n, self.n), blocks)

    # Pieces ----------------------------------------------------------------------------------------------------------

    def _arguments(self, x: Array) -> tuple[Array, ...]:
        return (*self.layout.step_inputs(x), self.par)

    def _step(self, x: Array) -> tuple[Array, ...]:
        return self.problem.kernels.call("step", *self._arguments(x))

    def momenta(self, x: Array) -> tuple[Array, Array]:
        """Return p at the start and at the end of every step, shape (total, nq) each."""
        r_minus, r_plus, _ = self._step(x)
        return -r_minus, r_plus

    def _columns(self, kernel: str, output: str) -> Index:
        return self.problem.kernels.pattern(kernel, output)[1]

    def _collision_positions(self, x: Array) -> Array:
        return np.ascontiguousarray(x[self.layout.index_q[self.layout.collision_nodes]])

    def _impulses(self, x: Array) -> Array:
        """Impulses with respect to every surface, shape (I, nc); only the surface that is hit has one."""
        lam = np.zeros((len(self.surfaces), len(self.problem.kernels.surfaces)))
        lam[np.arange(len(lam)), self.surfaces] = x[self.layout.index_lam]
        return lam

    def _collision_steps(self, x: Array) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
        """Arguments of the last step before and of the first step after each collision."""
        inputs = self.layout.step_inputs(x)
        nodes = self.layout.collision_nodes
        before = tuple(np.ascontiguousarray(a[nodes - 1]) for a in inputs)
        after = tuple(np.ascontiguousarray(a[nodes]) for a in inputs)
        return (*before, self.par), (*after, self.par)

    def _energies(self, x: Array) -> Array:
        before, after = self._collision_steps(x)
        kernels = self.problem.kernels
        return (kernels.call("impact", *before)[0] - kernels.call("impact", *after)[1])[:, 0]

    @cached_property
    def _normal_unknowns(self) -> Index:
        """Unknowns (q_c, lam) of each collision; every surface's column stands for the impulse of the one that is hit."""
        lay = self.layout
        lam = np.repeat(lay.index_lam[:, None], len(self.problem.kernels.surfaces), axis=1)
        return np.hstack([lay.index_q[lay.collision_nodes], lam])

    @cached_property
    def _normal_entries(self) -> NDBool:
        """Entries of n_D_ql that belong to q_c or to the impulse of the surface that is hit, shape (I, entries)."""
        _, c = self.problem.kernels.pattern("normal_jac", "n_D_ql")
        return np.asarray((c < self.layout.nq) | (c - self.layout.nq == self.surfaces[:, None]))

    @cached_property
    def _normal_hess_entries(self) -> NDBool:
        """Entries of the second derivative of mu . n that belong to q_c or to the impulse of the surface that is hit."""
        r, c = self.problem.kernels.pattern("normal_hess", "hess")
        nq = self.layout.nq
        return np.asarray(((r < nq) | (r - nq == self.surfaces[:, None])) & ((c < nq) | (c - nq == self.surfaces[:, None])))

    @cached_property
    def _active_gradients(self) -> NDBool:
        """Entries of g_D_q that belong to the surface that is hit, shape (I, entries)."""
        r, _ = self.problem.kernels.pattern("surface_jac", "g_D_q")
        return np.asarray(r == self.surfaces[:, None])

    @cached_property
    def _gap_entries(self) -> NDBool:
        r, _ = self.problem.kernels.pattern("surface_jac", "g_D_q")
        keep = np.zeros((self.layout.total + 1, len(self.problem.kernels.surfaces)), dtype=bool)
        keep[self.gap_constraints] = True
        return keep[:, r]

    @cached_property
    def _velocity_ends(self) -> list[tuple[Index, int, Index, Index]]:
        """Rows, node, momenta and velocities of each end whose velocities are unknowns."""
        lay = self.layout
        ends = [
            (self.equality_rows("start velocity"), 0, lay.index_p_B, lay.index_v_B),
            (self.equality_rows("goal velocity"), -1, lay.index_p_E, lay.index_v_E),
        ]
        return [end for end in ends if len(end[3])]

    def _time_unknowns(self, i: int) -> Index:
        """Unknowns y = (q_k, q_kp1, h, q_c) of the minimal time of phase i."""
        lay = self.layout
        first, last = lay.ends[i], lay.ends[i + 1]
        return np.concatenate([lay.index_q[first], lay.index_q[first + 1], lay.index_h[[i]], lay.index_q[last]])

    def minimal_time(self, y: Array, i: int) -> tuple[float, Array]:
        """Return T_min of phase i and its gradient with respect to y = (q_k, q_kp1, h, q_c)."""
        nq, bounds = self.layout.nq, self.problem.input_bounds
        surface = int(self.surfaces[i])
        return minimal_time(
            self.problem.kernels, y[:nq], y[nq : 2 * nq], float(y[2 * nq]), y[2 * nq + 1 :], surface, bounds, self.par
        )

    def phase_minimal_time(self, x: Array, i: int) -> float:
        return self.minimal_time(x[self._time_unknowns(i)], i)[0]

    def _time_reserve(self, x: Array, i: int) -> tuple[float, Array]:
        """T_i - T_min and its gradient with respect to y; without an estimate nothing is demanded."""
        y = x[self._time_unknowns(i)]
        shortest, slope = self.minimal_time(y, i)
        steps = self.layout.steps[i]
        slope = -slope
        slope[2 * self.layout.nq] += steps
        reserve = steps * y[2 * self.layout.nq] - (shortest if np.isfinite(shortest) else 0.0)
        return float(reserve), slope

    def _time_hessian(self, x: Array, i: int) -> Array:
        """Second derivative of T_i - T_min by central differences of its gradient: one small row, and rarely active."""
        y = x[self._time_unknowns(i)]
        hessian = np.empty((len(y), len(y)))
        for j in range(len(y)):
            step = 1e-6 * max(abs(y[j]), 1e-3)
            ends = [y.copy(), y.copy()]
            ends[0][j] -= step
            ends[1][j] += step
            below, above = (self.minimal_time(e, i)[1] for e in ends)
            hessian[j] = -(above - below) / (2 * step)
        return (hessian + hessian.T) / 2
