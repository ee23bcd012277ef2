"""The variational scheme beside Hermite and Simpson's rule and Radau's methods: optima of the same
problem with the same inputs, and long motions through hits."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import casadi as ca
import numpy as np
import sympy as sp
from common import Section
from ladder_casadi import Motion, State, Transcription, transcribed
from ladder_smooth import Statement
from scipy.optimize import brentq
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.models.registry import find

# Two problems are those of the examples, a folder of scripts.
sys.path.append(str(Path(__file__).resolve().parent.parent / "examples"))

import block_and_wall
import seed as reference_problem

SECONDS = 60.0  # limit of a solve
STEPS = (10, 20, 40)
LENGTH, WIDTH = 1000.0, 0.1  # of the long motion and its steps, in seconds
LOBATTO = np.array([0.0, 0.5, 1.0])
RADAU = {2: np.array([1 / 3, 1.0]), 3: np.array([(4 - 6**0.5) / 10, (4 + 6**0.5) / 10, 1.0])}


def collocation(places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Tableau A, b of the collocation at some places of a step."""
    powers = np.arange(1, len(places) + 1)
    moments = np.vander(places, increasing=True).T
    A = np.linalg.solve(moments, (places[:, None] ** powers / powers).T).T
    return A, np.linalg.solve(moments, 1 / powers)


# Optima -------------------------------------------------------------------------------------------


class Rules(Transcription):
    """Steps whose inputs are linear in a step, as those of dmoc are at order 4."""

    def hermite(
        self, before: State, after: State, _: ca.SX | None, t: ca.SX, h: ca.SX
    ) -> tuple[ca.SX, None]:
        """Hermite and Simpson's rule; its cost."""
        return self._collocated(LOBATTO, before, after, t, h)

    def radau3(
        self, before: State, after: State, _: ca.SX | None, t: ca.SX, h: ca.SX
    ) -> tuple[ca.SX, None]:
        return self._collocated(RADAU[2], before, after, t, h)

    def radau5(
        self, before: State, after: State, _: ca.SX | None, t: ca.SX, h: ca.SX
    ) -> tuple[ca.SX, None]:
        return self._collocated(RADAU[3], before, after, t, h)

    def _collocated(
        self, places: np.ndarray, before: State, after: State, t: ca.SX, h: ca.SX
    ) -> tuple[ca.SX, None]:
        (A, b), u_0, u_1 = collocation(places), self.inputs(), self.inputs()
        stages = []
        for c in places:
            inner = (
                (before, after)[int(c)] if c in (0.0, 1.0) else self.node(self.phase, self.share)
            )
            stages.append((*inner, (1 - c) * u_0 + c * u_1, t + float(c) * h))
        slopes = [(v, self.model.acceleration(q, v, u, s)) for q, v, u, s in stages]
        for (q, v, *_), c, row in zip(stages, places, A, strict=True):
            if c:
                for value, start, k in ((q, before[0], 0), (v, before[1], 1)):
                    change = sum(float(a) * slope[k] for a, slope in zip(row, slopes, strict=True))
                    self.demand(value - start - h * change)
        cost = sum(float(w) * self.model.cost(*at) for w, at in zip(b, stages, strict=True))
        return h * cost, None


@dataclass(frozen=True)
class Optimum:
    """A problem with its known cost and time of the hit."""

    name: str
    problem: Callable[[int, int], dmoc.Problem]
    system: Callable[[], dmoc.MechanicalSystem]
    cost: float
    time: float


def optima() -> tuple[Optimum, ...]:
    cost, time, _ = block_and_wall.known(0.8)
    finest = dmoc.solve(reference_problem.problem(320, 6), "ipm", starts=1, verify=False)
    return (
        Optimum(
            "block and wall, e = 0.8", lambda n, o: block_and_wall.problem(0.8, n, o),
            block_and_wall.system, cost, time,
        ),
        Optimum(
            "cart-pendulum, left", reference_problem.problem,
            find("cart_pendulum").system, finest.cost,
            finest.collisions[0].time,
        ),
    )  # fmt: skip


SCHEMES = {
    "variational, order 2": (2, ""),
    "variational, order 4": (4, ""),
    "Hermite and Simpson, order 4": (4, "hermite"),
    "Radau, 2 stages, order 3": (4, "radau3"),
    "Radau, 3 stages, order 5": (4, "radau5"),
    "variational, order 6": (6, ""),
}


def compare(quick: bool) -> Section:
    steps = STEPS[:2] if quick else STEPS
    section = Section(
        "Schemes: optima",
        "Relative errors of the cost and of the time of the hit, N steps in each of two phases. "
        "Inputs are linear in a step with two values each, in all but the variational scheme of "
        "order 2, where they are constant. The collocations are CasADi's programs with Newton's "
        "law between the phases, solved by IPOPT from the variational motion of order 4. Order: "
        "of the cost, from the last two meshes.",
        [
            "problem", "scheme", *(f"cost, N = {n}" for n in steps), "order",
            *(f"hit, N = {n}" for n in steps),
        ],
    )  # fmt: skip
    for optimum in optima():
        for name, (order, rule) in SCHEMES.items():
            costs, times = [], []
            for n in steps:
                cost, time = _solved(optimum, n, order, rule)
                costs.append(abs(cost / optimum.cost - 1))
                times.append(abs(time / optimum.time - 1))
            exact = max(costs[-2:]) < 1e-9
            shown = "exact" if exact else f"{math.log2(costs[-2] / costs[-1]):.1f}"
            section.row(
                optimum.name,
                name,
                *(f"{e:.1e}" for e in costs),
                shown,
                *(f"{e:.1e}" for e in times),
            )
    return section


