"""The factorisation of a Newton step beside a product of matrices of its block size."""

from __future__ import annotations

import ctypes
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from common import Section, guess, program, seed, timed

import dmoc
from dmoc.codegen.compiler import compiler
from dmoc.program.transcription import Transcription
from dmoc.solvers.compiled import Factorisation
from dmoc.solvers.kkt_layout import kkt_layout

FLAGS = ["-O3", "-std=gnu11", "-ffp-contract=off", "-fPIC", "-shared"]
# L Y' of a block: rows below its pivots by rows, over its columns, four by four as in ldl.c, of
# numbers that stay in the first cache.
PRODUCT = """
typedef double four __attribute__((vector_size(32), aligned(8)));
#if defined(__x86_64__) && !defined(__clang__)
__attribute__((target_clones("avx2", "default")))
#endif
void products(long times, int width, int rows, const double *L, const double *Y, double *U)
{
    for (long t = 0; t < times; ++t) {
        for (int j = 0; j < rows; j += 4)
            for (int i = 0; i < rows; i += 4) {
                four a = {0}, b = {0}, c = {0}, d = {0};
                for (int e = 0; e < width; ++e) {
                    const four l = *(const four *)(L + e*rows + i);
                    const double *y = Y + e*rows + j;
                    a += l*y[0], b += l*y[1], c += l*y[2], d += l*y[3];
                }
                *(four *)(U + j*rows + i) = a, *(four *)(U + (j + 1)*rows + i) = b;
                *(four *)(U + (j + 2)*rows + i) = c, *(four *)(U + (j + 3)*rows + i) = d;
            }
        __asm__ volatile("" : : "r"(L), "r"(Y), "r"(U) : "memory");
    }
}
"""
ROUNDS, TIMES = 300, 200_000


def dense(width: int, rows: int) -> float:
    """Operations a nanosecond of products (rows, width) by (width, rows); rows in fours."""
    with tempfile.TemporaryDirectory() as folder:
        source, library = Path(folder) / "product.c", Path(folder) / "product.so"
        source.write_text(PRODUCT, encoding="utf-8")
        subprocess.run([*compiler(), *FLAGS, "-o", str(library), str(source)], check=True)
        run = ctypes.CDLL(str(library)).products
    L, Y, U = (np.ones(n) for n in (width * rows, width * rows, rows * rows))
    numbers = [a.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for a in (L, Y, U)]
    seconds, _ = timed(lambda: run(ctypes.c_long(TIMES), width, rows, *numbers), 5)
    return 2e-9 * width * rows * rows * TIMES / seconds


def walker() -> dmoc.Problem:
    sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "examples"))
    import walker

    problem: dmoc.Problem = walker.problem()
    return problem


def operations(width: np.ndarray, rows: np.ndarray) -> tuple[float, float]:
    """Additions and multiplications of the columns of all blocks, and of what they subtract from
    others."""
    both = zip(width.tolist(), rows.tolist(), strict=True)
    own = [sum(2 * (c + 1) * (w - c + r) for c in range(w)) for w, r in both]
    return float(sum(own)), float((width * rows * (rows + 1)).sum())


def compare(quick: bool) -> Section:
    section = Section(
        "The factorisation of a Newton step",
        "Blocks of K (`solvers/ldl.h`) with the columns and the rows below them that most of the "
        "work is in, operations in all of them: of their own columns, and of what they subtract "
        "from others. Beside it the products of dense matrices of this size, with as many rows as "
        "fours hold. A column waits for the one before it, and what is subtracted is added to "
        "other panels number by number, for which a block of a step gives little to do meanwhile.",
        ["problem", "unknowns of K", "block", "operations", "of columns", "us", "a nanosecond",
         "dense product", "share", "a solve, us"],
    )  # fmt: skip
    cases = [(f"seed, N = {n} + {n}", seed(steps=n)) for n in (24, 100, 1000)]
    for name, problem in [*cases, ("a step of RABBIT", walker())]:
        nlp: Transcription = program(problem, guess(problem))
        layout = kkt_layout(nlp)
        found = layout.factorisation.analysis()
        width = np.diff(found["first"][found["block"]])
        rows = np.diff(found["row_start"])
        work = width * (width + rows) ** 2
        shapes, which = np.unique(np.stack([width, rows]), axis=1, return_inverse=True)
        most = shapes[:, int(np.argmax(np.bincount(which.ravel(), work)))]
        values = np.random.default_rng(0).normal(size=layout.factorisation.entries)
        values[layout.diagonal[layout.diagonal >= 0]] += 10.0
        own, right = Factorisation(like=layout.factorisation), np.ones(layout.size)
        seconds, _ = timed(lambda f=own, v=values: f.factor(v), 3 if quick else ROUNDS)
        solving, _ = timed(lambda f=own, b=right: f.solve(b), 3 if quick else ROUNDS)
        columns, others = operations(width, rows)
        rate = 1e-9 * (columns + others) / seconds
        product = dense(int(most[0]), -(-int(most[1]) // 4) * 4)
        section.row(
            name, layout.size, f"{most[0]} columns, {most[1]} rows", f"{columns + others:,.0f}",
            f"{columns / (columns + others):.0%}", f"{1e6 * seconds:.1f}", f"{rate:.1f}",
            f"{product:.1f}", f"{rate / product:.0%}", f"{1e6 * solving:.1f}",
        )  # fmt: skip
    return section
