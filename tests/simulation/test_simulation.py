"""The variational integrator: known answers, conservation over many impacts, order, and hard
cases."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols
from systems import dropped_ball

import dmoc
from dmoc.base.errors import SimulationError
from dmoc.codegen.kernels import Kernels

T = dynamicsymbols._t


@pytest.fixture(scope="module")
def ball() -> Kernels:
    return dmoc.build(dropped_ball())


@pytest.fixture(scope="module")
def bouncing() -> Kernels:
    return dmoc.load("bouncing_pendulum")


@pytest.mark.slow
def test_elastic_ball_ends_where_it_should(ball: Kernels) -> None:
    """The steps of free flight are exact; the energies of the two parts of a collision step are
    those of their midpoints, O(h^2)."""
    fall = np.sqrt(2 * 0.8 / 9.81)
    for h, tolerance in ((0.01, 1e-3), (0.001, 2e-5), (0.0001, 2e-7)):
        run = dmoc.simulate(ball, [0.8], step_size=h, steps=round(3 / h))
        assert len(run.collisions) == 4
        assert run.q[-1, 0] == pytest.approx(0.538626351, abs=tolerance)
        assert run.p[-1, 0] == pytest.approx(2.264542117, abs=tolerance)
        assert run.collisions[0].time == pytest.approx(fall, abs=1e-10)
        assert [c.time for c in run.collisions] == pytest.approx(
            [fall * (2 * k + 1) for k in range(4)], abs=tolerance
        )


@pytest.mark.slow
def test_three_thousand_bounces_without_energy_drift(bouncing: Kernels) -> None:
    run = dmoc.simulate(bouncing, [0.5], step_size=0.02, steps=154_500, every=103)
    assert len(run.collisions) >= 3_000
    error = run.energy - run.energy[0]
    tenth = len(error) // 10
    drift = error[-tenth:].mean() - error[:tenth].mean()
    assert abs(drift) < 2e-2 * np.abs(error).max()
    speeds = np.array([abs(c.momentum_before[0]) for c in run.collisions])
    assert np.ptp([speeds[:500].mean(), speeds[-500:].mean()]) < 5e-4 * speeds.mean()


def test_tangential_momentum_is_kept_through_collisions(pendulum: Kernels) -> None:
    """Without input the cart-pendulum's p_x is conserved, and the limiters push in alpha alone."""
    run = dmoc.simulate(pendulum, [1.2, 0.0], [0.0, 0.0], step_size=0.002, steps=20_000, every=10)
    assert len(run.collisions) > 20
    assert np.ptp(run.p[:, 1]) < 1e-10
    for c in run.collisions:
        assert 0.1 < c.rate_before == pytest.approx(-c.rate_after, rel=1e-4)
        assert c.momentum_after[1] == pytest.approx(c.momentum_before[1], abs=1e-12)
        assert c.impulse > 0


def test_energy_error_falls_as_the_square_of_the_step(bouncing: Kernels) -> None:
    sizes = [0.02, 0.01, 0.005, 0.0025]
    spread = [
        np.median(np.abs(r.energy - r.energy[0]))
        for r in (dmoc.simulate(bouncing, [0.5], step_size=h, steps=round(40 / h)) for h in sizes)
    ]
    order = np.polyfit(np.log(sizes), np.log(spread), 1)[0]
    assert order > 1.7


def test_positions_converge_to_second_order_between_impacts(bouncing: Kernels) -> None:
    from scipy.integrate import solve_ivp

    exact = solve_ivp(
        lambda t, y: [y[1], -9.81 * np.sin(y[0])], (0, 0.4), [0.5, 0.0], rtol=1e-12, atol=1e-14
    ).y[0, -1]
    errors = [
        abs(dmoc.simulate(bouncing, [0.5], step_size=0.4 / n, steps=n).q[-1, 0] - exact)
        for n in (20, 40, 80)
    ]
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx([2, 2], abs=0.05)


