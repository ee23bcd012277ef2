"""Impacts by Stronge's energetic restitution: simulated, solved, checked, refused."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import sympy as sp
from answers import answer_of
from hit_problems import X, Y, ball, coupled, rod, thrown

import dmoc
from dmoc.base.errors import ModelError, ProblemError, SimulationError
from dmoc.codegen.kernels import Array
from dmoc.guess.hits import _impulses, rates_and_response
from dmoc.program.blocks import NOWHERE
from dmoc.program.laws.hit import RESTITUTIONS
from dmoc.program.layout import Layout
from dmoc.program.transcription import Transcription
from dmoc.simulation.impact_laws import poisson, stronge
from dmoc.simulation.impact_laws.course import Coefficients, Impulses


def energetic(system: dmoc.MechanicalSystem, **changes: Any) -> dmoc.MechanicalSystem:
    return replace(system, impact_laws={"floor": "stronge"}, **changes)


def of_rod(angle: float, v: tuple[float, ...]) -> tuple[Array, Array]:
    """Rates of separation and of sliding of a uniform rod of length 1, and their response."""
    c, s = np.cos(np.radians(angle)) / 2, np.sin(np.radians(angle)) / 2
    D = np.array([[0, 1, -c], [1, 0, s]])
    return D @ v, D * [1.0, 1.0, 12.0] @ D.T


def marched(rates: Array, response: Array, mu: float, e: float) -> tuple[float, float]:
    """The impulses by small steps of the normal one, until it gives e^2 of its work back."""
    n, t = rates
    dP, P, S, work, due = -n / response[0, 0] / 40_000, 0.0, 0.0, 0.0, None
    while due is None or work < due:
        held = -response[1, 0] / response[1, 1]
        slips = abs(t) > 2 * dP * np.abs(response[1]).max() * (1 + mu)
        slope = -np.sign(t) * mu if slips else float(np.clip(held, -mu, mu))
        step = response @ [1.0, slope] * dP
        work, n, t = work + (n + step[0] / 2) * dP, n + step[0], t + step[1]
        P, S = P + dP, S + slope * dP
        if due is None and n >= 0:
            work, due = 0.0, -(e**2) * work
    return P, S


def works(hit: Impulses, rates: Array, response: Array) -> tuple[float, float]:
    """Those of the normal impulse in compression and in restitution, from corner to corner."""
    path = np.array([(0.0, 0.0), *hit.stops, (hit.normal, hit.tangential)])
    n = (rates + path @ response.T)[:, 0]
    turn = np.flatnonzero((n[:-1] < 0) & (n[1:] >= 0))[0]
    top = path[turn, 0] + np.diff(path[:, 0])[turn] * n[turn] / (n[turn] - n[turn + 1])
    P, n = np.insert(path[:, 0], turn + 1, top), np.insert(n, turn + 1, 0.0)
    parts = np.diff(P) * (n[1:] + n[:-1]) / 2
    return float(parts[: turn + 1].sum()), float(parts[turn + 1 :].sum())


@pytest.mark.parametrize(
    ("angle", "v", "mu", "course"),
    [
        (60, (0.5, -1, 0), 0.3, "slip+:slip-"), (60, (0.1, -1, 0), 0.6, "slip+:stick"),
        (60, (1.2, -1, 0), 0.3, "slip+:slip-:late"), (60, (1.6, -1, 0), 0.7, "slip+:stick:late"),
    ],
)  # fmt: skip
def test_a_rod_has_the_impulses_of_small_steps(
    angle: float, v: tuple[float, ...], mu: float, course: str
) -> None:
    rates, response = of_rod(angle, v)
    hit = stronge.impulses(rates, response, Coefficients(mu, 0.5))
    assert hit.course == course
    P, S = marched(rates, response, mu, 0.5)
    assert (hit.normal, hit.tangential) == pytest.approx((P, S), abs=1e-4)
    other = poisson.impulses(rates, response, Coefficients(mu, 0.5))
    assert abs(other.normal - hit.normal) > 3e-4


def test_where_sliding_never_stops_the_laws_are_one() -> None:
    rates, response = of_rod(45, (-0.3, -1, 0))
    hit = stronge.impulses(rates, response, Coefficients(0.2, 0.5))
    assert hit.normal == pytest.approx(0.681818182, abs=6e-10)
    n = (rates + response @ [hit.normal, hit.tangential])[0]
    assert n == pytest.approx(-0.5 * rates[0])  # Newton's


def test_works_of_random_hits_are_as_stated_and_no_energy_grows() -> None:
    r, courses = np.random.default_rng(5), set[str]()
    for _ in range(2000):
        root, mu, e = r.normal(size=(2, 2)), r.uniform(0, 2), r.uniform(0, 1)
        response = root @ root.T + 1e-3 * np.eye(2)
        rates = np.array([-r.uniform(0.01, 2), r.normal()])
        hit = stronge.impulses(rates, response, Coefficients(mu, e))
        lam = np.array([hit.normal, hit.tangential])
        taken, given = works(hit, rates, response)
        assert given == pytest.approx(-(e**2) * taken, rel=1e-8)
        assert lam @ (2 * rates + response @ lam) <= 0
        assert abs(hit.tangential) <= mu * hit.normal * (1 + 1e-12)
        courses.add(hit.course)
    assert len(courses) == 10


def drawn(number: int) -> tuple[dmoc.Problem, Impulses]:
    """A random hit, and what the simulation's law makes of it."""
    rng = np.random.default_rng(number)
    root = rng.normal(size=(2, 2))
    inverse = root @ root.T + 0.05 * np.eye(2)
    mass, mu = np.linalg.inv(inverse), rng.uniform(0.02, 1.5)
    v = np.array([rng.normal(), -abs(rng.normal()) - 0.2])
    law = stronge.impulses(v[::-1], inverse[::-1, ::-1], Coefficients(mu, 0.6))
    problem = dmoc.Problem(
        energetic(coupled()), sequence=[f"floor:{law.course}"], restitution=0.6,
        parameters={"mu": mu, "m_x": mass[0, 0], "m_xy": mass[0, 1], "m_y": mass[1, 1]},
        **thrown((v[0], v[1]), {"x": 0.0, "y": 0.0}),
    )  # fmt: skip
    return problem, law


