"""What a trial found to be solved and wrong, or right and not solved: none of it passes any
more."""

from __future__ import annotations

from math import pi, sin

import numpy as np
import pytest
import sympy as sp
from answers import answer_of
from methods import INSTALLED
from sympy.physics.mechanics import dynamicsymbols
from systems import block_system, there_and_back, unit_mass

import dmoc
from dmoc.base.errors import ProblemError
from dmoc.problem.contacts import contact_point, crossings, onto_surface
from dmoc.program.transcription import Transcription

pytestmark = pytest.mark.slow

T = dynamicsymbols._t


def arm_system(name: str = "arm_with_stop") -> dmoc.MechanicalSystem:
    """Two links that hang in gravity, the first with a stop."""
    a, b, u1, u2 = dynamicsymbols("a b u1 u2")
    m1, m2, l1, l2, g, stop = sp.symbols("m1 m2 l1 l2 g stop")
    first, second = l1 * a.diff(), l2 * b.diff()
    upper = first**2 / 2 + g * l1 * sp.cos(a)
    lower = upper + second**2 / 2 + first * second * sp.cos(a - b) + g * l2 * sp.cos(b)
    return dmoc.MechanicalSystem(
        name, [a, b], m1 * upper + m2 * lower,
        {m1: 1.0, m2: 1.0, l1: 1.0, l2: 1.0, g: 9.81, stop: 1.0}, [u1, u2], {a: u1 - u2, b: u2},
        {"stop": a <= stop}, u1**2 + u2**2,
    )  # fmt: skip


def random_arm(seed: int, order: int, steps: int) -> dmoc.Problem:
    r = np.random.default_rng(seed)
    parameters = {
        name: r.uniform(*box)
        for name, box in (
            ("m1", (0.5, 2)),
            ("m2", (0.5, 2)),
            ("l1", (0.5, 1.5)),
            ("l2", (0.5, 1.5)),
            ("stop", (0.5, 1.5)),
        )
    }
    return dmoc.Problem(
        dmoc.build(arm_system(), order=order),
        start={"a": r.uniform(-1, 0.3), "b": r.uniform(-1, 1)},
        goal={"a": r.uniform(-1, 0.3), "b": r.uniform(-1, 1), "a_dot": 0, "b_dot": 0},
        sequence=["stop"], steps=steps, final_time=r.uniform(0.7, 2), parameters=parameters,
        restitution=r.choice([1, 0.8, 0.5, 0.0]),
    )  # fmt: skip


# Collisions that are none -------------------------------------------------------------------------


@pytest.mark.parametrize(("seed", "order"), [(0, 2), (2, 4)])
def test_a_collision_obeys_the_law_of_impact(seed: int, order: int) -> None:
    """w+ = -e w-."""
    problem = random_arm(seed, order, 80 if order == 2 else 20)
    solution = dmoc.solve(problem, "ipm", starts=1)
    (hit,) = solution.collisions
    assert solution.status == "solved" and not hit.grazes
    assert hit.rate_before > 0 >= hit.rate_after
    law = -problem.restitution_values[0] * hit.rate_before
    assert hit.rate_after == pytest.approx(law, rel=0.05, abs=1e-9)
    stays_before_the_stop(problem, solution)


@pytest.mark.parametrize("order", [2, 4])
def test_an_input_on_another_body_buys_no_restitution(order: int) -> None:
    """Nothing drives the ball b, which comes back from its wall with half of its rate: at the
    latest time it is at 2 - 0.939 (1.822 - 0.632/1.878) = 0.605, and cannot be at 0.575."""
    a, b, u = dynamicsymbols("a b u")
    system = dmoc.MechanicalSystem(
        "beside", [a, b], (a.diff() ** 2 + 2 * b.diff() ** 2) / 2, {}, [u], {a: u},
        surfaces={"wall": b <= 2}, cost=u**2 / 2,
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(system, order=order), start={a: 0.7, b: 1.368, "a_dot": -0.788, "b_dot": 1.878},
        goal={b: (0.425, 0.575)}, sequence=["wall"], restitution=0.5, steps=12,
        final_time=(0.5, 1.822),
    )  # fmt: skip
    assert dmoc.solve(problem, "ipm", starts=2).status == "infeasible"
    later = problem.but(final_time=(0.5, 1.9))
    assert dmoc.solve(later, "ipm", starts=1).collisions[0].rate_after == pytest.approx(-0.939)


