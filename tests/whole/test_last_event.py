"""Motions that end with an event: the last phase has no steps, and one node after the event."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from last_events import FALL, G, against_wall, cubic, thrown_block
from pytest import approx
from sympy.physics.mechanics import dynamicsymbols
from systems import block_on_floor, block_system, dropped_ball, landing_system, unit_mass

import dmoc
from dmoc.base.errors import ProblemError
from dmoc.program.transcription import Transcription
from dmoc.solvers.outcome import Status

pytestmark = pytest.mark.slow

EXAMPLES = str(Path(__file__).resolve().parents[2] / "examples")


@pytest.mark.parametrize("order", [2, 4, 6])
def test_a_ball_that_is_dropped_ends_with_its_bounce(order: int) -> None:
    """It falls for sqrt(2 h/g) and leaves with e times its speed."""
    ball = dmoc.build(dropped_ball(), order=order)
    solution = dmoc.solve(
        dmoc.Problem(
            ball, start={"q": 1.0}, sequence=["floor"], durations=[None, 0], steps=10,
            restitution=0.6,
        )
    )  # fmt: skip
    fall = np.sqrt(2 / G)
    assert solution.solved and solution.final_time == approx(fall, rel=1e-12)
    (before, after), hit = solution.phases, solution.collisions[0]
    assert (after.steps, after.duration, after.u.shape) == (0, 0.0, (0, 0))
    assert after.t == approx([fall]) and hit.time == solution.final_time
    assert before.v[-1, 0] == approx(-G * fall, rel=1e-12)
    assert after.v[0, 0] == approx(0.6 * G * fall, rel=1e-12) == hit.momentum_after[0]
    assert hit.impulse == approx(1.6 * G * fall, rel=1e-12)


@pytest.mark.parametrize("method", ["ipm", "slsqp"])
@pytest.mark.parametrize(("order", "controls", "error"), [
    (2, "constant", 1e-3), (2, "linear", 2e-3), (4, "stages", 1e-9), (4, "constant", 1e-3),
    (6, "stages", 1e-9),
])  # fmt: skip
def test_a_rebound_of_least_effort(order: int, controls: str, error: float, method: str) -> None:
    """To leave with r the wall is met with r/e, whatever the goal says beside it."""
    solution = dmoc.solve(against_wall(order, controls=controls), method, starts=1)
    assert solution.solved and solution.cost == approx(cubic(1.6), abs=error)
    assert solution.phases[0].v[-1] == approx([1.6]) and solution.phases[1].v[0] == approx([-0.8])


@pytest.mark.parametrize(
    "fields",
    [
        {"goal": {"x": 1.0, "x_dot": -0.8}},
        {"goal": {"p_x": -0.8}},
        {"goal": {"x_dot": (-0.8, None)}},
        {"goal": {"x_dot": (None, -0.8)}, "durations": [None, (0, 0)], "final_time": (None, 1.0)},
        {"steps": [20, 0], "via": [{"x": 1.0}], "bounds": {"x_dot": (-2, 2)}},
        {"steps": None},
    ],
    ids=str,
)
def test_a_goal_speaks_of_the_state_after_the_event(fields: dict[str, Any]) -> None:
    """Speeds above 1.6 cost more, those below less, until 1.5."""
    solution = dmoc.solve(against_wall(**fields), starts=1)
    least = cubic(1.5) if fields.get("goal") == {"x_dot": (-0.8, None)} else cubic(1.6)
    assert solution.solved and solution.cost == approx(least, abs=1e-8)


def test_the_hardest_stroke_of_a_hammer() -> None:
    """With |u| <= 1 and two seconds the hammer first swings back for 2 - sqrt(3) s, and meets the
    wall at 2 sqrt(3) - 2; the objective is the speed after the stroke."""
    x = dynamicsymbols("x")
    hammer = replace(block_system("hammer"), cost=0, objective=dmoc.at_end(x.diff()))
    for order, error in ((2, 1e-2), (4, 2e-3)):
        solution = dmoc.solve(
            against_wall(order).but(
                kernels=dmoc.build(hammer, order=order), goal={}, bounds={"u": (-1, 1)},
                durations=[None, 0], final_time=(None, 2.0), steps=30,
            )
        )  # fmt: skip
        assert solution.solved and solution.final_time == approx(2.0)
        assert solution.cost == approx(-(np.sqrt(3) - 1), abs=error)
        assert solution.collisions[0].impulse == approx(1.5 * 2 * (np.sqrt(3) - 1), abs=4 * error)


@pytest.mark.parametrize("word", ["wall", "+wall"])
@pytest.mark.parametrize("goal", [{}, {"x": 1.0}, {"x_dot": 0.0}, {"x": 1.0, "x_dot": 0.0}])
def test_what_fixed_values_say_of_a_plastic_end_is_not_said_twice(
    goal: dict[str, float], word: str
) -> None:
    """However much of the end is fixed: 3/(2 T^3) of least effort to the wall, whose speed is
    free."""
    solution = dmoc.solve(against_wall(goal=goal, sequence=[word], restitution=0.0), starts=1)
    assert solution.solved and solution.cost == approx(1.5, abs=1e-9)
    assert solution.phases[-1].v[0] == approx([0.0], abs=1e-12)
    assert solution.phases[-1].closed == (("wall",) if word == "+wall" else ())


def test_rows_that_fixed_values_settle_are_left_out() -> None:
    """Rows that depend on no other unknown would leave multipliers open."""
    stops = Transcription(against_wall(goal={"x": 1.0, "x_dot": 0.0}, sequence=["+wall"])).laws
    assert not stops.impact.contact.count and not stops.impact.energy.count
    meets = Transcription(against_wall(goal={"x": 1.0}, sequence=["+wall"])).laws.impact
    assert (meets.contact.count, meets.energy.count) == (0, 1)
    comes = against_wall(goal={"x": (0.9, 1.1), "x_dot": 0.0}, sequence=["+wall"])
    stays = Transcription(comes).laws.impact
    assert (stays.contact.count, stays.energy.count) == (1, 0)
    rests = {"x": 1.0, "y": 0.0, "x_dot": 0.0, "y_dot": 0.0}
    lands = Transcription(thrown_block(4, "+floor", goal=rests)).laws
    assert not lands.friction.sticks.count and not lands.impact.energy.count
    returns = {"start": {"x": 1.0, "x_dot": None}, "goal": {}, "periodic": ["x", "x_dot"]}
    assert not Transcription(against_wall(**returns)).laws.impact.contact.count
    bounded = Transcription(against_wall(bounds={"x_dot": (-2, 2)}))
    at_end = bounded.layout.index_v_E
    assert [limit[at_end].tolist() for limit in bounded.limits] == [[-0.8], [-0.8]]


@pytest.mark.parametrize("order", [2, 4])
def test_a_bounce_that_repeats(order: int) -> None:
    """Without losses a ball returns as often as it likes: gT/2, and no force; the place is fixed
    at the start, by the period and by the floor."""
    y, F = dynamicsymbols("y F")
    bouncer = dmoc.MechanicalSystem(
        "bouncer", [y], y.diff() ** 2 / 2 - G * y, {}, [F], {y: F}, surfaces={"floor": y >= 0},
        cost=F**2 / 2,
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(bouncer, order=order), start={"y": 0.0, "y_dot": None}, steps=10,
        periodic=["y", "y_dot"], sequence=["floor"], durations=[None, 0], final_time=1.0,
    )  # fmt: skip
    solution = dmoc.solve(problem, starts=1)
    assert solution.solved and solution.cost == approx(0.0, abs=1e-12)
    assert solution.phases[0].v[0] == approx([G / 2]) == solution.phases[1].v[0]
    lossy = dmoc.solve(problem.but(restitution=0.7))
    assert lossy.solved and lossy.phases[0].v[0] == approx(lossy.phases[1].v[0], abs=1e-9)
    assert lossy.phases[1].v[0] == approx(-0.7 * lossy.phases[0].v[-1])


@pytest.mark.parametrize("order", [2, 4, 6])
@pytest.mark.parametrize(("word", "after"), [
    ("floor:slip+", (3 - 0.3 * 1.5 * FALL, 0.5 * FALL)),  # the impulse is (1 + e) v
    ("+floor:slip+", (3 - 0.3 * FALL, 0.0)),
])  # fmt: skip
def test_impacts_with_friction_end_a_motion(
    word: str, after: tuple[float, float], order: int
) -> None:
    solution = dmoc.solve(thrown_block(order, word), starts=1)
    assert solution.solved and solution.final_time == approx(FALL / G)
    assert solution.phases[-1].v[0] == approx(after, abs=1e-7)
    assert solution.phases[-1].mode == ("floor:slip+" if word[0] == "+" else "free")


def test_hits_with_tangential_restitution_and_what_sticks() -> None:
    """A point that sticks in the hit leaves with -e_t of its sliding velocity."""
    returning = replace(landing_system(), tangential_restitution={"floor": 0.4})
    problem = dmoc.Problem(
        dmoc.build(returning, order=4), start={"x": 0.0, "y": 1.0, "x_dot": 0.5}, steps=10,
        goal={"x": 0.3}, sequence=["floor:stick"], durations=[None, 0], final_time=(0.2, 1.0),
        restitution=0.6,
    )  # fmt: skip
    solution = dmoc.solve(problem, starts=1)
    assert solution.solved
    names, (before, after) = solution.trajectory.coordinates, solution.phases
    slide = names.index("x")
    assert after.v[0, slide] == approx(-0.4 * before.v[-1, slide])
    stuck = dmoc.solve(thrown_block(4, "+floor", bounds={}, goal={"x": 1.5}), starts=1)
    assert stuck.solved and stuck.phases[-1].v[0] == approx([0.0, 0.0], abs=1e-12)


@pytest.mark.parametrize("order", [2, 4, 6])
def test_a_hit_while_something_slides(order: int) -> None:
    """On the floor the wall is met with (v^2 - 2 mu g)^(1/2), and left with e of it."""
    x, y = dynamicsymbols("x y")
    walled = block_on_floor("walled", 1.0, G, 0.3, surfaces={"floor": y >= 0, "wall": x <= 1})
    problem = dmoc.Problem(
        dmoc.build(walled, order=order), start={"x": 0.0, "y": 0.0, "x_dot": 3.0}, steps=10,
        contacts=["floor:slip+"], sequence=["wall floor:slip-"], durations=[None, 0],
        restitution=0.5,
    )  # fmt: skip
    solution = dmoc.solve(problem, starts=1)
    rate = np.sqrt(9 - 2 * 0.3 * G)
    assert solution.solved and solution.phases[-1].mode == "floor:slip-"
    assert solution.phases[-1].v[0] == approx([-0.5 * rate, 0.0], abs=1e-8)
    assert solution.phases[-1].normal == approx(np.array([[G]]))


@pytest.mark.parametrize("order", [2, 4, 6])
def test_a_pendulum_of_a_constraint_ends_with_its_hit(order: int) -> None:
    """On a circle the energy gives the speed at the wall, (2 g sqrt(1 - 1/4))^(1/2), and the law
    of impact half of it back along the circle."""
    x, y = dynamicsymbols("x y")
    rod = dmoc.MechanicalSystem(
        "rod_pendulum", [x, y], (x.diff() ** 2 + y.diff() ** 2) / 2 - G * y,
        constraints={"rod": x**2 + y**2 - 1}, surfaces={"wall": x <= sp.Rational(1, 2)},
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(rod, order=order), start={"x": -1.0, "y": 0.0}, sequence=["wall"], steps=30,
        via=[{"y": (None, 0.0)}], durations=[None, 0], final_time=(None, 1.0), restitution=0.5,
    )  # fmt: skip
    solution = dmoc.solve(problem, starts=4)
    speed = 0.5 * np.sqrt(2 * G * np.sqrt(0.75))
    along = np.array([-np.sqrt(0.75), -0.5])
    assert solution.solved
    assert solution.phases[-1].v[0] == approx(speed * along, abs={2: 1e-2, 4: 1e-5, 6: 1e-8}[order])


@pytest.mark.parametrize("order", [2, 4])
def test_a_wall_that_moves_ends_a_motion(order: int) -> None:
    """Newton's law holds for the rates of the gap."""
    x, t = dynamicsymbols("x"), dynamicsymbols._t
    u = dynamicsymbols("u")
    moving = unit_mass("moving_wall", surfaces={"wall": x <= 1 + sp.sin(t) / 4}, cost=u**2 / 2)
    solution = dmoc.solve(
        dmoc.Problem(
            dmoc.build(moving, order=order), start={"x": 0.0}, goal={"x_dot": -0.5}, steps=20,
            sequence=["wall"], durations=[None, 0], final_time=(0.5, 1.5), restitution=0.5,
        )
    )  # fmt: skip
    wall = np.cos(solution.final_time) / 4
    assert solution.solved
    assert -0.5 - wall == approx(-0.5 * (solution.phases[0].v[-1, 0] - wall))


