"""Forces of contacts and constraints in quantities: bounds, peaks, ends, beside closed forms and
the same problems in minimal coordinates; what the check makes of them, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import ModelError, ProblemError
from dmoc.guess.automatic import initial_guesses
from dmoc.mechanics.touch import Open
from dmoc.problem.derived import relaxed
from dmoc.program.transcription import Transcription

pytestmark = pytest.mark.slow

G, MU = 9.81, 0.5
t = dynamicsymbols._t
x, y, a, u, w = dynamicsymbols("x y a u w")
FORMS = [(2, "constant"), (2, "linear"), (4, "stages"), (4, "constant"), (6, "stages")]


def pendulum(wall: bool = False, **fields: Any) -> dmoc.MechanicalSystem:
    """1 kg at the end of a rod of 1 m, with a torque; its rod is a constraint with the force R, so
    that it pulls with -2 R."""
    return dmoc.MechanicalSystem(
        "rod_pendulum", [x, y], (x.diff() ** 2 + y.diff() ** 2) / 2 - G * y, {}, [u],
        {x: -u * y, y: u * x}, cost=u**2, constraints={"rod": sp.Eq(x**2 + y**2, 1)},
        quantities={"pull": -2 * dmoc.reaction("rod")},
        surfaces={"wall": x <= sp.Rational(1, 2)} if wall else {}, **fields,
    )  # fmt: skip


def by_angle(wall: bool = False, **fields: Any) -> dmoc.MechanicalSystem:
    """The same in its angle: the rod pulls with a'^2 + g cos a."""
    return dmoc.MechanicalSystem(
        "angle_pendulum", [a], a.diff() ** 2 / 2 + G * sp.cos(a), {}, [u], {a: u}, cost=u**2,
        quantities={"pull": a.diff() ** 2 + G * sp.cos(a)},
        surfaces={"wall": sp.sin(a) <= sp.Rational(1, 2)} if wall else {}, **fields,
    )  # fmt: skip


def block(**fields: Any) -> dmoc.MechanicalSystem:
    """1 kg on a floor with friction, pushed along it and lifted."""
    return dmoc.MechanicalSystem(
        "rubbing", [x, y], (x.diff() ** 2 + y.diff() ** 2) / 2 - G * y, {}, [u, w], {x: u, y: w},
        surfaces={"floor": y >= 0, "roof": y <= 3}, tangents={"floor": x}, friction={"floor": MU},
        cost=u**2 + w**2, quantities={
            "N": dmoc.normal("floor"), "T": dmoc.traction("floor"), "above": dmoc.normal("roof"),
            "used": dmoc.traction("floor") / dmoc.normal("floor"),
        }, **fields,
    )  # fmt: skip


def solved(problem: dmoc.Problem, **options: Any) -> dmoc.Solution:
    solution = dmoc.solve(problem, "ipm", **({"starts": 1} | options))
    assert solution.solved and solution.verification.passed
    return solution


def above(order: int, **fields: Any) -> Any:
    """1 kg on the floor, 1 kg above it, and a force between them."""
    system = dmoc.MechanicalSystem(
        "above", [x, y], (x.diff() ** 2 + y.diff() ** 2) / 2 - G * (x + y), {}, [u],
        {x: -u, y: u}, surfaces={"floor": x >= 0}, quantities={"load": dmoc.normal("floor")},
        **fields,
    )  # fmt: skip
    return dmoc.build(system, order=order)


