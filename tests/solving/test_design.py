"""Parameters of the model that the solver chooses: answers in closed form, and what goes with
them."""

from __future__ import annotations

from typing import Any

import compass_gait
import numpy as np
import pytest
import sympy as sp
from scipy.optimize import minimize
from scipy.special import ellipk
from sympy.physics.mechanics import dynamicsymbols
from systems import block_system, landing_problem, landing_system, unit_mass

import dmoc
from dmoc.base.errors import ModelError, ProblemError
from dmoc.guess.random_motions import random_motions
from dmoc.solving.mesh.error import changes
from dmoc.solving.starts import starts_of

pytestmark = pytest.mark.slow

G = 9.81
ORDERS = pytest.mark.parametrize("order", [2, 4])


def wall_problem(order: int = 2, steps: int = 20, **fields: Any) -> dmoc.Problem:
    """The block from rest to the wall and back to rest in a second, where the wall is cheaper the
    further it is.

    Unfolded, it is moved by 2 w at the cost 6 (2 w)^2, so that J = 24 w^2 - 40 w, with its least
    value -50/3 at w = 5/6.
    """
    system = block_system("chosen_wall")
    wall = next(s for s in system.parameters if s.name == "wall")
    kernels = dmoc.build(
        dmoc.MechanicalSystem(
            "chosen_wall", system.coordinates, system.lagrangian, system.parameters, system.inputs,
            system.forces, surfaces=system.surfaces, cost=system.cost, terminal_cost=-40 * wall,
        ),
        order=order,
    )  # fmt: skip
    stated: dict[str, Any] = {"design": {"wall": (0.5, 2)}} | fields
    return dmoc.Problem(
        kernels, start={"x": 0, "x_dot": 0}, goal={"x": 0, "x_dot": 0}, sequence=["wall"],
        steps=steps, final_time=1.0, **stated,
    )  # fmt: skip


@ORDERS
@pytest.mark.parametrize("method", ["ipm", "slsqp"])
def test_the_place_of_a_wall(order: int, method: str) -> None:
    """At order 2 the constant inputs of N steps a phase move the block by (1 - 1/N^2)/12 instead of
    1/12 of their change: both errors are of second order."""
    s = dmoc.solve(wall_problem(order), method, starts=1)
    error = 2e-3 if order == 2 else 1e-7
    assert s.solved
    assert s.design["wall"] == pytest.approx(5 / 6, rel=error)
    assert s.cost == pytest.approx(-50 / 3, rel=error)
    assert s.trajectory.parameters["wall"] == s.design["wall"]
    assert s.collisions[0].position[0] == pytest.approx(s.design["wall"], rel=1e-9)
    assert dmoc.simulate(s).collisions[0].position[0] == pytest.approx(s.design["wall"], rel=1e-9)


@ORDERS
def test_the_stiffness_that_turns_a_mass_round_in_half_a_second(order: int) -> None:
    """Half a period, pi / sqrt(k): k = (2 pi)^2; there are no inputs.  A step of the midpoint rule
    turns by 2 atan(h sqrt(k) / 2), a 40th of half a turn."""
    x, k = dynamicsymbols("x"), sp.Symbol("k")
    system = dmoc.MechanicalSystem("half_period", [x], x.diff() ** 2 / 2 - k * x**2 / 2, {k: 10.0})
    problem = dmoc.Problem(
        dmoc.build(system, order=order), start={"x": 1.0}, goal={"x": -1.0}, steps=40,
        final_time=0.5, design={"k": (20, 60)},
    )  # fmt: skip
    s = dmoc.solve(problem, "ipm")
    assert s.solved
    exact = (160 * np.tan(np.pi / 80)) ** 2 if order == 2 else (2 * np.pi) ** 2
    assert s.design["k"] == pytest.approx(exact, rel=1e-7 if order == 2 else 1e-6)


