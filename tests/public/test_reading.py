"""Every argument is read before any work begins: whatever the problem, nothing is solved, simulated
or explored for a call that is refused."""

from __future__ import annotations

import math
from collections.abc import Callable
from decimal import Decimal
from functools import partial
from typing import Any

import pytest
from hit_problems import back
from systems import block_system

import dmoc
from dmoc.base.errors import DmocError, ProblemError, SearchError, SimulationError

WRONG: dict[str, tuple[Any, ...]] = {
    "tolerance": ("a", 0, -1, math.nan, True), "optimality": (None, "a", 0, math.inf),
    "violation": (None, "a", 0, math.inf), "seconds": ("a", -1, 0, math.nan, True, [1]),
    "starts": ("many", 0, 1.5, True), "iterations": ("many", 0, 1.5, None),
    "seed": ("a", -1, 0.5, None), "method": ("newton", 5, ["ipm"]), "form": ("dense", None, 5),
    "verify": ("no", None, 1), "reference": (None, 5), "progress": (5, "print"),
}  # fmt: skip
OF_ALL = {name: WRONG[name] for name in ("method", "seconds", "progress")}


@pytest.fixture(scope="module")
def open_hit() -> dmoc.Problem:
    """A hit with friction that does not say how it goes."""
    return back(sequence=["floor"])


@pytest.fixture
def lazy(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing may be done."""

    def never(*_: object, **__: object) -> None:
        raise AssertionError("work has begun")

    for place in (
        "dmoc.solving.open_hits.explored", "dmoc.solving.mesh.one_mesh.solved_on_mesh",
        "dmoc.solving.open_hits.starts_of", "dmoc.sequences.search._searched",
        "dmoc.check.check.Motion.of",
    ):  # fmt: skip
        monkeypatch.setattr(place, never)


def refused(call: Callable[..., object], error: type[DmocError], wrong: dict[str, Any]) -> None:
    for name, values in wrong.items():
        for value in values:
            with pytest.raises(error) as refusal:
                call(**{name: value})
            sentence = str(refusal.value)
            assert sentence.startswith(name) and sentence.endswith(".") and "\n" not in sentence


@pytest.mark.usefixtures("lazy")
def test_a_hit_that_does_not_say_how_it_goes_reads_its_arguments_first(
    open_hit: dmoc.Problem,
) -> None:
    refused(partial(dmoc.solve, open_hit), ProblemError, WRONG)
    refused(partial(dmoc.solve, open_hit.but(steps=None)), ProblemError, WRONG)


@pytest.mark.usefixtures("lazy")
def test_many_solves_read_what_is_the_same_for_all_first(open_hit: dmoc.Problem) -> None:
    plain = dmoc.Problem(block_system(), start={"x": 0.0}, steps=4, final_time=1.0)  # type: ignore[arg-type]
    rest = {name: values for name, values in WRONG.items() if name != "reference"}
    for problems in ([plain, plain], [open_hit]):
        refused(partial(dmoc.solve_many, problems), ProblemError, rest)
    refused(partial(dmoc.sweep, plain, {"m": [1.0, 2.0]}), ProblemError, rest)
    with pytest.raises(DmocError, match=r"missing\.npz"):
        dmoc.solve_many([plain], guess="missing.npz")


@pytest.mark.usefixtures("lazy")
def test_a_check_and_a_search_read_their_limits_first(open_hit: dmoc.Problem) -> None:
    search = partial(dmoc.search, open_hit.but(sequence=[]), 0)
    refused(search, SearchError, {**OF_ALL, "node_seconds": WRONG["seconds"]})


def test_the_limit_of_a_check_is_read(open_hit: dmoc.Problem) -> None:
    solution = dmoc.solve(open_hit.but(sequence=["floor:slip+:stick:late"]), starts=1)
    check = partial(dmoc.verify, solution.trajectory, open_hit.kernels)
    refused(check, SimulationError, {"seconds": WRONG["seconds"]})
    refused(solution.verify, SimulationError, {"seconds": WRONG["seconds"]})
    assert check(seconds=60).passed


def test_numbers_of_other_kinds_are_limits_of_a_search(open_hit: dmoc.Problem) -> None:
    problem = dmoc.Problem(block_system(), start={"x": 0.0}, steps=4, final_time=1.0)  # type: ignore[arg-type]
    result = dmoc.search(problem, 0, seconds=Decimal("60"), node_seconds=Decimal("30"))  # type: ignore[arg-type]
    assert result.complete and [n.verdict for n in result.nodes] == ["optimal"]


@pytest.mark.slow
def test_all_ways_through_a_hit_share_the_iterations(open_hit: dmoc.Problem) -> None:
    """No way leads to a motion that comes back faster than the hit allows."""
    impossible = open_hit.but(goal={"y": 0.5, "y_dot": 9.0}, final_time=(0.2, 1))
    for limit in (1, 30):
        numbers: list[int] = []
        solution = dmoc.solve(
            impossible, starts=1, iterations=limit, progress=lambda i, n=numbers: n.append(i.number)
        )
        assert not solution.minimum
        assert len(numbers) <= limit + 10 and solution.iterations <= limit + 10, limit


def test_two_phases_must_fit_into_the_final_time() -> None:
    problem = dmoc.Problem(block_system(), start={"x": 0.0}, steps=4, final_time=1.0)
    with pytest.raises(SearchError, match="two phases of it do not fit"):
        dmoc.search(problem, 1, shortest_phase=0.51)
