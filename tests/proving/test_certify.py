"""Certificates: minima with closed forms lie in them, and what fails is named."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import mpmath as mp
import numpy as np
import pytest
import scipy.sparse
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols
from systems import block_system, there_and_back, unit_mass

import dmoc
from dmoc.base.errors import ProblemError
from dmoc.base.table import plain
from dmoc.codegen.kernels import Array, Kernels
from dmoc.proving.active_set import first_set, followed, sharpened
from dmoc.proving.enclosure import Inverse, radii
from dmoc.proving.factorisation import SignedFactors
from dmoc.proving.proof import Near, proof
from dmoc.results.certificate import Certificate
from dmoc.solvers.outcome import Duals, Status
from dmoc.solving.programs import at_solution

X, U = dynamicsymbols("x u")


def stated(kernels: Kernels, **fields: Any) -> dmoc.Problem:
    """From rest at 0 to rest at 1 in six steps, unless fields say otherwise."""
    plain = {"start": {"x": 0.0}, "goal": {"x": 1.0, "x_dot": 0.0}, "steps": 6, "final_time": 1.0}
    return dmoc.Problem(kernels, **(plain | fields))


def certified(problem: dmoc.Problem) -> tuple[dmoc.Solution, Certificate]:
    solution = dmoc.solve(problem, starts=1)
    return solution, dmoc.certify(problem, solution)


@pytest.fixture(scope="module")
def mass() -> Kernels:
    """A unit mass that is pushed along a line, dearer where it is far from 0."""
    k = sp.Symbol("k")
    cost = U**2 / 2 - k * X**2
    return dmoc.build(unit_mass("certified_mass", cost=cost, parameters={k: 0.0}))


def fails(certificate: Certificate) -> str:
    assert not certificate.proved and certificate.cost is None and certificate.radius == np.inf
    (sentence,) = certificate.fails
    return sentence


def test_a_closed_form_lies_in_the_certificate(mass: Kernels) -> None:
    """From rest to rest by the midpoint rule in N steps: 6 N^2 / (N^2 - 1)."""
    problem = stated(mass)
    solution, certificate = certified(problem)
    assert certificate.proved and certificate.cost is not None
    low, high = certificate.cost
    assert low < 6 * 36 / 35 < high < low + 1e-12
    assert certificate.radius < 1e-11 and certificate.active == 0
    assert certificate.unknowns == 5 + 6 + 1  # places, forces, step size
    # How far an answer is from the minimum is in its radius.
    k = int(np.flatnonzero(solution.unknowns == solution.phases[0].q[3, 0])[0])
    moved = solution.unknowns.copy()
    moved[k] += 1e-6
    other = dmoc.certify(problem, replace(solution, unknowns=moved))
    assert other.proved and 1e-6 <= other.radius < 1e-4


def wall_cost(speed: Any, duration: Any) -> Any:
    """What it takes a unit mass from rest at 0 to a wall at 1, which it hits with a speed and
    leaves with 0.8 of it, and back to rest at 0 within 1 s."""
    total = mp.mpf(0)
    for way, before, after, t in (
        (1, mp.mpf(0), speed, duration), (-1, -mp.mpf(0.8) * speed, mp.mpf(0), 1 - duration),
    ):  # fmt: skip
        a, b = before - way / t, after - way / t
        total += 2 * (a * a + a * b + b * b) / t
    return total


def test_a_hit_with_restitution_has_its_exact_cost_in_the_certificate() -> None:
    """Steps of order 6 whose forces vary within them have the cubic motions of the exact optimum,
    of which speed and duration are found with thirty digits."""
    problem = there_and_back(
        dmoc.build(block_system(), order=6), restitution=0.8, steps=3, controls="stages"
    )
    _, certificate = certified(problem)
    with mp.workdps(30):
        slopes = [lambda *z, n=n: mp.diff(wall_cost, z, n) for n in ((1, 0), (0, 1))]
        exact = wall_cost(*mp.findroot(lambda *z: [f(*z) for f in slopes], (3.3, 0.48)))
        assert mp.almosteq(exact, mp.mpf("24.58630915"), abs_eps=5e-9)
        assert certificate.proved and certificate.cost is not None
        low, high = certificate.cost
        assert mp.mpf(low) < exact < mp.mpf(high) < mp.mpf(low) + 1e-10


def test_the_answer_of_the_source_is_certified(seed: dmoc.Problem, solution: dmoc.Solution) -> None:
    certificate = dmoc.certify(seed, solution)
    assert certificate.proved and certificate.cost is not None
    low, high = certificate.cost
    assert low <= solution.cost + 1e-7 and solution.cost - 1e-7 <= high < low + 1e-6
    assert certificate.active == 1  # final time <= 1 s
    assert certificate.radius < 1e-6 and certificate.slack > 1e-3
    shown = {plain(row[0]): plain(row[1]) for row in certificate.summary().rows}
    assert shown["certificate"].startswith("passed: a strict local minimum of the discrete program")
    assert shown["cost"] == f"in [{low:.15g}, {high:.15g}]"
    data = certificate.to_dict()
    assert data["proved"] and data["cost"] == (low, high) and data["fails"] == ()


def test_a_continuum_of_minima_is_named(mass: Kernels) -> None:
    """Nobody has to move, however long it takes."""
    _, certificate = certified(stated(mass, goal={"x": 0.0, "x_dot": 0.0}, final_time=(0.5, 1.0)))
    assert fails(certificate) == (
        "the cost does not change in second order with step size of phase 0: a continuum of minima "
        "may go through this answer, and none of them is strict."
    )


def test_a_saddle_is_named(mass: Kernels) -> None:
    """To stay is a minimum where the cost of being elsewhere falls slowly, a saddle where it falls
    fast: the least of the integral of x''^2 / x^2 is that of a beam clamped at both ends, 4.730041
    to the power of four, twice the limit of k."""
    problem = stated(mass, goal={"x": 0.0, "x_dot": 0.0}, steps=20)
    stays = dmoc.solve(problem, starts=1)
    limit = 4.730041**4 / 2
    assert dmoc.certify(problem.but(parameters={"k": 0.85 * limit}), stays).proved
    assert fails(dmoc.certify(problem.but(parameters={"k": 1.15 * limit}), stays)) == (
        "the cost falls along a direction that the active constraints allow: the answer is a "
        "saddle, and no minimum."
    )


def test_a_bound_that_may_hold_or_not_is_named(mass: Kernels) -> None:
    """Thrown up with speed 1, a mass comes back with that speed after a second: at half time it
    is at 1/4, where a bound touches it without a force."""
    there = stated(mass, start={"x": 0.0, "x_dot": 1.0}, goal={"x": 0.0, "x_dot": -1.0})
    _, certificate = certified(there.but(bounds={"x": (None, 0.25)}))
    assert fails(certificate).startswith("whether the bound of x at node 3 ")
    assert " is open: its " in fails(certificate)
    for limit, active in ((0.2, True), (0.26, False)):
        _, clear = certified(there.but(bounds={"x": (None, limit)}))
        assert clear.proved and (clear.active > 0) is active


def test_an_equation_that_follows_from_others_is_left_out() -> None:
    """Nothing pushes along x, so that the speed at the end is that of the start."""
    y = dynamicsymbols("y")
    kinetic = (X.diff() ** 2 + y.diff() ** 2) / 2
    drifting = dmoc.MechanicalSystem("drifting", [X, y], kinetic, {}, [U], {y: U}, cost=U**2 / 2)
    start = {"x": 0.0, "y": 0.0, "x_dot": 1.0, "y_dot": 0.0}
    goal = {"x_dot": 1.0, "y": 1.0, "y_dot": 0.0}
    _, certificate = certified(stated(dmoc.build(drifting), start=start, goal=goal))
    assert certificate.proved and certificate.left_out == ("p_x at the goal",)
    assert certificate.cost is not None and certificate.cost[0] < 6 * 36 / 35 < certificate.cost[1]


def test_a_limit_that_another_one_implies_is_left_out(mass: Kernels) -> None:
    """A limit that is stated twice holds as it does where it is stated once; where it is touched
    without a force, nothing implies it."""
    a = sp.Symbol("a")
    limits = {"low": a >= X, "same": 2 * a >= 2 * X}
    twice = dmoc.MechanicalSystem(
        "limited_twice", [X], X.diff() ** 2 / 2, {a: 0.2}, [U], {X: U}, cost=U**2 / 2,
        path_constraints=limits,
    )  # fmt: skip
    ends = {"start": {"x": 0.0, "x_dot": 1.0}, "goal": {"x": 0.0, "x_dot": -1.0}}
    problem = stated(dmoc.build(twice), **ends)
    _, certificate = certified(problem)
    _, once = certified(stated(mass, **ends, bounds={"x": (None, 0.2)}))
    assert certificate.proved and certificate.left_out == ("path constraint same at node 3",)
    assert certificate.cost is not None and once.cost is not None
    assert certificate.cost[0] < once.cost[1] and once.cost[0] < certificate.cost[1]
    _, touching = certified(problem.but(parameters={"a": 0.25}))
    assert not touching.proved and "whether path constraint low at node 3" in touching.fails[0]


def test_constraints_that_hold_are_found_without_their_multipliers(mass: Kernels) -> None:
    """A bound below the top of a throw holds; one that is a little higher does not, whatever a
    solver says."""
    there = stated(mass, start={"x": 0.0, "x_dot": 1.0}, goal={"x": 0.0, "x_dot": -1.0})
    for limit, said, holds in ((0.2, 0.0, True), (0.25 + 1e-7, -1e-3, False)):
        problem = there.but(bounds={"x": (-1.0, limit)})
        nlp, duals = at_solution(problem, solution := dmoc.solve(problem, starts=1))
        x, z = nlp.scaled(solution.unknowns), np.zeros(nlp.n)
        z[nlp.layout.index_q[3]] = said
        assert first_set(nlp, x, Duals(duals.y, duals.w, z)).upper.any() == bool(said)
        point = sharpened(nlp, x, Duals(duals.y, duals.w, z))
        assert point.active.upper.any() == holds and proof(nlp, x, point).proved


@pytest.mark.parametrize("beyond", [2e-6, -2e-6])
def test_what_an_answer_leaves_open_is_told_further_along_the_central_path(
    mass: Kernels, beyond: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A bound a little below the top of a throw pushes as much as it is below, and one above does
    not, where distance and multiplier of an answer are alike."""
    there = stated(mass, start={"x": 0.0, "x_dot": 1.0}, goal={"x": 0.0, "x_dot": -1.0})
    problem = there.but(bounds={"x": (None, 0.25 + beyond)})
    nlp, duals = at_solution(problem, solution := dmoc.solve(problem, starts=1))
    k = int(nlp.layout.index_q[3, 0])
    x = nlp.scaled(solution.unknowns)
    # As an interior-point method ends, with the product 1e-11.
    top = np.minimum(x[k], nlp.upper[k] - 3e-6)
    z = duals.z.copy()
    z[k] = -1e-11 / (nlp.upper[k] - top)
    x[k] = top
    near, told = followed(nlp, x, Duals(duals.y, duals.w, z))
    force, distance = -told.z[k], nlp.upper[k] - near[k]
    if beyond > 0:
        assert distance == pytest.approx(beyond / nlp.sizes[k], rel=1e-3)
        assert force < 1e-4 * distance
    else:
        lower = there.but(bounds={"x": (None, 0.2)})
        of_lower, pushed = at_solution(lower, dmoc.solve(lower, starts=1))
        size = (of_lower.scale.cost / of_lower.sizes[k]) / (nlp.scale.cost / nlp.sizes[k])
        assert force == pytest.approx(-pushed.z[k] * size * -beyond / 0.05, rel=1e-3)
        assert distance < 1e-4 * force
    monkeypatch.setattr("dmoc.proving.active_set.ROUNDS", 1)
    assert dmoc.certify(problem, replace(solution, unknowns=x * nlp.sizes)).proved


