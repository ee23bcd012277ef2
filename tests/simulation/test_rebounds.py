"""Restitution that depends on the approach speed."""

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import ModelError, SimulationError

GRAVITY, SOFTENED = 10.0, 2.0  # m/s^2, and the speed at which e is 1/2


def ball(e=None, **parameters):
    """A ball above a floor with e(v) = 1/(1 + v/v0)."""
    z = dynamicsymbols("z")
    m, g, v0 = sp.symbols("m g v0")
    own = {} if e is not None else {v0: SOFTENED}
    return dmoc.MechanicalSystem(
        "softening_ball",
        coordinates=[z],
        lagrangian=m * z.diff() ** 2 / 2 - m * g * z,
        surfaces={"floor": z >= 0},
        restitution={"floor": 1 / (1 + dmoc.approach_speed / v0) if e is None else e},
        parameters={m: 1.0, g: GRAVITY} | own | parameters,
    )


def puck(e):
    """A mass on a line that a force drives against a wall."""
    x, F = dynamicsymbols("x F")
    k = sp.Symbol("k")
    return dmoc.MechanicalSystem(
        "driven_mass",
        coordinates=[x],
        inputs=[F],
        lagrangian=x.diff() ** 2 / 2,
        forces={x: F},
        surfaces={"wall": x <= 1},
        restitution={"wall": e(k)},
        parameters={k: 0.2},
        cost=F**2,
    )


def there_and_back(kernels, **more):
    return dmoc.Problem(
        kernels, start={"x": 0}, goal={"x": 0, "x_dot": 0}, sequence=["wall"], steps=40,
        final_time=1, **more,
    )  # fmt: skip


def test_the_speeds_of_a_bouncing_ball_follow_their_recursion():
    # v+ = v/(1 + v/v0), so that 1/v grows by 1/v0 with each bounce
    drop = 0.8
    run = dmoc.simulate(ball(), {"z": drop}, step_size=0.001, steps=1500)
    speeds = [abs(c.momentum_before[0]) for c in run.collisions][:5]
    first = np.sqrt(2 * GRAVITY * drop)
    expected = 1 / (1 / first + np.arange(len(speeds)) / SOFTENED)
    assert len(speeds) == 5
    np.testing.assert_allclose(speeds, expected, rtol=1e-4)


def exact(e):
    """The least cost from 0 over the wall at 1 to rest at 0 in 1 s: cubics with the speeds v and
    e(v) v at the wall, at the best moment of the hit."""
    from scipy.optimize import minimize

    def cost(z):
        v, T = z
        back = e(v) * v
        # int u^2 of a cubic with ends (0, 0) (1, v) and (1, -back) (0, 0)
        there = 4 * (3 - 3 * v * T + v**2 * T**2) / T**3
        R = 1 - T
        home = 4 * (3 - 3 * back * R + back**2 * R**2) / R**3
        return there + home

    return minimize(cost, [3.0, 0.5], method="Nelder-Mead",
                    options={"xatol": 1e-10, "fatol": 1e-12}).fun  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(
    "law", [lambda v, k: sp.exp(-k * v), lambda v, k: 1 / (1 + k * v**2)], ids=["exp", "square"]
)
def test_a_mass_takes_the_wall_at_the_speed_that_pays(law):
    kernels = dmoc.build(puck(lambda k: law(dmoc.approach_speed, k)), order=4)
    solution = dmoc.solve(there_and_back(kernels), "ipm")
    wanted = exact(lambda v: float(law(v, 0.2)))
    assert solution.verification.passed
    np.testing.assert_allclose(solution.cost, wanted, rtol=1e-5)
    hit = solution.collisions[0]
    e = float(law(hit.rate_before, 0.2))
    np.testing.assert_allclose(-hit.rate_after, e * hit.rate_before, rtol=1e-7)


def test_the_cost_has_a_derivative_by_the_parameter_of_the_law():
    kernels = dmoc.build(puck(lambda k: sp.exp(-k * dmoc.approach_speed)), order=4)
    problem = there_and_back(kernels)
    slopes = dmoc.sensitivities(problem, dmoc.solve(problem, "ipm"))
    step = 1e-4
    costs = [exact(lambda v, k=k: np.exp(-k * v)) for k in (0.2 - step, 0.2 + step)]
    np.testing.assert_allclose(
        slopes["parameters"]["k"], (costs[1] - costs[0]) / (2 * step), rtol=1e-3
    )
    assert slopes["restitution"] == {}


def test_a_number_of_the_problem_replaces_the_law():
    kernels = dmoc.build(puck(lambda k: sp.exp(-k * dmoc.approach_speed)))
    solution = dmoc.solve(there_and_back(kernels, restitution={"wall": 1.0}), "ipm")
    assert abs(solution.cost - 48) < 0.1 and solution.trajectory.restitution == {"wall": 1.0}


def test_files_and_simulations_of_a_solution_keep_the_law(tmp_path):
    kernels = dmoc.build(puck(lambda k: sp.exp(-k * dmoc.approach_speed)), order=4)
    solution = dmoc.solve(there_and_back(kernels), "ipm")
    solution.save(tmp_path / "hit.npz")
    again = dmoc.Solution.load(tmp_path / "hit.npz")
    assert again.trajectory.restitution == {"wall": None}
    assert dmoc.verify(again.trajectory, kernels).passed
    run = dmoc.simulate(again, model=kernels, steps=4000)
    assert abs(run.q[-1, 0]) < 1e-3
    assert "exp(-approach_speed*k)" in str(there_and_back(kernels).summary())


