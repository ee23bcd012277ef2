"""What a simulation can be asked, its files, and solutions that are simulated once more."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols
from systems import block_system, landing_problem, landing_system, there_and_back

import dmoc
from dmoc.base.errors import ModelError, MotionError, SimulationError, SolutionFileError
from dmoc.codegen.kernels import Kernels
from dmoc.motion.motion_tables import columns
from dmoc.simulation.replay import _start_velocity, mean_inputs

G = 10.0
X, T = dynamicsymbols("x"), dynamicsymbols._t


@pytest.mark.parametrize("rests", [0, 1, 2])
def test_what_hardly_moves_at_the_start_of_a_motion_that_moves_rests(rests: int) -> None:
    """1e-10 m/s are an error of rounding beside 100 m/s in any phase, and a speed beside none."""
    rates = [np.array([[1e-10, 1e-10, 0.0, 1e-3], [100.0, 0.0, 1.0, 0.0]])]
    rates[rests:rests] = [np.array([[1e-10, 1e-10, 0.0, 1e-3]])]
    rates.insert(0 if rests else 2, np.array([[1e-10, 1e-10, 0.0, 1e-3]]))
    motion: Any = SimpleNamespace(phases=[SimpleNamespace(v=v) for v in rates])
    np.testing.assert_array_equal(_start_velocity(motion), [0.0, 1e-10, 0.0, 1e-3])


@pytest.fixture(scope="module")
def falling() -> dmoc.Simulation:
    """A puck that falls for 0.2 s, lands plastically, slides under 1 N and stops after 0.9 s."""
    kernels = dmoc.build(landing_system())
    return dmoc.simulate(kernels, {"y": 0.2}, {"x": 1.1}, step_size=0.03, steps=50, restitution=0.0)


def test_a_simulation_is_told_in_phases(falling: dmoc.Simulation) -> None:
    """The impulse of the landing is 2 N s; friction takes 0.2 m/s of it."""
    motion = falling.trajectory
    assert [p.mode for p in motion.phases] == ["free", "floor:slip+", "floor:stick"]
    assert [c.word for c in motion.collisions] == ["+floor:slip+", "floor:stick"]
    landing, stop = motion.collisions
    assert landing.time == pytest.approx(0.2) and stop.time == pytest.approx(0.2 + 0.9)
    assert landing.impulses["floor"] == pytest.approx(2.0)
    np.testing.assert_allclose(landing.momentum_after, [0.9, 0.0], atol=1e-9)
    for phase in motion.phases:
        assert (np.diff(phase.t) > 0).all()
    state = falling.at([0.1, 0.21, 0.9, 1.3])
    np.testing.assert_allclose(state["y"], [0.15, 0, 0, 0], atol=1e-9)
    np.testing.assert_allclose(state["x_dot"], [1.1, 0.89, 0.2, 0], atol=1e-9)
    np.testing.assert_allclose(state["N_floor"], [0, 10, 10, 10], atol=1e-9)
    np.testing.assert_allclose(state["T_floor"], [0, -1, -1, 0], atol=1e-9)
    before, after = falling.at(landing.time, "left"), falling.at(landing.time)
    assert (before["y_dot"], after["y_dot"]) == pytest.approx((-2.0, 0.0), abs=1e-9)
    with pytest.raises(MotionError, match=r"expected times from 0 to 1.5 s"):
        falling.at(1.6)


@pytest.mark.slow
def test_collisions_at_one_moment_are_one_event() -> None:
    """Into a corner, both walls at once."""
    x, y = dynamicsymbols("x y")
    m = sp.Symbol("m")
    system = dmoc.MechanicalSystem(
        "corner", [x, y], m * (x.diff() ** 2 + y.diff() ** 2) / 2, {m: 1.0},
        surfaces={"east": x <= 1, "north": y <= 1},
    )  # fmt: skip
    run = dmoc.simulate(dmoc.build(system), [0, 0], [2.0, 2.0], step_size=0.07, steps=15)
    assert len(run.collisions) == 2 and len(run.trajectory.collisions) == 1
    (hit,) = run.trajectory.collisions
    assert hit.impulses == pytest.approx({"east": 4.0, "north": 4.0})
    assert (hit.rate_before, hit.rate_after) == pytest.approx((2.0, -2.0))
    np.testing.assert_allclose(run.at(0.75).q, [0.5, 0.5], atol=1e-9)
    np.testing.assert_allclose(hit.momentum_after, [-2.0, -2.0], atol=1e-9)


@pytest.mark.parametrize("every", [1, 4])
def test_inputs_may_be_a_function_of_time(block: Kernels, every: int) -> None:
    """x'' = 6 t has x = t^3; the middle of a step has the mean of it."""
    run = dmoc.simulate(
        block, [0.0], step_size=0.01, steps=80, inputs=lambda t: [6 * t], every=every
    )
    t = np.linspace(0, 0.8, 33)
    assert run.at(t)["x"] == pytest.approx(t**3, abs=1e-4 * every**2)
    assert run.at(0.4)["u"] == pytest.approx(6 * 0.405)
    with pytest.raises(SimulationError, match="expected a function of the time that returns 1"):
        dmoc.simulate(block, [0.0], step_size=0.1, steps=2, inputs=lambda t: [t, t])


def test_a_saved_simulation_comes_back_whole(falling: dmoc.Simulation, tmp_path: Path) -> None:
    path = falling.save(tmp_path / "s.npz")
    again = dmoc.Simulation.load(path)
    for name in ("t", "q", "p", "v", "energy", "normal", "tangential"):
        np.testing.assert_array_equal(getattr(again, name), getattr(falling, name))
    assert again.contacts == falling.contacts and again.rubbing == falling.rubbing
    assert len(again.collisions) == len(falling.collisions) == 1
    both = columns(again.trajectory), columns(falling.trajectory)
    assert list(both[0]) == list(both[1])
    for name in both[0]:
        np.testing.assert_array_equal(both[0][name], both[1][name], err_msg=name)
    np.testing.assert_array_equal(again.at(0.9).v, falling.at(0.9).v)


def test_quantities_and_coefficients_of_each_phase_come_back(tmp_path: Path) -> None:
    """Two quantities, friction that rises along the floor, in phases of unlike lengths."""
    x, y = dynamicsymbols("x y")
    system = dmoc.MechanicalSystem(
        "rougher", [x, y], (x.diff() ** 2 + y.diff() ** 2) / 2 - G * y, {},
        surfaces={"floor": y >= 0}, tangents={"floor": x}, friction={"floor": 0.1 + x / 10},
        restitution={"floor": 0}, quantities={"power": x * x.diff(), "height": y + x},
    )  # fmt: skip
    run = dmoc.simulate(system, {"y": 0.2}, {"x": 1.1}, step_size=0.03, steps=50)
    phases = run.trajectory.phases
    assert [p.mode for p in phases] == ["free", "floor:slip+", "floor:stick"]
    assert len({len(p.t) for p in phases}) == 3
    assert all(p.quantities.shape[1] == 2 for p in phases)
    assert [p.coefficients.shape[1] for p in phases] == [0, 1, 1]
    again = dmoc.Simulation.load(run.save(tmp_path / "s.npz")).trajectory.phases
    for one, other in zip(phases, again, strict=True):
        np.testing.assert_array_equal(other.quantities, one.quantities)
        np.testing.assert_array_equal(other.coefficients, one.coefficients)


@pytest.mark.slow
def test_a_long_simulation_fits_into_its_file(tmp_path: Path) -> None:
    """More bounces than an archive has members."""
    block = dmoc.build(block_system())
    run = dmoc.simulate(block, [0.9], [1.0], step_size=0.05, steps=40_000, inputs=[2.0], every=8)
    assert len(run.collisions) > 1500
    again = dmoc.Simulation.load(run.save(tmp_path / "s.npz"))
    assert len(again.trajectory.phases) == len(run.trajectory.phases)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"energy": np.zeros(3)}, "energy has 3 entries, expected"),
        ({"normal": np.zeros((51, 2))}, "its forces are those of other contacts"),
    ],
)
def test_damaged_files_of_simulations_are_refused(
    falling: dmoc.Simulation, tmp_path: Path, change: dict[str, np.ndarray], message: str
) -> None:
    path = replace(falling, **change).save(tmp_path / "s.npz")
    with pytest.raises(SolutionFileError, match=message) as error:
        dmoc.Simulation.load(path)
    assert "\n" not in str(error.value)


def test_files_of_solutions_and_simulations_are_told_apart(
    solution: dmoc.Solution, falling: dmoc.Simulation, tmp_path: Path
) -> None:
    path = solution.save(tmp_path / "s.npz")
    with pytest.raises(SolutionFileError, match=r"s\.npz is the file of a solution"):
        dmoc.Simulation.load(path)
    path = falling.save(tmp_path / "f.npz")
    with pytest.raises(SolutionFileError, match=r"f\.npz is the file of a simulation"):
        dmoc.Solution.load(path)


@pytest.mark.slow
def test_tables_and_figures_of_a_simulation(falling: dmoc.Simulation, tmp_path: Path) -> None:
    frame = falling.to_frame()
    assert len(frame) == 51 + 2 * 2 and frame.attrs["units"]["N_floor"] == "N"
    assert len(falling.to_csv(tmp_path / "x.csv").read_text().splitlines()) == len(frame) + 1
    assert '"floor:stick"' in falling.to_json(tmp_path / "x.json").read_text()
    assert falling.to_xarray().sizes == {"time": 55}
    falling.plot(tmp_path / "x.png")
    assert (tmp_path / "x.png").read_bytes().startswith(b"\x89PNG")


@pytest.fixture(scope="module")
def bounced() -> dmoc.Solution:
    problem = there_and_back(
        dmoc.build(block_system()), steps=25, restitution=0.8, parameters={"m": 1.3}
    )
    return dmoc.solve(problem, "ipm", starts=1)


def test_a_replayed_solution_meets_its_collision_again(bounced: dmoc.Solution) -> None:
    run = dmoc.simulate(bounced)
    (planned,), (met,) = bounced.collisions, run.collisions
    assert met.surface == "wall" and met.time == pytest.approx(planned.time, abs=1e-3)
    assert run.final_time == pytest.approx(bounced.final_time)
    t = np.linspace(0, 1, 101)
    away = np.abs(t - planned.time) > 2e-3
    assert np.abs(run.at(t)["x"] - bounced.at(t)["x"]).max() < 5e-3
    np.testing.assert_allclose(run.at(t)["x_dot"][away], bounced.at(t)["x_dot"][away], atol=0.05)
    assert run.trajectory.parameters["m"] == 1.3 and run.trajectory.restitution["wall"] == 0.8
    other = dmoc.simulate(bounced, restitution=1.0, steps=40)
    assert len(other.t) == 41 and other.at(1.0)["x"] < run.at(1.0)["x"] - 0.05


def test_replays_converge_to_the_solution() -> None:
    """With order 4 solution and simulation come together as the steps get smaller."""
    errors = []
    for steps in (4, 8):
        problem = dmoc.Problem(
            dmoc.build(block_system(), order=4), start={"x": 0}, goal={"x": 0, "x_dot": 0},
            sequence=["wall"], steps=steps, final_time=1.0,
        )  # fmt: skip
        solution = dmoc.solve(problem, "ipm", starts=1)
        t = np.linspace(0, 1, 51)
        errors.append(np.abs(dmoc.simulate(solution).at(t)["x"] - solution.at(t)["x"]).max())
    assert errors[1] < errors[0] / 3 and errors[1] < 2e-3


def test_means_keep_the_impulse_of_the_inputs(bounced: dmoc.Solution) -> None:
    motion = bounced.trajectory
    whole = sum(float(np.diff(p.t) @ p.u[:, 0]) for p in motion.phases)
    for steps in (7, 100):
        assert mean_inputs(motion, steps).sum() / steps == pytest.approx(whole)


def test_replays_are_refused_in_one_sentence(bounced: dmoc.Solution, tmp_path: Path) -> None:
    with pytest.raises(SimulationError, match="give step_size or steps, not both"):
        dmoc.simulate(bounced, steps=10, step_size=0.1)
    loaded = dmoc.Solution.load(bounced.save(tmp_path / "s.npz"))
    with pytest.raises(ModelError, match="give its kernels"):
        dmoc.simulate(loaded)
    assert bounced.kernels is not None
    again = dmoc.simulate(loaded, model=bounced.kernels)
    np.testing.assert_array_equal(again.q, dmoc.simulate(bounced).q)
    with pytest.raises(SolutionFileError, match="another version of model"):
        dmoc.simulate(loaded, model=dmoc.load("cart_pendulum"))
    with pytest.raises(SimulationError, match="it goes with a solution"):
        dmoc.simulate(bounced.kernels, [0], step_size=1, steps=1, model=bounced.kernels)
    scuffing = replace(bounced, trajectory=replace(bounced.trajectory, ignored=("wall",)))
    with pytest.raises(SimulationError, match="the solution ignores wall"):
        dmoc.simulate(scuffing)


@pytest.mark.parametrize("name", ["x", "x_dot", X, X.diff(T)])
def test_a_velocity_has_the_names_that_a_start_has(block: Kernels, name: Any) -> None:
    motion = dmoc.simulate(block, {"x": 0.0}, {name: 0.5}, step_size=0.1, steps=10)
    assert motion.q[-1, 0] == pytest.approx(0.5)  # it moves freely for 1 s


def test_a_velocity_is_given_once(block: Kernels) -> None:
    with pytest.raises(SimulationError, match="velocity gives 'x' twice, also as 'x_dot'"):
        dmoc.simulate(block, {"x": 0.0}, {"x": 0.5, "x_dot": 0.5}, step_size=0.1, steps=1)
    with pytest.raises(SimulationError, match="unknown coordinate 'x_dot' in position"):
        dmoc.simulate(block, {"x_dot": 0.0}, step_size=0.1, steps=1)


def test_a_solution_that_lands_does_so_once_more() -> None:
    """Not as what it lands on would send it back, unless that is asked for."""
    solution = dmoc.solve(landing_problem(), "ipm", starts=1)
    again, bounced = dmoc.simulate(solution), dmoc.simulate(solution, restitution=1.0)
    assert [c.word for c in again.collisions] == ["+floor"] and len(bounced.collisions) == 4
    np.testing.assert_allclose(again.q[-1], solution.phases[-1].q[-1], atol=2e-4)
