"""Parameters with a value for each phase: springs, stages, gears and hits with closed forms."""

from __future__ import annotations

from dataclasses import replace
from math import acos, asin, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import DmocError
from dmoc.codegen.kernels import Kernels
from dmoc.guess.automatic import initial_guesses
from dmoc.program.layout import Layout

X, U = dynamicsymbols("x u")
V = X.diff()
M, K, C, D = sp.symbols("m k c d")
HALF = sp.Rational(1, 2)


def built(name: str, parameters: dict[Any, float], order: int = 4, **more: Any) -> Kernels:
    lagrangian = more.pop("lagrangian", M * V**2 / 2)
    return dmoc.build(dmoc.MechanicalSystem(name, [X], lagrangian, parameters, **more), order=order)


# A spring that another one joins at a place ------------------------------------------------------

# From rest at 1 by k = 10 to 1/2, and with k = 50 on to 0, where m = 2 then.
T1 = acos(0.5) / sqrt(10)
BEFORE = sqrt(10 * (1 - 0.25))


def after(k: float, m: float) -> tuple[float, float]:
    """Time from 1/2 to 0, where the velocity is that of the first spring, and the speed there."""
    rate = sqrt(k / m)
    return float(np.arctan2(0.5 * rate, BEFORE) / rate), sqrt(BEFORE**2 + k / m / 4)


@pytest.fixture(scope="module")
def spring() -> dmoc.Problem:
    model = built(
        "joined", {M: 1, K: 10}, lagrangian=M * V**2 / 2 - K * X**2 / 2, switches={"gate": HALF - X}
    )
    return dmoc.Problem(model, {X: 1}, {X: 0}, ["gate"], steps=10, parameters={K: [10, 50]})


@pytest.fixture(scope="module")
def sprung(spring: dmoc.Problem) -> dmoc.Solution:
    return dmoc.solve(spring, "ipm", starts=1)


def test_a_stiffness_changes_where_a_mass_passes(
    spring: dmoc.Problem, sprung: dmoc.Solution, tmp_path: Path
) -> None:
    time, speed = after(50, 1)
    first, second = sprung.phases
    assert sprung.solved and sprung.verification.passed
    assert asin(0.5 / sqrt(0.4)) / sqrt(50) == pytest.approx(time)
    assert first.duration == pytest.approx(T1, rel=1e-6)
    assert second.duration == pytest.approx(time, rel=1e-6)
    assert second.v[-1, 0] == pytest.approx(-speed, rel=1e-6)
    assert sprung.trajectory.parameters == {"m": 1.0, "k": (10.0, 50.0)}
    assert "k = 10, then 50" in sprung.report(tmp_path / "report.html").read_text()
    assert "k = 10, then 50" in str(spring.summary())


def test_what_joins_a_mass_has_its_velocity(spring: dmoc.Problem) -> None:
    """The momentum doubles at the gate, as the mass does, without an impulse."""
    solution = dmoc.solve(spring.but(parameters={K: [10, 50], M: [1, 2]}), "ipm", starts=1)
    time, speed = after(50, 2)
    (event,), (_, second) = solution.collisions, solution.phases
    assert solution.verification.passed and event.impulse == 0
    assert event.momentum_before[0] == pytest.approx(-BEFORE, rel=1e-6)
    assert event.momentum_after[0] == pytest.approx(-2 * BEFORE, rel=1e-6)
    assert (second.duration, -second.v[-1, 0]) == pytest.approx((time, speed), rel=1e-6)


def test_a_simulation_takes_the_values_of_its_phases(spring: dmoc.Problem) -> None:
    """The last value goes on; energies are those of the phases, with and without the second
    spring and mass."""
    values = {"k": [10, 50], "m": [1, 2]}
    motion = dmoc.simulate(spring.kernels, {"x": 1}, step_size=0.01, steps=60, parameters=values)
    late = motion.t > T1
    rate = sqrt(25)
    way = 0.5 * np.cos(rate * (motion.t - T1)) - BEFORE / rate * np.sin(rate * (motion.t - T1))
    (event,) = motion.collisions
    assert (event.switch, event.time) == ("gate", pytest.approx(T1, rel=1e-12))
    np.testing.assert_allclose(motion.q[late, 0], way[late], atol=1e-10)
    np.testing.assert_allclose(motion.energy[late], BEFORE**2 + 50 / 8, rtol=1e-10)
    np.testing.assert_allclose(motion.energy[~late], 5, rtol=1e-10)
    assert motion.trajectory.parameters == {"m": (1.0, 2.0), "k": (10.0, 50.0)}


