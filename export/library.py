"""The sources of a carried solver as a library that Python calls."""

from __future__ import annotations

import ctypes
import re
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

from dmoc.base.errors import BuildError
from dmoc.base.files import scratch_folder
from dmoc.base.messages import place
from dmoc.codegen.compiler import HEADER, SOURCE, compile_library, compiler
from dmoc.export.solver import KERNELS, PARTS, PLANNER

# The source that is compiled with those of a folder.
BESIDE = "dmoc_loaded.c"
# What the header of a problem asks for where its folder has a planner too.
PLANNER_HEADERS = [name for name in PLANNER if name.endswith(".h")]
FORMAT = re.compile(r"DMOC_SOLVER_FORMAT = (\d+)")
PROBLEM = re.compile(r"const dmoc_carried (\w+)_problem = \{")


def sources_in(folder: Path) -> dict[str, str]:
    """The sources of a folder, without its programs."""

    def text(name: str) -> str:
        return (folder / name).read_text(encoding="utf-8")

    own = resources.files(__package__).joinpath("dmoc_solver.h").read_text(encoding="utf-8")
    forms = [FORMAT.search(header) for header in (text("dmoc_solver.h"), own)]
    was, now = (form[1] if form else "1" for form in forms)
    if was != now:
        raise BuildError(
            f"{place(folder)} was written by another version of dmoc (its sources have form {was}, "
            f"those of this one form {now}): write it again with dmoc.generate_solver."
        )
    program = text("program.c")
    named = PROBLEM.search(program)
    if named is None:
        raise FileNotFoundError
    parts = [*KERNELS, HEADER, f"{named[1]}.h", *(n for names in PARTS.values() for n in names)]
    parts += [name for name in PLANNER_HEADERS if (folder / name).exists()]
    return {"program.c": program} | {name: text(name) for name in parts}


def library_of(texts: Mapping[str, str]) -> ctypes.CDLL:
    """The sources as a library; its file is not needed once it is loaded."""
    beside = resources.files(__package__).joinpath(BESIDE).read_text(encoding="utf-8")
    name, *_ = PROBLEM.findall(texts["program.c"])
    others = [file for file in (*texts, BESIDE) if file.endswith(".c") and file != SOURCE]
    words = [*compiler(), f"-DDMOC_PROBLEM={name}_problem"]
    with scratch_folder() as folder:
        for file, text in {**texts, BESIDE: beside}.items():
            (folder / file).write_text(text, encoding="utf-8")
        compile_library(folder, words, "solver.so", others)
        try:
            return declared(ctypes.CDLL(str(folder / "solver.so")))
        except (OSError, AttributeError) as error:
            raise BuildError(
                f"the sources of {name!r} lack functions of a solver ({error}): write the folder "
                "again with dmoc.generate_solver."
            ) from None


def declared(c: ctypes.CDLL) -> ctypes.CDLL:
    """A library with the types of its functions."""
    real, whole_number, size, text = ctypes.c_double, ctypes.c_int, ctypes.c_size_t, ctypes.c_char_p
    p, seed = ctypes.c_void_p, ctypes.c_ulonglong
    types: tuple[tuple[Any, ...], ...] = (
        ("loaded", p), ("loaded_clock", real), ("loaded_row", size, p),
        ("loaded_solve", None, p, whole_number, real, whole_number, seed, p, p, p, p),
        ("loaded_many", None, p, size, p, whole_number, whole_number, real, p, p, p, p),
        ("solver_memory", size, p), ("solver_begin", p, p, p, size),
        ("solver_numbers", whole_number, p), ("solver_number", text, p, whole_number),
        ("solver_get", real, p, whole_number), ("solver_set", None, p, whole_number, real),
        ("solver_from_answer", None, p), ("solver_from_first_motion", None, p),
        ("solver_from", None, p, p), ("solver_shift", whole_number, p, real),
        ("solver_sentence", text, whole_number), ("solver_size", whole_number, p),
        ("solver_rows", whole_number, p), ("solver_tables", whole_number, p),
        ("solver_table_name", text, p, whole_number),
        ("solver_table", p, p, whole_number, p, p), ("solver_times", p, p, p),
    )  # fmt: skip
    for name, result, *arguments in types:
        function = getattr(c, f"dmoc_{name}")
        function.restype, function.argtypes = result, arguments
    return c
