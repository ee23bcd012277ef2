"""The C compiler: which one, whether it works, and the extension that it makes of a model's
sources."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sysconfig
import tempfile
from pathlib import Path
from typing import Any

from dmoc.base.arguments import shown
from dmoc.base.errors import BuildError

# The kernels decide the speed of a solve; the wrapper only hands over their table, so it is
# compiled quickly instead.  Contraction into fused operations stays off so that results are the
# same on every machine.  A warning is no reason to refuse a user's model.
KERNEL_FLAGS = ("-std=c11", "-O2", "-fPIC", "-ffp-contract=off", "-w")
# Large kernels are as quick with less optimisation, which takes a third of the compiler's time.
LARGE, LARGE_FLAGS = 200_000, ("-O1",)  # bytes of C
WRAPPER_FLAGS = ("-O1", "-fPIC", "-w")
# What an entry of the cache depends on.
FLAGS = (KERNEL_FLAGS, LARGE_FLAGS, WRAPPER_FLAGS)
WRAPPER = "wrapper"
# The header of every model's sources, and its folder.
HEADER, HEADERS = "dmoc_kernel.h", Path(__file__).parent


def compiler() -> list[str]:
    """Return the C compiler's command: $CC if set, else the one Python was built with, else cc or
    gcc.

    Raises
    ------
    BuildError
        If none of them can be found, or Python's headers are missing.
    """
    candidates = [os.environ.get("CC"), sysconfig.get_config_var("CC"), "cc", "gcc", "clang"]
    for candidate in candidates:
        command = _words(candidate)
        if command and shutil.which(command[0]):
            _require_headers()
            return command
        if command and candidate == os.environ.get("CC"):
            break
    raise BuildError(
        "no C compiler was found"
        + (f" (CC={os.environ['CC']})" if os.environ.get("CC") else "")
        + ": install gcc or clang (Debian: apt install gcc), or set CC to its command."
    )


def _words(command: str | None) -> list[str]:
    """The words of a command; only what a user sets can have a quotation without an end."""
    try:
        return shlex.split(command) if command else []
    except ValueError:
        raise BuildError(
            f"CC = {shown(command)} is no command (a quotation in it has no end): set CC to the "
            "command of a C compiler, or not at all."
        ) from None


def tried_compiler() -> list[str]:
    """Return the C compiler's command, after it has compiled and linked an extension without
    content.

    Raises
    ------
    BuildError
        If there is none, or it fails.
    """
    command = compiler()
    with tempfile.TemporaryDirectory(prefix="dmoc-") as work:
        (Path(work) / "trial.c").write_text("#include <math.h>\n#include <Python.h>\n")
        include = f"-I{sysconfig.get_path('include')}"
        _run([*command, *KERNEL_FLAGS, include, "-c", "trial.c", "-o", "trial.o"], Path(work))
        _link(command, ["trial.o"], "trial.so", Path(work))
    return command


def compile_extension(folder: Path, command: list[str]) -> Path:
    """Compile the sources in ``folder`` into an extension module beside them and return its
    path."""
    from Cython.Compiler import Main, Options

    translate: Any = Main.compile_single  # Cython's compiler is untyped
    make_options: Any = Main.CompilationOptions  # type: ignore[attr-defined]
    options = make_options(
        Options.default_options, output_file=str(folder / "wrapper_cython.c"), language_level=3
    )
    result = translate(str(folder / f"{WRAPPER}.pyx"), options, full_module_name=WRAPPER)
    if result.num_errors:
        raise BuildError(f"Cython cannot translate {folder / WRAPPER}.pyx: see its messages above.")
    include = ["-I", str(folder), "-I", str(HEADERS), "-I", sysconfig.get_path("include")]
    large = (folder / "kernels.c").stat().st_size > LARGE
    flags = (*KERNEL_FLAGS, *(LARGE_FLAGS if large else ()))
    _run([*command, *flags, *include, "-c", "kernels.c", "-o", "kernels.o"], folder)
    _run([*command, *WRAPPER_FLAGS, *include, "-c", "wrapper_cython.c", "-o", "wrapper.o"], folder)
    target = folder / f"{WRAPPER}{sysconfig.get_config_var('EXT_SUFFIX')}"
    _link(command, ["kernels.o", "wrapper.o"], target.name, folder)
    for leftover in ("kernels.o", "wrapper.o", "wrapper_cython.c"):
        (folder / leftover).unlink()
    return target


def _link(command: list[str], objects: list[str], target: str, folder: Path) -> None:
    linker = shlex.split(sysconfig.get_config_var("LDSHARED") or "cc -shared")[1:]
    _run([command[0], *linker, *objects, "-lm", "-o", target], folder)


def _run(command: list[str], folder: Path) -> None:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise BuildError(
            f"the compiler failed.\n  command: {shlex.join(command)}\n  output: "
            f"{done.stderr.strip()}"
        )


def _require_headers() -> None:
    header = Path(sysconfig.get_path("include")) / "Python.h"
    if not header.exists():
        raise BuildError(
            f"{header} is missing, which compiled kernels need: install the headers of Python "
            "(Debian: apt install python3-dev)."
        )