@pytest.mark.parametrize("order", [2, 4])
def test_the_limit_of_a_load_near_the_least_there_is(order: int) -> None:
    """From rest to rest by d = 0.2 m in T = 0.5 s, with an acceleration of A = limit - 2 g at most
    and then one that falls evenly for 3 (T/2 - d/(A T)): a convex program, which has one minimum.
    Up with A and down with the weight of both it comes 0.2 m high for A = 1.742."""
    T, d, A = 0.5, 0.2, 22.5 - 2 * G
    problem = dmoc.Problem(
        above(order, cost=u**2 / 2), {x: 0, y: 1}, {y: 1 + d, "y_dot": 0}, contacts=["floor"],
        final_time=T, steps=20, bounds={"load": (None, 2 * G + A)},
    )  # fmt: skip
    fall = 3 * (T / 2 - d / (A * T))
    last = A - 2 * A * T / fall
    exact = G**2 * T / 2 + A**2 * (T - fall) / 2 + (A**3 - last**3) / (A - last) * fall / 6
    solution = dmoc.solve(problem)
    assert solution.solved and not solution.others and solution.agreeing_starts == solution.starts
    assert solution.cost == pytest.approx(exact, rel={2: 1e-3, 4: 1e-5}[order])
    idle = dmoc.solve(problem, "ipm", guess={"u": 1e-9, "y": [1, 1 + d]}, starts=1)
    assert idle.solved and idle.cost == pytest.approx(solution.cost, rel=1e-8)
    above_it = dmoc.solve(problem.but(bounds={"load": (None, 2 * G + 1.8)}), "ipm", starts=1)
    assert above_it.minimum
    below = dmoc.solve(problem.but(bounds={"load": (None, 2 * G + 1.7)}), "ipm", starts=1)
    assert below.status == "infeasible" and below.conflicts


@pytest.mark.parametrize(("order", "controls"), FORMS)
def test_the_least_peak_of_a_landing_mass(order: int, controls: str) -> None:
    """1 kg above 1 kg on the floor comes down with 2 m/s and stops in 0.2 m, which takes 0.2 s:
    (m + m) g + m v^2/(2 s)."""
    problem = dmoc.Problem(
        above(order, objective=dmoc.peak("load")), {x: 0, y: 1, "y_dot": -2},
        {y: (0.8, None), "y_dot": 0}, contacts=["floor"], final_time=0.2, controls=controls,
        steps=20,
    )  # fmt: skip
    solution = solved(problem)
    assert solution.cost == pytest.approx(29.62, rel=1e-8)
    assert solution.phases[0].q[-1, 1] == pytest.approx(0.8, abs=1e-6)
    assert solution.trajectory.totals["peak load"] == pytest.approx(29.62, rel=1e-8)
    np.testing.assert_allclose(solution.phases[0].quantities, 29.62, rtol=1e-6)


@pytest.mark.parametrize("order", [2, 4, 6])
def test_the_pull_of_a_swinging_rod(order: int) -> None:
    """From rest at 1 rad it is g (3 cos a - 2 cos 1), in solutions and simulations."""
    free = replace(pendulum(), name="free_rod", inputs=[], forces={}, cost=0)
    start = {x: np.sin(1.0), y: -np.cos(1.0)}
    problem = dmoc.Problem(dmoc.build(free, order=order), start, {}, final_time=0.8, steps=40)
    for motion, near in (
        (solved(problem), {2: 2e-3, 4: 1e-6, 6: 1e-9}[order]),
        (dmoc.simulate(free, start, step_size=0.02, steps=40), 1e-3),
    ):
        for phase in motion.trajectory.phases:
            at_nodes = phase.quantities.reshape(phase.steps, 3)[:, 0]
            closed = G * (-3 * phase.q[:-1, 1] - 2 * np.cos(1.0))
            np.testing.assert_allclose(at_nodes, closed, rtol=near)


def swung(system: dmoc.MechanicalSystem, order: int, **stated: Any) -> dmoc.Problem:
    rod = len(system.coordinates) > 1
    start = {x: 0, y: -1} if rod else {a: 0}
    goal = {x: np.sin(1.2), y: -np.cos(1.2)} if rod else {a: 1.2}
    still = dict.fromkeys(("x_dot", "y_dot") if rod else ("a_dot",), 0)
    return dmoc.Problem(
        dmoc.build(system, order=order), start, goal | still,
        **({"final_time": 1.5, "steps": 60} | stated),
    )  # fmt: skip


@pytest.mark.parametrize(("order", "controls"), FORMS)
def test_a_rod_that_bears_no_more_beside_its_angle(order: int, controls: str) -> None:
    """Unbounded it pulls with 15.5 N.  The two schemes differ by their errors."""
    costs = [
        solved(swung(s, order, bounds={"pull": (3, 13)}, controls=controls)).cost
        for s in (pendulum(), by_angle())
    ]
    assert costs[0] == pytest.approx(costs[1], rel={2: 6e-3, 4: 1.5e-3, 6: 2e-4}[order])
    assert costs[0] > 1.05 * solved(swung(pendulum(), order, controls=controls)).cost


