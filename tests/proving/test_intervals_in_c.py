"""Intervals in C contain what exact fractions give."""

from __future__ import annotations

import ctypes
import math
import subprocess
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from c_objects import C11, WARNINGS

from dmoc.codegen.kernels import Array

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    target = tmp_path_factory.mktemp("intervals") / "intervals.so"
    source, include = Path(__file__).with_name("intervals.c"), ROOT / "proving"
    command = ["gcc", *C11, *WARNINGS, "-O2", "-fPIC", "-shared", f"-I{include}", source]
    subprocess.run([*command, "-o", target, "-lm"], check=True)
    return ctypes.CDLL(str(target))


def results(library: ctypes.CDLL, a: Array, b: Array) -> Array:
    """Bounds (n, 6, 2) of a + b, a - b, a b, a / b, the square and the root of a."""
    out = np.empty((len(a), 6, 2))
    pointers = [x.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for x in (a, b, out)]
    library.operations(len(a), *pointers)
    return out


def drawn(rng: np.random.Generator, count: int) -> Array:
    """Intervals of all magnitudes, some of one number, some about zero, shape (count, 2)."""
    middle = rng.normal(size=count) * 10.0 ** rng.integers(-160, 150, count)
    wide = np.abs(middle) * rng.choice([0.0, 1e-16, 1e-3, 2.0], count)
    return np.stack([middle - wide, middle + wide], axis=1)


def test_results_contain_those_of_fractions(library: ctypes.CDLL) -> None:
    rng = np.random.default_rng(1)
    a, b = drawn(rng, 600), drawn(rng, 600)
    for (p, q), row in zip(zip(a, b, strict=True), results(library, a, b), strict=True):
        pairs = [(Fraction(x), Fraction(y)) for x in p for y in q]
        exact = [[x + y for x, y in pairs], [x - y for x, y in pairs], [x * y for x, y in pairs]]
        exact += [[x / y for x, y in pairs] if q[0] * q[1] > 0 else []]
        squares = [x * x for x, _ in pairs] + ([Fraction(0)] if p[0] <= 0 <= p[1] else [])
        for (lo, hi), numbers in zip(row, [*exact, squares], strict=False):
            finite = [bound for bound in (lo, hi) if math.isfinite(bound)]
            for x in numbers:
                assert lo <= x <= hi
            if numbers and len(finite) == 2:  # and not by much
                size = max(map(abs, numbers))
                assert Fraction(hi) - max(numbers) <= 3 * size / 2**52 + Fraction(2) ** -1021
                assert min(numbers) - Fraction(lo) <= 3 * size / 2**52 + Fraction(2) ** -1021
        lo, hi = row[5]
        if p[0] >= 0:
            assert lo >= 0 and Fraction(lo) ** 2 <= Fraction(p[0])
            assert Fraction(hi) ** 2 >= Fraction(p[1])


def test_what_has_no_bounds_is_the_whole_line(library: ctypes.CDLL) -> None:
    a = np.array([[1.0, 2.0], [1e308, 1.5e308], [-1.0, 4.0], [0.0, 0.0], [0.0, 5.0]])
    b = np.array(
        [[0.0, 1.0], [1e308, 1.5e308], [-1.0, 1.0], [-np.inf, np.inf], [2.0, np.inf]],
    )
    rows = results(library, a, b)
    line = [-np.inf, np.inf]
    assert rows[0, 3].tolist() == line  # by an interval with zero
    assert rows[1, 0].tolist() == line and rows[1, 2].tolist() == line  # too large
    assert rows[2, 5].tolist() == line  # the root of a negative number
    assert rows[3, 2].tolist() == line  # zero times infinity
    assert rows[4, 2].tolist() == line  # which is passed over by no comparison
    assert rows[0, 4].tolist() != line
