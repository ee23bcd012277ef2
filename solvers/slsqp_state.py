"""The state of SLSQP on a condensed program between two runs: multipliers, working set, metric,
equations."""

from __future__ import annotations

import numpy as np
import scipy.linalg
import scipy.sparse

from dmoc.base.tolerances import TINY
from dmoc.codegen.kernels import Array
from dmoc.mechanics.algebra import least_squares
from dmoc.program.blocks import NOWHERE
from dmoc.program.transcription import Transcription
from dmoc.solvers.condensed import Elimination, Reduced, partition
from dmoc.solvers.kkt import residuals, with_bounds
from dmoc.solvers.outcome import Duals, Residuals
from dmoc.solvers.slsqp_runs import EQUATION_TOLERANCE, FOLLOWING_LIMIT, Working

# Segments of each phase in the condensed form: fewer make the program more nonlinear, more make
# each iteration more expensive.
SEGMENTS = 16
# Curvatures below this share of the cost's own count as flat; it bounds the first step along them.
FLATTEST = 1e-3
# An inequality within this share of its length joins the working set.
NEAR = 1e-3
# Curvature below which the end of Newton's method is a saddle.
SADDLE = 1e-4
# Rows whose orthogonalisation leaves this share of the longest are surely independent.
INDEPENDENT = 1e-7
# Shortest share of a step towards the equations.
SHORTEST_SHARE = 1e-3