@pytest.mark.parametrize("number", [0, 1, 3, 5, 8, 10, 16, 22, 30])
def test_first_values_within_a_hit_are_those_of_the_law(number: int) -> None:
    problem, law = drawn(number)
    (p,) = Layout.of(problem).hit.passages
    v = np.array([problem.start["x_dot"], problem.start["y_dot"]])
    rates, A = rates_and_response(problem, p, (np.zeros(2), v, 0.0))
    first = _impulses(p, rates, A, (0.6, problem.parameters["mu"]))
    assert first[-1] == pytest.approx([law.normal, law.tangential], rel=1e-9)


def test_no_root_below_zero_is_left_to_restitution() -> None:
    for number in (5, 8):
        problem, law = drawn(number)
        rows = Transcription(problem).laws.hit.share.index[0]
        assert (rows[2] != NOWHERE) == (law.course != "slip-:stick")


def test_the_whole_impulse_beside_that_of_compression() -> None:
    """1 + e times the root of the ratio of what a normal impulse changes the rate by."""
    assert RESTITUTIONS["stronge"].ratio(0.5, 4.0, 1.0) == pytest.approx(2.0)
    assert RESTITUTIONS["poisson"].ratio(0.5, 4.0, 1.0) == pytest.approx(1.5)


@pytest.mark.slow
@pytest.mark.parametrize("number", [0, 1, 3, 5, 8, 10, 16, 22, 30])
def test_a_program_has_the_hit_of_the_simulation(number: int) -> None:
    problem, law = drawn(number)
    solution = answer_of(problem, starts=1)
    hit = solution.collisions[0]
    assert hit.impulse == pytest.approx(law.normal, rel=1e-7)
    assert hit.tractions["floor"] == pytest.approx(law.tangential, abs=1e-7 * law.normal)
    run = dmoc.simulate(solution)
    assert run.collisions[0].impulse == pytest.approx(law.normal, rel=1e-6)