@pytest.mark.slow
def test_several_collisions_in_one_step(block: Kernels) -> None:
    """A mass between walls, so fast that it meets them more than once within a step; free flight
    between elastic walls is exact."""
    x = dynamicsymbols("x")
    m = sp.Symbol("m")
    system = dmoc.MechanicalSystem(
        "slot", [x], m * x.diff(T) ** 2 / 2, {m: 1.0}, surfaces={"low": x >= 0, "high": x <= 1}
    )
    run = dmoc.simulate(dmoc.build(system), [0.3], [7.3], step_size=1.0, steps=3)
    travelled = 0.3 + 7.3 * np.arange(4)
    folded = np.abs((travelled + 1) % 2 - 1)
    np.testing.assert_allclose(run.q[:, 0], folded, atol=1e-10)
    assert len(run.collisions) == int(travelled[-1])
    assert run.energy == pytest.approx(7.3**2 / 2)


@pytest.mark.parametrize("h", [0.2, 1 / 6, 0.11])
def test_a_thin_obstacle_is_not_tunnelled(puck: Kernels, h: float) -> None:
    """Both ends of the step are free, the post is between them: in its middle, or nearer to its
    end."""
    run = dmoc.simulate(
        puck, [0.0, 0.0], [10.0, 0.0], step_size=h, steps=1, parameters={"post": 0.05}
    )
    assert [c.surface for c in run.collisions] == ["post"]
    assert run.collisions[0].position == pytest.approx([0.95, 0.0], abs=1e-9)
    assert run.q[-1, 0] == pytest.approx(0.95 - (10 * h - 0.95), abs=1e-8)


def test_a_grazing_motion_passes(puck: Kernels) -> None:
    """A path that just misses the post has no collision, one that just touches it keeps its
    speed."""
    free = dmoc.simulate(puck, [0.0, 0.2 + 1e-6], [1.0, 0.0], step_size=0.05, steps=40)
    assert not free.collisions
    touching = dmoc.simulate(puck, [0.0, 0.2 - 1e-6], [1.0, 0.0], step_size=0.05, steps=40)
    assert touching.energy == pytest.approx(0.5, abs=1e-9)


@pytest.mark.slow
def test_what_lies_on_a_floor_stays(ball: Kernels) -> None:
    run = dmoc.simulate(ball, [0.0], [0.0], step_size=0.01, steps=10)
    assert not run.collisions and not run.q.any() and not run.p.any()
    assert run.normal == pytest.approx(np.full((11, 1), 9.81))
    assert [(s.name, s.begin, s.end) for s in run.contacts] == [("floor", 0.0, 0.1)]


@pytest.mark.slow
def test_a_start_on_a_surface_but_for_rounding_errors_is_one_on_it() -> None:
    x = dynamicsymbols("x")
    system = dmoc.MechanicalSystem("origin", [x], x.diff() ** 2 / 2, {}, surfaces={"wall": x <= 0})
    for start in (float(np.cos(np.pi / 2)), 1e-15):
        run = dmoc.simulate(system, [start], [1.0], step_size=0.1, steps=10)
        assert run.q[-1, 0] == pytest.approx(-1)
    with pytest.raises(SimulationError, match="lies behind surface 'wall' by 1e-09"):
        dmoc.simulate(system, [1e-9], [1.0], step_size=0.1, steps=10)


@pytest.mark.slow
def test_accumulating_collisions_are_an_error() -> None:
    """Into a wedge whose walls close: more and more collisions within one step."""
    x, y = dynamicsymbols("x y")
    m, a = sp.symbols("m a")
    system = dmoc.MechanicalSystem(
        "wedge", [x, y], m * (x.diff(T) ** 2 + y.diff(T) ** 2) / 2, {m: 1.0, a: 1e-3},
        surfaces={"up": y <= a * x, "down": y >= -a * x},
    )  # fmt: skip
    with pytest.raises(SimulationError, match="Zeno"):
        dmoc.simulate(dmoc.build(system), [1.0, 0.0], [-1.0, 0.01], step_size=2.0, steps=1)


def test_a_system_stands_for_its_kernels(ball: Kernels) -> None:
    runs = [dmoc.simulate(k, [1.0], step_size=0.1, steps=9) for k in (dropped_ball(), ball)]
    np.testing.assert_array_equal(runs[0].q, runs[1].q)


