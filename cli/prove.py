"""The command ``dmoc prove``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

from dmoc.base.table import print_table
from dmoc.cli.console import draw, emit, in_turn, out, prepare, written
from dmoc.cli.problem_options import (
    CourseOptions,
    ProblemOptions,
    problem_fields,
    stated_problem,
)
from dmoc.cli.shared_options import NOT_SOLVED, DarkOption, JsonOption, ModelArgument, out_option
from dmoc.cli.words import option


def prove(
    *,
    model: ModelArgument,
    course: CourseOptions,
    stated: ProblemOptions,
    gap: Annotated[
        float, option(help="How far the bound may stay below the cost, relative to it.")
    ] = 1e-4,
    seconds: Annotated[float, option(help="Limit of all, in seconds.")] = 60.0,
    seed: Annotated[int, option(help="Seed of the random starts of the solve.")] = 0,
    workers: Annotated[int, option(help="Threads that bound boxes.")] = 1,
    journal: Annotated[
        Path | None,
        option(metavar="FILE", help="Keep what is left to do, and go on with it, in this file."),
    ] = None,
    target: Annotated[
        Path | None,
        out_option("Write solution.npz, and a figure of the boxes, into this folder.", "DIR"),
    ] = None,
    dark: DarkOption = False,
    json_: JsonOption = None,
) -> None:
    """Prove that a motion is the best of its sequence, or that there is none."""
    from dmoc.models import registry
    from dmoc.proving.prove import prove as proved

    reference = registry.find(model)
    fields = problem_fields(reference.defaults, course, stated)
    prepare(target, json_)
    problem = stated_problem(reference, stated.order, fields)
    proof = proved(
        problem, gap, seconds, seed=seed, workers=workers, journal=journal, progress=True
    )
    files: list[Path] = []

    def save() -> None:
        if target is not None and proof.solution is not None:
            files.append(proof.solution.save(target / "solution.npz"))

    def tell() -> None:
        if json_ != "-":
            print_table(proof.summary(), out)
            written(*files)

    figure = target / "proof.png" if target is not None and proof.paving is not None else None
    in_turn(
        save,
        lambda: emit(proof.to_dict(), json_),
        tell,
        lambda: draw(figure, proof.plot, json_ == "-", dark),
    )
    sys.exit(0 if proof.proved else NOT_SOLVED)
