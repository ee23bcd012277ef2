"""Neighbours that are solved as rows: each is what a solve of its own finds, in every word."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import block_and_wall
import numpy as np
import pytest
from sympy.physics.mechanics import dynamicsymbols
from systems import unit_mass

import dmoc
from dmoc.base.deadline import Deadline
from dmoc.codegen.kernels import Kernels
from dmoc.models.registry import find
from dmoc.program.rows import row_numbers
from dmoc.program.scaling import scale_of
from dmoc.program.stacked import Stacked
from dmoc.program.transcription import Transcription
from dmoc.solvers.outcome import Duals, Options
from dmoc.solvers.row_solves import solve_rows
from dmoc.solving import many, rows
from dmoc.solving.row import Row

pytestmark = pytest.mark.slow

WORDS = ("status", "message", "collisions", "check")
NUMBERS = ("cost", "final_time", "collision_times", "impulses", "iterations")


@pytest.fixture
def together(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The numbers of the problems that were solved as rows, however long they take."""
    monkeypatch.setattr(many.Pace, "together", 64)
    numbers, solved = list[int](), many.solved_rows

    def noted(*args: Any) -> Iterator[Row]:
        for row in solved(*args):
            numbers.append(row.number)
            yield row

    monkeypatch.setattr(many, "solved_rows", noted)
    return numbers


@pytest.fixture
def alone(monkeypatch: pytest.MonkeyPatch) -> Callable[..., dmoc.Batch]:
    """The rows of solves one by one."""

    def solved(problems: list[dmoc.Problem], **options: Any) -> dmoc.Batch:
        with monkeypatch.context() as patch:
            patch.setattr(rows, "FEWEST", len(problems) + 1)
            return dmoc.solve_many(problems, **options)

    return solved


def same(a: dmoc.Batch, b: dmoc.Batch) -> None:
    for name in WORDS:
        assert getattr(a, name) == getattr(b, name), name
    for name in NUMBERS:
        np.testing.assert_allclose(
            getattr(a, name), getattr(b, name), rtol=1e-12, atol=1e-13, err_msg=name
        )


def moved(value: Any, by: Callable[[], float]) -> Any:
    """A number, or a range, of a neighbour."""
    if isinstance(value, tuple):
        return tuple(moved(end, by) for end in value)
    return value if value is None else value * by()


def neighbours(base: dmoc.Problem, count: int, size: float) -> list[dmoc.Problem]:
    """Problems whose numbers differ by a share at random: of each field in some of them."""
    rng = np.random.default_rng(2026)

    def by() -> float:
        return float(1 + size * rng.uniform(-1, 1))

    def field(stated: Mapping[str, Any]) -> dict[str, Any]:
        return {name: moved(value, by) for name, value in stated.items()}

    parameters = dict(zip(base.kernels.parameters, base.parameter_values[0].tolist(), strict=True))
    problems = []
    for _ in range(count):
        fields = {
            "start": field(base.start), "goal": field(base.goal), "bounds": field(base.bounds),
            "final_time": moved(base.final_time, by), "parameters": field(parameters),
        }  # fmt: skip
        kept = [name for name in fields if rng.random() < 0.6]
        problems.append(base.but(**{name: fields[name] for name in kept}))
    return problems


def pendulum(order: int, **fields: Any) -> dmoc.Problem:
    reference = find("cart_pendulum")
    base = dmoc.Problem(reference.kernels(order), **reference.defaults)
    return base.but(**{"steps": (7, 8), **fields})


def puck(*hits: str) -> dmoc.Problem:
    reference = find("puck_table")
    base = dmoc.Problem(reference.kernels(), **reference.defaults)
    return base.but(sequence=hits, steps=10)


def limited() -> dmoc.Problem:
    """A mass whose power is limited."""
    x, u = dynamicsymbols("x u")
    system = unit_mass(
        "limited",
        path_constraints={"power": 1e3 * u * x.diff(dynamicsymbols._t) <= 1e3},
        cost=u**2 / 2,
    )
    return dmoc.Problem(
        dmoc.build(system), start={"x": 0.0}, goal={"x": 0.6, "x_dot": 0.0}, final_time=1.0,
        steps=12,
    )  # fmt: skip


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


def test_kept_solutions_are_solved_one_by_one(together: list[int]) -> None:
    base = pendulum(2)
    guess = dmoc.solve(base, "ipm", starts=1, verify=False)
    problems = neighbours(base, 4, 0.02)
    kept = dmoc.solve_many(problems, guess=guess, keep=True, verify=False)
    assert not together
    same(dmoc.solve_many(problems, guess=guess, verify=False), kept)
    assert together


