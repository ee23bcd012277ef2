"""Problems of dmoc as nosnoc takes them, which needs no sequence: complementarity conditions decide
what touches, sticks and slides.

Friction with a largest force is a switch at the sign of the slip.  Surfaces are stated by time
freezing: behind one the clock and the cost stand still while an auxiliary motion turns the velocity
round (A. Nurkanovic, T. Sartor, S. Albrecht, M. Diehl: A time-freezing approach for numerical
optimal control of nonsmooth differential equations with state jumps, IEEE Control Systems Letters 5
(2021) 439-444).  One with restitution has a spring and a damper, a plastic one a constant push
until the rate of the gap is zero, with friction of that push (A. Nurkanovic, S. Albrecht, B.
Brogliato, M. Diehl: The time-freezing reformulation for numerical optimal control of
complementarity Lagrangian systems with state jumps, Automatica 158 (2023) 111295).
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import metadata, util
from itertools import product
from math import log, pi, sqrt
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from ladder_casadi import CasadiModel
from referee_laws import velocity_bounds

import dmoc

MOST_REGIONS = 64


@dataclass(frozen=True)
class NosnocSetting:
    """Control intervals, stiffness of the springs behind surfaces (per mass in their direction),
    and the acceleration behind plastic ones, which must exceed all others there."""

    stages: int
    stiffness: float
    push: float


SETTINGS = (NosnocSetting(15, 10.0, 20.0), NosnocSetting(20, 100.0, 100.0))


class NotStatedError(Exception):
    """What nosnoc cannot state, or is not stated for it here."""


def version() -> str | None:
    """The version of nosnoc, or None where it is not installed."""
    return metadata.version("nosnoc") if util.find_spec("nosnoc") else None


@dataclass(frozen=True)
class Switch:
    """Functions whose signs say what acts: rows of signs (0: any), each with the friction of a rail
    or the auxiliary motion of a surface, None for neither."""

    functions: Sequence[ca.SX]
    choices: Sequence[tuple[tuple[int, ...], ca.SX | None]]
    freezes: bool


class NosnocStatement:
    """State (q, v, clock, cost), switches and final time of a problem."""

    def __init__(
        self, system: dmoc.MechanicalSystem, problem: dmoc.Problem, setting: NosnocSetting
    ) -> None:
        _check(problem)
        self.setting = setting
        self.problem, self.model = problem, CasadiModel(system, problem)
        self.nq = self.model.nq
        self.x = ca.SX.sym("x", 2 * self.nq + 2)
        self.u = ca.SX.sym("u", self.model.nu)
        self.q, self.v = self.x[: self.nq], self.x[self.nq : -2]
        low, high = problem.final_time_bounds
        self.free = low < high
        self.horizon = ca.SX.sym("T") if self.free else ca.SX(high)
        self.span = (low, high)
        # The clock goes from 0 to 1 where the final time is free.
        self.t = self.x[-2] * (self.horizon if self.free else 1)
        self.inverse = ca.inv(self.model.mass(self.q, self.v, self.u, self.t))
        self.switches = self._switches(system)

    def _switches(self, system: dmoc.MechanicalSystem) -> list[Switch]:
        at = (self.q, self.v, self.u, self.t)
        gaps, rates = -self.model.gaps(*at), -self.model.rates(*at)
        slips, along = self.model.slips(*at), self.model.along(*at)
        names, stiffness = list(system.tangents), self.setting.stiffness
        rails = [
            Switch([slips[k]], [
                ((s,), -s * self.model.friction[k] * self.inverse @ along[k, :].T) for s in (1, -1)
            ], False)
            for k, name in enumerate(names) if name not in system.surfaces
        ]  # fmt: skip
        surfaces = []
        for j, (name, e) in enumerate(
            zip(system.surfaces, self.problem.restitution_values, strict=True)
        ):
            normal = -self.model.normals(*at)[j, :].T
            way = self.inverse @ normal / (normal.T @ self.inverse @ normal)
            if e > 0:
                damping = 2 * abs(log(e)) * sqrt(stiffness / (pi**2 + log(e) ** 2))
                back = -way * (stiffness * gaps[j] + damping * rates[j])
                behind = ca.vertcat(way * rates[j], back, 0, 0)
                surfaces.append(Switch([gaps[j]], [((1,), None), ((-1,), behind)], True))
                continue
            pushes = [((-1, -1), way)]
            functions = [gaps[j], rates[j]]
            if name in names and self.model.friction[k := names.index(name)]:
                functions.append(slips[k])
                rub = self.inverse @ along[k, :].T / (normal.T @ self.inverse @ normal)
                pushes = [
                    ((-1, -1, s), way - s * self.model.friction[k] * rub) for s in (1, -1)
                ]  # fmt: skip
            rest = (0,) * (len(functions) - 2)
            free = [((1, 0, *rest), None), ((-1, 1, *rest), None)]
            still = ca.SX.zeros(self.nq)
            surfaces.append(Switch(functions, free + [
                (signs, ca.vertcat(still, self.setting.push * push, 0, 0)) for signs, push in pushes
            ], True))  # fmt: skip
        return rails + surfaces

    @property
    def freezes(self) -> bool:
        return any(switch.freezes for switch in self.switches)

    def regions(self) -> tuple[np.ndarray, ca.SX]:
        """Signs of the regions, and the motion in each."""
        a = self.model.acceleration(self.q, self.v, self.u, self.t)
        cost = self.model.cost(self.q, self.v, self.u, self.t)
        signs, motions = [], []
        for choice in product(*(switch.choices for switch in self.switches)):
            signs.append([s for row, _ in choice for s in row])
            acts = zip(self.switches, choice, strict=True)
            parts = [(switch.freezes, part) for switch, (_, part) in acts if part is not None]
            behind = [part for freezes, part in parts if freezes]
            rubbed = sum((part for freezes, part in parts if not freezes), a)
            free = ca.vertcat(self.v, rubbed, 1 / self.horizon if self.free else 1, cost)
            motions.append(sum(behind[1:], behind[0]) if behind else free)
        if len(signs) > MOST_REGIONS:
            raise NotStatedError(f"{len(signs)} regions")
        scale = self.horizon if self.free else 1
        return np.array(signs), scale * ca.horzcat(*motions)

    def pieces(self) -> ca.SX | None:
        """Where all surfaces throw back and nothing rubs: the motion without them, and behind
        each."""
        if any(len(s.functions) > 1 or not s.freezes for s in self.switches):
            return None
        _, motions = self.regions()
        alone = [len(self.switches) - 1 - j for j in range(len(self.switches))]
        return ca.horzcat(motions[:, 0], *(motions[:, 2**k] for k in alone))


def _check(problem: dmoc.Problem) -> None:
    if problem.periodic:
        raise NotStatedError("a start that is open")
    if problem.kernels.joints:
        raise NotStatedError("constraints")
    if len(problem.kernels.surfaces) + len(problem.kernels.tangents) == 0:
        raise NotStatedError("nothing that touches")


def solver_of(statement: NosnocStatement) -> Any:
    """The optimal control problem as nosnoc takes it."""
    import nosnoc

    problem, x, nq = statement.problem, statement.x, statement.nq
    start = problem.start_bounds
    q_0 = start.position[:, 0]
    v_0 = velocity_bounds(problem, start, q_0, 0.0)[:, 0]
    fields = {"x": x, "x0": np.array([*q_0, *v_0, 0.0, 0.0])}
    fields |= {"u": statement.u, "t_var": x[-2], "name": "stated"}
    pieces = statement.pieces()
    if pieces is None:
        signs, motions = statement.regions()
        functions = ca.vertcat(*(f for s in statement.switches for f in s.functions))
        fields |= {"F": [motions], "c": [functions], "S": [signs]}
    else:
        gaps = ca.vertcat(*(s.functions[0] for s in statement.switches))
        fields |= {"F": [pieces], "g_Stewart": [ca.vertcat(0, gaps)]}
    terminal = statement.model.terminal_cost(statement.q, statement.v, statement.u, statement.t)
    bounds = np.full((2 * nq + 2, 2), [-np.inf, np.inf])
    bounds[:nq] = problem.coordinate_bounds
    path = statement.model.path(statement.q, statement.v, statement.u, statement.t)
    ends: dict[str, Any] = {
        "lbu": problem.input_bounds[:, 0], "ubu": problem.input_bounds[:, 1],
        "lbx": bounds[:, 0], "ubx": bounds[:, 1], "f_terminal": x[-1] + terminal,
    }  # fmt: skip
    if (demands := _demands(statement)).numel():
        ends["g_terminal"] = demands
    if path.numel():
        n = path.numel()
        ends |= {"g_path": path, "lbg": np.zeros(n), "ubg": np.full(n, np.inf)}
    if statement.free:
        fields["v_global"] = statement.horizon
        low, high = statement.span
        ends |= {"lbv_global": np.array([low]), "ubv_global": np.array([high])}
        ends["v_global_guess"] = np.array([(low + high) / 2])
    return nosnoc.NosnocSolver(
        _options(nosnoc, statement, pieces is not None), nosnoc.NosnocModel(**fields),
        nosnoc.NosnocOcp(**ends),
    )  # fmt: skip


def _demands(statement: NosnocStatement) -> ca.SX:
    """What the goal fixes, zero where it is reached."""
    problem, goal = statement.problem, statement.problem.goal_bounds
    rates = velocity_bounds(problem, goal, goal.position[:, 0], statement.span[1])
    boxes, demands = [(goal.position, statement.q), (rates, statement.v)], []
    if not goal.by_velocity:
        momentum = statement.model.momentum(statement.q, statement.v, statement.u, statement.t)
        boxes.append((goal.momentum, momentum))
    for box, values in boxes:
        for k, (low, high) in enumerate(box):
            if low == high:
                demands.append(values[k] - low)
            elif np.isfinite(low) or np.isfinite(high):
                raise NotStatedError("a goal with a range")
    return ca.vertcat(*demands)


def _options(nosnoc: Any, statement: NosnocStatement, in_pieces: bool) -> Any:
    options = nosnoc.NosnocOpts()
    options.terminal_time = 1.0 if statement.free else float(statement.span[1])
    options.N_stages = statement.setting.stages
    options.N_finite_elements = 3 if statement.freezes else 2
    options.n_s = 3 if in_pieces else 2
    options.equidistant_control_grid = True
    options.time_freezing = statement.freezes
    if statement.freezes:
        options.speed_of_time_variables = nosnoc.SpeedOfTimeVariableMode.LOCAL
    options.pss_mode = nosnoc.PssMode.STEWART if in_pieces else nosnoc.PssMode.STEP
    options.mpcc_mode = nosnoc.MpccMode.ELASTIC_INEQ
    options.step_equilibration = nosnoc.StepEquilibrationMode.HEURISTIC_MEAN
    options.comp_tol = options.time_freezing_tolerance = 1e-6
    options.nlp_max_iter = 500
    return options


def solve(
    system: dmoc.MechanicalSystem, problem: dmoc.Problem, setting: NosnocSetting, motion: Path
) -> tuple[str, float]:
    """Solve with nosnoc and write its motion for the referee; return its status and its cost.

    Raises
    ------
    NotStatedError
        If the problem cannot be stated.
    """
    statement, stages = NosnocStatement(system, problem, setting), setting.stages
    answer = solver_of(statement).solve()
    x, u = np.array(answer["x_traj"]), np.array(answer["u_list"]).reshape(stages, -1)
    horizon = float(np.ravel(answer["v_global"])[0]) if statement.free else 1.0
    each = len(answer["x_list"]) // stages
    nq, kernels = statement.nq, problem.kernels
    with motion.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        rates = [f"{name}_dot" for name in kernels.coordinates]
        writer.writerow(["t", "numerical_time", *kernels.coordinates, *rates, *kernels.inputs])
        for k, (row, clock) in enumerate(zip(x, answer["t_grid"], strict=True)):
            held = u[min(k // each, stages - 1)]
            writer.writerow([row[-2] * horizon, clock * horizon, *row[:-2], *held])
    q, v, t = x[-1, :nq], x[-1, nq:-2], x[-1, -2] * horizon
    terminal = statement.model.terminal_cost(q, v, u[-1], t)
    return answer["status"].name.lower(), float(x[-1, -1] + float(terminal))
