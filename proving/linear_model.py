"""The mechanics of a model that moves linearly: momenta, gaps, and the coordinates of its modes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import null_space

from dmoc.base.errors import ProblemError
from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.mechanics.contact_mode import Mode
from dmoc.problem.problem import Problem
from dmoc.proving.linear import Rows
from dmoc.proving.recognition import Affine, affine


@record(frozen=True, eq=False)
class Frame:
    """Coordinates of a mode: q = origin + Z y, y = inverse (q - origin), p_y = left p."""

    origin: Array
    Z: Array
    inverse: Array
    left: Array

    @property
    def size(self) -> int:
        return int(self.Z.shape[1])


@dataclass(eq=False)
class LinearModel:
    """The model of a problem, in functions that are affine; what is not is refused by name."""

    problem: Problem

    @cached_property
    def sizes(self) -> Array:
        """Typical sizes of the coordinates, shape (nq,)."""
        reach = np.abs(self.problem.reach)
        return np.where(np.isfinite(reach) & (reach > 0), reach, 1.0)

    @cached_property
    def h(self) -> float:
        """A typical size of a step."""
        low, high = self.problem.final_time_bounds
        time = high if np.isfinite(high) else max(low, 1.0)
        return float(time / sum(self.problem.phase_steps))

    @cached_property
    def momentum(self) -> Affine:
        """p = dL/dv as function of (q, v)."""
        n, names = self.problem.nq, list(self.problem.kernels.coordinates)
        function = self.problem.model.momentum
        sizes = np.concatenate([self.sizes, self.sizes])
        return affine(lambda x: function(x[:, :n], x[:, n:]), [*names, *names], "momentum", sizes)

    @property
    def M(self) -> Array:
        """The mass matrix, shape (nq, nq)."""
        return self.momentum.A[:, self.problem.nq :]

    def gap(self, j: int) -> Affine:
        """The gap to a surface as function of (q, t)."""
        p, n = self.problem, self.problem.nq
        names = [*p.kernels.coordinates, "the time"]
        width = np.append(self.sizes, self.h * sum(p.phase_steps))

        def values(x: Array) -> Array:
            return p.model.gaps(x[:, :n], x[:, n])[:, [j]]

        return affine(values, names, f"gap to {p.kernels.surfaces[j]}", width)

    @cached_property
    def flat(self) -> dict[int, Affine]:
        """Gaps to the surfaces that are flat, by number."""
        flat = {}
        for j in range(self.problem.model.nc):
            try:
                flat[j] = self.gap(j)
            except ProblemError:
                continue
        return flat

    # Modes ----------------------------------------------------------------------------------------

    def frame(self, mode: Mode) -> Frame:
        """The coordinates of a mode."""
        p, n = self.problem, self.problem.nq
        if mode.free:
            return Frame(np.zeros(n), np.eye(n), np.eye(n), np.eye(n))
        places, pushes, values = list[Array](), list[Array](), list[float]()
        friction = {p.model.supports[k]: (k, sign) for k, sign in mode.sliding}
        for j in mode.closed:
            gap = self.gap(j)
            if gap.A[0, n] != 0:
                raise ProblemError(
                    f"{p.kernels.surfaces[j]} moves while it is touched: proofs cover contacts "
                    "that last with surfaces that stand."
                )
            normal = gap.A[0, :n]
            places.append(normal)
            values.append(float(gap.b[0]))
            k, sign = friction.get(j, (-1, 0))
            pushes.append(normal + sign * self._friction(k) * self._tangent(k) if sign else normal)
        for k in mode.sticking:
            tangent = self._tangent(k)
            places.append(tangent)
            values.append(float(-tangent @ self._place(mode, k)))
            pushes.append(tangent)
        A = np.array(places)
        origin = np.linalg.lstsq(A, -np.array(values), rcond=None)[0]
        Z = null_space(A)
        return Frame(origin, Z, np.linalg.pinv(Z), null_space(np.array(pushes)).T)

    def _place(self, mode: Mode, k: int) -> Array:
        """Where tangent k sticks: at the start."""
        p, start = self.problem, self.problem.start_bounds.position
        if mode is not p.touch.modes[0] or not (start[:, 0] == start[:, 1]).all():
            raise ProblemError(
                f"{p.kernels.tangents[k]} sticks where the motion leads it: proofs cover contacts "
                "that stick from a start that is given, and those that slide or have no friction."
            )
        return start[:, 0]

    def _tangent(self, k: int) -> Array:
        p = self.problem

        def values(q: Array) -> Array:
            return p.model.tangents(q)[:, [k]]

        name = p.kernels.tangents[k]
        tangent = affine(values, list(p.kernels.coordinates), f"tangent {name}", self.sizes)
        return np.asarray(tangent.A[0])

    def _friction(self, k: int) -> float:
        mu = float(self.problem.friction[k])
        if not np.isfinite(mu):
            raise ProblemError(
                f"the friction of {self.problem.kernels.tangents[k]} varies: proofs cover a "
                "constant coefficient."
            )
        return mu

    # Functions of the state -----------------------------------------------------------------------

    def velocity(self, frame: Frame) -> tuple[Array, Array]:
        """v as function V z + v_0 of the state in a mode, shapes (nq, 2 r) and (nq,)."""
        n, r = self.problem.nq, frame.size
        inverse = frame.Z @ np.linalg.inv(frame.left @ self.M @ frame.Z)
        G, p_0 = self.momentum.A[:, :n], self.momentum.b
        V = np.zeros((n, 2 * r))
        V[:, :r] = -inverse @ frame.left @ G @ frame.Z
        V[:, r:] = inverse
        return V, -inverse @ frame.left @ (G @ frame.origin + p_0)

    def rows(self, frame: Frame, a: Array, v: Array, b: Array, b_t: Array | float = 0.0) -> Rows:
        """Functions a q + v v + b + b_t t of the state in a mode."""
        V, v_0 = self.velocity(frame)
        A = v @ V
        A[:, : frame.size] += a @ frame.Z
        return Rows(A, a @ frame.origin + v @ v_0 + b, np.broadcast_to(b_t, b.shape).astype(float))