@pytest.mark.parametrize(("seed", "order"), [(22, 4), (34, 2), (42, 4)])
def test_a_collision_without_effect_is_called_a_graze(seed: int, order: int) -> None:
    """The optimum would rather not collide: it touches, and says so."""
    problem = random_arm(seed, order, 40 if order == 2 else 20)
    solution = dmoc.solve(problem, "ipm", starts=1)
    (hit,) = solution.collisions
    assert solution.status == "grazes" and hit.grazes and not solution.solved
    assert hit.impulse == 0 and "collision 1 (stop) has no effect" in solution.message
    assert abs(hit.rate_before) + abs(hit.rate_after) < 1e-9
    stays_before_the_stop(problem, solution)


def stays_before_the_stop(problem: dmoc.Problem, solution: dmoc.Solution) -> None:
    gaps = np.concatenate([p.q[:, 0] for p in solution.phases]) - problem.parameter_values[0][-1]
    assert gaps.max() <= 1e-9
    assert solution.verification is not None and solution.verification.penetration < 2e-3


def test_a_graze_needs_no_more_than_the_motion_that_may_touch() -> None:
    """A touch costs what the same problem costs with a tangential contact, and more than without
    any."""
    problem = random_arm(22, 4, 20)
    touching, free = (
        dmoc.solve(problem, "ipm", starts=1),
        dmoc.solve(problem.but(sequence=()), "ipm"),
    )
    assert free.solved and touching.status == "grazes" and touching.cost > free.cost


def test_a_motion_that_grazes_is_a_start_like_any_other() -> None:
    """Its multipliers belong to another program than the one that a solve begins with."""
    problem = random_arm(22, 4, 20)
    grazing = dmoc.solve(problem, "ipm", starts=1)
    again = dmoc.solve(
        problem.but(parameters={**problem.parameters, "m1": problem.parameters["m1"] * 1.01}),
        "ipm",
        guess=grazing,
    )
    assert grazing.status == again.status == "grazes" and again.cost == pytest.approx(
        grazing.cost, rel=0.1
    )


def test_a_search_gives_no_credit_for_a_graze() -> None:
    problem = random_arm(22, 2, 40).but(sequence=())
    result = dmoc.search(problem, max_collisions=1)
    by_sequence = {n.sequence: n for n in result.nodes}
    assert by_sequence[("stop",)].verdict == "grazes" and result.best is by_sequence[()]
    assert "has no effect" in by_sequence[("stop",)].evidence[0]


# Limits of inputs ---------------------------------------------------------------------------------


@pytest.mark.parametrize("steps", [5, 10, 41])
def test_order_4_keeps_the_limits_of_inputs_everywhere(steps: int) -> None:
    """Furthest rest-to-rest point of a unit mass with |u| <= 1 in 1 s: at most 0.25, whatever
    the steps."""
    system = unit_mass("far", terminal_cost=-dynamicsymbols("x"))
    problem = dmoc.Problem(
        dmoc.build(system, order=4), start={"x": 0}, goal={"x_dot": 0}, steps=steps, final_time=1.0,
        bounds={"u": (-1, 1)},
    )  # fmt: skip
    for method in ("ipm", "slsqp") if steps < 20 else ("ipm",):
        solution = answer_of(problem, method)
        assert 0.23 < -solution.cost <= 0.25 + 1e-9
        (phase,) = solution.phases
        assert max(np.abs(end).max() for end in solution.trajectory.input_ends(phase)) <= 1 + 1e-9


