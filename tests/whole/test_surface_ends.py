"""Surfaces that end: hits inside alone, contacts that slip off, beside closed forms and an
integration of its own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.deadline import Deadline
from dmoc.base.errors import ModelError, ProblemError, SimulationError
from dmoc.check.checked_motion import Motion
from dmoc.control.linearisation import _ends
from dmoc.mechanics.possible_words import words_after

X, Y, U, T = *dynamicsymbols("x y u"), dynamicsymbols._t
FALL = np.sqrt(2 / 9.81)  # from a height of 1


def table(name: str, within: Any, **fields: Any) -> dmoc.MechanicalSystem:
    """A mass on a table of height 1 over a floor, pushed along it."""
    return dmoc.MechanicalSystem(
        name, [X, Y], (X.diff() ** 2 + Y.diff() ** 2) / 2 - 9.81 * Y, inputs=[U], forces={X: U},
        surfaces={"table": Y >= 1, "floor": Y >= 0}, within={"table": within}, cost=U**2 / 2,
        **fields,
    )  # fmt: skip


@pytest.fixture(scope="module")
def ball() -> dmoc.MechanicalSystem:
    return table("ball_on_table", X <= 0)


def words(run: dmoc.Simulation) -> list[str]:
    return [c.word for c in run.trajectory.collisions]


def falling(x: float, v: float, **given: Any) -> dict[str, Any]:
    return {"position": {X: x, Y: 2}, "velocity": {X: v}, "step_size": 0.01, "steps": 100, **given}


def test_what_slides_off_lands_at_the_speed_times_the_time_of_its_fall(
    ball: dmoc.MechanicalSystem,
) -> None:
    run = dmoc.simulate(ball, {X: -1, Y: 1}, {X: 2}, step_size=0.01, steps=100, restitution=0.5)
    assert words(run) == ["~table", "floor"]
    off, hit = run.trajectory.collisions
    assert off.time == pytest.approx(0.5, abs=1e-12)
    assert hit.position[0] == pytest.approx(2 * FALL, abs=1e-10)
    problem = dmoc.Problem(
        ball, {X: -1, Y: 1, "x_dot": 2, "y_dot": 0}, contacts=["table"],
        sequence=["~table", "+floor"], steps=8, final_time=(0.1, 2),
    )  # fmt: skip
    solution = dmoc.solve(problem, "ipm", starts=1)
    assert solution.status.value == "solved"
    assert [c.word for c in solution.collisions] == ["~table", "+floor"]
    assert solution.collisions[0].time == pytest.approx(0.5, abs=1e-8)
    assert solution.collisions[1].position[0] == pytest.approx(2 * FALL, abs=1e-8)


def test_what_is_pushed_off_with_the_least_effort(ball: dmoc.MechanicalSystem) -> None:
    """It has to be at the end when it falls for the rest of the time: 3/(2 t^3) for a way of 1."""
    problem = dmoc.Problem(
        ball, {X: -1, Y: 1, "x_dot": 0, "y_dot": 0}, {Y: 0}, contacts=["table"],
        sequence=["~table"], steps=20, final_time=1.5,
    )  # fmt: skip
    solution = dmoc.solve(problem, "ipm", starts=1)
    assert solution.status.value == "solved"
    assert solution.cost == pytest.approx(1.5 / (1.5 - FALL) ** 3, rel=2e-3)
    falls = solution.phases[1]  # below the table's height, beside it
    planner = dmoc.Planner(problem, solution)
    assert planner.replan(float(falls.t[10]), (falls.q[10], falls.v[10])).new
    never = dmoc.solve(problem.but(bounds={U: (-1, -0.1)}), "ipm", starts=1)
    assert never.status.value == "infeasible"
    assert "misses the ends of 'table', which depend on x" in " ".join(str(never).split())


def test_a_surface_is_hit_where_it_is_alone(ball: dmoc.MechanicalSystem) -> None:
    """The last time that it may be hit is one of the end itself; just before it, between two places
    of a step, it is."""
    assert words(dmoc.simulate(ball, **falling(0.5, 0.0))) == ["floor"]
    assert words(dmoc.simulate(ball, **falling(-1.0, (1 - 1e-6) / FALL)))[0] == "table"
    assert words(dmoc.simulate(ball, **falling(-1.0, (1 + 1e-6) / FALL)))[0] == "floor"
    start = {X: -1, Y: 2, "x_dot": 2.9, "y_dot": 0}
    problem = dmoc.Problem(ball, start, sequence=["table"], steps=8, final_time=1)
    solution = dmoc.solve(problem, "ipm", starts=1)
    assert solution.status.value == "solved"
    assert abs(solution.collisions[0].position[0]) < 1e-6
    shifted = solution.trajectory.collisions[0].position
    shifted[0] += 0.01  # a hit that is planned beyond the end
    found = " ".join(str(dmoc.verify(solution.trajectory, problem.kernels)).split())
    assert "'table' is hit 0.01 beyond its end" in found


def test_nothing_comes_into_a_surface_from_beside_it(ball: dmoc.MechanicalSystem) -> None:
    below = {X: 0.5, Y: 0.5}
    with pytest.raises(SimulationError, match="comes into surface 'table' at t"):
        dmoc.simulate(ball, below, {X: -2}, step_size=0.01, steps=40)
    board = table("board", (X <= 0, Y >= 0.9))
    under = dmoc.simulate(board, below, {X: -2}, step_size=0.01, steps=40)
    assert words(under) == ["floor"]


def test_the_corner_of_a_stair() -> None:
    """Below the tread the riser is hit, at g t^2/2 below the way of the start, and beyond it the
    tread alone, where the riser ends behind it; so does a last digit of what lies on the tread."""
    (h, R), g = sp.symbols("h R"), 9.81
    stair = dmoc.build(
        dmoc.MechanicalSystem(
            "stair", [X, Y], (X.diff() ** 2 + Y.diff() ** 2) / 2 - g * Y,
            surfaces={"riser": X <= 1, "tread": h + R <= Y},
            within={"riser": h >= Y - R, "tread": X >= 1}, parameters={h: 1 / 3, R: 0.21},
        )
    )  # fmt: skip
    for up, surface in ((2.55, "riser"), (2.57, "tread")):
        for e in (0.5, 0.0):
            way = {"velocity": {X: 4, Y: up}, "step_size": 0.01, "steps": 40, "restitution": e}
            run = dmoc.simulate(stair, {X: 0, Y: 0.21}, **way)
            first = run.trajectory.collisions[0]
            assert first.surface == surface
            t = 0.25 if surface == "riser" else (up + np.sqrt(up**2 - 2 * g / 3)) / g
            assert first.time == pytest.approx(t, abs=1e-12)
            assert first.position == pytest.approx([4 * t, 0.21 + up * t - g * t**2 / 2], abs=1e-12)
            assert dmoc.verify(run.trajectory, stair).passed
    on = {X: 2, Y: np.nextafter(1 / 3 + 0.21, 0)}
    assert words(dmoc.simulate(stair, on, {X: 1}, step_size=0.01, steps=10)) == []
    dmoc.Problem(stair, {**on, "x_dot": 1, "y_dot": 0}, contacts=["tread"], steps=4)


def test_ends_on_both_sides_and_ends_that_move() -> None:
    for v, at in ((-1, 0), (1, 1)):
        strip = table("strip", sp.And(X >= 0, X <= 1))
        run = dmoc.simulate(strip, {X: 0.5, Y: 1}, {X: v}, step_size=0.01, steps=70)
        assert words(run) == ["~table"]
        assert run.trajectory.collisions[0].position[0] == pytest.approx(at, abs=1e-12)
    drawn = table("drawn_out", X <= T / 2)
    run = dmoc.simulate(drawn, {X: -1, Y: 1}, {X: 2}, step_size=0.01, steps=80)
    assert run.trajectory.collisions[0].time == pytest.approx(1 / 1.5, abs=1e-12)


def test_a_way_round_a_corner_is_that_through_it() -> None:
    """From rest to rest with the least effort of both inputs: two cubics that meet at the corner
    with the velocity and the acceleration in common, at the best of all times."""
    V = dynamicsymbols("v")
    flown = dmoc.MechanicalSystem(
        "flown", [X, Y], (X.diff() ** 2 + Y.diff() ** 2) / 2, inputs=[U, V], forces={X: U, Y: V},
        surfaces={"table": Y >= 1}, within={"table": X <= 0}, cost=U**2 + V**2,
    )  # fmt: skip
    ends = {X: -1, Y: 1.2, "x_dot": 0, "y_dot": 0}, {X: 0.1, Y: -0.5, "x_dot": 0, "y_dot": 0}
    problem = dmoc.Problem(flown, *ends, final_time=1, steps=100)
    solution = dmoc.solve(problem, "ipm", starts=4)

    def least(t: float) -> float:
        """Integral of the squared second derivatives of the spline through the corner at t."""
        total = 0.0
        for a, b, c in ((-1, 0, 0.1), (1.2, 1, -0.5)):
            first, last = 3 * (b - a) / t**2, 3 * (c - b) / (1 - t) ** 2
            v = (first + last) / (2 / t + 2 / (1 - t))
            for p, q, u, w, h in ((a, b, 0, v, t), (b, c, v, 0, 1 - t)):
                s = (q - p) / h
                total += 4 / h * (u**2 + u * w + w**2 - 3 * s * (u + w) + 3 * s**2)
        return total

    best = min(map(least, np.linspace(0.2, 0.8, 601)))
    assert solution.cost == pytest.approx(best, rel=0.05)
    assert solution.cost < best  # a chord cuts the corner


def test_a_carton_tips_over_an_edge() -> None:
    """Its base is the surface, which ends at its corners. It turns about the edge, slides, and
    leaves where the normal force vanishes, as an integration of its own says."""
    x, y, a = dynamicsymbols("x y a")
    b, k, mu, beyond, g = 0.3, 0.2, 0.4, 0.05, 9.81
    s, n = -x * sp.cos(a) - y * sp.sin(a), x * sp.sin(a) - y * sp.cos(a)
    inertia = (b**2 + k**2) / 3
    carton = dmoc.MechanicalSystem(
        "carton", [x, y, a], (x.diff() ** 2 + y.diff() ** 2 + inertia * a.diff() ** 2) / 2 - g * y,
        surfaces={"edge": n <= -k}, within={"edge": (s >= -b, s <= b)}, tangents={"edge": -s},
        friction={"edge": mu},
    )  # fmt: skip
    run = dmoc.simulate(carton, {x: beyond, y: k}, step_size=0.02, steps=25)
    assert words(run) == ["edge:slip+", "-edge"]

    def motion(z: Any, slides: bool) -> Any:
        """Accelerations of the place d along the base and the angle, and forces N and T."""
        d, angle, rate, turn = z
        down, along = -g * np.cos(angle), -g * np.sin(angle)
        A = np.array([[1, -k, 0, -1], [0, d, -1, 0], [0, inertia, d, -k], [1, 0, 0, 0.0]])
        A[3] = [0, 0, mu, 1] if slides else A[3]
        B = [along + d * turn**2, down - 2 * rate * turn + k * turn**2, 0, 0]
        return np.linalg.solve(A, B)

    def until(z: Any, t: float, slides: bool) -> Any:
        def left(_: float, z: Any) -> float:
            *_, N, T = motion(z, slides)
            return float(N if slides else mu * N - abs(T))

        left.terminal = True  # type: ignore[attr-defined]
        way = solve_ivp(
            lambda _, z: [*z[2:], *motion(z, slides)[:2]], (t, t + 1), z, events=left,
            rtol=1e-11, atol=1e-12,
        )  # fmt: skip
        return way.y[:, -1], float(way.t[-1])

    z, t = until([beyond, 0, 0, 0], 0.0, False)
    slips, leaves = run.trajectory.collisions
    assert (slips.time, slips.position[2]) == pytest.approx((t, z[1]), abs=1e-8)
    z, t = until(z, t, True)
    assert (leaves.time, leaves.position[2]) == pytest.approx((t, z[1]), abs=1e-8)


def test_down_two_steps_with_the_least_effort(tmp_path: Path) -> None:
    """All of the way is pushed, so that the last end alone decides: 3 d^2/(2 t^3)."""
    stairs = dmoc.MechanicalSystem(
        "stairs", [X, Y], (X.diff() ** 2 + Y.diff() ** 2) / 2 - 9.81 * Y, inputs=[U], forces={X: U},
        surfaces={"top": Y >= 2, "middle": Y >= 1}, within={"top": X <= 0, "middle": X <= 1.5},
        cost=U**2 / 2,
    )  # fmt: skip
    problem = dmoc.Problem(
        stairs, {X: -1, Y: 2, "x_dot": 0, "y_dot": 0}, {Y: 0}, contacts=["top"],
        sequence=["~top", "+middle", "~middle"], steps=12, final_time=3,
    )  # fmt: skip
    solution = dmoc.solve(problem, "ipm", starts=1)
    assert solution.status.value == "solved"
    assert solution.iterations < 20  # nodes come to the very corner, where kernels are numbers
    assert solution.cost == pytest.approx(1.5 * 2.5**2 / (3 - FALL) ** 3, rel=1e-3)
    solution.save(tmp_path / "stairs.npz")
    assert dmoc.Solution.load(tmp_path / "stairs.npz").collisions[2].word == "~middle"


def test_proposals_see_what_slips_off(ball: dmoc.MechanicalSystem) -> None:
    there = dmoc.Problem(
        ball, {X: -1, Y: 1, "x_dot": 0, "y_dot": 0}, {X: 0.5, Y: 0}, contacts=["table"], steps=12,
        final_time=1.5, restitution=0,
    )  # fmt: skip
    found = dmoc.search(there, strategy="propose", starts=4)
    assert found.best is not None
    assert found.best.sequence == ("~table",)


def test_a_slip_off_happens_earlier_where_the_motion_is_ahead(ball: dmoc.MechanicalSystem) -> None:
    """The deviation of the time is that of the place over the speed."""
    start = {X: -1, Y: 1, "x_dot": 2, "y_dot": 0}
    problem = dmoc.Problem(
        ball, start, {X: 1.2}, contacts=["table"], sequence=["~table"], steps=10, final_time=0.9
    )
    solution = dmoc.solve(problem, "ipm", starts=1)
    motion = Motion.of(solution.trajectory, problem.kernels, Deadline.after(None))
    at = motion.trajectory.collisions[0]
    function = _ends(motion, 0)
    assert function is not None
    y = np.concatenate([at.position, [2.0, 0.0]])
    ahead = y[None] + np.array([[0.01, 0, 0, 0]])
    assert function(ahead, np.zeros((1, 1)), np.array([at.time]))[0, 0] == pytest.approx(-0.01)
    motion.flow.allowance = lambda t: np.zeros((len(t), 2))
    contacts: list[Any] = []  # from there on nothing is met
    motion.flow.through_contacts(y, motion.steps[1], 0, contacts)
    assert not contacts


@pytest.mark.parametrize(
    ("ground", "jumps"),
    [
        (sp.Piecewise((1, X < 0), (0, True)), True),
        (sp.Piecewise((0, X < 1), ((X - 1) / 2, True)), False),
        (sp.Piecewise((0, X < 1), (X / 2, True)), True),
    ],
)
def test_a_gap_of_pieces_does_not_jump(ground: Any, jumps: bool) -> None:
    fields = [X, Y], X.diff() ** 2 + Y.diff() ** 2
    if not jumps:
        assert dmoc.MechanicalSystem("pieces", *fields, surfaces={"ground": ground <= Y}).gaps
        return
    with pytest.raises(ModelError, match="surface 'ground' jumps where x = "):
        dmoc.MechanicalSystem("pieces", *fields, surfaces={"ground": ground <= Y})


def test_words_of_ends(ball: dmoc.MechanicalSystem) -> None:
    problem = dmoc.Problem(ball, {X: -1, Y: 1, "x_dot": 0, "y_dot": 0}, contacts=["table"], steps=4)
    (mode,), contacts = problem.touch.modes, problem.touch.contacts
    assert "~table" in words_after(mode, contacts, contacts.surfaces)
    assert problem.but(sequence=["~table"]).touch.events[0].off == (0,)
    for sequence, text in (
        (["~floor"], "'~floor' in the sequence slips off an end of 'floor', which has none"),
        (["~table", "~table"], "table leaves, but is not closed then"),
        (["~table:slip+"], "expected stick, slip"),
    ):
        with pytest.raises(ProblemError, match=text):
            problem.but(sequence=sequence)
    with pytest.raises(ProblemError, match=r"closed at the start \(x=0.5\), which is beyond"):
        problem.but(start={X: 0.5, Y: 1, "x_dot": 0, "y_dot": 0})
    beyond = dmoc.solve(problem.but(goal={X: 0.5}, final_time=1), "ipm", starts=1)
    assert beyond.status.value == "infeasible"
    problem.but(start={X: 0.5, Y: 0.5}, contacts=[])  # below the table, beside it


@pytest.mark.parametrize(
    ("within", "text"),
    [
        (X.diff() >= 0, "one of the velocities: expected coordinates, the time and parameters"),
        (U >= 0, "an end of surface 'table' contains u.t., one of the inputs"),
        (X, "an end of surface 'table' is not an inequality"),
        ((), "within says nothing of surface 'table'"),
    ],
)
def test_what_is_no_end(within: Any, text: str) -> None:
    with pytest.raises(ModelError, match=text):
        table("endless", within)
    with pytest.raises(ModelError, match="within says where 'wall' is, which is no surface"):
        dmoc.MechanicalSystem(
            "no_wall", [X], X.diff() ** 2, surfaces={"table": X >= 0}, within={"wall": X >= 0}
        )