def test_quantities_forces_and_integrals_at_the_end() -> None:
    """After the landing the floor carries the weight, and the goal of the speed is that of then."""
    x, u = dynamicsymbols("x u")
    measured = block_on_floor(
        "measured", 1.0, G, 0.3, quantities={"load": dmoc.normal("floor"), "speed": x.diff()},
        integrals={"work": u * x.diff()},
    )  # fmt: skip
    problem = thrown_block(4, "+floor:slip+").but(
        kernels=dmoc.build(measured, order=4), goal={"speed": 2.0, "load": (5, None)},
        bounds={"speed": (0, 4), "load": (-1, 20)},
    )  # fmt: skip
    solution = dmoc.solve(problem, starts=1)
    assert solution.solved
    kinetic = [p.v[k, 0] ** 2 / 2 for p, k in zip(solution.phases[:1] * 2, (0, -1), strict=True)]
    assert solution.trajectory.totals["work"] == approx(kinetic[1] - kinetic[0])
    end = solution.at(solution.final_time)
    assert (end["speed"], end["load"]) == (approx(2.0), approx(G))
    assert solution.phases[-1].quantities == approx(np.array([[G, 2.0]]))
    before = solution.at(solution.final_time, "left")
    assert before["speed"] == approx(2 + 0.3 * FALL) and before["load"] == 0
    assert end["u"] == before["u"] == solution.trajectory.last_inputs[0]


