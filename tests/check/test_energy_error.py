"""What the error of the energy of a phase is compared with: the energy that a motion exchanges, of
which a slow one has hardly any in its velocities."""

from __future__ import annotations

from dataclasses import replace

import motions
import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.motion.trajectory import Trajectory

T = dynamicsymbols._t
WEIGHT, TIME = 9.81, 20.0


@pytest.fixture(scope="module")
def crane() -> Kernels:
    """Two unit weights, each moved up and down by a force of its own."""
    q, u = dynamicsymbols("left right"), dynamicsymbols("f_left f_right")
    kinetic = sum(x.diff(T) ** 2 for x in q) / 2
    return dmoc.build(
        dmoc.MechanicalSystem(
            "crane", q, kinetic - WEIGHT * sum(q), inputs=u, forces=dict(zip(q, u, strict=True))
        )
    )


def moved(kernels: Kernels, right: float, short: float = 0.0) -> Trajectory:
    """The left weight goes up by 1 m in 20 s, the right one by ``right``, from rest to rest; both
    end short by a share of that, little by little."""
    way = sp.Symbol("t")
    s = (3 - 2 * way / TIME) * (way / TIME) ** 2
    place, rate, bend = (sp.lambdify(way, s.diff(way, k)) for k in range(3))
    ends = np.array([1.0, right])

    def state(t: np.ndarray) -> np.ndarray:
        return np.hstack([place(t)[:, None] * ends, rate(t)[:, None] * ends])

    def force(t: np.ndarray) -> np.ndarray:
        return WEIGHT + (0 * t + bend(t))[:, None] * ends

    motion = motions.trajectory(kernels, [motions.Piece(TIME, state, force)], [], 40)
    (phase,) = motion.phases
    off = short * np.linspace(0.0, 1.0, 41)[:, None] * ends
    return replace(motion, phases=(replace(phase, q=phase.q - off),))


@pytest.mark.parametrize("right", [0.0, 1.0, -1.0])
def test_a_weight_that_is_lifted_slowly_is_judged_by_the_work_of_its_weight(
    crane: Kernels, right: float
) -> None:
    """0.5 % of the way is 0.5 % of the work, m g s: four times what the weight has of kinetic
    energy, (3 / 2 / 20)^2 / 2 J.  Two that change places exchange as much as two that rise."""
    assert 0.005 * WEIGHT > 4 * (1.5 / TIME) ** 2 / 2
    check = dmoc.verify(moved(crane, right, short=0.005), crane)
    weights = abs(1 + right)
    assert check.passed, check.message
    assert check.energy_error == pytest.approx(0.005 * weights, rel=0.01, abs=1e-9)


def test_a_slow_motion_that_loses_work_is_contradicted(crane: Kernels) -> None:
    assert dmoc.verify(moved(crane, 1.0), crane).energy_error < 1e-9
    check = dmoc.verify(moved(crane, 1.0, short=0.03), crane)
    assert not check.passed and "energy error 0.06" in check.message
