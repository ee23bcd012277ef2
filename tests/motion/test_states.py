"""The states of a solution at any time, and its tables in other formats."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from sympy.physics.mechanics import dynamicsymbols
from systems import block_system, landing_problem

import dmoc
from dmoc.base.discretisation import ORDERS
from dmoc.base.errors import MissingExtraError, MotionError
from dmoc.models.registry import find
from dmoc.motion import states
from dmoc.motion.motion_tables import columns
from dmoc.motion.scene import resampled
from dmoc.motion.states import Names, state_at

G = 9.81
# Orders of position, velocity and momentum between the nodes.
BETWEEN = {2: (2, 2, 2), 4: (4, 3, 3), 6: (5, 4, 4)}


def bounce(**fields: Any) -> dmoc.Solution:
    problem = dmoc.Problem(
        dmoc.build(block_system(), order=fields.pop("order", 2)), start={"x": 0},
        goal={"x": 0, "x_dot": 0}, sequence=["wall"], steps=6, final_time=1.0, **fields,
    )  # fmt: skip
    return dmoc.solve(problem, "ipm", starts=1)


@pytest.fixture(scope="module")
def bounced() -> dmoc.Solution:
    return bounce()


def falling(order: int, steps: int) -> dmoc.Solution:
    """A pendulum of changing inertia that no input moves."""
    a, u = dynamicsymbols("a u")
    g = sp.Symbol("g")
    system = dmoc.MechanicalSystem(
        "falling", coordinates=[a], inputs=[u],
        lagrangian=(1 + sp.cos(a) ** 2 / 2) * a.diff() ** 2 / 2 + g * sp.cos(a), forces={a: u},
        parameters={g: G}, cost=u**2 / 2,
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(system, order=order), start={"a": 0.3, "a_dot": 2.0},
        bounds={"u": (-1e-9, 1e-9)}, steps=steps, final_time=1.0,
    )  # fmt: skip
    return dmoc.solve(problem, "ipm", starts=1)


@pytest.mark.slow
@pytest.mark.parametrize("order", ORDERS)
def test_states_between_nodes_have_their_orders(order: int) -> None:
    def slope(t: float, y: np.ndarray) -> list[float]:
        force = -G * np.sin(y[0]) + np.sin(2 * y[0]) * y[1] ** 2 / 4
        return [y[1], force / (1 + np.cos(y[0]) ** 2 / 2)]

    t, errors = np.linspace(0.0, 1.0, 501), []
    right = solve_ivp(
        slope, (0, 1), [0.3, 2.0], rtol=1e-13, atol=1e-13, method="DOP853", t_eval=t
    ).y
    momentum = (1 + np.cos(right[0]) ** 2 / 2) * right[1]
    for steps in (8, 16):
        state = falling(order, steps).at(t)
        errors.append(
            [
                np.abs(state[name] - wanted).max()
                for name, wanted in (("a", right[0]), ("a_dot", right[1]), ("p_a", momentum))
            ]
        )
    measured = np.log2(np.divide(*errors))
    assert (np.abs(measured - BETWEEN[order]) < 0.35).all(), measured


@pytest.mark.slow
@pytest.mark.parametrize(("order", "controls"), [(2, "constant"), (2, "linear"), (4, "stages")])
def test_nodes_and_inputs_are_met(order: int, controls: str) -> None:
    solution = bounce(order=order, controls=controls)
    motion = solution.trajectory
    for i, phase in enumerate(solution.phases):
        for side in ("left", "right"):
            inner = slice(1, -1)
            state = solution.at(phase.t[inner], side)
            assert (state.phase == i).all()
            for name in "qvp":
                np.testing.assert_allclose(
                    getattr(state, name), getattr(phase, name)[inner], rtol=1e-12, atol=1e-12
                )
        first, last = motion.input_ends(phase)
        for share in (0.25, 0.75):
            state = solution.at(phase.t[:-1] + share * np.diff(phase.t))
            np.testing.assert_allclose(state.u, (1 - share) * first + share * last, atol=1e-9)
    at = float(solution.phases[0].t[2])
    first, last = motion.input_ends(solution.phases[0])
    assert solution.at(at, "left")["u"] == pytest.approx(last[1, 0])
    assert solution.at(at, "right")["u"] == pytest.approx(first[2, 0])


def test_the_side_decides_at_a_collision(bounced: dmoc.Solution) -> None:
    (hit,) = bounced.collisions
    before, after = bounced.at(hit.time, "left"), bounced.at(hit.time)
    assert (before["phase"], after["phase"]) == (0, 1)
    assert before["p_x"] == pytest.approx(hit.momentum_before[0])
    assert after["p_x"] == pytest.approx(hit.momentum_after[0])
    assert before["x"] == after["x"] == pytest.approx(1.0)
    start, end = bounced.at(0.0, "left"), bounced.at(bounced.final_time)
    assert start["x"] == pytest.approx(0, abs=1e-9) and end["phase"] == 1
    assert dict(end).keys() == {"t", "x", "x_dot", "p_x", "u", "N_wall", "phase"}
    assert repr(end).startswith("State(t=1, x=") and len(repr(bounced.at([0.1, 0.2]))) < 80


@pytest.mark.parametrize(
    ("t", "side", "what"),
    [
        (-0.1, "right", r"t = -0.1 s lies outside the motion: expected times from 0 to 1 s\."),
        ([0.5, 1.5], "right", r"t = 1.5 s lies outside"),
        ("now", "right", "expected a time in seconds"),
        (float("nan"), "right", "expected a time in seconds"),
        ([[0.5]], "right", "expected a time in seconds"),
        (0.5, "after", "side = 'after': expected one of left, right"),
    ],
)
def test_wrong_times_are_one_sentence(bounced: dmoc.Solution, t: Any, side: str, what: str) -> None:
    with pytest.raises(MotionError, match=what):
        bounced.at(t, side)


def test_contact_forces_are_known_at_any_time() -> None:
    """A puck of 10 N that falls, slides with mu = 0.1 and sticks."""
    solution = dmoc.solve(landing_problem(), starts=1)
    landing = solution.collisions[0].time
    assert solution.at(landing / 2)["N_floor"] == 0
    state = solution.at(landing + 0.02)
    assert state["N_floor"] == pytest.approx(10.0) and state["T_floor"] == pytest.approx(-1.0)
    table = columns(solution.trajectory)
    assert table["N_floor"][0] == 0 and table["N_floor"][-1] == pytest.approx(10.0)


def test_a_name_that_the_model_uses_is_marked(bounced: dmoc.Solution) -> None:
    motion = replace(bounced.trajectory, inputs=("N_wall",), coordinates=("phase",))
    assert "N_wall~" in Names.of(motion).places
    state = state_at(motion, 0.25)
    assert state["N_wall"] == bounced.at(0.25)["u"] and state["N_wall~"] == 0
    assert state["phase~"] == 0 and state["phase"] == bounced.at(0.25)["x"]


@pytest.fixture(scope="module")
def named() -> dmoc.Solution:
    """A motion whose model names units."""
    fields = dict(find("cart_pendulum").defaults) | {"steps": 20}
    return dmoc.solve(dmoc.Problem(dmoc.load("cart_pendulum"), **fields), "ipm", starts=1)


def test_a_csv_reads_back_the_same_numbers(named: dmoc.Solution, tmp_path: Path) -> None:
    path = named.to_csv(tmp_path / "x.csv")
    table = columns(named.trajectory)
    assert list(table) == ["t", "phase", "alpha", "x", "alpha_dot", "x_dot", "p_alpha", "p_x", "F"]
    frame = pd.read_csv(path)
    assert list(frame)[:4] == ["t [s]", "phase", "alpha [rad]", "x [m]"]
    assert "alpha_dot [rad/s]" in frame and "F [N]" in frame
    plain = np.loadtxt(path, delimiter=",", skiprows=1)
    for i, (name, column) in enumerate(table.items()):
        np.testing.assert_allclose(frame.iloc[:, i], column, rtol=4e-16, err_msg=name)
        np.testing.assert_array_equal(plain[:, i], column, err_msg=name)


def test_both_sides_of_a_collision_have_their_row(named: dmoc.Solution) -> None:
    frame = named.to_frame()
    assert len(frame) == 42 and frame.attrs["units"]["x"] == "m"
    before, after = frame[frame.t == named.collisions[0].time].to_dict("records")
    assert (before["phase"], after["phase"]) == (0, 1)
    np.testing.assert_array_equal(
        [before["p_alpha"], before["p_x"]], named.collisions[0].momentum_before
    )
    np.testing.assert_array_equal(
        [after["p_alpha"], after["p_x"]], named.collisions[0].momentum_after
    )
    first = named.phases[0]
    np.testing.assert_array_equal(frame.F[:20], first.u[:, 0])  # of the step that begins
    assert before["F"] == first.u[-1, 0] and after["F"] == named.phases[1].u[0, 0]


def test_inputs_with_jumps_have_two_rows_at_a_node() -> None:
    solution = bounce(order=4, controls="stages")
    table = columns(solution.trajectory)
    np.testing.assert_array_equal(table["u"], np.vstack([p.u for p in solution.phases])[:, 0])
    times = np.concatenate([solution.trajectory.input_times(p) for p in solution.phases])
    np.testing.assert_array_equal(table["t"], times)


@pytest.mark.slow
def test_json_and_xarray_hold_the_same(named: dmoc.Solution, tmp_path: Path) -> None:
    saved = json.loads(named.to_json(tmp_path / "x.json").read_text())
    table = columns(named.trajectory)
    assert saved["columns"] == {name: column.tolist() for name, column in table.items()}
    assert saved["units"]["alpha_dot"] == "rad/s" and saved["collisions"][0]["event"] == "lower"
    dataset = named.to_xarray()
    np.testing.assert_array_equal(dataset["alpha"].values, table["alpha"])
    assert dataset["F"].attrs["units"] == "N" and dataset.sizes == {"time": 42}
    assert {k: len(v["time"]) for k, v in dataset.groupby("phase")} == {0: 21, 1: 21}


@pytest.mark.parametrize(("package", "method"), [("pandas", "to_frame"), ("xarray", "to_xarray")])
def test_a_missing_package_is_named(
    bounced: dmoc.Solution, monkeypatch: pytest.MonkeyPatch, package: str, method: str
) -> None:
    monkeypatch.setitem(__import__("sys").modules, package, None)
    with pytest.raises(MissingExtraError, match=f"pip install {package}"):
        getattr(bounced, method)()


def test_states_of_a_file_are_those_of_the_solution(tmp_path: Path) -> None:
    solution = bounce(order=6)
    again = dmoc.Solution.load(solution.save(tmp_path / "s.npz"))
    for name, value in solution.at(0.3).items():
        assert again.at(0.3)[name] == value, name
    assert len(again.phases[0].q_inside) == 12


def test_a_phase_is_drawn_along_cubics_at_equal_parts_of_its_steps() -> None:
    """x = t^3 and y = 1 - t at the uneven nodes 0, 1/2, 2: cubics meet them in between."""
    nodes = np.array([0.0, 0.5, 2.0])

    def at(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.stack([t**3, 1 - t], axis=1), np.stack([3 * t**2, -np.ones_like(t)], axis=1)

    times, places = resampled(nodes, *at(nodes))
    np.testing.assert_allclose(
        times, np.append(np.linspace(0, 0.5, 31), np.linspace(0.5, 2, 31)[1:])
    )
    np.testing.assert_allclose(places, at(times)[0], atol=1e-12)
    one = resampled(nodes[:1], *at(nodes[:1]))
    np.testing.assert_array_equal(one[0], nodes[:1])
    many = np.linspace(0, 1, 5001)
    times, places = resampled(many, *at(many))
    assert len(times) == 3001 and (times[0], times[-1]) == (0.0, 1.0)
    np.testing.assert_allclose(places[:, 0], times**3)


@pytest.mark.parametrize("inside", [1, 2, 3])
def test_forces_at_nodes_leave_out_those_inside_of_steps(
    inside: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of rows at nodes and at places between them, as many in each step; all of a phase without
    steps."""
    rows = np.arange(4 * inside + 1.0)[:, None]
    motion: Any = None
    monkeypatch.setattr(states, "_all_forces", lambda motion, phase: phase.forces)
    phase: Any = SimpleNamespace(steps=4, forces=[(0, rows), (1, -rows)])
    one, other = states.phase_forces(motion, phase)
    np.testing.assert_array_equal(one[:, 0], inside * np.arange(5.0))
    np.testing.assert_array_equal(other, -one)
    rest: Any = SimpleNamespace(steps=0, forces=[(0, rows[:1])])
    np.testing.assert_array_equal(states.phase_forces(motion, rest)[0], [[0.0]])