@pytest.mark.parametrize("order", [2, 4])
def test_peaks_before_and_after_a_hit_beside_the_angle(order: int) -> None:
    """Down to the wall and back: the peak and its price."""
    costs = []
    for make in (pendulum, by_angle):
        system = make(wall=True, objective=dmoc.peak("pull") / 5)
        rod = len(system.coordinates) > 1
        problem = dmoc.Problem(
            dmoc.build(system, order=order), {x: 0, y: -1} if rod else {a: 0},
            {x: 0, y: -1, "x_dot": 0} if rod else {a: 0, "a_dot": 0}, ["wall"],
            final_time=1.5, steps=24, restitution=0.8,
        )  # fmt: skip
        costs.append(solved(problem, starts=4).cost)
    assert costs[0] == pytest.approx(costs[1], rel={2: 5e-3, 4: 2e-3}[order])


@pytest.mark.parametrize(("order", "near"), [(2, 1e-3), (4, 1e-9)])
def test_a_block_that_may_not_press_too_hard(order: int, near: float) -> None:
    """N <= 3 N lifts with w = g - 3 all along; u = 3 (1 + 3 mu/2)(1 - t) is the cheapest to 1 m."""
    problem = dmoc.Problem(
        dmoc.build(block(), order=order), {x: 0, y: 0}, {x: 1}, contacts=["floor:slip+"],
        final_time=1, steps=30, bounds={"N": (None, 3)},
    )  # fmt: skip
    solution = solved(problem)
    closed = 3 * (1 + 3 * MU / 2) ** 2 + (G - 3) ** 2
    assert solution.cost == pytest.approx(closed, rel=near)
    for at in (0.0, 0.4, 1.0):
        state = solution.at(at)
        values = [state["N"], state["T"], state["used"], state["above"]]
        np.testing.assert_allclose(values, [3, -MU * 3, -MU, 0], atol=1e-6)
    # The same bound of what rubs: T = -mu N >= -1.5 N.
    same = solved(problem.but(bounds={"T": (-1.5, None)}))
    assert same.cost == pytest.approx(solution.cost, rel=1e-8)
    sides = dmoc.sensitivities(problem, solution)["bounds"]
    # d/dN of the closed form, up to the error of the steps
    slope = 3 * MU * (1 + 3 * MU / 2) - 2 * (G - 3)
    assert sides["N <="] == pytest.approx(slope, rel=near)


@pytest.mark.parametrize("order", [2, 4])
def test_friction_that_depends_on_the_place(order: int) -> None:
    """On mu = (1 + x)/2 friction is T = -mu N, and |T| <= 6 N holds x <= 1 with w >= g - 6."""
    system = replace(block(), name="rougher", friction={"floor": (1 + x) / 2})
    problem = dmoc.Problem(
        dmoc.build(system, order=order), {x: 0, y: 0}, {x: 1}, contacts=["floor:slip+"],
        final_time=1, steps=30, bounds={"T": (-6, 0)},
    )  # fmt: skip
    solution = solved(problem)
    (phase,) = solution.phases
    N, T = phase.quantities[::3, :2].T
    np.testing.assert_allclose(T, -(1 + phase.q[:-1, 0]) / 2 * N, atol=1e-9)
    free = solved(problem.but(bounds={}))
    assert free.phases[0].quantities[:, 1].min() < -6 - 1e-3 < T.min()


@pytest.mark.parametrize("order", [2, 4])
def test_forces_are_zero_where_contacts_are_open(order: int) -> None:
    """It stands, is lifted, and has no force; what sticks is held by T = -u."""
    problem = dmoc.Problem(
        dmoc.build(block(), order=order), {x: 0, y: 0}, {y: 0.1, "y_dot": 0}, ["-floor"],
        contacts=["floor"], final_time=1, steps=12, bounds={u: (0.2, 1), "N": (0, 12)},
        durations=[(0.3, None), (0.3, None)],
    )  # fmt: skip
    first, second = solved(problem).phases
    # T/N of nothing by nothing is no number
    assert np.array_equal(second.quantities[:, :3], np.zeros((36, 3)))
    np.testing.assert_allclose(first.quantities[:, 1], -0.2, atol=1e-6)


