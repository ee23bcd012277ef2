"""The command ``dmoc search``: the best sequence of collisions."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dmoc.base.errors import SearchError
from dmoc.base.table import print_table
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
    read_names,
)
from dmoc.cli.shared_options import (
    NOT_SOLVED,
    ControlsOption,
    DarkOption,
    FinalTimeOption,
    JsonOption,
    MethodOption,
    ModelArgument,
    OrderOption,
    out_option,
)

if TYPE_CHECKING:
    from dmoc.sequences.search import SearchResult


class Strategy(StrEnum):
    exhaustive = "exhaustive"
    best_first = "best-first"
    beam = "beam"


def search(
    *,
    model: ModelArgument,
    max_collisions: Annotated[int, typer.Option(help="Most collisions of a sequence.")] = 3,
    surfaces: Annotated[
        str | None, typer.Option(help="Surfaces that may be hit, as left,right; all by default.")
    ] = None,
    events: Annotated[
        str | None,
        typer.Option(
            help="Events that may happen, as '+right -left,rail:slip+' (see --sequence of dmoc "
            "solve); by default all hits, and with contacts that last all that is possible."
        ),
    ] = None,
    strategy: Annotated[
        Strategy,
        typer.Option(help="All sequences, the most promising first, or the best of each depth."),
    ] = Strategy.exhaustive,
    beam: Annotated[
        int,
        typer.Option(
            help="Sequences of a depth whose children are looked at, with --strategy beam."
        ),
    ] = 4,
    starts: Annotated[
        int, typer.Option(help="Random starts of each sequence beside the automatic ones.")
    ] = 4,
    seed: Annotated[int, typer.Option(help="Seed of the random starts.")] = 0,
    workers: Annotated[int, typer.Option(help="Processes of this machine.")] = 1,
    steps: Annotated[int | None, typer.Option(help="Steps of each phase.")] = None,
    final_time: FinalTimeOption = None,
    method: MethodOption = None,
    order: OrderOption = None,
    controls: ControlsOption = None,
    values: ValueOptions,
    conditions: ConditionOptions,
    shortest_phase: Annotated[
        float | None,
        typer.Option(
            help="Shortest duration of a phase in seconds; a hundredth of the largest final time "
            "by default."
        ),
    ] = None,
    seconds: Annotated[float | None, typer.Option(help="Time budget of the search.")] = None,
    max_nodes: Annotated[int | None, typer.Option(help="Budget of sequences.")] = None,
    node_seconds: Annotated[
        float | None,
        typer.Option(help="Time limit of one sequence; it is tried once more.  None by default."),
    ] = None,
    journal: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Keep finished sequences in this file (SQLite)."),
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with the sequences of --journal.")
    ] = False,
    target: Annotated[
        Path | None,
        out_option(
            "Write the best solution, the tree, the best motions, and a page that plays "
            "them into this folder.",
            "DIR",
        ),
    ] = None,
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Show durations and evidence too.")
    ] = False,
    dark: DarkOption = False,
    json_: JsonOption = None,
) -> None:
    """Search for the best sequence of collisions."""
    from dmoc.models import registry
    from dmoc.problem.problem import Problem
    from dmoc.sequences.search import search as search_sequences
    from dmoc.sequences.search_table import table_of_search

    reference = registry.find(model)
    course = CourseOptions(steps=None if steps is None else str(steps), final_time=final_time)
    fields = problem_fields(reference.defaults, course, values, conditions, controls)
    fields |= {"sequence": (), "durations": None, "via": None}
    prepare(target, json_)
    problem = Problem(reference.kernels(order, progress=True), **fields)
    result = search_sequences(
        problem,
        max_collisions,
        surfaces=None if surfaces is None else read_names(surfaces),
        events=None if events is None else read_names(events),
        strategy=strategy.value,
        beam=beam,
        starts=starts,
        seed=seed,
        method=method,
        workers=workers,
        seconds=seconds,
        node_seconds=node_seconds,
        max_nodes=max_nodes,
        shortest_phase=shortest_phase,
        journal=journal,
        resume=resume,
        progress=True,
    )
    quiet = json_ == "-"
    files: list[Path] = []

    def save() -> None:
        if target is not None and result.best is not None and result.best.solution is not None:
            files.append(result.best.solution.save(target / "solution.npz"))

    def tell() -> None:
        if not quiet:
            print_table(table_of_search(result, verbose), out)
            written(*files)

    in_turn(
        save,
        lambda: emit(result.to_dict(), json_),
        tell,
        lambda: _draw(result, target, quiet, dark),
        lambda: _complain(result),
    )
    raise typer.Exit(0 if result.best is not None else NOT_SOLVED)


def _draw(result: SearchResult, folder: Path | None, quiet: bool, dark: bool) -> None:
    if folder is not None:
        draw(folder / "tree.png", result.plot, quiet, dark)
        draw(folder / "best.png", result.plot_best, quiet, dark)
        draw(folder / "tree.html", result.animate, quiet, dark)


def _complain(result: SearchResult) -> None:
    """A search that something broke off has its answer so far, and is no success."""
    if result.broken:
        raise SearchError(f"{result.broken}: the result is that of a search that was broken off.")
