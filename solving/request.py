"""What a solve is asked for beside its problem: read before anything is done."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Annotated

from dmoc.base.arguments import choice, flag, positive, text, whole
from dmoc.base.deadline import Deadline
from dmoc.base.options import Option
from dmoc.codegen.kernels import COMPILED
from dmoc.problem.problem import Problem
from dmoc.solvers.outcome import ITERATIONS, OPTIMALITY, VIOLATION, Options
from dmoc.solving.methods import DEFAULT, FORMS, METHODS, REFINING, Method, ProgramForm, usual

# Tolerance where neither steps nor a tolerance are given.
AUTOMATIC = 1e-3
MOST_STARTS = 1_000_000
MOST_ITERATIONS = 2**31 - 1  # what the compiled method can count
NUMBER = "expected a positive number"
NUMBER_OR_NONE = f"{NUMBER}, or None"
LIMIT = "expected a positive time limit, or None"


@dataclass(frozen=True)
class Request:
    """How a problem shall be solved; its parts are checked.  ``verify`` is for the solution,
    ``ranks_checked`` for the minima among which it is chosen; ``by_rates`` states the law of impact
    in the rates of the gaps."""

    method: Method
    options: Options
    form: str = ProgramForm.CONDENSED
    verify: bool = True
    ranks_checked: bool = True
    starts: int | None = 1
    seed: int = 0
    by_rates: bool = False


@dataclass(frozen=True)
class Keywords:
    """The keywords of :func:`dmoc.solve` that mean the same for every problem, as they were
    read."""

    method: Annotated[str | None, Option(partial(choice, choices=METHODS))] = None
    tolerance: Annotated[float | None, Option(partial(positive, expected=NUMBER_OR_NONE))] = None
    form: Annotated[str, Option(partial(choice, choices=FORMS))] = ProgramForm.CONDENSED
    starts: Annotated[int | None, Option(partial(whole, least=1, most=MOST_STARTS))] = None
    seed: Annotated[int, Option(partial(whole, least=0, most=MOST_ITERATIONS))] = 0
    optimality: Annotated[float, Option(partial(positive, expected=NUMBER))] = OPTIMALITY
    violation: Annotated[float, Option(partial(positive, expected=NUMBER))] = VIOLATION
    iterations: Annotated[int, Option(partial(whole, least=1, most=MOST_ITERATIONS))] = ITERATIONS
    seconds: Annotated[float | None, Option(partial(positive, expected=LIMIT))] = None
    verify: Annotated[bool, Option(flag)] = True
    reference: Annotated[str, Option(text)] = ""

    def tolerance_of(self, problem: Problem) -> float | None:
        """The tolerance of a refinement; None where the mesh of the problem is the only one."""
        return AUTOMATIC if self.tolerance is None and problem.steps is None else self.tolerance

    def request(self, problem: Problem) -> Request:
        """What is asked for of a problem, with its usual method unless one is named, from now on.

        Raises
        ------
        ProblemError
            If the method cannot solve this problem.
        MissingExtraError
            If the package of the method is not installed.
        """
        name = self.method or _usual(problem, self.tolerance_of(problem))
        method = METHODS[name]
        method.require(problem.kernels.backend)
        method.check_size(problem.steps, problem.nu * sum(problem.phase_steps))
        deadline = Deadline.after(self.seconds)
        limits = Options(self.optimality, self.violation, self.iterations, deadline)
        return Request(method, limits, self.form, self.verify, self.verify, self.starts, self.seed)


def _usual(problem: Problem, tolerance: float | None) -> str:
    """The method that a problem is solved by unless one is named."""
    rubs = bool(problem.open_hits) or any(event.course for event in problem.events)
    plain = tolerance is None and not (problem.lasting or rubs)
    return usual(DEFAULT if plain else REFINING, problem.kernels.backend == COMPILED)
