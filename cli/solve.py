"""The command ``dmoc solve``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from rich.table import Table

from dmoc.base.table import print_table
from dmoc.cli.console import draw, emit, in_turn, out, prepare, written
from dmoc.cli.groups import passed_on
from dmoc.cli.option_values import read_guess
from dmoc.cli.problem_options import (
    CourseOptions,
    ProblemOptions,
    problem_fields,
    stated_problem,
)
from dmoc.cli.shared_options import (
    NOT_SOLVED,
    DarkOption,
    GuessOption,
    JsonOption,
    ModelArgument,
    out_option,
)
from dmoc.cli.words import option
from dmoc.solving.keywords import Keywords

if TYPE_CHECKING:
    from dmoc.program.cost_derivatives import Sensitivities


def solve(
    *,
    model: ModelArgument,
    course: CourseOptions,
    stated: ProblemOptions,
    keywords: Keywords,
    guess: GuessOption = None,
    sensitivities: Annotated[
        bool,
        option(
            "--sensitivities",
            help="Derivatives of the optimal cost with respect to what the problem is given.",
        ),
    ] = False,
    certify: Annotated[
        bool,
        option(
            "--certify",
            help="Prove that a strict local minimum of the program lies near the solution.",
        ),
    ] = False,
    target: Annotated[
        Path | None, out_option("Write solution.npz (and the figure) into this folder.", "DIR")
    ] = None,
    dark: DarkOption = False,
    json_: JsonOption = None,
) -> None:
    """Solve an optimal control problem and check the solution by simulation."""
    from dmoc.models import registry
    from dmoc.solving.solve import solve as solved

    first_motion = read_guess(guess)
    reference = registry.find(model)
    fields = problem_fields(reference.defaults, course, stated)
    prepare(target, json_)
    problem = stated_problem(reference, stated.order, fields)
    quiet = json_ == "-"
    solution = solved(problem, guess=first_motion, progress=True, **passed_on(keywords))
    files: list[Path] = []
    derivatives: list[Sensitivities] = []

    def save() -> None:
        if target is not None:
            files[:] = [solution.save(target / "solution.npz")]

    def differentiate() -> None:
        if sensitivities and solution.converged:
            from dmoc.solving.sensitivity import sensitivities as differentiated

            derivatives.append(differentiated(problem, solution))

    def prove() -> None:
        nonlocal solution
        if certify:
            from dmoc.proving.certify import certify as certified

            solution = solution.with_certificate(certified(problem, solution))
            save()

    def told() -> dict[str, Any]:
        more: dict[str, Any] = {"sensitivities": derivatives[0]} if derivatives else {}
        return solution.to_dict() | more

    def tell() -> None:
        if not quiet:
            print_table(solution.summary(), out)
            if not solution.solved:
                out.print(f"Help: dmoc explain {solution.status}", style="dim")
            for slopes in derivatives:
                _print_sensitivities(slopes)
            written(*files)

    in_turn(
        save,
        differentiate,
        prove,
        lambda: emit(told(), json_),
        tell,
        lambda: draw(target and target / "solution.png", solution.plot, quiet, dark),
    )
    sys.exit(0 if solution.solved else NOT_SOLVED)


def _print_sensitivities(derivatives: Sensitivities) -> None:
    """Derivatives of the cost by kind and name."""
    table = Table("dJ/d ...", "", "", box=None, header_style="bold")
    for kind, slopes in derivatives.items():
        named = slopes.items() if isinstance(slopes, dict) else [("", slopes)]
        for name, value in named:
            table.add_row(kind.replace("_", " "), name, f"{value:.6g}")
    out.print(table)
