"""The variational scheme beside Hermite and Simpson's rule and Radau's methods: optima of the same
problem with the same inputs."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import casadi as ca
import numpy as np
from common import Section
from ladder_casadi import CasadiTranscription, NodeState, SolvedMotion, transcribed
from ladder_smooth import Statement
from long_runs import LOBATTO, RADAU, collocation

import dmoc
from dmoc.models.registry import find

# Two problems are those of the examples, a folder of scripts.
sys.path.append(str(Path(__file__).resolve().parent.parent / "examples"))

import block_and_wall
import seed as reference_problem

SECONDS = 60.0  # limit of a solve
STEPS = (10, 20, 40)


class Rules(CasadiTranscription):
    """Steps whose inputs are linear in a step, as those of dmoc are at order 4."""

    def hermite(
        self, before: NodeState, after: NodeState, _: ca.SX | None, t: ca.SX, h: ca.SX
    ) -> tuple[ca.SX, None]:
        """Hermite and Simpson's rule; its cost."""
        return self._collocated(LOBATTO, before, after, t, h)

    def radau3(
        self, before: NodeState, after: NodeState, _: ca.SX | None, t: ca.SX, h: ca.SX
    ) -> tuple[ca.SX, None]:
        return self._collocated(RADAU[2], before, after, t, h)

    def radau5(
        self, before: NodeState, after: NodeState, _: ca.SX | None, t: ca.SX, h: ca.SX
    ) -> tuple[ca.SX, None]:
        return self._collocated(RADAU[3], before, after, t, h)

    def _collocated(
        self, places: np.ndarray, before: NodeState, after: NodeState, t: ca.SX, h: ca.SX
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
    """A problem with its known cost, time and impulse of the hit."""

    name: str
    problem: Callable[[int, int], dmoc.Problem]
    system: Callable[[], dmoc.MechanicalSystem]
    cost: float
    time: float
    impulse: float


def optima() -> tuple[Optimum, ...]:
    cost, time, speed = block_and_wall.closed_form(0.8)
    finest = dmoc.solve(reference_problem.problem(320, 6), "ipm", starts=1, verify=False)
    return (
        Optimum(
            "block and wall, e = 0.8", lambda n, o: block_and_wall.problem(0.8, n, o),
            block_and_wall.system, cost, time, 1.8 * speed,
        ),
        Optimum(
            "cart-pendulum, lower", reference_problem.problem,
            find("cart_pendulum").system, finest.cost,
            finest.collisions[0].time, finest.collisions[0].impulse,
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
        "Relative errors of the cost, of the time of the hit, and of its impulse, which the rates "
        "there make, N steps in each of two phases. Inputs are linear in a step with two values "
        "each, in all but the variational scheme of order 2, where they are constant. The "
        "collocations are CasADi's programs with Newton's law between the phases, solved by IPOPT "
        "from the variational motion of order 4. Order: of the cost, from the last two meshes.",
        [
            "problem", "scheme", *(f"cost, N = {n}" for n in steps), "order",
            *(f"hit, N = {n}" for n in steps), *(f"impulse, N = {n}" for n in steps),
        ],
    )  # fmt: skip
    for optimum in optima():
        for name, (order, rule) in SCHEMES.items():
            reference = optimum.cost, optimum.time, optimum.impulse
            solved = np.array([_solved(optimum, n, order, rule) for n in steps])
            costs, times, impulses = np.abs(solved / reference - 1).T.tolist()
            exact = max(costs[-2:]) < 1e-9
            measured = "exact" if exact else f"{math.log2(costs[-2] / costs[-1]):.1f}"
            section.row(
                optimum.name,
                name,
                *(f"{e:.1e}" for e in costs),
                measured,
                *(f"{e:.1e}" for e in (*times, *impulses)),
            )
    return section


def _solved(optimum: Optimum, steps: int, order: int, rule: str) -> tuple[float, float, float]:
    """The cost, the time and the impulse of the hit."""
    problem = optimum.problem(steps, order)
    solution = dmoc.solve(problem, "ipm", starts=1, verify=False)
    if not rule:
        return solution.cost, solution.collisions[0].time, solution.collisions[0].impulse
    statement = Statement(optimum.system(), {})
    program = transcribed(
        statement, problem, SECONDS, SolvedMotion(solution), Rules, rule, tol=1e-11, max_iter=500
    )
    status, answer = program.solve()
    if status != "Solve_Succeeded":
        return np.nan, np.nan, np.nan
    x = np.array(answer["x"]).ravel()
    return float(answer["f"]), float(x[0]), float(x[program.names.index("impulse")])
