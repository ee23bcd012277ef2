"""What a motion may miss: measures just inside and just outside of their limits, and each measure
beside its closed form."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import motions
import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.simulation.flow import PLACES, Contact
from dmoc.simulation.path_limits import Excess
from dmoc.simulation.runs import compare
from dmoc.simulation.verdict import broken, exceeded, lost_by
from dmoc.trajectory import Trajectory

T = dynamicsymbols._t
# What docs/verdicts.md says that a motion may miss.
LIMITS = {
    "step error": 0.01,
    "segment error": 0.01,
    "energy error": 0.02,
    "penetration": 0.002,
    "excess of a limit": 0.002,
    "excess of an input": 1e-6,
    "error of the law of impact": 0.02,
    "error of the law of impact relative to its own rates": 0.05,
    "error of a contact force": 0.05,
}


@pytest.mark.parametrize("name", LIMITS)
def test_a_measure_counts_above_its_limit(name: str) -> None:
    assert exceeded({name: 0.99 * LIMITS[name]}) == []
    (sentence,) = exceeded({name: 1.01 * LIMITS[name]})
    assert sentence.startswith(name)
    assert exceeded({name: np.nan}) != []


def test_a_path_constraint_may_be_exceeded_by_half_a_percent() -> None:
    within, beyond = (Excess(c, c, "speed", 1.0) for c in (0.00495, 0.00505))
    assert broken([within]) == []
    assert broken([within, beyond]) == [beyond.text]


def test_the_end_of_an_open_loop_run_may_be_off_by_a_quarter() -> None:
    assert lost_by((), (), 0.249) == []
    (sentence,) = lost_by((), (), 0.251)
    assert sentence == "terminal error 0.251 exceeds 0.25"


@pytest.mark.parametrize(("late", "met"), [(0.049, True), (0.051, False), (-0.051, False)])
def test_a_contact_is_the_planned_one_within_a_twentieth_of_the_time(
    late: float, met: bool
) -> None:
    """In a motion of 2 s."""
    planned = SimpleNamespace(surface="wall", time=1.0, grazes=False)
    motion: Any = SimpleNamespace(
        sizes=SimpleNamespace(time=2.0), trajectory=SimpleNamespace(collisions=[planned])
    )
    missed, extra = compare(motion, [Contact("wall", 1.0 + 2 * late, 1.0)])
    assert (not missed and not extra) is met


# Measures -----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def square() -> Kernels:
    """A free unit mass in the plane, and a wall that it hits."""
    x, y = q = dynamicsymbols("x y")
    wall = sp.Symbol("wall")
    return dmoc.build(
        dmoc.MechanicalSystem(
            "square", q, (x.diff(T) ** 2 + y.diff(T) ** 2) / 2, {wall: 1.0},
            surfaces={"wall": x <= wall},
        )
    )  # fmt: skip


def flight(kernels: Kernels, along: float = 1.0, impulse: float = 2.0) -> Trajectory:
    """With (1, 1) m/s to the wall in 1 s, and back with (-1, along)."""

    def before(t: np.ndarray) -> np.ndarray:
        return motions.columns(t, t, 1, 1)

    def after(t: np.ndarray) -> np.ndarray:
        return motions.columns(2 - t, 1 + along * (t - 1), -1, along)

    def idle(t: np.ndarray) -> np.ndarray:
        return np.zeros((len(t), 0))

    pieces = [motions.Piece(1.0, before, idle), motions.Piece(2.0, after, idle)]
    hit = {"surface": "wall", "impulse": impulse}
    return motions.trajectory(kernels, pieces, [hit], 20, {"wall": 1.0})


def test_energy_that_a_hit_makes_is_measured(square: Kernels) -> None:
    """(1.1^2 - 1) / 2 of a largest kinetic energy of (1 + 1.1^2) / 2."""
    assert dmoc.verify(flight(square), square).passed
    check = dmoc.verify(flight(square, along=1.1), square)
    assert check.energy_error == pytest.approx(0.21 / 2.21, rel=1e-9)
    assert not check.passed and "energy error 0.095" in check.message


def test_an_impulse_that_is_not_the_planned_one_is_measured(square: Kernels) -> None:
    """2.2 N s of a hit that takes 2 N s; the rate is 1 m/s."""
    check = dmoc.verify(flight(square, impulse=2.2), square)
    assert check.impact_error == pytest.approx(0.2, rel=1e-9)
    assert "error of the law of impact 0.2 exceeds 0.02" in check.message


@pytest.mark.parametrize(("off", "seen"), [(1e-5, True), (1e-7, False)])
def test_a_collision_beside_its_surface_is_told(square: Kernels, off: float, seen: bool) -> None:
    """By more than a millionth of how far the motion moves the gap, 1 m."""
    check = dmoc.verify(replace(flight(square), parameters={"wall": 1.0 + off}), square)
    assert ("the collision with 'wall' is -1e-05 off it" in check.message) is seen


@pytest.mark.parametrize(("excess", "passed"), [(0.0019, True), (0.0021, False)])
def test_a_coordinate_beyond_its_bound_is_seen(
    square: Kernels, excess: float, passed: bool
) -> None:
    """Inside the last step of 5 cm; a range of 2 m of y, of which the share counts."""
    motion, furthest = flight(square), 2 - 0.05 * (1 - PLACES[-2])
    bounds = np.array([[-np.inf, np.inf], [0.0, furthest - 2 * excess]])
    check = dmoc.verify(replace(motion, coordinate_bounds=bounds), square)
    assert check.limit_excess == pytest.approx(excess, rel=1e-6)
    assert check.passed is passed, check.message
