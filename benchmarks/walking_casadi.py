"""RABBIT's step beside a collocation by hand: a problem with lasting contacts, friction and a
landing, as one writes it with CasADi.

Hermite and Simpson's rule in positions and velocities; accelerations, motor torques and contact
forces are unknowns at the nodes and in the middle of the steps, with the equations of motion and
the acceleration of the stance foot as equations there (as in FROST).  The landing is plastic and
sticks.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import sympy as sp
from common import Section, clocked, ms
from ladder_casadi import FUNCTIONS, Program

import dmoc

# The problem is that of an example, in a folder of scripts.
sys.path.append(str(Path(__file__).resolve().parent.parent / "examples"))

import walker

SECONDS, FRICTION, GRAVITY = 120.0, 0.7, 9.81
FREE = (-np.inf, np.inf)
POSTURE = (0.25, 0.75, 0.0, 0.35, -0.05, -0.15, -0.55)  # a guess of what a step looks like
EXCHANGED = [0, 1, 2, 5, 6, 3, 4]


class Robot:
    """Functions of the example's system: residual of the equations of motion, the feet with their
    Jacobians, momenta."""

    def __init__(self) -> None:
        system = walker.system()
        self.nq, self.nu = len(system.coordinates), len(system.inputs)
        q, v, a = (ca.SX.sym(name, self.nq) for name in "qva")
        u = ca.SX.sym("u", self.nu)
        symbols = [*ca.vertsplit(q), *ca.vertsplit(v), *ca.vertsplit(u)]
        names = [*system.coordinates, *system.velocities, *system.inputs]
        values = {sp.Symbol("g"): GRAVITY, sp.Symbol("mu"): FRICTION}

        def read(expression: Any) -> ca.SX:
            known = sp.sympify(expression).subs(values).doit()
            return ca.SX(sp.lambdify(names, known, modules=[FUNCTIONS, "math"])(*symbols))

        lagrangian = read(system.lagrangian)
        p = ca.gradient(lagrangian, v)
        force = ca.vertcat(*map(read, system.force_vector))
        rest = ca.jtimes(p, q, v) - ca.gradient(lagrangian, q) - force
        self.motion = ca.Function("motion", [q, v, a, u], [ca.jtimes(p, v, a) + rest])
        self.momentum = ca.Function("p", [q, v], [p])
        self.feet, self.jacobians, self.accelerations = [], [], []
        for name in ("left", "right"):
            place = ca.vertcat(read(system.tangents[name]), -read(system.gaps[name]))
            jacobian = ca.jacobian(place, q)
            speed = jacobian @ v
            self.feet.append(ca.Function(f"foot_{name}", [q], [place]))
            self.jacobians.append(ca.Function(f"J_{name}", [q], [jacobian]))
            change = ca.jtimes(speed, q, v) + jacobian @ a
            self.accelerations.append(ca.Function(f"a_{name}", [q, v, a], [change]))
        self.knees = ca.Function("knees", [q], [ca.vertcat(q[3] - q[4], q[5] - q[6])])


def transcribed(steps: int, **ipopt: Any) -> Any:
    """The program with as many steps in each of the two phases."""
    robot, program = Robot(), Program()
    nq, nu, h = robot.nq, robot.nu, walker.TIME / 2 / steps
    box = np.array([FREE, FREE, (-0.6, 0.6), *[(-1.8, 1.2)] * 4])

    def point(share: float, stance: int, node: bool) -> tuple[ca.SX, ...]:
        """Positions, velocities, accelerations, torques and forces, with what holds there."""
        begin = np.array(POSTURE)
        begin[0] += share * walker.STEP
        q = program.unknown("q", begin, box)
        v = program.unknown("v", [walker.STEP / walker.TIME, *[0.0] * (nq - 1)], FREE)
        a = program.unknown("a", np.zeros(nq), FREE)
        u = program.unknown("u", np.zeros(nu), FREE)
        f = program.unknown("f", [0.0, 40 * GRAVITY], [FREE, (0.0, np.inf)])
        program.demand(robot.motion(q, v, a, u) - robot.jacobians[stance](q).T @ f)
        program.demand(robot.accelerations[stance](q, v, a))
        program.demand(FRICTION * f[1] - f[0], (0.0, np.inf))
        program.demand(FRICTION * f[1] + f[0], (0.0, np.inf))
        if node:
            program.demand(robot.feet[1 - stance](q)[1], (-1e-9, np.inf))
            program.demand(robot.knees(q), (0.0, np.inf))
        return q, v, a, u, f

    def effort(u: ca.SX) -> ca.SX:
        return ca.sumsqr(u)

    cost, first, last = ca.SX(0), None, None
    for stance in (0, 1):
        before = point(stance / 2, stance, True)
        q, v = before[:2]
        if first is None:
            first = before
            program.demand(q[0])
        else:
            assert last is not None
            impulse = program.unknown("impulse", [0.0, 1.0], [FREE, (0.0, np.inf)])
            jump = robot.momentum(q, v) - robot.momentum(q, last[1])
            program.demand(q - last[0])
            program.demand(jump - robot.jacobians[1](q).T @ impulse)
            program.demand(FRICTION * impulse[1] - impulse[0], (0.0, np.inf))
            program.demand(FRICTION * impulse[1] + impulse[0], (0.0, np.inf))
        program.demand(robot.feet[stance](q)[1])
        program.demand(robot.jacobians[stance](q) @ v)
        for k in range(steps):
            middle = point((stance + (k + 0.5) / steps) / 2, stance, False)
            after = point((stance + (k + 1) / steps) / 2, stance, True)
            for i in (0, 1):  # positions by velocities, velocities by accelerations
                x_0, x_m, x_1 = before[i], middle[i], after[i]
                s_0, s_m, s_1 = before[i + 1], middle[i + 1], after[i + 1]
                program.demand(x_1 - x_0 - h / 6 * (s_0 + 4 * s_m + s_1))
                program.demand(x_m - (x_0 + x_1) / 2 - h / 8 * (s_0 - s_1))
            cost += h / 6 * (effort(before[3]) + 4 * effort(middle[3]) + effort(after[3]))
            before = after
        last = before
    shift = ca.DM([walker.STEP, *[0.0] * (nq - 1)])
    program.demand(last[0] - first[0][EXCHANGED] - shift)
    program.demand(last[1] - first[1][EXCHANGED])
    return program.solver(cost, SECONDS, **ipopt)


def compare(quick: bool) -> Section:
    section = Section(
        "RABBIT's step",
        "A periodic step of a robot with five links (`examples/walker.py`): seven coordinates, "
        "four motors, a foot that sticks, one that lands plastically, N steps in each half. "
        "CasADi: Hermite and Simpson's rule by hand with IPOPT, from one posture that moves ahead; "
        "nothing is checked. dmoc: order 2, from a statement without a guess, with exploration "
        "and check, or from its first guess alone. Kernels and expressions are built before.",
        ["tool", "N", "status", "cost", "iterations", "starts", "until the answer, ms"],
    )  # fmt: skip
    for steps in (10,) if quick else (10, 20, 30):
        solver = transcribed(steps)
        seconds, (status, found) = clocked(solver.solve)
        count = solver.function.stats()["iter_count"]
        cost = float(found["f"])
        section.row("CasADi + IPOPT", steps, status, f"{cost:.3f}", count, 1, ms(seconds))
        problem = walker.problem(steps)
        for name, given in (("dmoc", {}), ("dmoc, one start", {"starts": 1})):
            seconds, solution = clocked(lambda p=problem, g=given: dmoc.solve(p, **g))
            section.row(
                name, steps, str(solution.status), f"{solution.cost:.3f}", solution.iterations,
                solution.starts or 1, ms(seconds),
            )  # fmt: skip
    return section
