"""The command ``dmoc sweep``: a problem solved over a grid of values."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from dmoc.base.errors import OutputError, ProblemError
from dmoc.base.files import check_file
from dmoc.base.table import print_table
from dmoc.cli.console import (
    draw,
    emit,
    in_turn,
    out,
    written,
)
from dmoc.cli.groups import ConditionOptions, CourseOptions, ValueOptions
from dmoc.cli.option_values import (
    by_name,
    problem_fields,
    read_guess,
    read_range,
    separate,
)
from dmoc.cli.shared_options import (
    NOT_SOLVED,
    BoundOption,
    ControlsOption,
    DarkOption,
    GoalOption,
    GuessOption,
    JsonOption,
    MethodOption,
    ModelArgument,
    OrderOption,
    SetOption,
    StartOption,
    ViaOption,
    out_option,
)

ENDINGS = (".csv", ".npz")


def sweep(
    *,
    model: ModelArgument,
    set_: SetOption = None,
    start: StartOption = None,
    goal: GoalOption = None,
    bound: BoundOption = None,
    course: CourseOptions,
    method: MethodOption = None,
    order: OrderOption = None,
    controls: ControlsOption = None,
    conditions: ConditionOptions,
    via: ViaOption = None,
    guess: GuessOption = None,
    starts: Annotated[
        int, typer.Option(help="Starts that are explored for each; 1 is the automatic guess alone.")
    ] = 1,
    workers: Annotated[int, typer.Option(help="Processes of this machine.")] = 1,
    seconds: Annotated[float | None, typer.Option(help="Time limit of all solves.")] = None,
    target: Annotated[
        Path | None,
        out_option("Write the table, as .csv or .npz.", "FILE"),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Draw cost and times of events over one value, or the cost over two.",
        ),
    ] = None,
    dark: DarkOption = False,
    json_: JsonOption = None,
) -> None:
    """Solve a problem over ranges of values.

    A range in --set, --start and --goal is FROM:TO:COUNT, as l=0.4:0.8:50.
    In --bound it is that of the largest magnitude, as F=50:200:4.
    Several ranges make a grid.
    """
    from dmoc.models import registry
    from dmoc.problem.problem import Problem
    from dmoc.solving.sweep import sweep as swept

    _check_targets(target, plot, json_)
    ranges, firsts = _ranges(ValueOptions(set_, bound, start, goal))
    first_motion = read_guess(guess)
    reference = registry.find(model)
    fields = problem_fields(reference.defaults, course, firsts, conditions, controls, via)
    problem = Problem(reference.kernels(order, progress=True), **fields)
    quiet = json_ == "-"
    batch = swept(
        problem,
        ranges["parameters"],
        start=ranges["start"],
        goal=ranges["goal"],
        bounds=ranges["bounds"],
        method=method,
        workers=workers,
        guess=first_motion,
        starts=starts,
        seconds=seconds,
        progress=True,
    )

    def tell() -> None:
        if not quiet:
            print_table(batch.summary(), out)

    def save() -> None:
        if target is not None:
            path = batch.to_csv(target) if target.suffix == ".csv" else batch.save(target)
            if not quiet:
                written(path)

    in_turn(
        lambda: emit(batch.to_dict(), json_),
        tell,
        save,
        lambda: None if plot is None else draw(plot, batch.plot, quiet, dark),
    )
    raise typer.Exit(0 if batch.solved.all() else NOT_SOLVED)


def _check_targets(target: Path | None, plot: Path | None, json_: str | None) -> None:
    """Fail before long solves rather than after them."""
    if target is not None and target.suffix not in ENDINGS:
        raise OutputError(f"--out {target}: expected a file that ends in .csv or .npz.")
    for path in (target, plot, None if json_ in (None, "-") else Path(str(json_))):
        if path is not None:
            check_file(path)


def _ranges(values: ValueOptions) -> tuple[dict[str, dict[str, list[Any]]], ValueOptions]:
    """What is varied, by field and name; and the options with the first value of each range in its
    place."""
    ranges: dict[str, dict[str, list[Any]]] = {}
    firsts: dict[str, list[str]] = {}
    for field, option, texts in values.by_field():
        ranges[field], firsts[field] = {}, []
        named = by_name(((t.partition("=")[0].strip(), t) for t in separate(texts)), option)
        for name, text in named.items():
            value = text.partition("=")[2]
            numbers = read_range(value, f"{option} {name}")
            if numbers is None:
                firsts[field].append(text)
            elif field == "bounds":
                ranges[field][name] = [(-abs(v), abs(v)) for v in numbers]
                firsts[field].append(f"{name}={-abs(numbers[0])!r}:{abs(numbers[0])!r}")
            else:
                ranges[field][name] = numbers
                firsts[field].append(f"{name}={numbers[0]!r}")
    if not any(ranges.values()):
        raise ProblemError(
            "no value is a range: give one as FROM:TO:COUNT, such as --set l=0.4:0.8:50."
        )
    return ranges, ValueOptions(
        firsts["parameters"], firsts["bounds"], firsts["start"], firsts["goal"]
    )
