"""Contacts that last, friction and constraints at orders 4 and 6, beside SciPy, closed forms and
mechanisms in minimal coordinates."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import compass_gait
import numpy as np
import pytest
import sympy as sp
from answers import answer_of
from contact_problems import (
    PUSHED,
    TURNED,
    against_wall,
    floor,
    pushed,
    pushed_together,
    pushers,
    rail,
    turned,
    wall_with_friction,
)
from joint_problems import double_pendulum, places
from scipy.integrate import solve_ivp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.program.layout import Layout
from dmoc.program.transcription import Transcription

pytestmark = pytest.mark.slow
T = dynamicsymbols._t
G, MU, BEGIN, RATE, TIME = 9.81, 0.25, 1.15 * np.pi, 3.2, 0.35
ORDERS = (4, 6)


def made_again(problem: dmoc.Problem, system: dmoc.MechanicalSystem, order: int) -> dmoc.Problem:
    """A problem with kernels of another order, and their inputs."""
    return replace(problem, kernels=dmoc.build(system, order=order), controls=None)


# A bead that slides in the bowl r = 1 + 0.3 sin a ------------------------------------------------


def bowl(rubs: bool) -> dmoc.MechanicalSystem:
    r, a = dynamicsymbols("r a")
    lagrangian = (r.diff(T) ** 2 + r**2 * a.diff(T) ** 2) / 2 - G * r * sp.sin(a)
    mu = sp.Symbol("mu")
    friction = {"tangents": {"bowl": a}, "friction": {"bowl": mu}, "parameters": {mu: MU}}
    return dmoc.MechanicalSystem(
        "curved", [r, a], lagrangian, surfaces={"bowl": r <= 1 + sp.Rational(3, 10) * sp.sin(a)},
        cost=1, **(friction if rubs else {"parameters": {}}),
    )  # fmt: skip


def slope(rubs: bool, a: float, rate: float) -> tuple[float, float]:
    """a'' and the contact force, from r'' = R' a'' + R'' a'^2 and both equations of motion."""
    r, d, bend = 1 + 0.3 * np.sin(a), 0.3 * np.cos(a), -0.3 * np.sin(a)
    along = d - MU * rubs
    left = [[d, 1.0], [r**2, -along]]
    right = [
        r * rate**2 - G * np.sin(a) - bend * rate**2,
        -2 * r * d * rate**2 - G * r * np.cos(a),
    ]
    acceleration, force = np.linalg.solve(left, right)
    return float(acceleration), float(force)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("rubs", [False, True])
def test_a_slide_along_a_curve_has_its_order(order: int, rubs: bool) -> None:
    """Without friction it ends at 5.262753 with 4.76276497."""
    run = solve_ivp(
        lambda _, y: (y[1], slope(rubs, *y)[0]), (0, TIME), [BEGIN, RATE], method="DOP853",
        rtol=1e-13, atol=1e-13,
    )  # fmt: skip
    end = run.y[:, -1]
    if not rubs:
        np.testing.assert_allclose(end, [5.262753, 4.76276497], atol=1e-8)
    kernels, errors = dmoc.build(bowl(rubs), order=order), []
    radius, rise = 1 + 0.3 * np.sin(BEGIN), 0.3 * np.cos(BEGIN) * RATE
    for steps in (4, 16):
        problem = dmoc.Problem(
            kernels, start={"r": radius, "a": BEGIN, "r_dot": rise, "a_dot": RATE}, steps=steps,
            contacts=["bowl:slip+"] if rubs else ["bowl"], final_time=TIME,
        )  # fmt: skip
        (phase,) = answer_of(problem, "ipm", starts=1).phases
        errors.append(np.abs([phase.q[-1, 1] - end[0], phase.v[-1, 1] - end[1]]))
        held = np.vstack([phase.q, phase.q_inside])
        np.testing.assert_allclose(held[:, 0], 1 + 0.3 * np.sin(held[:, 1]), atol=1e-12)
        np.testing.assert_allclose(
            phase.v[:, 0], 0.3 * np.cos(phase.q[:, 1]) * phase.v[:, 1], atol=1e-9
        )
    assert (np.log2(errors[0] / errors[1]) / 2 > order - 0.2).all()
    assert (errors[1] < {4: 2e-6, 6: 1e-9}[order]).all()
    states = np.stack([phase.q_inside[:, 1], _rates(phase)], axis=1)
    forces = [slope(rubs, *state)[1] for state in states]
    assert phase.normal_inside.shape == (16 * (order // 2 - 1), 1)
    np.testing.assert_allclose(phase.normal_inside[:, 0], forces, rtol=2e-3)


def _rates(phase: dmoc.Phase) -> np.ndarray:
    """Rates of a at the nodes inside steps, from its momentum r^2 a'."""
    return np.asarray(phase.p_inside[:, 1] / phase.q_inside[:, 0] ** 2)