@pytest.mark.parametrize("order", [2, 4, 6])
@pytest.mark.parametrize("by_rod", [False, True])
def test_the_length_of_a_pendulum_that_swings_down_in_a_given_time(
    order: int, by_rod: bool
) -> None:
    """From rest at 1 rad a quarter of its period is sqrt(l / g) K(sin(1/2)^2), with the complete
    elliptic integral of the first kind; in an angle, and as a mass on a rod."""
    a, x, y = dynamicsymbols("a x y")
    l, T = sp.Symbol("l"), 0.7
    if by_rod:
        system = dmoc.MechanicalSystem(
            "chosen_rod", [x, y], (x.diff() ** 2 + y.diff() ** 2) / 2 - G * y, {l: 1.0},
            constraints={"rod": x**2 + y**2 - l**2},
            quantities={"across": x * sp.cos(1) + y * sp.sin(1)},
        )  # fmt: skip
        ends: dict[str, Any] = {
            "start": {"x": (0.5, 2), "y": (-2, 0), "x_dot": 0, "y_dot": 0, "across": 0.0},
            "goal": {"x": 0.0, "y": (None, 0)},
        }
    else:
        system = dmoc.MechanicalSystem(
            "chosen_length", [a], l**2 * a.diff() ** 2 / 2 + G * l * sp.cos(a), {l: 1.0}
        )
        ends = {"start": {"a": 1.0}, "goal": {"a": 0.0}}
    problem = dmoc.Problem(
        dmoc.build(system, order=order), steps=40, final_time=T, design={"l": (0.5, 5)}, **ends
    )
    s = dmoc.solve(problem, "ipm", starts=1)
    exact = G * (T / ellipk(np.sin(0.5) ** 2)) ** 2
    assert s.solved, s.message
    assert s.design["l"] == pytest.approx(exact, rel=1e-3 if order == 2 else 1e-6)


@ORDERS
def test_the_slope_on_which_a_block_slides_a_metre_in_a_second(order: int) -> None:
    """x = g sin(2 s) t^2 / 4 on a slope s without friction, which it presses with m g cos s; the
    contact lasts."""
    x, y, s = *dynamicsymbols("x y"), sp.Symbol("s")
    m = 2.0
    system = dmoc.MechanicalSystem(
        "chosen_slope", [x, y], m * (x.diff() ** 2 + y.diff() ** 2) / 2 - m * G * y, {s: 0.5},
        surfaces={"slope": y * sp.cos(s) + x * sp.sin(s) >= 0},
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(system, order=order), start={"x": 0, "y": 0}, goal={"x": 1.0}, steps=10,
        contacts=["slope"], final_time=1.0, design={"s": (0.0, 0.7)},
    )  # fmt: skip
    answer = dmoc.solve(problem, "ipm", starts=1)
    exact = np.arcsin(4 / G) / 2
    assert answer.solved, answer.message
    assert answer.design["s"] == pytest.approx(exact, rel=1e-8)
    np.testing.assert_allclose(answer.phases[0].normal, m * G * np.cos(exact), rtol=1e-7)


@ORDERS
def test_a_restitution_that_costs_more_the_better_it_is(order: int) -> None:
    """From rest to a wall a metre away and back to rest within a second: each phase is a cubic,
    whose cost is that of its ends; with e^2 beside it, a function of three numbers is minimised."""
    e = sp.Symbol("e")
    x = dynamicsymbols("x")
    system = unit_mass(
        "chosen_restitution", surfaces={"wall": x <= 1}, restitution={"wall": e},
        parameters={e: 0.5}, cost=dynamicsymbols("u") ** 2 / 2, terminal_cost=30 * e**2,
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(system, order=order), start={"x": 0, "x_dot": 0}, goal={"x": 0, "x_dot": 0},
        sequence=["wall"], steps=40, final_time=1.0, design={"e": (0.1, 0.9)},
    )  # fmt: skip

    def effort(v: float, T: float) -> float:
        return 6 / T**3 - 6 * v / T**2 + 2 * v**2 / T

    def cost(z: np.ndarray) -> float:
        T, v, e = z
        return effort(v, T) + effort(e * v, 1 - T) + 30 * e**2

    sharp = {"xatol": 1e-9, "fatol": 1e-12}
    least = minimize(cost, [0.5, 2.0, 0.5], method="Nelder-Mead", options=sharp)
    s = dmoc.solve(problem, "ipm", starts=1)
    error = 3e-3 if order == 2 else 1e-6
    assert s.solved, s.message
    assert s.design["e"] == pytest.approx(least.x[2], rel=error)
    assert s.cost == pytest.approx(least.fun, rel=error)


