"""Commands about solutions: verify, plot."""

from __future__ import annotations

import sys
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

from dmoc.base.table import print_table
from dmoc.cli.console import emit, out, prepare, style_of, written
from dmoc.cli.shared_options import NOT_SOLVED, DarkOption, JsonOption, SolutionArgument, out_option
from dmoc.cli.words import option


def verify(
    solution: SolutionArgument,
    model: Annotated[
        str | None, option(help="Model of the solution, if it is not shipped: file.py:name.")
    ] = None,
    json_: JsonOption = None,
) -> None:
    """Check a solution by an independent simulation."""
    from dmoc.models import registry
    from dmoc.results.solution import Solution
    from dmoc.results.solution_model import check_same_model, kernels_of_file

    prepare(None, json_)
    loaded = Solution.load(solution)
    order = loaded.trajectory.order
    kernels = registry.load(model, order=order) if model else kernels_of_file(loaded)
    check_same_model(loaded, kernels)
    check = loaded.verify(kernels)
    emit(asdict(check), json_)
    if json_ != "-":
        print_table(check.summary(), out)
    sys.exit(0 if check.passed else NOT_SOLVED)


def plot(
    solution: SolutionArgument,
    target: Annotated[
        Path | None,
        out_option("Figure file (.png, .pdf, .svg); by default beside the solution, as .png."),
    ] = None,
    velocities: Annotated[bool, option("--velocities", help="Draw velocities too.")] = False,
    dark: DarkOption = False,
) -> None:
    """Draw a solution: snapshots, positions, momenta, inputs."""
    from dmoc.results.solution import Solution

    path = target or solution.with_suffix(".png")
    Solution.load(solution).plot(path, velocities=velocities, style=style_of(dark))
    written(path)
