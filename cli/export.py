"""The commands that hand a solution on: as a table for other programs, as a report for people."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from dmoc.cli.console import written
from dmoc.cli.shared_options import SolutionArgument, out_option


def export(
    solution: SolutionArgument,
    target: Annotated[
        Path | None,
        out_option("Table, .csv or .json; by default beside the solution, as .csv.", "FILE"),
    ] = None,
) -> None:
    """Write the motion of a solution as a table: time, phase, states, inputs, contact forces."""
    from dmoc.base.files import write_whole
    from dmoc.motion.motion_tables import written_as
    from dmoc.results.solution import Solution

    path = target or solution.with_suffix(".csv")
    write = written_as(path.suffix[1:].lower())
    write_whole(path, write(Solution.load(solution).trajectory).encode())
    written(path)


def report(
    solution: SolutionArgument,
    target: Annotated[
        Path | None,
        out_option("Report, .html or .pdf; by default beside the solution, as .html.", "FILE"),
    ] = None,
) -> None:
    """Write a report of a solution: problem, result, minima found, check and figure."""
    from dmoc.results.solution import Solution

    path = target or solution.with_suffix(".html")
    written(Solution.load(solution).report(path))