def _solved(optimum: Optimum, steps: int, order: int, rule: str) -> tuple[float, float]:
    """The cost and the time of the hit."""
    problem = optimum.problem(steps, order)
    solution = dmoc.solve(problem, "ipm", starts=1, verify=False)
    if not rule:
        return solution.cost, solution.collisions[0].time
    statement = Statement(optimum.system(), {})
    program = transcribed(
        statement, problem, SECONDS, Motion(solution), Rules, rule, tol=1e-11, max_iter=500
    )
    status, answer = program.solve()
    if status != "Solve_Succeeded":
        return np.nan, np.nan
    return float(answer["f"]), float(np.array(answer["x"])[0, 0])


# Long motions -------------------------------------------------------------------------------------


def bowl() -> dmoc.MechanicalSystem:
    """A particle on a spring that hardens, within a round wall: hits keep its energy and its
    angular momentum."""
    x, y = dynamicsymbols("x y")
    square = x**2 + y**2
    return dmoc.MechanicalSystem(
        "bowl", [x, y], (x.diff() ** 2 + y.diff() ** 2) / 2 - square / 2 - square**2 / 2,
        surfaces={"wall": square <= sp.Integer(1)}, cost=1,
    )  # fmt: skip


START, SPEED = np.array([0.4, 0.0]), np.array([1.2, 1.3])


def _force(q: np.ndarray) -> np.ndarray:
    return -q * (1 + 2 * (q * q).sum(axis=-1, keepdims=True))


def _kept(q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Energy and angular momentum."""
    square = (q * q).sum(axis=1)
    energy = (v * v).sum(axis=1) / 2 + square / 2 + square**2 / 2
    return energy, q[:, 0] * v[:, 1] - q[:, 1] * v[:, 0]


def collocated(places: np.ndarray, steps: int) -> tuple[np.ndarray, np.ndarray, int]:
    """Nodes of a motion by a collocation method, which locates its hits: a step ends at the wall,
    the velocity is mirrored there, and the rest of the step follows."""
    A, b = collocation(places)

    def step(q: np.ndarray, v: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray]:
        speed, force = np.tile(v, (len(b), 1)), np.tile(_force(q), (len(b), 1))
        for _ in range(60):  # contracts by h^2
            new_speed = v + h * A @ force
            new_force = _force(q + h * A @ speed)
            change = abs(new_speed - speed).max() + abs(new_force - force).max()
            speed, force = new_speed, new_force
            if change < 1e-15:
                break
        return q + h * b @ speed, v + h * b @ force

    q, v, hits = START, SPEED, 0
    nodes = [(q, v)]
    for _ in range(steps):
        left = WIDTH
        while True:
            q_1, v_1 = step(q, v, left)
            if q_1 @ q_1 <= 1.0:
                break

            def outside(
                share: float, q: np.ndarray = q, v: np.ndarray = v, h: float = left
            ) -> float:
                place, _ = step(q, v, share * h)
                return float(place @ place) - 1.0

            low = 1e-9 if outside(1e-9) < 0 else 1e-6
            share = brentq(outside, low, 1.0, xtol=1e-14)
            q, v = step(q, v, share * left)
            v = v - 2 * (q @ v) / (q @ q) * q
            q, left, hits = q / math.sqrt(q @ q), left * (1 - share), hits + 1
        q, v = q_1, v_1
        nodes.append((q, v))
    places_, speeds = (np.array(part) for part in zip(*nodes, strict=True))
    return places_, speeds, hits


def long_runs(quick: bool) -> Section:
    steps = int((LENGTH / 10 if quick else LENGTH) / WIDTH)
    section = Section(
        "Schemes: long motions through hits",
        f"A particle on a spring that hardens, in a round elastic wall, {steps} steps of {WIDTH:g} "
        "s. Relative errors of the energy and of the angular momentum: the largest in the first "
        "tenth of the motion, and in the last one. All methods locate their hits; the variational "
        "one by its discrete law of impact, the others by a mirror.",
        [
            "scheme", "hits", "energy: first tenth", "last tenth", "angular momentum: first tenth",
            "last tenth",
        ],
    )  # fmt: skip
    for order in (2, 4, 6):
        run = dmoc.simulate(
            dmoc.build(bowl(), order=order), START, SPEED, step_size=WIDTH, steps=steps
        )
        _row(section, f"variational, order {order}", run.q, run.p, len(run.collisions))
    for name, places in (
        ("Hermite and Simpson, order 4", LOBATTO),
        ("Radau, 2 stages, order 3", RADAU[2]),
        ("Radau, 3 stages, order 5", RADAU[3]),
    ):
        _row(section, name, *collocated(places, steps))
    return section


def _row(section: Section, name: str, q: np.ndarray, v: np.ndarray, hits: int) -> None:
    cells = []
    for values in _kept(q, v):
        errors = np.abs(values / values[0] - 1)
        tenth = len(errors) // 10
        cells += [f"{errors[:tenth].max():.1e}", f"{errors[-tenth:].max():.1e}"]
    section.row(name, hits, *cells)
