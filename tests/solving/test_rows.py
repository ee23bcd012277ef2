"""Neighbours that are solved as rows: each is what a solve of its own finds, in every word."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import block_and_wall
import numpy as np
import pytest
from batch_rows import limited, neighbours, pendulum, periodic, puck, same, watched

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.program.rows import row_numbers
from dmoc.program.scaling import scale_of
from dmoc.program.stacked import Stacked
from dmoc.program.transcription import Transcription
from dmoc.solvers import ipm
from dmoc.solvers.outcome import Duals, Options
from dmoc.solvers.row_solves import solve_rows
from dmoc.solving import rows
from dmoc.solving.mesh import one_mesh

pytestmark = pytest.mark.slow


CASES = {
    "limited power": limited,
    "one hit": lambda: pendulum(2),
    "order 4": lambda: pendulum(4),
    "linear inputs": lambda: pendulum(2, controls="linear"),
    "fixed time": lambda: pendulum(2, final_time=0.95),
    "durations and places": lambda: pendulum(
        4, durations=[(0.1, 0.8), None], via=[{"x": (-5.0, 5.0)}]
    ),
    "bounded velocity": lambda: pendulum(4, bounds={"F": (-200.0, 200.0), "x_dot": (-90.0, 90.0)}),
    "two hits": lambda: puck("east", "north"),
    "no hit": lambda: puck(),
    "a length to choose": lambda: pendulum(2, design={"l": (0.3, 0.7)}),
    "a mass to choose": lambda: block_and_wall.problem(0.8, 10, 4).but(design={"m": (0.5, 2.0)}),
    "periodic states": periodic,
    "quantities without bounds": watched,
    "a bound on the wall": lambda: block_and_wall.problem(0.8, 10, 4).but(
        bounds={"x": (-1.0, 1.0)}
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_rows_are_what_solves_find(
    case: str,
    together: list[int],
    alone: Callable[..., dmoc.Batch],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What the check confirms needs no solution."""
    base = CASES[case]()
    guess = dmoc.solve(base, "ipm", starts=1, verify=False)
    problems = neighbours(base, 6, 0.02)
    made, solutions = rows._Rows._solution, 0

    def noted(*args: Any) -> dmoc.Solution:
        nonlocal solutions
        solutions += 1
        return made(*args)

    monkeypatch.setattr(rows._Rows, "_solution", noted)
    batch = dmoc.solve_many(problems, guess=guess)
    count = len(together)
    assert solutions == list(batch.check).count("failed")
    # bounds of velocities are part of the form
    assert count >= (2 if case == "bounded velocity" else 4)
    same(batch, alone(problems, guess=guess))
    assert len(together) == count


@pytest.mark.parametrize("case", CASES)
def test_rows_from_their_own_guesses_are_what_solves_find(
    case: str, together: list[int], alone: Callable[..., dmoc.Batch]
) -> None:
    """Each with sizes of its own, those of a first motion."""
    problems = neighbours(CASES[case](), 5, 0.05)
    batch = dmoc.solve_many(problems)
    count = len(together)
    same(batch, alone(problems))
    assert len(together) == count >= 2


