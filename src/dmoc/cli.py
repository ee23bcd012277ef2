"""The command line: models, derive, generate, build, solve, search, sweep, verify, plot, doctor.

Exit status: 0 solved and verified, 1 not solved, 2 wrong use or bad input.
"""

from __future__ import annotations

import errno
import io
import os
import sys
import warnings
from dataclasses import asdict
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table
from rich.text import Text

from dmoc.cli_input import (
    BAD_INPUT,
    METHOD_HELP,
    NOT_SOLVED,
    BoundOption,
    ContactsOption,
    ControlsOption,
    FinalTimeOption,
    GoalOption,
    GuessOption,
    IgnoredOption,
    JsonOption,
    ModelArgument,
    OrderOption,
    PeriodicOption,
    RestitutionOption,
    SequenceOption,
    SetOption,
    StartOption,
    StepsOption,
    ViaOption,
    draw,
    emit,
    err,
    in_turn,
    out,
    prepare,
    print_text,
    problem_fields,
    read_guess,
    written,
)
from dmoc.cli_output import Live, coloured, print_sensitivities, print_summary, print_verification
from dmoc.cli_search import search
from dmoc.cli_sweep import sweep
from dmoc.discretisation import ORDERS_SHOWN
from dmoc.errors import DmocError, OutputError
from dmoc.solving.methods import DEFAULT, METHODS, REFINING, Form
from dmoc.writing import REMEDY, write_whole

if TYPE_CHECKING:
    from dmoc.nlp.sensitivity import Sensitivities

NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)

