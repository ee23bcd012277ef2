"""How many steps a motion needs whose mesh is too coarse: the number that is named passes."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
import sympy as sp
from answers import answer_of
from contact_problems import two_masses
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from sympy.physics.mechanics import dynamicsymbols
from systems import block_system

import dmoc
from dmoc.results.notes import Note, Topic
from dmoc.solvers.outcome import Status
from dmoc.solving.mesh.confirmation import _telling, naming_steps, passing_steps

Q, X, U = dynamicsymbols("q x u")


def swing_up(steps: int) -> dmoc.Problem:
    """A pendulum of 1 kg and 1 m with a torque of 2 N m in least time."""
    system = dmoc.MechanicalSystem(
        "weak_swing_up", [Q], Q.diff() ** 2 / 2 + 9.81 * sp.cos(Q), {}, inputs=[U], forces={Q: U},
        cost=sp.Integer(1),
    )  # fmt: skip
    return dmoc.Problem(
        system, start={Q: 0}, goal={Q: sp.pi, "q_dot": 0}, bounds={U: (-2, 2)},
        final_time=(0.5, 10), steps=steps,
    )  # fmt: skip


def crane(steps: int) -> dmoc.Problem:
    """A cart of 1 kg carries 10 kg on a rope of 5 m over 15 m in least time."""
    speeds = X.diff() ** 2 + 25 * Q.diff() ** 2 + 10 * X.diff() * Q.diff() * sp.cos(Q)
    system = dmoc.MechanicalSystem(
        "hanging_load", [X, Q], X.diff() ** 2 / 2 + 5 * speeds + 490.5 * sp.cos(Q), {}, inputs=[U],
        forces={X: U}, cost=sp.Integer(1),
    )  # fmt: skip
    return dmoc.Problem(
        system, start={X: 0, Q: 0}, goal={X: 15, Q: 0, "x_dot": 0, "q_dot": 0},
        bounds={U: (-20, 20)}, final_time=(0.5, 20), steps=steps,
    )  # fmt: skip


PROBLEMS = {"swing_up": swing_up, "crane": crane, "two_masses": two_masses}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "steps"),
    [("swing_up", 25), ("swing_up", 50), ("crane", 25), ("crane", 50), ("two_masses", 20)],
)
def test_the_number_of_steps_that_is_named_passes(name: str, steps: int) -> None:
    coarse = dmoc.solve(PROBLEMS[name](steps), "ipm")
    assert coarse.status == "not_verified" and "take more steps" not in coarse.message
    words = r"take (\d+) steps( a phase)?, with which it is confirmed and costs ([\d.]+)"
    named = re.search(words, coarse.message)
    assert named is not None
    enough = answer_of(PROBLEMS[name](int(named[1])), "ipm", guess=coarse)
    assert enough.cost == pytest.approx(float(named[3]), rel=1e-5)
    # What the order, 2, and a margin of a fifth ask for, or not many more.
    assert coarse.verification is not None
    by_order = 1.2 * coarse.verification.excess**0.5
    assert steps < enough.steps[0] <= max(4.0, by_order) * steps + 1


def test_a_batch_solves_no_finer_meshes() -> None:
    batch = dmoc.solve_many([crane(15)], "ipm")
    assert batch.status == ("not_verified",)
    assert batch.message[0].endswith("too coarse, take more steps")


@pytest.fixture(scope="module")
def confirmed() -> dmoc.Solution:
    return dmoc.solve(rest_to_rest(10), "ipm", starts=1)


def rest_to_rest(steps: int) -> dmoc.Problem:
    return dmoc.Problem(
        block_system(), start={"x": 0}, goal={"x": 0.5, "x_dot": 0}, steps=steps, final_time=1
    )


@pytest.mark.slow
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
@given(
    excess=st.floats(1.001, 50),
    order=st.sampled_from([2.0, 4.0, 6.0]),
    steps=st.lists(st.integers(2, 500), min_size=1, max_size=4),
)
def test_errors_that_fall_with_the_order_pass(
    confirmed: dmoc.Solution, excess: float, order: float, steps: list[int]
) -> None:
    check = contradicting(confirmed, excess).verification
    assert check is not None and check.excess == pytest.approx(excess)
    for n, more in zip(steps, passing_steps(check, steps, order), strict=True):
        assert excess * (n / more) ** order < 1


def contradicting(solution: dmoc.Solution, excess: float) -> dmoc.Solution:
    """A solution whose energies are so many times further off than may be."""
    assert solution.verification is not None
    message, advice = "energies are off: too coarse", "take more steps"
    check = replace(
        solution.verification, passed=False, message=message, advice=advice,
        energy_error=0.02 * excess,
    )  # fmt: skip
    notes = Note(Topic.OTHER, f"but {message}", ", "), Note(Topic.STEPS, advice, ", ")
    return replace(solution, status=Status.NOT_VERIFIED, verification=check, notes=notes)


def test_advice_stands_where_the_check_says_none(confirmed: dmoc.Solution) -> None:
    """As behind a contradiction, which more steps may mend or not."""
    wrong = Note(Topic.OTHER, "but it misses the wall", ", ")
    open_too = Note(Topic.OPEN, "the problem does not determine T")
    found = replace(confirmed, cause="found", notes=(wrong, open_too))
    told = _telling(found, "take 20 steps").message
    assert told == "found, but it misses the wall; the problem does not determine T: take 20 steps"
    general = replace(found, notes=(wrong, Note(Topic.STEPS, "take more steps", ", "), open_too))
    assert _telling(general, "take 20 steps").message == (
        "found, but it misses the wall, take 20 steps; the problem does not determine T"
    )


@pytest.mark.parametrize(("falls", "named"), [(2, [18]), (1, [18, 26]), (0, None)])
def test_the_order_that_the_errors_show_counts(
    confirmed: dmoc.Solution, falls: int, named: list[int] | None
) -> None:
    """Errors of 2.1 times what passes with 10 steps: with order 2 and a margin of a fifth 18 steps
    are tried first.  Errors that fall with order 1 are 1.167 times what passes then."""
    tried: list[int] = []

    def along(fine: dmoc.Problem, coarse: dmoc.Solution, verify: bool) -> dmoc.Solution:
        tried.append(fine.phase_steps[0])
        excess = 2.1 if falls == 0 else 2.1 * (10 / tried[-1]) ** falls
        s = dmoc.solve(fine, "ipm", starts=1)
        return s if excess <= 1 else contradicting(s, excess)

    asked = SimpleNamespace(tolerance=None, names_steps=True)
    case: Any = SimpleNamespace(problem=rest_to_rest(10), request=asked, along=along)
    answer = naming_steps(contradicting(confirmed, 2.1), case)
    assert answer.status == "not_verified" and answer.steps == (10,)
    assert "take more steps" not in answer.message
    if named is None:
        assert (
            f"{tried[0]} steps or {tried[1]} steps or {tried[2]} steps are not enough"
            in answer.message
        )
    else:
        assert tried == named
        assert f"take {named[-1]} steps, with which it is confirmed" in answer.message
