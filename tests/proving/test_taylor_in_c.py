"""Lines, curves and models in C contain the values and derivatives that SymPy finds."""

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
VARIABLES = a, b, c = sp.symbols("a b c")
ONE = a**2 / (1 + a)
THREE = (a + b + c) * ONE * (b + c) * (1 + b * c) - 2 * ONE
EXACT = sp.lambdify(VARIABLES, [[ONE.diff(a, k) for k in range(4)], THREE])
CENTRE = np.array([0.7, 1.3, 0.4])
WIDTHS = [0.0, 1e-6, 1e-3, 0.1, 0.6]
# Powers of the distances from the centre in each term of a model.
POWERS = [
    [key.count(i) for i in range(3)]
    for order in range(4)
    for key in itertools.combinations_with_replacement(range(3), order)
]


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    target = tmp_path_factory.mktemp("taylor") / "taylor.so"
    source, include = Path(__file__).with_name("taylor.c"), ROOT / "proving"
    command = ["gcc", *C11, *WARNINGS, "-O1", "-fPIC", "-shared", f"-I{include}", source]
    subprocess.run([*command, "-o", target, "-lm"], check=True)
    return ctypes.CDLL(str(target))


def of_box(library: ctypes.CDLL, width: float) -> tuple[Array, list[Array]]:
    """A box, its line (n, 2), sizes, its curve and its model, each with its rest, the last with its
    range."""
    box = CENTRE[:, None] * [1 - width, 1 + width]
    made: list[Any] = [np.empty((7, 2)), np.empty(3), np.empty(5), np.empty(23)]
    arrays = (CENTRE, np.ascontiguousarray(box), *made)
    library.example(*(x.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for x in arrays))
    return box, made


@pytest.mark.parametrize("width", WIDTHS)
def test_functions_over_a_box_contain_their_values(library: ctypes.CDLL, width: float) -> None:
    box, (line, most, curve, model) = of_box(library, width)
    rng = np.random.default_rng(0)
    corners = itertools.product(*box)
    for point in (*corners, *(box[:, 0] + (box[:, 1] - box[:, 0]) * rng.random((20, 3)))):
        one, three = EXACT(*point)
        x = (point - CENTRE) / most
        slack = 1e-13 * np.abs(one)  # of the exact ones, which NumPy rounds
        assert (line[3:, 0] <= one + slack).all() and (one - slack <= line[3:, 1]).all()
        assert abs(curve[:4] @ x[0] ** np.arange(4) - one[0]) <= curve[4] + slack[0]
        polynomial = model[:20] @ np.prod(x ** np.array(POWERS), axis=1)
        assert abs(polynomial - three) <= model[20] + 1e-13 * abs(three)
        assert model[21] - 1e-13 <= three <= model[22] + 1e-13
    if width == 0:
        assert (line[3:, 1] - line[3:, 0] <= 1e-12 * (1 + np.abs(one))).all()
        assert model[20] <= 1e-12


def test_rests_are_of_the_fourth_order(library: ctypes.CDLL) -> None:
    """The line's third derivative over the range is its own rest."""
    rests = [of_box(library, width)[1][3][20] for width in (1e-3, 1e-2)]
    assert 1e3 < rests[1] / rests[0] < 3e4
    assert rests[1] < 1e-6


def test_rests_have_what_is_above_the_third_degree(library: ctypes.CDLL) -> None:
    rests = (ctypes.c_double * 6)()
    library.fourth_powers(rests)
    np.testing.assert_allclose(rests[:], 1.0, rtol=1e-10)
    assert min(rests) >= 1


@pytest.mark.parametrize("width", [0.1, 0.6])
def test_rests_are_needed(library: ctypes.CDLL, width: float) -> None:
    """Some values are nearly as far from the polynomial as the rest allows."""
    box, (_, most, curve, model) = of_box(library, width)
    away = []
    for point in itertools.product(*box):
        one, three = EXACT(*point)
        x = (point - CENTRE) / most
        polynomial = model[:20] @ np.prod(x ** np.array(POWERS), axis=1)
        away.append([abs(curve[:4] @ x[0] ** np.arange(4) - one[0]), abs(polynomial - three)])
    assert (np.max(away, axis=0) > 0.02 * np.array([curve[4], model[20]])).all()
