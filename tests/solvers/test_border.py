"""Arrays of wrong sizes do not reach the C code of the interior-point method."""

from __future__ import annotations

import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dmoc
from dmoc.codegen.border import Library
from dmoc.program.transcription import Transcription
from dmoc.solvers.compiled import Factorisation, interior_point, interior_points, kkt_pattern
from dmoc.solvers.kkt_layout import kkt_layout

ROOT = Path(__file__).resolve().parents[2]
ARRAYS = ("size", "stretch", "x", "y", "z_lower", "z_upper")
LAYOUT = ("place", "row", "from_hess", "from_jac", "diagonal")


@pytest.mark.parametrize("wrong", [*ARRAYS, *LAYOUT, "price"])
def test_a_wrong_size_is_refused_by_name(seed: dmoc.Problem, wrong: str) -> None:
    nlp = Transcription(seed.but(steps=4))
    m, layout = nlp.n_eq + nlp.n_in, kkt_layout(nlp)
    arrays = {name: np.ones(m if name == "y" else nlp.n) for name in ARRAYS}
    prices: dict[str, Any] = {"price": np.ones(m)}
    if wrong in LAYOUT:
        layout = replace(layout, **{wrong: getattr(layout, wrong)[:-1]})
    else:
        (arrays if wrong in arrays else prices)[wrong] = np.ones(1)
    with pytest.raises(ValueError, match=f"^{wrong}: expected"):
        interior_point(
            nlp.program, layout, *arrays.values(), **prices, optimality=1e-6, demanded=1e-6,
            violation=1e-6, least_cost=1.0, infeasible=1e-6, mu=1e-2, warm=False, iterations=1,
            seconds=1.0, report=lambda *_: None, every=True,
        )  # fmt: skip


@pytest.mark.parametrize("wrong", ["size", "mu", "hurried", "x", "y", "status", "turn", "stop"])
def test_a_wrong_size_of_several_starts_is_refused_by_name(seed: dmoc.Problem, wrong: str) -> None:
    nlp = Transcription(seed.but(steps=4))
    counted = ("hurried", "status", "iterations", "turn", "stop")
    row, m = np.ones((2, nlp.n)), nlp.n_eq + nlp.n_in
    arrays = dict.fromkeys(ARRAYS, row) | {
        "stretch": row[0],
        "mu": np.ones(2),
        "y": np.ones((2, m)),
    }
    arrays |= {name: np.zeros(2 if name in counted[:3] else 1, np.intc) for name in counted}
    arrays[wrong] = arrays[wrong][..., :0].copy()
    with pytest.raises(ValueError, match=f"^{wrong}: expected"):
        interior_points(
            nlp.program, kkt_layout(nlp), **arrays, optimality=1e-6, demanded=1e-6, violation=1e-6,
            least_cost=1.0, infeasible=1e-6, most=1, seconds=1.0,
        )  # fmt: skip


def test_a_matrix_of_wrong_size_is_refused() -> None:
    first, start, row = (np.array(a, dtype=np.int32) for a in ([0, 1, 2], [0, 1, 2], [0, 1]))
    for rows, values, right in ((row[:1], 2, 2), (row, 1, 2), (row, 2, 3)):
        with pytest.raises(ValueError, match="expected 2"):
            K = Factorisation(first, start, rows)
            K.factor(np.ones(values))
            K.solve(np.ones(right))


def test_a_wrong_pattern_is_refused() -> None:
    """Of one unknown and one row in it."""

    def ints(*values: int) -> np.ndarray:
        return np.array(values, dtype=np.int32)

    right = {
        "place": ints(0, 1), "hess_start": ints(0, 1), "hess_column": ints(0),
        "jac_start": ints(0, 1), "jac_column": ints(0),
    }  # fmt: skip
    assert list(kkt_pattern(size=2, **right)["row"]) == [0, 0, 1]
    for name, wrong in (
        ("place", ints(0)), ("place", ints(0, 2)), ("hess_column", ints(1)),
        ("jac_column", ints(-1)), ("jac_column", ints(0, 0)), ("hess_start", ints(0, 2)),
    ):  # fmt: skip
        with pytest.raises(ValueError, match="expected"):
            kkt_pattern(size=2, **{**right, name: wrong})


WIDE = """#include "dmoc_kernel.h"
static dmoc_kernel *const none = 0;
static const dmoc_array array[40];
static const dmoc_entry entry[] = {{"wide", none, %d, %d, array}};
const dmoc_table wide_kernels = {"wide", "none", 1, entry};
"""


@pytest.mark.parametrize(
    ("inputs", "outputs", "refused"), [(16, 16, False), (17, 1, True), (1, 17, True)]
)
def test_a_kernel_has_no_more_arrays_than_there_is_room_for(
    tmp_path: Path, inputs: int, outputs: int, refused: bool
) -> None:
    (tmp_path / "wide.c").write_text(WIDE % (inputs, outputs), encoding="utf-8")
    command = ["gcc", "-shared", "-fPIC", "-I", str(ROOT / "codegen"), "wide.c", "-o", "wide.so"]
    subprocess.run(command, cwd=tmp_path, check=True)
    library = Library(tmp_path / "wide.so", "wide")
    if not refused:
        assert list(library.functions()) == ["wide"]
        return
    with pytest.raises(ValueError, match="wide: more than 16 inputs or outputs"):
        library.functions()
