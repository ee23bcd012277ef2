"""Grazes of hits with friction, and what a collision would cost instead."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.motion.friction import STICK
from dmoc.motion.impact_laws import POISSON
from dmoc.program.blocks import NOWHERE
from dmoc.program.hit_stages import END, STOP
from dmoc.program.scaling import scale_of
from dmoc.solvers.outcome import Options
from dmoc.solving import grazing
from dmoc.solving.grazing import _closing, _in_stages, _turning, pays, slopes
from dmoc.solving.methods import METHODS
from dmoc.solving.programs import Programs
from dmoc.solving.starts import starts_of

X, Y, U, V = dynamicsymbols("x y u v")
MU, M_XY = sp.symbols("mu m_xy")
MINIMISE = METHODS["ipm"].minimise()
SHARP = Options(1e-10, 1e-12)


@cache
def problem() -> dmoc.Problem:
    """A body whose masses couple the normal and the tangent goes down to a floor and up again."""
    x, y = X.diff(), Y.diff()
    system = dmoc.MechanicalSystem(
        "grazed_floor", [X, Y], (x**2 + 2 * M_XY * x * y + y**2) / 2, {MU: 0.2, M_XY: 0.1},
        inputs=[U, V], forces={X: U, Y: V}, cost=(U**2 + V**2) / 2,
        surfaces={"floor": Y >= 0}, tangents={"floor": X}, friction={"floor": MU},
    )  # fmt: skip
    start = {"x": 0, "y": 1, "x_dot": 1}
    goal = {"x": 1, "y": 1, "x_dot": 1, "y_dot": 0}
    return dmoc.Problem(
        dmoc.build(system), start=start, goal=goal, sequence=["floor:slip+"], steps=20,
        final_time=1, restitution=0.5,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("found", "pays_off"),
    [
        ([[0.0]], False), ([[1.0]], False), ([[-1.0]], True), ([[]], False),
        ([[1.0, -1.0]], True), ([[1.0], [0.5]], False), ([[1.0], [-1.0]], True),
        ([[-1.0], [1.0]], True), ([[-1e-5]], True), ([[-5e-6]], False), ([[5e-6]], False),
    ],
)  # fmt: skip
def test_a_collision_pays_where_a_slope_falls(
    found: list[list[float]], pays_off: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By more than a millionth of the cost of 7; some grazes are among other events."""
    events = np.flatnonzero([False, True, False, True])[: len(found)]
    law = SimpleNamespace(grazing=np.isin(np.arange(5), events))
    nlp: Any = SimpleNamespace(laws=SimpleNamespace(impact=law))
    outcome: Any = SimpleNamespace(x=None)
    slopes_of = dict(zip(events.tolist(), found, strict=True))
    monkeypatch.setattr(grazing, "cost_size", lambda *_: 7.0)
    monkeypatch.setattr(grazing, "slopes", lambda _, __, i: slopes_of[i])
    assert pays(nlp, outcome) is pays_off


@pytest.mark.parametrize(
    ("friction", "closing", "turning"),
    [
        (1, 2.0 - 0.2 * 0.5, 0.5 - 0.2 * 3.0),
        (-1, 2.0 + 0.2 * 0.5, 0.5 + 0.2 * 3.0),
        (0, 2.0 - 0.5**2 / 3.0, None),  # the inertia of what does not slide
    ],
)
def test_an_impulse_changes_both_rates(
    friction: int, closing: float, turning: float | None
) -> None:
    """A normal impulse with the friction of 0.2 of it against the sliding."""
    A = np.array([[2.0, 0.5], [0.5, 3.0]])
    assert _closing(A, 0.2, friction) == pytest.approx(closing)
    assert turning is None or _turning(A, 0.2, friction) == pytest.approx(turning)