def test_a_solution_is_simulated_with_its_values(sprung: dmoc.Solution) -> None:
    motion = dmoc.simulate(sprung)
    assert motion.q[-1, 0] == pytest.approx(0, abs=1e-6)
    assert motion.trajectory.parameters == sprung.trajectory.parameters


@pytest.mark.parametrize("values", [(50.0, 10.0), (10.0, 60.0), 10.0, 50.0])
def test_a_motion_with_other_values_is_no_motion(
    sprung: dmoc.Solution, values: float | tuple[float, float]
) -> None:
    motion = replace(sprung.trajectory, parameters={"m": 1.0, "k": values})
    assert not dmoc.verify(motion, sprung.kernels).passed


def test_values_of_phases_are_kept_in_files(sprung: dmoc.Solution, tmp_path: Path) -> None:
    sprung.save(tmp_path / "sprung.npz")
    again = dmoc.Solution.load(tmp_path / "sprung.npz")
    assert again.trajectory.parameters == sprung.trajectory.parameters
    wrong = replace(sprung.trajectory, parameters={"m": 1.0, "k": (1.0, 2.0, 3.0)})
    replace(sprung, trajectory=wrong).save(tmp_path / "wrong.npz")
    with pytest.raises(DmocError, match="parameter k has 3 values for 2 phases"):
        dmoc.Solution.load(tmp_path / "wrong.npz")


# A rocket that drops its first stage -------------------------------------------------------------


def test_a_stage_takes_its_momentum_away() -> None:
    """A push F brings m1 over the way d, and from there m2: T^2 = 2 d m1/F at the drop, then the
    speeds v1 and v2 with v2^2 = v1^2 + 2 F d/m2. The price of each mass is the slope of that."""
    force, first, second, d = 2.0, 3.0, 1.0, 4.0
    rocket = built(
        "stages", {M: first}, inputs=[U], forces={X: U}, switches={"drop": X - d}, cost=1
    )
    problem = dmoc.Problem(
        rocket, {X: 0}, {X: 2 * d}, ["drop"], steps=4, bounds={U: (0, force)},
        parameters={M: [first, second]},
    )  # fmt: skip

    def time(m1: float, m2: float) -> float:
        v1 = sqrt(2 * force * d / m1)
        return sqrt(2 * d * m1 / force) + m2 / force * (sqrt(v1**2 + 2 * force * d / m2) - v1)

    solution = dmoc.solve(problem, "ipm", starts=1)
    (event,), speed = solution.collisions, sqrt(2 * force * d / first)
    assert solution.verification.passed
    assert solution.cost == pytest.approx(time(first, second), rel=1e-6)
    assert event.momentum_before[0] == pytest.approx(first * speed, rel=1e-6)
    assert event.momentum_after[0] == pytest.approx(second * speed, rel=1e-6)
    slopes = [
        (time(first + h, second + k) - time(first - h, second - k)) / 2e-5
        for h, k in ((1e-5, 0), (0, 1e-5))
    ]
    prices = dmoc.sensitivities(problem, solution)["parameters"]["m"]
    assert prices == pytest.approx(slopes, rel=1e-5)


def test_first_motions_have_the_inputs_of_their_phases() -> None:
    """A heavier mass on the same way takes as many times the force."""
    moved = built("moved", {M: 1}, 2, inputs=[U], forces={X: U}, switches={"gate": X - 1})
    alike = dmoc.Problem(moved, {X: 0}, {X: 2, V: 0}, ["gate"], steps=5, final_time=2)
    other = alike.but(parameters={M: [1, 3]})
    lay = Layout.of(alike)
    for before, after in zip(initial_guesses(alike), initial_guesses(other), strict=True):
        u, v = (g.x[lay.index_u] for g in (before, after))
        np.testing.assert_allclose(v, u * np.repeat([1, 3], 5)[:, None], rtol=1e-9, atol=1e-12)


# A car with a turbo ------------------------------------------------------------------------------


