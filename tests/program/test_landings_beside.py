"""A plank whose left foot slides on a rough floor while its right one lands on a step: its course
by linear systems, stage by stage, and what the simulation makes of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import sympy as sp
from answers import answer_of
from several_contacts import GRAVITY, A, T, X, Y, box, falling_flat
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import ProblemError

LEFT, RIGHT, STEP = sp.symbols("mu_l mu_r h")
MASS = np.array([1, 1, 1 / 3])
Stages = list[tuple[int, str]]
SIGNS = {"slip+": 1, "slip-": -1, "stick": 0}


def plank() -> dmoc.Kernels:
    """Two metres long, with the mass 1."""
    feet = {
        "left": (X - sp.cos(A), Y - sp.sin(A)),
        "right": (X + sp.cos(A), Y + sp.sin(A) - STEP),
    }
    return dmoc.build(
        dmoc.MechanicalSystem(
            "landing_plank", [X, Y, A],
            (X.diff(T) ** 2 + Y.diff(T) ** 2 + A.diff(T) ** 2 / 3) / 2 - GRAVITY * Y,
            {LEFT: 0.3, RIGHT: 0.4, STEP: 0.4},
            surfaces={name: foot[1] >= 0 for name, foot in feet.items()},
            tangents={name: foot[0] for name, foot in feet.items()},
            friction={"left": LEFT, "right": RIGHT}, cost=1,
        )
    )  # fmt: skip


def by_stages(
    tilt: float, v: np.ndarray, mu: tuple[float, float], stages: Stages, e: float
) -> np.ndarray:
    """Impulses (P, T) of left and right where the left foot slides on, and the right one in stages:
    its sign, 0 for sticking, and what ends each of them but the last."""
    c, s = np.cos(tilt), np.sin(tilt)
    (n_l, n_r), (t_l, t_r) = np.array([[[0, 1, -c], [0, 1, c]], [[1, 0, s], [1, 0, -s]]])
    ahead, impulses, whole = np.sign(t_l @ v), np.zeros(4), np.inf
    left = n_l - mu[0] * ahead * t_l
    for slip, end in stages:
        # Beside a unit of P_r: left keeps no rate, right slides by its friction or keeps its rate.
        rest = t_r / MASS @ np.array([left, t_r, n_r]).T if not slip else [0, 1, slip * mu[1]]
        rows = np.array([n_l / MASS @ np.array([left, t_r, n_r]).T, rest])
        P_l, T_r = np.linalg.solve(rows[:, :2], -rows[:, 2])
        assert P_l > 0 and abs(T_r) < mu[1] * (1 + 1e-12)
        unit = np.array([P_l, -mu[0] * ahead * P_l, 1, T_r])
        change = (P_l * left + n_r + T_r * t_r) / MASS
        direction = t_r if end == "stop" else n_r
        P = whole - impulses[2] if end == "whole" else -(direction @ v) / (direction @ change)
        assert P >= 0
        impulses, v = impulses + P * unit, v + P * change
        if end == "compression":
            whole = (1 + e) * impulses[2]
        assert ahead * (t_l @ v) > -1e-12 and slip * (t_r @ v) > -1e-12
    return impulses


COURSES: dict[str, tuple[str, ...]] = {
    "": ("compression", "whole"), "then": ("stop", "compression", "whole"),
    "late": ("compression", "stop", "whole"),
}  # fmt: skip


def stages_of(course: str, lands: bool) -> Stages:
    first, *more = course.split(":")
    then = more[0] if more else first
    ends = COURSES["late" if "late" in more else "then" if more else ""]
    stages, slip = [], SIGNS[first]
    for end in ends:
        if lands and end == "whole":
            break
        stages.append((slip, end))
        slip = SIGNS[then] if end == "stop" else slip
    return stages


def problem(
    word: str, left: str, state: tuple[float, float, float], mu: tuple[float, float], e: float
) -> dmoc.Problem:
    """The right foot comes down on its step, about 2 ms after a state of tilt and rates of the
    middle and of the tilt."""
    tilt, ahead, turn = state
    a = tilt - 0.002 * turn
    place = {"x": 0.0, "y": np.sin(a), "a": a}
    rates = {"x_dot": ahead, "y_dot": np.cos(a) * turn, "a_dot": turn}
    return dmoc.Problem(
        plank(), start=place | rates, contacts=[f"left:{left}"], sequence=[word], steps=4,
        parameters={"mu_l": mu[0], "mu_r": mu[1], "h": 2 * np.sin(tilt)},
        restitution={"left": 0.0, "right": e},
        final_time=(5e-4, 0.1), durations=[(None, None), (5e-4, 5e-4)],
    )  # fmt: skip


WAYS = (  # course, left slides, restitution, tilt and rates, mu
    ("slip-", "slip-", 0.0, (-0.41, -0.6, -0.6), (0.2, 1.2)),
    ("slip-:stick", "slip-", 0.0, (0.09, -0.2, -1.6), (0.3, 1.2)),
    ("slip+:slip-", "slip-", 0.0, (0.38, -0.5, -1.8), (0.5, 0.3)),
    ("slip-", "slip-", 0.5, (-0.07, -0.9, -0.7), (0.3, 0.3)),
    ("slip-:stick:late", "slip-", 0.5, (-0.41, -0.6, -0.6), (0.2, 1.2)),
    ("slip+:slip-:late", "slip+", 0.5, (0.38, 1.0, -1.6), (0.5, 0.4)),
    ("slip-:slip+", "slip+", 0.5, (-0.38, 0.5, -1.6), (0.1, 0.1)),
)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["ipm", "slsqp"])
@pytest.mark.parametrize(("course", "left", "e", "state", "mu"), WAYS)
def test_a_foot_lands_or_hits_while_the_other_one_slides(
    course: str, left: str, e: float, state: tuple[float, float, float], mu: tuple[float, float],
    method: str,
) -> None:  # fmt: skip
    lands = e == 0
    stated = problem(f"{'+' * lands}right:{course}", left, state, mu, e)
    solution = answer_of(stated, method, starts=1)
    hit, before = solution.collisions[0], solution.phases[0]
    expected = by_stages(before.q[-1, 2], before.v[-1], mu, stages_of(course, lands), e)
    impulses = hit.impulses["left"], hit.tractions["left"]
    impulses += hit.impulses["right"], hit.tractions["right"]
    assert impulses == pytest.approx(expected.tolist(), rel=1e-6, abs=1e-8)
    names = "x", "y", "a"
    run = dmoc.simulate(
        plank(), {n: stated.start[n] for n in names}, {n: stated.start[f"{n}_dot"] for n in names},
        step_size=5e-5, steps=80, parameters=stated.parameters, restitution=stated.restitution,
    )  # fmt: skip
    struck = {c.surface: (c.impulse, c.tractions[c.surface]) for c in run.collisions[:2]}
    assert struck["left"] + struck["right"] == pytest.approx(expected.tolist(), rel=1e-4, abs=1e-6)


@pytest.mark.parametrize(
    ("left", "how"), [("left:stick", "stops sliding"), ("left:slip-", "turns")]
)
def test_a_foot_that_stops_or_turns_beside_a_course_is_refused(left: str, how: str) -> None:
    state = 0.38, 1.0, -1.6
    with pytest.raises(ProblemError, match=f"left {how} while right lands with friction"):
        problem(f"+right:slip+:stick {left}", "slip+", state, (0.5, 0.4), 0.0)


def test_feet_that_turn_as_both_land_are_refused() -> None:
    """When a foot turns depends on how the impulses of both grow."""
    with pytest.raises(ProblemError, match="depends on the order in which the impulses grow"):
        dmoc.Problem(
            plank(), start={"x": 0, "y": 1, "a": 0.92}, sequence=["+left:slip-:slip+ +right:slip+"],
            steps=4, final_time=1,
        )  # fmt: skip


@pytest.mark.slow
def test_the_check_tells_what_turns_as_several_land() -> None:
    landed = answer_of(falling_flat(0.1, "+left:slip+ +right:slip+"), starts=1).trajectory
    before, after = landed.phases
    v = before.v.copy()
    v[-1, 0] = -v[-1, 0]
    turned = replace(landed, phases=(replace(before, v=v), after))
    assert "left turns round in the impact at" in dmoc.verify(turned, dmoc.build(box())).message


def compass() -> dmoc.Kernels:
    """Two legs with masses at their middles and at the hip."""
    one, two, mu, nu = *dynamicsymbols("q1 q2"), *sp.symbols("mu_s mu_w")
    hip = X - sp.sin(one), Y + sp.cos(one)
    swing = hip[0] + sp.sin(two), hip[1] - sp.cos(two)
    points = ((X, Y), hip, 5), (hip, hip, 10), (swing, hip, 5)
    lagrangian: sp.Expr = sp.Integer(0)
    for foot, top, mass in points:
        x, y = ((a + b) / 2 for a, b in zip(foot, top, strict=True))
        lagrangian += mass * ((x.diff(T) ** 2 + y.diff(T) ** 2) / 2 - GRAVITY * y)
    return dmoc.build(
        dmoc.MechanicalSystem(
            "compass_on_ice", [X, Y, one, two], lagrangian, {mu: 0.05, nu: 0.3},
            surfaces={"stance": Y >= 0, "swing": swing[1] >= 0},
            tangents={"stance": X, "swing": swing[0]},
            friction={"stance": mu, "swing": nu}, cost=1,
        )
    )  # fmt: skip


@pytest.mark.slow
def test_a_gait_on_ice_steps_off_a_foot_that_slips() -> None:
    """Velocities of the start follow from momenta: what they leave of the resting gap is no
    rate."""
    start = {"x": 0, "y": 0, "q1": -0.25, "q2": 0.27}
    rates = {"x_dot": -0.3, "y_dot": 0, "q1_dot": -1.0, "q2_dot": -0.6}
    problem = dmoc.Problem(
        compass(), start=start | rates, contacts=["stance:slip-"], sequence=["+swing -stance"],
        restitution=0.0, steps=8, final_time=(1e-3, 0.5), durations=[(None, None), (0.01, 0.01)],
    )  # fmt: skip
    solution = answer_of(problem, starts=2)
    hit, before = solution.collisions[0], solution.phases[0]
    model, q, v = problem.model, before.q[-1], before.v[-1]
    D = np.array([-model.gap_slopes(q)[1, :-1], model.tangent_slopes(q)[1, :-1]])
    impulses = np.linalg.solve(D @ np.linalg.solve(model.mass(q), D.T), -D @ v)
    assert (hit.impulse, hit.tractions["swing"]) == pytest.approx(impulses.tolist(), rel=1e-6)
    run = dmoc.simulate(
        compass(), start, {n.removesuffix("_dot"): r for n, r in rates.items()}, step_size=2e-4,
        steps=round(solution.phases[-1].t[-1] / 2e-4), restitution=0.0,
    )  # fmt: skip
    assert run.collisions[0].impulse == pytest.approx(hit.impulse, rel=1e-4)
