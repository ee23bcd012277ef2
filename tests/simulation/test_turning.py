"""Bodies that turn by quaternions, forward in time: motions in closed form."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.special import ellipj

import dmoc
from dmoc.base.errors import SimulationError
from dmoc.motion.attitude import rates, rotation

GRAVITY, MASS, HEIGHT = 9.81, 2.0, 0.3


def spinner(inertia: tuple[float, ...], **body: Any) -> dmoc.MechanicalSystem:
    world = dmoc.spatial.World(gravity=GRAVITY if body else 0)
    world.ball("q", inertia=inertia, **body)
    return world.system("spinner", cost=1)


@pytest.fixture(scope="module")
def symmetric() -> dmoc.codegen.kernels.Kernels:
    return dmoc.build(spinner((1, 1, 2)))


def omega(motion: dmoc.Simulation) -> np.ndarray:
    """Angular velocities in the axes of the body, shape (n, 3)."""
    G = np.array([rates(p) for p in motion.q])
    return np.asarray(2 * np.einsum("kij,kj->ki", G, motion.v))


def momentum(motion: dmoc.Simulation, inertia: tuple[float, ...]) -> np.ndarray:
    """Angular momenta in the world, shape (n, 3)."""
    turns = np.array([rotation(p) for p in motion.q])
    return np.asarray(np.einsum("kij,kj->ki", turns, omega(motion) * inertia))


def test_a_free_symmetric_top_precesses(symmetric: Any) -> None:
    """A hundred turns from where Euler angles have none: omega turns about the axis of the body
    with (C - A)/A omega_z; energy, momentum and length stay."""
    start = {"q": dmoc.attitude(euler=(0.3, np.pi / 2, 0.2))}
    spin = {"q_omega_x": 0.5, "q_omega_z": 6.0}
    motion = dmoc.simulate(symmetric, start, spin, step_size=0.02, steps=5236, every=4)
    turned = 6.0 * motion.t
    np.testing.assert_allclose(omega(motion)[:, 0], 0.5 * np.cos(turned), atol=1e-8)
    np.testing.assert_allclose(omega(motion)[:, 1], 0.5 * np.sin(turned), atol=1e-8)
    assert np.abs((motion.q**2).sum(axis=1) - 1).max() < 1e-14
    assert np.ptp(motion.energy) < 1e-10 * motion.energy[0]
    assert np.ptp(momentum(motion, (1, 1, 2)), axis=0).max() < 1e-7


def test_a_body_turns_over_about_its_middle_axis() -> None:
    """Jacobi's elliptic functions, for inertias 3, 2, 1 and 2 E I_2 < L^2."""
    I1, I2, I3 = inertia = (3.0, 2.0, 1.0)
    w1, w3 = 1.0, 0.05  # at the largest omega_1, where omega_2 vanishes
    energy, L2 = (I1 * w1**2 + I3 * w3**2) / 2, (I1 * w1) ** 2 + (I3 * w3) ** 2
    assert 2 * energy * I2 < L2
    pace = np.sqrt((I1 - I2) * (L2 - 2 * energy * I3) / (I1 * I2 * I3))
    modulus = (I2 - I3) * (2 * energy * I1 - L2) / ((I1 - I2) * (L2 - 2 * energy * I3))
    largest = np.sqrt((2 * energy * I1 - L2) / (I2 * (I1 - I2)))
    spin = {"q_omega_x": w1, "q_omega_z": w3}
    kernels = dmoc.build(spinner(inertia))
    motion = dmoc.simulate(kernels, {}, spin, step_size=0.02, steps=1500)
    sn, cn, dn, _ = ellipj(pace * motion.t, modulus)
    expected = np.stack([w1 * dn, -largest * sn, w3 * cn], axis=1)
    np.testing.assert_allclose(omega(motion), expected, atol=1e-8)


def test_a_heavy_top_in_steady_precession_keeps_its_tilt() -> None:
    """A Omega^2 cos(theta) - C omega_3 Omega + m g l = 0 about the point that holds it."""
    A, C, tilt, precession = 0.25, 0.1, 0.6, 1.4
    total = (MASS * GRAVITY * HEIGHT + A * precession**2 * np.cos(tilt)) / (C * precession)
    inertia = (A - MASS * HEIGHT**2, A - MASS * HEIGHT**2, C)
    top = spinner(inertia, mass=MASS, centre=(0, 0, HEIGHT))
    start = {"q": dmoc.attitude(axis=(1, 0, 0), angle=tilt)}
    up = np.array(rotation(start["q"].quaternion)).T @ (0, 0, 1)
    spin = precession * up + (total - precession * up[2]) * np.array([0, 0, 1])
    named = dict(zip(("q_omega_x", "q_omega_y", "q_omega_z"), spin, strict=True))
    motion = dmoc.simulate(dmoc.build(top), start, named, step_size=0.005, steps=1000)
    axes = np.array([rotation(p) for p in motion.q])[:, :, 2]
    np.testing.assert_allclose(axes[:, 2], np.cos(tilt), atol=1e-8)
    angle = precession * motion.t
    expected = np.sin(tilt) * np.stack([np.sin(angle), -np.cos(angle)], axis=1)
    np.testing.assert_allclose(axes[:, :2], expected, atol=1e-7)


@pytest.mark.parametrize(
    ("position", "velocity", "message"),
    [
        ({"q": 1}, {}, r"position of q = 1: expected an attitude such as dmoc.attitude"),
        ({"q": (1, 1, 0, 0)}, {}, r"position of q: quaternion = .* has the length 1.41421"),
        ({"q": None}, {}, "expected 4 finite numbers"),
        ({"q": (1, 0, 0, 0), "q0": 1}, {}, "position gives 'q0' twice, also as 'q'"),
        ({}, {"q_omega_x": "a"}, "velocity of q_omega_x = 'a': expected a number"),
        ({}, {"q_omega_x": 1, "q1_dot": 0.5}, "velocity gives 'q1_dot' and 'q_omega_x'"),
        ({"q0": 0.9}, {}, "position does not fit joint 'q_unit', which is off by -0.19"),
    ],
)
def test_a_wrong_start_is_one_sentence(
    symmetric: Any, position: Any, velocity: Any, message: str
) -> None:
    with pytest.raises(SimulationError, match=message):
        dmoc.simulate(symmetric, position, velocity, step_size=0.01, steps=1)


def test_parts_of_a_start_are_at_rest_and_upright(symmetric: Any) -> None:
    named = dmoc.simulate(symmetric, {}, {"q_omega_y": 1.0}, step_size=0.01, steps=1)
    assert named.q[0].tolist() == [1, 0, 0, 0] and named.v[0].tolist() == [0, 0, 0.5, 0]
    plain = dmoc.simulate(symmetric, {"q1": 1}, {"q3_dot": 0.2}, step_size=0.01, steps=1)
    assert plain.q[0].tolist() == [0, 1, 0, 0] and plain.v[0].tolist() == [0, 0, 0, 0.2]
