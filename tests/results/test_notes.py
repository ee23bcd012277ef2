"""Messages are made of data: a cause, and notes on topics."""

from __future__ import annotations

from pathlib import Path

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols
from systems import double_integrator

import dmoc
from dmoc.results.notes import Note, Topic, message_of, with_note

STEPS = Note(Topic.STEPS, "take more steps", ", ")
OPEN = Note(Topic.OPEN, "the problem does not determine T")


def test_a_note_takes_the_place_of_that_on_its_topic() -> None:
    notes = (Note(Topic.OTHER, "but it is off", ", "), STEPS, OPEN)
    assert message_of("found", notes) == (
        "found, but it is off, take more steps; the problem does not determine T"
    )
    better = with_note(notes, Note(Topic.STEPS, "take 80", ": "))
    assert message_of("found", better) == (
        "found, but it is off: take 80; the problem does not determine T"
    )
    assert with_note((), OPEN) == (OPEN,)
    assert with_note((OPEN,), STEPS) == (OPEN, STEPS)
    assert message_of("found", notes, (Topic.OPEN, Topic.STEPS)) == "found, but it is off"


def test_a_file_keeps_what_is_said(tmp_path: Path) -> None:
    """Of an answer whose mesh is too coarse."""
    q = dynamicsymbols("q")
    system = dmoc.MechanicalSystem("swing", [q], q.diff() ** 2 / 2 + 9.81 * sp.cos(q))
    fast = dmoc.Problem(dmoc.build(system), {"q": 0, "q_dot": 9}, steps=6, final_time=1.0)
    coarse = dmoc.solve(fast, "ipm", starts=1)
    assert coarse.status == "not_verified"
    (steps,) = (note for note in coarse.notes if note.topic is Topic.STEPS)
    assert steps.text.startswith("take ") and "with which it is confirmed" in steps.text
    assert coarse.verification is not None and coarse.verification.advice == "take more steps"
    assert coarse.message == message_of(coarse.cause, coarse.notes)
    again = dmoc.Solution.load(coarse.save(tmp_path / "coarse.npz"))
    assert (again.cause, again.notes) == (coarse.cause, coarse.notes)
    assert again.verification is not None and again.verification.advice == "take more steps"


def test_conflicts_and_proposals_have_rows_of_their_own() -> None:
    solution = dmoc.solve(double_integrator(8).but(bounds={"u": (-3, 3)}), "ipm", starts=1)
    assert solution.status == "infeasible" and solution.conflicts
    conflicts = [note.text for note in solution.notes if note.topic is Topic.CONFLICT]
    assert tuple(conflicts) == solution.conflicts
    shown = str(solution)
    for conflict in solution.conflicts:
        assert " ".join(shown.split()).count(conflict) == 1
        assert conflict in solution.message
