"""Hits with friction in optimal control problems: closed forms, Poisson's law by another way, what
is refused."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from answers import answer_of
from hit_problems import (
    RODS,
    back,
    coupled,
    fallen_rod,
    thrown,
)
from systems import landing_system

import dmoc
from dmoc.base.errors import ProblemError
from dmoc.guess.hit_course import course_of
from dmoc.program.hit_stages import END, STOP
from dmoc.program.transcription import Transcription
from dmoc.simulation.impact_laws.course import Coefficients, Impulses
from dmoc.simulation.impact_laws.poisson import impulses
from dmoc.solving import open_hits

COURSES = [
    "slip+", "slip-", "slip+:stick", "slip-:stick", "slip+:slip-", "slip-:slip+",
    "slip+:stick:late", "slip-:stick:late", "slip+:slip-:late", "slip-:slip+:late",
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("order", [2, 4])
@pytest.mark.parametrize(
    ("angle", "v", "mu", "after", "normal", "tangential", "course"),
    RODS,
)
def test_a_rod_that_hits_a_floor(
    angle: float, v: tuple[float, ...], mu: float, after: tuple[float, ...], normal: float,
    tangential: float, course: str, order: int,
) -> None:  # fmt: skip
    problem = fallen_rod(angle, v, mu, course, order=order)
    solution = answer_of(problem, starts=1)
    hit = solution.collisions[0]
    np.testing.assert_allclose(solution.phases[1].v[0], after, atol=1e-8)
    assert hit.impulses["floor"] == pytest.approx(normal, abs=1e-8)
    assert hit.tractions["floor"] == pytest.approx(tangential, abs=1e-8)
    assert hit.word == f"floor:{course}" and hit.rate_before > 0 > hit.rate_after


def drawn(number: int) -> tuple[dmoc.Problem, Impulses]:
    """A random hit, and what Poisson's law in steps of impulses makes of it."""
    rng = np.random.default_rng(number)
    root = rng.normal(size=(2, 2))
    inverse = root @ root.T + 0.05 * np.eye(2)
    mass, mu = np.linalg.inv(inverse), rng.uniform(0.02, 1.5)
    e = float(rng.choice([0.0, 0.5, 0.9, 1.0]))
    v = np.array([rng.normal(), -abs(rng.normal()) - 0.2])
    law = impulses(v[::-1], inverse[::-1, ::-1], Coefficients(mu, e))
    problem = dmoc.Problem(
        coupled(),
        sequence=[f"floor:{law.course}"],
        restitution=e,
        parameters={"mu": mu, "m_x": mass[0, 0], "m_xy": mass[0, 1], "m_y": mass[1, 1]},
        **thrown((v[0], v[1]), {"x": 0.0, "y": 0.0}),  # type: ignore[arg-type]
    )
    return problem, law


# Each course at least once, some of them with e = 0 (8, 14, 19).
@pytest.mark.slow
@pytest.mark.parametrize("number", [0, 1, 2, 6, 7, 8, 12, 14, 15, 19, 21, 70, 186])
def test_the_way_through_a_hit_is_poissons_and_no_other_is_possible(number: int) -> None:
    problem, law = drawn(number)
    solution = answer_of(problem, starts=1)
    hit = solution.collisions[0]
    assert hit.impulse == pytest.approx(law.normal, rel=1e-7)
    assert hit.tractions["floor"] == pytest.approx(law.tangential, abs=1e-7 * law.normal)
    energy = [float(p.p[k] @ p.v[k]) for p, k in zip(solution.phases, (-1, 0), strict=True)]
    assert energy[1] <= energy[0] * (1 + 1e-9)
    for course in COURSES:
        plastic = problem.restitution == 0 and course.endswith("late")
        if course == law.course or plastic:
            continue
        other = dmoc.solve(problem.but(sequence=[f"floor:{course}"]), starts=1, iterations=200)
        assert not other.minimum, course