def test_rows_stop_in_time_and_by_ctrl_c(
    together: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    base = pendulum(2)
    guess = dmoc.solve(base, "ipm", starts=1, verify=False)
    problems = neighbours(base, 40, 0.02)
    late = dmoc.solve_many(problems, guess=guess, seconds=0.02)
    assert set(late.status) <= {"solved", "not_verified", "not_tried", "time_limit"}
    assert "not_tried" in late.status

    def interrupted(*args: Any) -> Any:
        raise KeyboardInterrupt

    monkeypatch.setattr(rows, "row_numbers", interrupted)
    batch = dmoc.solve_many(problems, guess=guess, verify=False)
    assert batch.counts == {"interrupted": 1, "not_tried": 39}


def test_rows_that_have_passed_before_ctrl_c_are_kept(
    together: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    class Interrupted(rows.FreeMotion):
        def judge(self, *args: Any) -> None:
            verdicts = args[4]
            verdicts[:7] = rows.PASSES
            raise KeyboardInterrupt

    base = pendulum(2)
    guess = dmoc.solve(base, "ipm", starts=1, verify=False)
    monkeypatch.setattr(rows, "FreeMotion", Interrupted)
    batch = dmoc.solve_many(neighbours(base, 20, 0.02), guess=guess)
    assert batch.status[:8] == (*("solved",) * 7, "interrupted")
    assert batch.counts == {"solved": 7, "interrupted": 1, "not_tried": 12}


def test_threads_solve_rows_and_give_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    """No process is started for one problem that is left over."""
    base = pendulum(2)
    guess = dmoc.solve(base, "ipm", starts=1)
    problems = [*neighbours(base, 30, 1e-3), base.but(steps=(6, 9))]
    one = dmoc.solve_many(problems, guess=guess)
    monkeypatch.setattr(many, "workforce", None)
    for workers in (2, 3):
        several = dmoc.solve_many(problems, guess=guess, workers=workers)
        assert [getattr(several, name) for name in WORDS] == [getattr(one, name) for name in WORDS]
        for name in NUMBERS:
            assert getattr(several, name).tobytes() == getattr(one, name).tobytes()


def test_what_threads_do_not_solve_is_left_to_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also what comes behind a share in which nothing is a row."""
    base, given = pendulum(2), list[int]()
    guess = dmoc.solve(base, "ipm", starts=1)
    problems = [base.but(steps=(6, 9 + k)) for k in range(4)] + neighbours(base, 8, 0.02)
    solved = many.solve_share

    @contextmanager
    def counted(workers: int, executor: None) -> Iterator[Any]:
        def answers(work: Any, shares: Iterator[many.Share], deadline: Deadline) -> Iterator[Any]:
            for share in shares:
                given.extend(number for number, _ in share.problems)
                yield solved(share)

        yield answers

    monkeypatch.setattr(many, "workforce", counted)
    monkeypatch.setattr(many.Pace, "together", 3)
    batch = dmoc.solve_many(problems, guess=guess, workers=2, verify=False)
    assert batch.counts == {"solved": 12}
    assert given[:4] == [0, 1, 2, 3] and len(set(given)) == len(given)


def test_the_first_share_is_as_large_as_the_guess_was_quick(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    base, sizes, solved = pendulum(2), list[int](), many.solve_share
    guess = dmoc.solve(base, "ipm", starts=1)

    def counted(share: many.Share) -> list[Row]:
        sizes.append(len(share.problems))
        return solved(share)

    monkeypatch.setattr(many, "solve_share", counted)
    for seconds, first in ((0.1, 5), (10.0, 1), (1e-6, 8)):
        sizes.clear()
        timed = replace(guess, seconds={"solve": seconds / 2, "verify": seconds / 2})
        dmoc.solve_many(neighbours(base, 8, 0.02), guess=timed, verify=False)
        assert sizes[0] == first


def test_rows_that_are_solved_in_time_are_kept(
    together: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those behind one that has no time too; where ends are checked, solves leave time for it."""
    base = pendulum(2)
    guess = dmoc.solve(base, "ipm", starts=1, verify=False)
    plain, left = neighbours(base, 3, 0.02), list[float]()

    def late(*args: Any) -> Any:
        left.append(args[-1].deadline.left)
        ends = solve_rows(*args)
        monkeypatch.setattr(Deadline, "passed", True)
        return ends

    problems = [plain[0], base.but(steps=(6, 9)), *plain[1:]]
    with monkeypatch.context() as patch:
        patch.setattr(rows, "solve_rows", late)
        batch = dmoc.solve_many(problems, guess=guess, verify=False, seconds=1000.0)
        assert batch.status == ("solved", "not_tried", "solved", "solved")
        monkeypatch.setattr(Deadline, "passed", False)
        batch = dmoc.solve_many(problems, guess=guess, seconds=1000.0)
    assert batch.counts == {"not_tried": 4} and left[1] <= 500.0 < left[0]


def test_an_error_of_rows_is_left_to_solves(together: list[int]) -> None:
    base = pendulum(2)
    guess = dmoc.solve(base, "ipm", starts=1, verify=False)
    shorter = [base.but(sequence=(), steps=10, goal={"x": 0.1}) for _ in range(3)]
    batch = dmoc.solve_many([base, *shorter], guess=guess, verify=False)
    assert batch.status == ("solved", "refused", "refused", "refused")
    assert "guess has 1 collisions" in batch.message[1] and not together


def test_arrays_of_other_rows_are_refused() -> None:
    """Compiled code trusts their shapes."""
    base = pendulum(2)
    guess = dmoc.solve(base, "ipm", starts=1, verify=False)
    x = guess.unknowns
    nlp = Transcription(base, scale_of(base, x, minimum=True))
    numbers = row_numbers(Stacked([base, base]), nlp, x)
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
