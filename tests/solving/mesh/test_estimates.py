"""The error of a mesh from changes whose law is known, and what ends a refinement."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dmoc.program.active_constraints import ActiveBound
from dmoc.program.bound_kinds import BoundKind
from dmoc.solvers.outcome import Status
from dmoc.solving import unbounded_cost
from dmoc.solving.mesh import refinement
from dmoc.solving.mesh.error import UNKNOWN, Errors, changes, estimates
from dmoc.solving.mesh.refinement import History, Level
from dmoc.solving.multistart.minima import Basin

LIMITED = (ActiveBound(BoundKind.INPUT, "u", "<=", 1.0, 3),)


def meshed(n: int, order: float, error: float = 1e-3, **fields: Any) -> Any:
    """A solution with n steps, whose cost is wrong by error/n^order."""
    stated = {
        "phases": (SimpleNamespace(steps=n, duration=2.0, q=np.linspace(0, 1, n + 1)[:, None]),),
        "cost": 1 + error / n**order, "final_time": 2.0, "scale": {"cost": 1.0, "x": 1.0},
        "trajectory": SimpleNamespace(coordinates=("x",)), "active_bounds": (), "design": {},
        "duality_gap": 0.0, "minimum": True,
    }  # fmt: skip
    return SimpleNamespace(**(stated | fields))


@pytest.mark.parametrize("order", [1.0, 1.5, 2.0, 4.0])
def test_three_meshes_show_their_order(order: float) -> None:
    solved = [meshed(n, order) for n in (10, 20, 40)]
    errors = estimates(solved, UNKNOWN, 4)
    assert errors.cost == pytest.approx(1e-3 / 40**order, rel=1e-2)
    assert errors.motion == 0


def test_two_meshes_show_none_and_half_of_it_is_assumed() -> None:
    change = 1e-3 * (1 / 100 - 1 / 400)
    errors = estimates([meshed(n, 2) for n in (10, 20)], UNKNOWN, 4)
    assert errors.cost == pytest.approx(change / (2**2 - 1), rel=1e-2)
    assert estimates([meshed(10, 2)], UNKNOWN, 4) == UNKNOWN


def test_where_limits_hold_an_order_of_two_counts_at_most() -> None:
    solved = [meshed(n, 4, active_bounds=LIMITED) for n in (10, 20, 40)]
    change = 1e-3 * (1 / 20**4 - 1 / 40**4)
    assert estimates(solved, UNKNOWN, 4).cost == pytest.approx(change / 3, rel=1e-2)
    assert estimates(solved, Errors(1.0, 1.0), 4).cost == pytest.approx(0.25)


def test_no_estimate_is_below_what_the_barrier_has_left() -> None:
    solved = [meshed(n, 4, duality_gap=1e-3) for n in (10, 20, 40)]
    assert estimates(solved, UNKNOWN, 4).cost == pytest.approx(1e-3, rel=1e-5)


@pytest.mark.parametrize(("gap", "solves"), [(0.2e-4, 1), (0.3e-4, 2)])
def test_a_barrier_that_takes_a_quarter_of_the_tolerance_is_made_smaller(
    gap: float, solves: int
) -> None:
    """Of 1e-4."""
    optimalities: list[float | None] = []
    s = SimpleNamespace(
        minimum=True, solved=True, status=Status.SOLVED, optimality=1e-6, max_violation=0.0,
        cost=1.0, duality_gap=gap, scale={"cost": 1.0}, iterations=5, seconds={},
    )  # fmt: skip

    def solve(problem: Any, guess: Any, optimality: float | None) -> Any:
        optimalities.append(optimality)
        return s

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(refinement, "replace", lambda s, **fields: s)
        refinement._solved(None, History(), 1e-4, solve)  # type: ignore[arg-type]
    assert len(optimalities) == solves and optimalities[0] is None
    if solves == 2:
        assert optimalities[1] == pytest.approx(0.25e-4 / gap / 2 * 1e-6)


@pytest.mark.parametrize(("cost", "other"), [(1.09, False), (1.12, True), (0.5, False)])
def test_a_cost_ten_errors_higher_is_that_of_another_minimum(cost: float, other: bool) -> None:
    """An error of 0.01 of a cost of 1; relative to the new cost."""
    before = Level(meshed(10, 2, 0.0), Errors(0.01, 0.01), 1)
    after = meshed(20, 2, cost=cost)
    assert refinement._dearer(History((before,)), after, 1e-6) is other
    assert not refinement._dearer(History(), after, 1e-6)
    assert not refinement._dearer(History((before,)), after, 0.9)


SEEN = "max_segment_defect", "cost_error", "path_excess"


@pytest.mark.parametrize("name", SEEN)
@pytest.mark.parametrize(("seen", "error"), [(None, 1e-3), (1e-4, 1e-3), (3e-3, 3e-3)])
def test_what_the_check_has_seen_counts_beside_the_estimate(
    name: str, seen: float | None, error: float
) -> None:
    check = seen and SimpleNamespace(**(dict.fromkeys(SEEN, 0.0) | {name: seen}))
    level = Level(meshed(10, 2, verification=check), Errors(1e-3, 2e-4), 1)
    assert History().error(level) == error


@pytest.mark.parametrize(
    ("estimates", "seen", "idle"),
    [
        ([4e-3, 2e-3, 1e-3], [9e-3, 9e-3, 9e-3], True),
        ([4e-3, 2e-3, 1e-3], [None, 2e-3, 9e-3], False),  # seen on two meshes alone
        ([4e-3, 2e-3, 1e-3], [9e-3, 9e-3, 2e-3], False),
        ([2e-3, 2e-3, 2e-3], [9e-3, 5e-3, 2e-3], True),
        ([2e-3, 2e-3, 2e-3], [None, None, None], True),
        ([1e-5, 1e-5, 1e-5], [1e-5, 1e-5, 1e-5], False),  # which meets the tolerance
    ],
)
def test_what_exceeds_the_tolerance_is_idle_by_itself(
    estimates: list[float], seen: list[float | None], idle: bool
) -> None:
    """The excess of a path constraint, which is known on some meshes, and the estimates of all."""
    levels = []
    for k, (estimate, excess) in enumerate(zip(estimates, seen, strict=True)):
        check = excess and SimpleNamespace(**(dict.fromkeys(SEEN, 0.0) | {"path_excess": excess}))
        solution = meshed(10 * 2**k, 2, verification=check)
        levels.append(Level(solution, Errors(estimate, 0.0), 1))
    assert History(tuple(levels)).is_idle(1e-4) is idle


def test_errors_that_have_not_become_smaller_for_two_meshes_are_idle() -> None:
    assert not refinement._idle([1.0, 0.5, 0.3, 0.4])
    assert refinement._idle([1.0, 0.5, 0.3, 0.5])
    assert not refinement._idle([1.0, 2.0])


@pytest.mark.parametrize(
    ("cost", "falls", "open_ended", "endless"),
    [
        (1e-6, 0.011, True, True),
        (1e-6, 0.009, True, False),
        (0.9e-2, 0.5, True, True),  # from a share of 1e-2 on residuals are compared with the cost
        (1.1e-2, 0.5, True, False),
        (1.1e-17, 0.5, True, True),
        (0.9e-17, 0.5, True, False),  # what rounding leaves
        (1e-6, 0.5, False, False),
    ],
)
def test_a_small_cost_that_falls_by_a_hundredth_in_twice_the_time_has_no_minimum(
    cost: float, falls: float, open_ended: bool, endless: bool
) -> None:
    def answer(cost: float, time: float) -> Any:
        ends = {"minimum": True, "converged": True, "scale": {"cost": 1.0}}
        return SimpleNamespace(cost=cost, final_time=time, **ends)

    limits = (1.0, np.inf if open_ended else 9.0)
    problem: Any = SimpleNamespace(final_time_bounds=limits, but=lambda final_time: final_time)
    first = answer(cost, 3.0)

    def along(times: Any, guess: Any) -> Any:
        assert times == 6.0 and guess is first
        return answer(cost * (1 - falls), 6.0)

    case: Any = SimpleNamespace(problem=problem, along=along)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(unbounded_cost, "ending", lambda s, status, cause: status)
        patch.setattr(unbounded_cost, "replace", lambda status, **fields: status)
        bounded: Any = unbounded_cost.bounded(first, case)
    assert bounded is (Status.STALLED if endless else first)


def phases(*durations: float, moved: tuple[int, int, float] | None = None) -> Any:
    """Phases of two steps with two coordinates from 0 to 1 and 0 to 10; of one phase one node moved
    in the first."""
    made = []
    for i, duration in enumerate(durations):
        q = np.linspace([0.0, 0.0], [1.0, 10.0], 3)
        if moved and moved[0] == i:
            q[moved[1], 0] += moved[2]
        made.append(SimpleNamespace(steps=2, duration=duration, q=q))
    return tuple(made)


def two(made: Any, **fields: Any) -> Any:
    trajectory = SimpleNamespace(coordinates=("x", "y"))
    total = sum(phase.duration for phase in made)
    return meshed(2, 2, 0.0, phases=made, final_time=total, trajectory=trajectory, **fields)


@pytest.mark.parametrize("durations", [(1.0, 1.02, 1.0), (1.02, 1.0, 1.0), (1.0, 1.0, 1.02)])
def test_the_largest_change_of_a_duration_counts(durations: tuple[float, ...]) -> None:
    errors = changes(two(phases(1.0, 1.0, 1.0)), two(phases(*durations)))
    assert errors.motion == pytest.approx(0.02 / 3.02)


@pytest.mark.parametrize("phase", [0, 1])
@pytest.mark.parametrize("node", [0, 1, 2])
def test_the_largest_change_of_a_place_counts(phase: int, node: int) -> None:
    """Of nodes in common with a mesh twice as fine, in shares of the range of their coordinate."""
    fine = two(phases(1.0, 1.0))
    for part in fine.phases:
        part.steps, part.q = 4, np.linspace([0.0, 0.0], [1.0, 10.0], 5)
    coarse = two(phases(1.0, 1.0, moved=(phase, node, -0.03)))
    assert changes(coarse, fine).motion == pytest.approx(0.03)


@pytest.mark.parametrize("name", ["a", "b", "c"])
def test_the_largest_change_of_a_design_counts_in_its_size(name: str) -> None:
    design, sizes = {"a": 1.0, "b": 2.0, "c": 3.0}, {"cost": 1.0, "a": 2.0, "b": 2.0, "c": 2.0}
    made = phases(1.0)
    coarse = two(made, design=design | {name: design[name] + 0.1}, scale=sizes)
    assert changes(coarse, two(made, design=design, scale=sizes)).motion == pytest.approx(0.05)


def test_minima_of_one_cost_and_other_durations_are_two() -> None:
    attempt: Any = SimpleNamespace(nlp=SimpleNamespace(scale=SimpleNamespace(cost=1.0)))
    one = Basin(attempt, 1.0, np.array([1.0, 1.0]))
    assert one.same(Basin(attempt, 1.0 + 0.9e-5, np.array([1.001, 0.999])))
    assert not one.same(Basin(attempt, 1.0, np.array([1.01, 0.99])))
    assert not one.same(Basin(attempt, 1.0 + 3e-5, np.array([1.0, 1.0])))
    three = Basin(attempt, 1.0, np.array([1.0, 1.0, 2.0]))
    for durations in ([1.0, 2.0, 1.0], [2.0, 1.0, 1.0], [1.0, 1.0, 2.1], [1.1, 1.0, 2.0]):
        assert not three.same(Basin(attempt, 1.0, np.array(durations)))