@pytest.mark.parametrize("beyond", [2e-6, -2e-6])
def test_rows_are_told_along_the_central_path(beyond: float) -> None:
    """The same for an inequality: with a multiplier and a distance that are alike, both are what a
    solve has that ends sharply."""
    a = sp.Symbol("a")
    limited = dmoc.MechanicalSystem(
        "limited_once", [X], X.diff() ** 2 / 2, {a: 0.25 + beyond}, [U], {X: U}, cost=U**2 / 2,
        path_constraints={"low": a >= X},
    )  # fmt: skip
    ends = {"start": {"x": 0.0, "x_dot": 1.0}, "goal": {"x": 0.0, "x_dot": -1.0}}
    problem = stated(dmoc.build(limited, backend="numpy"), **ends)
    nlp, duals = at_solution(problem, solution := dmoc.solve(problem, starts=1))
    x, w = nlp.scaled(solution.unknowns), duals.w.copy()
    k, row = nlp.layout.index_q[3, 0], int(np.argmin(nlp.inequality(x)))
    x[k], w[row] = x[k] - 3e-6, 3e-6
    near, told = followed(nlp, x, Duals(duals.y, w, duals.z))
    distance, force = nlp.inequality(near)[row], told.w[row]
    sharp = sharpened(nlp, x, duals)
    assert force == pytest.approx(-sharp.y[nlp.n_eq + row], rel=1e-3, abs=1e-9)
    assert distance == pytest.approx(nlp.inequality(sharp.x)[row], rel=1e-3, abs=1e-9)
    assert (force > 1e3 * distance) == (beyond < 0)