# Known answers ------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", ORDERS)
def test_what_has_no_error_but_that_of_cubics_is_exact(order: int) -> None:
    """Blocks on rails: stick, slide and stick; there and back by a wall; a turn in least time."""
    for problem, cost, most in (
        (pushed(8), PUSHED, 1e-9),
        (against_wall(8, 1.0), 24.5, 1e-9),
        (against_wall(8, 0.5), wall_with_friction(0.5), 1e-8),
        (turned(20), TURNED, 1e-7),
    ):
        name = problem.kernels.name
        system = rail(1 if name == "railed_time" else U**2 / 2, name == "railed_wall", name)
        s = answer_of(made_again(problem, system, order), "ipm", starts=2)
        assert s.cost == pytest.approx(cost, rel=most)
        for phase in s.phases:
            for rows in (phase.tangential, phase.tangential_inside):
                assert (np.abs(rows) <= 1 + 1e-6).all()


U = dynamicsymbols("u")


def test_a_landing_has_order_four() -> None:
    x, s = dynamicsymbols("x s")
    system = dmoc.MechanicalSystem(
        "pushers", [x, s], (x.diff(T) ** 2 + 3 * s.diff(T) ** 2) / 2, {}, inputs=[U], forces={x: U},
        cost=U**2, surfaces={"pad": s >= x},
    )  # fmt: skip
    costs = [answer_of(made_again(pushers(n), system, 4), "ipm").cost for n in (4, 8)]
    assert costs == pytest.approx([pushed_together()] * 2, rel=1e-9)


def test_the_passive_compass_gait_has_its_period() -> None:
    """That of an event-driven integration with 1e-12."""
    problem = compass_gait.problem(10).but(start={"x": 0.0, "a": 0.0}, durations=[(0.05, None)] * 2)
    coarse = answer_of(problem, "ipm", starts=20)
    fine = answer_of(problem.but(steps=40), "ipm", guess=coarse)
    assert fine.cost == pytest.approx(compass_gait.PERIOD, abs=1e-8)
    assert coarse.cost == pytest.approx(compass_gait.PERIOD, abs=3e-6)


def test_a_ladder_leaves_its_wall() -> None:
    """Of length 2 and mass 1, smooth, from rest at 70 degrees to 0.1 rad: 0.80918926 s."""
    x, y, th = dynamicsymbols("x y th")
    rates = x.diff(T) ** 2 + y.diff(T) ** 2 + th.diff(T) ** 2 / 3
    system = dmoc.MechanicalSystem(
        "leaning", [x, y, th], rates / 2 - G * y, {}, cost=1,
        surfaces={"floor": y >= sp.sin(th), "wall": x >= sp.cos(th)},
    )  # fmt: skip
    begin = np.radians(70)
    s = answer_of(
        dmoc.Problem(
            dmoc.build(system, order=4), start={x: np.cos(begin), y: np.sin(begin), th: begin},
            goal={th: 0.1}, contacts=["floor", "wall"], sequence=["-wall"], steps=40,
            final_time=(0.1, 3),
        ),
        "ipm",
    )  # fmt: skip
    assert s.cost == pytest.approx(0.80918926, rel=1e-6)
    leaves = float(np.sin(s.collisions[0].position[2]) / np.sin(begin))
    assert leaves == pytest.approx(2 / 3, rel=3e-3)


@pytest.mark.parametrize("order", ORDERS)
def test_rods_are_their_angles(order: int) -> None:
    by_rods, by_angles = double_pendulum()
    ends = [(0.0, 0.0), (1.0, 0.5)]
    rods = [places(*angles) for angles in ends]
    angles = [dict(zip("ab", pair, strict=True)) for pair in ends]
    differences = []
    for steps in (10, 20):
        costs = [
            answer_of(
                dmoc.Problem(
                    dmoc.build(system, order=order), start=begin, steps=steps, final_time=1.5,
                    goal=end | {f"{name}_dot": 0.0 for name in end},
                ),
                "ipm", starts=1,
            ).cost
            for system, (begin, end) in ((by_rods, rods), (by_angles, angles))
        ]  # fmt: skip
        differences.append(abs(costs[0] / costs[1] - 1))
    assert differences[1] < {4: 3e-5, 6: 3e-8}[order]
    assert np.log2(differences[0] / differences[1]) > order - 0.5


