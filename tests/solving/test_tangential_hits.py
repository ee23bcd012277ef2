"""Problems with tangential restitution: hits of programs are those of the simulation and of closed
forms."""

from dataclasses import replace

import numpy as np
import pytest
import sympy as sp
from superballs import (
    FALL,
    GRAVITY,
    HEIGHT,
    LAWS,
    MASS,
    RADIUS,
    THROWS,
    a,
    bounced,
    disc,
    k,
    pushed,
    r,
    rough,
    u,
    x,
    z,
)
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.motion.friction import STICK
from dmoc.program.laws import tangential

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("law", LAWS, ids=str)
def test_a_program_has_the_hit_of_the_simulation(law):
    rough_ball = dmoc.build(rough())
    e, back, friction = law
    for v, w in THROWS:
        problem = dmoc.Problem(
            rough_ball, start={"z": HEIGHT, "x": 0, "a": 0, "x_dot": v, "z_dot": 0, "a_dot": w},
            sequence=["floor"], steps=4, final_time=0.4, restitution=e,
            parameters={"e_t": back, "mu": friction},
        )  # fmt: skip
        solution = dmoc.solve(problem, "ipm", starts=1)
        (hit,) = solution.collisions
        wanted = bounced((v, -FALL, w), e, back, friction)
        np.testing.assert_allclose(hit.momentum_after, MASS @ wanted, atol=1e-8)
        slides = abs(abs(hit.tractions["floor"]) - friction * hit.impulse) < 1e-9
        way = f"slip{'+' if v > RADIUS * w else '-'}" if slides else "stick"
        assert solution.verification.passed and hit.word == f"floor:{way}"


@pytest.mark.parametrize("word", ["stick", "slip-"])
def test_words_of_other_ways_have_no_motion(word):
    rough_ball = dmoc.build(rough())
    problem = dmoc.Problem(
        rough_ball, start={"z": HEIGHT, "x": 0, "a": 0, "x_dot": 5, "z_dot": 0, "a_dot": 0},
        sequence=[f"floor:{word}"], steps=4, final_time=0.4, parameters={"mu": 0.1},
    )  # fmt: skip
    assert dmoc.solve(problem, "ipm", starts=1).status == "infeasible"


def test_a_ball_thrown_under_a_table_comes_back():
    # floor, table, floor: back on its way, where the table turns x' and r w = 5/2 x' round
    h, fall, v = 0.75, -6.0, 3.0
    system = disc(
        surfaces={"floor": z >= r, "table": z <= h - r},
        tangents={"floor": x - r * a, "table": x + r * a},
        tangential_restitution={"floor": 1, "table": 1},
        parameters={r: 0.03, k: 0.4},
    )
    start = {"x": 0, "z": 0.5, "a": 0, "x_dot": v, "z_dot": fall, "a_dot": (-900, 900)}
    problem = dmoc.Problem(
        system, start=start, goal={"x": 0, "z": 0.5}, sequence=["floor", "table", "floor"],
        steps=10, final_time=(0.1, 1),
    )  # fmt: skip
    solution = dmoc.solve(problem, "ipm")
    assert solution.verification.passed
    np.testing.assert_allclose(solution.phases[0].v[0, 2], 5 * v / (26 * 0.03), rtol=1e-9)


@pytest.fixture(scope="module")
def returned():
    """The least push that brings a disc back to where it was thrown from, and its problem."""
    kernels = dmoc.build(pushed(), order=4)
    problem = dmoc.Problem(
        kernels, start={"x": 0, "z": HEIGHT, "a": 0, "x_dot": 1, "z_dot": 0, "a_dot": 0},
        goal={"x": 0}, sequence=["floor"], steps=20, final_time=0.8, restitution=0.9,
        parameters={"e_t": 0.6},
    )  # fmt: skip
    return problem, dmoc.solve(problem, "ipm")


def exact_push(back, inertia=0.5, final_time=0.8):
    """The cost of :func:`returned`: x(T) is linear in the push, which acts on it with a weight."""
    first = np.sqrt(2 * (HEIGHT - RADIUS) / GRAVITY)
    rest, kept = final_time - first, 1 - (1 + back) / (1 + 1 / inertia)
    # of a push at t: it moves x by (first - t) + kept rest before the hit, by T - t after it
    lever, late = kept * rest, rest
    weight = ((first + lever) ** 3 - lever**3) / 3 + late**3 / 3
    return (first + kept * rest) ** 2 / weight


def test_the_least_push_is_that_of_the_closed_form(returned):
    _, solution = returned
    assert solution.verification.passed
    np.testing.assert_allclose(solution.cost, exact_push(0.6), rtol=1e-4)


def test_the_cost_has_a_derivative_by_the_coefficient(returned):
    slopes = dmoc.sensitivities(*returned)
    step = 1e-5
    slope = (exact_push(0.6 + step) - exact_push(0.6 - step)) / (2 * step)
    np.testing.assert_allclose(slopes["parameters"]["e_t"], slope, rtol=1e-4)


def test_a_check_tells_that_the_law_is_not_kept(returned):
    problem, solution = returned
    motion = solution.trajectory
    other = replace(motion, parameters={**motion.parameters, "e_t": 0.4})
    check = dmoc.verify(other, problem.kernels)
    assert not check.passed and "violates its law of tangential restitution" in check.message


