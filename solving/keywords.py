"""The keywords of :func:`dmoc.solve` and of batches, each stated once; the command line has those
with a help."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, field
from typing import Annotated, Any

from dmoc.base.options import option
from dmoc.base.tolerances import ITERATIONS, OPTIMALITY, VIOLATION
from dmoc.solving.methods import DEFAULT, FORMS, METHODS, REFINING, SEARCHING, ProgramForm, listed

MOST_STARTS, MOST_WORKERS = 1_000_000, 1000
MOST_COUNT = 2**31 - 1  # that the compiled method can count
NUMBER = "expected a positive number"
LIMIT = "expected a positive time limit, or None"
METHOD = f"Solver: {listed()}"
# Of a search and of a batch.
METHOD_OF_MANY = f"{METHOD}; {SEARCHING} if the kernels are compiled."
WORKERS = "Processes of this machine."
SEED = "Seed of the random starts."


@dataclass(frozen=True)
class Keywords:
    """The keywords of :func:`dmoc.solve` that mean the same for every problem."""

    method: Annotated[
        str | None,
        option(
            "choice",
            f"{METHOD}; {DEFAULT} by default, with --tolerance, contacts that last or hits with "
            f"friction {REFINING} if the kernels are compiled.",
            choices=METHODS,
        ),
    ] = None
    tolerance: Annotated[
        float | None,
        option(
            "positive",
            "Refine the mesh, from --steps on, until the relative error is below this.",
            expected=f"{NUMBER}, or None",
        ),
    ] = None
    form: Annotated[
        str,
        option(
            "choice",
            "For slsqp: condensed, or the full program (small numbers of steps).",
            choices=FORMS,
        ),
    ] = ProgramForm.CONDENSED
    starts: Annotated[
        int | None,
        option(
            "whole",
            "Starts that are tried on a coarse mesh before the best minimum is solved; 1 for the "
            "guess alone, as many as it seems to take by default.",
            least=1,
            most=MOST_STARTS,
        ),
    ] = None
    seed: Annotated[int, option("whole", SEED, least=0, most=MOST_COUNT)] = 0
    optimality: Annotated[float, option("positive", expected=NUMBER)] = OPTIMALITY
    violation: Annotated[float, option("positive", expected=NUMBER)] = VIOLATION
    iterations: Annotated[int, option("whole", "Iteration limit.", least=1, most=MOST_COUNT)] = (
        ITERATIONS
    )
    seconds: Annotated[
        float | None, option("positive", "Time limit of the solver in seconds.", expected=LIMIT)
    ] = None
    verify: Annotated[bool, option("flag")] = True
    reference: Annotated[str, option("text")] = ""


@dataclass(frozen=True)
class BatchKeywords:
    """The keywords of :func:`dmoc.solve_many` and :func:`dmoc.sweep`; ``options`` are those of a
    solve."""

    method: Annotated[str | None, option(help=METHOD_OF_MANY)] = None
    workers: Annotated[int, option("whole", WORKERS, least=1, most=MOST_WORKERS)] = 1
    executor: Annotated[Executor | None, option("executor")] = None
    guess: Any = None
    keep: Annotated[bool, option("flag")] = False
    seconds: Annotated[
        float | None, option("positive", "Time limit of all solves.", expected=LIMIT)
    ] = None
    progress: Any = None
    options: Mapping[str, Any] = field(default_factory=dict)