def test_a_car_with_a_turbo_takes_forty_thirds() -> None:
    """CARTIM of NOSBENCH: |u| <= 5, three times as strong above 10 m/s, at most 20 m/s, over 200 m
    from rest to rest. It takes 2 s to 10 m/s and 2/3 s to 20 m/s, on ways of 10 m each, and as much
    back; 160 m at 20 m/s take 8 s."""
    car = built(
        "car", {M: 1, C: 1}, inputs=[U], forces={X: C * U}, cost=1,
        switches={"on": V - 10, "off": 10 - V},
    )  # fmt: skip
    problem = dmoc.Problem(
        car, {X: 0}, {X: 200, V: 0}, ["on", "off"], bounds={U: (-5, 5), "x_dot": (None, 20)},
        parameters={C: [1, 3, 1]},
    )  # fmt: skip
    solution = dmoc.solve(problem, "ipm", starts=1)
    assert solution.verification.passed
    assert solution.cost == pytest.approx(40 / 3, rel=1e-5)
    assert [p.duration for p in solution.phases] == pytest.approx([2, 28 / 3, 2], rel=1e-5)


# Friction -----------------------------------------------------------------------------------------

Y, A = dynamicsymbols("y a")
MU, J, E = sp.symbols("mu j e")


@pytest.mark.parametrize("order", [2, 4])
def test_a_block_slides_from_asphalt_onto_ice(order: int) -> None:
    """With 3 m/s over half a metre with mu = 0.5, and to rest with mu = 0.1: 0.2 s and 2 s. Three
    times the mass on the ice has three times the friction."""
    lagrangian = M * (V**2 + Y.diff() ** 2) / 2 - 10 * M * Y
    floor = {"surfaces": {"floor": Y >= 0}, "tangents": {"floor": X}, "friction": {"floor": MU}}
    system = dmoc.MechanicalSystem(
        "slide", [X, Y], lagrangian, {M: 1, MU: 0.5}, switches={"ice": X - HALF}, **floor
    )
    values = {"mu": [0.5, 0.1], "m": [1, 3]}
    problem = dmoc.Problem(
        dmoc.build(system, order=order), {X: 0, Y: 0, V: 3}, {V: 0}, ["ice"], steps=4,
        contacts=["floor:slip+"], parameters=values,
    )  # fmt: skip
    solution = dmoc.solve(problem, "ipm", starts=1)
    asphalt, ice = solution.phases
    assert solution.verification.passed
    assert (asphalt.duration, ice.duration) == pytest.approx((0.2, 2), rel=1e-9)
    assert ice.q[-1, 0] == pytest.approx(2.5, rel=1e-9)
    assert asphalt.tangential[0, 0] == pytest.approx(-5, rel=1e-9)
    assert ice.tangential[0, 0] == pytest.approx(-3, rel=1e-9)
    assert solution.trajectory.friction == {"floor": None}
    assert solution.trajectory.friction_limits(ice)[0, 0] == pytest.approx(3, rel=1e-9)
    motion = dmoc.simulate(
        problem.kernels, {"x": 0, "y": 0}, {"x": 3}, step_size=0.05, steps=50, parameters=values
    )
    times = [c.time for c in motion.trajectory.collisions]
    assert times == pytest.approx([0.2, 2.2], rel=1e-9)
    assert motion.q[-1, 0] == pytest.approx(2.5, rel=1e-9)
    with pytest.raises(DmocError, match="the friction of 'floor' is zero in some phases"):
        problem.but(parameters={MU: [0.5, 0]})
    with pytest.raises(DmocError, match="the friction of 'floor' is -1 in phase 1"):
        problem.but(parameters={MU: [0.5, -1]})


