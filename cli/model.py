"""Commands about models: list, derive, generate, build."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

from rich.table import Table

from dmoc.base.discretisation import ORDERS_SHOWN
from dmoc.base.errors import OutputError
from dmoc.base.files import write_whole
from dmoc.cli.console import out, print_text, written
from dmoc.cli.option_values import read_names
from dmoc.cli.shared_options import ModelArgument, out_option
from dmoc.cli.words import argument, option


class TextFormat(StrEnum):
    text = "text"
    latex = "latex"
    html = "html"


def models(
    robot: Annotated[
        Path | None,
        argument(help="File of a robot, a URDF or an MJCF: its links, joints and limits."),
    ] = None,
) -> None:
    """List the shipped models and problems, or show the robot of a file."""
    if robot is not None:
        from dmoc.base.table import print_table
        from dmoc.robots.robot import read_robot

        print_table(read_robot(robot).summary(), out)
        return
    from dmoc.models import catalogue

    table = Table(box=None, header_style="bold")
    table.add_column("name", no_wrap=True)
    table.add_column("model", overflow="fold")
    table.add_column("what", overflow="fold")
    for name, entry in catalogue.ENTRIES.items():
        table.add_row(
            name,
            entry.model,
            entry.title + ("" if entry.problem else " - no problem, give one by options"),
        )
    out.print(table)


def derive(
    model: ModelArgument,
    format_: Annotated[
        TextFormat,
        option(
            "--format",
            help="Readable text, a LaTeX document, or a page with the check of the kernels.",
        ),
    ] = TextFormat.text,
    order: Annotated[int, option(help=f"Order of the discretisation, one of {ORDERS_SHOWN}.")] = 2,
    expanded: Annotated[
        bool,
        option(
            "--expanded",
            help="Write out large systems and definitions, whose structure is shown otherwise.",
        ),
    ] = False,
    design: Annotated[
        str,
        option(
            metavar="NAMES", help="Parameters that a solver chooses, as k,l: kernels that know it."
        ),
    ] = "",
    target: Annotated[
        Path | None, out_option("Write to a file instead of standard output.")
    ] = None,
) -> None:
    """Print every step of the derivation of a model."""
    from dmoc.inspection.system_derivation import derive as derive_system
    from dmoc.models.registry import find

    chosen = read_names(design)
    derivation = derive_system(find(model).system(), order, expanded=expanded, design=chosen)
    made = {
        TextFormat.text: derivation.__str__,
        TextFormat.latex: derivation.latex,
        TextFormat.html: derivation.html,
    }
    text = made[format_]()
    if target is None:
        print_text(text)
    else:
        write_whole(target, text.encode())
        written(target)


def generate(
    model: ModelArgument,
    target: Annotated[
        Path | None,
        out_option("Folder for the sources; by default a folder of the model's name."),
    ] = None,
    order: Annotated[
        int | None,
        option(
            help=f"Order of the discretisation, one of {ORDERS_SHOWN}; by default 2, or the order "
            "of the problem."
        ),
    ] = None,
    solver: Annotated[
        bool, option("--solver", help="A solver of the problem, with all that it needs.")
    ] = False,
    page: Annotated[
        Path | None,
        option(metavar="FILE", help="A page (.html) that plans the motion again while one drags."),
    ] = None,
) -> None:
    """Write the C sources of a model, or of a solver of its problem, or this as a page."""
    if page is not None and (solver or target is not None):
        raise OutputError("--page writes one file: give it without --solver and --out.")
    if solver or page is not None:
        for path in _exported(model, target, order, page):
            out.print(str(path), soft_wrap=True)
        return
    from dmoc.codegen.build import header, write_files
    from dmoc.codegen.text import c_files
    from dmoc.models.registry import find
    from dmoc.symbolic.families import model_spec

    files = c_files(model_spec(find(model).system(), order or 2)) | header()
    folder = target or Path(find(model).system().name)
    try:
        paths = write_files(folder, files)
    except OSError as error:
        raise OutputError(
            f"{folder} cannot be written ({error.strerror}): choose a writable folder."
        ) from None
    for path in paths:
        out.print(str(path), soft_wrap=True)


def _exported(model: str, target: Path | None, order: int | None, page: Path | None) -> list[Path]:
    from dmoc.export.page import generate_page
    from dmoc.export.solver import generate_solver
    from dmoc.models.registry import find
    from dmoc.problem.problem import Problem

    reference = find(model)
    kernels = reference.kernels(order, progress=True)
    problem = Problem(kernels, **reference.defaults)
    if page is not None:
        return [generate_page(problem, page)]
    return generate_solver(problem, target or Path(f"{kernels.name}_solver"))


def build(
    model: ModelArgument,
    order: Annotated[int, option(help=f"Order of the discretisation, one of {ORDERS_SHOWN}.")] = 2,
    force: Annotated[
        bool, option("--force", help="Build again even if the cache holds the kernels.")
    ] = False,
) -> None:
    """Compile the kernels of a model into the cache."""
    from dmoc.models import registry

    kernels = registry.build(
        registry.find(model).system(), order=order, backend="compiled", force=force, progress=True
    )
    state = f"built in {kernels.seconds:.2f} s" if kernels.seconds else "found in the cache"
    out.print(f"{kernels.name}: {state}, {kernels.module.path}", soft_wrap=True)