def test_sensitivities_are_those_of_whole_solves() -> None:
    """By central differences: of the bound that holds the wall, and of the mass."""
    problem = wall_problem(design={"wall": (0.5, 0.7)})
    s = dmoc.solve(problem, "ipm", starts=1)
    assert list(map(str, s.active_bounds)) == ["wall <= 0.7"]
    change, d = dmoc.sensitivities(problem, s), 1e-4

    def slope(*problems: dmoc.Problem) -> float:
        low, high = (dmoc.solve(p, "ipm", starts=1, optimality=1e-10).cost for p in problems)
        return (high - low) / (2 * d)

    bound = slope(*(problem.but(design={"wall": (0.5, 0.7 + k * d)}) for k in (-1, 1)))
    mass = slope(*(problem.but(parameters={"m": 1 + k * d}) for k in (-1, 1)))
    assert change["bounds"]["wall <="] == pytest.approx(bound, rel=1e-6)
    assert change["bounds"]["wall >="] == 0.0
    assert change["parameters"] == {"m": pytest.approx(mass, rel=1e-6)}


def test_a_design_of_one_number_is_that_parameter() -> None:
    kept = dmoc.solve(wall_problem(design={"wall": 0.9}), "ipm", starts=1)
    plain = dmoc.solve(wall_problem(design={}, parameters={"wall": 0.9}), "ipm", starts=1)
    assert (kept.design, plain.design) == ({"wall": 0.9}, {})
    assert kept.cost == pytest.approx(plain.cost, rel=1e-12)


def test_a_guess_begins_with_the_models_own_value_or_with_what_it_names() -> None:
    assert wall_problem().design_values.tolist() == [1.0]
    assert wall_problem(design={"wall": (2, 4)}).design_values.tolist() == [3.0]
    assert wall_problem(design={"wall": (2, None)}).design_values.tolist() == [2.0]
    for guess in ({"wall": 1.7}, {"wall": 1.7, "x": [0, 1.7, 0]}):
        assert starts_of(wall_problem(), guess).points[0][-1] == 1.7
    with pytest.raises(ProblemError, match=r"guess: wall = 3 lies outside its range 0\.5 to 2"):
        dmoc.solve(wall_problem(), "ipm", guess={"wall": 3})


def test_random_starts_have_designs_of_their_own() -> None:
    problem = wall_problem()
    x = random_motions(problem, [], 1.0, range(8))
    assert len(set(x[:, -1])) == 8
    assert ((x[:, -1] >= 0.5) & (x[:, -1] <= 2)).all()


def test_a_finer_mesh_and_another_order_begin_with_the_design() -> None:
    s = dmoc.solve(wall_problem(), "ipm", starts=1)
    for problem in (wall_problem(steps=30), wall_problem(order=4)):
        assert starts_of(problem, s).points[0][-1] == s.design["wall"]
    refined = dmoc.solve(wall_problem(), "ipm", tolerance=1e-3)
    assert refined.solved
    assert len(refined.meshes) > 1
    assert refined.design["wall"] == pytest.approx(5 / 6, rel=1e-3)


def test_numpy_kernels_choose_too() -> None:
    problem = wall_problem(steps=8)
    kernels = dmoc.build(problem.kernels.system(), backend="numpy")
    s = dmoc.solve(dmoc.Problem(kernels, **_fields(problem)), "slsqp", starts=1)
    compiled = dmoc.solve(problem, "slsqp", starts=1)
    assert s.solved
    assert s.design["wall"] == pytest.approx(compiled.design["wall"], rel=1e-7)


def _fields(problem: dmoc.Problem) -> dict[str, Any]:
    names = "start goal sequence steps final_time design".split()
    return {name: getattr(problem, name) for name in names}