def test_a_guess_that_cannot_be_made_costs_no_other(
    together: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    base, made = pendulum(2), rows.starts_of

    def flawed(problem: dmoc.Problem, *rest: Any) -> Any:
        if problem.parameters["l"] == 0.51:
            raise ZeroDivisionError("by chance")
        return made(problem, *rest)

    monkeypatch.setattr(rows, "starts_of", flawed)
    lengths = (0.5, 0.51, 0.52)
    batch = dmoc.solve_many([base.but(parameters={"l": l}) for l in lengths], verify=False)
    assert batch.solved.all() and together == [0, 2]


def test_what_is_of_another_kind_is_solved_alone(
    together: list[int], alone: Callable[..., dmoc.Batch]
) -> None:
    """No motion, ends and bounds of other kinds, another coefficient of restitution, other
    steps."""
    base = pendulum(4)
    guess = dmoc.solve(base, "ipm", starts=1, verify=False)
    start, goal = base.start, base.goal
    odd = [
        base.but(final_time=(None, 0.05)),
        base.but(start={**start, "alpha_dot": (-1.0, 1.0)}),
        base.but(start={**start, "x": (0.0, 0.1)}),
        base.but(goal={**goal, "x": (-1.0, 1.0)}),
        base.but(restitution=0.7),
        base.but(steps=(6, 9)),
        base.but(bounds={**base.bounds, "x": (None, 10.0)}),
        base.but(bounds={"F": (-1e-3, 1e-3)}),
        base.but(final_time=0.95),
    ]
    plain = neighbours(base, 6, 0.01)
    problems = [plain[0], *(p for pair in zip(plain[1:], odd, strict=False) for p in pair)]
    problems += odd[5:]
    batch = dmoc.solve_many(problems, guess=guess, verify=False, iterations=60)
    few = set(together)
    assert 6 <= len(few) < len(problems) and "infeasible" in batch.status
    same(batch, alone(problems, guess=guess, verify=False, iterations=60))


def test_what_starts_elsewhere_or_rubs_is_solved_alone(
    floor: Kernels, together: list[int], alone: Callable[..., dmoc.Batch]
) -> None:
    """From a motion on other steps, and from one without multipliers; a model with friction."""
    base = pendulum(2)
    guess = dmoc.solve(base, "ipm", starts=1, verify=False)
    finer = neighbours(base.but(steps=(8, 8)), 3, 0.02)
    bare = replace(guess, multipliers={})
    for problems, start in ((finer, guess), (neighbours(base, 3, 0.02), bare)):
        options = {"guess": start, "verify": False}
        same(dmoc.solve_many(problems, **options), alone(problems, **options))
    assert not set(together) - {0, 1, 2}
    together.clear()
    fly = dmoc.Problem(floor, start={"x": 0.0, "y": 1.0}, goal={"x": 0.1}, final_time=0.3, steps=6)
    guess = dmoc.solve(fly, "ipm", starts=1, verify=False)
    batch = dmoc.solve_many([fly, fly], guess=guess, verify=False)
    assert batch.solved.all() and not together


def test_what_chooses_its_mesh_is_solved_alone(
    together: list[int], alone: Callable[..., dmoc.Batch]
) -> None:
    """Beside neighbours whose steps are stated, and are those of its first mesh."""
    refined = puck().but(steps=None)
    stated = refined.but(steps=refined.phase_steps)
    guess = dmoc.solve(stated, "ipm", starts=1, verify=False)
    problems = [p.but(final_time=t) for t in (1.9, 2.0) for p in (stated, refined)]
    batch = dmoc.solve_many(problems, guess=guess, verify=False)
    assert sorted(together) == [0, 2]
    same(batch, alone(problems, guess=guess, verify=False))


def test_rows_that_end_at_a_limit_are_those_of_solves(
    together: list[int], alone: Callable[..., dmoc.Batch]
) -> None:
    base = pendulum(2)
    guess = dmoc.solve(base, "ipm", starts=1, verify=False)
    problems = neighbours(base, 5, 0.02)
    batch = dmoc.solve_many(problems, guess=guess, iterations=2)
    assert set(batch.status) == {"iteration_limit"} and not together
    same(batch, alone(problems, guess=guess, iterations=2))


def test_a_hit_without_effect_is_told_of_a_row(
    together: list[int], alone: Callable[..., dmoc.Batch]
) -> None:
    """The bounds of the force leave it no choice but to touch the wall softly."""
    base = puck("east")
    guess = dmoc.solve(base, "ipm", starts=1, verify=False)
    problems = [base.but(start={**base.start, "x_dot": v}) for v in (1.5, 1.0, 0.5, 0.0, -0.5)]
    same(
        dmoc.solve_many(problems, guess=guess, verify=False),
        alone(problems, guess=guess, verify=False),
    )


def test_rows_of_periodic_states_settle_the_same_gaps(
    together: list[int], alone: Callable[..., dmoc.Batch]
) -> None:
    """Where the puck ends as far from a wall as it begins, that is no constraint of the end."""
    base = puck()
    open_end = base.but(goal={"x": 0.4})
    guess = dmoc.solve(open_end.but(periodic={"y": ("y", 0.05)}), "ipm", starts=1, verify=False)
    problems = [open_end.but(periodic={"y": ("y", d)}) for d in (0.05, 0.04, 0.0)]
    batch = dmoc.solve_many(problems, guess=guess)
    assert together == [0, 1]
    same(batch, alone(problems, guess=guess))


def test_rows_leave_what_is_said_of_quantities_to_solves(together: list[int]) -> None:
    """Bounds of them, their values at the ends, and what is periodic."""
    base = watched()
    said = [
        {"bounds": {"power": (None, 0.9)}}, {"goal": {**base.goal, "power": (-0.1, 0.1)}},
        {"periodic": {"power": ("power", (-0.1, 0.1))}},
    ]  # fmt: skip
    for fields in said:
        pair = [base.but(**fields, final_time=t) for t in (1.0, 1.1)]
        assert dmoc.solve_many(pair, verify=False).solved.all() and not together
    dmoc.solve_many([base, base], verify=False)
    assert together == [0, 1]


@pytest.mark.parametrize("case", ["a length to choose", "periodic states"])
def test_rows_are_the_same_for_any_number_of_threads(
    case: str, together: list[int], alone: Callable[..., dmoc.Batch]
) -> None:
    base = CASES[case]()
    guess = dmoc.solve(base, "ipm", starts=1, verify=False)
    problems, options = neighbours(base, 6, 0.01), {"guess": guess, "verify": False}
    first, *others = (dmoc.solve_many(problems, **options, workers=n) for n in (1, 2, 3))
    assert len(together) >= 12
    same(first, alone(problems, **options))
    for other in others:
        for name in ("cost", "final_time", "impulses", "iterations"):
            assert np.array_equal(getattr(first, name), getattr(other, name), equal_nan=True)
        assert first.check == other.check and first.message == other.message
        assert all(map(np.array_equal, first.design.values(), other.design.values()))


@pytest.mark.parametrize("verify", [True, False])
def test_kept_solutions_are_those_of_rows(
    verify: bool, together: list[int], alone: Callable[..., dmoc.Batch]
) -> None:
    base = pendulum(2, design={"l": (0.3, 0.7)})
    guess = dmoc.solve(base, "ipm", starts=1, verify=False)
    problems = neighbours(base, 4, 0.02)
    options = {"guess": guess, "keep": True, "verify": verify}
    kept = dmoc.solve_many(problems, **options)
    assert together == [0, 1, 2, 3]
    single = alone(problems, **options)
    same(kept, single)
    for mine, own in zip(kept.solutions, single.solutions, strict=True):
        assert mine is not None and own is not None and mine.notes == own.notes
        np.testing.assert_allclose(mine.unknowns, own.unknowns, rtol=1e-12, atol=1e-13)
        assert (mine.verification is None) == (own.verification is None) == (not verify)
    np.testing.assert_array_equal(kept.design["l"], [s.design["l"] for s in kept.solutions if s])


def test_a_solve_goes_on_where_its_row_has_ended(
    together: list[int], alone: Callable[..., dmoc.Batch], monkeypatch: pytest.MonkeyPatch
) -> None:
    """From its guess and its end: neither is found twice."""
    base = pendulum(2)
    problems = neighbours(base, 3, 0.02)
    single = alone(problems, iterations=3, verify=False)
    assert set(single.status) == {"iteration_limit"}

    def refused(*args: Any, **options: Any) -> Any:
        raise ZeroDivisionError("it is known")

    monkeypatch.setattr(one_mesh, "starts_of", refused)
    monkeypatch.setattr(ipm, "solve_ipm", refused)
    same(dmoc.solve_many(problems, iterations=3, verify=False), single)
    assert not together


def test_what_judges_a_row_starts_elsewhere(
    together: list[int], alone: Callable[..., dmoc.Batch]
) -> None:
    """A cost that falls with the time: longer motions are solved from the answer."""
    base = watched()
    problems = [base.but(final_time=(low, None)) for low in (1.0, 1.1)]
    single = alone(problems)
    assert set(single.status) == {"stalled"}
    same(dmoc.solve_many(problems), single)


def test_an_error_of_rows_is_left_to_solves(
    together: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """That of a guess that fits none, and that of all rows."""
    base = pendulum(2)
    guess = dmoc.solve(base, "ipm", starts=1, verify=False)
    shorter = [base.but(sequence=(), steps=10, goal={"x": 0.1}) for _ in range(3)]
    batch = dmoc.solve_many([base, *shorter], guess=guess, verify=False)
    assert batch.status == ("solved", "refused", "refused", "refused")
    assert "guess has 1 collisions" in batch.message[1] and not together

    def flawed(*args: Any) -> Any:
        raise ZeroDivisionError("by chance")

    monkeypatch.setattr(rows, "row_numbers", flawed)
    assert dmoc.solve_many([base, base], guess=guess, verify=False).solved.all() and not together


def test_arrays_of_other_rows_are_refused() -> None:
    """Compiled code trusts their shapes."""
    base = pendulum(2)
    guess = dmoc.solve(base, "ipm", starts=1, verify=False)
    x = guess.unknowns
    nlp = Transcription(base, scale_of(base, x, minimum=True))
    numbers = row_numbers(Stacked([base, base]), nlp, np.tile(x, (2, 1)), True)
    count = nlp.n_eq, nlp.n_in, nlp.n
    duals = Duals(*(np.zeros((2, size)) for size in count))
    start = np.tile(nlp.scaled(x), (2, 1))
    assert solve_rows(nlp, numbers, start, duals, Options()).strict.all()
    for fewer in (start[:, :-1], start[:1]):
        with pytest.raises(ValueError, match="expected an array of shape"):
            solve_rows(nlp, numbers, fewer, duals, Options())
    with pytest.raises(ValueError, match="expected an array of shape"):
        solve_rows(
            nlp, replace(numbers, parameters=numbers.parameters[:1]), start, duals, Options()
        )