@pytest.mark.slow
@pytest.mark.parametrize(
    ("course", "order", "signs"),
    [
        ("slip+", (END,), (1, 1)),
        ("stick", (END,), (0, 0)),
        ("slip+:stick", (STOP, END), (1, 0, 0)),
        ("slip-:stick:late", (END, STOP), (-1, -1, 0)),
        ("slip+:slip-", (STOP, END), (1, -1, -1)),
    ],
)
def test_the_rows_of_a_hit_are_those_of_poisson_and_coulomb(
    course: str, order: tuple[int, ...], signs: tuple[int, ...]
) -> None:
    """At any unknowns: with e = 0.8, mu = 0.3 and the sliding velocity x_dot + 0.1 a_dot."""
    nlp = Transcription(back(sequence=[f"floor:{course}"]))
    lay, scaled = nlp.layout, np.random.default_rng(1).uniform(0.5, 2.0, nlp.n)
    x = nlp.physical(scaled)
    values = np.concatenate([nlp.equality(scaled), nlp.inequality(scaled)]) * nlp.row_sizes
    index = {b.name: b.index for b in (*nlp.equalities, *nlp.inequalities)}
    dP = np.diff([0.0, *x[lay.hit.P_h[0, list(order)]], x[lay.impact.lam[0]]])
    dT = np.diff([0.0, *x[lay.hit.T_h[0, list(order)]], x[lay.contact.T_c[0, 0]]])
    slides = [x[v[0, 0]] + 0.1 * x[v[0, 2]] for v in (lay.impact.v_a, lay.impact.v_c)]
    expected = {"restitution": {(0,): 1.8 * x[lay.hit.P_h[0, END]] - x[lay.impact.lam[0]]}}
    expected["slips"] = {(0, k): dT[k] + s * 0.3 * dP[k] for k, s in enumerate(signs) if s}
    ends = enumerate((signs[0], signs[-1]))
    expected["heads"] = {(0, side): s * slides[side] for side, s in ends if s}
    last = len(order)
    cone = {(0, last, side): 0.3 * dP[-1] + way * dT[-1] for side, way in enumerate((-1, 1))}
    expected["bears"] = {} if signs[-1] else cone
    for name, rows in expected.items():
        stated = {at: values[row] for at, row in np.ndenumerate(index[name]) if row >= 0}
        assert stated == pytest.approx(rows, abs=1e-12), name


@pytest.mark.parametrize("e", [0.0, 0.8])
def test_a_ball_that_is_thrown_without_sliding_sticks_from_the_beginning(e: float) -> None:
    start = {"x": 0, "y": 0.5, "a": 0, "x_dot": (0.5, 1), "y_dot": -1, "a_dot": 0}
    problem = back(
        start=start, goal={"x": 0.5}, sequence=["floor:stick"], restitution=e,
        parameters={"g": 0},
    )  # fmt: skip
    solution = answer_of(problem)
    hit, (before, after) = solution.collisions[0], solution.phases
    assert hit.tractions["floor"] == pytest.approx(0, abs=1e-9)  # it rolls off as it came
    assert before.v[-1, 0] + 0.1 * before.v[-1, 2] == pytest.approx(0, abs=1e-9)
    np.testing.assert_allclose(after.v[0, [0, 2]], before.v[-1, [0, 2]], atol=1e-8)


@pytest.mark.slow
def test_a_spinning_ball_comes_back_at_the_known_cost(tmp_path: Path) -> None:
    """The spin that it needs follows from the fall: the torque is constant, and the friction sticks
    with -s / (1 + 1/k)."""
    solution = answer_of(back())
    down = np.sqrt(2 * 0.9 / 9.81)
    v_up = 0.8 * 9.81 * down
    up = (v_up + np.sqrt(v_up**2 - 2 * 9.81 * 0.4)) / 9.81  # the later time at half a metre
    traction = -(1 + down / up)  # v after = -down / up
    slides = -traction * (1 + 1 / 0.4)
    torque = 0.4 * 0.1 * (slides - 1) / down
    assert solution.final_time == pytest.approx(down + up, rel=1e-9)
    assert solution.cost == pytest.approx(torque**2 / 2 * down, rel=1e-9)
    assert solution.collisions[0].tractions["floor"] == pytest.approx(traction, rel=1e-9)
    solution.save(tmp_path / "s.npz")
    again = dmoc.Solution.load(tmp_path / "s.npz")
    assert again.collisions[0].word == "floor:slip+:stick:late"
    assert str(again.collisions[0]).count("of floor") == 2
    for steps in (20, 33):
        warm = answer_of(back(steps=steps), guess=again)
        assert warm.iterations <= 10
        assert warm.cost == pytest.approx(solution.cost, rel=1e-9)