@pytest.mark.parametrize("order", [2, 4, 6])
def test_a_deck_that_moves_with_the_time(order: int) -> None:
    """On y = sin(2 t)/10 the force is g - 0.4 sin(2 t), and friction pulls along with the deck:
    x'' = 1/2 = u + T, with T <= 0.2 and the cost 0.09."""
    system = dmoc.MechanicalSystem(
        "lifted", [x, y], (x.diff() ** 2 + y.diff() ** 2) / 2 - G * y, {}, [u], {x: u},
        surfaces={"deck": y >= sp.sin(2 * t) / 10}, tangents={"deck": x - t**2 / 4}, cost=u**2,
        friction={"deck": MU},
        quantities={"N": dmoc.normal("deck"), "T": dmoc.traction("deck")},
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(system, order=order), {x: 0, y: 0, "y_dot": 0.2}, contacts=["deck"],
        final_time=1, steps=16, bounds={"T": (None, 0.2)},
    )  # fmt: skip
    solution = solved(problem)
    assert solution.cost == pytest.approx(0.09, abs=1e-8)
    (phase,) = solution.phases
    N, T = phase.quantities[::3].T
    np.testing.assert_allclose(N, G - 0.4 * np.sin(2 * phase.t[:-1]), atol=1e-4)
    np.testing.assert_allclose(T, 0.2, atol=1e-6)
    assert dmoc.solve(problem.but(bounds={"N": (None, 9.7)}), "ipm", starts=1).status == (
        "infeasible"  # it stands with g at the start
    )


@pytest.mark.parametrize("order", [2, 4])
def test_forces_at_both_ends(order: int) -> None:
    """At the lowest point with the speed v the rod pulls with g + v^2, at rest with g cos a."""
    kernels = dmoc.build(pendulum(), order=order)
    start = {x: 0, y: -1, "pull": G + 4, "x_dot": (0, None)}
    problem = dmoc.Problem(
        kernels, start, {"pull": 5.0, "x_dot": 0, "y_dot": 0, x: (0, 1)}, final_time=0.6, steps=20
    )
    (phase,) = solved(problem, starts=4).phases
    assert phase.v[0, 0] == pytest.approx(2, abs=1e-6)
    assert G * -phase.q[-1, 1] == pytest.approx(5, abs=1e-6)
    again = dmoc.Problem(
        kernels, {x: 0, y: -1, "x_dot": None}, {x: 0, y: -1, "x_dot": (1, None)}, steps=60,
        periodic={"pull": ("pull", 0.5)}, final_time=(0.5, 1.5),
    )  # fmt: skip
    (phase,) = solved(again, starts=4).phases
    assert phase.v[-1, 0] ** 2 - phase.v[0, 0] ** 2 == pytest.approx(0.5, abs=1e-6)


def test_the_derivative_of_the_cost_by_a_bound() -> None:
    """Beside differences."""
    problem = swung(pendulum(), 4, bounds={"pull": (None, 13)}, steps=20)
    solution = solved(problem)
    beside = [
        solved(problem.but(bounds={"pull": (None, 13 + d)}), guess=solution).cost
        for d in (-1e-3, 1e-3)
    ]
    slope = dmoc.sensitivities(problem, solution)["bounds"]["pull <="]
    assert slope == pytest.approx((beside[1] - beside[0]) / 2e-3, rel=1e-5)


def test_the_check_has_its_own_forces() -> None:
    """A motion that says of itself what its rod does not bear."""
    problem = swung(pendulum(), 4)
    motion = solved(problem).trajectory
    (most,) = [float(phase.quantities.max()) for phase in motion.phases]
    for bound, passes in ((most + 0.01, True), (most - 0.3, False)):
        report = dmoc.verify(replace(motion, limits={"pull": (-np.inf, bound)}), problem.kernels)
        assert report.passed is passes
    assert "the bound of pull is exceeded by" in str(report)


