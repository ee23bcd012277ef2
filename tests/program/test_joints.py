"""Constraints of a model, which hold in every phase, beside the same mechanisms without any."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import four_bar as example
import joint_problems
import numpy as np
import pytest
import sympy as sp
from answers import answer_of
from joint_problems import A, T, U, X, Y, bob, double_pendulum, pendulum, places
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import DmocError
from dmoc.motion.largest_forces import largest_forces
from dmoc.motion.motion_tables import columns
from dmoc.program.blocks import NOWHERE
from dmoc.program.transcription import Transcription

pytestmark = pytest.mark.slow


def best(problem: dmoc.Problem, **options: Any) -> dmoc.Solution:
    solution = answer_of(problem, "ipm", **options)
    return solution


def limit(values: list[float]) -> float:
    """What numbers on meshes, each with twice the steps of the one before, tend to: errors are a
    series in even powers of the step."""
    for order in range(1, len(values)):
        values = [b + (b - a) / (4**order - 1) for a, b in pairwise(values)]
    return values[0]


def test_redundant_coordinates_lead_to_the_minimum_of_minimal_ones() -> None:
    redundant, minimal = double_pendulum()
    end = places(0.9, 0.6)
    rest = {f"{name}_dot": 0.0 for name in end}
    by_rods = dmoc.Problem(
        dmoc.build(redundant), start=places(0.0, 0.0), goal=end | rest, final_time=1.5
    )
    by_angles = dmoc.Problem(
        dmoc.build(minimal, order=2), start={"a": 0.0, "b": 0.0}, final_time=1.5,
        goal={"a": 0.9, "b": 0.6, "a_dot": 0.0, "b_dot": 0.0}, controls="linear",
    )  # fmt: skip
    limits = []
    for problem in (by_rods, by_angles):
        meshes = [best(problem.but(steps=n), starts=1) for n in (40, 80, 160, 320)]
        middle = [s.trajectory.phases[0].q[s.steps[0] // 5 * 2] for s in meshes]  # at 0.6 s
        limits.append((limit([s.cost for s in meshes]), limit(middle)))  # type: ignore[arg-type]
        assert meshes[0].verification is not None and meshes[0].verification.passed
    (cost, q), (expected, angles) = limits
    assert cost == pytest.approx(expected, rel=1e-8)
    np.testing.assert_allclose(q, list(places(*angles).values()), rtol=1e-8)


def test_redundant_coordinates_cost_as_much_as_minimal_ones_on_one_mesh() -> None:
    redundant, minimal = double_pendulum()
    end = places(0.9, 0.6)
    rest = {f"{name}_dot": 0.0 for name in end}
    by_rods = dmoc.Problem(
        dmoc.build(redundant, order=6), places(0.0, 0.0), end | rest, final_time=1.5, steps=60
    )
    by_angles = dmoc.Problem(
        dmoc.build(minimal, order=6), {"a": 0.0, "b": 0.0},
        {"a": 0.9, "b": 0.6, "a_dot": 0.0, "b_dot": 0.0}, final_time=1.5, steps=60,
    )  # fmt: skip
    costs = [best(problem, starts=1).cost for problem in (by_rods, by_angles)]
    assert costs[0] == pytest.approx(costs[1], rel=1e-9)


def test_a_four_bar_hammer_is_that_of_its_crank_alone() -> None:
    closed = answer_of(example.problem(), "ipm", starts=20)
    crank = dmoc.Problem(
        dmoc.build(joint_problems.four_bar(), order=4), start={"a": 0},
        goal={"a": 0, "a_dot": 0}, steps=80, sequence=["anvil"], restitution=0.3,
        final_time=example.TIME, bounds={"a": (-2.2, 0.6)},
    )  # fmt: skip
    turned = [{"a": phase.q[:, 0]} for phase in closed.phases]
    alone = answer_of(crank, "ipm", guess=turned)
    assert alone.cost == pytest.approx(example.EFFORT, rel=3e-7)
    meshes = [closed, answer_of(example.problem(80), "ipm", guess=closed)]
    at_limit = meshes[1].cost + (meshes[1].cost - meshes[0].cost) / 15
    assert at_limit == pytest.approx(example.EFFORT, rel=1e-7)
    blow = meshes[1].collisions[0]
    assert blow.time == pytest.approx(example.BLOW, rel=1e-7)
    assert blow.impulse == pytest.approx(example.IMPULSE, rel=1e-6)


def test_forces_of_a_rod_are_what_a_swing_pulls_with() -> None:
    """The tension g cos a + a_dot^2 of a pendulum: R (2 x, 2 y) with 2 R = -tension."""
    problem = dmoc.Problem(
        dmoc.build(bob()), start={"x": 0.0, "y": -1.0}, steps=100, final_time=1.2,
        goal={"x": np.sin(1.0), "y": -np.cos(1.0), "x_dot": 0.0, "y_dot": 0.0},
    )  # fmt: skip
    solution = best(problem)
    phase = solution.trajectory.phases[0]
    tension = -9.81 * phase.q[:, 1] + (phase.v**2).sum(axis=1)
    pull = -2 * phase.reaction[:, 0]
    np.testing.assert_allclose(pull[1:-1], tension[1:-1], rtol=1e-3)
    np.testing.assert_allclose(pull, tension, rtol=1e-2)  # at the ends continued
    assert np.abs((phase.q**2).sum(axis=1) - 1).max() < 1e-12
    assert np.abs((phase.q * phase.v).sum(axis=1)).max() < 1e-12
    assert solution.trajectory.phases[0].joints == ("rod",)
    assert solution.at(0.6)["R_rod"] == pytest.approx(phase.reaction[50, 0])
    assert "R_rod" in columns(solution.trajectory)
    (largest,) = largest_forces(solution.trajectory)
    assert (largest.contact, largest.kind) == ("rod", "R")
    assert largest.value == pytest.approx(phase.reaction[np.abs(phase.reaction).argmax(), 0])


@pytest.mark.parametrize("slope", [0.0, 0.1])
def test_a_hit_beside_a_rod_is_that_of_the_pendulum(slope: float, tmp_path: Path) -> None:
    """At half a metre, on a wall that is upright, or leans."""
    task: dict[str, Any] = {"sequence": ["wall"], "steps": 60, "final_time": 1.2}
    there = 0.5 - slope * np.sqrt(0.75)
    by_rod = dmoc.Problem(
        dmoc.build(bob(surfaces={"wall": X + slope * Y <= there})), start={"x": 0.0, "y": -1.0},
        goal={"x": -0.4, "y": -np.sqrt(0.84), "x_dot": 0.0, "y_dot": 0.0}, restitution=0.8, **task,
    )  # fmt: skip
    by_angle = dmoc.Problem(
        dmoc.build(pendulum(surfaces={"wall": sp.sin(A) - slope * sp.cos(A) <= there})),
        start={"a": 0.0}, goal={"a": -np.arcsin(0.4), "a_dot": 0.0}, restitution=0.8,
        controls="linear", **task,
    )  # fmt: skip
    a, b = best(by_rod), best(by_angle)
    assert a.cost == pytest.approx(b.cost, rel=1e-3)
    (hit,), (other,) = a.collisions, b.collisions
    assert hit.time == pytest.approx(other.time, abs=1e-3)
    assert hit.impulse == pytest.approx(other.impulse, rel=2e-3)
    assert hit.rate_after == pytest.approx(-0.8 * hit.rate_before)
    by_wall, by_rod_itself = -hit.impulse * np.array([1.0, slope]), 2 * hit.reactions["rod"]
    change = by_wall + by_rod_itself * hit.position
    np.testing.assert_allclose(hit.momentum_after - hit.momentum_before, change, atol=1e-9)
    a.save(tmp_path / "hit.npz")
    again = dmoc.Solution.load(tmp_path / "hit.npz")
    assert again.collisions[0].reactions == hit.reactions
    np.testing.assert_array_equal(
        again.trajectory.phases[1].reaction, a.trajectory.phases[1].reaction
    )


def test_a_swing_up_does_not_go_through_the_middle() -> None:
    """From below to above there is a step that costs nothing and leaves the circle between its
    nodes."""
    fields: dict[str, Any] = {"bounds": {"u": (-5, 5)}, "final_time": (None, 6), "steps": 120}
    above = {"x": 0.0, "y": 1.0, "x_dot": 0.0, "y_dot": 0.0}
    by_rod = dmoc.Problem(dmoc.build(bob()), start={"x": 0.0, "y": -1.0}, goal=above, **fields)
    by_angle = dmoc.Problem(
        dmoc.build(pendulum()), start={"a": 0.0}, goal={"a": np.pi, "a_dot": 0.0},
        controls="linear", **fields,
    )  # fmt: skip
    a, b = (best(problem, verify=False, starts=30) for problem in (by_rod, by_angle))
    assert a.cost == pytest.approx(b.cost, rel=1e-2)
    q = a.trajectory.phases[0].q
    assert (np.einsum("ki,ki->k", q[1:], q[:-1]) > 0.5).all()


def test_a_ladder_slides_along_floor_and_wall() -> None:
    """Closed contacts beside a rod; the ladder has one angle."""
    x1, y1, x2, y2, th = dynamicsymbols("x1 y1 x2 y2 th")
    speeds = sum(s.diff(T) ** 2 for s in (x1, y1, x2, y2)) / 2
    ladder = dmoc.MechanicalSystem(
        "ladder", [x1, y1, x2, y2], speeds - 9.81 * (y1 + y2), {}, [U], {x1: U}, cost=U**2,
        surfaces={"floor": y1 >= 0, "wall": x2 >= 0},
        constraints={"rod": sp.Eq((x2 - x1) ** 2 + (y2 - y1) ** 2, 1)},
    )  # fmt: skip
    by_angle = dmoc.MechanicalSystem(
        "ladder_by_angle", [th], th.diff(T) ** 2 / 2 - 9.81 * sp.sin(th), {}, [U],
        {th: -U * sp.sin(th)}, cost=U**2,
    )  # fmt: skip
    a = best(
        dmoc.Problem(
            dmoc.build(ladder), start={"x1": 0.6, "y1": 0.0, "x2": 0.0, "y2": 0.8},
            goal={"x1": 0.3, "x1_dot": 0.0}, contacts=["floor", "wall"], steps=40, final_time=1.0,
        )
    )  # fmt: skip
    b = best(
        dmoc.Problem(
            dmoc.build(by_angle), start={"th": np.arctan2(0.8, 0.6)}, steps=40, final_time=1.0,
            goal={"th": np.arccos(0.3), "th_dot": 0.0}, controls="linear",
        )
    )  # fmt: skip
    assert a.cost == pytest.approx(b.cost, rel=2e-3)


@pytest.mark.parametrize("joined", [True, False])
def test_a_guide_that_moves(joined: bool) -> None:
    """On y = sin(3 t)/5 + x/10 the force obeys 1.01 x'' = u - g/10 + 0.18 sin 3 t: the cheapest one
    to x = 1 at rest is linear in the time, with the mean and the moment that the two ends ask for.
    By x alone, its momentum at rest changes with the time."""
    system = dmoc.MechanicalSystem(
        "guide", [X, Y], (X.diff(T) ** 2 + Y.diff(T) ** 2) / 2 - 9.81 * Y, {}, [U], {X: U},
        constraints={"guide": sp.Eq(Y, sp.sin(3 * T) / 5 + X / 10)}, cost=U**2,
    )  # fmt: skip
    start: dict[str, Any] = {"x": 0.0, "y": 0.0, "y_dot": 0.6}
    if not joined:
        rate = sp.Rational(3, 5) * sp.cos(3 * T) + X.diff(T) / 10
        energies = (X.diff(T) ** 2 + rate**2) / 2 - 9.81 * (sp.sin(3 * T) / 5 + X / 10)
        system = dmoc.MechanicalSystem("guide_by_x", [X], energies, {}, [U], {X: U}, cost=U**2)
        start = {"x": 0.0}
    end = 1.3
    s = best(
        dmoc.Problem(
            dmoc.build(system), start=start, goal={"x": 1.0, "x_dot": 0.0}, final_time=end,
            steps=100, controls="linear",
        )
    )  # fmt: skip
    # integral of x'' is 0, that of (T - t) x'' is 1
    w = 3.0
    mean = 0.981 - 0.18 * (1 - np.cos(w * end)) / w / end
    pushed = 0.18 * (end / w - np.sin(w * end) / w**2)
    moment = 1.01 + 0.0981 * 10 * end**2 / 2 - pushed  # of u about the end
    slope = (mean * end**2 / 2 - moment) * 12 / end**3
    expected = mean + slope * (s.trajectory.phases[0].t - end / 2)
    np.testing.assert_allclose(s.trajectory.phases[0].u[:, 0], expected, atol=1e-3)


@pytest.mark.parametrize("order", [2, 4])
def test_constraints_that_say_the_same_twice_hold_once(order: int) -> None:
    """The swing of a rod that is held twice, and by its rate a third time, is that of one held
    once, also through a hit; the forces together pull as the one does."""
    rod = X**2 + Y**2 - 1
    more = {"same": sp.sqrt(X**2 + Y**2) - 1, "rate": X * X.diff(T) + Y * Y.diff(T)}
    answers = []
    for constraints in ({"rod": rod}, {"rod": rod, **more}):
        system = dmoc.MechanicalSystem(
            f"held_{len(constraints)}", [X, Y],
            (X.diff(T) ** 2 + Y.diff(T) ** 2) / 2 - 9.81 * Y, {},
            constraints=constraints, surfaces={"wall": X <= 0.5},
        )  # fmt: skip
        problem = dmoc.Problem(
            dmoc.build(system, order=order), start={"x": 0.0, "y": -1.0, "x_dot": 2.5, "y_dot": 0},
            sequence=["wall"], restitution=0.6, steps=30, final_time=0.5,
        )  # fmt: skip
        answers.append(best(problem))
    one, other = answers
    assert other.collisions[0].time == pytest.approx(one.collisions[0].time, rel=1e-9)
    for a, b in zip(one.phases, other.phases, strict=True):
        np.testing.assert_allclose(b.q, a.q, atol=1e-9)
        whole = b.reaction @ [2.0, 1.0, 1.0]  # along (x, y), of 2 R, of R / 1 and of R
        np.testing.assert_allclose(whole, 2.0 * a.reaction[:, 0], rtol=1e-5, atol=1e-5)


def test_constraints_that_contradict_each_other_are_named() -> None:
    apart = {"one": X**2 + Y**2 - 1, "two": sp.sqrt(X**2 + Y**2) - 2}
    energies = (X.diff(T) ** 2 + Y.diff(T) ** 2) / 2
    system = dmoc.MechanicalSystem("apart", [X, Y], energies, {}, constraints=apart)
    with pytest.raises(DmocError, match="contradict each other"):
        dmoc.Problem(system, start={"x": 1.0, "y": 0.0}, final_time=1.0)


def test_a_constraint_is_shown() -> None:
    system = bob()
    assert "rod" in dmoc.build(system).summary().rows[5][1]
    assert "Constraints" in [section.title for section in dmoc.derive(system).sections]
    assert joint_problems.bob().fingerprint() == system.fingerprint()


def test_a_bound_of_power_beside_a_rod_is_no_obstacle_to_a_blow() -> None:
    """It comes back to where it began: a straight way from start to goal would not meet the wall,
    and power is flat where nothing moves."""
    task: dict[str, Any] = {"sequence": ["wall"], "final_time": 1.2, "restitution": 0.5}
    power = U * (X * Y.diff(T) - Y * X.diff(T))
    by_rod = dmoc.Problem(
        bob(surfaces={"wall": X <= 0}, quantities={"power": power}), start={"x": -0.6, "y": -0.8},
        goal={"x": -0.6, "x_dot": 0.0}, bounds={"power": (-40, 2)}, **task,
    )  # fmt: skip
    by_angle = dmoc.Problem(
        pendulum(surfaces={"wall": A <= 0}, quantities={"power": U * A.diff(T)}),
        start={"a": -np.arcsin(0.6)}, goal={"a": -np.arcsin(0.6), "a_dot": 0.0},
        bounds={"power": (-40, 2)}, **task,
    )  # fmt: skip
    a, b = best(by_rod, starts=4), best(by_angle, starts=4)
    assert a.cost == pytest.approx(b.cost, rel=1e-5)
    assert a.active_bounds and b.active_bounds


def test_a_constraint_that_is_stated_twice_counts_once_in_a_hit_with_friction() -> None:
    """A mass on a rod that slides up and down a post, and falls on a rough floor."""
    z, mu = dynamicsymbols("z"), sp.Symbol("mu")
    rod = X**2 + Y**2 - 1
    system = dmoc.MechanicalSystem(
        "held_twice", [X, Y, z], (X.diff() ** 2 + Y.diff() ** 2 + z.diff() ** 2) / 2 - 9.81 * z,
        {mu: 0.2}, [U], {X: -U * Y, Y: U * X}, cost=U**2, surfaces={"floor": z >= 0},
        tangents={"floor": X}, friction={"floor": mu}, constraints={"rod": rod, "again": 2 * rod},
    )  # fmt: skip
    problem = dmoc.Problem(
        system, {"x": 0, "y": -1, "z": 1, "x_dot": 1, "z_dot": 0}, {"x": 0.5}, ["floor:slip+"],
        restitution=0.5, final_time=0.8, steps=5,
    )  # fmt: skip
    joined = Transcription(problem).laws.held.joined
    assert joined.count == 1 and joined.index[0, :, 1].tolist() == [NOWHERE, NOWHERE]
