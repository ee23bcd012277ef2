"""RABBIT's steps beside a collocation by hand: problems with lasting contacts, friction and a
landing, as one writes them with CasADi.

Hermite and Simpson's rule in positions and velocities; accelerations, motor torques and contact
forces are unknowns at the nodes and in the middle of the steps, with the equations of motion and
the acceleration of the stance foot as equations there (as in FROST).  The landing is plastic and
sticks.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from typing import Any

import casadi as ca
import numpy as np
import referee_motion
import sympy as sp
from common import Section, clocked, ms
from ladder_casadi import FUNCTIONS, CasadiProgram, Solver
from referee import judge
from referee_motion import Claim
from scipy.interpolate import CubicHermiteSpline

import dmoc

# The problems are those of examples, in a folder of scripts.
sys.path.append(str(Path(__file__).resolve().parent.parent / "examples"))

import transport
import walker

SECONDS, REPEATS, GRAVITY = 120.0, 3, 9.81
FREE, POSITIVE = (-np.inf, np.inf), (0.0, np.inf)
POSTURE = (0.25, 0.75, 0.0, 0.35, -0.05, -0.15, -0.55)  # a guess of what a step looks like
SPENT = np.array([400.0, walker.TIME])  # and of its effort and time
EXCHANGED = [0, 1, 2, 5, 6, 3, 4]
ROWS = 8  # of a table for the referee, in a step


@dataclass(frozen=True)
class StepTask:
    """A step on a floor with friction; with a speed, its length and time are free, and its cost is
    that of a metre."""

    friction: float
    speed: float | None = None


WALK, TRANSPORT = StepTask(0.7), StepTask(transport.FRICTION, transport.SPEED)


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

        def read(expression: Any) -> ca.SX:
            numeric = sp.sympify(expression).subs(system.parameters).doit()
            return ca.SX(sp.lambdify(names, numeric, modules=[FUNCTIONS, "math"])(*symbols))

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


@dataclass(frozen=True)
class Transcribed:
    """A program of CasADi; step sizes and points (q, v, a, u) of both phases as functions of its
    unknowns."""

    solver: Solver
    motion: ca.Function

    def claim(self, x: Any) -> Claim:
        """The motion as the referee takes it: cubics of positions and velocities and parabolas of
        torques through the points."""
        sizes, *phases = (np.array(part).T for part in self.motion(x))
        begin, tables = 0.0, []
        for h, points in zip(sizes[0], phases, strict=True):
            steps = len(points) // 2
            q, v, a, u = np.split(points, [7, 14, 21], axis=1)
            nodes = begin + h * np.arange(steps + 1)
            t = np.linspace(begin, nodes[-1], ROWS * steps + 1)
            k = np.minimum(np.arange(len(t)) // ROWS, steps - 1)
            s = (np.arange(len(t)) / ROWS - k)[:, None]
            torques = (1 - s) * (1 - 2 * s) * u[2 * k] + s * (2 * s - 1) * u[2 * k + 2]
            states = (CubicHermiteSpline(nodes, x[::2], y[::2])(t) for x, y in ((q, v), (v, a)))
            tables.append((t, *states, torques + 4 * s * (1 - s) * u[2 * k + 1]))
            begin = nodes[-1]
        t, q, v, u = map(np.concatenate, zip(*tables, strict=True))
        return Claim(t, q, v, u[:-1], u[1:], "linear", ())


def transcribed(task: StepTask, steps: int, **ipopt: Any) -> Transcribed:
    """The program with as many steps in each of the two phases.  Where the time is free, step sizes
    and sums are unknowns of each step: one for all would fill IPOPT's matrices."""
    robot, program = Robot(), CasadiProgram()
    nq, nu, size = robot.nq, robot.nu, walker.TIME / 2 / steps
    box = np.array([FREE, FREE, (-0.6, 0.6), *[(-1.8, 1.2)] * 4])

    def within_cone(push: ca.SX) -> None:
        for side in (-1, 1):
            program.demand(task.friction * push[1] + side * push[0], POSITIVE)

    def point(share: float, stance: int, node: bool) -> tuple[ca.SX, ...]:
        """Positions, velocities, accelerations and torques, with what holds there."""
        begin = np.array(POSTURE)
        begin[0] += share * walker.STEP
        q = program.unknown("q", begin, box)
        v = program.unknown("v", [walker.STEP / walker.TIME, *[0.0] * (nq - 1)], FREE)
        a = program.unknown("a", np.zeros(nq), FREE)
        u = program.unknown("u", np.zeros(nu), FREE)
        f = program.unknown("f", [0.0, 40 * GRAVITY], [FREE, POSITIVE])
        program.demand(robot.motion(q, v, a, u) - robot.jacobians[stance](q).T @ f)
        program.demand(robot.accelerations[stance](q, v, a))
        within_cone(f)
        program.demand(robot.knees(q), POSITIVE)
        if node:
            program.demand(robot.feet[1 - stance](q)[1], (-1e-9, np.inf))
        return q, v, a, u

    sums = ca.SX.zeros(2)  # effort and time
    phases, sizes = list[list[tuple[ca.SX, ...]]](), list[ca.SX]()
    for stance in (0, 1):
        points = [point(stance / 2, stance, True)]
        q, v = points[0][:2]
        if phases:
            before = phases[0][-1]
            impulse = program.unknown("impulse", [0.0, 1.0], [FREE, POSITIVE])
            jump = robot.momentum(q, v) - robot.momentum(q, before[1])
            program.demand(q - before[0])
            program.demand(jump - robot.jacobians[1](q).T @ impulse)
            within_cone(impulse)
        program.demand(robot.feet[stance](q)[1])
        program.demand(robot.jacobians[stance](q) @ v)
        h = ca.SX(size)
        for k in range(steps):
            if task.speed:
                before, h = h, program.unknown("h", size, (0.01 * size, 3 * size))
                if k:
                    program.demand(h - before)
            middle = point((stance + (k + 0.5) / steps) / 2, stance, False)
            after = point((stance + (k + 1) / steps) / 2, stance, True)
            for i in (0, 1):  # positions by velocities, velocities by accelerations
                x_0, x_m, x_1 = points[-1][i], middle[i], after[i]
                s_0, s_m, s_1 = points[-1][i + 1], middle[i + 1], after[i + 1]
                program.demand(x_1 - x_0 - h / 6 * (s_0 + 4 * s_m + s_1))
                program.demand(x_m - (x_0 + x_1) / 2 - h / 8 * (s_0 - s_1))
            efforts = [ca.sumsqr(p[3]) for p in (points[-1], middle, after)]
            sums += ca.vertcat(h / 6 * (efforts[0] + 4 * efforts[1] + efforts[2]), h)
            if task.speed:
                before, share = sums, (stance + (k + 1) / steps) / 2
                sums = program.unknown("sums", SPENT * share, FREE)
                program.demand(sums - before)
            points += [middle, after]
        phases.append(points)
        sizes.append(h)
    first, last = phases[0][0], phases[1][-1]
    program.demand(first[0][0])
    exchange, length = last[0] - first[0][EXCHANGED], last[0][0]
    program.demand(exchange[1:])
    program.demand(length, transport.LENGTHS if task.speed else (walker.STEP, walker.STEP))
    program.demand(last[1] - first[1][EXCHANGED])
    if task.speed:
        program.demand(robot.feet[0](first[0])[0])
        program.demand(length - task.speed * sums[1])
    tables = [ca.horzcat(*(ca.vertcat(*p) for p in points)) for points in phases]
    motion = ca.Function("motion", [ca.vertcat(*program.x)], [ca.vertcat(*sizes), *tables])
    cost = sums[0] / length if task.speed else sums[0]
    return Transcribed(program.solver(cost, SECONDS, **ipopt), motion)


