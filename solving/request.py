"""What a solve is asked for beside its problem: read before anything is done."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from dmoc.base.arguments import choice, flag, positive, text, whole
from dmoc.base.deadline import Deadline
from dmoc.codegen.kernels import COMPILED
from dmoc.problem.problem import Problem
from dmoc.solvers.outcome import ITERATIONS, OPTIMALITY, VIOLATION, Options
from dmoc.solving.methods import DEFAULT, FORMS, METHODS, REFINING, Form, Method, usual

# Tolerance where neither steps nor a tolerance are given.
AUTOMATIC = 1e-3
MOST_STARTS = 1_000_000
MOST_ITERATIONS = 2**31 - 1  # what the compiled method can count


@dataclass(frozen=True)
class Request:
    """How a problem shall be solved; its parts are checked.  ``verify`` is for the solution,
    ``ranks_checked`` for the minima among which it is chosen; ``by_rates`` states the law of impact
    in the rates of the gaps."""

    method: Method
    options: Options
    form: str = Form.CONDENSED
    verify: bool = True
    ranks_checked: bool = True
    starts: int | None = 1
    seed: int = 0
    by_rates: bool = False


@dataclass(frozen=True)
class Keywords:
    """The keywords of :func:`dmoc.solve` that mean the same for every problem, as they were read;
    :func:`keywords` reads them."""

    method: str | None
    tolerance: float | None
    form: str
    starts: int | None
    seed: int
    options: Options
    verify: bool
    reference: str

    def tolerance_of(self, problem: Problem) -> float | None:
        """The tolerance of a refinement; None where the mesh of the problem is the only one."""
        return AUTOMATIC if self.tolerance is None and problem.steps is None else self.tolerance

    def request(self, problem: Problem) -> Request:
        """What is asked for of a problem, with its usual method unless one is named.

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
        return Request(
            method, self.options, self.form, self.verify, self.verify, self.starts, self.seed
        )


def keywords(
    method: Any = None,
    *,
    tolerance: Any = None,
    form: Any = "condensed",
    starts: Any = None,
    seed: Any = 0,
    optimality: Any = OPTIMALITY,
    violation: Any = VIOLATION,
    iterations: Any = ITERATIONS,
    seconds: Any = None,
    verify: Any = True,
    reference: Any = "",
) -> Keywords:
    """Read the keywords of :func:`dmoc.solve`.

    Raises
    ------
    ProblemError
        If one of them does not fit.
    """
    limits = Options(
        positive(optimality, "optimality", "expected a positive number"),
        positive(violation, "violation", "expected a positive number"),
        whole(iterations, "iterations", 1, MOST_ITERATIONS),
        Deadline.after(_unless_none(seconds, "seconds", "expected a positive time limit, or None")),
    )
    return Keywords(
        None if method is None else choice(method, "method", tuple(METHODS)),
        _unless_none(tolerance, "tolerance", "expected a positive number, or None"),
        choice(form, "form", FORMS),
        None if starts is None else whole(starts, "starts", 1, MOST_STARTS),
        whole(seed, "seed", 0, MOST_ITERATIONS),
        limits,
        flag(verify, "verify"),
        text(reference, "reference"),
    )


def _unless_none(value: Any, what: str, expected: str) -> float | None:
    return None if value is None else positive(value, what, expected)


def _usual(problem: Problem, tolerance: float | None) -> str:
    """The method that a problem is solved by unless one is named."""
    rubs = bool(problem.open_hits) or any(event.course for event in problem.events)
    plain = tolerance is None and not (problem.lasting or rubs)
    return usual(DEFAULT if plain else REFINING, problem.kernels.backend == COMPILED)
