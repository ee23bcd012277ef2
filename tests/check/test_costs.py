"""What motions cost, their integrals and peaks, by a quadrature along their own path."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import motions
import numpy as np
import pytest
import sympy as sp
from answers import answer_of
from sympy.physics.mechanics import dynamicsymbols
from systems import unit_mass

import dmoc
from dmoc.check.integrated_steps import IntegratedSteps
from dmoc.check.quadrature import integrals_along
from dmoc.codegen.kernels import Array
from dmoc.motion.trajectory import Trajectory
from dmoc.simulation.flow import Steps

T = dynamicsymbols._t
x, u = dynamicsymbols("x u")
v = x.diff(T)
ACROSS = {"start": {"x": -1.0}, "goal": {"x": 1.0, "x_dot": 0.0}, "final_time": 1.0}


def across(cost: Any, order: int = 2, **fields: Any) -> dmoc.Problem:
    """Two metres in a second, from rest to rest."""
    return dmoc.Problem(dmoc.build(unit_mass("carried", cost=cost), order=order), **ACROSS | fields)


# A motion in closed form --------------------------------------------------------------------------


def rest_to_rest(**fields: Any) -> tuple[Trajectory, dmoc.codegen.kernels.Kernels]:
    """A metre in a second with the least int u^2: x = 3 t^2 - 2 t^3 under u = 6 - 12 t."""
    kernels = dmoc.build(unit_mass("moved", **fields))
    piece = motions.Piece(
        1.0, lambda t: (3 * t**2 - 2 * t**3, 6 * t - 6 * t**2), lambda t: 6 - 12 * t
    )
    return motions.trajectory(kernels, [piece], [], 20), kernels


OBJECTIVE = {
    "quantities": {"speed": v, "pull": -u}, "integrals": {"way": x, "effort": u**2},
    "terminal_cost": 5 * x, "cost": u**2,
    "objective": dmoc.total("way") * dmoc.total("effort") + 2 * dmoc.peak("speed")
    + dmoc.largest("pull") + dmoc.at_end(x) - dmoc.at_start(v) + dmoc.final_time,
}  # fmt: skip
# int u^2 = 12, Phi = 5, int x = 1/2, the largest speed 3/2, the largest force 6.
TOTALS = {"way": 0.5, "effort": 12.0, "peak speed": 1.5, "largest pull": 6.0}
COSTS: Mapping[str, tuple[Mapping[str, Any], float, float]] = {
    "of inputs": ({"cost": u**2}, 12.0, 12.0),
    "of both signs": ({"cost": u}, 0.0, 3.0),
    "of the end": ({"cost": u**2, "terminal_cost": -8 * x**2}, 4.0, 20.0),
    "of the time": ({"cost": T * u**2}, 6.0, 6.0),
    "of a kink": ({"cost": sp.Abs(u)}, 3.0, 3.0),
}


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("name", COSTS)
def test_a_cost_is_that_of_the_path_up_to_two_per_cent_of_its_magnitude(
    name: str, sign: int
) -> None:
    fields, cost, size = COSTS[name]
    motion, kernels = rest_to_rest(**fields)
    for share, passed in ((0.0, True), (0.0199, True), (0.0201, False), (1.0, False)):
        check = dmoc.verify(replace(motion, cost=cost + sign * share * size), kernels)
        assert check.passed is passed, check.message
        assert check.cost_error == pytest.approx(share, rel=1e-5, abs=1e-7)
    assert f"the cost is {cost:.6g} along the motion" in check.message or not cost
    assert dmoc.verify(motion, kernels).passed  # which says no cost


def test_a_cost_has_the_terms_of_an_objective() -> None:
    motion, kernels = rest_to_rest(**OBJECTIVE)
    motion = replace(motion, totals=TOTALS)
    own = 12 + 5 + 0.5 * 12 + 2 * 1.5 + 6 + 1 - 0 + 1
    check = dmoc.verify(replace(motion, cost=own), kernels)
    assert check.passed and check.cost_error < 1e-9
    for cost in (own - 3, own + 3):
        assert "error of the cost" in dmoc.verify(replace(motion, cost=cost), kernels).message


@pytest.mark.parametrize(("name", "word"), [
    ("way", "integral"), ("effort", "integral"), ("peak speed", "peak"), ("largest pull", "peak"),
])  # fmt: skip
@pytest.mark.parametrize("share", [-0.5, -0.021, -0.019, 0.019, 0.021, 0.5])
def test_totals_are_those_of_the_path(name: str, word: str, share: float) -> None:
    motion, kernels = rest_to_rest(**OBJECTIVE)
    value = (1 + share) * TOTALS[name]
    check = dmoc.verify(replace(motion, totals=TOTALS | {name: value}), kernels)
    assert check.passed is (abs(share) < 0.02)
    # of a peak relative to the larger one of both
    error = abs(share) / max(1 + share * (word == "peak"), 1)
    assert check.cost_error == pytest.approx(error, rel=1e-4)
    assert check.passed or f"error of a{'n' * (word[0] == 'i')} {word}" in check.message


def test_what_a_peak_is_stands_in_the_message() -> None:
    motion, kernels = rest_to_rest(**OBJECTIVE)
    wrong = replace(motion, totals=TOTALS | {"peak speed": 0.75})
    assert "(peak speed is 1.5 along the motion, not 0.75)" in dmoc.verify(wrong, kernels).message


# Poles, roots, peaks ------------------------------------------------------------------------------

PLACE = 0.3137  # where the functions below are singular


def integrated(function: Callable[[Array], Array], steps: int = 7) -> Any:
    """A function along x = t in a second."""
    t = np.linspace(0, 1, steps + 1)
    one, none = np.ones((steps, 1)), np.zeros((steps, 0))
    start, stop = (np.hstack([a[:, None], one]) for a in (t[:-1], t[1:]))
    run = Steps(t[:-1], np.diff(t), none, none)
    course = IntegratedSteps(run, start, np.zeros((steps, 2, 1)), stop)
    with np.errstate(all="ignore"):
        return integrals_along([course], lambda q, *_: function(q))


@pytest.mark.parametrize(("function", "pole"), [
    (lambda r: 1 / r**2, True), (lambda r: 1 / r, True), (lambda r: 1 / np.abs(r), True),
    (lambda r: np.abs(r) ** -1.5, True), (lambda r: 1e-4 / np.abs(r) + 1, True),
    (lambda r: np.abs(r) ** -0.5, False), (lambda r: np.log(np.abs(r)), False),
    (lambda r: np.abs(r) ** 0.5, False), (lambda r: np.abs(r) ** -0.6, False),
    (lambda r: np.sin(60 * r), False), (lambda r: np.maximum(r, 0), False),
    (lambda r: 1 / (r**2 + 1e-12), False),
])  # fmt: skip
def test_poles_are_told_from_roots_and_peaks(
    function: Callable[[Array], Array], pole: bool
) -> None:
    for place in np.linspace(0.0137, 0.9871, 12):
        along = integrated(lambda q, r=place: function(q - r))
        assert along.has_pole.tolist() == [pole] and not along.undefined.any(), place
        if pole:
            assert along.hardest(0).t == pytest.approx(place, abs=1e-6)


@pytest.mark.parametrize(("function", "exact"), [
    (lambda r: np.abs(r) ** -0.5, 2 * np.sqrt(PLACE) + 2 * np.sqrt(1 - PLACE)),
    (lambda r: np.abs(r) ** 0.5, (PLACE**1.5 + (1 - PLACE) ** 1.5) / 1.5),
    (lambda r: np.log(np.abs(r)),
     PLACE * np.log(PLACE) + (1 - PLACE) * np.log(1 - PLACE) - 1),
    (lambda r: np.maximum(r, 0), (1 - PLACE) ** 2 / 2),
    (lambda r: 1 / (r**2 + 1e-8),
     1e4 * (np.arctan(1e4 * PLACE) + np.arctan(1e4 * (1 - PLACE)))),
])  # fmt: skip
def test_integrals_with_roots_kinks_and_peaks(
    function: Callable[[Array], Array], exact: float
) -> None:
    along = integrated(lambda q: function(q - PLACE))
    assert along.values[0] == pytest.approx(exact, rel=2e-4)
    assert along.left[0] < 1e-3 * along.sizes[0]


def test_each_function_has_its_own_place_and_verdict() -> None:
    along = integrated(lambda q: np.hstack([1 / (q - 0.8) ** 2, q, np.abs(q - PLACE) ** -0.5]))
    assert along.has_pole.tolist() == [True, False, False]
    assert along.hardest(0).t == pytest.approx(0.8, abs=1e-6)
    assert along.hardest(2).t == pytest.approx(PLACE, abs=1e-6)
    assert along.values[1] == pytest.approx(0.5, rel=1e-12)


def test_a_function_that_is_none_beside_a_node_is_undefined() -> None:
    """Where a motion turns round it may leave a domain for a moment that no rule would meet."""
    for near in (lambda q: q < 1e-6, lambda q: q > 1 - 1e-6):
        along = integrated(lambda q, near=near: np.where(near(q), np.nan, q))
        assert along.undefined.all()


def test_what_varies_too_fast_is_left() -> None:
    along = integrated(lambda q: np.sin(1e9 * q) ** 2)
    assert along.left[0] > 0.02 * along.sizes[0] and not along.has_pole.any()


def test_what_the_quadrature_leaves_is_an_error_of_the_cost() -> None:
    """A cost said to be nothing is off by all of its magnitude, and by what is left of that."""
    motion, kernels = rest_to_rest(cost=sp.sin(1e9 * x) ** 2)
    assert dmoc.verify(replace(motion, cost=0.0), kernels).cost_error > 1.02


def test_no_motion_through_a_pole_is_solved() -> None:
    """The cost of every motion through x = 0 is infinite."""
    problem = across(u**2 + sp.Rational(1, 1000) / x**2)
    for wanted in (problem, problem.but(steps=41), problem.but(steps=40)):
        solution = dmoc.solve(wanted)
        assert solution.status == "not_verified"
        assert "the integrand of the cost has a pole at 0.5 s, x = " in solution.message
        assert solution.verification is not None and solution.verification.cost_error == np.inf


def test_all_meshes_of_a_pole_have_its_error() -> None:
    """Their costs differ little: each jumps over it."""
    solution = dmoc.solve(across(u**2 + sp.Rational(1, 1000) / x**2), "ipm", tolerance=1e-2)
    assert solution.status == "not_verified" and solution.error_estimate == np.inf


def test_a_post_of_infinite_cost_is_passed_at_a_side() -> None:
    """Straight through it, with a cost of 1e28, is no minimum that counts."""
    y, w = dynamicsymbols("y w")
    system = dmoc.MechanicalSystem(
        "plane", [x, y], (v**2 + y.diff(T) ** 2) / 2, {}, [u, w], {x: u, y: w},
        cost=u**2 + w**2 + sp.Rational(1, 100) / (x**2 + y**2),
    )  # fmt: skip
    ends = {
        "start": {"x": -1.0, "y": 0.0},
        "goal": {"x": 1.0, "y": 0.0, "x_dot": 0.0, "y_dot": 0.0},
    }
    problem = dmoc.Problem(system, **ends, final_time=1.0)
    assert answer_of(problem).status == "solved"
    straight = dmoc.solve(problem.but(steps=41), "ipm", starts=1)
    if straight.cost > 100:
        assert straight.status == "not_verified" and "has a pole at 0.5 s" in straight.message


@pytest.mark.parametrize("order", [2, 4, 6])
@pytest.mark.parametrize("steps", [6, 7])
@pytest.mark.parametrize("f", [sp.sqrt, sp.log])
def test_a_motion_that_leaves_the_domain_of_its_cost_is_never_solved(
    f: Any, steps: int, order: int
) -> None:
    """A ball that is thrown to x = 1, where its cost ends at 0.9995, between nodes or at one."""
    cost = 1e3 * u**2 + f(sp.Float(0.9995) - x)
    system = replace(unit_mass("thrown", cost=cost), lagrangian=v**2 / 2 - 10 * x)
    problem = dmoc.Problem(
        dmoc.build(system, order=order), start={"x": 0.8, "x_dot": 2.0},
        goal={"x": 0.8, "x_dot": -2.0}, final_time=0.4, steps=steps,
    )  # fmt: skip
    solution = dmoc.solve(problem, "ipm", starts=1)
    assert not solution.minimum
    if solution.verification is not None:
        assert "the integrand of the cost is not a number at 0." in solution.message


def test_a_cost_that_is_none_at_a_node_alone_is_known() -> None:
    """sin(x)/x is 0/0 where the motion begins."""
    system = unit_mass("unfolded", cost=u**2 + sp.sin(x) / x)
    problem = dmoc.Problem(
        system, start={"x": 0.0}, goal={"x": 1.0, "x_dot": 0.0}, final_time=1.0, steps=20
    )
    assert dmoc.solve(problem, "ipm", starts=1).status == "solved"


def test_a_peak_between_nodes_is_no_free_lunch() -> None:
    """One of a width of 1e-5 m, which adds 1e-4 pi / (1e-5 x 3 m/s) = 10 to a cost of 48."""
    solution = dmoc.solve(across(u**2 + 1e-4 / (x**2 + 1e-10), steps=40), "ipm", starts=1)
    assert solution.status == "not_verified" and "at 0.5 s, x = " in solution.message
    assert solution.verification is not None and solution.verification.cost_error > 0.1


@pytest.mark.parametrize("order", [2, 4, 6])
def test_costs_of_right_motions_are_right(order: int) -> None:
    """Also where there is hardly any, and where errors of the positions make it."""
    followed = 1e3 * (x + sp.cos(3 * T)) ** 2 + 1e-6 * u**2
    for cost, steps in ((u**2 + x**2, 10), (sp.Abs(u) + u**2, 20), (followed, 30)):
        problem = across(cost, order, steps=steps)
        solution = dmoc.solve(problem, "ipm", starts=1)
        assert solution.status == "solved", solution.message
        check = solution.verification
        assert check is not None and check.cost_error < 0.02
    still = across(sp.Abs(u), order, steps=10, start={"x": 0.0}, goal={"x": 0.0, "x_dot": 0.0})
    assert dmoc.solve(still, "ipm", starts=1).status == "solved"
