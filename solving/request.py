"""What a solve is asked for beside its problem: read before anything is done."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated, Any

from dmoc.base.arguments import choice, flag, positive, text, whole
from dmoc.base.deadline import Deadline
from dmoc.base.options import Option
from dmoc.codegen.kernels import COMPILED
from dmoc.problem.problem import Problem
from dmoc.solvers.outcome import ITERATIONS, OPTIMALITY, VIOLATION, Options
from dmoc.solving.methods import DEFAULT, FORMS, METHODS, REFINING, Method, ProgramForm, usual

# Tolerance where neither steps nor a tolerance are given.
AUTOMATIC = 1e-3
# The error up to which a motion that the check confirms is a solution where nobody has asked for a
# tolerance and finer meshes do not lead to the usual one: the check itself allows as much.
LOOSE = 1e-2
MOST_STARTS = 1_000_000
MOST_ITERATIONS = 2**31 - 1  # what the compiled method can count
NUMBER = "expected a positive number"
NUMBER_OR_NONE = f"{NUMBER}, or None"
LIMIT = "expected a positive time limit, or None"


@dataclass(frozen=True)
class Request:
    """How a problem shall be solved; its parts are checked.

    ``verify`` is for the solution, ``ranks_checked`` for the minima among which it is chosen;
    ``by_rates`` states the law of impact in the rates of the gaps.  ``tolerance`` is that of a
    refinement, None where the mesh of the problem is the only one; where finer meshes do not lead
    there, an error up to ``loose`` that the check confirms is a solution too.  ``refining`` is the
    method of other meshes than that of the answer.
    """

    method: Method
    options: Options
    form: str = ProgramForm.CONDENSED
    verify: bool = True
    ranks_checked: bool = True
    starts: int | None = 1
    seed: int = 0
    by_rates: bool = False
    tolerance: float | None = None
    loose: float = LOOSE
    refining: Method = METHODS[REFINING]

    def within(self, **limits: Any) -> Request:
        """The same with other options."""
        return replace(self, options=replace(self.options, **limits))

    def compiled(self) -> Request:
        """The same for other meshes: silent, by the compiled method if the problem has one."""
        return replace(self.within(progress=None), method=self.refining)


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

    def request(self, problem: Problem) -> Request:
        """What is asked for of a problem, with its usual method unless one is named, from now on.

        Raises
        ------
        ProblemError
            If the method cannot solve this problem.
        MissingExtraError
            If the package of the method is not installed.
        """
        tolerance, loose = self.tolerance, self.tolerance or LOOSE
        if tolerance is None and problem.steps is None:
            tolerance = AUTOMATIC
        compiled = problem.kernels.backend == COMPILED
        rubs = bool(problem.open_hits) or any(event.course for event in problem.events)
        plain = tolerance is None and not (problem.held or rubs)
        method = METHODS[self.method or usual(DEFAULT if plain else REFINING, compiled)]
        method.require(problem.kernels.backend)
        method.check_size(problem.steps, problem.nu * sum(problem.phase_steps))
        limits = Options(
            self.optimality, self.violation, self.iterations, Deadline.after(self.seconds)
        )
        return Request(
            method, limits, self.form, self.verify, self.verify, self.starts, self.seed,
            tolerance=tolerance, loose=loose, refining=METHODS[usual(REFINING, compiled)],
        )  # fmt: skip