@pytest.mark.parametrize(
    ("way", "coupling", "late", "shares"),
    [
        # Slides back where A_nt < -mu A_tt = -0.9, on where it is more; stops where it is less
        # than 0.9; each slope with the normal inertia of the sliding that closes the impact.
        ((1, -1), -1.2, False, [(0, 1.64), (1, 2.36)]), ((1, -1), -0.5, False, []),
        ((1, -1), 1.2, False, []), ((1, -1), -1.2, True, [(1, 2.36), (1.5, 2.36)]),
        ((-1, 1), 1.2, False, [(0, 1.64), (1, 2.36)]), ((-1, 1), 0.5, False, []),
        ((-1, 1), -1.2, False, []), ((-1, 1), 1.2, True, [(1, 2.36), (1.5, 2.36)]),
        ((1, STICK), 0.6, False, [(0, 1.88), (1, 1.82)]), ((1, STICK), 1.2, False, []),
        ((1, STICK), 0.6, True, [(1, 1.82), (1.5, 1.82)]), ((1, STICK), -1.2, False, []),
    ],
)  # fmt: skip
def test_a_hit_that_stops_sliding_costs_what_its_ways_cost(
    way: tuple[int, int], coupling: float, late: bool, shares: list[tuple[float, float]],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """Slopes 7 by the impulse of compression and 5 by that at which sliding stops, in rates of 2
    m/s, e = 0.5."""
    A = np.array([[2.0, coupling], [coupling, 3.0]])
    monkeypatch.setattr(grazing, "response", lambda *_: A)
    monkeypatch.setattr(grazing, "friction_of", lambda *_: 0.3)
    P_h = np.array([[0, 1]])
    nlp: Any = SimpleNamespace(
        problem=None, scale=SimpleNamespace(rate=np.array([2.0])),
        layout=SimpleNamespace(hit=SimpleNamespace(P_h=P_h)),
        laws=SimpleNamespace(
            hit=SimpleNamespace(restitution=SimpleNamespace(index=np.array([NOWHERE])))
        ),
    )  # fmt: skip
    passage: Any = SimpleNamespace(
        friction=way, surface=0, moments=(STOP, END), event=0, late=late, law=POISSON
    )
    by_unknown, outcome = np.zeros(2), SimpleNamespace()
    by_unknown[P_h[0, STOP]] = 5.0
    unused: Any = outcome
    found = _in_stages(nlp, unused, passage, (7.0 / 1.5, by_unknown), (np.zeros(2), 0.0, 0.5))
    assert found == pytest.approx([(7.0 + share * 5.0) * 2.0 / size for share, size in shares])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("course", "mu", "coupling"),
    [
        ("slip+", 0.2, 0.1),
        ("slip+", 0.5, -0.3),
        ("slip-", 0.5, -0.3),  # would rather go the other way: sigma = 0, and slower afterwards
        ("slip-", 0.2, 0.3),  # the same, and faster afterwards
        ("stick", 0.5, 0.3),
        ("slip+:stick", 0.5, 0.3),
        ("slip+:stick", 0.5, -0.3),
        ("slip+:stick:late", 0.5, 0.3),
    ],
)
def test_the_slope_of_a_graze_is_that_of_hits_at_small_rates(
    course: str, mu: float, coupling: float
) -> None:
    hit = problem().but(sequence=[f"floor:{course}"], parameters={"mu": mu, "m_xy": coupling})
    point = starts_of(hit, None).points[0]
    programs = Programs(hit, scale_of(hit, point))
    grazing = programs.program(grazing=[0])
    graze = MINIMISE(grazing, grazing.scaled(point), SHARP, None)
    assert graze.status == "solved"
    # Regular: an equation that inequalities say too would have multipliers without limit.
    assert max(abs(graze.duals.y).max(), abs(graze.duals.w).max(), abs(graze.duals.z).max()) < 2e3
    slope, rate = min(slopes(grazing, graze, 0)), 1e-4

    real = Programs(hit, programs.scale).program()
    down = real.layout.impact.v_a[0, 1]
    real.lower[down] = real.upper[down] = -rate / real.sizes[down]
    struck = MINIMISE(real, graze.x, SHARP, None)
    assert struck.status == "solved"
    by_difference = (real.cost(struck.x) - grazing.cost(graze.x)) / rate
    assert slope / programs.scale.rate[0] == pytest.approx(by_difference, rel=5e-4)


def test_a_way_that_no_hit_goes_pays_nothing() -> None:
    """Sticking needs |A_nt| <= mu A_tt, here 0.3 <= 0.2."""
    hit = problem().but(sequence=["floor:slip+:stick"], parameters={"mu": 0.2, "m_xy": 0.3})
    point = starts_of(hit, None).points[0]
    grazing = Programs(hit, scale_of(hit, point)).program(grazing=[0])
    graze = MINIMISE(grazing, grazing.scaled(point), SHARP, None)
    assert graze.status == "solved" and not slopes(grazing, graze, 0) and not pays(grazing, graze)


def test_what_a_constraint_keeps_from_moving_grazes_alone() -> None:
    """x = sin t touches x = 1 with a rate of zero, and no impulse changes it; the cost of y is that
    of the least u^2/2 from rest to rest, 6 / T^3."""
    system = dmoc.MechanicalSystem(
        "driven_graze", [X, Y], (X.diff() ** 2 + Y.diff() ** 2) / 2, {}, inputs=[U],
        forces={Y: U}, cost=U**2 / 2, surfaces={"wall": X <= 1},
        constraints={"drive": X - sp.sin(dynamicsymbols._t)},
    )  # fmt: skip
    start, goal = {"x": 0, "y": 0, "x_dot": 1, "y_dot": 0}, {"y": 1, "y_dot": 0}
    stated = dmoc.Problem(
        dmoc.build(system), start=start, goal=goal, sequence=["wall"], steps=20, final_time=np.pi,
        restitution=0.5,
    )  # fmt: skip
    solution = dmoc.solve(stated, starts=1)
    assert solution.status == "grazes"
    assert solution.cost == pytest.approx(6 / np.pi**3, rel=1e-2)
