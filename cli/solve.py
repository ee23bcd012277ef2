"""The command ``dmoc solve``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dmoc.base.table import print_table
from dmoc.cli import completion
from dmoc.cli.console import (
    draw,
    emit,
    in_turn,
    out,
    prepare,
    written,
)
from dmoc.cli.groups import ConditionOptions, CourseOptions, ValueOptions
from dmoc.cli.option_values import (
    problem_fields,
    read_guess,
)
from dmoc.cli.shared_options import (
    METHOD_HELP,
    NOT_SOLVED,
    ControlsOption,
    DarkOption,
    GuessOption,
    JsonOption,
    ModelArgument,
    OrderOption,
    ViaOption,
    out_option,
)
from dmoc.cli.summaries import print_sensitivities
from dmoc.solving.methods import DEFAULT, REFINING, ProgramForm

if TYPE_CHECKING:
    from dmoc.program.cost_derivatives import Sensitivities


def solve(
    *,
    model: ModelArgument,
    course: CourseOptions,
    method: Annotated[
        str | None,
        typer.Option(
            autocompletion=completion.methods,
            help=f"{METHOD_HELP}; {DEFAULT} by default, with --tolerance, contacts that "
            f"last or hits with friction {REFINING} if the kernels are compiled.",
        ),
    ] = None,
    tolerance: Annotated[
        float | None,
        typer.Option(
            help="Refine the mesh, from --steps on, until the relative error is below this."
        ),
    ] = None,
    order: OrderOption = None,
    form: Annotated[
        ProgramForm,
        typer.Option(help="For slsqp: condensed, or the full program (small numbers of steps)."),
    ] = ProgramForm.CONDENSED,
    controls: ControlsOption = None,
    values: ValueOptions,
    conditions: ConditionOptions,
    via: ViaOption = None,
    sensitivities: Annotated[
        bool,
        typer.Option(
            "--sensitivities",
            help="Derivatives of the optimal cost with respect to what the problem is given.",
        ),
    ] = False,
    iterations: Annotated[int, typer.Option(help="Iteration limit.")] = 1000,
    seconds: Annotated[
        float | None, typer.Option(help="Time limit of the solver in seconds.")
    ] = None,
    guess: GuessOption = None,
    starts: Annotated[
        int | None,
        typer.Option(
            help="Starts that are tried on a coarse mesh before the best minimum is solved; 1 for "
            "the guess alone, as many as it seems to take by default."
        ),
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the random starts.")] = 0,
    target: Annotated[
        Path | None,
        out_option("Write solution.npz (and the figure) into this folder.", "DIR"),
    ] = None,
    dark: DarkOption = False,
    json_: JsonOption = None,
) -> None:
    """Solve an optimal control problem and check the solution by simulation."""
    from dmoc.models import registry
    from dmoc.problem.problem import AUTOMATIC_ORDER, Problem, says_lasting
    from dmoc.solving.sensitivity import sensitivities as differentiated
    from dmoc.solving.solve import solve as solved

    first_motion = read_guess(guess)
    reference = registry.find(model)
    fields = problem_fields(reference.defaults, course, values, conditions, controls, via)
    prepare(target, json_)
    words = fields.get("sequence", ())
    held = reference.held or says_lasting(fields.get("contacts", ()), words)
    if order is None and "steps" not in fields and fields.get("controls") != "linear":
        order = None if held else AUTOMATIC_ORDER
    problem = Problem(reference.kernels(order, progress=True), **fields)
    quiet = json_ == "-"
    solution = solved(
        problem,
        method,
        tolerance=tolerance,
        form=form.value,
        guess=first_motion,
        starts=starts,
        seed=seed,
        iterations=iterations,
        seconds=seconds,
        progress=True,
    )
    files: list[Path] = []
    derivatives: list[Sensitivities] = []

    def save() -> None:
        if target is not None:
            files.append(solution.save(target / "solution.npz"))

    def differentiate() -> None:
        if sensitivities and solution.converged:
            derivatives.append(differentiated(problem, solution))

    def tell() -> None:
        if not quiet:
            print_table(solution.summary(), out)
            if not solution.solved:
                out.print(f"Help: dmoc explain {solution.status}", style="dim")
            for slopes in derivatives:
                print_sensitivities(slopes)
            written(*files)

    in_turn(
        save,
        differentiate,
        lambda: emit(
            solution.to_dict() | ({"sensitivities": derivatives[0]} if derivatives else {}), json_
        ),
        tell,
        lambda: (
            None if target is None else draw(target / "solution.png", solution.plot, quiet, dark)
        ),
    )
    raise typer.Exit(0 if solution.solved else NOT_SOLVED)
