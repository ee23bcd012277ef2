"""Folders of solvers in C, compiled under the sanitizers with objects that all of them share."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence
from functools import cache
from importlib import resources
from pathlib import Path

from c_objects import SANITIZED, WARNINGS, object_of
from quick_compiler import compile_quickly

from dmoc.codegen import compiler
from dmoc.codegen.compiler import HEADERS
from dmoc.export.solver import PARTS, PLANNER

# Sources of a folder that are its own, beside its program.
OWN = ("program*.c", "kernels.c", "rests.c")


def run(*command: str, folder: Path, stdin: str = "") -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command, cwd=folder, capture_output=True, text=True, timeout=120, input=stdin
    )


def parts() -> dict[Path, tuple[str, ...]]:
    """The files that all solvers and planners have, by their folders."""
    places = {**PARTS, "dmoc.export": (*PARTS["dmoc.export"], *PLANNER)}
    return {Path(str(resources.files(package))): (*names,) for package, names in places.items()}


@cache
def shared(flags: tuple[str, ...], without: str = "") -> list[str]:
    """The objects that all solvers and planners have, without those of a source."""
    sources = [folder / name for folder, names in parts().items() for name in names]
    return [
        shared_object(source, *WARNINGS, *flags)
        for source in sources
        if source.suffix == ".c" and source.name != without
    ]


@cache
def shared_object(source: Path, *flags: str, gcc: str = "gcc") -> str:
    """The object of a source that all solvers and planners have."""
    return object_of(source, *flags, *(f"-I{folder}" for folder in (*parts(), HEADERS)), gcc=gcc)


def compile_library(
    folder: Path, command: list[str], target: str, others: Sequence[str] = ()
) -> None:
    """What dmoc's function of this name does, with objects for what all solvers have, where the
    compiler's command is one word."""
    gcc, *more = compiler.compiler()
    flags = [flag for flag in compiler.FLAGS if flag != "-shared"]
    places = {} if more else parts()
    own = {name: place / name for place, names in places.items() for name in names}
    files = [
        shared_object(own[name], *flags, gcc=gcc)
        if name in own and (folder / name).read_text() == own[name].read_text()
        else name
        for name in others
    ]
    compile_quickly(folder, command, target, files)


def compiled(folder: Path, main: str = "main.c", *flags: str) -> str:
    """The program of a folder, or another one on its sources."""
    flags, target = flags or SANITIZED, f"./{Path(main).stem}"
    sources = [*(file for name in OWN for file in sorted(folder.glob(name))), folder / main]
    objects = [object_of(source, *WARNINGS, *flags) for source in sources]
    done = run("gcc", *flags, *objects, *shared(flags), "-lm", "-o", target, folder=folder)
    assert done.returncode == 0, done.stderr
    return target
