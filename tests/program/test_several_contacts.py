"""Several contacts at once: landings, redundant ones and their forces, what is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy as sp
from answers import answer_of
from scipy.optimize import linprog
from several_contacts import (
    FALL,
    GRAVITY,
    HALF_HEIGHT,
    HALF_WIDTH,
    HOUSNER,
    LET_GO,
    MASS,
    MU,
    PUSHED,
    SLENDER,
    STANDING,
    A,
    T,
    U,
    X,
    Y,
    box,
    falling_flat,
    flat_foot,
    gripper,
    pushed,
    rocking,
    time_of_slender,
    time_to_land,
)

import dmoc
from dmoc.base.errors import ProblemError

BOTH_METHODS = pytest.mark.parametrize("method", ["ipm", "slsqp"])


@pytest.mark.slow
@BOTH_METHODS
def test_a_rough_box_that_falls_flat_is_at_rest(method: str) -> None:
    solution = answer_of(falling_flat(0.6, "+left +right"), method, starts=1)
    landing, after = solution.collisions[0], solution.phases[1]
    assert landing.time == pytest.approx(FALL, rel=1e-6)
    assert sum(landing.impulses.values()) == pytest.approx(MASS * GRAVITY * FALL, rel=1e-6)
    assert sum(landing.tractions.values()) == pytest.approx(-MASS * 0.5, rel=1e-6)
    np.testing.assert_allclose(after.v, 0, atol=1e-6)
    np.testing.assert_allclose(after.normal.sum(axis=1), MASS * GRAVITY, rtol=1e-6)
    # Of the friction only the sum has an effect; least squares share it equally.
    left, right = landing.tractions.values()
    assert left == pytest.approx(right, rel=1e-6)
    assert "friction of left and right in phase 1: shared by least squares" in solution.message


@pytest.mark.slow
@pytest.mark.parametrize("how", [{"events": ["+left +right", "+left"]}, {"strategy": "propose"}])
def test_a_search_lands_on_both_corners(how: dict[str, Any]) -> None:
    problem = falling_flat(0.6, "+left +right").but(sequence=[])
    best = dmoc.search(problem, max_collisions=1, workers=1, **how).best
    assert best is not None and best.sequence == ("+left +right",)


@pytest.mark.slow
def test_a_box_is_tipped_until_it_balances_on_a_corner() -> None:
    problem = dmoc.Problem(
        dmoc.build(box(), order=4), start=STANDING | dict.fromkeys(("x_dot", "y_dot", "a_dot"), 0),
        contacts=["left", "right"], sequence=["-left"], goal={"a": -SLENDER, "a_dot": 0},
        bounds={"w": (0, 0)}, steps=25, final_time=1.5,
    )  # fmt: skip
    tipped = answer_of(problem, starts=4).phases[-1]
    np.testing.assert_allclose(tipped.q[-1, 1], np.hypot(HALF_WIDTH, HALF_HEIGHT), rtol=1e-9)


def test_a_smooth_box_that_falls_flat_slides_on() -> None:
    solution = answer_of(falling_flat(0.0, "+left:slip+ +right:slip+"), starts=1)
    landing, after = solution.collisions[0], solution.phases[1]
    # The impulses of the corners are equal, because nothing turns the box.
    for impulse in landing.impulses.values():
        assert impulse == pytest.approx(MASS * GRAVITY * FALL / 2, rel=1e-6)
    np.testing.assert_allclose(after.v, np.tile([0.5, 0, 0], (len(after.t), 1)), atol=1e-6)
    assert "least squares" not in solution.message


def test_a_box_that_falls_flat_and_fast_slides_on_more_slowly() -> None:
    problem = falling_flat(0.1, "+left:slip+ +right:slip+")
    solution = answer_of(problem, starts=1)
    landing, after = solution.collisions[0], solution.phases[1]
    lost = 0.1 * GRAVITY * FALL
    assert after.v[0, 0] == pytest.approx(0.5 - lost, rel=1e-6)
    assert sum(landing.tractions.values()) == pytest.approx(-MASS * lost, rel=1e-6)


def test_shared_friction_stays_within_the_cones_of_both_corners() -> None:
    """The friction that is needed turns the box about its front corner: the rear one bears less
    than half of it."""
    problem = falling_flat(0.4, "+left +right").but(
        start={"x": 0, "y": 1.0, "a": 0, "x_dot": 1.1}, final_time=0.5
    )
    landing = answer_of(problem, starts=1).collisions[0]
    (left, right), rubbed = landing.impulses.values(), landing.tractions
    assert rubbed["left"] == pytest.approx(-0.4 * landing.impulses["left"], rel=1e-4)
    assert sum(rubbed.values()) == pytest.approx(-MASS * 1.1, rel=1e-6)
    assert abs(rubbed["right"]) < 0.4 * landing.impulses["right"]
    assert left + right == pytest.approx(MASS * GRAVITY * FALL, rel=1e-6)


@pytest.mark.slow
@BOTH_METHODS
def test_a_rocking_box_loses_what_housner_says(method: str) -> None:
    solution = answer_of(rocking(0.1), method, starts=1)
    before, after = solution.phases[0].v[-1, 2], solution.phases[1].v[0, 2]
    assert after / before == pytest.approx(HOUSNER, rel=1e-6)
    assert solution.collisions[0].time == pytest.approx(time_to_land(0.1), rel=3e-4)


def test_the_simulation_rocks_and_lands_flat_by_itself() -> None:
    system, place = box(), rocking(0.1).start
    run = dmoc.simulate(
        system, [place["x"], place["y"], 0.1], [0, 0, 0], step_size=0.001, steps=400, restitution=0
    )
    landing = run.collisions[0]
    assert landing.time == pytest.approx(time_to_land(0.1), rel=1e-9)
    assert landing.momentum_after[2] / landing.momentum_before[2] == pytest.approx(HOUSNER)
    run = dmoc.simulate(system, [0, 1, 0], [0.5, 0, 0], step_size=0.01, steps=50, restitution=0)
    assert sum(c.impulse for c in run.collisions) == pytest.approx(MASS * GRAVITY * FALL)
    tractions = [c.tractions[c.surface] for c in run.collisions]
    assert tractions == pytest.approx([-MASS * 0.25] * 2)
    np.testing.assert_allclose(run.v[-1], 0, atol=1e-9)
    assert "not unique" in run.notes[0]


def test_the_time_to_land_is_that_of_slender_boxes_for_small_tilts() -> None:
    assert time_to_land(0.01) == pytest.approx(time_of_slender(0.01), rel=0.05)


@pytest.mark.slow
def test_a_box_that_is_pushed_stands_slides_and_stands() -> None:
    errors = [answer_of(pushed(steps), starts=4).cost / PUSHED - 1 for steps in (10, 20)]
    assert errors[0] == pytest.approx(4 * errors[1], rel=0.05)  # order 2
    assert abs(errors[1]) < 2e-3


@pytest.mark.slow
def test_order_four_shares_too() -> None:
    """The push is a polynomial in time that it contains; the time to land is that of quadrature."""
    kernels = dmoc.build(box(), order=4)
    solution = answer_of(pushed(10).but(kernels=kernels), starts=2)
    assert solution.cost == pytest.approx(PUSHED, rel=1e-8)
    left, right = solution.phases[1].tangential.T
    np.testing.assert_allclose(left + right, -0.2 * MASS * GRAVITY, rtol=1e-6)
    landing = answer_of(rocking(0.1, 20).but(kernels=kernels), starts=1).collisions[0]
    assert landing.time == pytest.approx(time_to_land(0.1), rel=1e-6)


@pytest.mark.slow
def test_a_third_corner_between_two_carries_a_share() -> None:
    """Forces a, a at the corners and c in the middle, 2 a + c = m g, are shortest in the measure of
    the masses where c / a = (1/m + b^2/I) / (1/m)."""
    problem = dmoc.Problem(
        box("three_corners", corners=3), start=STANDING, goal={"x": 0}, bounds=LET_GO,
        contacts=["left", "right", "middle"], steps=6, final_time=1,
    )  # fmt: skip
    solution = answer_of(problem, starts=1)
    ratio = 1 + 3 * HALF_WIDTH**2 / (HALF_WIDTH**2 + HALF_HEIGHT**2)
    shares = np.array([1, 1, ratio]) / (2 + ratio) * MASS * GRAVITY
    np.testing.assert_allclose(solution.phases[0].normal, np.tile(shares, (7, 1)), rtol=1e-6)
    assert "forces of left and right and middle in phase 0" in solution.message
    assert problem.redundant[0].closed == (2,)
    assert problem.redundant[0].sticking == (1, 2)


@pytest.mark.slow
def test_gaps_of_other_sizes_share_by_their_effect() -> None:
    """Two gaps of one floor, the second one twice the first: N1 + 2 N2 = m g, and the shares by
    effect are equal."""
    twice = dmoc.MechanicalSystem(
        "twice", [X, Y], (X.diff(T) ** 2 + Y.diff(T) ** 2) / 2 - 9.81 * Y, {},
        surfaces={"floor": Y >= 0, "ground": 2 * Y >= 0}, cost=1,
    )  # fmt: skip
    problem = dmoc.Problem(
        twice, start={"x": 0, "y": 0, "x_dot": 1}, contacts=["floor", "ground"], steps=5,
        final_time=1,
    )  # fmt: skip
    normal = answer_of(problem, starts=1).phases[0].normal
    np.testing.assert_allclose(normal, np.tile([9.81 / 2, 9.81 / 4], (6, 1)), rtol=1e-6)


def test_a_box_lands_on_one_corner_while_the_other_one_slips() -> None:
    """The impulses N of both corners stop their approach, with friction -mu N, by the response of a
    rigid box to forces at its corners."""
    b, h, mu, tilt = 0.5, 0.2, 0.1, 0.2
    start = {"x": 0, "y": h * np.cos(tilt) + b * np.sin(tilt), "a": tilt, "x_dot": 1.0}
    problem = dmoc.Problem(
        box(), start=start | {"y_dot": 0, "a_dot": 0}, contacts=["left:slip+"],
        sequence=["+right:slip+"], parameters={"b": b, "h": h, "mu": mu}, bounds=LET_GO, steps=20,
        final_time=(0.05, 1), durations=[(None, None), (0.05, 0.05)],
    )  # fmt: skip
    solution = answer_of(problem, starts=2)
    landing, before = solution.collisions[0], solution.phases[0].v[-1]
    mass = MASS * np.array([1, 1, (b**2 + h**2) / 3])
    normals = np.array([[0, 1, -b], [0, 1, b]])
    pushes = normals - mu * np.array([1, 0, h])
    impulses = np.linalg.solve(normals / mass @ pushes.T, -normals @ before)
    assert [*landing.impulses.values()] == pytest.approx(impulses.tolist(), rel=1e-4)
    assert [*landing.tractions.values()] == pytest.approx((-mu * impulses).tolist(), rel=1e-4)
    run = dmoc.simulate(
        box(), [0, start["y"], tilt], [1.0, 0, 0], step_size=0.002, steps=150, restitution=0,
        parameters={"b": b, "h": h, "mu": mu},
    )  # fmt: skip
    struck = [(c.surface, c.impulse) for c in run.collisions]
    assert [name for name, _ in struck] == ["left", "right"]
    assert [p for _, p in struck] == pytest.approx(impulses.tolist(), rel=1e-3)


@pytest.mark.slow
@BOTH_METHODS
def test_two_fingers_catch_a_disc(method: str) -> None:
    """They close on it at once; each bears half of its weight at the edge of its friction."""
    start = dict.fromkeys(("x", "a", "z", "x_dot", "y_dot", "a_dot", "w_dot", "z_dot"), 0)
    problem = dmoc.Problem(
        gripper(), start={**start, "y": 0.3, "w": 0.1}, sequence=["+one +two"],
        goal={"y": 0.3, "y_dot": 0, "z_dot": 0}, steps=15, final_time=(0.3, 1.5),
    )  # fmt: skip
    solution = answer_of(problem, method, starts=6)
    caught, held = solution.collisions[0], solution.phases[1]
    assert caught.impulses["one"] == pytest.approx(caught.impulses["two"], rel=1e-5)
    lifted = held.p[1:-1, 1] - held.p[:-2, 1]
    np.testing.assert_allclose(lifted.mean() / np.diff(held.t).mean() + 0.5 * GRAVITY,
                               held.tangential.sum(axis=1).mean(), rtol=0.02)  # fmt: skip
    np.testing.assert_allclose(held.tangential, 0.5 * held.normal, rtol=1e-4)


@pytest.mark.slow
@BOTH_METHODS
def test_a_flat_foot_lands_with_one_force_and_one_moment(method: str) -> None:
    start = dict.fromkeys(("x", "a", "th", "y_dot", "a_dot", "l_dot", "th_dot"), 0)
    problem = dmoc.Problem(
        flat_foot(), start={**start, "y": 0.3, "l": 0.4, "x_dot": 0.3}, sequence=["+heel +toe"],
        goal={"l": 0.4, "l_dot": 0, "th": 0, "th_dot": 0}, bounds={"l": (0.2, 0.7)}, steps=20,
        final_time=(0.5, 1.5),
    )  # fmt: skip
    solution = answer_of(problem, method, starts=6)
    landing = solution.collisions[0]
    jump = landing.momentum_after - landing.momentum_before
    assert sum(landing.impulses.values()) == pytest.approx(jump[1], rel=1e-6)
    assert sum(landing.tractions.values()) == pytest.approx(jump[0], rel=1e-6)
    heel, toe = landing.tractions.values()
    assert heel == pytest.approx(toe, rel=1e-6)


@pytest.mark.slow
def test_a_flat_foot_hops() -> None:
    rest = dict.fromkeys(("x", "y", "a", "th", "x_dot", "y_dot", "a_dot", "l_dot", "th_dot"), 0)
    problem = dmoc.Problem(
        flat_foot(), start={**rest, "l": 0.4}, contacts=["heel", "toe"],
        sequence=["-heel -toe", "+heel +toe"], via=[None, {"th": 0, "l": 0.4}],
        goal={"l": 0.4, "l_dot": 0, "th": 0, "th_dot": 0}, steps=15,
        bounds={"l": (0.2, 0.7), "th": (-1, 1)}, final_time=(0.3, 2),
        durations=[(0.1, None), (0.2, None), (0.1, None)],
    )  # fmt: skip
    crouching = {"l": [0.4, 0.3, 0.45, 0.45, 0.4, 0.3, 0.4], "durations": [0.4, 0.3, 0.4]}
    solution = answer_of(problem, "ipm", guess=crouching)
    for phase in solution.phases[::2]:
        np.testing.assert_allclose(phase.v[:, :3], 0, atol=1e-9)


@pytest.mark.slow
@BOTH_METHODS
def test_a_ladder_is_pushed_by_what_the_best_shared_forces_leave(method: str) -> None:
    """Floor and wall hold it with four forces of three conditions.  The least push at its middle
    is that of a linear program over all forces within the cones."""
    length, tilt, mu = 2.0, 1.1, 0.1
    ends = {s: (X + s * length / 2 * sp.cos(A), Y + s * length / 2 * sp.sin(A)) for s in (-1, 1)}
    inertia = length**2 / 12 * A.diff(T) ** 2
    ladder = dmoc.MechanicalSystem(
        "pushed_ladder", [X, Y, A],
        (X.diff(T) ** 2 + Y.diff(T) ** 2 + inertia) / 2 - GRAVITY * Y, {MU: mu},
        inputs=[U], forces={X: U}, cost=U**2 / 2,
        surfaces={"floor": ends[-1][1] >= 0, "wall": ends[1][0] <= 1},
        tangents={"floor": ends[-1][0], "wall": ends[1][1]},
        friction={"floor": MU, "wall": MU},
    )  # fmt: skip
    place = {"x": 1 - np.cos(tilt), "y": np.sin(tilt), "a": tilt}
    problem = dmoc.Problem(
        ladder, start=place | dict.fromkeys(("x_dot", "y_dot", "a_dot"), 0),
        contacts=["floor", "wall"], steps=8, final_time=1,
    )  # fmt: skip
    # Forces N, T of the floor, N, T of the wall, and the push: balances of x, y, moments at the
    # middle; the four edges of the cones.
    c, s = np.cos(tilt), np.sin(tilt)
    balance = [[0, 1, -1, 0, 1], [1, 0, 0, 1, 0], [-c, s, s, c, 0]]
    cones = [[-mu, 1, 0, 0, 0], [-mu, -1, 0, 0, 0], [0, 0, -mu, 1, 0], [0, 0, -mu, -1, 0]]
    bounds = [(0, None), (None, None), (0, None), (None, None), (0, None)]
    least = linprog([0, 0, 0, 0, 1], cones, np.zeros(4), balance, [0, GRAVITY, 0], bounds).fun
    assert least > 0
    solution = answer_of(problem, method, starts=2)
    assert solution.cost == pytest.approx(least**2 / 2, rel=1e-6)


@pytest.mark.slow
def test_a_body_that_sticks_between_two_walls_is_held_by_the_least_that_bears_it() -> None:
    problem = dmoc.Problem(
        squeezed(), start=dict.fromkeys(("x", "y", "x_dot", "y_dot"), 0),
        contacts=["left", "right"], steps=5, final_time=1,
    )  # fmt: skip
    held = answer_of(problem, starts=1).phases[0]
    np.testing.assert_allclose(held.tangential, GRAVITY / 2, rtol=1e-6)
    np.testing.assert_allclose(held.normal, GRAVITY / 2 / 0.5, rtol=1e-6)


# What is refused ----------------------------------------------------------------------------------


def squeezed(**more: Any) -> dmoc.MechanicalSystem:
    """A disc between two walls."""
    return dmoc.MechanicalSystem(
        "squeezed", [X, Y], (X.diff(T) ** 2 + Y.diff(T) ** 2) / 2 - 9.81 * Y, {MU: 0.5},
        surfaces={"left": X >= 0, "right": X <= 0}, tangents={"left": Y, "right": Y},
        friction={"left": MU, "right": MU}, cost=1, **more,
    )  # fmt: skip


def test_friction_by_a_squeeze_that_nothing_determines_is_refused() -> None:
    with pytest.raises(ProblemError, match="the friction of left and right depends on it"):
        dmoc.Problem(
            squeezed(), start={"x": 0, "y": 0}, contacts=["left:slip-", "right:slip-"], steps=5,
            final_time=1,
        )  # fmt: skip


def test_contacts_that_cannot_be_closed_together_are_refused() -> None:
    gap = dmoc.MechanicalSystem(
        "no_gap", [X, Y], (X.diff(T) ** 2 + Y.diff(T) ** 2) / 2, {},
        surfaces={"floor": Y >= 0, "ceiling": Y <= 1}, cost=1,
    )  # fmt: skip
    with pytest.raises(ProblemError, match="ceiling cannot hold together"):
        dmoc.Problem(
            gap, start={"x": 0, "y": None}, contacts=["floor", "ceiling"], steps=5, final_time=1
        )


@pytest.mark.slow
def test_belts_of_different_speeds_cannot_hold_one_body() -> None:
    belts = dmoc.MechanicalSystem(
        "belts", [X, Y], (X.diff(T) ** 2 + Y.diff(T) ** 2) / 2 - 9.81 * Y, {MU: 0.5},
        surfaces={"slow": Y >= 0, "fast": 2 * Y >= 0}, tangents={"slow": X, "fast": X - T},
        friction={"slow": MU, "fast": MU}, cost=1,
    )  # fmt: skip
    with pytest.raises(ProblemError, match="contradict each other: fast"):
        dmoc.Problem(
            belts, start={"x": 0, "y": 0, "x_dot": None}, contacts=["slow", "fast"], steps=5,
            final_time=1,
        )  # fmt: skip


def test_what_touches_by_other_contacts_has_nothing_to_land_from() -> None:
    with pytest.raises(ProblemError, match="middle touches wherever left and right do"):
        dmoc.Problem(
            box("three_corners", corners=3), start=STANDING, contacts=["left", "right"],
            sequence=["+middle"], steps=5, final_time=1,
        )  # fmt: skip
