"""Motions that follow a word: each event when its surface is met, also before the last event."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

import dmoc
from dmoc.fitting.course import Course, Laws, Mesh
from dmoc.fitting.words import touch_of_words

BEGIN, SPEED = np.array([0.3, 0.4]), np.array([1.5, 0.9])
HITS = {"east": (1 - 0.3) / 1.5, "north": (1 - 0.4) / 0.9}


def followed(words: Sequence[str]) -> Course:
    """A puck on a table of 1 m by 1 m that keeps half of its speed at each wall."""
    problem = dmoc.Problem(dmoc.load("puck_table"), start={"x": 0.3, "y": 0.4}, restitution=0.5)
    t = np.linspace(0, 1, 101)
    still = np.zeros((100, 2))
    touch = touch_of_words(problem, words)
    laws = Laws(problem.model, problem.restitution_values, touch, np.ones(4))
    return laws.follow(np.concatenate([BEGIN, SPEED]), Mesh(t, still, still), 1.0)


@pytest.mark.parametrize("words", [["east", "north"], ["north", "east"]])
def test_events_happen_where_their_surfaces_are_met_in_any_order(words: list[str]) -> None:
    """The walls act on a coordinate each, so that the end is the same."""
    course = followed(words)
    assert course.whole
    assert course.events == pytest.approx([HITS[word] for word in words], rel=1e-12)
    (end,) = course.states(np.array([1.0]), course.phases(np.array([1.0])))
    back = np.array([HITS["east"], HITS["north"]])
    place = 1 - 0.5 * SPEED * (1 - back)
    assert end == pytest.approx([*place, *(-0.5 * SPEED)], rel=1e-12)


def test_states_are_asked_for_beyond_the_phase_that_they_belong_to() -> None:
    """A little after a hit, by the flow before it, as if the wall were not there."""
    course = followed(["east"])
    late = np.array([HITS["east"] + 1e-3])
    ((x, *_),) = course.states(late, np.array([0]))
    assert x == pytest.approx(1 + 1.5e-3, rel=1e-12)
    assert course.phases(late).tolist() == [1]
    ((x, *_),) = course.states(late, np.array([1]))
    assert x == pytest.approx(1 - 0.75e-3, rel=1e-12)


def test_an_event_that_does_not_happen_ends_the_motion_with_the_mesh() -> None:
    course = followed(["east", "east"])
    assert not course.whole
    assert course.events == pytest.approx([HITS["east"], 1.0])