@pytest.mark.slow
def test_sensitivities_equal_differences_of_solved_problems() -> None:
    problem = back()
    solution = dmoc.solve(problem)
    slopes = dmoc.sensitivities(problem.but(sequence=["floor"]), solution)  # it tells the way
    step = 1e-4

    def cost(**changes: object) -> float:
        return dmoc.solve(back(**changes), guess=solution).cost

    by_e = (cost(restitution=0.8 + step) - cost(restitution=0.8 - step)) / (2 * step)
    assert slopes["restitution"]["floor"] == pytest.approx(by_e, rel=1e-5)
    by_r = (cost(parameters={"r": 0.1 + step}) - cost(parameters={"r": 0.1 - step})) / (2 * step)
    assert slopes["parameters"]["r"] == pytest.approx(by_r, rel=1e-4)
    assert slopes["parameters"]["mu"] == pytest.approx(0, abs=1e-6)  # friction sticks
    sliding = back(parameters={"mu": 0.2}, sequence=["floor:slip+"], goal={"y": 0.5, "a": 20.0})
    slid = answer_of(sliding)
    by_mu = [
        dmoc.solve(sliding.but(parameters={"mu": 0.2 + s}), guess=slid).cost for s in (-step, step)
    ]
    assert dmoc.sensitivities(sliding, slid)["parameters"]["mu"] == pytest.approx(
        (by_mu[1] - by_mu[0]) / (2 * step), rel=1e-4
    )


@pytest.mark.slow
def test_a_hit_that_does_not_say_how_it_goes_is_tried_in_its_ways() -> None:
    solution = answer_of(back(sequence=["floor"]))
    assert [c.word for c in solution.collisions] == ["floor:slip+:stick:late"]
    assert "of 10 ways through the hits with friction led to a motion" in solution.message
    assert solution.cost == pytest.approx(dmoc.solve(back()).cost, rel=1e-6)


def test_the_law_says_the_course_of_a_hit_as_the_check_does() -> None:
    """From random states: by the check's own integration of the impact."""
    r = np.random.default_rng(3)
    courses = set[str]()
    for _ in range(2000):
        root, mu, e = r.normal(size=(2, 2)), r.uniform(0.01, 2), r.choice([0.0, r.uniform(0, 1)])
        A, rates = root @ root.T + 1e-3 * np.eye(2), np.array([-r.uniform(0.01, 2), r.normal()])
        courses.add(impulses(rates, A, Coefficients(mu, e)).course)
        assert str(course_of(rates, A, mu, e)) == impulses(rates, A, Coefficients(mu, e)).course
    assert courses == set(COURSES)


def bouncing(hits: int) -> dmoc.Problem:
    goal = {"x": 0.9, "y": 0.3}
    return back(sequence=["floor"] * hits, goal=goal, final_time=(0.2, 3.6), restitution=0.9)


@pytest.mark.slow
def test_the_courses_of_three_hits_follow_from_their_motions() -> None:
    """There are 1000; a ball that bounces with e = 0.9 is at 0.3 m or higher all along."""
    solution = answer_of(bouncing(hits=3), starts=1)
    assert [c.word for c in solution.collisions] == ["floor:slip+:stick"] * 3
    (tried,) = re.findall(r"of (\d+) ways through the hits", solution.message)
    assert int(tried) <= 100