def test_files_and_reports_keep_the_law(returned, tmp_path):
    problem, solution = returned
    solution.save(tmp_path / "hit.npz")
    again = dmoc.Solution.load(tmp_path / "hit.npz")
    assert again.trajectory.tangential_restitution == {"floor": 0.6}
    assert dmoc.verify(again.trajectory, problem.kernels).passed
    assert "e_t" in str(problem.summary()) and "tangential" in str(solution)
    run = dmoc.simulate(again, model=problem.kernels, steps=4000)
    assert abs(run.q[-1, 0]) < 1e-3


def test_a_search_hits_by_the_law(returned):
    problem, solution = returned
    for strategy in ("tree", "propose"):
        result = dmoc.search(problem.but(sequence=()), max_collisions=1, strategy=strategy)
        assert result.best is not None
    result = dmoc.search(problem.but(sequence=()), max_collisions=1)
    costs = {node.sequence: node.cost for node in result.nodes}
    np.testing.assert_allclose(costs["floor",], solution.cost, rtol=1e-6)


def test_a_hit_that_costs_more_than_a_touch_becomes_one():
    # down by 1 cm and up again in a second, at rest in between: 2 x 12 d^2/T^3
    w = dynamicsymbols("w")
    system = rough(inputs=[u, w], forces={x: u, z: GRAVITY + w}, cost=u**2 + w**2)
    problem = dmoc.Problem(
        dmoc.build(system, order=4),
        start={"x": 0, "z": 0.11, "a": 0, "x_dot": 1, "z_dot": 0, "a_dot": -10},
        goal={"x": 1, "z": 0.11, "a": -10, "z_dot": 0}, sequence=["floor:slip+"], steps=10,
        final_time=1, restitution=0.5,
    )  # fmt: skip
    solution = dmoc.solve(problem, "ipm")
    assert solution.status == "grazes" and solution.verification.passed
    np.testing.assert_allclose(solution.cost, 24 * 0.01**2 / 0.5**3, rtol=1e-3)
    assert abs(solution.collisions[0].tractions["floor"]) < 1e-9


def test_a_search_finds_how_a_hit_with_friction_goes():
    # the torque on a ball before the hit changes its spin alone, and that its way back
    torque = rough(inputs=[u], forces={a: u}, cost=u**2)
    problem = dmoc.Problem(
        torque, start={"x": 0, "z": HEIGHT, "a": 0, "x_dot": 1}, goal={"x": 0, "z": 0.3}, steps=10,
        final_time=(0.4, 1.5), restitution=0.9, parameters={"e_t": 0.6},
    )  # fmt: skip
    costs = set()
    for strategy in ("tree", "propose"):
        best = dmoc.search(problem, max_collisions=1, strategy=strategy).best
        assert best is not None and best.sequence[0] in (
            "floor:stick",
            "floor:slip-",
            "floor:slip+",
        )
        costs.add(round(best.cost, 6))
    assert len(costs) == 1


def test_kernels_and_derivation_have_the_coefficient():
    from dmoc.inspection.kernel_check import kernel_errors

    errors = {c.kernel: c.error for c in kernel_errors(disc(), dmoc.build(disc()))}
    assert errors["tangential"] == 0 and max(errors.values()) < 1e-10
    summary = str(disc(restitution={"floor": sp.exp(-dmoc.approach_speed)}).summary())
    assert "e_t_floor" in summary and "e_floor" in summary and "mu_floor" not in summary
    derivation = dmoc.derive(disc())
    assert "e_t_floor = e_t" in str(derivation) and "e_{t," in derivation.latex()


def test_a_hit_of_a_heavy_ball_takes_the_law_of_its_speed_too():
    system = disc(restitution={"floor": sp.exp(-dmoc.approach_speed / 5)})
    kernels = dmoc.build(system)
    start = {"x": 0, "z": HEIGHT, "a": 0, "x_dot": 1, "z_dot": 0, "a_dot": 3}
    problem = dmoc.Problem(kernels, start=start, sequence=["floor"], steps=4, final_time=0.4)
    solution = dmoc.solve(problem, "ipm")
    wanted = bounced((1, -FALL, 3), np.exp(-FALL / 5), 1)
    assert solution.verification.passed
    np.testing.assert_allclose(solution.collisions[0].momentum_after, MASS @ wanted, atol=1e-8)


def test_a_landing_keeps_its_law():
    ball = dmoc.build(disc())
    problem = dmoc.Problem(
        ball, start={"x": 0, "z": HEIGHT, "a": 0, "x_dot": 1, "z_dot": 0, "a_dot": 3},
        sequence=["+floor"], steps=5, final_time=0.5,
    )  # fmt: skip
    solution = dmoc.solve(problem, "ipm")
    assert solution.verification.passed
    np.testing.assert_allclose(solution.trajectory.phases[-1].v[-1], [1, 0, 3], atol=1e-9)
    run = dmoc.simulate(
        ball, {"z": HEIGHT}, {"x": 1, "a": 3}, step_size=0.01, steps=50, restitution=0
    )
    np.testing.assert_allclose(run.v[-1], [1, 0, 3], atol=1e-9)


@pytest.mark.parametrize("turned", [1, -1])
def test_what_a_guess_takes_for_a_hit(turned: int) -> None:
    """That of a disc of 1 kg: its impulses and how it ends, as above."""
    A, spin = np.diag([1.0, 3.0]), turned * 2.0
    for coefficient, ends in ((0.9, STICK), (0.1, turned)):
        hit = tangential.returned(np.array([-3.0, spin]), A, coefficient, 0.8, 0.6)
        velocity = bounced([spin, -3.0, 0.0], 0.8, 0.6, coefficient)
        assert hit.impulses == pytest.approx([velocity[1] + 3, velocity[0] - spin])
        assert hit.friction == ends