@pytest.mark.parametrize("laws", [{}, {"floor": "stronge"}])
def test_hits_with_friction_have_the_laws_of_their_phase(laws: dict[str, str]) -> None:
    """A ball that slides in both hits: the rates of the gap turn by e, and the traction is mu of
    the impulse, which is (1 + e) m times the rate before."""
    system = dmoc.MechanicalSystem(
        "ball", [X, Y, A], M * (V**2 + Y.diff() ** 2) / 2 + J * A.diff() ** 2 / 2 - 10 * M * Y,
        {M: 1, J: 0.4, MU: 0.02, E: 0.9}, surfaces={"floor": Y >= 0}, tangents={"floor": X + A},
        friction={"floor": MU}, restitution={"floor": E}, impact_laws=laws,
    )  # fmt: skip
    values = {"mu": [0.02, 0.01, 0.3], "e": [0.9, 0.5, 0.3], "m": [1, 2, 1]}
    first, second = sqrt(20), 0.9 * sqrt(20)
    problem = dmoc.Problem(
        system, {X: 0, Y: 1, A: 0, "x_dot": 1}, {}, ["floor:slip+"] * 2, steps=6, final_time=1.5,
        parameters=values,
    )  # fmt: skip
    solution = dmoc.solve(problem, "ipm", starts=1)
    motion = dmoc.simulate(
        problem.kernels, {"y": 1}, {"x": 1}, step_size=0.05, steps=30, parameters=values
    )
    assert solution.verification.passed
    for events in (solution.collisions, motion.trajectory.collisions):
        for c, rate, e, m, mu in zip(
            events, (first, second), values["e"], values["m"], values["mu"], strict=False
        ):
            assert (c.rate_before, c.rate_after) == pytest.approx((rate, -e * rate), rel=1e-8)
            assert c.impulse == pytest.approx((1 + e) * m * rate, rel=1e-8)
            assert c.tractions["floor"] == pytest.approx(-mu * c.impulse, rel=1e-8)


# Hits ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", [2, 4])
def test_a_hit_has_the_values_of_the_phase_that_it_ends(order: int) -> None:
    """With e = 1/2 a mass of 2 comes back from a wall at half its speed, with an impulse of 3, each
    of which does the harm 2; then it has a mass of 5, and would do more."""
    harm = {"harm": C * dmoc.impulse("wall")}
    ball = built("ball", {M: 2, C: 1}, order, surfaces={"wall": X <= 1}, integrals=harm)
    problem = dmoc.Problem(
        ball, {X: 0, V: 1}, {X: 0, "harm": (None, 10)}, ["wall"], steps=3, restitution=0.5,
        parameters={M: (2, 5), C: [2, 9]},
    )  # fmt: skip
    solution = dmoc.solve(problem, "ipm", starts=1)
    (event,), (first, second) = solution.collisions, solution.phases
    assert solution.verification.passed
    assert event.impulse == pytest.approx(3, rel=1e-9)
    assert solution.trajectory.totals["harm"] == pytest.approx(6, rel=1e-9)
    assert (first.duration, second.duration) == pytest.approx((1, 2), rel=1e-9)
    assert second.v[0, 0] == pytest.approx(-0.5, rel=1e-9)
    assert event.momentum_after[0] == pytest.approx(-2.5, rel=1e-9)
    values = {"m": [2, 5]}
    flown = dmoc.simulate(
        ball, {"x": 0}, {"x": 1}, step_size=0.3, steps=8, restitution=0.5, parameters=values
    )
    (hit,) = flown.trajectory.collisions
    assert (hit.impulse, hit.momentum_after[0]) == pytest.approx((3, -2.5), rel=1e-9)
    assert flown.q[-1, 0] == pytest.approx(1 - 0.5 * 1.4, rel=1e-9)


def test_gravity_changes_from_bounce_to_bounce() -> None:
    """Dropped from 1 with g = 10, a ball rises to 20/(2 * 5) = 2 with g = 5, and falls with it
    for ever."""
    ball = built("moon", {C: 10}, 2, lagrangian=V**2 / 2 - C * X, surfaces={"floor": X >= 0})
    fall, rise = sqrt(0.2), sqrt(20) / 5
    motion = dmoc.simulate(ball, {"x": 1}, step_size=rise / 10, steps=33, parameters={"c": [10, 5]})
    times = [c.time for c in motion.collisions]
    assert times == pytest.approx([fall, fall + 2 * rise], rel=1e-9)
    assert dmoc.verify(motion.trajectory, ball).passed
    assert dmoc.simulate(
        ball, {"x": 1}, step_size=fall + rise, steps=1, parameters={"c": [10, 5]}
    ).q[-1, 0] == pytest.approx(2, rel=1e-9)


