"""The compiled program refuses what its C code would trust."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import dmoc
from dmoc.program.arrays import ProgramData
from dmoc.program.assembly import Program, strided
from dmoc.program.transcription import Transcription


@pytest.fixture(scope="module")
def data(seed: dmoc.Problem) -> ProgramData:
    return Transcription(seed.but(steps=4)).program.data


def changed(data: ProgramData, **fields: object) -> ProgramData:
    """The program with another first element of its values."""
    first, *others = data.values.places
    return replace(data, values=replace(data.values, places=(replace(first, **fields), *others)))


Change = Callable[[ProgramData], ProgramData]
WRONG: dict[str, tuple[Change, str]] = {
    "bounds": (lambda d: replace(d, upper=d.upper[:-1]), "bounds of"),
    "units": (lambda d: replace(d, sizes=d.sizes[:-1]), "sizes of"),
    "pattern": (lambda d: replace(d, hessian=(d.hessian[0], d.hessian[1][:-1])), "a pattern of"),
    "linear part": (
        lambda d: replace(d, values=replace(d.values, rows=d.values.rows + len(d.values.constant))),
        "position .* expected 0 to",
    ),
    "argument": (
        lambda d: changed(d, arguments=(d.values.places[0].arguments[0] - 10**6, *_others(d))),
        "position .* expected 0 to",
    ),
    "number of arguments": (lambda d: changed(d, arguments=_others(d)), "expected 8 arguments"),
    "size of an argument": (
        lambda d: changed(d, arguments=(d.values.places[0].arguments[0][:, :1], *_others(d))),
        r"q_k of shape \(8, 1\), expected \(8, 2\)",
    ),
    "factors": (
        lambda d: replace(d, values=replace(d.values, factors=d.values.factors[1:])),
        "expected .* numbers, got",
    ),
    "slots": (
        lambda d: changed(d, slots=tuple(s + 10**6 for s in d.values.places[0].slots)),
        "position .* expected -1 to",
    ),
}


def _others(data: ProgramData) -> tuple[np.ndarray, ...]:
    return data.values.places[0].arguments[1:]


@pytest.mark.parametrize("what", WRONG)
def test_wrong_arrays_are_refused(seed: dmoc.Problem, data: ProgramData, what: str) -> None:
    change, message = WRONG[what]
    with pytest.raises(ValueError, match=message):
        Program(seed.kernels, change(data))


def test_an_unknown_kernel_is_refused(seed: dmoc.Problem, data: ProgramData) -> None:
    with pytest.raises(KeyError, match="no_such"):
        Program(seed.kernels, changed(data, kernel="no_such"))


def test_rows_that_are_evenly_apart_are_found() -> None:
    at = 3 + 5 * np.arange(4)[:, None] + np.arange(2)
    assert strided(at) == (3, 5)
    assert strided(at[:1]) == (3, 0)
    assert strided(at[:, ::-1]) is None and strided(at[[0, 1, 3]]) is None
    assert strided(np.zeros((4, 0), dtype=np.intp)) == (0, 0)