def walk(quick: bool) -> Section:
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
        solver = transcribed(WALK, steps).solver
        seconds, (status, result) = clocked(solver.solve)
        count = solver.function.stats()["iter_count"]
        cost = float(result["f"])
        section.row("CasADi + IPOPT", steps, status, f"{cost:.3f}", count, 1, ms(seconds))
        half = walker.TIME / 2
        problem = walker.problem(steps, 2).but(durations=[half, half])
        for name, options in (("dmoc", {}), ("dmoc, one start", {"starts": 1})):
            seconds, solution = clocked(lambda p=problem, g=options: dmoc.solve(p, **g))
            section.row(
                name, steps, str(solution.status), f"{solution.cost:.3f}", solution.iterations,
                solution.starts or 1, ms(seconds),
            )  # fmt: skip
    return section


def transported(quick: bool) -> Section:
    """The cost of a metre, its motions simulated by the referee."""
    section = Section(
        "A metre of RABBIT's walk",
        f"The cost of a metre at {transport.SPEED} m/s, length and time of the step being free "
        "(`examples/transport.py`), N steps in each phase. CasADi: the collocation of the section "
        "before, from the same posture, or from the step that it finds there. dmoc: from a "
        "statement without a guess, from its first guess alone, and, on the coarsest meshes, with "
        "exploration; always with its check. Recomputed: the torques simulated and their squares "
        f"integrated by the referee (docs/referee.md), in brackets where it refuses the motion. "
        f"Medians of {REPEATS} runs in seconds of a core, at most {SECONDS / 4:g} for CasADi; "
        "programs and kernels are built before.",
        ["tool", "order", "N", "status", "cost", "recomputed", "step, m", "time, s", "iterations",
         "starts", "core, s"],
    )  # fmt: skip
    for steps in (10,) if quick else (10, 20, 40):
        _by_hand(section, steps)
    every = ((2, 10), (2, 20), (2, 40), (4, 5), (4, 10), (4, 20))
    for order, steps in every[3:4] if quick else every:
        problem = _metre(steps, order)
        explored = [("dmoc", None)] if (order, steps) in (every[0], every[3]) else []
        for name, starts in (*explored, ("dmoc, one start", 1)):
            seconds, solution = _core(lambda p=problem, n=starts: dmoc.solve(p, starts=n))
            with tempfile.TemporaryDirectory() as folder:
                path = solution.to_csv(Path(folder) / "motion.csv")
                claim = referee_motion.read_claim(path, problem)
            section.row(
                name, order, steps, str(solution.status), *_recomputed(solution.cost, claim),
                solution.iterations, solution.starts or 1, f"{seconds:.2f}",
            )  # fmt: skip
    return section


