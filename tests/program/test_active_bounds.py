"""Active bounds and statuses are data that read as text."""

from __future__ import annotations

import json
import pickle
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from contact_problems import floor
from systems import block_system, there_and_back

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.program.active_constraints import ActiveBound, _bounds, _impulses
from dmoc.program.bound_kinds import BoundKind
from dmoc.program.layout import Layout
from dmoc.program.transcription import Transcription
from dmoc.results.schema import Context
from dmoc.results.solution_file import BOUND
from dmoc.solvers.outcome import SENTENCES, Status

BOUNDS = {
    "gap to post at 1 node": ActiveBound(BoundKind.GAP, "post", places=1),
    "gap to post at 12 nodes": ActiveBound(BoundKind.GAP, "post", places=12),
    "gap to post inside 3 steps": ActiveBound(BoundKind.INSIDE, "post", places=3),
    "friction cone of foot at 2 nodes": ActiveBound(BoundKind.CONE, "foot", places=2),
    "sliding of foot in 1 step": ActiveBound(BoundKind.DIRECTION, "foot", places=1),
    "path constraint reach in 3 steps": ActiveBound(BoundKind.PATH, "reach", places=3),
    "duration of phase 1 >= 0.4 s": ActiveBound(BoundKind.DURATION, "1", ">=", 0.4),
    "F >= -25 in 1 step": ActiveBound(BoundKind.INPUT, "F", ">=", -25.0, 1),
    "x <= 1.5e-05 in 2 nodes": ActiveBound(BoundKind.COORDINATE, "x", "<=", 1.5e-5, 2),
    "impulse of collision 2 (lower) >= 0": ActiveBound(BoundKind.IMPULSE, "2 (lower)"),
    "final time <= 1 s": ActiveBound(BoundKind.OTHER, "final time <= 1 s"),
}


@pytest.mark.parametrize(("text", "bound"), BOUNDS.items())
def test_a_bound_is_its_text_and_data_in_files(text: str, bound: ActiveBound) -> None:
    assert bound == text == str(bound) and json.dumps([bound]) == json.dumps([text])
    written = json.loads(json.dumps(BOUND.write(bound, "", lambda *_: None)))
    of_file = BOUND.read(written, "", Context())
    for again in (of_file, pickle.loads(pickle.dumps(bound)), replace(bound)):
        assert (again, again.kind, again.name, again.side) == (
            text,
            bound.kind,
            bound.name,
            bound.side,
        )
        assert (again.value, again.places) == (bound.value, bound.places)


@pytest.mark.parametrize("place", [0, 2, 3])
@pytest.mark.parametrize(
    ("value", "force", "side"),
    [
        (-4.0, 1e-6, ">="), (-4.0, -1e-6, ""), (-4.0, 1e-8, ""), (-4.0, 0.0, ""),
        (4.0, -1e-6, "<="), (4.0, 1e-6, ""), (4.0, -1e-8, ""), (4.0, 0.0, ""),
        (-3.0, 1.1, ">="), (-3.0, 0.9, ""), (-3.0, -1.1, ""), (-3.0, -7.1, "<="),
        (3.0, -1.1, "<="), (3.0, -0.9, ""), (3.0, 1.1, ""), (3.0, 7.1, ">="),
        (-4.2, 1e-6, ">="), (4.2, -1e-6, "<="), (-4.2, 1e-8, ""),  # beyond it
    ],
)  # fmt: skip
def test_a_bound_holds_where_its_multiplier_exceeds_the_distance(
    block: Kernels, place: int, value: float, force: float, side: str
) -> None:
    """An input between -4 and 4 in one of four steps, all others far inside."""
    problem = there_and_back(block, steps=2, bounds={"u": (-4.0, 4.0)})
    nlp = Transcription(problem, replace(Transcription(problem).scale, u=np.ones(1)))
    x, z = np.zeros(nlp.n), np.zeros(nlp.n)
    unknown = nlp.layout.index_u[place, 0]
    x[unknown], z[unknown] = value, force
    told = list(_bounds(nlp, x, z))
    assert told == ([f"u {side} {-4 if side == '>=' else 4} in 1 step"] if side else [])


@pytest.mark.slow
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


@pytest.mark.slow
@pytest.mark.parametrize("order", [2, 4, 6])
def test_places_are_counted_once(order: int) -> None:
    """A mass that is in a hurry is pushed and braked with the largest force in every step, one half
    of them each; one whose speed is limited keeps the limit in a part of the steps."""
    system = replace(
        block_system(), name=f"hurried{order}", cost=1,
        path_constraints={"speed": block_system().coordinates[0].diff() <= 1.0},
    )  # fmt: skip
    hurry = dmoc.Problem(
        dmoc.build(system, order=order), {"x": 0.0}, {"x": 0.9, "x_dot": 0.0}, steps=20,
        final_time=(0.1, 5.0), bounds={"u": (-4, 4)},
    )  # fmt: skip
    fast = dmoc.solve(hurry, "ipm", verify=False)
    places = {(b.kind, b.side): b.places for b in fast.active_bounds}
    assert places[BoundKind.INPUT, "<="] + places[BoundKind.INPUT, ">="] <= 20
    assert 0 < places[BoundKind.PATH, ""] < 20


@pytest.mark.slow
def test_a_motion_that_keeps_to_a_surface_is_one_bound() -> None:
    """A mass that would go beyond the wall in every step, and may touch it."""
    x = block_system().coordinates[0]
    system = replace(block_system(), name="leaning", cost=(x - 2) ** 2)
    leaning = dmoc.Problem(
        dmoc.build(system, order=4), {"x": 0.9}, {"x": 0.9}, steps=12, final_time=1.0,
        bounds={"u": (-50, 50)},
    )  # fmt: skip
    bounds = dmoc.solve(leaning, "ipm", starts=1, verify=False).active_bounds
    gaps = [b for b in bounds if b.name == "wall"]
    assert {b.kind for b in gaps} == {BoundKind.GAP, BoundKind.INSIDE}
    assert all(1 < b.places <= 12 for b in gaps) and len(gaps) == 2


@pytest.mark.slow
def test_only_a_hit_has_an_impulse_that_is_held_at_zero() -> None:
    problem = dmoc.Problem(
        floor(), start={"x": 0, "y": 0}, goal={"x": 1}, contacts=["floor:slip+"],
        sequence=["-floor", "floor:slip+", "+floor:slip+"], steps=4, final_time=1,
    )  # fmt: skip
    nlp: Any = SimpleNamespace(problem=problem, layout=Layout.of(problem))
    x = np.zeros(nlp.layout.size)
    assert list(_impulses(nlp, x)) == ["impulse of collision 2 (floor:slip+) >= 0"]
    x[nlp.layout.impact.lam[1]] = 1.0
    assert list(_impulses(nlp, x)) == []