def test_radii_that_are_too_large_shrink() -> None:
    """The second one needs the square of the first, whose first guess is twice what it needs: it
    would never get it from one that grows with it."""
    K = scipy.sparse.identity(2, format="csr")
    inverse = Inverse(K, SignedFactors(K))

    def variation(r: Any) -> Any:
        return scipy.sparse.csr_matrix(np.array([[0.0, 1e-3 * r[0]], [0.0, 0.0]]))

    within = radii(inverse, np.array([1.0, 1e-9]), variation)
    assert within is not None
    np.testing.assert_allclose(within, [1.0, 1e-3 * 1.2**2], rtol=1e-5)


def test_forces_that_are_shared_stay_as_they_are() -> None:
    """Of a rail that two constraints state the program knows one force alone."""
    y = dynamicsymbols("y")
    railed = dmoc.MechanicalSystem(
        "railed_twice", [X, y], (X.diff() ** 2 + y.diff() ** 2) / 2 - y, {}, [U], {X: U},
        constraints={"one": y, "two": 2 * y}, cost=U**2 / 2,
    )  # fmt: skip
    start, goal = {"x": 0.0, "y": 0.0, "x_dot": 0.0, "y_dot": 0.0}, {"x": 1.0, "x_dot": 0.0}
    _, certificate = certified(stated(dmoc.build(railed), start=start, goal=goal))
    assert certificate.proved and certificate.held == ("impulse of constraint two (7)",)
    assert "as they are" in {row[0] for row in certificate.summary().rows}


