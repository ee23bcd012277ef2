"""The peer of the ladder: direct transcription with CasADi and IPOPT, as one writes it by hand,
from a straight line, or from a motion that dmoc has found.

The equations are those of a dmoc system, read with SymPy and differentiated by CasADi. States are
positions and velocities at the nodes; order 2 is the implicit midpoint rule with constant inputs in
each step, order 4 is Hermite and Simpson's rule with inputs at the nodes and in the middle of the
steps.  A collision is a jump of the velocities between two phases, whose durations are unknowns.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import casadi as ca
import numpy as np
import sympy as sp
from common import clocked
from ladder_smooth import Statement
from sympy.physics.mechanics import dynamicsymbols

import dmoc

SHORTEST = 1e-3  # duration of a phase, relative to the largest final time, as in dmoc
FUNCTIONS = {
    name: getattr(ca, name)
    for name in (
        "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "exp", "log", "sqrt", "tanh", "fabs",
    )
} | {"Abs": ca.fabs}  # fmt: skip


@dataclass(frozen=True)
class PeerAnswer:
    """What IPOPT says, the cost, and the seconds of building and of solving."""

    status: str
    cost: float
    build: float
    solve: float

    @property
    def succeeded(self) -> bool:
        return self.status in ("Solve_Succeeded", "Solved_To_Acceptable_Level")


class CasadiModel:
    """The functions of a system with the parameters of a problem, of CasADi's symbols.

    nq coordinates, nu inputs; a = acceleration(q, v, u, t) without friction, p = momentum(q, v, t).
    """

    def __init__(self, system: dmoc.MechanicalSystem, problem: dmoc.Problem) -> None:
        self.nq, self.nu = len(system.coordinates), len(system.inputs)
        q, v = ca.SX.sym("q", self.nq), ca.SX.sym("v", self.nq)
        u, t = ca.SX.sym("u", self.nu), ca.SX.sym("t")
        places = [*system.coordinates, *system.velocities, *system.inputs, dynamicsymbols._t]
        symbols = [*ca.vertsplit(q), *ca.vertsplit(v), *(ca.vertsplit(u) if self.nu else ()), t]
        parameters = list(system.parameters)
        values = list(problem.parameter_values[0])

        def read(expression: Any) -> ca.SX:
            """An expression of SymPy as one of CasADi."""
            arguments = [*places, *parameters]
            for name, value in reversed(system.definitions.items()):
                expression = expression.subs(name, value).doit()
            function = sp.lambdify(arguments, expression, modules=[FUNCTIONS, "math"])
            return ca.SX(function(*symbols, *values))

        def function(name: str, expression: ca.SX) -> ca.Function:
            return ca.Function(name, [q, v, u, t], [expression])

        lagrangian = read(system.lagrangian)
        momentum = ca.gradient(lagrangian, v)
        force = ca.vertcat(*map(read, system.force_vector))
        rest = ca.jtimes(momentum, q, v) + ca.jacobian(momentum, t)
        mass = ca.jacobian(momentum, v)
        acceleration = ca.solve(mass, force + ca.gradient(lagrangian, q) - rest)
        self.acceleration = function("a", acceleration)
        self.momentum = function("p", momentum)
        self.cost = function("C", read(system.cost))
        self.terminal_cost = function("Phi", read(system.terminal_cost))
        self.path = function("r", ca.vertcat(*map(read, system.path_functions.values())))
        gaps = ca.vertcat(*map(read, system.gaps.values()))
        self.gaps = function("gaps", gaps)
        normals = ca.jacobian(gaps, q)
        self.normals = function("normals", normals)
        self.rates = function("rates", normals @ v + ca.jacobian(gaps, t))
        tangents = ca.vertcat(*map(read, system.tangents.values()))
        along = ca.jacobian(tangents, q)
        self.mass, self.along = function("M", mass), function("along", along)
        self.slips = function("slips", along @ v + ca.jacobian(tangents, t))
        pairs = [coefficients(system.friction[name]) for name in system.tangents]
        self.static_friction = [float(read(static)) for static, _ in pairs]
        self.friction = [float(read(kinetic)) for _, kinetic in pairs]
        self.quantities = function("z", ca.vertcat(*map(read, system.quantities.values())))


def coefficients(friction: Any) -> tuple[Any, Any]:
    """The static and the kinetic coefficient of friction."""
    static, kinetic = friction if isinstance(friction, sp.Tuple) else (friction, friction)
    return static, kinetic


class CasadiProgram:
    """A nonlinear program that is stated piece by piece."""

    def __init__(self) -> None:
        self.x: list[ca.SX] = []
        self.x0: list[np.ndarray] = []
        self.g: list[ca.SX] = []
        self.x_bounds: list[np.ndarray] = []
        self.g_bounds: list[np.ndarray] = []

    def unknown(self, name: str, start: Any, bounds: Any) -> ca.SX:
        """A vector of unknowns with its start and its bounds of shape (n, 2)."""
        start = np.atleast_1d(np.asarray(start, float))
        x = ca.SX.sym(name, len(start))
        self.x.append(x)
        self.x0.append(start)
        self.x_bounds.append(np.broadcast_to(bounds, (len(start), 2)))
        return x

    def demand(self, value: ca.SX, bounds: Any = (0.0, 0.0)) -> None:
        self.g.append(value)
        self.g_bounds.append(np.broadcast_to(bounds, (value.numel(), 2)))

    def solver(self, cost: ca.SX, seconds: float, **ipopt: Any) -> Solver:
        """The program as CasADi takes it."""
        options = {
            "ipopt": {
                "print_level": 0, "sb": "yes", "max_wall_time": seconds, "max_iter": 3000, **ipopt
            },
            "print_time": False,
        }  # fmt: skip
        program = {"x": ca.vertcat(*self.x), "f": cost, "g": ca.vertcat(*self.g)}
        x_bounds, g_bounds = np.concatenate(self.x_bounds), np.concatenate(self.g_bounds)
        bounds = {
            "lbx": x_bounds[:, 0], "ubx": x_bounds[:, 1],
            "lbg": g_bounds[:, 0], "ubg": g_bounds[:, 1],
        }  # fmt: skip
        function = ca.nlpsol("ladder", "ipopt", program, options)
        names = [x.name() for x in ca.vertsplit(program["x"])]
        return Solver(function, bounds, np.concatenate(self.x0), names)


@dataclass(frozen=True)
class Solver:
    """A program of CasADi with its bounds, its start and the names of its unknowns."""

    function: Any
    bounds: dict[str, np.ndarray]
    start: np.ndarray
    names: list[str]

    def solve(self, **changes: Any) -> tuple[str, dict[str, Any]]:
        """Its status and its results, with other bounds or another start where they are given."""
        result = self.function(**{"x0": self.start, **self.bounds, **changes})
        return str(self.function.stats()["return_status"]), result


class InitialGuess(Protocol):
    """Where a program begins: durations of the phases, the state and the inputs at a share of a
    phase, the velocity after a collision and its impulse."""

    def durations(self, phases: int) -> np.ndarray: ...
    def state(self, phase: int, share: float) -> tuple[np.ndarray, np.ndarray]: ...
    def inputs(self, phase: int, share: float) -> np.ndarray: ...
    def after(self, hit: int) -> tuple[np.ndarray, float]: ...


@dataclass(frozen=True)
class StraightLine:
    """The straight line: positions from the start to the goal, the velocity on it, the time, and
    the nodes at the ends of the phases."""

    begin: np.ndarray
    end: np.ndarray
    time: float
    ends: np.ndarray
    nu: int

    @classmethod
    def of(cls, problem: dmoc.Problem) -> StraightLine:
        low, high = problem.final_time_bounds
        if not np.isfinite(high):
            time = max(low, 1.0)
        else:
            time = float(np.sqrt(low * high)) if low > 0 else high
        begin = _middle(problem.start_bounds.position, 0.0)
        ends = np.concatenate([[0], np.cumsum(problem.phase_steps)])
        return cls(begin, _middle(problem.goal_bounds.position, begin), time, ends, problem.nu)

    def durations(self, phases: int) -> np.ndarray:
        return np.full(phases, self.time / phases)

    def state(self, phase: int, share: float) -> tuple[np.ndarray, np.ndarray]:
        node = (1 - share) * self.ends[phase] + share * self.ends[phase + 1]
        way = self.end - self.begin
        return self.begin + node / self.ends[-1] * way, way / self.time

    def inputs(self, phase: int, share: float) -> np.ndarray:
        return np.zeros(self.nu)

    def after(self, hit: int) -> tuple[np.ndarray, float]:
        return np.zeros(len(self.begin)), 0.0


@dataclass(frozen=True)
class SolvedMotion:
    """A motion that dmoc has found."""

    solution: dmoc.Solution

    def durations(self, phases: int) -> np.ndarray:
        return np.array([phase.t[-1] - phase.t[0] for phase in self.solution.phases])

    def state(self, phase: int, share: float) -> tuple[np.ndarray, np.ndarray]:
        one = self.solution.phases[phase]
        return _along(one.q, share), _along(one.v, share)

    def inputs(self, phase: int, share: float) -> np.ndarray:
        return _along(self.solution.phases[phase].u, share)

    def after(self, hit: int) -> tuple[np.ndarray, float]:
        return self.solution.phases[hit + 1].v[0], self.solution.collisions[hit].impulse


def _along(rows: np.ndarray, share: float) -> np.ndarray:
    """Values at a share of rows that are spread evenly."""
    at = np.linspace(0.0, 1.0, len(rows))
    return np.array([np.interp(share, at, column) for column in rows.T])


def _middle(bounds: np.ndarray, otherwise: Any) -> np.ndarray:
    """Where both bounds are finite their middle."""
    finite = np.isfinite(bounds).all(axis=1)
    return np.where(finite, np.where(finite[:, None], bounds, 0.0).mean(axis=1), otherwise)


def solve(
    statement: Statement, problem: dmoc.Problem, seconds: float, start: InitialGuess | None = None
) -> PeerAnswer:
    """Transcribe a problem, which must not be periodic, with its steps and order, and solve it."""
    build, solver = clocked(lambda: transcribed(statement, problem, seconds, start))
    spent, (status, result) = clocked(solver.solve)
    return PeerAnswer(status, float(result["f"]), build, spent)


NodeState = tuple[ca.SX, ca.SX]  # positions and velocities of a node


class CasadiTranscription(CasadiProgram):
    """The program of a problem, which begins at a line."""

    def __init__(self, model: CasadiModel, problem: dmoc.Problem, start: InitialGuess) -> None:
        super().__init__()
        self.model, self.problem, self.start = model, problem, start
        self.longest = StraightLine.of(problem).time
        self.phase, self.share = 0, 0.0  # where the step is that is stated

    def durations(self) -> ca.SX:
        problem, phases = self.problem, self.problem.phases
        longest = problem.final_time_bounds[1]
        shortest = SHORTEST * (longest if np.isfinite(longest) else self.longest)
        durations = problem.duration_bounds.copy()
        durations[:, 0] = np.maximum(durations[:, 0], shortest)
        T = self.unknown("T", self.start.durations(phases), durations)
        self.demand(ca.sum1(T), problem.final_time_bounds)
        return T

    def node(self, phase: int, share: float) -> NodeState:
        place, velocity = self.start.state(phase, share)
        q = self.unknown("q", place, self.problem.coordinate_bounds)
        return q, self.unknown("v", velocity, (-np.inf, np.inf))

    def inputs(self) -> ca.SX:
        begin = self.start.inputs(self.phase, self.share)
        return self.unknown("u", begin, self.problem.input_bounds)

    def boundary(self, at: Any, state: NodeState, t: ca.SX) -> None:
        """The state at one end is as it is bounded."""
        momentum = self.model.momentum(*state, 0, t)
        for value, bounds in zip(
            (*state, momentum), (at.position, at.velocity, at.momentum), strict=True
        ):
            for i in np.flatnonzero(np.isfinite(bounds).any(axis=1)):
                self.demand(value[int(i)], bounds[i])

    def collision(self, hit: int, before: NodeState, t: ca.SX) -> NodeState:
        """The state after an event of the sequence."""
        surface = list(self.problem.kernels.surfaces).index(self.problem.sequence[hit])
        return self.bounce(hit, surface, before, t)

    def bounce(self, hit: int, surface: int, before: NodeState, t: ca.SX) -> NodeState:
        """The state after a collision: an impulse along the normal, and Newton's law of impact."""
        (q, v), model, problem = before, self.model, self.problem
        begin, push = self.start.after(hit)
        after = self.unknown("v_after", begin, (-np.inf, np.inf))
        impulse = self.unknown("impulse", push, (0.0, np.inf))
        normal = model.normals(q, v, 0, t)[surface, :].T
        jump = model.momentum(q, after, 0, t) - model.momentum(q, v, 0, t)
        e = float(problem.restitution_values.ravel()[surface])
        self.demand(model.gaps(q, v, 0, t)[surface])
        self.demand(jump + normal * impulse)
        self.demand(model.rates(q, after, 0, t)[surface] + e * model.rates(q, v, 0, t)[surface])
        return q, after

    def enter(self, phase: int, state: NodeState, t: ca.SX) -> None:
        """A phase begins."""

    def outside(self, state: NodeState, t: ca.SX) -> None:
        """No surface is passed at a node."""
        self.demand(self.model.gaps(*state, 0, t), (-np.inf, 0.0))

    def ends(self, first: NodeState, last: NodeState, t: ca.SX) -> None:
        """The goal, in the last rows."""
        self.boundary(self.problem.goal_bounds, last, t)

    def midpoint(
        self, before: NodeState, after: NodeState, u: ca.SX | None, t: ca.SX, h: ca.SX
    ) -> tuple[ca.SX, None]:
        """A step of the implicit midpoint rule; its cost."""
        (q0, v0), (q1, v1), model = before, after, self.model
        at = ((q0 + q1) / 2, (v0 + v1) / 2, self.inputs(), t + h / 2)
        self.demand(q1 - q0 - h * at[1])
        self.demand(v1 - v0 - h * model.acceleration(*at))
        self.demand(model.path(*at), (0.0, np.inf))
        return h * model.cost(*at), None

    def simpson(
        self, before: NodeState, after: NodeState, u: ca.SX | None, t: ca.SX, h: ca.SX
    ) -> tuple[ca.SX, ca.SX]:
        """A step of Hermite and Simpson's rule; its cost and the inputs at its end."""
        (q0, v0), (q1, v1), model = before, after, self.model
        u0 = self.inputs() if u is None else u
        u_m, u1 = self.inputs(), self.inputs()
        a0, a1 = model.acceleration(q0, v0, u0, t), model.acceleration(q1, v1, u1, t + h)
        q_m, v_m = (q0 + q1) / 2 + h / 8 * (v0 - v1), (v0 + v1) / 2 + h / 8 * (a0 - a1)
        middle = (q_m, v_m, u_m, t + h / 2)
        self.demand(q1 - q0 - h / 6 * (v0 + 4 * v_m + v1))
        self.demand(v1 - v0 - h / 6 * (a0 + 4 * model.acceleration(*middle) + a1))
        points = ((q0, v0, u0, t), middle, (q1, v1, u1, t + h))
        for at in points[1:] if u is not None else points:
            self.demand(model.path(*at), (0.0, np.inf))
        weighted = (w * model.cost(*at) for w, at in zip((1, 4, 1), points, strict=True))
        return h / 6 * sum(weighted), u1


