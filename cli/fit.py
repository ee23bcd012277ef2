"""The command ``dmoc fit``: parameters of a model from measured runs."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

from dmoc.base.errors import FitError
from dmoc.base.table import print_table
from dmoc.cli import completion
from dmoc.cli.console import draw, emit, in_turn, out, prepare, written
from dmoc.cli.groups import Stated, stated
from dmoc.cli.option_values import by_name, read_events, read_names, read_pairs, separate
from dmoc.cli.problem_options import ModelOptions, problem_fields
from dmoc.cli.shared_options import NOT_SOLVED, DarkOption, JsonOption, ModelArgument, out_option
from dmoc.cli.words import argument, option


class InputForm(StrEnum):
    held = "held"
    linear = "linear"


class Loss(StrEnum):
    linear = "linear"
    huber = "huber"


@dataclass(frozen=True)
class RunOptions(ModelOptions):
    """What happens in the runs, and from where on."""

    sequence: str | None = stated(
        "Events of the runs in their order, with commas between them; without it they are looked "
        "for.",
        Stated("sequence", read_events),
        completed=completion.surfaces,
    )
    start: list[str] | None = stated(
        "Start state: x or x_dot; a value, a range LOW:HIGH, or free; several with commas, or "
        "repeat it.",
        Stated("start", option="--start"),
        completed=completion.states,
        metavar="NAME=VALUE",
    )
    contacts: str | None = stated(
        "Surfaces that are closed at the start and rails that slide then.",
        Stated("contacts", read_names),
        completed=completion.surfaces,
        metavar="CONTACTS",
    )
    ignored: str | None = stated(
        "Surfaces that hold nothing back where no event names them.",
        Stated("ignored", read_names),
        completed=completion.surfaces,
        metavar="SURFACES",
    )


def fit(
    *,
    model: ModelArgument,
    runs: Annotated[
        list[Path],
        argument(metavar="RUN...", help="Tables of measured runs (.csv), one or several."),
    ],
    values: RunOptions,
    parameter: Annotated[
        list[str] | None,
        option(
            metavar="NAME=LOW:HIGH",
            help="What is fitted, within a range, or free: a parameter, e or e:SURFACE, "
            "bias:SENSOR, gain:SENSOR, delay:SENSOR; several with commas, or repeat it.",
            completed=completion.parameters,
        ),
    ] = None,
    sigma: Annotated[
        list[str] | None,
        option(
            metavar="NAME=VALUE|COLUMN",
            help="Standard deviation of a column, or the name of the column that has one in each "
            "row; several with commas, or repeat it.",
        ),
    ] = None,
    own: Annotated[
        str | None, option(help="Parameters that each run has of its own, as bias:x,e.")
    ] = None,
    inputs: Annotated[
        InputForm, option(help="What inputs are between their samples.")
    ] = InputForm.held,
    loss: Annotated[
        Loss, option(help="Least squares, or Huber's loss, for outliers.")
    ] = Loss.linear,
    target: Annotated[
        Path | None,
        out_option("Write fit.npz, .json, .csv, .html and .png into this folder.", "DIR"),
    ] = None,
    dark: DarkOption = False,
    json_: JsonOption = None,
) -> None:
    """Fit parameters to measured runs, through hits.

    A run is a CSV file with a column t, columns of coordinates, velocities, quantities and inputs
    by name, and a column event where events were seen.
    """
    from dmoc.fitting.fit import fit as fitted
    from dmoc.fitting.result import CONVERGED
    from dmoc.models import registry
    from dmoc.problem.problem import Problem

    prepare(target, json_)
    if not parameter:
        raise FitError("--parameter is missing: say what is fitted, such as m=0.5:2,e=0:1.")
    ranges, deviations = read_pairs(parameter, "--parameter"), _sigma(sigma)
    reference = registry.find(model)
    fields = problem_fields(reference.defaults, values)
    problem = Problem(reference.kernels(values.order, progress=True), **fields)
    result = fitted(
        problem, list(runs), ranges, sigma=deviations, own=read_names(own or ""),
        inputs=inputs.value, loss=loss.value,
    )  # fmt: skip
    quiet, files = json_ == "-", list[Path]()

    def save() -> None:
        if target is not None:
            for name in ("npz", "json", "csv"):
                write = {"npz": result.save, "json": result.to_json, "csv": result.to_csv}[name]
                files.append(write(target / f"fit.{name}"))

    def tell() -> None:
        if not quiet:
            print_table(result.summary(), out)
            written(*files)

    in_turn(
        lambda: emit(result.to_dict(), json_),
        save,
        tell,
        lambda: draw(target and target / "fit.png", result.plot, quiet, dark),
        lambda: draw(target and target / "fit.html", _report(result), quiet, dark),
    )
    sys.exit(0 if result.status == CONVERGED else NOT_SOLVED)


def _report(result: Any) -> Any:
    """The report as what draws a figure: both need Matplotlib, and neither decides the outcome."""

    def report(path: Path, style: str) -> None:
        del style  # a page has both
        result.report(path)

    return report


def _sigma(texts: list[str] | None) -> dict[str, Any]:
    """Standard deviations by column: numbers, or names of columns."""
    pairs = [text.partition("=") for text in separate(texts)]
    for name, _, value in pairs:
        if not (name.strip() and value.strip()):
            raise FitError(f"--sigma {name}: expected NAME=VALUE or NAME=COLUMN.")
    return by_name(((name.strip(), _number(value.strip())) for name, _, value in pairs), "--sigma")


def _number(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text
