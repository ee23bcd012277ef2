"""Carried solvers whose parameters leave no law: masses, friction and restitution that no body has,
numbers that a problem does not have, and ends that are no motion."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from pytest import approx
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import ProblemError
from dmoc.export.loaded_solver import LoadedSolver, load_solver

x, y, a, u, w = dynamicsymbols("x y a u w")
mu, mu_s, k, c, e_t, m = sp.symbols("mu mu_s k c e_t m")
BALL = (x.diff() ** 2 + y.diff() ** 2) / 2 - 9.81 * y
ON_FLOOR: dict[str, Any] = {"surfaces": {"floor": y >= 0}, "tangents": {"floor": x}}
ON_RAIL: dict[str, Any] = {"tangents": {"rail": x}}
SLIDES: dict[str, Any] = {"contacts": ["floor:slip+"], "final_time": 1}
DRAGS: dict[str, Any] = {"contacts": ["rail:slip+"], "final_time": 1}


def pushed(
    coordinates: list[Any], energy: Any, parameters: dict[Any, float], order: int = 2, **fields: Any
) -> Any:
    fields = {"inputs": [u], "forces": {x: u}, "cost": u**2} | fields
    system = dmoc.MechanicalSystem("pushed", coordinates, energy, parameters, **fields)
    return dmoc.build(system, order=order)


def rubbing(friction: Any, order: int = 2) -> Any:
    values = {mu: 0.3, k: 0.1}
    return pushed([x, y], BALL, values, order, friction={"floor": friction}, **ON_FLOOR)


def returning() -> dmoc.Problem:
    """To a wall at 1 m and back, which returns exp(-c v) of v."""
    kernels = pushed(
        [x], x.diff() ** 2 / 2, {c: 1.0}, surfaces={"wall": x <= 1},
        restitution={"wall": sp.exp(-c * dmoc.approach_speed)},
    )  # fmt: skip
    return dmoc.Problem(
        kernels, {x: 0, "x_dot": 1}, {x: 0}, sequence=["wall"], final_time=2.5, steps=20
    )


def sliding() -> dmoc.Problem:
    """1 m over a floor with mu (1 - k x)."""
    kernels = rubbing(mu * (1 - k * x))
    return dmoc.Problem(kernels, {x: 0, y: 0, "x_dot": 1}, {x: 1, "x_dot": 1}, steps=20, **SLIDES)


def bouncing() -> dmoc.Problem:
    """Onto the same floor at about 0.6 m."""
    kernels = rubbing(mu * (1 - k * x))
    return dmoc.Problem(
        kernels, {x: 0, y: 0.5, "x_dot": 1}, {x: 1}, sequence=["floor:slip+"], restitution=0.5,
        final_time=0.5, steps=20,
    )  # fmt: skip


def slowing() -> dmoc.Problem:
    """Along a rail that drags with mu (1 - k v) at about 1 m/s."""
    friction = {"rail": mu * (1 - k * dmoc.sliding_speed)}
    kernels = pushed([x], x.diff() ** 2 / 2, {mu: 0.3, k: 0.1}, 4, friction=friction, **ON_RAIL)
    return dmoc.Problem(kernels, {x: 0, "x_dot": 1}, {x: 1, "x_dot": 1}, steps=10, **DRAGS)


def braked() -> dmoc.Problem:
    """Along a rail that drags with mu - k w, w at 1 N where it ends."""
    kernels = pushed(
        [x], x.diff() ** 2 / 2, {mu: 0.3, k: 0.1}, inputs=[u, w], friction={"rail": mu - k * w},
        cost=u**2 + (w - 1) ** 2, **ON_RAIL,
    )  # fmt: skip
    bounds = {"w": (0, 1)}
    return dmoc.Problem(
        kernels, {x: 0, "x_dot": 1}, {x: 1, "x_dot": 1}, steps=20, bounds=bounds, **DRAGS
    )


def eased() -> dmoc.Problem:
    """Along a rail that drags with mu - k w x, w at 1 N: least at the last node."""
    kernels = pushed(
        [x], x.diff() ** 2 / 2, {mu: 0.3, k: 0.1}, inputs=[u, w], cost=u**2 + (w - 1) ** 2,
        friction={"rail": mu - k * w * x}, **ON_RAIL,
    )  # fmt: skip
    return dmoc.Problem(
        kernels, {x: 0, "x_dot": 1}, {x: 1, "x_dot": 1}, steps=20, controls="linear",
        bounds={"w": (0, 1)}, **DRAGS,
    )  # fmt: skip


def breaking() -> dmoc.Problem:
    """Static friction (1 + x^2) mu_s beside the kinetic mu."""
    kernels = pushed(
        [x], x.diff() ** 2 / 2, {mu: 0.3, mu_s: 0.5}, 4, friction={"rail": (mu_s + x**2, mu)},
        **ON_RAIL,
    )  # fmt: skip
    return dmoc.Problem(kernels, {x: 0, "x_dot": 1}, {x: 1, "x_dot": 1}, steps=10, **DRAGS)


def weighed() -> dmoc.Problem:
    """A mass m cos(x), positive where it begins."""
    kernels = pushed([x], m * sp.cos(x) * x.diff() ** 2 / 2, {m: 1.0})
    return dmoc.Problem(kernels, {x: 0}, {x: 1}, final_time=1, steps=20)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stated", "lawful", "lawless"),
    [
        (returning, {"parameters": {"c": 0.5}}, {"parameters": {"c": -1}}),
        (sliding, {"parameters": {"k": 0.9}}, {"parameters": {"k": 1.5}}),
        (sliding, {"parameters": {"mu": 0.2}}, {"parameters": {"mu": -0.1}}),
        (bouncing, {"parameters": {"k": 1.5}}, {"parameters": {"k": 4}}),
        (slowing, {"parameters": {"k": 0.5}}, {"parameters": {"k": 1.5}}),
        (braked, {"parameters": {"k": 0.2}}, {"parameters": {"k": 0.5}}),
        (eased, {"parameters": {"k": 0.295}}, {"parameters": {"k": 0.31}}),
        (breaking, {"parameters": {"mu": 0.4}}, {"parameters": {"mu": 0.7}}),
        (weighed, {"goal": {"x": 1.2}}, {"goal": {"x": 2.0}}),
    ],
)
def test_laws_that_parameters_spoil_are_told_by_a_word(
    stated: Callable[[], dmoc.Problem],
    lawful: dict[str, Any],
    lawless: dict[str, Any],
    tmp_path: Path,
) -> None:
    """What is a law yet has the answer of a solve in Python, which refuses the other one."""
    problem = stated()
    solver = carried(problem, tmp_path)
    solver.set(**lawful)
    own = dmoc.solve(problem.but(**lawful), "ipm", starts=1)
    end = solver.solve()
    assert (end.status, end.cost) == ("solved", approx(own.cost, rel=1e-8))
    solver.set(**lawless)
    end = solver.solve("answer")
    assert end.status == "unphysical"
    assert end.message.startswith("a mass, friction or restitution along the motion is none")
    assert [e.status for e in solver.solve_many([{}, lawful])] == ["unphysical", "solved"]
    try:
        status = dmoc.solve(problem.but(**lawless), "ipm", starts=1).status
    except ProblemError:
        status = "refused"
    assert status in ("not_verified", "infeasible", "refused")


def carried(problem: dmoc.Problem, folder: Path) -> LoadedSolver:
    solution = dmoc.solve(problem, "ipm", starts=1)
    dmoc.generate_solver(problem, folder / "pushed", guess=solution)
    return load_solver(folder / "pushed")


def test_tangential_restitution_that_creates_energy_is_refused(tmp_path: Path) -> None:
    energy = BALL + a.diff() ** 2 / 5
    kernels = pushed(
        [x, y, a], energy, {e_t: 0.5}, surfaces={"floor": y >= 1}, tangents={"floor": x - a},
        tangential_restitution={"floor": e_t},
    )  # fmt: skip
    problem = dmoc.Problem(
        kernels, {x: 0, y: 1.5, a: 0, "x_dot": 1, "y_dot": 0}, {x: 1}, sequence=["floor"],
        restitution=0.8, final_time=0.8, steps=10,
    )  # fmt: skip
    solver = carried(problem, tmp_path)
    for value in (-2, 1.01):
        solver.set(parameters={"e_t": value})
        with pytest.raises(ProblemError, match=r"parameters\.e_t = .* restitution from -1 to 1\."):
            solver.solve("answer")
    solver.set(parameters={"e_t": 1})
    assert solver.solve("answer").status == "solved"


@pytest.fixture
def wall(tmp_path: Path) -> LoadedSolver:
    return carried(returning(), tmp_path)


def test_a_number_that_there_is_not_is_told_once(wall: LoadedSolver) -> None:
    """In C: -1 is what a mistyped name has."""
    count = len(wall.numbers)
    for number in (-1, count, 10**6):
        wall._c.dmoc_solver_set(wall._solver, number, 2.0)
        with pytest.raises(ProblemError, match=r"^expected a number that the problem has\."):
            wall.solve()
        assert wall.solve().status == "solved"
        assert np.isnan(wall._c.dmoc_solver_get(wall._solver, number))
        assert wall._c.dmoc_solver_number(wall._problem, number) is None


def test_an_infeasible_end_stays_one_when_the_next_solve_is_refused(wall: LoadedSolver) -> None:
    end = wall.solve("first", iterations=1)
    assert end.violation > 1e-2
    wall._c.dmoc_solver_set(wall._solver, 0, np.nan)
    with pytest.raises(ProblemError, match="expected a finite number"):
        wall.solve()
    with pytest.raises(ProblemError, match="the last end is no motion"):
        wall.shift(0.1)


def test_a_motion_is_not_shifted_with_parameters_that_were_refused(wall: LoadedSolver) -> None:
    assert wall.solve().status == "solved"
    wall._c.dmoc_solver_set(wall._solver, 0, np.inf)
    with pytest.raises(ProblemError, match="expected a finite number"):
        wall.solve()
    wall.set(parameters={"c": 1})
    wall.shift(0.1)
    assert wall.solve().status == "solved"


def test_a_motion_is_not_shifted_by_masses_that_have_no_velocities(tmp_path: Path) -> None:
    m = sp.Symbol("m")
    system = pushed([x], m * x.diff() ** 2 / 2, {m: 1.0})
    problem = dmoc.Problem(system, {x: 0, "x_dot": 1}, {x: 1}, final_time=2, steps=10)
    solver = carried(problem, tmp_path)
    assert solver.solve().status == "solved"
    solver.set(parameters={"m": 0.0})
    with pytest.raises(ProblemError, match=r"parameters\.m"):
        solver.solve()
    with pytest.raises(ProblemError, match="nothing is left"):
        solver.shift(0.1)
    solver.set(parameters={"m": 1.0})
    assert solver.solve().status == "solved"


@pytest.mark.slow
def test_static_friction_is_no_less_than_kinetic(tmp_path: Path) -> None:
    """Which of two numbers is refused is the one that spoils it, in their order."""
    low, high = sp.symbols("low high")
    sled = dmoc.MechanicalSystem(
        "paired_sled", [x], x.diff() ** 2 / 2, {low: 0.2, high: 0.5}, [u], {x: u},
        tangents={"belt": x}, friction={"belt": (high, low)}, cost=u**2,
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(sled, order=4), {"x": 0, "x_dot": 1}, {"x": 1, "x_dot": 0.5},
        contacts=["belt:slip+"], steps=6, final_time=1.5,
    )  # fmt: skip
    dmoc.generate_solver(problem, tmp_path / "sled")
    solver = load_solver(tmp_path / "sled")
    solver.set(parameters={"low": 0.6, "high": 0.7})
    assert solver.solve().status == "solved"
    for parameters, named in (
        ({"low": 0.6, "high": 0.55}, "low = 0.6"),
        ({"low": 0.2, "high": 0.1}, "high = 0.1"),
        ({"low": -0.1, "high": 0.5}, "low = -0.1"),
    ):
        solver.set(parameters=parameters)
        with pytest.raises(ProblemError, match=f"parameters.{named}: expected friction of 0 or"):
            solver.solve()
