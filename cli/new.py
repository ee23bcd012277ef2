"""The command ``dmoc new``: a file to begin with."""

from __future__ import annotations

import os
from enum import StrEnum
from pathlib import Path
from typing import Annotated

from dmoc.base.errors import ModelError, OutputError
from dmoc.base.files import check_folder, write_whole
from dmoc.cli.console import out, written
from dmoc.cli.shared_options import out_option
from dmoc.cli.words import argument, option

NAME = "my_system"  # in the templates


class TemplateKind(StrEnum):
    """What the file begins with."""

    collision = "collision"
    contact = "contact"
    mechanism = "mechanism"
    smooth = "smooth"
    fit = "fit"
    robot = "robot"


def new(
    name: Annotated[str, argument(help="Name of the system and of its file.")],
    kind: Annotated[
        TemplateKind,
        option(
            help="A block that bounces off a wall; a block that rests and slides on a rough floor; "
            "a hammer with a constraint, a quantity, an objective and a design; a pendulum that "
            "meets nothing; a block whose mass, wall and restitution are fitted to a run; an arm "
            "from a URDF that taps a table."
        ),
    ] = TemplateKind.collision,
    target: Annotated[Path, out_option("Folder of the file.", "DIR")] = Path(),
) -> None:
    """Write a system file to begin with.

    It has a model, a problem, and a main part that solves, prints and draws.
    """
    from dmoc.base.names import check_name

    path = target / f"{check_name(name, 'system')}.py"
    _check_hidden(name)
    _write(path, _text(kind).replace(NAME, name))
    written(path)
    out.print("It is complete and runs as it is. Next:")
    for command in next_steps(name, path):
        out.print(f"    {command}", soft_wrap=True)


def next_steps(name: str, path: Path) -> list[str]:
    """Commands that work with a new file."""
    import shlex

    file = shlex.quote(str(path))
    return [
        f"python {file}",
        f"dmoc solve {shlex.quote(f'{path}:problem')} --out {name}",
        f"dmoc derive {shlex.quote(f'{path}:system')}",
    ]


def _check_hidden(name: str) -> None:
    """Refuse the name of a module: a script beside the file would import the file instead."""
    import sys
    from importlib.machinery import PathFinder

    elsewhere = [place for place in sys.path if place not in ("", str(Path.cwd()))]
    taken = name in ("dmoc", *sys.stdlib_module_names)
    if taken or PathFinder.find_spec(name, elsewhere) is not None:
        raise ModelError(
            f"system name {name!r} is that of a module, which {name}.py would hide from Python: "
            "choose another name."
        )


def _text(kind: TemplateKind) -> str:
    from importlib import resources

    place = resources.files("dmoc.cli").joinpath("templates", f"{kind.value}.py")
    return place.read_text(encoding="utf-8")


def _write(path: Path, text: str) -> None:
    if os.path.lexists(path):
        raise OutputError(
            f"{path} exists, and is left as it is: choose another name, or --out another folder."
        )
    check_folder(path.parent)
    write_whole(path, text.encode())