def test_bounds_hold_after_the_event_too() -> None:
    """A wall that is left with 0.8 breaks a bound of 0.7."""
    problem = against_wall(goal={"x_dot": (None, -0.5)}, bounds={"x_dot": (-0.7, None)})
    assert dmoc.solve(problem).phases[-1].v[0, 0] >= -0.7 - 1e-9
    motion = dmoc.solve(against_wall()).trajectory
    check = dmoc.verify(replace(motion, limits={"x_dot": (-0.7, np.inf)}), problem.kernels)
    assert "the bound of x_dot is exceeded" in check.message
    with pytest.raises(ProblemError, match=r"the goal of x_dot .* outside its bounds"):
        against_wall(bounds={"x_dot": (-0.7, None)})


# Contacts that leave ------------------------------------------------------------------------------


def beam(inertia: float) -> dmoc.Problem:
    """A beam of unit mass stands on its left foot and falls onto the right one."""
    y, a = dynamicsymbols("y a")
    feet = {"left": y - a, "right": y + a}
    system = dmoc.MechanicalSystem(
        "beam", [y, a], y.diff() ** 2 / 2 + sp.Symbol("I") * a.diff() ** 2 / 2 - G * y,
        {sp.Symbol("I"): inertia}, surfaces={name: foot >= 0 for name, foot in feet.items()},
    )  # fmt: skip
    return dmoc.Problem(
        dmoc.build(system, order=4), start={"y": 0.2, "a": 0.2}, contacts=["left"],
        sequence=["+right -left"], durations=[None, 0], steps=10,
    )  # fmt: skip


