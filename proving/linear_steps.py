"""The steps of a problem that moves linearly, as numbers: powers of the step size, and the cost."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from dmoc.base.discretisation import FORMS, InputForm
from dmoc.base.errors import ProblemError
from dmoc.codegen.kernels import Array
from dmoc.proving.convexity import check_convex
from dmoc.proving.linear import LinearPhase
from dmoc.proving.linear_model import Frame, LinearModel
from dmoc.proving.recognition import SAME_VALUE, TRIALS, affine
from dmoc.proving.state_costs import (
    StateCost,
    places_of,
    squares_of,
    state_cost,
    with_squares,
)
from dmoc.proving.step_conditions import StepConditions, sides

# Powers of h are read at steps of these sizes, relative to a typical one, and tried at another.
SIZES, TRIED = np.array([0.5, 1.0, 2.0]), 0.7
# Coefficients below this share of the largest power of their entry are rounding errors.
NOTHING = 1e-12
# A curvature that varies more than this with the size of an input is that of no quadratic function.
UNEVEN = 1e-3


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
                f"the input {name} has neither a cost of its own nor bounds: give it one of both, "
                "or nothing keeps it finite."
            )
        paths, most, since, within, moves = self._paths(i, frame)
        along = self._along(i, frame)
        asked = StepConditions(self.model, i, frame, along)
        low, high = bounds.T
        phase = LinearPhase(
            p.phase_steps[i], self._powers_in(frame, along), R, c, c_0, low, high, paths, most,
            since, moves, within, np.sort(p.scheme.nodes), frame.drives, asked.S, asked.conditions,
        )  # fmt: skip
        squares = squares_of(self.state_cost, frame, p.scheme, self._form)
        return with_squares(phase, squares, self._heavy)

    @cached_property
    def state_cost(self) -> StateCost:
        """What positions and velocities cost."""
        p = self.model.problem
        return state_cost(p, self.model.sizes, p.final_time_bounds[1] / p.phases)

    @property
    def _heavy(self) -> float:
        """What typical positions and velocities cost."""
        p, sizes = self.model.problem, self.model.sizes
        x = np.concatenate([sizes, sizes / (p.final_time_bounds[1] / p.phases)])
        cost = self.state_cost
        squares = replace(cost, slope=0 * cost.slope, rest=0.0).at(x[None], np.zeros((1, p.nu)))
        return float(squares[0] + np.abs(cost.slope) @ x + abs(cost.rest))

    @property
    def _form(self) -> InputForm:
        return FORMS[self.model.problem.control_form]

    @property
    def _rows(self) -> int:
        """Rows of the inputs of a step.  Where steps share them at a node, each has its own: at
        order 2 a motion is that of both halves of the impulse there in sum, and two values cost no
        less than their mean does twice, since costs are convex."""
        return 2 if self._form.width else 1

    @property
    def parts_inputs(self) -> bool:
        """Whether steps would do better with inputs of their own where they share them."""
        return bool(self._form.shared) and bool(self.state_cost.F.any())

    def _step(self, x: Array, h: float, time: float = 0.0) -> list[Array]:
        """Rows (q_k, q_i, q_kp1, u) of steps, shape (k, ...), as kernels take them."""
        p, n = self.model.problem, self.model.problem.nq
        d = p.scheme.degree
        u = x[:, (d + 1) * n :].reshape(len(x), -1, p.nu)
        q_kp1 = x[:, d * n : (d + 1) * n]
        size, at = np.full((len(x), 1), h), np.full((1, 1), time)
        return [x[:, :n], q_kp1, u[:, 0], u[:, -1], size, at, x[:, n : d * n]]

    def _momenta(self, x: Array, h: float, time: float = 0.0) -> Array:
        """h (r_i, r_minus, r_plus) of steps."""
        p = self.model.problem
        p_k, p_kp1, r_i = p.model.step_balance(self._step(x, h, time))
        return np.asarray(h * np.hstack([r_i.reshape(len(x), -1), -p_k, p_kp1]))

    def check_time(self) -> None:
        """Refuse equations of motion and costs that depend on the time: what does not is the same
        number at any."""
        p, model, rng = self.model.problem, self.model, np.random.default_rng(0)
        nodes = p.scheme.degree + 1
        q = rng.uniform(-1, 1, (TRIALS, nodes * p.nq)) * np.tile(model.sizes, nodes)
        x = np.hstack([q, rng.uniform(-1, 1, (TRIALS, self._rows * p.nu))])
        last = p.final_time_bounds[1]
        if (self._momenta(x, model.h) != self._momenta(x, model.h, last)).any():
            raise ProblemError(
                "the equations of motion depend on the time: proofs cover motion that is the same "
                "at any; solve and search have no such limit."
            )
        first, then = (p.model.step_costs(self._step(x, model.h, t)) for t in (0.0, last))
        if (first != then).any():
            raise ProblemError(
                "the cost depends on the time: proofs cover costs of the inputs, and of how long a "
                "motion takes."
            )

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

    def _along(self, i: int, frame: Frame) -> Array:
        """P of a phase in the coordinates of its mode and the momenta of the model, with the
        friction of rails, shape (3, d + 1, nq, r + na + nb + ns + 1)."""
        model, p = self.model, self.model.problem
        n, d, P = p.nq, p.scheme.degree, self._powers
        nodes, rest = P[:, :, : (d + 1) * n], P[:, :, (d + 1) * n :].copy()
        rest[:, :, -1] += nodes @ np.tile(frame.origin, d + 1)
        first, *inside, last = p.scheme.weights
        shares = np.array([*inside, first, last])
        rest[2, :, -1] += np.kron(shares, model.drag(p.touch.modes[i]))
        own, driven = (
            nodes @ np.kron(np.eye(d + 1), part) for part in (frame.Z, frame.moved[:, frame.drives])
        )
        own = np.concatenate([own, rest[:, :, :-1], driven, rest[:, :, -1:]], axis=2)
        return np.asarray(own.reshape(3, d + 1, n, own.shape[2]))

    def _powers_in(self, frame: Frame, along: Array) -> Array:
        """P of a phase in the coordinates and momenta of its mode."""
        d, (_, _, n, columns) = self.model.problem.scheme.degree, along.shape
        own = np.vstack([frame.left, np.zeros((frame.held, n))]) @ along
        for k in range(frame.moving, frame.size):  # what sticks is where it was
            own[0, :d, k, k] = -1.0
            for node in range(d):
                own[0, node, k, (node + 1) * frame.size + k] = 1.0
        return np.asarray(own.reshape(3, (d + 1) * frame.size, columns))

    @cached_property
    def cost(self) -> tuple[Array, Array, float]:
        """R, c and c_0 of the cost h (u R u/2 + c u + c_0) of a step."""
        p, model = self.model.problem, self.model
        nodes, nb = (p.scheme.degree + 1) * p.nq, self._rows * p.nu

        def cost(u: Array, q: Array) -> Array:
            x = np.hstack([np.broadcast_to(q, (len(u), nodes)), u])
            return np.asarray(p.model.step_costs(self._step(x, model.h)) / model.h)

        rest = np.zeros((1, nodes))
        c_0 = float(cost(np.zeros((1, nb)), rest)[0])
        reach = np.abs(np.tile(p.input_bounds, (self._rows, 1))).max(axis=1)
        size = np.where(np.isfinite(reach) & (reach > 0), reach, 1.0)
        for _ in range(2):  # inputs in sizes that bring the same curvature
            up, down = (cost(sign * np.diag(size), rest) for sign in (1, -1))
            bent = up + down - 2 * c_0
            curved = bent > NOTHING * (np.abs(up) + np.abs(down) + np.abs(c_0))
            size = np.where(curved, size / np.sqrt(np.where(curved, bent, 1.0)), size)
        up, down = (cost(sign * np.diag(size), rest) for sign in (1, -1))
        c, R = (up - down) / 2, np.diag(np.where(curved, up + down - 2 * c_0, 0.0))
        for i, j in zip(*np.tril_indices(nb, -1), strict=True):
            pair = cost((np.eye(nb)[i] + np.eye(nb)[j])[None] * size, rest)[0]
            crossed = pair - up[i] - up[j] + c_0
            noise = NOTHING * (np.abs(pair) + np.abs(up[i]) + np.abs(up[j]) + np.abs(c_0))
            R[i, j] = R[j, i] = crossed if abs(crossed) > noise else 0.0
        rng = np.random.default_rng(0)
        u = rng.uniform(-2, 2, (TRIALS, nb))
        q = rng.uniform(-1, 1, (TRIALS, nodes)) * np.tile(model.sizes, p.scheme.degree + 1)
        expected = np.einsum("ki,ij,kj->k", u, R, u) / 2 + u @ c + c_0
        error = SAME_VALUE * max(np.abs(expected).max(initial=0.0), 1e-300)
        uneven = np.abs(np.diag(R)[curved] - 1) > UNEVEN
        wrong = np.abs(cost(u * size, np.zeros((TRIALS, nodes))) - expected) > error
        expected += self._beside(q, u * size) - self._beside(0 * q, u * size)
        error = SAME_VALUE * max(np.abs(expected).max(initial=0.0), 1e-300)
        if uneven.any() or wrong.any():
            raise ProblemError("the cost is no quadratic function of the inputs: proofs need one.")
        if (np.abs(cost(u * size, q) - expected) > error).any():
            raise ProblemError(
                "the cost is no quadratic function of positions, velocities and inputs: proofs "
                "need one."
            )
        R, c = R / np.outer(size, size), c / size
        of_squares, slopes = self.state_cost.inputs_of(p.scheme, self._form)
        alone = R - of_squares
        alone[np.abs(alone) <= NOTHING * (np.abs(R) + np.abs(of_squares))] = 0.0
        check_convex(alone, bool(of_squares.any()))
        return alone, c - slopes, c_0 - float(self._beside(rest, np.zeros((1, nb)))[0])

    def _beside(self, q: Array, u: Array) -> Array:
        """What positions and velocities of steps with the nodes q cost beside inputs by the
        time."""
        p, total = self.model.problem, np.zeros(len(q))
        nodes = q.reshape(len(q), p.scheme.degree + 1, p.nq)
        for at in places_of(p.scheme, self._form):
            x = np.hstack([at.values @ nodes, at.slopes @ nodes / self.model.h])
            total += at.weight * self.state_cost.at(x, u @ at.of_inputs(p.nu).T)
        return total

    def _paths(self, i: int, frame: Frame) -> tuple[Array, Array, Array, Array, Array]:
        """What holds in the steps of a phase and at their ends, from which step on, whether inside
        them too, and what shifts add: bounds of coordinates, flat surfaces but for the first step
        after they were touched.  The program has times inside steps where something lasts."""
        p, model = self.model.problem, self.model
        rows, rest = list[Array](), list[tuple[float, float, float]]()
        modes, moves = p.touch.modes, list[Array]()
        for j, sign, bound in sides(p.coordinate_bounds):
            rows.append(sign * np.eye(p.nq)[j])
            rest.append((bound, 0.0, 1.0))
            moves.append(np.zeros(model.movers.count))
        for j, gap in model.flat.items():
            if p.kernels.surfaces[j] not in p.ignored and j not in modes[i].closed:
                rows.append(gap.A[0])
                left = i > 0 and j in modes[i - 1].closed
                timed = j not in p.model.moving or not p.touch.free
                rest.append((-gap.b[0], float(left), float(timed)))
                moves.append(model.shift(j)[0])
        A, (b, since, within) = np.array(rows).reshape(-1, p.nq), np.array(rest).reshape(-1, 3).T
        moved = np.array(moves).reshape(len(A), model.movers.count) + A @ frame.moved
        A, b = A @ frame.Z, b - A @ frame.origin
        kept = np.abs(np.hstack([A, moved])).max(axis=1, initial=0.0) > 0
        return A[kept], b[kept], since[kept], within[kept], moved[kept]
