"""What small errors of one sign make of a phase: it is followed from its first node to its last."""

from __future__ import annotations

import motions
import numpy as np
import pytest
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.motion.trajectory import Trajectory

T = dynamicsymbols._t


def of_one(spring: float) -> Kernels:
    """A unit mass on a line with the force ``spring`` x."""
    (x,) = q = [dynamicsymbols("x")]
    name = "line" if spring == 0 else "saddle"
    lagrangian = (x.diff(T) ** 2 + spring * x**2) / 2
    return dmoc.build(dmoc.MechanicalSystem(name, q, lagrangian))


@pytest.fixture(scope="module")
def line() -> Kernels:
    return of_one(0.0)


def moving(kernels: Kernels, late: float) -> Trajectory:
    """With 1 m/s over 1 m, in a time that is longer by a share."""

    piece = motions.Piece(1 + late, lambda t: (t / (1 + late), 1))
    return motions.trajectory(kernels, [piece], [], 40)


@pytest.mark.parametrize("late", [0.001, 0.02, 0.04, 0.08])
def test_a_phase_that_takes_too_long_is_off_by_that_at_its_end(line: Kernels, late: float) -> None:
    check = dmoc.verify(moving(line, late), line)
    assert check.max_segment_defect == pytest.approx(late / 10, rel=1e-6)
    assert check.phase_error == pytest.approx(late, rel=1e-6)
    assert check.passed == (late < 0.03)
    assert ("phase error" in check.message) == (late > 0.03)


@pytest.mark.parametrize("off", [0.0005, 0.001])
def test_a_phase_that_amplifies_is_weighed_by_that(off: float) -> None:
    """x'' = x with (sinh t, cosh t) for 6 s, whose rate is told too large by a constant: a
    simulation from the first node then leaves it by this times (sinh t, cosh t - 1), and an error
    becomes at most cosh t + sinh t times as large."""
    saddle, end = of_one(1.0), 6.0
    extra = off * np.cosh(end)
    piece = motions.Piece(end, lambda t: (np.sinh(t), np.cosh(t) + extra))
    motion = motions.trajectory(saddle, [piece], [], 80)
    check = dmoc.verify(motion, saddle)
    x, v = np.sinh(end), np.cosh(end) + extra
    grows = max(np.cosh(end) + np.sinh(end) * v / x, np.cosh(end) + np.sinh(end) * x / v)
    left = extra * max(np.sinh(end) / x, (np.cosh(end) - 1) / v)
    assert grows > 400 and left > 0.1  # far more than would pass where the flow is steady
    assert check.phase_error == pytest.approx(left / (grows / 6), rel=1e-3)
    assert check.passed, check.message
