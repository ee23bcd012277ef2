"""What each part of `ipm` is worth: the ladder's programs from the same starts, with one part left
out at a time.

Parts in C are left out of a copy of the sources, which is compiled for that; the product has no
switch for them.
"""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import mean
from typing import Any

import numpy as np
from common import Options, Section, Status, clocked, guess
from ladder_problems import RUNGS, Rung
from threadpoolctl import threadpool_limits

import dmoc
from dmoc.base.deadline import Deadline
from dmoc.guess.automatic import natural_time
from dmoc.guess.random_motions import random_motions
from dmoc.program.scale import Scale
from dmoc.program.scaling import scale_of
from dmoc.program.transcription import Transcription
from dmoc.solvers import ipm
from dmoc.solvers.kkt_layout import KKTLayout

ROOT = Path(__file__).resolve().parent.parent
STEPS, ORDERS, RANDOM = 24, (2, 4), 8  # steps a phase, and random starts beside the guess
ITERATIONS, SECONDS = 300, 20.0
SAME = 1e-5  # relative difference of two costs that are of one minimum

# What is left out: lines of the sources in C and what stands in their place.
PATCHES: Mapping[str, tuple[str, str, str]] = {
    "second-order corrections": (
        "interior_search.c", "k < MOST_SOC", "k < 0 * MOST_SOC",
    ),
    "restoration": (
        "interior_point.c", "return ip_restore(s); /* counts its own iterations */",
        "return DMOC_STALLED;",
    ),
}  # fmt: skip
BUILD = """
from Cython.Build import cythonize
from setuptools import Extension, setup
from glob import glob
setup(script_args=["-q", "build_ext", "--build-lib", "built"], ext_modules=cythonize(
    [Extension("compiled", ["compiled.pyx", *glob("*.c")], include_dirs=["."],
               extra_compile_args=["-std=c11", "-O3", "-ffp-contract=off"])],
    include_path=["."], language_level=3, quiet=True))
"""


@dataclass(frozen=True)
class ProgramStart:
    """A program's problem with the unknowns to begin with, in its own units."""

    problem: dmoc.Problem
    x: np.ndarray
    scale: Scale


@dataclass(frozen=True)
class End:
    solved: bool
    iterations: int
    cost: float
    seconds: float


def starts(rung: Rung, order: int) -> Iterator[ProgramStart]:
    """The first automatic guess, and random motions."""
    problem = rung.make(STEPS, order)
    first = guess(problem)
    scale = scale_of(problem, first)
    yield ProgramStart(problem, first, scale)
    for x in random_motions(problem, [first], natural_time(problem), range(RANDOM)):
        yield ProgramStart(problem, x, scale)


def run(start: ProgramStart, scaled: bool = True) -> End:
    scale = start.scale if scaled else Scale.none(start.problem)
    nlp = Transcription(start.problem, scale)
    options = Options(iterations=ITERATIONS, deadline=Deadline.after(SECONDS))
    with threadpool_limits(1), np.errstate(all="ignore"):
        x = np.clip(nlp.scaled(start.x), nlp.lower, nlp.upper)
        seconds, end = clocked(lambda: ipm.solve_ipm(nlp, x, options))
    solved = end.status is Status.SOLVED
    return End(solved, end.iterations, nlp.cost(end.x) * scale.cost, seconds)


@contextmanager
def without(name: str, of: Any) -> Iterator[None]:
    """Run with another entry of the method, or another constant."""
    before = getattr(ipm, name)
    setattr(ipm, name, of)
    try:
        yield
    finally:
        setattr(ipm, name, before)


def patched(part: str, folder: Path) -> Callable[..., Any]:
    """The entry of the method that is compiled without a part."""
    file, old, new = PATCHES[part]
    here = folder / part.replace(" ", "_")
    here.mkdir()
    for pattern in (
        "solvers/*.[ch]",
        "solvers/*.pyx",
        "solvers/*.pxi",
        "program/passes.*",
        "codegen/*.h",
        "codegen/*.pxd",
    ):
        for path in ROOT.glob(pattern):
            shutil.copy(path, here)
    source = here / file
    text = source.read_text()
    if text.count(old) != 1:
        raise RuntimeError(f"{file} has {old!r} {text.count(old)} times: expected once")
    source.write_text(text.replace(old, new))
    subprocess.run([sys.executable, "-c", BUILD], cwd=here, check=True, capture_output=True)
    (library,) = (here / "built").glob("compiled*.so")
    spec = importlib.util.spec_from_file_location("compiled", library)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)

    def method(program: Any, layout: KKTLayout, *arguments: Any, **options: Any) -> Any:
        """It works in rooms of its own, with a factorisation of its own."""
        own = module.Factorisation(layout.first, layout.start, layout.row)
        return module.interior_point(
            program, replace(layout, factorisation=own), *arguments, **options
        )

    return method


def compare(quick: bool) -> Section:
    rungs = RUNGS[::4] if quick else RUNGS
    every = [s for rung in rungs for order in ORDERS for s in starts(rung, order)]
    ends = {"as it is": [run(s) for s in every]}
    ends["scaling"] = [run(s, scaled=False) for s in every]
    with without("STRETCH", 1e9):
        ends["limit of step sizes"] = [run(s) for s in every]
    with tempfile.TemporaryDirectory() as folder:
        for part in PATCHES:
            with without("interior_point", patched(part, Path(folder))):
                ends[part] = [run(s) for s in every]
    section = Section(
        "`ipm` without its parts",
        f"The ladder's {len(rungs)} problems, orders 2 and 4, N = {STEPS} a phase, from the first "
        f"automatic guess and {RANDOM} random motions each: {len(every)} starts. At most "
        f"{ITERATIONS} iterations and {SECONDS:g} s. Solved: ends in a stationary point of its "
        "own program; lost and gained: starts that are solved with the part alone, and without it "
        "alone. Iterations are means over the starts that both solve; cheaper and dearer: of "
        "these, those that end in another minimum. The elimination of slacks is no row: the "
        "Newton step is the same without it, in a larger matrix.",
        [
            "without", "solved", "of guesses", "lost", "gained", "iterations", "with the part",
            "cheaper", "dearer",
        ],
    )  # fmt: skip
    reference = ends["as it is"]
    for name, own in ends.items():
        both = [(a, b) for a, b in zip(own, reference, strict=True) if a.solved and b.solved]
        guesses = own[:: RANDOM + 1]
        more = sum(a.cost > b.cost + SAME * abs(b.cost) for a, b in both)
        less = sum(a.cost < b.cost - SAME * abs(b.cost) for a, b in both)
        pairs = list(zip(own, reference, strict=True))
        section.row(
            "-" if name == "as it is" else name, f"{sum(e.solved for e in own)}/{len(own)}",
            f"{sum(e.solved for e in guesses)}/{len(guesses)}",
            sum(b.solved and not a.solved for a, b in pairs),
            sum(a.solved and not b.solved for a, b in pairs),
            f"{mean(a.iterations for a, _ in both):.1f}",
            f"{mean(b.iterations for _, b in both):.1f}", less, more,
        )  # fmt: skip
    return section