def test_batches_and_searches_have_their_designs(tmp_path: Any) -> None:
    problem = wall_problem()
    ranges = [(0.5, 0.6), (0.5, 2.0)]
    batch = dmoc.sweep(problem, design={"wall": ranges}, method="ipm", keep=True)
    assert batch.varied["design wall"].tolist() == [0.6, 2.0]
    assert batch.design["wall"].tolist() == [s.design["wall"] for s in batch.solutions]
    assert dmoc.Batch.load(batch.save(tmp_path / "b.npz")).columns() == batch.columns()
    assert "chosen wall" in batch.columns() and "chosen wall" in batch.summary().head
    assert [s.design["wall"] for s in batch.solutions] == pytest.approx([0.6, 5 / 6], rel=2e-3)
    result = dmoc.search(problem.but(sequence=[]), max_collisions=1, method="ipm")
    by_word = {node.sequence: node.solution for node in result.nodes if node.solution}
    # Nothing keeps a wall from being as far as it may that nothing hits.
    assert by_word[()].design["wall"] == pytest.approx(2.0, rel=1e-6)
    assert by_word[("wall",)].design["wall"] == pytest.approx(5 / 6, rel=2e-3)


def test_files_tables_and_reports_have_the_design(tmp_path: Any) -> None:
    s = dmoc.solve(wall_problem(), "ipm", starts=1)
    back = dmoc.Solution.load(s.save(tmp_path / "wall.npz"))
    assert back.design == s.design == s.to_dict()["design"]
    assert ("design", f"wall = {s.design['wall']:.6g}") in s.summary().rows
    assert f"wall = {s.design['wall']:.6g}" in s.report(tmp_path / "wall.html").read_text()
    assert "wall: 0.5 to 2" in str(dict(wall_problem().summary().rows)["design"])
    assert s.verify(wall_problem(design={}).kernels).passed  # those of another build


def test_what_is_not_determined_is_named() -> None:
    """Two springs beside each other, of which the motion knows the sum."""
    x, k, c = dynamicsymbols("x"), *sp.symbols("k c")
    system = dmoc.MechanicalSystem(
        "two_springs", [x], x.diff() ** 2 / 2 - (k + c) * x**2 / 2, {k: 20.0, c: 20.0}
    )
    problem = dmoc.Problem(
        system, start={"x": 1.0}, goal={"x": -1.0}, steps=20, final_time=0.5,
        design={"k": (0, 50), "c": (0, 50)},
    )  # fmt: skip
    s = dmoc.solve(problem, "ipm", starts=1)
    assert s.solved
    assert sum(s.design.values()) == pytest.approx((80 * np.tan(np.pi / 40)) ** 2, rel=1e-5)
    assert "does not determine k and c" in s.message


def test_the_error_of_a_mesh_is_that_of_the_design_too() -> None:
    """Half a period without a price: the cost is 0 on every mesh, the stiffness is not the same."""
    x, k = dynamicsymbols("x"), sp.Symbol("k")
    system = dmoc.MechanicalSystem("half_swing", [x], x.diff() ** 2 / 2 - k * x**2 / 2, {k: 10.0})
    problem = dmoc.Problem(
        dmoc.build(system), start={"x": 1.0}, goal={"x": -1.0}, steps=8, final_time=0.5,
        design={"k": (20, 60)},
    )  # fmt: skip
    s = dmoc.solve(problem, "ipm", tolerance=1e-3, starts=1)
    assert s.solved
    assert s.design["k"] == pytest.approx((2 * np.pi) ** 2, rel=2e-3)
    coarse, fine = (dmoc.solve(problem.but(steps=n), "ipm", starts=1) for n in (20, 40))
    changed = abs(fine.design["k"] - coarse.design["k"]) / fine.scale["k"]
    assert changes(coarse, fine).motion >= changed > 1e-3


def test_a_derivation_lists_the_kernels() -> None:
    *_, last = dmoc.derive(block_system(), design=["wall"]).sections
    assert last.title == "Design parameters"
    assert last.text.endswith("are by that, too: surface, gap_work.")
    assert dmoc.derive(block_system()).sections[-1].title != "Design parameters"
    with pytest.raises(
        ModelError, match="unknown parameter 'u' in design: expected one of m, wall"
    ):
        dmoc.derive(block_system(), design=["u"])