def back(**changes: Any) -> dmoc.Problem:
    """A rod is thrown onto a floor and comes up a little, in least time."""
    statement: dict[str, Any] = {
        "start": {"x": 0, "y": 0.6, "a": np.pi / 3, "x_dot": 0.1, "y_dot": (-1, 0), "a_dot": 0},
        "goal": {"y": 0.5}, "parameters": {"mu": 0.6}, "sequence": ["floor"], "steps": 6,
        "final_time": (0.2, 3), "restitution": 0.5,
    }  # fmt: skip
    return dmoc.Problem(energetic(rod()), **{**statement, **changes})


@pytest.mark.slow
def test_the_way_is_found_and_the_cost_has_a_derivative() -> None:
    problem = back()
    solution = dmoc.solve(problem)
    assert solution.status == "solved" and ":" in solution.collisions[0].word.partition(":")[2]
    slope = dmoc.sensitivities(problem, solution)["restitution"]["floor"]
    word = [solution.collisions[0].word]
    more, less = (
        dmoc.solve(back(restitution=e, sequence=word), guess=solution).cost for e in (0.501, 0.499)
    )
    assert slope == pytest.approx((more - less) / 0.002, rel=1e-4)
    plastic = dmoc.solve(back(restitution=0, sequence=word, goal={}))
    assert np.isnan(
        dmoc.sensitivities(back(restitution=0, sequence=word, goal={}), plastic)["restitution"][
            "floor"
        ]
    )


def test_a_restitution_of_parameters_is_a_number() -> None:
    e = sp.Symbol("e")
    values = {**coupled().parameters, e: 0.6**0.5}
    stated = energetic(coupled(), restitution={"floor": e**2}, parameters=values)
    problem, law = drawn(5)
    same = dmoc.Problem(
        stated, sequence=problem.sequence, parameters=problem.parameters, start=problem.start,
        steps=3, durations=problem.durations,
    )  # fmt: skip
    assert answer_of(same, starts=1).collisions[0].impulse == pytest.approx(law.normal, rel=1e-7)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"impact_laws": {"floor": "newton"}}, "is 'newton': expected one of 'poisson', 'stronge'"),
        ({"impact_laws": {"floor": 0.5}}, "is 0.5: expected one of"),
        ({"impact_laws": {"wall": "stronge"}}, "'wall' has a law of impact but is no surface"),
        ({"impact_laws": ["stronge"]}, "expected a mapping such as"),
        ({"tangents": {}, "friction": {}}, "no friction, without which all laws of impact are one"),
        ({"tangential_restitution": {"floor": 0.5}}, "leave one of them out"),
        (
            {"restitution": {"floor": 1 / (1 + dmoc.approach_speed)}},
            "by Stronge's law it is a number",
        ),
    ],
)
def test_what_no_law_is_or_needs_is_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(ModelError, match=words):
        replace(ball(), **{"impact_laws": {"floor": "stronge"}, **changes})


def test_the_derivation_says_the_law() -> None:
    said = str(dmoc.derive(energetic(ball())))
    assert "Hits of floor obey Stronge's law: restitution gives e^2 of the work" in said
    assert "Hits of floor obey Poisson's law: restitution has e times the imp" in str(
        dmoc.derive(ball())
    )


def test_a_design_of_the_restitution_is_refused() -> None:
    e = sp.Symbol("e")
    values = {**ball().parameters, e: 0.5}
    system = energetic(ball(), restitution={"floor": e}, parameters=values)
    with pytest.raises(ModelError, match="restitution of 'floor', which is a number by Stronge's"):
        dmoc.Problem(system, sequence=["floor"], design={"e": (0.2, 0.8)})


def test_hits_beside_other_contacts_are_refused() -> None:
    system = energetic(ball(), surfaces={"floor": Y >= 0.1, "wall": X + Y / 9 <= 1})
    with pytest.raises(ProblemError, match=r"floor obey Stronge's law, .* wall stays closed"):
        dmoc.Problem(system, start={"x": 0.9}, contacts=["wall"], sequence=["floor:slip+"])
    start, rates = {"x": 1 - 0.1 / 9, "y": 0.1, "a": 0}, {"x": 1.0, "y": -1.0, "a": 0}
    with pytest.raises(SimulationError, match="'floor', whose hits obey Stronge's law, is hit at"):
        dmoc.simulate(system, start, rates, step_size=0.01, steps=2)
