"""What is taken of several ends: minima that starts agree on, ranks, grazes and their collisions,
minimal times that were only estimated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols
from systems import unit_mass

import dmoc
from dmoc.base.deadline import ENDLESS
from dmoc.guess.automatic import initial_guesses
from dmoc.program.scaling import scale_of
from dmoc.solvers.diagnosis import diagnose
from dmoc.solvers.outcome import Duals, Options, Outcome, Residuals, Status
from dmoc.solving import attempts
from dmoc.solving.attempts import Attempt, LocalSolver
from dmoc.solving.multistart.effort import Effort, met_by_cost, unseen_share
from dmoc.solving.multistart.minima import Basin, joined
from dmoc.solving.multistart.ranking import Ranked, _seeks_effect
from dmoc.solving.open_hits import _Tries

NONE = np.zeros(0)


def met(
    *counts: int,
    costs: Sequence[float] = (1.0, 2.0, 3.0, 4.0),
    far: int = 5,
    grazing: int = 0,
) -> list[Basin]:
    """Minima of some costs, and how many starts have met each, so many at most far from all; the
    first ones have a collision without effect."""

    def attempt(grazes: bool) -> Any:
        laws = SimpleNamespace(impact=SimpleNamespace(grazing=np.array([grazes])))
        return SimpleNamespace(nlp=SimpleNamespace(scale=SimpleNamespace(cost=1.0), laws=laws))

    return [
        Basin(attempt(i < grazing), c, np.ones(1), n, "", min(n, far))
        for i, (c, n) in enumerate(zip(costs, counts, strict=False))
    ]


def test_the_share_of_unseen_minima_is_that_of_minima_met_once() -> None:
    """(f + 1) / (n + 2), of n starts and f minima met once; costs that are equal count as one."""

    def unseen(minima: list[Basin]) -> float:
        return unseen_share(met_by_cost(minima)[:, 0])

    assert unseen(met(7, 1, 1, 2)) == pytest.approx(3 / 13)
    assert unseen(met(8)) == pytest.approx(1 / 10)
    assert unseen(met(1, 1, 6, costs=(1.0, 1.0, 2.0))) == pytest.approx(1 / 10)
    assert unseen(met(6, 1, 1, costs=(1.0, 2.0, 2.0))) == pytest.approx(1 / 10)
    assert met_by_cost(met(6, 1, 1, costs=(1.0, 2.0, 2.0))).tolist() == [[6, 5], [2, 2]]


def test_starts_suffice_where_the_best_is_met_often_and_little_is_unseen() -> None:
    """Met five times, 16 since the first of these, and few minima met once, of all starts and of
    those far from them."""
    effort = Effort()
    assert effort.suffices(met(20, 10), 40, 16)
    assert not effort.suffices(met(20, 10), 40, 15)
    assert not effort.suffices(met(4, 30), 40, 16)
    assert effort.suffices(met(5, 30), 40, 16)
    assert not effort.suffices(met(20, 10, 1, far=20), 40, 16)  # 2 of 33
    assert effort.suffices(met(30, 10, 1, far=20), 50, 16)  # 2 of 43
    assert effort.suffices(met(9, 5, 5, 5), 40, 16)
    assert not effort.suffices(met(8, 5, 5, 5), 40, 16)  # six each on the average
    assert not effort.suffices(met(20, 10, far=1), 40, 16)  # 3 of 4 of those far away
    assert effort.suffices(met(20, 10, far=3), 40, 16)  # 1 of 8
    assert not effort.suffices(met(20, far=4), 40, 16)  # 1 of 6
    assert not effort.suffices([], 40, 40)
    assert not replace(effort, total=50).suffices(met(20, 10), 40, 16)


def test_a_minimum_whose_collisions_have_an_effect_is_looked_for_longer() -> None:
    """Where none is known, until six times as many starts have met no cheaper one; else it is the
    best of these that is to be met often."""
    effort = Effort()
    assert not effort.suffices(met(20, 10, grazing=2), 200, 95)
    assert effort.suffices(met(20, 10, grazing=2), 200, 96)
    assert not effort.suffices(met(20, 4, grazing=1), 200, 96)
    assert effort.suffices(met(20, 5, grazing=1), 200, 16)


def test_minima_that_graze_are_passed_over_where_a_dearer_one_does_not() -> None:
    solved, grazes = (
        cast(Ranked, SimpleNamespace(solution=SimpleNamespace(status=status)))
        for status in (Status.SOLVED, Status.GRAZES)
    )
    left = met(1, 1, grazing=1)
    assert _seeks_effect([grazes, grazes], left)
    assert not _seeks_effect([grazes, solved], left) and not _seeks_effect([grazes], left[:1])


def test_starts_suffice_where_all_of_them_lead_to_one_minimum() -> None:
    assert Effort().suffices(met(9), 9, 8)
    assert not Effort().suffices(met(9), 10, 9)
    assert not Effort().suffices(met(8, 1), 9, 8)


def test_starts_of_one_minimum_are_counted_together() -> None:
    one = met(3, far=2)[0].met_by(met(4, far=1)[0])
    assert (one.starts, one.far) == (7, 3)


def test_of_equal_costs_the_minimum_that_was_met_first_comes_first() -> None:
    attempt: Any = SimpleNamespace(nlp=SimpleNamespace(scale=SimpleNamespace(cost=1.0)))
    minima = [Basin(attempt, 1.0, np.array([1.0])), Basin(attempt, 3.0, np.array([1.0]))]
    new = Basin(attempt, 1.0 - 1e-12, np.array([2.0]))
    assert [float(b.durations[0]) for b in joined(minima, new)] == [1.0, 2.0, 1.0]
    cheaper = replace(new, cost=0.9)
    assert [b.cost for b in joined(minima, cheaper)] == [0.9, 1.0, 3.0]
    dearer = replace(new, cost=4.0)
    assert [b.cost for b in joined(minima, dearer)] == [1.0, 3.0, 4.0]


def test_a_collision_without_effect_ranks_behind_a_dearer_one_with_it() -> None:
    def ranked(status: Status, cost: float) -> Ranked:
        solution: Any = SimpleNamespace(status=status, cost=cost)
        minimum: Any = None
        return Ranked(minimum, minimum, solution, cost)

    best = sorted([ranked(Status.GRAZES, 1.0), ranked(Status.SOLVED, 2.0)], key=Ranked.rank)[0]
    assert best.solution.status is Status.SOLVED


def test_ways_that_are_confirmed_come_first_the_cheapest_before_others() -> None:
    def tried(status: Status, cost: float) -> Any:
        return SimpleNamespace(status=status, cost=cost)

    none: Any = None
    ways = _Tries(none, none, none, ENDLESS)
    ways.tried |= {
        ("nothing",): None,
        ("doubtful",): tried(Status.NOT_VERIFIED, 0.5),
        ("dear",): tried(Status.SOLVED, 2.0),
        ("cheap",): tried(Status.GRAZES, 1.0),
    }
    assert sorted(ways.tried, key=ways.rank) == [("cheap",), ("dear",), ("doubtful",), ("nothing",)]


class Ends:
    """A method that ends as it is told, with the cost as its only unknown, and keeps the programs
    it was given."""

    def __init__(self, *ends: tuple[float, float]) -> None:
        self.ends, self.programs = list(ends), list[Any]()

    def __call__(self, nlp: Any, x: np.ndarray, options: Options) -> Outcome:
        cost, time = self.ends[len(self.programs)]
        self.programs.append(nlp)
        duals = Duals(NONE, np.array([time]), np.zeros(1))
        left = Residuals(1e-9, 1e-12)
        return Outcome(Status.SOLVED, "", np.array([cost]), duals, 1, left)


def program(timed: bool = False) -> Any:
    times = np.zeros(1 if timed else 0, dtype=np.intp)
    return SimpleNamespace(cost=lambda x: float(x[0]), minimal_times=times)


@pytest.mark.parametrize(("collision", "cost"), [(2.0, 1.0), (0.5, 0.5)])
def test_the_collision_of_a_graze_is_taken_where_it_costs_less(
    monkeypatch: pytest.MonkeyPatch, collision: float, cost: float
) -> None:
    monkeypatch.setattr(attempts, "suspects", lambda nlp, x: np.zeros(1, dtype=np.intp))
    monkeypatch.setattr(attempts, "pays", lambda nlp, outcome: True)
    monkeypatch.setattr(attempts, "pushed", lambda nlp, x, at: x)
    nlp, programs = program(), cast(Any, SimpleNamespace(grazes=lambda nlp, at: program()))
    method = Ends((1.0, 0.0), (1.5, 0.0), (collision, 0.0))
    end = LocalSolver(programs, method).minimised(nlp, np.ones(1), Options())
    assert end.outcome.x == cost and end.outcome.iterations == 3
    assert method.programs[2] is end.nlp is nlp


@pytest.mark.parametrize(
    ("beside", "last", "best"),
    [
        ((1.0,), 1.0 + 0.9e-5, 1.0 + 0.9e-5),
        ((1.0,), 1.0 + 1.1e-5, 1.0),  # the method itself leaves the minimum
        ((1.0,), 0.5, 0.5),
        ((2.0, 1.0, 1.5), 1.0, 1.0),
        ((1.0, 2.0, 1.5), 1.5, 1.0),
    ],
)
def test_beside_a_saddle_the_method_has_the_last_word_where_it_keeps_the_minimum(
    monkeypatch: pytest.MonkeyPatch, beside: tuple[float, ...], last: float, best: float
) -> None:
    """From a saddle of cost 3 the compiled method gets to minima, the cheapest of which the method
    starts from."""
    monkeypatch.setattr(attempts, "suspects", lambda nlp, x: np.zeros(0, dtype=np.intp))
    nlp, programs = program(), cast(Any, SimpleNamespace(free=lambda nlp: nlp, compiled=True))
    compiled, method = Ends(*((cost, 0.0) for cost in beside)), Ends((last, 0.0))
    monkeypatch.setattr(LocalSolver, "compiled", lambda programs: LocalSolver(programs, compiled))
    saddle = Attempt(nlp, Ends((3.0, 0.0))(nlp, np.zeros(1), Options()))
    points = [np.array([cost]) for cost in beside]
    end = LocalSolver(programs, method)._lower(saddle, points, Options())
    assert end.outcome.x == best and end.outcome.iterations == len(beside) + 1


@pytest.mark.parametrize("beside", [(3.0,), (3.5, 3.0), ()])
def test_a_saddle_without_anything_cheaper_beside_it_stays_stationary(
    monkeypatch: pytest.MonkeyPatch, beside: tuple[float, ...]
) -> None:
    monkeypatch.setattr(attempts, "suspects", lambda nlp, x: np.zeros(0, dtype=np.intp))
    nlp, programs = program(), cast(Any, SimpleNamespace(free=lambda nlp: nlp, compiled=False))
    saddle = Attempt(nlp, Ends((3.0, 0.0))(nlp, np.zeros(1), Options()))
    solver = LocalSolver(programs, Ends(*((cost, 0.0) for cost in beside)))
    end = solver._lower(saddle, [np.zeros(1)] * len(beside), Options())
    assert end.status is Status.STATIONARY and end.outcome.x == 3.0


def test_an_estimated_minimal_time_that_holds_a_solution_is_dropped(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(attempts, "suspects", lambda nlp, x: np.zeros(0, dtype=np.intp))
    timed, free = program(timed=True), program()
    programs: Any = SimpleNamespace(free=lambda nlp: free)
    method = Ends((2.0, 0.3), (1.0, 0.0))
    end = LocalSolver(programs, method).minimised(timed, np.ones(1), Options())
    assert end.nlp is free and end.outcome.x == 1.0
    kept = LocalSolver(programs, Ends((2.0, 0.0))).minimised(timed, np.ones(1), Options())
    assert kept.nlp is timed


@pytest.mark.slow
def test_what_is_violated_does_not_stand_against_itself() -> None:
    """A speed of 3 where 1 is allowed, and brakes that leave 2 of it."""
    x, u = dynamicsymbols("x u")
    system = unit_mass(
        "hurried", cost=u**2 / 2, path_constraints={"speed": x.diff() <= sp.Integer(1)}
    )
    problem = dmoc.Problem(
        system, start={"x": 0.0, "x_dot": (2.9, 3.0)}, goal={"x": None, "x_dot": None},
        steps=10, durations=[1.0], bounds={"u": (-1.0, 1.0)},
    )  # fmt: skip
    guess = initial_guesses(problem)[0].x
    diagnosis = diagnose(problem, scale_of(problem, guess), guess, Options())
    assert any("speed" in text for text in diagnosis.missed)
    assert diagnosis.against and not any("speed" in text for text in diagnosis.against)