def test_what_leaves_with_the_last_event_opens() -> None:
    """The impulse of the right foot changes the rate of the left one by 1 - 1/I of it."""
    opens, enters = (dmoc.solve(beam(inertia), starts=1) for inertia in (2.0, 0.5))
    assert opens.solved
    after, impulse = opens.phases[-1].v[0], opens.collisions[0].impulse
    assert after @ [1, 1] == approx(0.0, abs=1e-12)
    assert after @ [1, -1] == approx(impulse / 2)
    assert enters.status is Status.INFEASIBLE
    assert "opening of left at event 1" in enters.message


def test_a_gait_of_one_phase_is_the_one_that_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    """The period 0.734346391 s, and the rates after the landing, of an event-driven simulation."""
    monkeypatch.syspath_prepend(EXAMPLES)
    import compass_gait

    begin: dict[str, Any] = {"starts": 1}
    for order, steps, error in ((4, 80, 1e-8), (6, 20, 1e-9)):
        solution = dmoc.solve(compass_gait.problem(steps, order=order), **begin)
        begin = {"guess": solution}
        assert solution.solved and solution.final_time == approx(0.734346391, abs=error)
        assert -solution.phases[-1].v[0, [3, 2]] == approx([1.09238359, 0.37737395], abs=1e-8)
        assert solution.phases[-1].mode == "right:stick"


def test_a_step_of_a_walker_costs_the_same_from_mid_stance_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """With the exchange of the feet at the end, and between two equal halves of the motion."""
    monkeypatch.syspath_prepend(EXAMPLES)
    import walker

    whole = walker.problem(40)
    halves = whole.but(steps=20, durations=[walker.TIME / 2] * 2)
    costs = [dmoc.solve(problem, starts=1).cost for problem in (whole, halves)]
    assert costs[0] == approx(costs[1], abs=1e-6) and costs[0] == approx(390.7905, abs=1e-3)