def test_the_bounds_hold_for_every_motion_within_the_radii(mass: Kernels) -> None:
    """The best motion for another cost has the same constraints; its cost lies within the bounds
    that hold as far away from the minimum."""
    problem = stated(mass)
    solution, other = (dmoc.solve(problem.but(parameters={"k": k}), starts=1) for k in (0.0, 50.0))
    nlp, duals = at_solution(problem, solution)
    x, z = nlp.scaled(solution.unknowns), nlp.scaled(other.unknowns)
    point = sharpened(nlp, x, duals)
    exact = point.system.enclosed(point.x, point.y, np.zeros(point.system.size))
    apart = np.concatenate([np.abs(z - point.x), np.zeros(len(point.y))])[point.system.order]
    low, high = Near(nlp, point, exact, apart * (1 + 1e-9) + 1e-12).cost
    assert low < solution.cost < solution.cost + 1e-2 < nlp.cost(z) * nlp.scale.cost <= high


def test_what_is_kept_is_kept_by_every_motion_within_the_radii(mass: Kernels) -> None:
    """The force of the best motion for another cost comes nearer to its limit."""
    problem = stated(mass, bounds={"u": (-6.5, 6.5)})
    solution, other = (dmoc.solve(problem.but(parameters={"k": k}), starts=1) for k in (0.0, 9.0))
    nlp, duals = at_solution(problem, solution)
    point = sharpened(nlp, nlp.scaled(solution.unknowns), duals)
    exact = point.system.enclosed(point.x, point.y, np.zeros(point.system.size))
    z, low, high = nlp.scaled(other.unknowns), nlp.lower, nlp.upper
    free = low < high

    def left(x: Array) -> float:
        return float(np.minimum(x - low, high - x)[free].min())

    apart = np.concatenate([np.abs(z - point.x), np.zeros(len(point.y))])[point.system.order]
    assert left(z) < left(point.x) - 1e-3
    assert Near(nlp, point, exact, apart * (1 + 1e-9) + 1e-12).slack <= left(z)


def test_a_program_that_is_too_large_is_named(
    mass: Kernels, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = stated(mass)
    solution = dmoc.solve(problem, starts=1)
    monkeypatch.setattr("dmoc.proving.certify.MOST", 20)
    assert fails(dmoc.certify(problem, solution)).endswith("unknowns and equations, more than 20.")


def test_what_did_not_converge_is_not_certified(mass: Kernels) -> None:
    problem = stated(mass)
    solution = replace(dmoc.solve(problem, starts=1), status=Status.STALLED)
    sentence = "the solver did not converge: its status is 'stalled'."
    assert fails(dmoc.certify(problem, solution)) == sentence


def test_a_solution_of_another_problem_is_refused(mass: Kernels) -> None:
    problem = stated(mass)
    solution = dmoc.solve(problem, starts=1)
    with pytest.raises(ProblemError, match="no minimum of this problem"):
        dmoc.certify(problem.but(goal={"x": 2.0, "x_dot": 0.0}), solution)
    with pytest.raises(ProblemError, match="expected the Solution of the problem"):
        dmoc.certify(problem, problem)  # type: ignore[arg-type]
