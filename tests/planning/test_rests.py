"""What a plan of the rest is made of: goals, times, the events that a state shows to be over."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from sympy.physics.mechanics import dynamicsymbols
from systems import unit_mass

import dmoc
from dmoc.base.errors import ProblemError
from dmoc.mechanics.contacts import Contacts
from dmoc.planning.measured_state import arrival, is_over
from dmoc.planning.rest import _check, check_recedes, planned

U = dynamicsymbols("u")


@pytest.mark.parametrize("name", ["x", "x_dot"])
@pytest.mark.parametrize(
    ("difference", "goal"),
    [
        ((0.1, 0.4), (0.6, 0.9)),
        (0.25, 0.75),
        ((None, 0.4), (None, 0.9)),
        ((0.1, None), (0.6, None)),
    ],
)
def test_what_is_periodic_ends_by_its_difference_from_the_start(
    name: str, difference: Any, goal: Any
) -> None:
    system = unit_mass("planned_stride", cost=U**2 / 2)
    start = {"x": 0.5, "x_dot": 0.5}
    problem = dmoc.Problem(
        system, start, {}, steps=4, final_time=1.0, periodic={name: (name, difference)}
    )
    solution = dmoc.solve(problem, "ipm", starts=1, verify=False)
    at = planned(problem, solution, 0.0).goal[name]
    expected = goal if isinstance(goal, float) else [np.nan if g is None else g for g in goal]
    assert np.array(at, dtype=float) == pytest.approx(expected, nan_ok=True)


@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        ({"explicit_time": True}, "depends on the time"),
        ({"totals_of": ["work"]}, "look at the whole"),
        ({"peaks_of": [(0, True)]}, "look at the whole"),
        ({"has_objective": True}, "look at the whole"),
        ({"compiled": False}, "run on NumPy"),
        ({}, ""),
    ],
)
def test_problems_without_a_rest_of_their_kind_are_refused(
    changed: dict[str, Any], reason: str
) -> None:
    facts = {"explicit_time": False, "totals_of": [], "peaks_of": [], "has_objective": False}
    facts |= {"compiled": True, "hit_quantities": {}} | changed
    problem: Any = SimpleNamespace(
        model=SimpleNamespace(**facts), models=SimpleNamespace(change=False),
        explicit_time=facts["explicit_time"],
        kernels=SimpleNamespace(
            name="one", compiled=facts["compiled"],
            manifest=SimpleNamespace(hit_quantities=facts["hit_quantities"]),
        ),
    )  # fmt: skip
    if reason:
        with pytest.raises(ProblemError, match=reason):
            _check(problem)
    else:
        _check(problem)


@pytest.mark.parametrize(
    ("durations", "final_time", "refused"),
    [
        ([(0.5, 1.4), (0.3, 0.9), (0.2, 0.6)], (1.6, 9.0), True),  # 1.5 s after the first
        ([(0.5, 1.4), (0.3, 0.9), (0.2, 0.6)], (1.4, 9.0), False),
        ([(0.5, 1.4), (0.3, 0.9), (0.2, np.inf)], (1.6, 9.0), False),
        ([(0.5, 9.0), (0.1, 0.2)], (0.3, 9.0), True),
        ([(0.5, 1.4)], (1.6, 9.0), False),  # one phase
    ],
)
def test_later_phases_last_long_enough_for_a_horizon_that_recedes(
    durations: list[tuple[float, float]], final_time: tuple[float, float], refused: bool
) -> None:
    problem: Any = SimpleNamespace(
        duration_bounds=np.array(durations), final_time_bounds=final_time, phases=len(durations)
    )
    if not refused:
        check_recedes(problem)
        return
    with pytest.raises(ProblemError, match=f"the final time is {final_time[0]} s at least"):
        check_recedes(problem)


def before(gaps: tuple[float, ...], rates: tuple[float, ...]) -> Any:
    """A problem whose state has some gaps to three surfaces, and their rates."""
    model = SimpleNamespace(
        contacts=Contacts(("left", "floor", "right", "hand"), (), grips=(("hand", ("hand",)),)),
        gaps=lambda q: np.array(gaps), gap_rates=lambda q, v: np.array(rates),
    )  # fmt: skip
    return SimpleNamespace(model=model)


def event(surface: str = "", lands: tuple[str, ...] = (), rates: tuple[float, ...] = (0, 0)) -> Any:
    return SimpleNamespace(
        surface=surface, lands=lands, rate_before=rates[0], rate_after=rates[1], switch="", off=()
    )


STATE = np.zeros(1), np.zeros(1)


@pytest.mark.parametrize(
    ("what", "seconds"),
    [
        (event("left"), 0.1), (event("floor"), 1.0), (event("right"), np.inf),
        (event("", ("floor", "left")), 1.0), (event("", ("left", "floor")), 0.1),
        (event("floor", ("left",)), 1.0), (event(), np.inf), (None, np.inf),
    ],
)  # fmt: skip
def test_a_state_arrives_at_the_first_surface_of_an_event(what: Any, seconds: float) -> None:
    """0.2 m away with 2 m/s, 1 m with 1 m/s, and one that is left."""
    problem = before((-0.2, -1.0, -1.0), (2.0, 1.0, -1.0))
    assert arrival(problem, what, STATE) == pytest.approx(seconds)
    gripped = before((0, 0, 0, 0.3), (0, 0, 0, -0.5))
    assert arrival(gripped, event("hand"), STATE) == pytest.approx(0.6)
    behind = before((0.1, 0.1, 0.1), (1.0, 1.0, 1.0))
    assert arrival(behind, event("left"), STATE) == 0.0


@pytest.mark.parametrize(
    ("gap", "rate", "over"),
    [
        (-0.39, -1.0, True), (-0.41, -1.0, False),  # as far as 2 m/s go in two steps of 0.1 s
        (-0.1, 0.49, True), (-0.1, 0.51, False),  # between 2 m/s before and -1 m/s after
    ],
)  # fmt: skip
@pytest.mark.parametrize("j", [0, 1, 2])
def test_a_hit_is_over_where_its_surface_is_left_and_near(
    j: int, gap: float, rate: float, over: bool
) -> None:
    gaps, rates = [-0.1 if over else -9.0] * 3, [-1.0 if over else 9.0] * 3
    gaps[j], rates[j] = gap, rate
    others = [-9.0 if over else -0.1 if k != j else gap for k in range(3)]
    others[j] = gap
    problem = before(tuple(others), tuple(rates))
    name = ("left", "floor", "right")[j]
    for what in (event(name, (), (2.0, -1.0)), event("", (name, "floor"), (2.0, -1.0))):
        assert is_over(problem, what, STATE, 0.0, 1.0, 0.1) is over


def test_what_leaves_or_slides_otherwise_is_over_at_its_time() -> None:
    problem = before((0.0,) * 3, (0.0,) * 3)
    for late, over in ((-1e-9, False), (0.0, True), (1e-9, True)):
        assert is_over(problem, event(), STATE, late, 1.0, 0.1) is over


def test_a_plan_has_its_phases_begin_and_end_at_times_of_the_motion() -> None:
    """Of a plan that begins later, too; a hit in the middle of 2 s, by symmetry."""
    x = dynamicsymbols("x")
    system = unit_mass("planned_span", cost=U**2 / 2, surfaces={"wall": x <= 1})
    problem = dmoc.Problem(
        system, {"x": 0.0, "x_dot": 0.0}, {"x": 0.0, "x_dot": 0.0}, sequence=["wall"], steps=8,
        final_time=2.0, restitution=1.0,
    )  # fmt: skip
    planner = dmoc.Planner(problem, dmoc.solve(problem, "ipm", starts=1, verify=False))
    assert planner.span(0) == pytest.approx((0.0, 1.0), abs=1e-6)
    assert planner.span(1) == pytest.approx((1.0, 2.0), abs=1e-6)
    there = planner.plan.at(0.25)
    assert planner.replan(0.25, (there.q, there.v)).new
    assert planner.span(0) == pytest.approx((0.25, 1.0), abs=0.02)
    assert planner.span(1) == pytest.approx((1.0, 2.0), abs=0.02)
