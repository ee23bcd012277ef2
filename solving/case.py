"""A problem that is answered, and others that are solved to judge its answer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

from dmoc.base.records import record
from dmoc.problem.problem import Problem
from dmoc.results.solution import Minimum, Solution
from dmoc.solvers.outcome import Status
from dmoc.solving.mesh.one_mesh import answers_on_mesh, best_on_mesh, solved_from
from dmoc.solving.request import Request
from dmoc.solving.starts import InitialGuess

# Starts of another problem, of which it is asked whether it leads to a motion.
FEW = 16


@record(frozen=True, eq=False)
class Case:
    """A problem, the guess that came with it, what is asked for, of the answer and of its first
    mesh, and the answer's minimum on the coarse mesh of its starts."""

    problem: Problem
    guess: InitialGuess
    request: Request
    of_mesh: Request
    coarse: Minimum | None = None

    def along(self, problem: Problem, motion: Solution, verify: bool = False) -> Solution:
        """Another problem solved from a motion."""
        request = replace(self.of_mesh.compiled(), verify=verify)
        return _finished(solved_from(problem, motion, request))

    def afresh(self, problem: Problem) -> Solution:
        """Another problem solved from few starts of its own."""
        return _finished(best_on_mesh(problem, None, self._few()))

    def led(self, problem: Problem) -> Solution | None:
        """Another problem solved from few starts of its own; None where none leads to a motion, of
        which it is not asked what stands against it."""
        answer = next(answers_on_mesh(problem, None, self._few()))
        return _finished(answer.solution) if answer else None

    def _few(self) -> Request:
        return replace(self.request.compiled(), starts=FEW, thorough=False)


# Looks at an answer: the answer as it was, one of which more is said, or another one.
Critic: TypeAlias = Callable[[Solution, Case], Solution]


def _finished(solution: Solution) -> Solution:
    """A solution of another problem; one that Ctrl-C has ended breaks off the answer too."""
    if solution.status is Status.INTERRUPTED:
        raise KeyboardInterrupt
    return solution


def first_of(*critics: Critic) -> Critic:
    """The first of some critics that leaves an answer not as it was."""

    def critic(answer: Solution, case: Case) -> Solution:
        looked_at = (look(answer, case) for look in critics)
        return next((other for other in looked_at if other is not answer), answer)

    return critic
