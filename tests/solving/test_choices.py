"""What is taken of several ends: minima that starts agree on, ranks, touches and their collisions,
minimal times that were only estimated."""

from __future__ import annotations

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
from dmoc.solving.multistart.exploration import Effort
from dmoc.solving.multistart.minima import Basin
from dmoc.solving.multistart.ranking import Ranked
from dmoc.solving.open_hits import _Tries

NONE = np.zeros(0)


def test_starts_agree_where_most_minima_and_enough_starts_are_the_best() -> None:
    attempt: Any = SimpleNamespace(nlp=SimpleNamespace(scale=SimpleNamespace(cost=1.0)))

    def met(best: int, other: int) -> list[Basin]:
        return [Basin(attempt, 1.0, np.ones(1), best), Basin(attempt, 2.0, np.ones(1), other)]

    effort = Effort()  # three of four minima, four of ten starts
    assert not effort.agree(met(3, 1), 16)
    assert not effort.agree(met(7, 9), 16)
    assert effort.agree(met(7, 1), 16)


def test_a_collision_without_effect_ranks_behind_a_dearer_one_with_it() -> None:
    def ranked(status: Status, cost: float) -> Ranked:
        solution: Any = SimpleNamespace(status=status, cost=cost)
        minimum: Any = None
        return Ranked(minimum, solution, cost)

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
def test_the_collision_of_a_touch_is_taken_where_it_costs_less(
    monkeypatch: pytest.MonkeyPatch, collision: float, cost: float
) -> None:
    monkeypatch.setattr(attempts, "suspects", lambda nlp, x: np.zeros(1, dtype=np.intp))
    monkeypatch.setattr(attempts, "pays", lambda nlp, outcome: True)
    monkeypatch.setattr(attempts, "pushed", lambda nlp, x, at: x)
    nlp, programs = program(), cast(Any, SimpleNamespace(touches=lambda nlp, at: program()))
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