class Descent:
    """The state that the runs of SLSQP on one condensed program share: multipliers, working set,
    metric, equations."""

    def __init__(self, nlp: Transcription, x: Array) -> None:
        self.nlp = nlp
        self.parts = partition(nlp, SEGMENTS)
        self.elimination = Elimination(nlp, self.parts, x)
        self.is_eliminated = np.isin(np.arange(nlp.n), self.parts.eliminated)
        self.free = np.flatnonzero(nlp.lower != nlp.upper)
        self.lengths = self._lengths(x)
        self.y = np.zeros(nlp.n_eq)
        self.w = np.zeros(nlp.n_in)
        self.bound_force = np.zeros(nlp.n)  # multipliers of the bounds, positive at a lower one
        self.watched_rows = np.zeros(nlp.n_in, dtype=bool)
        self.watched_lower = np.zeros(nlp.n, dtype=bool)
        self.watched_upper = np.zeros(nlp.n, dtype=bool)
        self._always()

    def duals_at(self, x: Array) -> Duals:
        """All multipliers, with those of the bounds at x, shape (n,)."""
        return with_bounds(self.nlp, x, self.y, self.w)

    def residuals_at(self, x: Array) -> Residuals:
        return residuals(self.nlp, x, self.duals_at(x))

    def _always(self) -> None:
        """Inequalities that shape the problem from the start: beside collisions, on the times,
        on steps and impulses, and what alone holds hidden unknowns."""
        nlp, lay = self.nlp, self.nlp.layout
        laws, impact = nlp.laws, nlp.laws.impact
        for c, s in zip(lay.collision_nodes, lay.touch.surfaces, strict=True):
            if s == NOWHERE:  # an event without an impact
                continue
            rows = laws.step.gap.index[max(c - 2, 0) : c + 3, s]
            self.watched_rows[rows[rows != NOWHERE] - nlp.n_eq] = True
        ends = laws.ends.earliest, laws.ends.latest, laws.contact.opens
        for block in (*ends, impact.approach, impact.separation, laws.kink.limit):
            self.watched_rows[block.numbers - nlp.n_eq] = True
        self.watched_rows[nlp.minimal_times] = True
        for index in (lay.index_h, lay.impact.lam):
            self.watched_lower[index] = np.isfinite(nlp.lower[index])
            self.watched_upper[index] = np.isfinite(nlp.upper[index])
        self.permanent = (
            self.watched_rows.copy(),
            self.watched_lower.copy(),
            self.watched_upper.copy(),
        )

    def _lengths(self, x: Array) -> Array:
        """Typical size of a change of each unknown; for inputs the size that changes the cost by
        one half."""
        nlp, lay = self.nlp, self.nlp.layout
        lengths = np.ones(nlp.n)
        q = x[lay.index_q]
        lengths[lay.index_q] = np.maximum(np.ptp(q, axis=0), 1e-2) / 20
        lengths[lay.index_h] = x[lay.index_h] / 10
        lengths[lay.impact.lam] = np.maximum(np.abs(x[lay.impact.lam]), 1.0) / 3
        if lay.nu:
            q_k, _, u, _, h, t_k, _ = lay.step_inputs(nlp.physical(x))
            model = lay.model_of_steps(nlp.designed(x).problem)
            curvature = model.running_cost_curvatures(q_k, None, u[:, : lay.nu], t_k[:, 0])
            curvature = h * curvature * nlp.scale.u**2 / nlp.scale.cost
            box = nlp.problem.input_bounds / nlp.scale.u[:, None]
            width = np.where(np.isfinite(box[:, 1] - box[:, 0]), box[:, 1] - box[:, 0], 1.0) / 4
            with np.errstate(divide="ignore"):
                size = np.where(curvature > 0, 1 / np.sqrt(np.maximum(curvature, TINY)), width)
            lengths[lay.index_u[lay.row_u_kp1]] = size
            lengths[lay.index_u[lay.row_u_k]] = size
        return lengths

    # Working set ----------------------------------------------------------------------------------

    def working(self, x: Array) -> Working:
        """Return the watched inequalities; watch those that are violated or nearly so, forget
        those that have become idle."""
        nlp = self.nlp
        d = nlp.inequality(x)
        near = NEAR * self.lengths
        with np.errstate(invalid="ignore"):
            below, above = x - nlp.lower, nlp.upper - x
        self.watched_rows = (
            (self.watched_rows & ((d < 1e-1) | (self.w > 0))) | (d < NEAR) | self.permanent[0]
        )
        idle = 1e3 * near
        self.watched_lower = (
            (self.watched_lower & (below < idle)) | (below < near) | self.permanent[1]
        )
        self.watched_upper = (
            (self.watched_upper & (above < idle)) | (above < near) | self.permanent[2]
        )
        free = np.isin(np.arange(nlp.n), self.free)
        return Working(
            np.flatnonzero(self.watched_rows),
            np.flatnonzero(self.watched_lower & free),
            np.flatnonzero(self.watched_upper & free),
        )

    # Metric ---------------------------------------------------------------------------------------

    def metric(self, x: Array) -> tuple[Array, Array] | None:
        """Return (move, null), shapes (n_y, rank) and (n_y, n_y - rank): S = (move | null).

        The columns of ``move`` change the kept equations one by one, dK = I, and are conjugate to
        those of ``null``, which leave the equations as they are and make the Hessian of the
        Lagrangian the identity, up to signs and the flattest curvatures.
        """
        none = np.zeros(0, dtype=np.intp)
        reduced = self.elimination.reduce(x, none, none)
        if reduced is None:
            return None
        if not self.y.any():
            self._estimate_multipliers(x, reduced)
        self._complete_multipliers(x, reduced)
        D = self.lengths[self.parts.kept]
        H = self._hessian(x, reduced, D)
        if not (np.isfinite(H).all() and np.isfinite(reduced.equality).all()):
            return None
        move, null = _split(reduced.equality * D)
        values, V = np.linalg.eigh(null.T @ H @ null)
        null = null @ (V / np.sqrt(np.maximum(np.abs(values), FLATTEST)))
        move = move - null @ (null.T @ (H @ move))
        return D[:, None] * move, D[:, None] * null

    def is_minimum(self, x: Array) -> bool:
        """Whether the Hessian of the Lagrangian is positive where the equations and the active
        inequalities stay as they are."""
        rows, bounds = np.flatnonzero(self.w > 0), np.flatnonzero(self.bound_force)
        reduced = self.elimination.reduce(x, rows, bounds[self.is_eliminated[bounds]])
        if reduced is None:
            return False
        D = self.lengths[self.parts.kept]
        fixed = np.flatnonzero(np.isin(self.parts.kept, bounds))
        active = (
            np.vstack(
                [reduced.equality, reduced.inequality, reduced.unknowns, np.eye(len(D))[fixed]]
            )
            * D
        )
        if not np.isfinite(active).all():
            return False
        null = _split(active)[1]
        H = self._hessian(x, reduced, D)
        if not np.isfinite(H).all():
            return False
        return not null.shape[1] or bool(np.linalg.eigvalsh(null.T @ H @ null)[0] > -SADDLE)

    def _hessian(self, x: Array, reduced: Reduced, D: Array) -> Array:
        """Hessian of the Lagrangian in the scaled kept unknowns, dense."""
        nlp, parts = self.nlp, self.parts
        upper = nlp.lagrangian_hessian(x, self.y, self.w)
        Z = np.zeros((nlp.n, len(parts.kept)))
        Z[parts.kept, np.arange(len(parts.kept))] = D
        Z[parts.eliminated] = -reduced.factors.solve(self.elimination.kept_columns(x) * D)
        H = Z.T @ ((upper + scipy.sparse.triu(upper, 1).T) @ Z)
        return np.asarray((H + H.T) / 2)

    def estimate_multipliers(self, x: Array) -> None:
        """Multipliers of the equations by least squares, without active inequalities."""
        self.forget_multipliers()
        none = np.zeros(0, dtype=np.intp)
        reduced = self.elimination.reduce(x, none, none)
        if reduced is not None:
            self._estimate_multipliers(x, reduced)
            self._complete_multipliers(x, reduced)

    def _estimate_multipliers(self, x: Array, reduced: Reduced) -> None:
        """Least-squares multipliers of the kept equations."""
        D = self.lengths[self.parts.kept]
        if len(reduced.equality):
            self.y[self.parts.kept_rows] = -np.nan_to_num(
                least_squares((reduced.equality * D).T, reduced.cost * D)
            )

    def _complete_multipliers(self, x: Array, reduced: Reduced) -> None:
        """Multipliers of the eliminated equations, which make the Lagrangian stationary in the
        eliminated unknowns."""
        nlp, parts = self.nlp, self.parts
        self.y[parts.used_rows] = 0.0
        slope = nlp.lagrangian_gradient(x, self.y, self.w) - self.bound_force
        self.y[parts.used_rows] = self.elimination.multipliers(slope, reduced.factors)

    # Equations ------------------------------------------------------------------------------------

    def equation_error(self, x: Array) -> float:
        """Largest violation of an equality constraint."""
        return float(np.abs(self.nlp.equality(x)).max())

    def onto_equations(self, x: Array) -> Array:
        """Meet the kept equations by Gauss-Newton steps of least scaled length; returns the best
        point found."""
        none = np.zeros(0, dtype=np.intp)
        D = self.lengths[self.parts.kept]
        error = self.equation_error(x)
        for _ in range(FOLLOWING_LIMIT):
            if error <= EQUATION_TOLERANCE:
                break
            reduced = self.elimination.reduce(x, none, none)
            if reduced is None or not np.isfinite(reduced.equality).all():
                break
            c = self.nlp.equality(x)[self.parts.kept_rows]
            step = D * least_squares(reduced.equality * D, -c)
            share, better = 1.0, None
            while share > SHORTEST_SHARE and better is None:
                trial = self.elimination.complete(
                    x, self._within_times(x, x[self.parts.kept] + share * step)
                )
                if trial is not None and self.equation_error(trial) < (1 - 0.1 * share) * error:
                    better = trial
                share /= 2
            if better is None:
                break
            x, error = better, self.equation_error(better)
        return x

    def _within_times(self, x: Array, y: Array) -> Array:
        """Change no step size by more than a tenth at once."""
        times = np.isin(self.parts.kept, self.nlp.layout.index_h)
        before = x[self.parts.kept][times]
        y[times] = np.clip(y[times], 0.9 * before, 1.1 * before)
        return y

    def forget_multipliers(self) -> None:
        self.y, self.w, self.bound_force = (
            np.zeros(self.nlp.n_eq),
            np.zeros(self.nlp.n_in),
            np.zeros(self.nlp.n),
        )

    def take_multipliers(self, x: Array, y_kept: Array, w_working: Array, working: Working) -> None:
        self.y = np.zeros(self.nlp.n_eq)
        self.y[self.parts.kept_rows] = y_kept
        self.w = np.zeros(self.nlp.n_in)
        a, b = len(working.rows), len(working.rows) + len(working.lower)
        self.w[working.rows] = w_working[:a]
        force = np.zeros(self.nlp.n)
        force[working.lower] += w_working[a:b]
        force[working.upper] -= w_working[b:]
        self.bound_force = force
        none = np.zeros(0, dtype=np.intp)
        reduced = self.elimination.reduce(x, none, none)
        if reduced is not None:
            self._complete_multipliers(x, reduced)


def _split(A: Array) -> tuple[Array, Array]:
    """Return a right inverse of A (if its rows are independent, else of its row space) and an
    orthonormal basis of its null space."""
    if not A.shape[0]:
        return np.zeros((A.shape[1], 0)), np.eye(A.shape[1])
    rows = len(A)
    if rows <= A.shape[1]:
        Q, R = np.linalg.qr(A.T, mode="complete")
        sizes = np.abs(np.diagonal(R))
        if sizes.min() > INDEPENDENT * sizes.max():
            inverse = scipy.linalg.solve_triangular(R[:rows], Q[:, :rows].T).T
            return np.asarray(inverse), Q[:, rows:]
    U, sizes, Vt = np.linalg.svd(A, full_matrices=True)
    rank = int((sizes > 1e-10 * max(sizes[0], TINY)).sum())
    inverse = Vt[:rank].T / sizes[:rank]
    return inverse @ U.T if rank == len(A) else inverse, Vt[rank:].T
