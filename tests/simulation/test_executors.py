"""The check of a motion with kernels in C and on NumPy, in many threads, and in little time."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields

import block_and_wall
import numpy as np
import pytest

import dmoc
from dmoc.check.checked_motion import OutOfTimeError


def same(one: dmoc.Verification, other: dmoc.Verification, error: float) -> None:
    for field in fields(one):
        a, b = getattr(one, field.name), getattr(other, field.name)
        if field.name == "contacts":
            assert [c.surface for c in a] == [c.surface for c in b]
            a, b = (np.array([(c.time, c.jump) for c in contacts]) for contacts in (a, b))
        if isinstance(a, float | np.ndarray):
            assert a == pytest.approx(b, rel=error, abs=error)
        elif field.name != "message":  # it shows numbers that are rounding errors
            assert a == b


@pytest.mark.parametrize("e", [0.8, 0.0])
def test_kernels_on_numpy_give_the_same_check(e: float) -> None:
    solution = dmoc.solve(block_and_wall.problem(e, 12), "ipm", verify=False)
    on_numpy = dmoc.build(block_and_wall.system(), backend="numpy")
    same(solution.verify(on_numpy), solution.verify(), 1e-9)


@pytest.mark.slow
def test_a_check_in_many_threads_is_the_check_in_one(solution: dmoc.Solution) -> None:
    alone = solution.verify()
    with ThreadPoolExecutor(4) as pool:
        for check in pool.map(lambda _: solution.verify(), range(40)):
            assert check.message == alone.message
            same(check, alone, 0.0)


def test_a_check_hears_of_its_time_limit(solution: dmoc.Solution, reads: list[int]) -> None:
    with pytest.raises(OutOfTimeError, match="the time for the check was used up"):
        solution.verify(seconds=0.5)
    assert reads[0] <= 3
