"""What positions and velocities cost: a convex quadratic function of them, as a sum of squares.

At each place of the quadrature of a step every square w^2/2 is an input of its own, which costs
this, and a condition that it is the function of the nodes that it stands for. Any price of that
condition gives a bound, as any other one does.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag

from dmoc.base.discretisation import Discretisation, gauss
from dmoc.base.errors import ProblemError
from dmoc.base.names import velocity_name
from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.problem.problem import Problem
from dmoc.proving.linear import LinearPhase
from dmoc.proving.linear_model import Frame
from dmoc.proving.recognition import SAME_VALUE, TRIALS

# Shares of the largest curvature, and of a cost, that are rounding errors.
FLAT, NOTHING = 1e-10, 1e-12


@record(frozen=True, eq=False)
class StateCost:
    """The sum of |E (q, v) + e|^2/2 and a constant, shapes (m, 2 nq) and (m,)."""

    E: Array
    e: Array
    rest: float

    def at(self, x: Array) -> Array:
        """Costs of rows (q, v)."""
        return np.asarray(((x @ self.E.T + self.e) ** 2).sum(axis=1) / 2 + self.rest)


@record(frozen=True, eq=False)
class Squares:
    """The squares of a step in a mode: weights of w^2/2, rows w of (q_k, h p_k, a, w, 1), shape (k,
    3, 2 r + na + k + 1), that are to vanish, and what is the same whatever the motion is."""

    weights: Array
    rows: Array
    rest: float


def state_cost(problem: Problem, sizes: Array, seconds: float) -> StateCost:
    """What positions and velocities cost beside the inputs; raise ProblemError where that is no
    convex quadratic function of them."""
    none = np.zeros((1, problem.nu))

    def cost(q: Array, v: Array) -> Array:
        return np.asarray(problem.model.running_cost(q, v, np.repeat(none, len(q), axis=0)))

    return squares_in(cost, "cost", problem, np.concatenate([sizes, sizes / seconds]))


def cost_of_end(problem: Problem, sizes: Array, seconds: float) -> StateCost:
    """What positions and velocities at the end cost, as :func:`state_cost`."""
    n, model, size = problem.nq, problem.model, np.concatenate([sizes, sizes / seconds])
    if not model.has_terminal_cost:
        return StateCost(np.zeros((0, 2 * n)), np.zeros(0), 0.0)
    first, last = (np.full((1, 1), t) for t in (0.0, problem.final_time_bounds[1]))

    def cost(q: Array, v: Array, time: Array = last) -> Array:
        return np.asarray(model.terminal_cost(q, v, np.repeat(time, len(q), axis=0))).reshape(-1)

    squares = squares_in(cost, "cost of the end", problem, size)
    x = np.random.default_rng(0).uniform(-1, 1, (TRIALS, 2 * n)) * size
    q, v = x[:, :n], x[:, n:]
    if (cost(q, v) != cost(q, v, first)).any():
        raise ProblemError(
            "the cost of the end depends on the time: proofs cover that of the state there."
        )
    expected = squares.at(x)
    if (np.abs(cost(q, v) - expected) > SAME_VALUE * np.abs(expected).max()).any():
        raise ProblemError(
            "the cost of the end is no quadratic function of positions and velocities: proofs need "
            "one."
        )
    if squares.rest < -SAME_VALUE * np.abs(expected).max():
        raise ProblemError(
            f"the cost of the end is {squares.rest:.6g} at least: proofs need one that is not "
            f"negative; add {-squares.rest:.6g}."
        )
    rest = np.sqrt(2 * max(squares.rest, 0.0))
    if rest == 0:
        return squares
    return StateCost(np.vstack([squares.E, np.zeros(2 * n)]), np.append(squares.e, rest), 0.0)


def squares_in(
    function: Callable[[Array, Array], Array], what: str, problem: Problem, size: Array
) -> StateCost:
    """The sum of squares that a function of rows (q, v) of a size is; raise ProblemError where it
    is not convex or linear in one of them."""
    n = problem.nq

    def cost(x: Array) -> Array:
        x = x * size
        return function(x[:, :n], x[:, n:])

    unit = np.eye(2 * n)
    zero = float(cost(np.zeros((1, 2 * n)))[0])
    up, down = cost(unit), cost(-unit)
    pairs = cost((unit[:, None] + unit[None]).reshape(-1, 2 * n)).reshape(2 * n, 2 * n)
    H = pairs - up[:, None] - up[None] + zero
    np.fill_diagonal(H, up + down - 2 * zero)
    noise = np.abs(pairs) + np.abs(up)[:, None] + np.abs(up)[None] + abs(zero)
    H[np.abs(H) <= NOTHING * noise] = 0.0
    slope = (up - down) / 2
    curved, ways = np.linalg.eigh(H)
    most = np.abs(curved).max()
    if curved.min() < -FLAT * most:
        raise ProblemError(
            f"the {what} is not convex in positions and velocities: proofs need one that is."
        )
    kept = curved > FLAT * most
    roots, ways = np.sqrt(curved[kept]), ways[:, kept]
    left = slope - ways @ (ways.T @ slope)
    if (np.abs(left) > SAME_VALUE * (np.abs(up) + np.abs(down) + abs(zero))).any():
        names = [*problem.kernels.coordinates, *map(velocity_name, problem.kernels.coordinates)]
        raise ProblemError(
            f"the {what} is linear in {names[int(np.argmax(np.abs(left)))]}: proofs cover costs of "
            "positions and velocities that are squares, such as (x - 1)**2."
        )
    e = ways.T @ slope / roots
    return StateCost((ways * roots).T / size, e, zero - float(e @ e) / 2)


def shapes_at_points(scheme: Discretisation) -> tuple[Array, Array]:
    """Values and slopes of the shape functions at the places of the quadrature, shape (points, d +
    1), nodes in the order (q_k, q_i, q_kp1)."""
    order = [0, *range(2, scheme.degree + 1), 1]
    powers = np.vander(scheme.places, scheme.degree + 1, increasing=True)
    return (powers @ scheme.shapes.T)[:, order], scheme.slopes(scheme.places)[:, order]


def squares_of(cost: StateCost, frame: Frame, scheme: Discretisation) -> Squares:
    """The squares of a step in the coordinates of a mode."""
    n, r, d = len(frame.Z), frame.size, scheme.degree
    values, slopes = shapes_at_points(scheme)
    weights, rows, rest = list[float](), list[Array](), cost.rest
    places = [*range(r), *range(2 * r, 2 * r + d * r)]
    for b, value, slope in zip(gauss(d)[1], values, slopes, strict=True):
        for by, e in zip(cost.E, cost.e, strict=True):
            row = np.zeros((3, 2 * r + d * r + 1))
            row[0, places] = np.kron(slope, by[n:] @ frame.Z)
            row[1, places] = np.kron(value, by[:n] @ frame.Z)
            row[1, -1] = by[:n] @ frame.origin + e
            if np.abs(row[:, :-1]).max(initial=0.0) > NOTHING * np.abs(by).max():
                weights.append(float(b))
                rows.append(row)
            else:
                rest += float(b * row[1, -1] ** 2 / 2)
    k = len(rows)
    wide = np.zeros((k, 3, 2 * r + d * r + k + 1))
    for i, row in enumerate(rows):
        wide[i, :, : 2 * r + d * r], wide[i, :, -1] = row[:, :-1], row[:, -1]
        wide[i, 1, 2 * r + d * r + i] = -1.0
    return Squares(np.array(weights), wide, rest)


def with_squares(phase: LinearPhase, squares: Squares, heavy: float) -> LinearPhase:
    """A phase with squares of its states, which cost something of a size, as inputs behind its
    own."""
    k, first, steps = len(squares.weights), len(phase.S), phase.steps
    if not k:
        return replace(phase, c_0=phase.c_0 + squares.rest)
    own, none = phase.S.shape[2] - 1, np.zeros(k)

    def wide(rows: Array, columns: int) -> Array:
        return np.insert(rows, [columns] * k, 0.0, axis=2)

    nodes = squares.rows.shape[2] - k - 1
    S = np.insert(squares.rows, [nodes] * len(phase.c), 0.0, axis=2)
    definitions = [(first + i, -1, 0, steps - 1, 1) for i in range(k)]
    return replace(
        phase, P=wide(phase.P, phase.P.shape[2] - 1),
        R=block_diag(phase.R, np.diag(squares.weights)),
        c=np.append(phase.c, none), c_0=phase.c_0 + squares.rest,
        lower=np.append(phase.lower, none - np.inf), upper=np.append(phase.upper, none + np.inf),
        S=np.concatenate([wide(phase.S, own), S]),
        conditions=np.vstack([phase.conditions, np.array(definitions)]), squares=k, heavy=heavy,
    )  # fmt: skip