def test_a_guide_that_moves_at_order_four() -> None:
    """On y = sin(3 t)/5 + x/10 the force obeys 1.01 x'' = u - g/10 + 0.18 sin 3 t: the cheapest one
    to x = 1 at rest is linear in the time, with the mean and the moment that the two ends ask
    for."""
    x, y = dynamicsymbols("x y")
    system = dmoc.MechanicalSystem(
        "guided", [x, y], (x.diff(T) ** 2 + y.diff(T) ** 2) / 2 - G * y, {}, [U], {x: U},
        constraints={"guide": sp.Eq(y, sp.sin(3 * T) / 5 + x / 10)}, cost=U**2,
    )  # fmt: skip
    end = 1.3
    s = answer_of(
        dmoc.Problem(
            dmoc.build(system, order=4), start={"x": 0.0, "y": 0.0, "y_dot": 0.6},
            goal={"x": 1.0, "x_dot": 0.0}, final_time=end, steps=20,
        ),
        "ipm", starts=1,
    )  # fmt: skip
    # int (u - d) dt = 0 and int (T - t) (u - d) dt = 1.01, with d = g/10 - 0.18 sin 3 t.
    t = np.linspace(0, end, 20001)
    d = G / 10 - 0.18 * np.sin(3 * t)
    mean, moment = np.trapezoid(d, t), np.trapezoid((end - t) * d, t) + 1.01
    a, b = np.linalg.solve([[end, end**2 / 2], [end**2 / 2, end**3 / 6]], [mean, moment])
    cost = np.trapezoid((a + b * t) ** 2, t)
    assert s.cost == pytest.approx(cost, rel=1e-6)


# The whole way ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def block() -> Kernels:
    return dmoc.build(floor(), order=4)


@pytest.fixture(scope="module")
def slid(block: Kernels) -> dmoc.Solution:
    return answer_of(block_problem(block), "ipm")


def block_problem(kernels: Kernels, steps: int = 6) -> dmoc.Problem:
    """A block of weight 5 on a floor with friction 0.1 is pushed along and comes to rest."""
    return dmoc.Problem(
        kernels, start={"x": 0, "y": 0}, goal={"x": 1, "x_dot": 0}, contacts=["floor:slip+"],
        sequence=["floor:stick"], steps=steps, final_time=2,
    )  # fmt: skip


def test_forces_inside_steps_are_shown_saved_and_carried_on(
    block: Kernels, slid: dmoc.Solution, tmp_path: Path
) -> None:
    weight = slid.trajectory.parameters["m"] * slid.trajectory.parameters["g"]
    for phase in slid.phases:
        for rows in (phase.normal, phase.normal_inside):
            np.testing.assert_allclose(rows, weight, rtol=1e-9)
    between = slid.phases[0].t[0] + 0.3 * slid.phases[0].step_size
    assert slid.at(between)["N_floor"] == pytest.approx(weight)
    again = dmoc.Solution.load(slid.save(tmp_path / "slid.npz"))
    np.testing.assert_array_equal(again.phases[0].normal_inside, slid.phases[0].normal_inside)
    problem = block_problem(block)
    assert answer_of(problem, "ipm", guess=again).iterations <= 1
    finer = answer_of(problem.but(steps=12), "ipm", guess=again)
    lower = answer_of(
        block_problem(dmoc.build(floor())).but(steps=24, controls="linear"), "ipm", guess=again
    )
    back = answer_of(problem, "ipm", guess=lower)
    assert [finer.cost, back.cost] == pytest.approx([slid.cost] * 2, rel=1e-8)
    assert lower.cost == pytest.approx(slid.cost, rel=3e-3)


def test_slsqp_finds_the_same(block: Kernels, slid: dmoc.Solution) -> None:
    assert answer_of(block_problem(block), "slsqp").cost == pytest.approx(slid.cost, rel=1e-6)


def test_wrong_forces_and_places_inside_steps_are_noticed(
    block: Kernels, slid: dmoc.Solution
) -> None:
    phase = slid.phases[0]
    lifted = phase.q_inside.copy()
    lifted[2, 1] += 0.05
    for change, words in (
        ({"normal_inside": 1.2 * phase.normal_inside}, "error of a contact force"),
        ({"q_inside": lifted}, "is off its surface by"),
    ):
        phases = (replace(phase, **change), *slid.phases[1:])
        check = dmoc.verify(replace(slid.trajectory, phases=phases), block)
        assert not check.passed and words in check.message


