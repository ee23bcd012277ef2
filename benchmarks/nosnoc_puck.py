"""The puck among four walls with nosnoc, which needs no sequence: complementarity conditions decide
which walls are hit.

Elastic walls are stated by time freezing: behind a wall the clock stands still while a spring
turns the velocity round (A. Nurkanovic, T. Sartor, S. Albrecht, M. Diehl: A time-freezing approach
for numerical optimal control of nonsmooth differential equations with state jumps. IEEE Control
Systems Letters 5 (2021) 439-444).  The pieces are in Stewart's form; the cost is a state, because
it grows only while the clock runs.

Run:  python benchmarks/nosnoc_puck.py STAGES...
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Mapping
from importlib import metadata, util
from typing import Any

import numpy as np
from common import clocked

from dmoc.models.registry import find

STIFFNESS = 10.0  # of the spring behind a wall, per mass: stiffer ones lead to dearer motions
WALLS = ("west", "east", "south", "north")
SECONDS = 300.0  # limit of one solve
AT = 1e-9  # distance from a wall, and time to it, that count as being there
BEHIND = 0.5  # share of the dynamics behind a wall from which the puck counts as there


def version() -> str | None:
    """The version of nosnoc, or None where it is not installed."""
    return metadata.version("nosnoc") if util.find_spec("nosnoc") else None


def solved(stages: int) -> dict[str, Any]:
    """What nosnoc finds, in a process of its own: it changes the filters of warnings."""
    command = [sys.executable, __file__, str(stages)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS, check=True)
    except subprocess.TimeoutExpired:
        return {"stages": stages, "status": f"more than {SECONDS:.0f} s"}
    except subprocess.CalledProcessError as error:
        last = (error.stderr.strip().splitlines() or ["no message"])[-1]
        return {"stages": stages, "status": f"error: {last[:80]}"}
    return dict(json.loads(done.stdout.splitlines()[-1]))


def run(stages: int) -> dict[str, Any]:
    """Solve, and replay the inputs with exact walls."""
    import nosnoc

    data = find("puck_table").defaults
    build, solver = clocked(lambda: _solver(nosnoc, data, stages))
    seconds, found = clocked(solver.solve)
    states = np.array(found["x_traj"])
    ends = states[:: len(found["x_list"]) // stages]
    inputs = np.array(found["u_list"])
    return {
        "stages": stages, "status": found["status"].name.lower(), "cost": float(states[-1, 5]),
        "walls": _walls(found["theta_list"]), "missed": missed(data, np.diff(ends[:, 4]), inputs),
        "build": build, "seconds": seconds, "version": version(),
    }  # fmt: skip


def _solver(nosnoc: Any, data: Mapping[str, Any], stages: int) -> Any:
    """The optimal control problem: state (x, y, v_x, v_y, t, J), mass and table of size 1."""
    import casadi as ca

    state, u = ca.SX.sym("state", 6), ca.SX.sym("u", 2)
    x, y, v_x, v_y = (state[i] for i in range(4))
    free = ca.vertcat(v_x, v_y, u[0], u[1], 1, ca.sumsqr(u) / 2)
    behind = [ca.vertcat(v_x, 0, -STIFFNESS * (x - wall), 0, 0, 0) for wall in (0.0, 1.0)] + [
        ca.vertcat(0, v_y, 0, -STIFFNESS * (y - wall), 0, 0) for wall in (0.0, 1.0)
    ]
    names = ("x", "y", "x_dot", "y_dot")
    model = nosnoc.NosnocModel(
        x=state,
        x0=np.array([*(data["start"][n] for n in names), 0.0, 0.0]),
        F=[ca.horzcat(free, *behind)],
        g_Stewart=[ca.vertcat(0, x, 1 - x, y, 1 - y)],  # the piece with the least one holds
        u=u,
        t_var=state[4],
        name="puck",
    )
    goal = ca.vertcat(*(state[i] - data["goal"][n] for i, n in enumerate(names)))
    ocp = nosnoc.NosnocOcp(f_terminal=state[5], g_terminal=goal)
    options = nosnoc.NosnocOpts()
    options.terminal_time = float(data["final_time"])
    options.N_stages, options.N_finite_elements, options.n_s = stages, 3, 3
    options.time_freezing = options.equidistant_control_grid = True
    options.speed_of_time_variables = nosnoc.SpeedOfTimeVariableMode.LOCAL
    options.pss_mode = nosnoc.PssMode.STEWART
    options.mpcc_mode = nosnoc.MpccMode.ELASTIC_INEQ
    options.step_equilibration = nosnoc.StepEquilibrationMode.HEURISTIC_MEAN
    options.comp_tol = 1e-6
    options.nlp_max_iter = 2000
    return nosnoc.NosnocSolver(options, model, ocp)


def _walls(shares: Any) -> list[str]:
    """The walls in the order in which the puck is behind them."""
    walls: list[str] = []
    last = None
    for share in shares:
        share = np.ravel(share)[1:]
        at = WALLS[int(share.argmax())] if share.max() > BEHIND else None
        if at is not None and at != last:
            walls.append(at)
        last = at
    return walls


def missed(data: Mapping[str, Any], times: np.ndarray, inputs: np.ndarray) -> float:
    """Largest difference to the goal, in positions and velocities, when constant inputs act one
    after the other for their times between exact walls."""
    start, goal = (
        np.array([[data[end][n] for n in names] for names in (("x", "y"), ("x_dot", "y_dot"))])
        for end in ("start", "goal")
    )
    reached = np.array([_bounced(*start[:, i], times, inputs[:, i]) for i in range(2)]).T
    return float(np.abs(reached - goal).max())


def _bounced(q: float, v: float, times: np.ndarray, forces: np.ndarray) -> tuple[float, float]:
    """Position and velocity between elastic walls at 0 and 1 after constant forces."""
    for left, force in zip(times, forces, strict=True):
        while left > 0:
            if (q < AT and v < 0) or (q > 1 - AT and v > 0):
                v = -v
            hits = [
                root.real
                for wall in (0.0, 1.0)
                for root in np.roots([force / 2, v, q - wall])
                if root.imag == 0 and root.real > AT and (v + force * root.real) * (wall - 0.5) > 0
            ]
            step = float(min([left, *hits]))
            q, v = q + v * step + force / 2 * step**2, v + force * step
            left -= step
    return q, v


def main() -> None:
    for stages in sys.argv[1:]:
        print(json.dumps(run(int(stages))))


if __name__ == "__main__":
    main()
