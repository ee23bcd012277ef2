"""What positions and velocities cost, also beside inputs: a convex quadratic function of them all,
as a sum of squares, a linear function of positions and velocities, and what inputs cost alone.

At each place of the quadrature of a step every square w^2/2 is an input of its own, which costs
this, and a condition that it is the function of the nodes and inputs that it stands for. Any price
of that condition gives a bound, as any other one does. What is linear is a row of each step, whose
price is 1.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag

from dmoc.base.discretisation import Discretisation, InputForm, gauss
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
    """The sum of |E x + F u + e|^2/2, slope . x and a constant, of x = (q, v) and inputs u, shapes
    (m, 2 nq), (m, nu), (m,) and (2 nq,)."""

    E: Array
    F: Array
    e: Array
    slope: Array
    rest: float

    def at(self, x: Array, u: Array) -> Array:
        """Costs of rows x and u."""
        squares = (x @ self.E.T + u @ self.F.T + self.e) ** 2
        return np.asarray(squares.sum(axis=1) / 2 + x @ self.slope + self.rest)

    def inputs_of(self, scheme: Discretisation, form: InputForm) -> tuple[Array, Array]:
        """What the squares cost of the inputs of a step alone, u R u/2 + c u."""
        R, c = np.zeros(()), np.zeros(())
        for place in places_of(scheme, form):
            by = self.F @ place.of_inputs(self.F.shape[1])
            R, c = R + place.weight * by.T @ by, c + place.weight * by.T @ self.e
        return R, c


@record(frozen=True, eq=False)
class Place:
    """A place of the quadrature of a step: its weight, values and slopes of the shape functions of
    the nodes in the order (q_k, q_i, q_kp1), shape (d + 1,), and shares of the rows of inputs."""

    weight: float
    values: Array
    slopes: Array
    shares: tuple[float, ...]

    def of_inputs(self, nu: int) -> Array:
        """The inputs there as function of those of the step, shape (nu, nb)."""
        return np.kron(np.array([self.shares]), np.eye(nu))


def places_of(scheme: Discretisation, form: InputForm) -> Iterator[Place]:
    """The places of the quadrature of a step. Steps of order 2 take their costs at both inputs."""
    values, slopes = shapes_at_points(scheme)
    for at, b, value, slope in zip(
        scheme.places, gauss(scheme.degree)[1], values, slopes, strict=True
    ):
        if not form.width:
            yield Place(float(b), value, slope, (1.0,))
        elif scheme.inside:
            yield Place(float(b), value, slope, (1 - float(at), float(at)))
        else:
            yield Place(float(b) / 2, value, slope, (1.0, 0.0))
            yield Place(float(b) / 2, value, slope, (0.0, 1.0))


@record(frozen=True, eq=False)
class Squares:
    """The squares of a step in a mode: weights of w^2/2, rows w of (q_k, h p_k, a, u, w, s, 1),
    shape (k, 3, 2 r + na + nb + k + ns + 1), that are to vanish; a row of (q_k, h p_k, a, u, s, 1)
    that is added to the cost, shape (3, 2 r + na + nb + ns + 1); and what is the same whatever the
    motion is."""

    weights: Array
    rows: Array
    linear: Array
    rest: float


def state_cost(problem: Problem, sizes: Array, seconds: float) -> StateCost:
    """What positions and velocities cost, also beside the inputs; raise ProblemError where that is
    no convex quadratic function of them."""
    reach = np.abs(problem.input_bounds).max(axis=1, initial=0.0)
    inputs = np.where(np.isfinite(reach) & (reach > 0), reach, 1.0)
    size = np.concatenate([sizes, sizes / seconds, inputs])
    return squares_in(problem.model.running_cost, "cost", problem, size)


def cost_of_end(problem: Problem, sizes: Array, seconds: float) -> StateCost:
    """What positions and velocities at the end cost, as :func:`state_cost`."""
    n, model, size = problem.nq, problem.model, np.concatenate([sizes, sizes / seconds])
    if not model.has_terminal_cost:
        return _nothing(problem)
    first, last = (np.full((1, 1), t) for t in (0.0, problem.final_time_bounds[1]))

    def cost(q: Array, v: Array, _: Array, time: Array = last) -> Array:
        return np.asarray(model.terminal_cost(q, v, np.repeat(time, len(q), axis=0))).reshape(-1)

    squares = squares_in(cost, "cost of the end", problem, np.append(size, np.ones(problem.nu)))
    x = np.random.default_rng(0).uniform(-1, 1, (TRIALS, 2 * n)) * size
    q, v, u = x[:, :n], x[:, n:], np.zeros((TRIALS, problem.nu))
    if (cost(q, v, u) != cost(q, v, u, first)).any():
        raise ProblemError(
            "the cost of the end depends on the time: proofs cover that of the state there."
        )
    expected = squares.at(x, u)
    if (np.abs(cost(q, v, u) - expected) > SAME_VALUE * np.abs(expected).max()).any():
        raise ProblemError(
            "the cost of the end is no quadratic function of positions and velocities: proofs need "
            "one."
        )
    return squares


def _nothing(problem: Problem) -> StateCost:
    n, nu = 2 * problem.nq, problem.nu
    return StateCost(np.zeros((0, n)), np.zeros((0, nu)), np.zeros(0), np.zeros(n), 0.0)


def names_of_state(problem: Problem) -> list[str]:
    names = problem.kernels.coordinates
    return [*names, *map(velocity_name, names)]


def squares_in(
    function: Callable[[Array, Array, Array], Array], what: str, problem: Problem, size: Array
) -> StateCost:
    """The squares that a function of rows (q, v), (nu,) beside them, of a size, is made of; raise
    ProblemError where it is not convex."""
    n, nu = problem.nq, problem.nu

    def cost(x: Array) -> Array:
        x = x * size
        return np.asarray(function(x[:, :n], x[:, n : 2 * n], x[:, 2 * n :])).reshape(-1)

    unit = np.eye(2 * n + nu)
    zero = float(cost(0 * unit[:1])[0])
    up, down = cost(unit), cost(-unit)
    pairs = cost((unit[:, None] + unit[None]).reshape(-1, 2 * n + nu)).reshape(len(unit), -1)
    H = pairs - up[:, None] - up[None] + zero
    np.fill_diagonal(H, up + down - 2 * zero)
    noise = np.abs(pairs) + np.abs(up)[:, None] + np.abs(up)[None] + abs(zero)
    H[np.abs(H) <= NOTHING * noise] = 0.0
    slope, noise_of_slope = (up - down) / 2, np.abs(up) + np.abs(down) + abs(zero)
    curved, ways = np.linalg.eigh(H[: 2 * n, : 2 * n])
    most = np.abs(curved).max()
    if curved.min() < -FLAT * most:
        raise ProblemError(
            f"the {what} is not convex in positions and velocities: proofs need one that is."
        )
    kept = curved > FLAT * most
    roots, ways = np.sqrt(curved[kept]), ways[:, kept]
    mixed = H[: 2 * n, 2 * n :]
    alone = mixed - ways @ (ways.T @ mixed)
    if (np.abs(alone) > SAME_VALUE * noise[: 2 * n, 2 * n :]).any():
        i, j = np.unravel_index(int(np.argmax(np.abs(alone))), alone.shape)
        raise ProblemError(
            f"the {what} is not convex in {names_of_state(problem)[i]} and "
            f"{problem.kernels.inputs[j]} together: proofs need one that is."
        )
    left = slope[: 2 * n] - ways @ (ways.T @ slope[: 2 * n])
    left[np.abs(left) <= SAME_VALUE * noise_of_slope[: 2 * n]] = 0.0
    e = ways.T @ slope[: 2 * n] / roots
    E, F = (ways * roots).T, (ways / roots).T @ mixed
    rest = zero - float(e @ e) / 2
    return StateCost(E / size[: 2 * n], F / size[2 * n :], e, left / size[: 2 * n], rest)


def shapes_at_points(scheme: Discretisation) -> tuple[Array, Array]:
    """Values and slopes of the shape functions at the places of the quadrature, shape (points, d +
    1), nodes in the order (q_k, q_i, q_kp1)."""
    order = [0, *range(2, scheme.degree + 1), 1]
    powers = np.vander(scheme.places, scheme.degree + 1, increasing=True)
    return (powers @ scheme.shapes.T)[:, order], scheme.slopes(scheme.places)[:, order]


def squares_of(cost: StateCost, frame: Frame, scheme: Discretisation, form: InputForm) -> Squares:
    """The squares of a step in the coordinates of a mode."""
    n, r, d = len(frame.Z), frame.size, scheme.degree
    nu = cost.F.shape[1]
    nb = nu * (2 if form.width else 1)
    weights, rows, rest = list[float](), list[Array](), cost.rest
    places = [*range(r), *range(2 * r, 2 * r + d * r)]
    ns = (d + 1) * len(frame.drives)
    own = slice(2 * r + d * r, 2 * r + d * r + nb)
    linear = np.zeros((3, own.stop + ns + 1))

    def row_of(by: Array, place: Place) -> Array:
        """A function (q, v) times the size of the step."""
        row = 0 * linear
        row[0, places] = np.kron(place.slopes, by[n:] @ frame.Z)
        row[1, places] = np.kron(place.values, by[:n] @ frame.Z)
        driven = frame.moved[:, frame.drives]
        row[0, own.stop : -1] = np.kron(place.slopes, by[n:] @ driven)
        row[1, own.stop : -1] = np.kron(place.values, by[:n] @ driven)
        row[1, -1] = by[:n] @ frame.origin
        return row

    for place in places_of(scheme, form):
        linear += place.weight * row_of(cost.slope, place)
        for by, by_inputs, e in zip(cost.E, cost.F, cost.e, strict=True):
            row = row_of(by, place)
            row[1, own] = by_inputs @ place.of_inputs(nu)
            row[1, -1] += e
            size = max(np.abs(by).max(), np.abs(by_inputs).max(initial=0.0))
            if np.abs(row[:, :-1]).max(initial=0.0) > NOTHING * size:
                weights.append(place.weight)
                rows.append(row)
            else:
                rest += place.weight * row[1, -1] ** 2 / 2
    k = len(rows)
    wide = np.insert(np.array(rows).reshape(k, *linear.shape), [own.stop] * k, 0.0, axis=2)
    wide[range(k), 1, range(own.stop, own.stop + k)] = -1.0
    return Squares(np.array(weights), wide, linear, rest)


def with_squares(phase: LinearPhase, squares: Squares, heavy: float) -> LinearPhase:
    """A phase with squares of its states, which cost something of a size, as inputs behind its
    own."""
    k, first, steps = len(squares.weights), len(phase.S), phase.steps
    none, behind = np.zeros(k), 1 + len(phase.places) * len(phase.drives)
    own = phase.S.shape[2] - behind

    def wide(rows: Array, columns: int) -> Array:
        return np.insert(rows, [columns] * k, 0.0, axis=2)

    linear = squares.linear[None] if squares.linear.any() else squares.linear[None][:0]
    definitions = [(first + i, -1, 0, steps - 1, 1) for i in range(k)]
    return replace(
        phase, P=wide(phase.P, phase.P.shape[2] - behind),
        R=block_diag(phase.R, np.diag(squares.weights)),
        c=np.append(phase.c, none), c_0=phase.c_0 + squares.rest,
        lower=np.append(phase.lower, none - np.inf), upper=np.append(phase.upper, none + np.inf),
        S=np.concatenate([wide(phase.S, own), squares.rows, wide(linear, own)]),
        conditions=np.vstack([phase.conditions, np.array(definitions).reshape(-1, 5)]),
        squares=k, heavy=heavy, cost=first + k if len(linear) else -1,
    )  # fmt: skip