def transcribed(
    statement: Statement,
    problem: dmoc.Problem,
    seconds: float,
    start: InitialGuess | None = None,
    kind: type[CasadiTranscription] = CasadiTranscription,
    rule: str = "",
    **ipopt: Any,
) -> Solver:
    """The program of a problem, whose goal is in its last rows; ``rule`` names the step, if it is
    not that of the order."""
    model = CasadiModel(statement.system, problem)
    program = kind(model, problem, start or StraightLine.of(problem))
    step = getattr(program, rule or ("midpoint" if problem.order == 2 else "simpson"))
    T = program.durations()
    cost, t = ca.SX(0), ca.SX(0)
    first = state = program.node(0, 0.0)
    program.boundary(problem.start_bounds, state, t)
    for phase, steps in enumerate(problem.phase_steps):
        program.enter(phase, state, t)
        u = None
        for k in range(steps):
            program.phase, program.share = phase, k / steps
            h = T[phase] / steps
            after = program.node(phase, (k + 1) / steps)
            more, u = step(state, after, u, t, h)
            cost, t, state = cost + more, t + h, after
            program.outside(state, t)
        if phase < problem.phases - 1:
            state = program.collision(phase, state, t)
    program.ends(first, state, t)
    return program.solver(cost + model.terminal_cost(*state, 0, t), seconds, **ipopt)
