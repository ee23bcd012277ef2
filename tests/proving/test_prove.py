"""dmoc.prove on problems whose best motions are known, and on those that have none."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import sympy as sp
from scipy.optimize import minimize
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.models.registry import find
from dmoc.proving.global_proof import Claim
from dmoc.proving.linear_problem import linear_problem
from dmoc.proving.prove import _claim

t = dynamicsymbols._t
x, u, v = dynamicsymbols("x u v")


@pytest.fixture(scope="module")
def block() -> Kernels:
    """A block of 1 kg between walls."""
    walls = {"right": x <= 1, "left": x >= 0}
    return dmoc.build(system("between", surfaces=walls), order=4)


def system(name: str, potential: Any = 0, cost: Any = u**2 / 2, **more: Any) -> Any:
    return dmoc.MechanicalSystem(
        name, [x], x.diff(t) ** 2 / 2 - potential, cost=cost,
        **{"surfaces": {"right": x <= 1}, "inputs": [u], "forces": {x: u}, **more},
    )  # fmt: skip


def through(kernels: Kernels, places: list[float], e: float, **more: Any) -> dmoc.Problem:
    """From rest to rest through hits at places, the first and the last of which are no hits."""
    return dmoc.Problem(
        kernels,
        start={"x": places[0]}, goal={"x": places[-1], "x_dot": 0.0},
        sequence=["right" if place == 1 else "left" for place in places[1:-1]],
        **{"steps": 6, "final_time": 1.0, "restitution": e, **more},
    )  # fmt: skip


@pytest.mark.parametrize(
    ("places", "e", "cost"),
    [
        ([0.0, 1, 0.0], 1.0, 24.0),
        ([0.0, 1, 0.0], 0.8, 24.58630915),
        ([0.0, 1, 0.0], 0.0, 50.95584412),
        ([0.3, 1, 0, 0.6], 0.8, 32.89248634),
    ],
)
def test_known_optima_are_proved(
    block: Kernels, places: list[float], e: float, cost: float
) -> None:
    proof = dmoc.prove(through(block, places, e))
    assert proof.claim is Claim.OPTIMAL and proof.proved and proof.waiting == 0
    assert proof.cost == pytest.approx(cost, rel=1e-7)
    assert cost * (1 - 1e-4) <= proof.bound <= cost * (1 + 1e-9)


def test_three_hits_are_unfolded() -> None:
    """East, north, west: the motion is a free one in the mirrored table."""
    reference = find("puck_table")
    fields = {**reference.defaults, "sequence": ("east", "north", "west"), "steps": 2}
    proof = dmoc.prove(dmoc.Problem(reference.kernels(4), **fields), gap=0.3)
    assert proof.claim is Claim.OPTIMAL
    assert 0.7 * 0.415 <= proof.bound <= 0.415 * (1 + 1e-9)


def test_landing_in_between(block: Kernels) -> None:
    """To stay at the wall brings nothing: it does so for as short as a phase may be, a thousandth
    of the time, which leaves less for the way. Costs of this kind go with its third power."""
    cost = 50.95584412 / 0.999**3
    problem = through(block, [0.0, 1, 0.0], 0.0)
    proof = dmoc.prove(problem.but(sequence=["+right", "-right"]))
    assert cost * (1 - 1e-4) <= proof.bound <= cost * (1 + 1e-9)
    assert proof.left_out == ()


def test_spring_and_damper_beside_many_durations() -> None:
    """The bound is below the best of the program at any durations, and near it at the best."""
    shaken = system("shaken", 20 * x**2, dissipation=x.diff(t) ** 2 / 4)
    problem = dmoc.Problem(
        dmoc.build(shaken, order=2), start={"x": 0.2, "x_dot": 1.0}, goal={"x": 0.0, "x_dot": 0.0},
        sequence=["right"], restitution=0.5, final_time=1.5, steps=12,
    )  # fmt: skip
    proof = dmoc.prove(problem)
    assert proof.claim is Claim.OPTIMAL
    for first in (0.3, 0.6, 0.9, 1.2):
        held = problem.but(durations=[first, 1.5 - first]).in_rates()
        assert dmoc.solve(held, starts=1).cost >= proof.bound


def test_a_start_within_ranges_is_chosen(block: Kernels) -> None:
    """Least of the cost of two free motions with given ends, in place and speed at the start, speed
    of the hit and its time; the place is chosen inside its range, the speed at its end."""

    def cost(z: Any) -> float:
        place, speed, hit, T = z
        ways = (1 - place, speed, hit, T), (-1, -0.8 * hit, 0, 1 - T)
        means = ((a - d / t, b - d / t, t) for d, a, b, t in ways)
        return float(sum(2 * (a * a + a * b + b * b) / t for a, b, t in means))

    bounds = [(0, 0.5), (-2, 0.0), (0, 9), (0.1, 0.9)]
    least = minimize(cost, [0.3, -1, 3, 0.4], bounds=bounds, tol=1e-14).fun
    problem = through(block, [0.0, 1, 0.0], 0.8, steps=4)
    proof = dmoc.prove(problem.but(start={"x": (0, 0.5), "x_dot": (-2, 0)}))
    assert proof.claim is Claim.OPTIMAL
    assert least * (1 - 1e-4) <= proof.bound <= least * (1 + 1e-7)


def test_periodic_motion() -> None:
    """A ball that bounces once in a second and is pushed so that it does so for ever: it comes down
    with w and goes up with e w, and integrating (a + g)^2 / 2 by parts gives a parabola in w."""
    g, e = 9.81, 0.8
    falls = system("falls", sp.Rational(981, 100) * x, surfaces={"left": x >= 0})
    problem = dmoc.Problem(
        dmoc.build(falls, order=4), start={"x": 0.3, "x_dot": (-9, 9)}, periodic=["x", "x_dot"],
        sequence=["left"], restitution=e, final_time=1, steps=4,
    )  # fmt: skip
    cost = g * g / 2 - (g * (1 + e)) ** 2 / (8 * (e * e - e + 1))
    proof = dmoc.prove(problem)
    assert proof.claim is Claim.OPTIMAL
    assert cost * (1 - 1e-4) <= proof.bound <= cost * (1 + 1e-7)


@pytest.fixture(scope="module")
def hammer() -> Kernels:
    """A hammer of 1 kg, and a nail on a spring and a damper."""
    s = dynamicsymbols("s")
    m, k, c = sp.symbols("m k c")
    system = dmoc.MechanicalSystem(
        "hammer", [x, s], (x.diff(t) ** 2 + m * s.diff(t) ** 2 - k * s**2) / 2, inputs=[u],
        forces={x: u}, dissipation=c * s.diff(t) ** 2 / 2, surfaces={"nail": x <= s},
        cost=u**2 / 2, parameters={m: 0.1, k: 500.0, c: 5.0},
    )  # fmt: skip
    return dmoc.build(system, order=4)


@pytest.mark.parametrize("final_time", [3.0, (1.0, 6.0)])
def test_goals_that_decide_a_duration_are_proved(hammer: Kernels, final_time: Any) -> None:
    """What is hit has 4 m to roll at 2 m/s, which takes it 2 s and no other time. The speed v of
    the hit follows, and its time T alone is left to choose."""
    rolling = {"m": 1.0, "k": 0.0, "c": 0.0}
    problem = dmoc.Problem(
        hammer, start={"x": 0.0, "s": 1.0}, goal={"s": 5.0, "s_dot": 2.0}, sequence=["nail"],
        final_time=final_time, restitution=0.5, parameters=rolling, steps=3,
    )  # fmt: skip
    v, T = 2 / 0.75, np.linspace(0.5, 4.0, 3501) if final_time != 3.0 else np.ones(1)
    cost = (6 / T**3 - 6 * v / T**2 + 2 * v**2 / T).min()
    proof = dmoc.prove(problem)
    assert proof.claim is Claim.OPTIMAL
    assert cost * (1 - 1e-4) <= proof.bound <= cost * (1 + 1e-7)
    assert proof.boxes < 1000


def test_hammer_and_nail(hammer: Kernels) -> None:
    """The nail is at rest at its deepest place alone; the hammer has to stay behind it until then.
    The cost is half of that of the ladder of published problems."""
    problem = dmoc.Problem(
        hammer, start={"x": -0.3, "s": 0.0}, goal={"s": 0.02, "s_dot": 0.0}, sequence=["nail"],
        final_time=(0.2, 1.0), durations=[None, (0.01, 0.1)], restitution=0.3, steps=4,
    )  # fmt: skip
    proof = dmoc.prove(problem)
    assert proof.claim is Claim.OPTIMAL
    assert proof.bound == pytest.approx(62.49558 / 2, rel=2e-4)


def test_surfaces_that_are_left_count_from_the_second_step_on(block: Kernels) -> None:
    """Where contact opens, the gap of the first step is an error of the step."""
    problem = through(block, [0.0, 1, 0.0], 0.0).but(sequence=["+right", "-right"])
    since = [phase.since.tolist() for phase in linear_problem(problem).phases]
    assert since == [[0.0, 0.0], [], [1.0, 0.0]]


def test_places_inside_steps_keep_their_bounds() -> None:
    """Forces that are linear in each of two steps are four numbers, x is a cubic polynomial, and of
    the places inside the steps one meets the ceiling: a quadratic program of two equations."""
    kernels = dmoc.build(system("ceiling", surfaces={"ceiling": x <= 0.3}), order=6)
    problem = dmoc.Problem(
        kernels, start={"x": 0.0, "x_dot": 2.0}, goal={"x": 0.0}, sequence=[], steps=2,
        final_time=1,
    )  # fmt: skip
    h = 0.5
    met = h * (1 + 5**-0.5) / 2

    def pushed(to: float, length: float) -> list[float]:
        """What 1 and s on a step of some length, which began ``to`` before, do to the place."""
        return [to * length - length**2 / 2, to * length**2 / 2 - length**3 / 3]

    A = np.array([[*pushed(1.0, h), *pushed(h, h)], [*pushed(met, met), 0.0, 0.0]])
    R = np.kron(np.eye(2), [[h, h**2 / 2], [h**2 / 2, h**3 / 3]])
    b = np.array([-2.0, 0.3 - 2 * met])
    cost = b @ np.linalg.solve(A @ np.linalg.solve(R, A.T), b) / 2
    proof = dmoc.prove(problem)
    assert proof.claim is Claim.OPTIMAL and proof.left_out == ()
    assert proof.cost == pytest.approx(cost, rel=1e-7)
    assert cost * (1 - 1e-4) <= proof.bound <= cost * (1 + 1e-9)


def test_inputs_that_are_linear_between_nodes() -> None:
    """Of both halves of the impulse at a node their sum counts: with four steps these are rows of a
    quadratic program with the impulses of five nodes in a phase."""
    h, d = 0.25, np.arange(4, -1, -1) * 0.25
    A = h * np.vstack([np.ones(5), d]) * [0.5, 1, 1, 1, 0.5]
    b, R = np.array([0.0, 1.0]), h * np.diag([0.5, 1, 1, 1, 0.5])
    cost = b @ np.linalg.solve(A @ np.linalg.solve(R, A.T), b) / 2
    problem = dmoc.Problem(
        dmoc.build(system("twice"), order=2), start={"x": 0.0}, goal={"x": 1.0, "x_dot": 0.0},
        sequence=[], steps=4, final_time=1, controls="linear",
    )  # fmt: skip
    assert dmoc.solve(problem, starts=1).cost == pytest.approx(cost, rel=1e-7)
    proof, weaker = dmoc.prove(problem), dmoc.prove(problem.but(bounds={"u": (-4.8, 4.8)}))
    assert proof.claim is weaker.claim is Claim.OPTIMAL and weaker.left_out == ()
    assert cost * (1 - 1e-4) <= proof.bound <= cost * (1 + 1e-7) < weaker.bound


def test_wall_that_moves_evenly(block: Kernels) -> None:
    """Seen from a wall that moves, the motion begins and ends with its speed, which costs what the
    problem at rest costs with these ends."""
    moving = dmoc.build(system("moving", surfaces={"right": x <= 1 + t / 2}), order=4)
    ends = {"goal": {"x": 0.5, "x_dot": 0.5}, "start": {"x": 0.0, "x_dot": 0.5}}
    proof = dmoc.prove(through(moving, [0.0, 1, 0.0], 0.8).but(**ends))
    assert proof.cost == pytest.approx(24.58630915, rel=1e-7)
    assert proof.claim is Claim.OPTIMAL
    assert proof.bound <= proof.cost * (1 + 1e-7)


def test_ctrl_c_keeps_what_was_bounded(block: Kernels) -> None:
    def interrupted(_: Any) -> None:
        raise KeyboardInterrupt

    proof = dmoc.prove(through(block, [0.3, 1, 0, 0.6], 0.8), progress=interrupted)
    assert proof.claim is Claim.OPEN and proof.waiting > 0
    assert proof.cost == pytest.approx(32.89248634, rel=1e-7)


def test_a_motion_that_costs_nothing_is_the_best(block: Kernels) -> None:
    start = {"x": 0.0, "x_dot": 2.0}
    proof = dmoc.prove(through(block, [0.0, 1, 0.0], 1.0).but(start=start, goal={"x": 0.0}))
    assert proof.claim is Claim.OPTIMAL
    assert proof.cost == pytest.approx(0.0, abs=1e-12) and proof.gap == 0.0


def test_bounds_that_contradict_a_motion_are_no_proof() -> None:
    from types import SimpleNamespace

    def claim(bound: float, cost: float) -> Claim:
        branch: Any = SimpleNamespace(bound=bound, best=cost)
        motion: Any = SimpleNamespace(cost=cost) if cost < np.inf else None
        return _claim(branch, motion, (1e-4, 0.0, 9.0), False)

    assert claim(9.0, np.inf) is Claim.IMPOSSIBLE
    # Durations that are fixed leave one box, whose bound may be too low to say anything.
    assert claim(8.99, np.inf) is claim(0.0, np.inf) is claim(np.nan, np.inf) is Claim.OPEN

    assert claim(0.99995, 1.0) is Claim.OPTIMAL
    assert claim(0.9998, 1.0) is Claim.OPEN
    with pytest.raises(dmoc.DmocError, match="below the bound"):
        claim(1.001, 1.0)


def test_shortest_time_of_bounded_inputs() -> None:
    """A cost without curvature: with a force of at most 1 N the way to the wall takes sqrt(2) s,
    and the way back, at e = 1, as long."""
    quick = dmoc.build(system("quick", cost=sp.Integer(1)), order=2)
    problem = through(quick, [0.0, 1, 0.0], 1.0, final_time=(0.5, 6.0), steps=8)
    proof = dmoc.prove(problem.but(bounds={"u": (-1, 1)}), gap=0.02)
    assert proof.claim is Claim.OPTIMAL
    assert 0.98 * np.sqrt(8) <= proof.bound <= np.sqrt(8) * (1 + 1e-9)


@pytest.mark.parametrize(
    ("change", "statement"),
    [
        ({"bounds": {"u": (-5, 5)}}, "no motion of the discrete program of 6 + 6 steps"),
        # The place can be reached, but not so fast: v^2 is at most 2 * 20 before the hit, 0.64 of
        # that after it, and a force to the wall only makes it slower.
        (
            {
                "bounds": {"u": (0, 20)},
                "goal": {"x": 0.0, "x_dot": -5.1},
                "final_time": (0.1, 2.0),
            },
            "has this sequence",
        ),
    ],
)
def test_impossible_sequences_are_proved(
    block: Kernels, change: dict[str, Any], statement: str
) -> None:
    proof = dmoc.prove(through(block, [0.0, 1, 0.0], 0.8).but(**change))
    assert proof.claim is Claim.IMPOSSIBLE and proof.solution is None and proof.proved
    assert statement in proof.statement
    assert "impossible (proved)" in str(proof)


def test_bounds_of_coordinates_hold_at_events(block: Kernels) -> None:
    """A wall that is out of bounds is hit by no motion."""
    problem = through(block, [0.3, 1, 0.2], 0.8, bounds={"x": (None, 0.95)})
    assert dmoc.prove(problem).claim is Claim.IMPOSSIBLE


def test_inputs_that_just_suffice_are_not_impossible(block: Kernels) -> None:
    """The weakest force that brings it to the wall and back is near 8 N: what a solve reaches, a
    proof does not rule out."""
    problem = through(block, [0.0, 1, 0.0], 0.8, controls="constant")
    for force in (8.6, 9.0):
        held = problem.but(bounds={"u": (-force, force)})
        if dmoc.solve(held).converged:
            assert dmoc.prove(held, gap=1e-2).claim is not Claim.IMPOSSIBLE


def test_time_that_runs_out_is_gone_on_with(block: Kernels, tmp_path: Any) -> None:
    problem, journal = through(block, [0.3, 1, 0, 0.6], 0.8, steps=3), tmp_path / "left.npz"
    whole = dmoc.prove(problem, gap=1e-2)
    first = dmoc.prove(problem, gap=1e-2, seconds=0.05, journal=journal)
    then = dmoc.prove(problem, gap=1e-2, journal=journal)
    assert whole.claim is then.claim is Claim.OPTIMAL
    assert then.bound == pytest.approx(whole.bound, rel=1e-6)
    assert first.waiting == 0 or first.claim is Claim.OPEN
    with pytest.raises(dmoc.DmocError, match="that of another proof"):
        dmoc.prove(problem.but(restitution=0.7), gap=1e-2, journal=journal)
    journal.write_bytes(b"none")
    with pytest.raises(dmoc.DmocError, match="is no journal of a proof"):
        dmoc.prove(problem, gap=1e-2, journal=journal)


def refused(problem: dmoc.Problem, **options: Any) -> str:
    with pytest.raises(dmoc.DmocError) as error:
        dmoc.prove(problem, **options)
    return str(error.value)


@pytest.mark.parametrize("wrong", ["journal", "progress"])
def test_what_does_not_fit_is_refused_before_anything_is_solved(
    block: Kernels, monkeypatch: pytest.MonkeyPatch, wrong: str
) -> None:
    monkeypatch.setattr("dmoc.proving.prove._solved", None)
    assert refused(through(block, [0.3, 1, 0, 0.6], 0.8), **{wrong: 3}).startswith(f"{wrong} = 3")


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda p: p.but(final_time=(0.1, None)), "a final time without an upper bound"),
        (lambda p: p.but(start={"x": None}), "the start of x is free"),
        (lambda p: p.but(start={"x": 0, "x_dot": None}), "a velocity at the start is free"),
        (lambda p: p.but(sequence=["right"] * 12), "13 phases: proofs take at most 10"),
    ],
)
def test_what_is_not_covered_is_refused(
    block: Kernels, change: Callable[[dmoc.Problem], dmoc.Problem], sentence: str
) -> None:
    assert sentence in refused(change(through(block, [0.0, 1, 0.0], 0.8)))


def test_bad_options_are_refused(block: Kernels) -> None:
    problem = through(block, [0.0, 1, 0.0], 0.8)
    assert "gap = 0" in refused(problem, gap=0)
    assert "seconds = -1" in refused(problem, seconds=-1)
    assert "workers = 0: expected a whole number of at least 1" in refused(problem, workers=0)


@pytest.mark.parametrize(
    ("name", "potential", "more", "sentence"),
    [
        ("cubic", x**4, {}, "the force is no affine function of x"),
        ("heavier", -(x * x.diff(t) ** 2), {}, "the mass matrix depends on x"),
        ("round_wall", 0, {"surfaces": {"right": x**2 <= 1}}, "the gap to right is no affine"),
        ("quartic", 0, {"cost": u**4}, "the cost is no quadratic function"),
        ("unpaid", 0, {"cost": sp.Integer(1)}, "the input u has neither a cost of its own nor"),
        ("dearer", 0, {"cost": (2 - t) * u**2}, "the cost depends on the time"),
        ("pushed", 0, {"forces": {x: u + t}}, "the equations of motion depend on the time"),
        ("growing", -t * x.diff(t) ** 2 / 9, {}, "the equations of motion depend on the time"),
    ],
)
def test_what_is_not_linear_is_refused_by_name(
    name: str, potential: Any, more: dict[str, Any], sentence: str
) -> None:
    kernels = dmoc.build(system(name, potential, **more), order=2, backend="numpy")
    assert sentence in refused(through(kernels, [0.0, 1, 0.0], 0.8))


@pytest.mark.parametrize(
    ("cost", "sentence"),
    [
        ((u + v) ** 2, "the cost is the same for several combinations of its inputs"),
        (u**2 + u * v / 1e5, "the cost is not convex in the inputs"),
        (u**2 + v**2 - 3 * u * v, "the cost is not convex in the inputs"),
        (u**2 + (v / 1e9) ** 4, "the cost is no quadratic function"),
    ],
)
def test_costs_of_several_inputs_that_have_no_bound_are_refused(cost: Any, sentence: str) -> None:
    two = system("two_inputs", cost=cost, inputs=[u, v], forces={x: u + v})
    kernels = dmoc.build(two, order=2, backend="numpy")
    bounds = {"u": (-90, 90), "v": (-90, 90)}
    assert sentence in refused(through(kernels, [0.0, 1, 0.0], 0.8, bounds=bounds))


def test_inputs_in_small_units_have_a_cost() -> None:
    """The other input costs nothing beside it in numbers, and does as much."""
    cost = u**2 / 2 + (v / 1e7) ** 2 / 2
    two = system("small_units", cost=cost, inputs=[u, v], forces={x: (u + v / 1e7) / sp.sqrt(2)})
    proof = dmoc.prove(through(dmoc.build(two, order=4), [0.0, 1, 0.0], 1.0))
    assert proof.claim is Claim.OPTIMAL
    assert proof.cost == pytest.approx(24.0, rel=1e-7)