def test_laws_hold_inside_steps_and_on_both_sides_of_nodes() -> None:
    """A mass on a floor, lifted as much as it may for the least of its squares beside a cost that
    wants more: P >= 0 at all three stations of each step."""
    x, y, lift = dynamicsymbols("x y lift")
    system = dmoc.MechanicalSystem(
        "lifted", [x, y], (x.diff(T) ** 2 + y.diff(T) ** 2) / 2 - G * y, {}, [U, lift],
        {x: U, y: lift}, cost=U**2 + (lift - 12 * sp.sin(5 * T)) ** 2,
        surfaces={"floor": y >= 0, "roof": y <= 1},
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(system, order=4), start={"x": 0, "y": 0}, goal={"x": 1, "x_dot": 0},
        contacts=["floor"], steps=8, final_time=1, ignored=["roof"],
    )  # fmt: skip
    s = answer_of(problem, "ipm", starts=1)
    (phase,) = s.phases
    assert phase.normal_inside.min() >= -1e-8 and phase.u[:, 1].max() <= G + 1e-8
    assert phase.u[:, 1].max() == pytest.approx(G, abs=1e-6)
    laws = Transcription(problem).laws
    assert laws.step.gap_inside.count == 0  # closed, and ignored
    open_roof = Transcription(problem.but(ignored=[])).laws.step
    assert open_roof.gap_inside.count == 8 and open_roof.gap.places[:, 1].tolist() == [1] * 8


@pytest.mark.parametrize("order", ORDERS)
def test_forces_that_are_not_determined_are_shared_inside_steps_too(order: int) -> None:
    """A box lands flat on two rough corners: each bears half of the weight, without friction."""
    x, y, a = dynamicsymbols("x y a")
    mu = sp.Symbol("mu")
    corners = {
        name: (x + s * sp.cos(a) / 2 + 0.3 * sp.sin(a), y + s * sp.sin(a) / 2 - 0.3 * sp.cos(a))
        for name, s in (("left", -1), ("right", 1))
    }
    system = dmoc.MechanicalSystem(
        "landing_box", [x, y, a],
        (x.diff(T) ** 2 + y.diff(T) ** 2 + a.diff(T) ** 2 / 10) / 2 - G * y, {mu: 0.5}, [U], {x: U},
        cost=U**2, surfaces={name: place[1] >= 0 for name, place in corners.items()},
        tangents={name: place[0] for name, place in corners.items()},
        friction={"left": mu, "right": mu},
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(system, order=order), start={"x": 0, "y": 1.3, "a": 0, "y_dot": -1},
        sequence=["+left +right"], steps=5, final_time=2,
    )  # fmt: skip
    phase = answer_of(problem, "ipm", starts=2).phases[1]
    for normal, friction in (
        (phase.normal, phase.tangential), (phase.normal_inside, phase.tangential_inside),
    ):  # fmt: skip
        np.testing.assert_allclose(normal, G / 2, rtol=1e-6)
        np.testing.assert_allclose(friction, 0.0, atol=1e-6)


@pytest.mark.parametrize("order", [2, *ORDERS])
def test_guesses_have_places_on_contacts_and_times(order: int) -> None:
    x, y = dynamicsymbols("x y")
    system = dmoc.MechanicalSystem(
        "lifting_floor", [x, y], (x.diff(T) ** 2 + y.diff(T) ** 2) / 2 - G * y, {}, [U], {x: U},
        cost=U**2, surfaces={"floor": y >= sp.sin(2 * T) / 5 + x**2 / 9},
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(system, order=order), start={"x": 0, "y": 0, "y_dot": 0.4},
        goal={"x": 1, "x_dot": 0}, contacts=["floor"], steps=3, final_time=1.2,
    )  # fmt: skip
    s = answer_of(problem.but(steps=20), "ipm", starts=1)
    lay = Layout.of(problem.but(steps=20))
    q, t = s.unknowns[lay.index_places], s.unknowns[lay.time_places[:, 0]]
    np.testing.assert_allclose(q[:, 1], np.sin(2 * t) / 5 + q[:, 0] ** 2 / 9, atol=1e-9)
    np.testing.assert_allclose(t[lay.scheme.degree :: lay.scheme.degree], 0.06 * np.arange(1, 21))


def test_a_solve_without_steps_begins_with_order_four() -> None:
    for problem in (
        dmoc.Problem(floor(), start={"x": 0, "y": 0}, contacts=["floor"], final_time=1),
        dmoc.Problem(rail(U**2 / 2), start={"x": 0}, final_time=1),
        dmoc.Problem(double_pendulum()[0], start=places(0.0, 0.0), final_time=1),
    ):
        assert problem.order == 4 and problem.held
    assert problem.but(steps=5).order == 4
    assert dmoc.Problem(rail(U**2 / 2), start={"x": 0}, final_time=1, steps=5).order == 2
