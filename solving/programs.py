"""The programs of a problem that one solve needs, each made once."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import field, replace

import numpy as np

from dmoc.base.records import record
from dmoc.problem.problem import Problem
from dmoc.program.extraction import multiplier_vectors, stated_as
from dmoc.program.minimal_times import WithMinimalTimes
from dmoc.program.scale import Scale
from dmoc.program.scaling import scale_of
from dmoc.program.transcription import Transcription
from dmoc.results.solution import Solution
from dmoc.solvers.outcome import Duals


@record(frozen=True, eq=False)
class Programs:
    """The programs of a problem in one scale.

    ``guided`` ones have the estimated minimal times as constraints, in as far as the problem has
    them; the others leave them out.
    """

    problem: Problem
    scale: Scale
    _made: dict[tuple[bool, tuple[int, ...]], Transcription] = field(default_factory=dict)

    @property
    def compiled(self) -> bool:
        """Whether the kernels are."""
        return self.problem.kernels.compiled

    def beside(self) -> Programs:
        """The same programs for another thread."""
        return replace(self, _made={key: nlp.beside() for key, nlp in self._made.items()})

    def program(self, guided: bool = False, grazing: Iterable[int] = ()) -> Transcription:
        """The program in which the given collisions graze their surface without an impulse."""
        key = (guided and self.problem.minimal_times, tuple(sorted(map(int, grazing))))
        if key not in self._made:
            make = WithMinimalTimes if key[0] else Transcription
            self._made[key] = make(self.problem, self.scale, grazing=key[1])
        return self._made[key]

    def free(self, nlp: Transcription) -> Transcription:
        """A program without its minimal times."""
        return self.program(False, np.flatnonzero(nlp.laws.impact.grazing))

    def grazes(self, nlp: Transcription, at: Iterable[int]) -> Transcription:
        """A program in which some more collisions graze."""
        return self.program(
            isinstance(nlp, WithMinimalTimes), [*np.flatnonzero(nlp.laws.impact.grazing), *at]
        )


def at_solution(problem: Problem, solution: Solution) -> tuple[Transcription, Duals]:
    """The program of a problem at its solution, with its multipliers."""
    scale = scale_of(problem, solution.unknowns, minimum=True)
    nlp = Transcription(stated_as(problem, solution.multipliers), scale)
    return nlp, Duals(*multiplier_vectors(nlp, solution.multipliers))
