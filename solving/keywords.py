"""The keywords of :func:`dmoc.solve` and of batches, each stated once; the command line has those
with a help."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import TYPE_CHECKING, Any

from dmoc.base.options import option
from dmoc.base.records import value_class
from dmoc.base.tolerances import ITERATIONS, OPTIMALITY, VIOLATION
from dmoc.solving.methods import DEFAULT, FORMS, METHODS, REFINING, SEARCHING, ProgramForm, listed

if TYPE_CHECKING:
    from concurrent.futures import Executor
else:  # which brings half a dozen modules, and of which the types of fields tell nothing
    Executor = Any

MOST_STARTS, MOST_WORKERS = 1_000_000, 1000
MOST_COUNT = 2**31 - 1  # that the compiled method can count
NUMBER = "expected a positive number"
LIMIT = "expected a positive time limit, or None"
METHOD = f"Solver: {listed()}"
# Of a search and of a batch.
METHOD_OF_MANY = f"{METHOD}; {SEARCHING} if the kernels are compiled."
WORKERS = "Processes of this machine."
SEED = "Seed of the random starts."


@value_class(frozen=True)
class Keywords:
    """The keywords of :func:`dmoc.solve` that mean the same for every problem."""

    method: str | None = option(
        None,
        "choice",
        f"{METHOD}; {DEFAULT} by default, with --tolerance, contacts that last, hits with friction "
        f"or peaks in the objective {REFINING} if the kernels are compiled.",
        choices=METHODS,
    )
    tolerance: float | None = option(
        None,
        "positive",
        "Refine the mesh, from --steps on, until the relative error is below this.",
        expected=f"{NUMBER}, or None",
    )
    form: str = option(
        ProgramForm.CONDENSED,
        "choice",
        "For slsqp: condensed, or the full program (small numbers of steps).",
        choices=FORMS,
    )
    starts: int | None = option(
        None,
        "whole",
        "Starts that are tried on a coarse mesh before the best minimum is solved; 1 for the "
        "guess alone, as many as it seems to take by default.",
        least=1,
        most=MOST_STARTS,
    )
    seed: int = option(0, "whole", SEED, least=0, most=MOST_COUNT)
    optimality: float = option(OPTIMALITY, "positive", expected=NUMBER)
    violation: float = option(VIOLATION, "positive", expected=NUMBER)
    iterations: int = option(ITERATIONS, "whole", "Iteration limit.", least=1, most=MOST_COUNT)
    seconds: float | None = option(
        None, "positive", "Time limit of the solver in seconds.", expected=LIMIT
    )
    verify: bool = option(True, "flag")
    reference: str = option("", "text")


@value_class(frozen=True)
class BatchKeywords:
    """The keywords of :func:`dmoc.solve_many` and :func:`dmoc.sweep`; ``options`` are those of a
    solve."""

    method: str | None = option(None, help=METHOD_OF_MANY)
    workers: int = option(1, "whole", WORKERS, least=1, most=MOST_WORKERS)
    executor: Executor | None = option(None, "executor")
    guess: Any = None
    keep: bool = option(False, "flag")
    seconds: float | None = option(None, "positive", "Time limit of all solves.", expected=LIMIT)
    progress: Any = None
    options: Mapping[str, Any] = field(default_factory=dict)