@pytest.mark.slow
def test_hits_are_all_alike_where_their_motions_say_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of 100 ways some 30 are tried."""
    monkeypatch.setattr(open_hits._Tries, "follow_the_law", lambda _: None)
    solution = answer_of(bouncing(hits=2), starts=1)
    assert [c.word for c in solution.collisions] == ["floor:slip+:stick"] * 2
    (tried,) = re.findall(r"of (\d+) ways through the hits", solution.message)
    assert int(tried) <= 40


@pytest.mark.slow
@pytest.mark.parametrize("e", [0.0, 0.6])
def test_a_puck_that_turns_or_stops_while_it_lands(e: float) -> None:
    """Sliding stops in the landing where friction can take all of it; a landing is plastic,
    whatever the restitution of its surface."""
    problem = dmoc.Problem(
        landing_system(), start={"x": 0, "y": 0.2, "x_dot": 0.1}, goal={"x": 0.2, "x_dot": 0.0},
        sequence=["+floor:slip+:stick", "floor:slip+", "floor:stick"], steps=10,
        final_time=(0.5, 2), bounds={"u": (-3, 3)}, restitution=e,
    )  # fmt: skip
    solution = answer_of(problem)
    event = solution.collisions[0]
    assert event.word == "+floor:slip+:stick" and event.lands == ("floor",)
    before = solution.phases[0].v[-1]
    assert event.impulses["floor"] == pytest.approx(-before[1], rel=1e-9)
    assert event.tractions["floor"] == pytest.approx(-before[0], rel=1e-9)
    assert solution.phases[1].rubbing == {"floor": 0}


def test_a_way_that_the_law_does_not_go_is_contradicted_by_the_check() -> None:
    from dataclasses import replace

    from dmoc.check.check import verify

    solution = dmoc.solve(back())
    assert solution.kernels is not None
    motion = solution.trajectory
    hit = motion.collisions[0]
    tractions = {"floor": 0.9 * hit.tractions["floor"]}
    wrong = replace(hit, course="slip+", tractions=tractions)
    check = verify(replace(motion, collisions=(wrong,)), solution.kernels)
    assert not check.passed
    assert "goes slip+:stick:late, not slip+ as planned" in check.message


@pytest.mark.slow
def test_a_hit_that_would_jam_is_told_why() -> None:
    """Sliding ahead with much friction, the masses so coupled that this presses the contact
    together: the law stops the sliding first."""
    inverse = np.array([[1.0, 0.9], [0.9, 1.0]])
    mass, v = np.linalg.inv(inverse), (1.0, -1.0)
    problem = dmoc.Problem(
        coupled(),
        sequence=["floor:slip+"],
        restitution=0.5,
        parameters={"mu": 2.0, "m_x": mass[0, 0], "m_xy": mass[0, 1], "m_y": mass[1, 1]},
        **thrown(v, {"x": 0.0, "y": 0.0}),  # type: ignore[arg-type]
    )
    jammed = dmoc.solve(problem, starts=1)
    assert jammed.status == "infeasible"
    assert "sliding as slip+ presses floor together at event 1" in jammed.message
    stopped = answer_of(problem.but(sequence=["floor:slip+:stick"]), starts=1)
    law = impulses(np.array([-1.0, 1.0]), inverse, Coefficients(2.0, 0.5))
    assert stopped.collisions[0].impulse == pytest.approx(law.normal, rel=1e-8)


@pytest.mark.slow
def test_the_search_offers_the_ways_through_a_hit() -> None:
    result = dmoc.search(back(sequence=[]), max_collisions=1, events=["floor"])
    assert len(result.nodes) == 11 and result.best is not None
    assert result.best.sequence == ("floor:slip+:stick:late",)


@pytest.mark.slow
def test_the_figure_names_the_way(tmp_path: Path) -> None:
    figure = dmoc.solve(back(), starts=1).plot(tmp_path / "s.png")
    words = [text.get_text() for axes in figure.axes for text in axes.texts]
    assert "floor:slip+:stick:late" in words


def test_a_program_needs_the_way_through_a_hit() -> None:
    with pytest.raises(ProblemError, match="by one of 'floor:slip\\+', 'floor:slip-', "):
        Transcription(back(sequence=["floor"]))
