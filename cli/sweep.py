"""The command ``dmoc sweep``: a problem solved over a grid of values."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from dmoc.base.errors import OutputError, ProblemError
from dmoc.base.files import check_file
from dmoc.base.table import print_table
from dmoc.cli.console import draw, emit, in_turn, out, written
from dmoc.cli.groups import passed_on
from dmoc.cli.option_values import by_name, read_guess, read_range, separate, with_lists
from dmoc.cli.problem_options import CourseOptions, ProblemOptions, problem_fields, stated_by
from dmoc.cli.shared_options import (
    NOT_SOLVED,
    DarkOption,
    GuessOption,
    JsonOption,
    ModelArgument,
    out_option,
)
from dmoc.cli.words import option
from dmoc.solving.keywords import BatchKeywords

ENDINGS = (".csv", ".npz")


def sweep(
    *,
    model: ModelArgument,
    course: CourseOptions,
    stated: ProblemOptions,
    keywords: BatchKeywords,
    guess: GuessOption = None,
    starts: Annotated[
        int, option(help="Starts that are explored for each; 1 is the automatic guess alone.")
    ] = 1,
    target: Annotated[Path | None, out_option("Write the table, as .csv or .npz.", "FILE")] = None,
    plot: Annotated[
        Path | None,
        option(
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
    ranges, firsts = _ranges(stated)
    first_motion = read_guess(guess)
    reference = registry.find(model)
    fields = problem_fields(reference.defaults, course, firsts)
    problem = Problem(reference.kernels(stated.order, progress=True), **fields)
    quiet = json_ == "-"
    batch = swept(
        problem, guess=first_motion, starts=starts, progress=True, **ranges, **passed_on(keywords)
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
        lambda: draw(plot, batch.plot, quiet, dark),
    )
    sys.exit(0 if batch.solved.all() else NOT_SOLVED)


def _check_targets(target: Path | None, plot: Path | None, json_: str | None) -> None:
    """Fail before long solves rather than after them."""
    if target is not None and target.suffix not in ENDINGS:
        raise OutputError(f"--out {target}: expected a file that ends in .csv or .npz.")
    for path in (target, plot, None if json_ in (None, "-") else Path(str(json_))):
        if path is not None:
            check_file(path)


def _ranges(stated: ProblemOptions) -> tuple[dict[str, Any], ProblemOptions]:
    """Ranges to vary, by field and name, and the options with the first value of each range in its
    place."""
    ranges: dict[str, Any] = {}
    firsts: dict[str, Any] = {}
    for place, values, texts in stated_by(stated):
        if not values.option:
            continue
        varied, first = ranges.setdefault(values.field, {}), firsts.setdefault(place, [])
        parts = with_lists(separate(texts)) if values.lists else separate(texts)
        pairs = ((t.partition("=")[0].strip(), t) for t in parts)
        for name, text in by_name(pairs, values.option).items():
            value = text.partition("=")[2]
            numbers = read_range(value, f"{values.option} {name}")
            if numbers is None:
                first.append(text)
            elif values.field == "bounds":
                varied[name] = [(-abs(v), abs(v)) for v in numbers]
                first.append(f"{name}={-abs(numbers[0])!r}:{abs(numbers[0])!r}")
            else:
                varied[name] = numbers
                first.append(f"{name}={numbers[0]!r}")
    if not any(ranges.values()):
        raise ProblemError(
            "no value is a range: give one as FROM:TO:COUNT, such as --set l=0.4:0.8:50."
        )
    return ranges, replace(stated, **firsts)