def test_a_law_that_creates_energy_is_refused_where_it_is_met():
    system = ball(e=sp.Rational(3, 2) - dmoc.approach_speed / 10)
    with pytest.raises(SimulationError, match=r"is 1\.1 at an approach of 4 .*creates energy"):
        dmoc.simulate(system, {"z": 0.8}, step_size=0.01, steps=100)


@pytest.mark.parametrize("e", [1.5, -0.1])
def test_a_number_that_creates_energy_is_refused(e):
    with pytest.raises(ModelError, match="expected a number from 0"):
        ball(e=e)


@pytest.mark.slow
def test_a_check_refuses_a_law_that_creates_energy():
    kernels = dmoc.build(puck(lambda k: 2 - k * dmoc.approach_speed), order=4)
    solution = dmoc.solve(there_and_back(kernels), "ipm")
    assert not solution.verification.passed
    assert "creates energy" in str(solution.verification) + solution.message


@pytest.mark.slow
def test_a_mass_hits_a_rough_wall_by_the_law_of_its_speed():
    x, y = dynamicsymbols("x y")
    system = dmoc.MechanicalSystem(
        "rough_hit",
        coordinates=[x, y],
        lagrangian=(x.diff() ** 2 + y.diff() ** 2) / 2,
        surfaces={"wall": x <= 1},
        tangents={"wall": y},
        friction={"wall": 0.1},
        restitution={"wall": sp.exp(-dmoc.approach_speed / 2)},
    )
    kernels = dmoc.build(system)
    start = {"x": 0, "y": 0, "x_dot": 2, "y_dot": 3}
    problem = dmoc.Problem(kernels, start=start, sequence=["wall"], steps=5, final_time=1)
    solution = dmoc.solve(problem, "ipm")
    kept = np.exp(-1.0)
    # slides all along: Newton's law and 0.1 of the normal impulse
    expected = [-2 * kept, 3 - 0.1 * 2 * (1 + kept)]
    assert solution.verification.passed
    np.testing.assert_allclose(solution.trajectory.phases[-1].v[-1], expected, rtol=1e-6)
    run = dmoc.simulate(kernels, {"x": 0, "y": 0}, {"x": 2, "y": 3}, step_size=0.1, steps=10)
    np.testing.assert_allclose(run.v[-1], expected, rtol=1e-6)


def test_hits_at_once_by_a_law_of_their_speeds_are_refused():
    x, y = dynamicsymbols("x y")
    system = dmoc.MechanicalSystem(
        "acute_corner",
        coordinates=[x, y],
        lagrangian=(x.diff() ** 2 + y.diff() ** 2) / 2,
        surfaces={"wall": x <= 1, "slope": x + y <= 1},
        restitution={"wall": sp.exp(-dmoc.approach_speed)},
    )
    start = {"x": 0.5, "y": -0.5}
    with pytest.raises(SimulationError, match=r"several hits at once.*restitution=0\.5"):
        dmoc.simulate(system, start, {"x": 1, "y": 1}, step_size=0.01, steps=100)
    run = dmoc.simulate(system, start, {"x": 1, "y": 1}, step_size=0.01, steps=100, restitution=0.5)
    assert run.collisions


def test_kernels_of_the_law_agree_with_numbers_of_many_digits():
    from dmoc.inspection.kernel_check import kernel_errors

    system = ball()
    errors = {c.kernel: c.error for c in kernel_errors(system, dmoc.build(system))}
    assert {k for k in errors if k.startswith("rebound")} and max(errors.values()) < 1e-10


def test_the_derivation_shows_the_law():
    assert "e_floor" in str(dmoc.derive(ball()))


@pytest.mark.slow
def test_a_search_hits_by_the_law():
    kernels = dmoc.build(puck(lambda k: sp.exp(-k * dmoc.approach_speed)))
    problem = there_and_back(kernels).but(
        sequence=(), goal={"x": 0.0, "x_dot": -1.0}, start={"x": 0.0, "x_dot": 1.0}
    )
    for strategy in ("best-first", "propose"):
        solution = dmoc.search(problem, max_collisions=1, strategy=strategy)
        assert solution.best is not None and solution.best.sequence in ((), ("wall",))


def test_the_speed_of_a_hit_stands_in_the_restitution_alone():
    x = dynamicsymbols("x")
    with pytest.raises(ModelError, match="known in a hit alone"):
        dmoc.MechanicalSystem(
            "one", coordinates=[x], lagrangian=x.diff() ** 2 / 2 - dmoc.approach_speed * x
        )


def test_each_surface_has_its_own_law():
    x, F = dynamicsymbols("x F")
    system = dmoc.MechanicalSystem(
        "two_laws",
        coordinates=[x],
        inputs=[F],
        lagrangian=x.diff() ** 2 / 2,
        forces={x: F},
        surfaces={"right": x <= 1, "left": x >= -1},
        restitution={
            "right": sp.exp(-dmoc.approach_speed / 9),
            "left": 1 / (1 + dmoc.approach_speed / 9),
        },
        cost=F**2,
    )
    problem = dmoc.Problem(
        system, start={x: 0}, goal={x: 0}, sequence=["right", "left"], steps=20, final_time=2
    )
    solution = dmoc.solve(problem, "ipm")
    assert solution.verification.passed
    kept = [-c.rate_after / c.rate_before for c in solution.collisions]
    right, left = (c.rate_before for c in solution.collisions)
    np.testing.assert_allclose(kept, [np.exp(-right / 9), 1 / (1 + left / 9)], rtol=1e-6)