def test_the_slope_on_which_a_passive_walker_has_a_given_period() -> None:
    """The compass gait of Goswami, Thuilot and Espiau: 3 degrees have the period 0.734346391 s, by
    event-driven integration to 1e-12 (docs/known_answers.md); at order 4 the period is right to
    1e-7."""
    gait = dmoc.solve(compass_gait.problem(), "ipm", starts=8)
    problem = compass_gait.problem().but(design={"slope": (0.01, 0.1)}, final_time=0.734346391)
    s = dmoc.solve(problem, "ipm", guess=gait)
    assert s.solved
    assert s.design["slope"] == pytest.approx(np.radians(3), rel=1e-5)


def test_the_stiffest_spring_is_the_soonest_at_order_6() -> None:
    """Against the spring k <= 4 with a force of 1 at most: x = (5 cos(2 t) - 1) / 4 is -1 at
    t = (pi - acos(3/5)) / 2."""
    x, u, k = *dynamicsymbols("x u"), sp.Symbol("k")
    system = dmoc.MechanicalSystem(
        "launched", [x], x.diff() ** 2 / 2 - k * x**2 / 2, {k: 1.0}, [u], {x: u},
        objective=dmoc.final_time,
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(system, order=6), start={"x": 1.0}, goal={"x": -1.0}, steps=8,
        bounds={"u": (-1, 1)}, final_time=(0.1, 10), design={"k": (0.1, 4)},
    )  # fmt: skip
    s = dmoc.solve(problem, "ipm", starts=1)
    assert s.solved
    assert "k <= 4" in map(str, s.active_bounds)
    assert s.final_time == pytest.approx((np.pi - np.arccos(0.6)) / 2, rel=1e-6)


@ORDERS
def test_the_friction_of_a_rail_that_is_cheap_to_hold(order: int) -> None:
    """A block is pushed by 1 m in 4 s with the least int u^2 / 2, which is (2/3) sqrt(6 f^3) with
    the friction f of its rail; with -2 f beside it, f = 2/3 and -4/9 are best."""
    x, u, f = *dynamicsymbols("x u"), sp.Symbol("f")
    system = unit_mass(
        "chosen_rail", parameters={f: 1.0}, tangents={"rail": x}, friction={"rail": f},
        cost=u**2 / 2, terminal_cost=-2 * f,
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(system, order=order), start={"x": 0}, goal={"x": 1, "x_dot": 0},
        sequence=["rail:slip+", "rail:stick"], steps=20, final_time=4, design={"f": (0.2, 2)},
    )  # fmt: skip
    s = dmoc.solve(problem, "ipm", starts=10)
    assert s.solved, s.message
    assert s.design["f"] == pytest.approx(2 / 3, rel=5e-3 if order == 2 else 1e-4)
    assert s.cost == pytest.approx(-4 / 9, rel=5e-3 if order == 2 else 1e-4)
    assert s.trajectory.friction["rail"] == pytest.approx(s.design["f"], rel=1e-12)
    plain = dmoc.build(system, order=order)
    assert s.verify(plain).passed
    change = dmoc.sensitivities(problem, s)["bounds"]
    assert change["f <="] == pytest.approx(0, abs=1e-6)


@ORDERS
def test_the_friction_on_which_a_puck_that_has_landed_stops_at_a_place(order: int) -> None:
    """It lands after 0.2 s and 0.2 m with 2 N s, which leave (1 - 2 mu) m/s, and slides 0.3 m with
    10 mu m/s^2: (1 - 2 mu)^2 = 6 mu."""
    stated = landing_problem(20)
    problem = dmoc.Problem(
        dmoc.build(landing_system(), order=order), start=stated.start, goal=stated.goal,
        sequence=stated.sequence, steps=20, final_time=1.5, design={"mu": (0.0, 0.5)},
    )  # fmt: skip
    s = dmoc.solve(problem, "ipm", starts=6)
    assert s.solved, s.message
    assert s.design["mu"] == pytest.approx((10 - np.sqrt(84)) / 8, rel=1e-7)
