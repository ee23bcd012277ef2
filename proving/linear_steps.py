"""The steps of a problem that moves linearly, as numbers: powers of the step size, and the cost."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from dmoc.base.errors import ProblemError
from dmoc.codegen.kernels import Array
from dmoc.proving.linear import LinearPhase
from dmoc.proving.linear_model import Frame, LinearModel
from dmoc.proving.recognition import SAME_VALUE, TRIALS, affine

# Powers of h are read at steps of these sizes, relative to a typical one, and tried at another.
SIZES, TRIED = np.array([0.5, 1.0, 2.0]), 0.7
# Coefficients below this share of the largest power of their entry are rounding errors.
NOTHING = 1e-12


@dataclass(eq=False)
class LinearSteps:
    """The steps of a problem."""

    model: LinearModel

    def phase(self, i: int, frame: Frame) -> LinearPhase:
        """The steps of a phase in the coordinates of its mode."""
        p = self.model.problem
        R, c, c_0 = self.cost
        bounds = np.tile(p.input_bounds, (self._rows, 1))
        loose = np.isinf(bounds).any(axis=1) & (np.diag(R) <= 0)
        if loose.any():
            name = p.kernels.inputs[int(np.argmax(loose)) % p.nu]
            raise ProblemError(
                f"the input {name} has neither a cost nor bounds: give it one of both, or nothing "
                "keeps it finite."
            )
        paths, most = self._paths(i, frame)
        powers = self._powers_in(frame)
        low, high = bounds.T
        return LinearPhase(p.phase_steps[i], powers, R, c, c_0, low, high, paths, most)

    @property
    def _rows(self) -> int:
        """Rows of the inputs of a step; of those that are linear between nodes a step of order 2
        knows the mean alone."""
        return 2 if self.model.problem.control_form == "stages" else 1

    def _step(self, x: Array, h: float) -> list[Array]:
        """Rows (q_k, q_i, q_kp1, u) of steps, shape (k, ...), as kernels take them."""
        p, n = self.model.problem, self.model.problem.nq
        d = p.scheme.degree
        u = x[:, (d + 1) * n :].reshape(len(x), -1, p.nu)
        q_kp1 = x[:, d * n : (d + 1) * n]
        size, time = np.full((len(x), 1), h), np.zeros((1, 1))
        return [x[:, :n], q_kp1, u[:, 0], u[:, -1], size, time, x[:, n : d * n]]

    def _momenta(self, x: Array, h: float) -> Array:
        """h (r_i, r_minus, r_plus) of steps."""
        p = self.model.problem
        r_minus, r_plus, _, r_i = p.kernels.call("step", *self._step(x, h), p.model.par)
        return np.asarray(h * np.hstack([r_i, r_minus, r_plus]))

    @cached_property
    def _powers(self) -> Array:
        """P in the coordinates of the model."""
        p, model = self.model.problem, self.model
        d, rows = p.scheme.degree, self._rows
        names = [*np.tile(p.kernels.coordinates, d + 1), *np.tile(p.kernels.inputs, rows)]
        width = np.concatenate([np.tile(model.sizes, d + 1), np.ones(rows * p.nu)])
        at = [
            affine(partial(self._momenta, h=model.h * s), names, "equation of a step", width)
            for s in (*SIZES, TRIED)
        ]
        values = np.array([np.hstack([f.A, f.b[:, None]]) for f in at])
        P = np.linalg.solve(np.vander(SIZES, 3, increasing=True), values[:3].reshape(3, -1))
        P = P.reshape(3, *values[0].shape)
        P[np.abs(P) <= NOTHING * np.abs(P).max(axis=0)] = 0.0
        again = P[0] + TRIED * P[1] + TRIED**2 * P[2]
        size = np.abs(values[3]).max(axis=1, keepdims=True)
        if not (np.abs(again - values[3]) <= SAME_VALUE * size).all():
            raise ProblemError(
                "the equations of a step are no polynomials in its size: proofs cover forces that "
                "are affine in positions, velocities and inputs and do not depend on the time."
            )
        return np.asarray(P / model.h ** np.arange(3)[:, None, None])

    def _powers_in(self, frame: Frame) -> Array:
        """P in the coordinates of a mode."""
        n, d = self.model.problem.nq, self.model.problem.scheme.degree
        P, several = self._powers, np.eye(d + 1)
        nodes, rest = P[:, :, : (d + 1) * n], P[:, :, (d + 1) * n :].copy()
        rest[:, :, -1] += nodes @ np.tile(frame.origin, d + 1)
        left, Z = np.kron(several, frame.left), np.kron(several, frame.Z)
        return np.concatenate([left @ nodes @ Z, left @ rest], axis=2)

    @cached_property
    def cost(self) -> tuple[Array, Array, float]:
        """R, c and c_0 of the cost h (u R u/2 + c u + c_0) of a step."""
        p, model = self.model.problem, self.model
        nodes, nb = (p.scheme.degree + 1) * p.nq, self._rows * p.nu

        def cost(u: Array, q: Array) -> Array:
            x = np.hstack([np.broadcast_to(q, (len(u), nodes)), u])
            return np.asarray(p.model.step_costs(self._step(x, model.h)) / model.h)

        rest, unit = np.zeros((1, nodes)), np.eye(nb)
        c_0 = float(cost(np.zeros((1, nb)), rest)[0])
        up, down = cost(unit, rest), cost(-unit, rest)
        c, R = (up - down) / 2, np.diag(up + down - 2 * c_0)
        for i, j in zip(*np.tril_indices(nb, -1), strict=True):
            pair = cost((unit[i] + unit[j])[None], rest)[0]
            R[i, j] = R[j, i] = pair - up[i] - up[j] + c_0
        R[np.abs(R) < NOTHING * np.abs(R).max(initial=0.0)] = 0.0
        rng = np.random.default_rng(0)
        u = rng.uniform(-2, 2, (TRIALS, nb))
        q = rng.uniform(-1, 1, (TRIALS, nodes)) * np.tile(model.sizes, p.scheme.degree + 1)
        expected = np.einsum("ki,ij,kj->k", u, R, u) / 2 + u @ c + c_0
        size = SAME_VALUE * max(np.abs(expected).max(initial=0.0), 1e-300)
        if (np.abs(cost(u, np.zeros((TRIALS, nodes))) - expected) > size).any():
            raise ProblemError("the cost is no quadratic function of the inputs: proofs need one.")
        if (np.abs(cost(u, q) - expected) > size).any():
            raise ProblemError(
                "the cost depends on positions or velocities: proofs cover costs of the inputs and "
                "of the time."
            )
        if np.linalg.eigvalsh(R).min(initial=0.0) < -SAME_VALUE * np.abs(R).max(initial=0.0):
            raise ProblemError("the cost is not convex in the inputs: proofs need one that is.")
        return R, c, c_0

    def _paths(self, i: int, frame: Frame) -> tuple[Array, Array]:
        """What holds at the nodes of a phase: bounds of coordinates, flat surfaces that stand."""
        p, n = self.model.problem, self.model.problem.nq
        rows, most = list[Array](), list[float]()
        for j, (low, high) in enumerate(p.coordinate_bounds):
            for sign, bound in ((1.0, high), (-1.0, -low)):
                if np.isfinite(bound):
                    rows.append(sign * np.eye(n)[j])
                    most.append(bound)
        for j, gap in self.model.flat.items():
            there = p.kernels.surfaces[j] not in p.ignored and j not in p.touch.modes[i].closed
            if there and gap.A[0, n] == 0:
                rows.append(gap.A[0, :n])
                most.append(-gap.b[0])
        A, b = np.array(rows).reshape(-1, n), np.array(most)
        A, b = A @ frame.Z, b - A @ frame.origin
        kept = np.abs(A).max(axis=1, initial=0.0) > 0
        return A[kept], b[kept]