def test_the_check_sees_inputs_beyond_their_limits() -> None:
    from dataclasses import replace

    kernels = dmoc.build(block_system(), order=4)
    problem = dmoc.Problem(
        kernels, start={"x": 0}, goal={"x": 0.5, "x_dot": 0}, steps=10, final_time=1.0,
        bounds={"u": (-4, 4)},
    )  # fmt: skip
    solution = answer_of(problem, "ipm")
    wrong = dmoc.verify(replace(solution.trajectory, input_bounds=np.array([[-2.0, 2.0]])), kernels)
    assert not wrong.passed and "excess of an input" in wrong.message and wrong.limit_excess > 0.1


# Points of surfaces -------------------------------------------------------------------------------


def pendulum_system(name: str, wall: sp.Basic) -> dmoc.MechanicalSystem:
    a, u = dynamicsymbols("a u")
    return dmoc.MechanicalSystem(
        name, [a], a.diff(T) ** 2 / 2 + sp.Float(9.81) * sp.cos(a), {}, [u], {a: u},
        {"wall": wall(a)}, u**2,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("goal", "cost", "order"), [(-pi, 40.695, 2), (-3.0, 29.385, 4), (-2.0, 18.119, 4)]
)
def test_a_wall_whose_gradient_vanishes_is_as_good_as_a_plain_one(
    order: int, goal: float, cost: float
) -> None:
    """sin(a) <= 0.5 and a <= pi/6 are the same wall; a better confirmed minimum than the known
    one is welcome."""
    steps = 100 if order == 2 else 50
    for name, wall in (
        ("sine_wall", lambda a: sp.sin(a) <= sp.Rational(1, 2)),
        ("plain_wall", lambda a: a <= sp.pi / 6),
    ):
        problem = dmoc.Problem(
            dmoc.build(pendulum_system(name, wall), order=order), start={"a": 0.0},
            goal={"a": goal, "a_dot": 0}, sequence=["wall"], steps=steps, final_time=3.0,
        )  # fmt: skip
        solution = answer_of(problem, "ipm")
        assert solution.cost <= cost * 1.002
        assert solution.collisions[0].position[0] == pytest.approx(pi / 6, abs=1e-9)


def test_points_of_surfaces_are_found_where_the_gradient_vanishes() -> None:
    kernels = dmoc.build(pendulum_system("sine_wall", lambda a: sp.sin(a) <= sp.Rational(1, 2)))
    problem = dmoc.Problem(
        kernels, start={"a": 0.0}, goal={"a": -pi, "a_dot": 0}, sequence=["wall"], final_time=3.0
    )
    summit = np.array([-pi / 2])
    assert sorted(float(q[0]) for q in crossings(problem, summit, 0)) == pytest.approx(
        [-7 * pi / 6, pi / 6]
    )
    point = onto_surface(problem, summit, 0)
    assert point is not None and sin(point[0]) == pytest.approx(0.5, abs=1e-9)
    assert contact_point(problem, summit, np.zeros(1), 0, 0.0)[0] == pytest.approx(pi / 6)
    far = dmoc.build(pendulum_system("no_wall", lambda a: sp.sin(a) <= 2))
    assert (
        onto_surface(
            dmoc.Problem(far, start={"a": 0.0}, goal={"a": 1.0}, final_time=1.0), summit, 0
        )
        is None
    )


def test_a_bound_gives_way_only_where_it_lies_on_the_surface() -> None:
    """The upper bound is the wall itself; the lower one, beside another root of the gap, stays."""
    kernels = dmoc.build(pendulum_system("sine_wall", lambda a: sp.sin(a) <= sp.Rational(1, 2)))
    fields = {
        "start": {"a": 0.0},
        "goal": {"a": -1.0},
        "sequence": ["wall"],
        "steps": 4,
        "final_time": 2.0,
    }
    for low, high, freed in ((-3.0, pi / 6, True), (-3.0, 1.0, False)):
        nlp = Transcription(dmoc.Problem(kernels, bounds={"a": (low, high)}, **fields))
        unknown = nlp.layout.index_q[4, 0]
        assert nlp.limits[0][unknown] == low
        assert bool(nlp.limits[1][unknown] > high) is freed and nlp.limits[1][unknown] < high + 0.1