app = typer.Typer(
    help="Discrete mechanics and optimal control for mechanical systems with collisions.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


class TextFormat(StrEnum):
    text = "text"
    latex = "latex"


@app.callback()
def _options(
    debug: Annotated[bool, typer.Option("--debug", help="Show tracebacks of errors.")] = False,
) -> None:
    del debug  # read by main, before anything can fail


@app.command()
def models() -> None:
    """List the shipped models and problems."""
    from dmoc.models import catalogue

    table = Table("name", "model", "what", box=None, header_style="bold")
    for name, entry in catalogue.ENTRIES.items():
        table.add_row(
            name,
            entry.model,
            entry.title + ("" if entry.problem else " - no problem, give one by options"),
        )
    out.print(table)


@app.command()
def derive(
    model: ModelArgument,
    format_: Annotated[
        TextFormat, typer.Option("--format", help="Readable text, or a LaTeX document.")
    ] = TextFormat.text,
    order: Annotated[
        int, typer.Option(help=f"Order of the discretisation, one of {ORDERS_SHOWN}.")
    ] = 2,
    target: Annotated[
        Path | None, typer.Option("--out", help="Write to a file instead of standard output.")
    ] = None,
) -> None:
    """Print every step of the derivation of a model."""
    from dmoc.registry import find
    from dmoc.symbolic.derivation import derive as derive_system

    derivation = derive_system(find(model).system(), order)
    text = derivation.latex() if format_ is TextFormat.latex else str(derivation)
    if target is None:
        print_text(text)
    else:
        write_whole(target, text.encode())


@app.command()
def generate(
    model: ModelArgument,
    target: Annotated[
        Path | None,
        typer.Option(
            "--out", help="Folder for the sources; by default a folder of the model's name."
        ),
    ] = None,
    order: Annotated[
        int, typer.Option(help=f"Order of the discretisation, one of {ORDERS_SHOWN}.")
    ] = 2,
) -> None:
    """Write the C and Cython sources of a model."""
    from dmoc.codegen.build import header, write_files
    from dmoc.codegen.text import c_files
    from dmoc.registry import find
    from dmoc.symbolic.families import model_spec

    files = c_files(model_spec(find(model).system(), order)) | header()
    folder = target or Path(find(model).system().name)
    try:
        paths = write_files(folder, files)
    except OSError as error:
        raise OutputError(
            f"{folder} cannot be written ({error.strerror}): choose a writable folder."
        ) from None
    for path in paths:
        out.print(str(path), soft_wrap=True)


@app.command()
def build(
    model: ModelArgument,
    order: Annotated[
        int, typer.Option(help=f"Order of the discretisation, one of {ORDERS_SHOWN}.")
    ] = 2,
    force: Annotated[
        bool, typer.Option("--force", help="Build again even if the cache holds the kernels.")
    ] = False,
) -> None:
    """Compile the kernels of a model into the cache."""
    from dmoc import registry

    kernels = registry.build(
        registry.find(model).system(), order=order, backend="compiled", force=force
    )
    state = f"built in {kernels.seconds:.2f} s" if kernels.seconds else "found in the cache"
    out.print(f"{kernels.name}: {state}, {kernels.module.__file__}", soft_wrap=True)


@app.command()
def solve(
    model: ModelArgument,
    sequence: SequenceOption = None,
    steps: StepsOption = None,
    final_time: FinalTimeOption = None,
    method: Annotated[
        str | None,
        typer.Option(
            help=f"{METHOD_HELP}; {DEFAULT} by default, with --tolerance or contacts that "
            f"last {REFINING}."
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
        Form,
        typer.Option(help="For slsqp: condensed, or the full program (small numbers of steps)."),
    ] = Form.CONDENSED,
    controls: ControlsOption = None,
    set_: SetOption = None,
    bound: BoundOption = None,
    start: StartOption = None,
    goal: GoalOption = None,
    restitution: RestitutionOption = None,
    periodic: PeriodicOption = None,
    contacts: ContactsOption = None,
    ignored: IgnoredOption = None,
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
        typer.Option(
            "--out", metavar="DIR", help="Write solution.npz (and the figure) into this folder."
        ),
    ] = None,
    json_: JsonOption = None,
) -> None:
    """Solve an optimal control problem and check the solution by simulation."""
    from dmoc import registry
    from dmoc.nlp.problem import AUTOMATIC_ORDER, Problem, says_lasting
    from dmoc.solving.sensitivity import sensitivities as differentiated
    from dmoc.solving.solve import solve as solved

    known = read_guess(guess)
    reference = registry.find(model)
    fields = problem_fields(
        reference.defaults,
        sequence,
        steps,
        final_time,
        controls,
        set_,
        bound,
        start,
        goal,
        restitution,
        periodic,
        contacts,
        ignored,
        via,
    )
    prepare(target, json_)
    lasting = says_lasting(fields.get("contacts", ()), fields.get("sequence", ()))
    if order is None and "steps" not in fields and fields.get("controls") != "linear":
        order = None if lasting else AUTOMATIC_ORDER
    problem = Problem(reference.kernels(order), **fields)
    quiet = json_ == "-"
    with Live() as live:
        solution = solved(
            problem,
            method,
            tolerance=tolerance,
            form=form.value,
            guess=known,
            starts=starts,
            seed=seed,
            iterations=iterations,
            seconds=seconds,
            progress=live.show,
        )
    files: list[Path] = []
    derivatives: list[Sensitivities] = []

    def save() -> None:
        if target is not None:
            files.append(solution.save(target / "solution.npz"))

    def differentiate() -> None:
        if sensitivities and solution.converged:
            derivatives.append(
                differentiated(problem.but(steps=[p.steps for p in solution.phases]), solution)
            )

    def tell() -> None:
        if not quiet:
            print_summary(solution)
            for found in derivatives:
                print_sensitivities(found)
            written(*files)

    in_turn(
        save,
        differentiate,
        lambda: emit(
            solution.to_dict() | ({"sensitivities": derivatives[0]} if derivatives else {}), json_
        ),
        tell,
        lambda: None if target is None else draw(target / "solution.png", solution.plot, quiet),
    )
    raise typer.Exit(0 if solution.solved else NOT_SOLVED)


app.command()(search)
app.command()(sweep)


@app.command()
def verify(
    solution: Annotated[Path, typer.Argument(help="Solution file (.npz).", show_default=False)],
    model: Annotated[
        str | None, typer.Option(help="Model of the solution, if it is not shipped: file.py:name.")
    ] = None,
    json_: JsonOption = None,
) -> None:
    """Check a solution by an independent simulation."""
    from dmoc import registry
    from dmoc.solution import Solution, check_same_model

    prepare(None, json_)
    loaded = Solution.load(solution)
    order = loaded.trajectory.order
    kernels = (
        registry.load(model, order=order)
        if model
        else registry.load_for_file(loaded.reference, order)
    )
    check_same_model(loaded, kernels)
    check = loaded.verify(kernels)
    summary = {
        key: (value.tolist() if hasattr(value, "tolist") else value)
        for key, value in asdict(check).items()
    }
    emit(summary, json_)
    if json_ != "-":
        print_verification(check)
    raise typer.Exit(0 if check.passed else NOT_SOLVED)


@app.command()
def plot(
    solution: Annotated[Path, typer.Argument(help="Solution file (.npz).", show_default=False)],
    target: Annotated[
        Path | None,
        typer.Option(
            "--out", help="Figure file (.png, .pdf, .svg); by default beside the solution, as .png."
        ),
    ] = None,
) -> None:
    """Draw a solution: snapshots, positions, momenta, inputs."""
    from dmoc.solution import Solution

    path = target or solution.with_suffix(".png")
    Solution.load(solution).plot(path)
    out.print(str(path), highlight=False, soft_wrap=True)


@app.command()
def doctor() -> None:
    """Show compiler, versions, cache and optional parts, and what is missing."""
    import platform
    from importlib import metadata

    from dmoc.codegen.build import cache_directory, compiler, load_installed
    from dmoc.codegen.private import make_folder
    from dmoc.errors import BuildError
    from dmoc.models import catalogue

    table = Table("part", "state", box=None, header_style="bold")
    table.add_row("python", platform.python_version())
    for name in ("dmoc", "numpy", "scipy", "sympy", "symengine", "cython"):
        table.add_row(name, metadata.version(name))
    healthy = True
    try:
        table.add_row("C compiler", " ".join(compiler()))
    except BuildError as error:
        table.add_row("C compiler", Text.assemble(coloured(False, "missing"), f": {error}"))
        healthy = False
    cache = cache_directory()
    try:
        make_folder(cache)
        writable = os.access(cache, os.W_OK)
    except OSError:
        writable = False
    entries = len([p for p in cache.iterdir() if p.is_dir()]) if cache.is_dir() else 0
    table.add_row(
        "kernel cache",
        f"{cache}, {entries} models"
        if writable
        else Text.assemble(
            f"{cache} ",
            coloured(False, "cannot be written"),
            ": set DMOC_CACHE to a writable folder",
        ),
    )
    healthy = healthy and writable
    for name in catalogue.models():
        table.add_row(
            f"model {name}",
            "compiled"
            if load_installed(f"dmoc.generated.{name}")
            else "not compiled: built on first use",
        )
    extras = [("matplotlib", "plot", "draw figures")]
    extras += [(m.package, m.name, f"use method {m.name}") for m in METHODS.values() if m.package]
    for name, extra, what in extras:
        try:
            table.add_row(name, metadata.version(name))
        except metadata.PackageNotFoundError:
            table.add_row(name, f"not installed: `pip install 'dmoc[{extra}]'` to {what}")
    out.print(table)
    raise typer.Exit(0 if healthy else BAD_INPUT)


def main() -> None:
    """Run the command line; errors become one sentence and exit status 2."""
    debug = "--debug" in sys.argv
    if debug:
        sys.argv.remove("--debug")  # so that it may stand anywhere
    else:
        warnings.showwarning = lambda message, *_, **__: err.print(
            f"warning: {message}", soft_wrap=True
        )
    try:
        app()
    except (DmocError, OSError) as error:
        if debug or (isinstance(error, OSError) and error.errno not in NO_ROOM):
            raise
        what = (
            error
            if isinstance(error, DmocError)
            else f"standard output cannot be written ({error.strerror}): {REMEDY}."
        )
        err.print(f"error: {what}", style="red", soft_wrap=True)
        if isinstance(error, OSError):
            sys.stdout = io.StringIO()  # Python would try once more, and complain, when it ends
        sys.exit(BAD_INPUT)
    except KeyboardInterrupt:
        err.print("interrupted")
        sys.exit(130)


if __name__ == "__main__":
    main()
