"""Active bounds and statuses are data that read as text."""

from __future__ import annotations

import json
import pickle
from dataclasses import replace

import pytest

import dmoc
from dmoc.nlp.active import ActiveBound, BoundKind
from dmoc.solvers.outcome import SENTENCES, Status

BOUNDS = {
    "gap to post at 1 node": ActiveBound(BoundKind.GAP, "post", places=1),
    "gap to post at 12 nodes": ActiveBound(BoundKind.GAP, "post", places=12),
    "path constraint reach in 3 steps": ActiveBound(BoundKind.PATH, "reach", places=3),
    "duration of phase 1 >= 0.4 s": ActiveBound(BoundKind.DURATION, "1", ">=", 0.4),
    "F >= -25 in 1 step": ActiveBound(BoundKind.INPUT, "F", ">=", -25.0, 1),
    "x <= 1.5e-05 in 2 nodes": ActiveBound(BoundKind.COORDINATE, "x", "<=", 1.5e-5, 2),
    "impulse of collision 2 (left) >= 0": ActiveBound(BoundKind.IMPULSE, "2 (left)"),
    "final time <= 1 s": ActiveBound(BoundKind.OTHER, "final time <= 1 s"),
}


@pytest.mark.parametrize(("text", "bound"), BOUNDS.items())
def test_a_bound_is_its_text_and_is_read_from_it(text: str, bound: ActiveBound) -> None:
    assert bound == text == str(bound) and json.dumps([bound]) == json.dumps([text])
    for again in (ActiveBound.read(text), pickle.loads(pickle.dumps(bound)), replace(bound)):
        assert (again, again.kind, again.name, again.side) == (
            text,
            bound.kind,
            bound.name,
            bound.side,
        )
        assert (again.value, again.places) == (bound.value, bound.places)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "x",
        "x >= nonsense in 2 steps",
        "gap to a\nb at 2 nodes",
        "x >= 1 in " + "9" * 5000 + " steps",
        "x >= 01 in 2 nodes",
    ],
)
def test_any_text_of_a_file_is_read_as_it_stands(text: str) -> None:
    assert ActiveBound.read(text) == text


def test_a_solution_and_its_file_tell_the_same_bounds(seed: dmoc.Problem) -> None:
    problem = seed.but(steps=20, durations=[(0.1, None), (None, None)], bounds={"F": (-28, 28)})
    kept = dmoc.solve(problem, "ipm", verify=False)
    kinds = {b.kind for b in kept.active_bounds}
    assert {
        BoundKind.DURATION,
        BoundKind.INPUT,
    } <= kinds and "duration of phase 0 >= 0.1 s" in kept.active_bounds
    again = dmoc.Solution.from_bytes(kept.to_bytes())
    assert again.active_bounds == kept.active_bounds
    assert [b.kind for b in again.active_bounds] == [b.kind for b in kept.active_bounds]
    assert again.status is kept.status is Status.SOLVED and again.converged


def test_every_status_is_its_word_and_has_a_sentence() -> None:
    assert set(SENTENCES) == set(Status)
    for status in Status:
        assert f"{status}" == status == status.name.lower() and status.sentence
