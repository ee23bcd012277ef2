"""What happens along a motion, in words: of a sequence, of the events, of the modes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from systems import landing_problem

import dmoc
from dmoc.base.errors import ProblemError
from dmoc.motion.largest_forces import largest_forces
from dmoc.motion.trajectory import Collision, Phase
from dmoc.problem.problem import Problem


def collision(surface: str = "", **parts: object) -> Collision:
    none = np.zeros(1)
    plain = Collision(surface, 0.25, none, 0.5, none, none)
    return replace(plain, **parts)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def landed() -> dmoc.Solution:
    return dmoc.solve(landing_problem(), starts=1)


@pytest.mark.parametrize(
    ("event", "word"),
    [
        (collision("wall"), "wall"),
        (collision("wall", leaves=("left",)), "wall -left"),
        (collision("right", lands=("right",), leaves=("left",)), "+right -left"),
        (collision("foot", lands=("foot",), friction={"foot": 0}), "+foot"),
        (collision("foot", lands=("foot",), friction={"foot": -1}), "+foot:slip-"),
        (collision("wall", friction={"rail": 0}), "wall rail:stick"),
        (collision(friction={"rail": 1, "foot": 0}), "rail:slip+ foot:stick"),
        (collision(leaves=("left", "right")), "-left -right"),
        (collision(), "no change"),
    ],
)
def test_an_event_is_told_as_a_sequence_says_it(event: Collision, word: str) -> None:
    assert event.word == word and str(event).startswith(f"{word} at 0.25 s")


def test_impulses_are_told_with_their_contacts() -> None:
    assert str(collision("wall")) == "wall at 0.25 s, impulse 0.5"
    assert str(collision("wall", grazes=True)) == "wall at 0.25 s, grazes"
    landing = collision("foot", lands=("foot",), impulses={"foot": 0.5}, tractions={"foot": -0.1})
    assert str(landing) == "+foot at 0.25 s, impulse 0.5 of foot, friction -0.1 of foot"


def test_a_mode_names_what_is_closed_and_what_rubs() -> None:
    none = np.zeros((2, 1))
    free = Phase(np.arange(2.0), none, none, none, none)
    assert free.free and free.mode == "free"
    mixed = replace(free, closed=("left", "stop"), rubbing={"left": 0, "rail": -1})
    assert not mixed.free and mixed.mode == "left:stick stop rail:slip-"


@pytest.mark.slow
def test_words_of_a_problem_are_those_of_its_motion(landed: dmoc.Solution) -> None:
    """However the problem has put them."""
    problem: Problem = landing_problem()
    words = ("+floor:slip+", "floor:stick")
    assert problem.words == tuple(c.word for c in landed.collisions) == words
    assert problem.but(sequence=["  +floor:slip+ ", "floor:stick"]).words == words
    assert [p.mode for p in landed.phases] == ["free", "floor:slip+", "floor:stick"]
    assert repr(landed) == (
        f"<Solution of landing: solved, cost {landed.cost:.7g}, final time 1.5 s; "
        f"{landed.collisions[0]}; {landed.collisions[1]}>"
    )


def test_largest_forces_and_limits_of_friction_are_those_of_the_closed_form(
    landed: dmoc.Solution,
) -> None:
    """m g = 10 N and mu m g = 1 N from the landing at 0.2 s on."""
    normal, friction = largest_forces(landed.trajectory)
    assert (normal.contact, normal.kind, friction.kind) == ("floor", "N", "T")
    assert (normal.value, friction.value) == pytest.approx((10.0, -1.0), rel=1e-9)
    assert 0.2 - 1e-12 <= friction.time <= landed.collisions[1].time
    limits = landed.trajectory.friction_limits(landed.phases[1])
    np.testing.assert_allclose(limits, np.ones((9, 1)), rtol=1e-9)
    assert landed.trajectory.friction_limits(landed.phases[0]).shape == (9, 0)


def test_a_motion_starts_and_judges_another_solve_of_its_words(landed: dmoc.Solution) -> None:
    problem = landing_problem()
    again = dmoc.solve(problem, guess=landed)
    assert again.iterations <= 2 and again.cost == pytest.approx(landed.cost, rel=1e-6)
    assert dmoc.sensitivities(problem, landed)["parameters"]["mu"] != 0
    other = problem.but(sequence=["+floor", "floor:slip+"])
    with pytest.raises(ProblemError, match=r"has the sequence \['\+floor:slip\+', 'floor:stick'\]"):
        dmoc.sensitivities(other, landed)


def test_impulses_of_rounding_errors_are_told_as_none(landed: dmoc.Solution) -> None:
    event = replace(
        landed.collisions[0], impulses={"floor": 2.0, "wall": 6e-20}, tractions={"floor": -3e-11}
    )
    assert str(event).endswith("impulse 2 of floor, impulse 0 of wall, friction 0 of floor")
