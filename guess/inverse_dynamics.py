"""Inputs that come closest to accelerations, and motions whose inputs do nothing."""

from __future__ import annotations

import numpy as np

from dmoc.base.records import record
from dmoc.base.tolerances import KEPT, SAME
from dmoc.codegen.kernels import Array
from dmoc.mechanics.model import Model
from dmoc.problem.problem import Problem
from dmoc.problem.reach import enter_linearly, slopes_by_inputs
from dmoc.program.layout import Layout

# Least squares of forces that are not linear in the inputs: iterations, the first damping relative
# to the slopes, and by how much it changes.
ITERATIONS, DAMPING, FASTER = 60, 1e-2, 10.0
# Share of the largest slope of the forces by an input below which it hardly acts, and of the way to
# the value of that slope by which it is moved there.
WEAK, TOWARDS = 1e-2, 0.1


def inputs_for(problem: Problem, model: Model, q: Array, v: Array, a: Array, t: Array) -> Array:
    """Inputs that come closest to accelerations, shape (n, nu), by the ``model`` of their phases; 0
    where nothing can be said."""
    if not problem.nu:
        return np.zeros((len(q), 0))
    if problem.operating_inputs.any():
        return _everywhere_acting(_Balance.of(problem, model, q, v, a, t))
    M, F = model.equations(q, v, t=t)
    B = model.input_matrix(q, v, t=t) / np.sqrt(problem.inertia)[:, None]
    missing = (np.einsum("kij,kj->ki", M, a) - F) / np.sqrt(problem.inertia)
    good = np.isfinite(B).all(axis=(1, 2)) & np.isfinite(missing).all(axis=1)
    u = np.zeros((len(q), problem.nu))
    u[good] = np.einsum("kij,kj->ki", np.linalg.pinv(B[good]), missing[good])
    return u


def acting(problem: Problem, x: Array, rng: np.random.Generator | None = None) -> Array:
    """Unknowns x, shape (n,), of a motion whose inputs change its forces.

    No solver moves inputs at which the forces have no slope anywhere in the motion, as those of u^2
    at u = 0.  They become inputs of the equations of motion or, with a generator, random ones,
    within their bounds or of that size.
    """
    if enter_linearly(problem):
        return x
    with np.errstate(all="ignore"):
        lay = Layout.of(problem)
        q_k, q_kp1, u_k, u_kp1, h, *_ = lay.step_inputs(x)
        state, t = ((q_k + q_kp1) / 2, (q_kp1 - q_k) / h), lay.times(x)
        t = (t[:-1] + t[1:]) / 2
        around = np.tile(problem.operating_inputs, (lay.total, 1))
        own, others = (slopes_by_inputs(problem, *state, u, t) for u in ((u_k + u_kp1) / 2, around))
        silent = ((own <= SAME * others) | (others == 0)).all(axis=0) & others.any(axis=0)
        if not silent.any():
            return x
        x = x.copy()
        model = lay.model_of_steps(problem)
        u = inputs_for(problem, model, *state, _accelerations(problem, lay, state[1], t), t)
        own = slopes_by_inputs(problem, *state, u, t)
        u = np.where((own <= SAME * others).all(axis=0), around, u)[lay.step_of_input]
        if rng is not None:
            low, high = problem.input_bounds.T
            size, draws = np.abs(u).max(axis=0), rng.uniform(-1.0, 1.0, u.shape)
            bounded = np.isfinite(high - low)
            middle, half = np.where(bounded, (low + high) / 2, 0.0), (high - low) / 2
            u = np.clip(middle + draws * np.where(bounded, half, size), low, high)
        changed = silent | (problem.operating_inputs != 0)
        at = lay.index_u[:, changed]
        x[at] = u[:, changed]
        return x


