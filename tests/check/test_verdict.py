"""What is told of ends and paths just beyond their limits, and what is measured of a hit."""

from __future__ import annotations

from math import nan

import motions
import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.check.path_limits import Excess
from dmoc.check.verdict import PASSING, broken, exceeded, lost_by
from dmoc.codegen.kernels import Kernels
from dmoc.motion.trajectory import Trajectory

T = dynamicsymbols._t


def test_a_path_constraint_may_be_exceeded_by_half_a_percent() -> None:
    within, beyond = (Excess(c, c, "speed", 1.0) for c in (0.00495, 0.00505))
    assert broken([within]) == []
    assert broken([within, beyond]) == [beyond.text]


def test_the_end_of_an_open_loop_run_may_be_off_by_a_quarter() -> None:
    assert lost_by((), (), 0.249) == []
    (sentence,) = lost_by((), (), 0.251)
    assert sentence == "terminal error 0.251 exceeds 0.25"


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


@pytest.mark.slow
def test_energy_that_a_hit_makes_is_measured(square: Kernels) -> None:
    """(1.1^2 - 1) / 2 of a largest kinetic energy of (1 + 1.1^2) / 2."""
    assert dmoc.verify(flight(square), square).passed
    check = dmoc.verify(flight(square, along=1.1), square)
    assert check.energy_error == pytest.approx(0.21 / 2.21, rel=1e-9)
    assert not check.passed and "energy error 0.095" in check.message


@pytest.mark.slow
def test_an_impulse_that_is_not_the_planned_one_is_measured(square: Kernels) -> None:
    """2.2 N s of a hit that takes 2 N s; the rate is 1 m/s."""
    check = dmoc.verify(flight(square, impulse=2.2), square)
    assert check.impact_error == pytest.approx(0.2, rel=1e-9)
    assert "error of the law of impact 0.2 exceeds 0.02" in check.message


def test_errors_are_told_in_one_order_whoever_measures_them() -> None:
    measured = {name: 2 * limit for name, limit in PASSING.items()}
    turned = dict(reversed(measured.items()))
    assert exceeded(turned) == exceeded(measured) and len(exceeded(measured)) == len(PASSING)
    assert exceeded(PASSING) == [] and exceeded({"step error": nan}) != []
    with pytest.raises(ValueError, match="wrong name"):
        exceeded({"wrong name": 0.0})