# The check ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("steps", [20, 50, 160])
def test_a_motion_that_slides_along_a_surface_is_confirmed_on_every_mesh(steps: int) -> None:
    """Around a post on the straight way: the motion lies on the post for many steps, held there
    by its inputs."""
    x, y, f_x, f_y = dynamicsymbols("x y f_x f_y")
    system = dmoc.MechanicalSystem(
        "around", [x, y], (x.diff(T) ** 2 + y.diff(T) ** 2) / 2, {}, [f_x, f_y], {x: f_x, y: f_y},
        {"post": x**2 + y**2 >= 1}, f_x**2 + f_y**2,
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(system), start={"x": -1.2, "y": 0.1},
        goal={"x": 1.2, "y": 0.1, "x_dot": 0, "y_dot": 0}, steps=steps, final_time=1.0,
    )  # fmt: skip
    solution = answer_of(problem, "ipm")
    assert any(b.startswith("gap to post") for b in solution.active_bounds)


def acrobot(steps: int) -> dmoc.Problem:
    """Two unit links driven at the elbow alone, swung up in 4 s: unstable."""
    a, b, u = dynamicsymbols("a b u")
    upper, lower = a.diff(), a.diff() + b.diff()
    kinetic = upper**2 + lower**2 / 2 + upper * lower * sp.cos(b)
    potential = -sp.Float(9.81) * (2 * sp.cos(a) + sp.cos(a + b))
    system = dmoc.MechanicalSystem(
        "acrobot", [a, b], kinetic - potential, {}, [u], {b: u}, cost=u**2
    )
    return dmoc.Problem(
        dmoc.build(system), start={"a": 0, "b": 0}, goal={"a": pi, "b": 0, "a_dot": 0, "b_dot": 0},
        steps=steps, final_time=4.0,
    )  # fmt: skip


def test_an_unstable_motion_is_weighed_with_its_amplification_and_a_coarse_one_is_not_excused() -> (
    None
):
    problem = acrobot(200)
    fine = answer_of(problem, "ipm", starts=1)
    check = fine.verify()
    assert check.passed and check.amplification > 1000
    assert (
        check.terminal_error > 0.25
        and "the motion is unstable: it amplifies errors" in fine.message
    )
    coarse = dmoc.solve(problem.but(steps=12), "ipm", starts=1)
    assert coarse.status == "not_verified" and "too coarse" in coarse.message


def test_the_amplification_is_that_of_the_linearised_flow() -> None:
    """A pendulum that stands upright for T = 2 s with g / l = 9: in sizes of its own the flow
    grows like cosh(3 T)."""
    a, u = dynamicsymbols("a u")
    system = dmoc.MechanicalSystem(
        "upright", [a], a.diff(T) ** 2 / 2 + sp.Rational(9, 2) * a**2, {}, [u], {a: u}, cost=u**2
    )
    problem = dmoc.Problem(
        dmoc.build(system), start={"a": 0}, goal={"a": 1.0, "a_dot": 0}, steps=100, final_time=2.0
    )
    solution = dmoc.solve(problem, "ipm")
    check = solution.verify()
    (phase,) = solution.phases
    size = np.array([np.ptp(phase.q), np.abs(phase.v).max()])
    flow = np.array([[np.cosh(6), np.sinh(6) / 3], [3 * np.sinh(6), np.cosh(6)]])
    assert check.amplification == pytest.approx(
        np.linalg.norm(flow * size / size[:, None], 2), rel=1e-4
    )


