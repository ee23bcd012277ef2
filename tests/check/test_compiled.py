"""Compiled code measures motions that are free between hits as the check by steps does, and passes
none that this does not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from functools import partial

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols
from systems import block_system, bouncer_problem, dropped_ball, there_and_back, unit_mass

import dmoc
from dmoc.base.deadline import ENDLESS, Deadline
from dmoc.base.discretisation import DISCRETISATIONS
from dmoc.base.errors import SimulationError
from dmoc.check import compiled
from dmoc.check.check import judged_by_steps
from dmoc.check.checked_motion import Motion, OutOfTimeError
from dmoc.check.compiled import MOST, arrays_of, passing
from dmoc.check.free_motion import FreeMotion
from dmoc.codegen.kernels import Kernels
from dmoc.mechanics.model_values import parameter_rows, restitution_row
from dmoc.models.registry import find
from dmoc.motion.trajectory import Phase, Trajectory

Case = tuple[Trajectory, Kernels]
CASES: dict[str, Callable[[], Case]] = {}


def case(name: str) -> Callable[[Callable[[], dmoc.Problem]], Callable[[], dmoc.Problem]]:
    """A problem whose motion is looked at by both."""

    def named(make: Callable[[], dmoc.Problem]) -> Callable[[], dmoc.Problem]:
        def solved() -> Case:
            problem = make()
            s = dmoc.solve(problem, "ipm", starts=1, verify=False)
            assert s.minimum
            return s.trajectory, problem.kernels

        CASES[name] = solved
        return make

    return named


def pendulum(order: int = 2, **fields: object) -> dmoc.Problem:
    reference = find("cart_pendulum")
    return dmoc.Problem(reference.kernels(order), **{**reference.defaults, **fields})


for order in (2, 4, 6):
    case(f"pendulum on a cart, order {order}")(partial(pendulum, order, steps=200 // order))
case("linear inputs")(lambda: pendulum(steps=100, controls="linear"))
case("other parameters")(lambda: pendulum(4, steps=60, parameters={"m_p": 0.12}, restitution=0.7))


@case("puck, two walls")
def puck() -> dmoc.Problem:
    reference = find("puck_table")
    problem = dmoc.Problem(reference.kernels(), **reference.defaults)
    return problem.but(sequence=["east", "north"], steps=30, ignored=["south"])


@case("a wall that is moved")
def moving() -> dmoc.Problem:
    x, t = dynamicsymbols("x"), dynamicsymbols._t
    system = unit_mass(
        "moving_wall", surfaces={"wall": x <= 1 + t / 4}, cost=dynamicsymbols("u") ** 2
    )
    return there_and_back(dmoc.build(system), steps=20, restitution=0.8)


@case("a gait without a start")
def bouncer() -> dmoc.Problem:
    return bouncer_problem(0.8, order=4, steps=10)[0]


@case("a cost of the end, mm")
def far() -> dmoc.Problem:
    x, u = dynamicsymbols("x"), dynamicsymbols("u")
    system = unit_mass("far", cost=u**2 / 2, terminal_cost=-8 * x)
    return dmoc.Problem(dmoc.build(system), start={"x": 0, "x_dot": 0}, steps=20, final_time=1.0)


@case("a cost that depends on the place")
def valley() -> dmoc.Problem:
    x, u = dynamicsymbols("x"), dynamicsymbols("u")
    system = unit_mass("valley", cost=u**2 + 1e3 * (x - 0.3) ** 4)
    goal = {"x": 1, "x_dot": 0}
    return dmoc.Problem(
        dmoc.build(system), start={"x": 0, "x_dot": 0}, goal=goal, steps=30, final_time=1.0
    )


@case("a sharp cost")
def sharp() -> dmoc.Problem:
    x, u = dynamicsymbols("x"), dynamicsymbols("u")
    system = unit_mass("sharp", cost=u**2 + 50 / (1 + (60 * x - 25) ** 2))
    goal = {"x": 1, "x_dot": 0}
    return dmoc.Problem(
        dmoc.build(system), start={"x": 0, "x_dot": 0}, goal=goal, steps=80, final_time=1.0
    )


@case("through a wall that is ignored, and a cost of what hardly moves")
def ignored() -> dmoc.Problem:
    x, y, u = dynamicsymbols("x y u")
    system = dmoc.MechanicalSystem(
        "ignored", [x, y], (x.diff() ** 2 + y.diff() ** 2) / 2 - 9 * y, {}, [u], {x: u, y: 9},
        surfaces={"wall": x <= 1, "floor": y >= -1}, cost=y**2,
    )  # fmt: skip
    rest = {"x": 0, "y": 0, "x_dot": 0, "y_dot": 0}
    goal = {"x": 2, "x_dot": 0}
    return dmoc.Problem(
        dmoc.build(system), start=rest, goal=goal, steps=10, final_time=1.0, ignored=["wall"]
    )


def course() -> Kernels:
    """A mass goes around a disc and past a wire, with limits of its power and of its height."""
    x, y, u, w = dynamicsymbols("x y u w")
    t, (r, s, b, P, z) = dynamicsymbols._t, sp.symbols("r s b P z")
    system = dmoc.MechanicalSystem(
        "course", [x, y], (x.diff() ** 2 + y.diff() ** 2) / 2,
        {r: 0.3, s: 0.1, b: -0.2, P: 11.0, z: 0.2}, [u, w], {x: u, y: w}, cost=(u**2 + w**2) / 2,
        quantities={"push": u},
        path_constraints={
            "disc": x**2 + (y + 0.1) ** 2 >= r**2, "wire": (x - 0.5) ** 2 + (y - b) ** 2 >= s**2,
            "power": u * x.diff() <= P, "roof": y <= z + t / 3,
        },
    )  # fmt: skip
    return dmoc.build(system)


@case("around a disc, with limits of velocities")
def around() -> dmoc.Problem:
    rest = {"y": 0, "x_dot": 0, "y_dot": 0}
    return dmoc.Problem(
        course(),
        start={"x": -1, **rest}, goal={"x": 1, **rest}, steps=60, final_time=1.0,
        bounds={"x_dot": (None, 2.8), "y_dot": (-2, None)},
    )  # fmt: skip


@pytest.fixture(scope="module", params=[*CASES])
def motion(request: pytest.FixtureRequest) -> Case:
    return CASES[request.param]()


@pytest.mark.parametrize("share", [0.0, 1e-3])
def test_both_find_the_same(motion: Case, share: float) -> None:
    """Also of a motion that says that it costs a little more."""
    good, kernels = motion
    said = replace(good, cost=good.cost + share * max(good.cost, 1e-16))
    quick, slow = passing(said, kernels, ENDLESS), judged_by_steps(said, kernels, ENDLESS)
    assert quick is not None and slow.passed
    for field in fields(slow):
        ours, theirs = getattr(quick, field.name), getattr(slow, field.name)
        if field.name == "contacts":
            assert [c.surface for c in ours] == [c.surface for c in theirs]
            ours, theirs = (np.array([(c.time, c.jump) for c in x]) for x in (ours, theirs))
        if isinstance(theirs, bool | str | tuple):
            assert ours == theirs, field.name
        else:
            assert ours == pytest.approx(theirs, rel=1e-9, abs=1e-12), field.name


def test_rows_have_the_verdicts_of_accurate_integrations(motion: Case) -> None:
    """With errors that are as large as they may be and a little larger, which integrations of order
    4 cannot tell."""
    good, kernels = motion
    par = parameter_rows(kernels, good.parameters, len(good.phases), SimulationError)
    restitution = restitution_row(kernels, good.restitution, SimulationError)
    arrays, claim = arrays_of(good, kernels, restitution), np.array([good.cost])
    check = FreeMotion(kernels, DISCRETISATIONS[good.order])
    found = check.measured(par, arrays, good.cost, lambda: None)
    assert found is not None
    errors, verdict = np.array(found[0]), np.full(1, 7, np.uint8)

    def passes(most: np.ndarray) -> bool:
        check.judge(par, arrays, claim, most, verdict, lambda: None)
        return bool(verdict[0])

    assert passes(MOST) and passes(1.001 * errors + 1e-15)
    for i in np.flatnonzero(errors > 1e-9):
        assert not passes(np.where(np.arange(len(errors)) == i, 0.9 * errors, np.inf))


def still(good: Trajectory) -> Trajectory:
    """A motion whose coordinates stay where they are, under the same inputs."""
    phases = [
        replace(own, q=0 * own.q + own.q[:1], v=0 * own.v, p=0 * own.p) for own in good.phases
    ]
    return replace(good, phases=tuple(phases))


def lifted(good: Trajectory) -> Trajectory:
    """A motion that goes the same way without velocities."""
    phases = [replace(own, v=0 * own.v, p=0 * own.p) for own in good.phases]
    return replace(good, phases=tuple(phases))


@pytest.mark.parametrize("changed", [lambda good: good, still, lifted])
def test_both_have_the_same_sizes(
    motion: Case, changed: Callable[[Trajectory], Trajectory]
) -> None:
    good, kernels = motion
    good = changed(good)
    with np.errstate(all="ignore"):
        sizes = Motion.of(good, kernels, ENDLESS).sizes
    check = FreeMotion(kernels, DISCRETISATIONS[good.order])
    restitution = restitution_row(kernels, good.restitution, SimulationError)
    par = parameter_rows(kernels, good.parameters, len(good.phases), SimulationError)
    check.measured(par, arrays_of(good, kernels, restitution), good.cost, lambda: None)
    ours = [np.asarray(check.sizes), check.size_p, check.size_gap, check.size_rate]
    theirs = [np.concatenate([sizes.q, sizes.v, [sizes.exchanged]]), sizes.p, sizes.gap, sizes.rate]
    for own, other in zip(ours, theirs, strict=True):
        assert np.asarray(own)[: len(other)] == pytest.approx(other, rel=1e-12, abs=0)
    assert check.energy_size == pytest.approx(sizes.energy, rel=1e-12)
    assert check.acceleration == pytest.approx(sizes.acceleration, rel=1e-12)


def wrong_motions(good: Trajectory) -> dict[str, Trajectory]:
    """A motion made wrong in one way at a time."""
    first, last = good.phases[0], good.phases[-1]

    def phase(i: int, **changes: np.ndarray) -> Trajectory:
        phases = list(good.phases)
        phases[i] = replace(phases[i], **changes)
        return replace(good, phases=tuple(phases))

    def bent(own: Phase, share: float) -> np.ndarray:
        q = own.q.copy()
        q[len(q) // 2] += share * np.ptp(q, axis=0)
        return q

    wrong = {
        "a node moved": phase(-1, q=bent(last, 0.05)),
        "a node moved a little": phase(0, q=bent(first, 0.002)),
        "faster": phase(0, v=1.05 * first.v),
        "another momentum": phase(-1, p=1.02 * last.p),
        "later": phase(-1, t=last.t + 1e-3),
        "not a number": phase(0, q=np.full_like(first.q, np.nan)),
        "cheaper": replace(good, cost=0.9 * good.cost),
        "no cost": replace(good, cost=np.nan),
        "narrower": replace(
            good, coordinate_bounds=0.5 * np.ptp(first.q, axis=0)[:, None] * [0, 1]
        ),
    }
    if first.u.size:
        wrong["weaker"] = phase(0, u=0.9 * first.u)
        wrong["beyond a limit"] = replace(
            good, input_bounds=np.abs(first.u).max() * np.tile([-0.5, 0.5], (first.u.shape[1], 1))
        )
    for i, c in enumerate(good.collisions[:1]):
        events = {
            "a weaker impulse": replace(c, impulse=0.9 * c.impulse),
            "elsewhere": replace(c, position=c.position + 1e-3),
            "at another time": replace(c, time=c.time + 1e-3),
            "grazing": replace(c, grazes=True),
        }
        for name, event in events.items():
            hits = (*good.collisions[:i], event, *good.collisions[i + 1 :])
            wrong[name] = replace(good, collisions=hits)
        e = {name: 0.9 * e if e else e for name, e in good.restitution.items()}
        wrong["softer"] = replace(good, restitution=e)
        wrong["through a wall"] = replace(
            good, phases=(good.phases[0], last), collisions=good.collisions[:1], cost=np.nan
        )
    return wrong


def test_none_passes_that_is_wrong(motion: Case) -> None:
    good, kernels = motion
    passed = list[str]()
    for name, wrong in wrong_motions(good).items():
        quick = passing(wrong, kernels, ENDLESS)
        slow = judged_by_steps(wrong, kernels, ENDLESS)
        assert quick is None or slow.passed, name
        passed += [name] * (quick is not None)
    assert "no cost" in passed and len(passed) <= 4


def test_what_rests_or_is_limited_or_large_is_left_to_the_other(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    kernels = dmoc.build(block_system())
    problem = there_and_back(kernels, steps=10)
    dead = dmoc.solve(problem.but(restitution=0.0), starts=1, verify=False)
    assert passing(dead.trajectory, kernels, ENDLESS) is None
    assert dmoc.verify(dead.trajectory, kernels).passed
    monkeypatch.setattr(compiled, "MOST_COORDINATES", 0)
    free = dmoc.solve(problem.but(restitution=0.8), starts=1, verify=False)
    assert passing(free.trajectory, kernels, ENDLESS) is None
    monkeypatch.undo()
    assert passing(free.trajectory, kernels, ENDLESS) is not None


def excess(good: Trajectory, kernels: Kernels) -> float:
    """The excess of limits that compiled code measures."""
    par = parameter_rows(kernels, good.parameters, len(good.phases), SimulationError)
    check = FreeMotion(kernels, DISCRETISATIONS[good.order])
    found = check.measured(par, arrays_of(good, kernels, np.ones(0)), good.cost, lambda: None)
    assert found is not None
    return found[0][6]


def test_excesses_of_limits_are_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of motions that exceed them: a thin wire that is met between two nodes among them."""
    problem = around()
    kernels = problem.kernels
    good = dmoc.solve(problem, "ipm", starts=1, verify=False).trajectory
    met = np.interp(0.5, *good.phases[0].q.T)
    monkeypatch.setattr(compiled, "MOST_SQUARES", 60 * 6**2 - 1)
    assert passing(good, kernels, ENDLESS) is None
    monkeypatch.undo()
    assert passing(good, kernels, ENDLESS) is not None
    pushed = replace(good, limits={"push": (-100.0, 100.0)})  # a quantity, with room for all
    assert passing(pushed, kernels, ENDLESS) is None
    for changed, limits in (
        ({"r": 0.303}, {}), ({"r": 0.33}, {}), ({"s": 0.3}, {}), ({"P": 10.9}, {}),
        ({"P": 3.0}, {}), ({"z": 0.15}, {}), ({"z": -2.0}, {}), ({}, {"x_dot": (-9, 2.7)}),
        ({}, {"y_dot": (-1, 1)}), ({"s": 1e-3, "b": met}, {}),
    ):  # fmt: skip
        moved = replace(good, parameters={**good.parameters, **changed}, limits=limits)
        slow = judged_by_steps(moved, kernels, ENDLESS).path_excess
        assert slow > 1e-4
        assert excess(moved, kernels) == pytest.approx(slow, rel=1e-9)
        assert (passing(moved, kernels, ENDLESS) is not None) <= (slow <= 0.005)


def test_shapes_and_time_are_looked_at() -> None:
    kernels = dmoc.build(dropped_ball())
    run = dmoc.simulate(kernels, [1.0], [0.0], step_size=0.01, steps=200)
    good = run.trajectory
    assert passing(good, kernels, ENDLESS) is not None
    short = replace(good.phases[0], v=good.phases[0].v[:-1])
    with pytest.raises(SimulationError, match="v of the phase from 0 s on has the shape"):
        passing(replace(good, phases=(short, *good.phases[1:])), kernels, ENDLESS)
    with pytest.raises(OutOfTimeError):
        passing(good, kernels, Deadline.after(0.0))
