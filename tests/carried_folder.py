"""Folders of solvers in C, compiled under the sanitizers with objects that all of them share."""

from __future__ import annotations

import subprocess
from functools import cache
from importlib import resources
from pathlib import Path

from c_objects import SANITIZED, WARNINGS, object_of

from dmoc.codegen.compiler import HEADERS
from dmoc.export.solver import PARTS, PLANNER

# Sources of a folder that are its own, beside its program.
OWN = ("program*.c", "kernels.c", "rests.c")


def run(*command: str, folder: Path, stdin: str = "") -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command, cwd=folder, capture_output=True, text=True, timeout=120, input=stdin
    )


@cache
def shared(flags: tuple[str, ...], without: str = "") -> list[str]:
    """The objects that all solvers and planners have, without those of a source."""
    places = {**PARTS, "dmoc.export": (*PARTS["dmoc.export"], *PLANNER)}
    parts = {Path(str(resources.files(package))): names for package, names in places.items()}
    flags = (*WARNINGS, *flags, *(f"-I{folder}" for folder in (*parts, HEADERS)))
    sources = [folder / name for folder, names in parts.items() for name in names]
    return [
        object_of(source, *flags)
        for source in sources
        if source.suffix == ".c" and source.name != without
    ]


def compiled(folder: Path, main: str = "main.c", *flags: str) -> str:
    """The program of a folder, or another one on its sources."""
    flags, target = flags or SANITIZED, f"./{Path(main).stem}"
    sources = [*(file for name in OWN for file in sorted(folder.glob(name))), folder / main]
    objects = [object_of(source, *WARNINGS, *flags) for source in sources]
    done = run("gcc", *flags, *objects, *shared(flags), "-lm", "-o", target, folder=folder)
    assert done.returncode == 0, done.stderr
    return target