def test_a_start_on_a_surface_that_moves_into_it_is_refused() -> None:
    kernels = dmoc.build(block_system())
    fields = {"goal": {"x": 0.0}, "sequence": ["wall"], "final_time": 1.0}
    with pytest.raises(
        ProblemError,
        match=r"lies on surface 'wall' and moves into it \(the gap changes by 2 per second\)",
    ):
        dmoc.Problem(kernels, start={"x": 1.0, "x_dot": 2.0}, **fields)
    with pytest.raises(ProblemError, match="moves into it"):
        dmoc.Problem(kernels, start={"x": 1.0, "p_x": 2.0}, **fields)
    for velocity in (-2.0, 0.0, (0.0, 1.0), None):
        assert dmoc.Problem(kernels, start={"x": 1.0, "x_dot": velocity}, **fields).sequence == (
            "wall",
        )


# Infeasible by a little, and limits of time -------------------------------------------------------


@pytest.mark.parametrize("method", [m for m in INSTALLED if m != "uno"])
@pytest.mark.parametrize("order", [2, 4])
@pytest.mark.parametrize("limit", ["wall", "bound"])
def test_infeasible_by_a_little_is_infeasible_early(method: str, order: int, limit: str) -> None:
    """6.664 m/s and |u| <= 50 need 0.4441 m to stop, and there are 0.443 m."""
    wall, box = (0.443, {}) if limit == "wall" else (9.0, {"x": (-1.0, 0.443)})
    problem = dmoc.Problem(
        dmoc.build(block_system(), order=order), start={"x": 0, "x_dot": 6.664}, goal={"x_dot": 0},
        steps=40, final_time=0.2, parameters={"wall": wall}, bounds={"u": (-50, 50), **box},
    )  # fmt: skip
    solution = dmoc.solve(problem, method, starts=1)
    assert solution.status == "infeasible" and solution.iterations < 300 and solution.conflicts


def test_a_numerical_failure_is_a_status_and_nothing_is_written(
    capfd: pytest.CaptureFixture[str],
) -> None:
    """A start and a goal on the wall that is to be hit, soft impact: slsqp once took minutes in
    an iteration and then raised."""
    problem = there_and_back(
        dmoc.build(block_system()), goal={"x": 1.0, "x_dot": 0}, steps=40, restitution=0.5
    )
    other = dmoc.solve(problem, "ipm")
    one = dmoc.solve(problem, "slsqp", guess=other.unknowns)
    assert one.status == other.status == "not_verified"  # feasible, and too coarse for its impact
    assert "law of impact" in one.message and one.max_violation < 1e-9
    assert one.cost == pytest.approx(other.cost, rel=1e-6)
    assert capfd.readouterr() == ("", "")


def test_the_time_limit_covers_guess_solve_and_check(reads: list[int]) -> None:
    """Each part hears of the limit: what a solve still does then does not grow with the problem."""
    small, problem = (there_and_back(dmoc.build(block_system()), steps=n) for n in (20, 2000))

    def heard(
        seconds: float, problem: dmoc.Problem = problem, starts: int | None = None
    ) -> tuple[dmoc.Solution, float]:
        reads[0] = 0
        solution = dmoc.solve(problem, "ipm", seconds=seconds, starts=starts)
        assert solution.status == "time_limit"
        return solution, reads[0] - seconds

    def reads_of(verify: bool) -> int:
        reads[0] = 0
        assert dmoc.solve(problem, "ipm", seconds=10_000, verify=verify, starts=1).solved
        return reads[0]

    within_the_check = (reads_of(verify=False) + reads_of(verify=True)) // 2
    (_, least), (unsolved, late), (unchecked, later) = (
        heard(5, small), heard(5), heard(within_the_check, starts=1)
    )  # fmt: skip
    assert late <= least and later <= least
    assert unsolved.iterations == 0 < unchecked.iterations
    # The check alone was cut short.
    assert unchecked.optimality < 1e-6 and unchecked.max_violation < 1e-9
