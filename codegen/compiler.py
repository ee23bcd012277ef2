"""The C compiler: which one, whether it works, and the shared library that it makes of a model's
sources."""

from __future__ import annotations

import os
import shlex
import shutil
import sys
import tempfile
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from dmoc.base.arguments import shown
from dmoc.base.errors import BuildError
from dmoc.base.files import scratch_folder

# Contraction into fused operations stays off so that results are the same on every machine.  A
# warning is no reason to refuse a user's model.
FLAGS = ("-std=c11", "-O2", "-fPIC", "-ffp-contract=off", "-w")
SHARED = ("-shared",)
# Large kernels are as quick with less optimisation, which takes a third of the compiler's time.
LARGE, LARGE_FLAGS = 135_000, ("-O1",)  # bytes of C
# The compiler of a package compiles for the very processor it runs on, unless it is told not to: a
# cache may be that of several machines.
BASELINE = ("-mcpu=baseline",)
SOURCE = "kernels.c"
UNIT = "\n#if UNIT("  # begins what one of several processes may compile alone
# The header of every model's sources, and its folder.
HEADER, HEADERS = "dmoc_kernel.h", Path(__file__).parent


def compiler() -> list[str]:
    """Return the C compiler's command: $CC if set, else cc, gcc or clang, else that which
    ``pip install 'dmoc[cc]'`` brings.

    Raises
    ------
    BuildError
        If none of them can be found.
    """
    chosen = os.environ.get("CC", "").strip()
    for candidate in [chosen] if chosen else ["cc", "gcc", "clang"]:
        command = _words(candidate)
        if shutil.which(command[0]):
            return command
    carried = None if chosen else packaged()
    if carried:
        return [*carried, *BASELINE]
    raise BuildError(
        "no C compiler was found"
        + (f" (CC={chosen})" if chosen else "")
        + ": install gcc or clang (Debian: apt install gcc libc6-dev), or `pip install "
        "'dmoc[cc]'`, or set CC to its command."
    )


def packaged() -> list[str] | None:
    """The command of the compiler that is a Python package, which compiles for other systems too;
    None where it is not installed."""
    return [sys.executable, "-m", "ziglang", "cc"] if find_spec("ziglang") else None


def _words(command: str) -> list[str]:
    """The words of a command; only what a user sets can have a quotation without an end."""
    try:
        return shlex.split(command)
    except ValueError:
        raise BuildError(
            f"CC = {shown(command)} is no command (a quotation in it has no end): set CC to the "
            "command of a C compiler, or not at all."
        ) from None


def tried_compiler() -> list[str]:
    """Return the C compiler's command, after it has made a library without content.

    Raises
    ------
    BuildError
        If there is none, or it fails.
    """
    command = compiler()
    with scratch_folder() as work:
        (work / SOURCE).write_text(f'#include "{HEADER}"\n#include <math.h>\n')
        compile_library(work, command, "trial.so")
    return command


def compile_library(
    folder: Path, command: list[str], target: str, others: Sequence[str] = ()
) -> None:
    """Compile the sources in ``folder``, those of a model and others, into a shared library beside
    them; units of a large model on all processors that there are."""
    large = (folder / SOURCE).stat().st_size > LARGE
    words = [*command, *FLAGS, *(LARGE_FLAGS if large else ()), "-I", str(HEADERS)]
    with tempfile.TemporaryDirectory(dir=folder) as work:
        units = (folder / SOURCE).read_text(encoding="utf-8").count(UNIT) if large else 0
        shares = min(processors(), units)
        objects = [f"{work}/{i}.o" for i in range(shares)] if shares > 1 else []
        own = [f"-DDMOC_SHARES={shares}", "-c", SOURCE]
        _run(folder, [[*words, *own, f"-DDMOC_SHARE={i}", "-o", o] for i, o in enumerate(objects)])
        _run(folder, [[*words, *SHARED, *(objects or [SOURCE]), *others, "-lm", "-o", target]])


def processors() -> int:
    """How many processes may compile at once."""
    return len(os.sched_getaffinity(0))


def _run(folder: Path, commands: Sequence[list[str]]) -> None:
    """Run the compiler's commands at once in a folder."""
    import subprocess  # which loaded kernels do not need

    jobs = [
        subprocess.Popen(c, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        for c in commands
    ]
    errors = [job.communicate()[1] for job in jobs]
    for words, job, error in zip(commands, jobs, errors, strict=True):
        if job.returncode != 0 or not (folder / words[-1]).exists():
            raise BuildError(
                f"the compiler failed.\n  command: {shlex.join(words)}\n  output: {error.strip()}"
            )