def test_many_steps_of_which_few_are_recorded_need_no_memory(puck: Kernels) -> None:
    """Inputs that are the same in all steps are not copied."""
    run = dmoc.simulate(
        puck, [0.0, -1.0], step_size=1e-4, steps=10_000, every=5_000, inputs=[1.0, 2.0]
    )
    assert run.q.shape == (3, 2) and run.q[-1] == pytest.approx([0.5, 0.0], abs=1e-6)


@pytest.mark.parametrize("backend", ["compiled", "numpy"])
@pytest.mark.parametrize(("start", "time"), [(0.0, r"0\.7\d*"), (1.0, "0"), (2.0, "0")])
def test_a_mass_that_vanishes_on_the_way_is_told(backend: str, start: float, time: str) -> None:
    """(1 - q^2) q'^2 / 2: from q = 0 with the unit velocity q = 1 is reached at pi / 4."""
    q = dynamicsymbols("q")
    system = dmoc.MechanicalSystem(
        "vanishing", [q], (1 - q**2) * q.diff(T) ** 2 / 2, {}, surfaces={"wall": q <= 5}
    )
    kernels = dmoc.build(system, backend=backend)
    with pytest.raises(
        SimulationError, match=f"mass matrix at t = {time} s is singular or not positive definite"
    ):
        dmoc.simulate(kernels, [start], [1.0], step_size=0.01, steps=100)


def test_numpy_kernels_step_the_same(ball: Kernels) -> None:
    numpy = dmoc.build(dropped_ball(), backend="numpy")
    a, b = (dmoc.simulate(k, [0.8], step_size=0.02, steps=50) for k in (ball, numpy))
    np.testing.assert_allclose(a.q, b.q, rtol=1e-12)
    assert len(a.collisions) == len(b.collisions) > 0


@pytest.mark.parametrize("h", [0.25, 0.125, 0.1, 0.02, 0.01, 0.0099, 0.001])
def test_a_collision_exactly_at_a_node_is_a_collision(block: Kernels, h: float) -> None:
    """Unit speed towards a wall at 1: the hit at t = 1 falls on a node for round steps."""
    run = dmoc.simulate(block, {"x": 0.0}, {"x": 1.0}, step_size=h, steps=round(1.5 / h))
    (collision,) = run.collisions
    assert collision.time == pytest.approx(1.0, abs=1e-9) and collision.impulse == pytest.approx(
        2.0
    )
    assert run.q[-1, 0] == pytest.approx(2.0 - run.t[-1], abs=1e-9)


def test_a_motion_that_starts_on_a_surface_outwards_bounces(block: Kernels) -> None:
    run = dmoc.simulate(block, {"x": 1.0}, {"x": 1.0}, step_size=0.1, steps=5)
    assert len(run.collisions) == 1 and run.q[-1, 0] == pytest.approx(0.5)


def test_constant_inputs_of_a_system_with_two(puck: Kernels) -> None:
    """A force of (1, 2) for half a second moves a unit mass by (1, 2)/8; rows in any memory
    order serve."""
    for inputs in ([1.0, 2.0], np.asfortranarray(np.tile([1.0, 2.0], (5, 1)))):
        run = dmoc.simulate(puck, [0.0, -1.0], step_size=0.1, steps=5, inputs=inputs)
        np.testing.assert_allclose(run.q[-1], [0.125, -0.75], atol=1e-12)


def test_what_comes_to_rest_behind_the_last_recorded_node_is_not_recorded() -> None:
    """A ball without restitution lands in step 8 of ten, of which every seventh is recorded."""
    ball = dmoc.build(dropped_ball())
    fields = {"step_size": 0.1, "steps": 10, "restitution": 0.0}
    few, all_of_them = (
        dmoc.simulate(ball, [9.81 * 0.83**2 / 2], every=n, **fields) for n in (7, 1)
    )
    assert few.q == pytest.approx(all_of_them.q[::7]) and few.p == pytest.approx(all_of_them.p[::7])
    assert few.contacts[0].begin == pytest.approx(0.83) and len(few.q) == 2