def test_integrals_and_limits_take_the_values_of_their_phases() -> None:
    """A unit mass with the price c u^2 from rest to a gate at 1, which it passes at 1 s with the
    speed v, and on to rest at 2 at 2 s: cubics cost 12 - 12 v + 4 v^2 in each phase, which is the
    least, 3, at v = 3/2. A limit 6 d of the force is kept in the phase where it holds."""
    system = built(
        "priced", {M: 1, C: 1, D: 1}, inputs=[U], forces={X: U}, cost=C * U**2,
        integrals={"effort": D * U**2}, switches={"gate": X - 1},
        path_constraints={"strong": U <= 6 * D},
    )  # fmt: skip
    problem = dmoc.Problem(
        system, {X: 0}, {X: 2, V: 0}, ["gate"], steps=10, durations=[1, 1],
        parameters={C: [1, 2], D: [1, 0.7]},
    )  # fmt: skip
    solution = dmoc.solve(problem, "ipm", starts=1)
    assert solution.verification.passed
    assert solution.cost == pytest.approx(3 + 2 * 3, rel=1e-9)
    assert solution.trajectory.totals["effort"] == pytest.approx(3 * 1.7, rel=1e-9)
    free = dmoc.solve(problem.but(parameters={C: [1, 2], D: [0.4, 1]}), "ipm", starts=1)
    pushes = [p.u.max() for p in free.phases]
    assert pushes[0] == pytest.approx(2.4, rel=1e-6) and free.cost > 9.01


# What is refused ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({K: [10, 50, 60]}, "for each of the 2 phases, not 3"),
        ({K: [10, np.nan]}, "parameter k = nan: expected a finite number"),
        ({K: [10, "much"]}, "parameter k = 'much': expected a number"),
        ({K: [[10, 20], [50, 60]]}, r"parameter k = \[10, 20\]: expected a number"),
        ({"stiffness": [10, 50]}, "unknown parameter 'stiffness'"),
        ({M: [1, -1]}, r"in phase 1 \(m=-1\): expected positive masses"),
    ],
)
def test_wrong_values_of_phases_are_refused(
    spring: dmoc.Problem, values: dict[Any, Any], words: str
) -> None:
    with pytest.raises(DmocError, match=words):
        spring.but(parameters=values)


def test_one_phase_has_one_value(spring: dmoc.Problem) -> None:
    with pytest.raises(DmocError, match=r"\[10, 50\]: expected a number, as there is one phase"):
        spring.but(sequence=[])
    with pytest.raises(DmocError, match=r"k = \[\]: expected a number, as there is one phase"):
        dmoc.simulate(spring.kernels, {"x": 1}, step_size=0.1, steps=1, parameters={"k": []})


def test_places_are_those_of_all_phases() -> None:
    walled = built("walled", {M: 1, D: 1}, 2, surfaces={"wall": X <= D})
    with pytest.raises(DmocError, match=r"parameter d has a value .* part of the gaps to surfaces"):
        dmoc.Problem(walled, {X: 0, V: 1}, {}, ["wall"], parameters={D: [1, 2]})
    with pytest.raises(DmocError, match=r"parameter d has a value .* part of the gaps to surfaces"):
        dmoc.simulate(walled, {"x": 0}, step_size=0.1, steps=2, parameters={"d": [1, 2]})


def test_what_takes_one_value_refuses_several(
    spring: dmoc.Problem, sprung: dmoc.Solution, tmp_path: Path
) -> None:
    walled = dmoc.Problem(
        built("held", {M: 1, K: 1}, 2, lagrangian=M * V**2 / 2 - K * X, surfaces={"wall": X <= 1}),
        {X: 0}, {X: 0}, ["wall"], steps=3, final_time=1, parameters={K: [1, 2]},
    )  # fmt: skip
    several = "parameter k has a value for each phase: expected one for all"
    with pytest.raises(DmocError, match=f"{several}, because sequences differ"):
        dmoc.search(walled, max_collisions=1)
    with pytest.raises(DmocError, match=several):
        dmoc.generate_page(spring, tmp_path / "joined.html")
    with pytest.raises(DmocError, match=several):
        dmoc.feedback(sprung)
    with pytest.raises(DmocError, match=several):
        sprung.stability()
    with pytest.raises(DmocError, match=several):
        dmoc.simulate(sprung, disturb={"start": {"x": 0.01}})
    with pytest.raises(DmocError, match="its parameters have a value for each phase"):
        dmoc.Planner(spring, sprung)
    runs = {"t": [0, 0.1, 0.2], "x": [1, 0.9, 0.8]}
    with pytest.raises(DmocError, match=several):
        dmoc.fit(spring, runs, {"m": (0.5, 2)})
    with pytest.raises(DmocError, match="leave them out with parameters that change by phase"):
        spring.but(minimal_times=True)