def _metre(steps: int, order: int) -> dmoc.Problem:
    """The metre from the hip above the stance foot on, with the landing inside, as by hand."""
    system = transport.system()
    reach = system.coordinates[0] - system.tangents["left"]
    system = replace(system, quantities={**system.quantities, "reach": reach})
    return transport.problem(steps, order).but(
        kernels=dmoc.build(system, order=order), start={"x": 0.0, "reach": 0.0}, durations=None
    )


def _by_hand(section: Section, steps: int) -> None:
    """Rows of the collocation from the posture, and from the step whose length and time are given,
    which is solved before."""
    limits = {"max_cpu_time": SECONDS / 4, "max_wall_time": 1e4}
    walked, metre = transcribed(WALK, steps), transcribed(TRANSPORT, steps, **limits)
    own = [not name.startswith(("h", "sums")) for name in metre.solver.names]

    def from_step() -> Any:
        x = metre.solver.start.copy()
        x[own] = np.array(walked.solver.solve()[1]["x"]).ravel()
        return metre.solver.solve(x0=x)

    for name, run in (("CasADi + IPOPT", metre.solver.solve), ("CasADi, from a step", from_step)):
        seconds, (status, result) = _core(run)
        section.row(
            name, 4, steps, status, *_recomputed(float(result["f"]), metre.claim(result["x"])),
            metre.solver.function.stats()["iter_count"], 1, f"{seconds:.2f}",
        )  # fmt: skip


def _core(run: Callable[[], Any]) -> tuple[float, Any]:
    """Median seconds of a core, and the last result."""
    seconds = []
    for _ in range(REPEATS):
        begin = time.process_time()
        result = run()
        seconds.append(time.process_time() - begin)
    return median(seconds), result


def _recomputed(cost: float, claim: Claim) -> tuple[str, ...]:
    """A cost, that of the referee, and length and time of a step."""
    problem = dmoc.Problem(
        dmoc.build(walker.system()),
        {"x": 0.0},
        periodic={"x": ("x", transport.LENGTHS)} | walker.SAME | walker.RATES,
        parameters={"mu": TRANSPORT.friction},
        **walker.STEPPING,
    )
    judgement, length = judge(problem, claim), claim.q[-1, 0]
    cell = f"{judgement.cost / length:.3f}"
    cell = cell if judgement.agrees else f"({cell})"
    return f"{cost:.3f}", cell, f"{length:.4f}", f"{claim.t[-1]:.4f}"