def test_files_and_the_numpy_backend_have_them(tmp_path: Any) -> None:
    problem = swung(pendulum(), 4, bounds={"pull": (None, 13)}, steps=12)
    solution = solved(problem)
    solution.save(tmp_path / "swing.npz")
    again = dmoc.Solution.load(tmp_path / "swing.npz")
    assert np.array_equal(again.phases[0].quantities, solution.phases[0].quantities)
    slow = problem.but(kernels=dmoc.build(pendulum(), order=4, backend="numpy"))
    again = dmoc.solve(slow, "slsqp", guess=solution)
    assert again.solved and again.cost == pytest.approx(solution.cost, rel=1e-6)


def rests() -> dmoc.MechanicalSystem:
    """A bar on two feet that stick, of whose tangential forces only the sum is determined."""
    ends = {"l": (x - sp.cos(a), y - sp.sin(a)), "r": (x + sp.cos(a), y + sp.sin(a))}
    return dmoc.MechanicalSystem(
        "bar", [x, y, a], (x.diff() ** 2 + y.diff() ** 2 + a.diff() ** 2 / 3) / 2 - G * y, {},
        [u], {x: u}, surfaces={n: e[1] >= 0 for n, e in ends.items()}, cost=u**2,
        tangents={n: e[0] for n, e in ends.items()}, friction={"l": MU, "r": MU},
        quantities={"left": dmoc.normal("l")},
    )  # fmt: skip


def test_forces_that_the_motion_does_not_determine_are_refused() -> None:
    problem = dmoc.Problem(
        rests(), {x: 0, y: 0, a: 0}, {x: 1, "x_dot": 0}, contacts=["l:slip+", "r:slip+"],
        final_time=1, steps=10, bounds={"left": (1, 9)},
    )  # fmt: skip
    solved(problem)
    stuck = problem.but(contacts=["l", "r"], goal={})
    with pytest.raises(ProblemError, match="determines only sums of those of l, r in phase 0"):
        dmoc.solve(stuck, "ipm")
    assert dmoc.solve(stuck.but(bounds={}), "ipm").solved
    tree = dmoc.search(problem, max_collisions=1, events=["l:stick r:stick"])
    assert tree.best is not None and tree.best.sequence == ()
    # A motion whose contacts are open has no forces that could be bounded.
    loose = relaxed(problem, Open((0, 1), (0, 1), (0, 1)), [], 10, 0.1)
    guess = initial_guesses(loose)[0].x
    assert np.isfinite(Transcription(loose).values(guess)).all()
    assert not np.isfinite(loose.quantity_bounds).any()


N = dmoc.normal("floor")
REFUSED = {
    "an unknown surface": (
        {"quantities": {"N": dmoc.normal("flor")}}, "expected the name of a surface of the model"),
    "an unknown tangent": (
        {"quantities": {"T": dmoc.traction("roof")}}, "the name of a tangent of the model, one of"),
    "no constraint": (
        {"quantities": {"R": dmoc.reaction("rod")}}, "a constraint of the model, one of none"),
    "in the cost": ({"cost": N**2}, "forces of contacts and constraints stand in `quantities`"),
    "in an integral": ({"integrals": {"I": N}}, "stand in `quantities`"),
    "in a path constraint": ({"path_constraints": {"p": N <= 3}}, "stand in `quantities`"),
    "in a force": ({"forces": {x: u - N, y: w}}, "stand in `quantities`"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_a_model_that_is_refused(name: str) -> None:
    fields, match = REFUSED[name]
    with pytest.raises(ModelError, match=match):
        replace(block(), **fields)


def test_what_is_no_name_and_no_place_is_refused() -> None:
    with pytest.raises(ModelError, match=r"normal\(3\): expected the name of a surface, such as"):
        dmoc.normal(3)
    with pytest.raises(ProblemError, match="velocities, inputs or forces, which jump there"):
        dmoc.Problem(block(), {x: 0, y: 0}, {}, ["-floor"], contacts=["floor"], via=[{"N": 3}])