def _accelerations(problem: Problem, lay: Layout, rates: Array, t: Array) -> Array:
    """Accelerations of steps from their rates, shape (total, nq), phase by phase; zero where they
    are as small as rounding errors of positions make them."""
    a = np.zeros_like(rates)
    for begin, end in zip(lay.ends[:-1], lay.ends[1:], strict=True):
        if end - begin > 1:
            a[begin:end] = np.gradient(rates[begin:end], t[begin:end], axis=0)
    return np.where(np.abs(a) > KEPT * problem.reach / t[-1] ** 2, a, 0.0)


# Forces that are not linear in the inputs --------------------------------------------------------


@record(frozen=True, eq=False)
class _Balance:
    """States of a problem, shape (n, nq) each, their times, and the generalised forces that the
    inputs have to come closest to there, by the roots of the inertias."""

    problem: Problem
    model: Model
    q: Array
    v: Array
    t: Array
    wanted: Array

    @classmethod
    def of(cls, problem: Problem, model: Model, q: Array, v: Array, a: Array, t: Array) -> _Balance:
        wanted = np.einsum("kij,kj->ki", model.mass(q, t), a) / np.sqrt(problem.inertia)
        return cls(problem, model, q, v, t, np.where(np.isfinite(wanted), wanted, 0.0))

    def missing(self, u: Array) -> Array:
        """Wanted forces less those at inputs u, shape (n, nu), by the roots of the inertias, shape
        (n, nq)."""
        F = self.model.equations(self.q, self.v, u, self.t)[1]
        return np.asarray(self.wanted - F / np.sqrt(self.problem.inertia))

    def closest(self, u: Array) -> tuple[Array, Array]:
        """Inputs within their bounds, shape (n, nu), found from others by least squares with
        damping (Levenberg), and the sums of the squares of the missing forces, shape (n,)."""
        root, (low, high) = np.sqrt(self.problem.inertia), self.problem.input_bounds.T
        missing, damping = self.missing(u), np.full(len(u), DAMPING)
        for _ in range(ITERATIONS):
            B = self.model.input_matrix(self.q, self.v, u, self.t) / root[:, None]
            B = np.where(np.isfinite(B), B, 0.0)
            length = np.sqrt((B * B).sum(axis=1, keepdims=True))
            B /= np.where(length > 0, length, 1.0)
            normal = np.swapaxes(B, 1, 2) @ B + damping[:, None, None] * np.eye(u.shape[1])
            right = np.swapaxes(B, 1, 2) @ np.where(np.isfinite(missing), missing, 0.0)[..., None]
            step = np.linalg.solve(normal, right)[..., 0] / np.where(length > 0, length, 1.0)[:, 0]
            trial = np.clip(u + step, low, high)
            left = self.missing(trial)
            better = _squares(left) < _squares(missing)
            moved = np.abs(trial - u).max(axis=1)
            u, missing = (
                np.where(better[:, None], trial, u),
                np.where(better[:, None], left, missing),
            )
            damping = np.where(better, np.maximum(damping / FASTER, SAME), damping * FASTER)
            if (moved <= SAME * np.abs(u).max(axis=1)).all():
                break
        return u, _squares(missing)


def _squares(missing: Array) -> Array:
    total = (missing * missing).sum(axis=1)
    return np.where(np.isfinite(total), total, np.inf)


def _everywhere_acting(balance: _Balance) -> Array:
    """The inputs that leave the least: none, where they leave as little as those from the operating
    inputs.  Such as hardly act are moved towards where they act most."""
    low, high = balance.problem.input_bounds.T
    none = np.tile(np.clip(0.0, low, high), (len(balance.q), 1))
    u, left = balance.closest(np.tile(balance.problem.operating_inputs, (len(none), 1)))
    least = _squares(balance.missing(none))
    better = left < (1 - SAME) * least - SAME * _squares(balance.wanted)
    u = np.where(better[:, None], u, none)
    slopes = slopes_by_inputs(balance.problem, balance.q, balance.v, u, balance.t)
    strongest = np.take_along_axis(u, slopes.argmax(axis=0)[None], axis=0)
    weak = slopes <= WEAK * slopes.max(axis=0)
    return np.where(weak, u + TOWARDS * (strongest - u), u)
