"""The command ``dmoc search``: the best sequence of collisions."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from dmoc.base.errors import SearchError
from dmoc.base.table import print_table
from dmoc.cli.console import draw, emit, in_turn, out, prepare, written
from dmoc.cli.groups import passed_on
from dmoc.cli.problem_options import ProblemOptions, problem_fields
from dmoc.cli.shared_options import NOT_SOLVED, DarkOption, JsonOption, ModelArgument, out_option
from dmoc.cli.words import option
from dmoc.sequences.keywords import SearchKeywords

if TYPE_CHECKING:
    from dmoc.sequences.search import SearchResult


def search(
    *,
    model: ModelArgument,
    steps: Annotated[int | None, option(help="Steps of each phase.")] = None,
    stated: ProblemOptions,
    keywords: SearchKeywords,
    target: Annotated[
        Path | None,
        out_option(
            "Write the best solution, the tree, the best motions, and a page that plays "
            "them into this folder.",
            "DIR",
        ),
    ] = None,
    verbose: Annotated[
        bool, option("--verbose", "-v", help="Show durations and evidence too.")
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
    fields = problem_fields(reference.defaults, stated)
    fields |= {"sequence": (), "durations": None, "via": None}
    if steps is not None:
        fields["steps"] = steps
    prepare(target, json_)
    problem = Problem(reference.kernels(stated.order, progress=True), **fields)
    result = search_sequences(problem, progress=True, **passed_on(keywords))
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
        lambda: draw(target and target / "tree.png", result.plot, quiet, dark),
        lambda: draw(target and target / "best.png", result.plot_best, quiet, dark),
        lambda: draw(target and target / "tree.html", result.animate, quiet, dark),
        lambda: _complain(result),
    )
    sys.exit(0 if result.best is not None else NOT_SOLVED)


def _complain(result: SearchResult) -> None:
    """A search that something broke off has its answer so far, and is no success."""
    if result.broken:
        raise SearchError(f"{result.broken}: the result is that of a search that was broken off.")
