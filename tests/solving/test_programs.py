"""Each program of a problem is made once."""

from __future__ import annotations

from typing import Any

import block_and_wall
import pytest

import dmoc
from dmoc.guess.automatic import initial_guesses
from dmoc.program.scaling import scale_of
from dmoc.program.transcription import Transcription
from dmoc.solving.programs import Programs


def test_programs_are_kept() -> None:
    problem = block_and_wall.problem(0.8, 10).but(minimal_times=True)
    programs = Programs(problem, scale_of(problem, initial_guesses(problem)[0].x))
    guided, free = programs.program(guided=True), programs.program()
    assert guided is programs.program(guided=True) and free is programs.free(guided) is not guided
    grazing = programs.grazes(free, [0])
    assert grazing is programs.grazes(free, [0]) is programs.free(programs.grazes(guided, [0]))
    assert grazing.laws.impact.grazing.tolist() == [True] and not free.laws.impact.grazing.any()


@pytest.mark.parametrize(("force", "status", "most"), [(200, "solved", 2), (1, "infeasible", 3)])
def test_a_solve_makes_few_programs(
    monkeypatch: pytest.MonkeyPatch, force: float, status: str, most: int
) -> None:
    """From the guess alone: one for the guess, one to solve, and one for the least violation where
    there is no solution."""
    problem = block_and_wall.problem(0.8, 10).but(bounds={"u": (-force, force)})
    made: list[object] = []
    make = Transcription.__init__

    def counted(self: Transcription, *arguments: Any, **named: Any) -> None:
        made.append(self)
        make(self, *arguments, **named)

    monkeypatch.setattr(Transcription, "__init__", counted)
    assert dmoc.solve(problem, "ipm", starts=1).status == status
    assert 0 < len(made) <= most
