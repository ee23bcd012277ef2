"""Motions just inside and just outside limits of the check, whose errors are known in closed form:
the worse one is refused by the name of its measure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from flights import Change, cube_system, flight, one, phase_changed

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.simulation.verdict import exceeded, is_unstable
from dmoc.trajectory import Trajectory


@pytest.fixture(scope="module")
def cube() -> Kernels:
    return dmoc.build(cube_system())


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


@pytest.mark.parametrize(("name", "limit"), LIMITS.items())
def test_a_measure_passes_up_to_its_limit(name: str, limit: float) -> None:
    assert not exceeded({name: 0.99 * limit})
    (text,) = exceeded({name: 1.01 * limit})
    assert text.startswith(name)
    assert exceeded({name: np.nan}) and exceeded({name: np.inf})


@pytest.mark.parametrize(
    ("worst", "amplified", "predicted"),
    [(0.0051, 1e3, 1.0), (1e-3, 89.0, 1.0), (1e-3, 1e3, 0.178)],
)
def test_an_end_is_excused_up_to_each_limit(
    worst: float, amplified: float, predicted: float
) -> None:
    """Of an end off by 0.9: segments to 0.005, an amplification of 90, a prediction of 0.18."""
    assert not is_unstable(worst, amplified, 0.9, predicted)
    assert is_unstable(min(worst, 0.0049), max(amplified, 91.0), 0.9, max(predicted, 0.182))


def bouncing(e: float) -> Change:
    return lambda motion: replace(motion, restitution={"wall": e})


def limited(top: float) -> Change:
    """A limit of y, which goes from 0 to 1."""
    bounds = np.array([[-np.inf, np.inf], [-np.inf, top], [-np.inf, np.inf]])
    return lambda motion: replace(motion, coordinate_bounds=bounds)


def moved(by: float) -> Change:
    """The whole motion moved along x, off the wall."""

    def change(motion: Trajectory) -> Trajectory:
        (hit,), shift = motion.collisions, np.array([by, 0.0, 0.0])
        for i in (0, 1):
            motion = phase_changed(i, q=lambda p: p.q + shift)(motion)
        return replace(motion, collisions=(replace(hit, position=hit.position + shift),))

    return change


@pytest.mark.parametrize(
    ("inside", "outside", "told"),
    [
        (one(0, 3, 0.009), one(0, 3, 0.011), "step error 0.011 exceeds"),
        (one(0, 4, 0.009), one(0, 4, 0.011), "segment error 0.011 exceeds"),
        # with e = 1 - s the energy after the hit is s of 0.75 J more, and the rate s of 1 m/s
        (bouncing(0.9855), bouncing(0.984), "energy error 0.02"),
        (bouncing(0.9855), bouncing(0.979), "error of the law of impact 0.021 exceeds"),
        (limited(0.9981), limited(0.9979), "excess of a limit 0.0021 exceeds"),
        (moved(-0.9e-6), moved(-1.1e-6), "the collision with 'wall' is -1.1e-06 off it"),
    ],
)
def test_a_motion_is_refused_beyond_a_limit(
    cube: Kernels, inside: Change, outside: Change, told: str
) -> None:
    good, bad = (dmoc.verify(change(flight(cube)), cube) for change in (inside, outside))
    assert good.passed, good.message
    assert not bad.passed and told in bad.message, bad.message
