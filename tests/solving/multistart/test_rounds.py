"""Rounds of starts: what the next one has, when the mesh gets finer, how far neighbours are."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from systems import double_integrator

import dmoc
from dmoc.base.deadline import ENDLESS
from dmoc.solvers.outcome import Options, Status
from dmoc.solving.attempts import Attempt
from dmoc.solving.multistart import rounds
from dmoc.solving.multistart.effort import Effort
from dmoc.solving.multistart.exploration import coarse_of
from dmoc.solving.multistart.ranking import Refinements
from dmoc.solving.multistart.rounds import Rounds

EFFORT = Effort(first=4, random=2, beside=6, most=40)


def search(problem: dmoc.Problem, effort: Effort = EFFORT) -> Rounds:
    return Rounds.begun(Refinements(problem), coarse_of(problem), effort, Options(), ENDLESS, {})


def names(found: Rounds) -> list[str]:
    return [start.name.split()[0] for start in found.starts]


def ending(failing: Callable[[int, str], bool]) -> Callable[..., list[Attempt]]:
    """Attempts of which some are no minima, by the round and the kind of their start."""
    solve, sizes = rounds._attempts, list[int]()

    def attempts(programs: Any, points: Sequence[Any], *others: Any) -> list[Attempt]:
        sizes.append(len(points))
        kinds = ["far"] * (len(points) - 6) + ["beside"] * 6 if len(sizes) > 1 else ["far"] * 99
        return [
            a.ending(Status.STALLED) if failing(len(sizes), kind) else a
            for a, kind in zip(solve(programs, points, *others), kinds, strict=False)
        ]

    return attempts


def test_the_first_round_is_far_the_second_beside_later_ones_both() -> None:
    found = search(double_integrator(30))
    assert found._next() == (4, 0)
    found._round(4, 0)
    assert found._next() == (0, 6)
    found._round(0, 6)
    assert found._next() == (2, 6)
    assert names(found) == ["automatic"] + ["random"] * 4 + ["neighbour"] * 6


def test_without_a_minimum_there_are_no_neighbours(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rounds, "_attempts", ending(lambda n, _: n < 3))
    found = search(double_integrator(30))
    found._round(*found._next())
    assert found._next() == (8, 0)
    found._round(8, 0)
    assert not found.minima and found._next() == (8, 0)
    found._round(8, 0)
    assert found.minima and found._next() == (0, 6)


@pytest.mark.parametrize("met, leads", [(False, False), (False, True), (True, False)])
def test_starts_that_were_given_up_go_on_where_nothing_leads_to_a_motion(
    monkeypatch: pytest.MonkeyPatch, met: bool, leads: bool
) -> None:
    """Of three one is given up, and one ends at the limit of iterations."""
    found, tried, real = search(double_integrator(8)), list[tuple[int, Any]](), rounds.attempts_from

    def hasty(programs: Any, points: Any, options: Any, hurried: Any = ()) -> list[Attempt]:
        tried.append((len(points), list(hurried)))
        solved = real(programs, points, options)
        if not any(hurried):
            return solved
        late = Status.ITERATION_LIMIT
        first = solved[0] if leads else solved[0].ending(Status.STALLED)
        counts = (9, options.iterations)
        return [
            first,
            *(a.ending(late).counting(n) for a, n in zip(solved[1:], counts, strict=True)),
        ]

    monkeypatch.setattr(rounds, "attempts_from", hasty)
    x, now = found.guesses[0], found.options
    ends = rounds._attempts(found.programs, [x, x, x], now, ENDLESS, [True] * 3, met)
    again = not (met or leads)
    assert tried == [(3, [True] * 3), (1, [])][: 1 + again]
    assert [end.status is Status.SOLVED for end in ends] == [leads, again, False]


@pytest.mark.parametrize(
    "fails, astray, again",
    [(1, False, True), (3, False, False), (1, True, False), (2, False, True)],
)
def test_few_starts_that_were_given_up_go_on_where_all_others_agree(
    monkeypatch: pytest.MonkeyPatch, fails: int, astray: bool, again: bool
) -> None:
    """Of eight, of which one more may end elsewhere."""
    found, real, calls = search(double_integrator(8)), rounds.attempts_from, list[int]()

    def hasty(programs: Any, points: Any, options: Any, hurried: Any = ()) -> list[Attempt]:
        calls.append(len(points))
        solved = real(programs, points, options)
        if not any(hurried):
            return solved
        late = [a.ending(Status.ITERATION_LIMIT).counting(9) for a in solved[:fails]]
        first = [solved[-1].ending(Status.STALLED)] if astray else solved[-1:]
        return [*late, *solved[fails:-1], *first]

    monkeypatch.setattr(rounds, "attempts_from", hasty)
    points = [found.guesses[0]] * 8
    ends = rounds._attempts(found.programs, points, found.options, ENDLESS, [True] * 8, False)
    assert calls == ([8, fails] if again else [8])
    unsolved = sum(end.status is not Status.SOLVED for end in ends)
    assert unsolved == (0 if again else fails + astray)


def test_all_but_a_guess_that_is_given_are_in_a_hurry(monkeypatch: pytest.MonkeyPatch) -> None:
    hasty, solve = list[Any](), rounds._attempts

    def attempts(*arguments: Any) -> list[Attempt]:
        hasty.append(arguments[4:])
        return solve(*arguments)

    monkeypatch.setattr(rounds, "_attempts", attempts)
    problem = double_integrator(8)
    given = {"given": search(problem).guesses[0]}
    found = Rounds.begun(Refinements(problem), problem, EFFORT, Options(), ENDLESS, given)
    found._round(2, 0)
    found._round(0, 2)
    assert names(found)[:2] == ["given", "automatic"]
    assert hasty == [([False, True, True, True], False), ([True, True], True)]


def test_there_are_no_more_than_the_most() -> None:
    found = search(double_integrator(30), replace(EFFORT, most=11))
    found._round(*found._next())
    found._round(*found._next())
    assert found._next() == (0, 1)
    found._round(0, 1)
    assert found._next() == (0, 0)
    found.effort = replace(found.effort, lasts=True)
    assert found._next() == (2, 6)
    given = search(double_integrator(30), replace(EFFORT, total=3))
    assert given._next() == (2, 0)


def test_starts_since_the_best_are_counted() -> None:
    """All lead to one minimum: the first of them has met it."""
    found = search(double_integrator(30))
    found._round(4, 0)
    assert found.unbeaten == 4
    found.minima = [replace(found.minima[0], cost=13.0)]  # as if they had led to a dearer one
    found._round(0, 6)
    assert found.unbeaten == 5 and found.minima[0].first == "neighbour 1"
    assert found.minima[0].far == 0 and found.minima[1].far == 5


@pytest.mark.parametrize("share, factor", [(0.0, 0.5), (1.0, 1.0)])
def test_waves_get_smaller_where_few_neighbours_end(
    monkeypatch: pytest.MonkeyPatch, share: float, factor: float
) -> None:
    fails = ending(lambda _, kind: kind == "beside" and share < 0.5)
    monkeypatch.setattr(rounds, "_attempts", fails)
    found = search(double_integrator(30))
    found._round(4, 0)
    assert found.amplitude == 1.0
    found._round(0, 6)
    assert found.amplitude == factor


@pytest.mark.parametrize("there", [11.0, 12.5, 13.0])
def test_the_mesh_gets_finer_where_the_best_minimum_costs_something_else(
    monkeypatch: pytest.MonkeyPatch, there: float
) -> None:
    """12 on 24 steps of 50: within 5 % on the finer mesh, or less, or more."""
    found = search(double_integrator(50))
    found._round(4, 0)
    coarse, of = found.minima[0], Refinements.of
    assert coarse.cost == pytest.approx(12, rel=1e-2) and found.coarse.phase_steps == (24,)

    def told(refinements: Refinements, basin: Any, options: Options) -> Attempt:
        attempt = of(refinements, basin, options)
        if refinements.problem.phase_steps != (50,):
            return attempt
        scale = attempt.nlp.scale
        other = replace(scale, cost=scale.cost * there / basin.cost)
        monkeypatch.setattr(attempt.nlp, "scale", other)
        return attempt

    monkeypatch.setattr(Refinements, "of", told)
    found._refine_mesh()
    finer = abs(there - coarse.cost) > 0.05 * max(there, coarse.cost)
    assert found.coarse.phase_steps == ((48,) if finer else (24,))
    assert found.minima[0].problem.phase_steps == found.coarse.phase_steps
    assert found.minima[0].starts == 5 and found.unbeaten == (0 if finer else 4)
    found._round(0, 6)
    assert found.minima[0].starts == 11 and np.isfinite(found.minima[0].cost)


def test_the_mesh_of_a_problem_with_few_steps_stays() -> None:
    found = search(double_integrator(20))
    found._round(4, 0)
    found._refine_mesh()
    assert found.coarse.phase_steps == (20,) and found.unbeaten == 4
