"""Values with three derivatives in C contain those that SymPy finds."""

from __future__ import annotations

import ctypes
import itertools
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from c_objects import C11, WARNINGS

from dmoc.codegen.kernels import Array

ROOT = Path(__file__).resolve().parents[2]
PHASES, SECONDS, THIRDS = 10, 55, 220  # sizes of a jet
VARIABLES = a, b, c = sp.symbols("a b c")
ONE = a**2 / (1 + a)
THREE = (a + b + c) * ONE * (b + c) * (1 + b * c)
DERIVATIVES = [
    [THREE.diff(*key) for key in itertools.combinations_with_replacement(VARIABLES, order)]
    for order in (1, 2, 3)
]
EXACT = sp.lambdify(VARIABLES, [[ONE, *(ONE.diff(a, k) for k in (1, 2, 3))], [THREE], *DERIVATIVES])
CENTRE = np.array([0.7, 1.3, 0.4])


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    target = tmp_path_factory.mktemp("taylor") / "taylor.so"
    source, include = Path(__file__).with_name("taylor.c"), ROOT / "proving"
    command = ["gcc", *C11, *WARNINGS, "-O1", "-fPIC", "-shared", f"-I{include}", source]
    subprocess.run([*command, "-o", target, "-lm"], check=True)
    return ctypes.CDLL(str(target))


def bounds(library: ctypes.CDLL, box: Array) -> list[Array]:
    """Bounds (n, 2) of the line, the jet's value and its first, second, third derivatives."""
    line, jet = np.empty((7, 2)), np.empty((2 * (1 + PHASES + SECONDS) + THIRDS, 2))
    arrays: list[Any] = [CENTRE, np.ascontiguousarray(box), line, jet]
    library.example(*(x.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for x in arrays))
    g = 2 + PHASES + SECONDS  # those at the centre come first
    H, T = g + PHASES, g + PHASES + SECONDS
    return [line[3:], jet[g - 1 : g], jet[g : g + 3], jet[H : H + 6], jet[T : T + 10]]


@pytest.mark.parametrize("width", [0.0, 1e-6, 1e-3, 0.1, 0.6])
def test_derivatives_over_a_box_contain_those_at_its_points(
    library: ctypes.CDLL, width: float
) -> None:
    box = CENTRE[:, None] * [1 - width, 1 + width]
    of_box = bounds(library, box)
    rng = np.random.default_rng(0)
    corners = itertools.product(*box)
    for point in (*corners, *(box[:, 0] + (box[:, 1] - box[:, 0]) * rng.random((20, 3)))):
        for rows, exact in zip(of_box, EXACT(*point), strict=True):
            slack = 1e-13 * np.abs(exact)  # of the exact ones, which NumPy rounds
            assert (rows[:, 0] <= exact + slack).all() and (exact - slack <= rows[:, 1]).all()
    if width == 0:
        for rows, exact in zip(of_box, EXACT(*CENTRE), strict=True):
            assert (rows[:, 1] - rows[:, 0] <= 1e-12 * (1 + np.abs(exact))).all()
