"""The program with the minimal times of its phases as further inequalities, which guide a method
that has no barrier.

A minimal time says how soon a phase can end in its collision at full input.  The equations of
motion at averaged coefficients, half-way between the phase's start and its collision, with the
inputs at the bounds that drive towards the surface, give constant accelerations a; with them the
gap is a quadratic in time, and its first root is T_min (Kern & Gross 2018, "implementation issue
#3"; equation :eq:`minimal-time` of the theory).  It is an estimate and no lower bound: a motion may
be sooner, at constant full input already.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.algebra import solved
from dmoc.mechanics.model import Model
from dmoc.problem.problem import Problem
from dmoc.program.blocks import NOWHERE, Block, Index, Numbering
from dmoc.program.evaluator import Matrix
from dmoc.program.iterate import Iterate
from dmoc.program.layout import Layout
from dmoc.program.scale import Scale
from dmoc.program.transcription import Transcription

# Relative change of an unknown for the differences that give second derivatives.
CHANGE = 1e-6


def phase_minimal_time(at: Iterate, i: int) -> float:
    """T_min of phase i of a motion in seconds."""
    return _minimal_time(at.problem, at.lay, at.x[_unknowns(at.lay, i)], i)[0]


def _unknowns(lay: Layout, i: int) -> Index:
    """Unknowns y = (q_k, q_kp1, h, q_c) of the minimal time of phase i."""
    first, last = lay.ends[i], lay.ends[i + 1]
    return np.concatenate(
        [lay.index_q[first], lay.index_q[first + 1], lay.index_h[[i]], lay.index_q[last]]
    )


def _minimal_time(problem: Problem, lay: Layout, y: Array, i: int) -> tuple[float, Array]:
    """T_min of phase i and its gradient with respect to y."""
    n, surface, box = lay.nq, int(lay.touch.surfaces[i]), problem.input_bounds
    parts = (y[:n], y[n : 2 * n], float(y[2 * n]), y[2 * n + 1 :])
    return minimal_time(problem.model, *parts, surface, box)


class WithMinimalTimes(Transcription):
    """Further inequalities T_i - T_min >= 0 of the phases before a collision, where the problem
    asks for them and every input is bounded.

    They come after all others.  Their second derivatives are differences: small rows, and rarely
    active.
    """

    def __init__(
        self, problem: Problem, scale: Scale | None = None, grazing: Sequence[int] = ()
    ) -> None:
        super().__init__(problem, scale, grazing=grazing)
        bounded = problem.nu > 0 and bool(np.isfinite(problem.input_bounds).all())
        estimated = problem.minimal_times and bounded and problem.model.has_minimal_times
        estimated = estimated and not problem.held
        there = problem.touch.impacts & bool(estimated)
        number = Numbering(self.n_eq + self.n_in)
        self._block = number(
            "minimal time",
            there,
            lambda i: f"minimal time of phase {i} -> {problem.sequence[i]}",
            lambda s: s.time,
        )
        self._last: dict[int, tuple[Array, float, Array]] = {}
        self.n_in += self._block.count

    @property
    def inequalities(self) -> Sequence[Block]:
        return [*self.laws.inequalities, self._block]

    @property
    def minimal_times(self) -> Index:
        """Positions in d of the minimal times of phases, shape (phases with a minimal time,)."""
        return self._block.numbers - self.n_eq

    def inequality(self, x: Array) -> Array:
        return np.concatenate(
            [super().inequality(x), [self._reserve(x, i)[0] for i in self._phases]]
        )

    def inequality_slopes(self, x: Array) -> Array:
        return np.concatenate(
            [super().inequality_slopes(x), *(self._reserve(x, i)[1] for i in self._phases)]
        )

    def inequality_jacobian(self, x: Array) -> Matrix:
        import scipy.sparse

        rows = super().inequality_jacobian(x)
        # Zeros stay in the pattern, which is analysed once.
        times = [self._sorted[i] for i in self._phases]
        starts = np.cumsum([rows.indptr[-1], *(len(t) for t in times)])
        indices, indptr = (
            np.concatenate([rows.indices, *times]),
            np.concatenate([rows.indptr, starts[1:]]),
        )
        return scipy.sparse.csr_matrix(
            (self.inequality_slopes(x), indices, indptr), shape=(self.n_in, self.n)
        )

    def lagrangian_gradient(self, x: Array, y: Array, w: Array) -> Array:
        rest = self.laws.n_in
        slope = super().lagrangian_gradient(x, y, w[:rest])
        for i, weight in zip(self._phases, w[rest:], strict=True):
            slope[self._sorted[i]] -= weight * self._reserve(x, i)[1]
        return slope

    def lagrangian_hessian(self, x: Array, y: Array, w: Array, sigma: float = 1.0) -> Matrix:
        import scipy.sparse

        rest = self.laws.n_in
        hessian = super().lagrangian_hessian(x, y, w[:rest], sigma)
        for i, weight in zip(self._phases, w[rest:], strict=True):
            if weight:
                at, values = self._sorted[i], -weight * self._second(x, i)
                r, c = np.triu_indices(len(at))
                hessian = hessian + scipy.sparse.csr_matrix(
                    (values[r, c], (at[r], at[c])), shape=hessian.shape
                )
        return hessian

    @property
    def _phases(self) -> Sequence[int]:
        return [int(i) for i in np.flatnonzero(self._block.index != NOWHERE)]

    @cached_property
    def _sorted(self) -> dict[int, Index]:
        """Unknowns of each minimal time, in the order of x, by the phase."""
        return {i: np.sort(_unknowns(self.layout, i)) for i in self._phases}

    def _reserve(self, x: Array, i: int) -> tuple[float, Array]:
        """T_i - T_min and its gradient with respect to the sorted scaled unknowns; the last point
        is remembered.

        Without an estimate nothing is demanded.
        """
        at = _unknowns(self.layout, i)
        y = x[at] * self.sizes[at]
        last = self._last.get(i)
        if last is None or not np.array_equal(last[0], y):
            steps, at_h = self.layout.steps[i], 2 * self.layout.nq
            shortest, slope = _minimal_time(self.problem, self.layout, y, i)
            slope = -slope
            slope[at_h] += steps
            left = (
                float(steps * y[at_h] - (shortest if np.isfinite(shortest) else 0.0))
                / self.scale.time
            )
            last = self._last[i] = (
                y,
                left,
                (slope * self.sizes[at] / self.scale.time)[np.argsort(at)],
            )
        return last[1], last[2]

    def _second(self, x: Array, i: int) -> Array:
        """Second derivative of T_i - T_min in the sorted scaled unknowns, by central differences
        of its gradient."""
        at = _unknowns(self.layout, i)
        order, sizes = np.argsort(at), self.sizes[at]
        y = x[at] * sizes
        curvature = np.empty((len(y), len(y)))
        for j in range(len(y)):
            step = CHANGE * max(abs(y[j]), 1e-3 * sizes[j])
            ends = [y.copy(), y.copy()]
            ends[0][j] -= step
            ends[1][j] += step
            below, above = (_minimal_time(self.problem, self.layout, e, i)[1] for e in ends)
            curvature[j] = (below - above) / (2 * step)
        curvature = (curvature + curvature.T) / 2 * np.outer(sizes, sizes) / self.scale.time
        return np.asarray(curvature[np.ix_(order, order)])


def averaged_accelerations(
    model: Model, q: Array, v: Array, q_c: Array, surface: int, bounds: Array
) -> tuple[Array, Array]:
    """Return a = M^-1 F (nq,) half-way between the positions q at the start and q_c at the
    collision, at full input within finite bounds (nu, 2) towards a surface, and its derivative (nq,
    2 nq) with respect to the averaged position and v."""
    at = 0.5 * (q + q_c)
    inputs = model.input_matrix(at, v, bounds.mean(axis=1))
    gradient = model.gap_slopes(at)[surface, :-1]  # a surface with a minimal time stands still
    push = solved(model.mass(at), inputs).T @ gradient
    full = np.where(push > 0, bounds[:, 1], bounds[:, 0])
    mass, force = model.equations(at, v, full)
    a = solved(mass, force)
    return a, solved(mass, model.equations_slopes(at, v, full, a=a))


def minimal_time(
    model: Model, q_k: Array, q_kp1: Array, h: float, q_c: Array, surface: int, bounds: Array
) -> tuple[float, Array]:
    """Return T_min of a phase and its gradient with respect to y = (q_k, q_kp1, h, q_c).

    q_k and q_kp1 are the nodes of the phase's first step of size h, and q_c is its collision node.
    T_min is infinite, with a zero gradient, where the quadratic has no root ahead; it is 0 where an
    input is unbounded, because then nothing limits the acceleration.
    """
    nq = len(q_k)
    if not np.isfinite(bounds).all():
        return 0.0, np.zeros(3 * nq + 1)
    qm, v = 0.5 * (q_k + q_kp1), (q_kp1 - q_k) / h
    a, a_D_s = averaged_accelerations(model, qm, v, q_c, surface, bounds)
    with np.errstate(invalid="ignore", divide="ignore"):
        time = float(model.minimal_times(q_k, q_kp1, h, q_c, a)[surface])
    if not (np.isfinite(time) and time > 0):
        return np.inf, np.zeros(3 * nq + 1)
    explicit = model.minimal_time_slopes(q_k, q_kp1, h, q_c, a)[surface]
    # s = ((qm + q_c)/2, v) with qm = (q_k + q_kp1)/2 and v = (q_kp1 - q_k)/h
    one = np.eye(nq)
    s_D_y = np.zeros((2 * nq, 3 * nq + 1))
    s_D_y[:nq, :nq] = s_D_y[:nq, nq : 2 * nq] = one / 4
    s_D_y[:nq, 2 * nq + 1 :] = one / 2
    s_D_y[nq:, :nq], s_D_y[nq:, nq : 2 * nq] = -one / h, one / h
    s_D_y[nq:, 2 * nq] = -v / h
    return time, explicit[: 3 * nq + 1] + explicit[3 * nq + 1 :] @ a_D_s @ s_D_y
