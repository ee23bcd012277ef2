"""Attitudes as they are stated, against SciPy's rotations."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import dmoc
from dmoc.base.errors import ProblemError
from dmoc.motion.attitude import logarithm, nearer, product, turned


def scipy_of(attitude: dmoc.Attitude) -> Rotation:
    return Rotation.from_quat(np.roll(attitude.quaternion, -1))


def test_all_ways_to_state_an_attitude_are_those_of_scipy() -> None:
    rng = np.random.default_rng(0)
    for _ in range(50):
        yaw, pitch, roll = rng.uniform(-np.pi, np.pi, 3)
        turn = Rotation.from_euler("ZYX", (yaw, pitch, roll))
        vector = turn.as_rotvec()
        ways = (
            dmoc.attitude(euler=(yaw, pitch, roll)),
            dmoc.attitude(matrix=turn.as_matrix()),
            dmoc.attitude(np.roll(turn.as_quat(), 1)),
            dmoc.attitude(axis=3 * vector, angle=float(np.linalg.norm(vector))),
        )
        for way in ways:
            np.testing.assert_allclose(way.matrix, turn.as_matrix(), atol=1e-14)
            assert np.linalg.norm(way.quaternion) == pytest.approx(1, abs=1e-15)


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0.6, -0.8, 0)])
def test_half_turns_have_a_quaternion(axis: tuple[float, ...]) -> None:
    half = dmoc.attitude(axis=axis, angle=np.pi)
    assert dmoc.attitude(matrix=half.matrix).angle_to(half) == pytest.approx(0, abs=1e-15)
    assert half.angle_to(dmoc.attitude((1, 0, 0, 0))) == pytest.approx(np.pi)


def test_angles_between_attitudes_are_those_of_the_short_way() -> None:
    rng = np.random.default_rng(1)
    for _ in range(20):
        p, q = (dmoc.attitude(e / np.linalg.norm(e)) for e in rng.normal(size=(2, 4)))
        expected = (scipy_of(p).inv() * scipy_of(q)).magnitude()
        assert p.angle_to(q) == pytest.approx(expected, abs=1e-14)
        assert q.angle_to(p) == pytest.approx(expected, abs=1e-14)


def test_turns_along_the_sphere_end_where_they_should() -> None:
    rng = np.random.default_rng(2)
    p, q = rng.normal(size=(2, 30, 4))
    p, q = (e / np.linalg.norm(e, axis=1, keepdims=True) for e in (p, q))
    half = logarithm(p, q)
    np.testing.assert_allclose(turned(p, half), q, atol=1e-14)
    assert np.linalg.norm(half, axis=1).max() <= np.pi
    long = logarithm(p, -q)
    np.testing.assert_allclose(
        np.linalg.norm(half, axis=1) + np.linalg.norm(long, axis=1), np.pi, atol=1e-14
    )
    np.testing.assert_allclose(turned(p, logarithm(p, -p)), -p, atol=1e-14)
    assert (logarithm(p, p) == 0).all() or np.abs(logarithm(p, p)).max() < 1e-15
    assert ((nearer(p, q) * p).sum(axis=1) >= 0).all()
    middle = turned(p, half / 2)
    np.testing.assert_allclose((p * middle).sum(axis=1), (middle * q).sum(axis=1), atol=1e-14)
    one = product(p[0], q[0])
    expected = Rotation.from_quat(np.roll(p[0], -1)) * Rotation.from_quat(np.roll(q[0], -1))
    assert abs(one @ np.roll(expected.as_quat(), 1)) == pytest.approx(1)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({}, "an attitude is stated in 0 ways: expected one of quaternion="),
        ({"euler": (0, 0, 0), "matrix": np.eye(3)}, "an attitude is stated in 2 ways"),
        ({"quaternion": (1, 1, 0, 0)}, "quaternion = .* has the length 1.41421: expected 1"),
        ({"quaternion": (1, 0, 0)}, "quaternion = .*: expected 4 finite numbers"),
        ({"quaternion": (np.nan, 0, 0, 0)}, "expected 4 finite numbers"),
        ({"matrix": np.diag([1, 1, -1])}, "is no rotation: expected orthogonal columns"),
        ({"matrix": 2 * np.eye(3)}, "is no rotation"),
        ({"matrix": np.eye(2)}, "matrix = .*: expected 3 x 3 finite numbers"),
        ({"axis": (0, 0, 0), "angle": 1}, r"axis = \(0, 0, 0\): expected three numbers, not all"),
        ({"axis": (0, 0, 1)}, "angle = None: expected a number"),
        ({"angle": 1}, "axis = None: expected 3 finite numbers"),
        ({"euler": "abc"}, "euler = 'abc': expected 3 finite numbers"),
    ],
)
def test_what_is_no_attitude_is_one_sentence(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(ProblemError, match=message) as error:
        dmoc.attitude(**arguments)
    assert str(error.value.args[0]).endswith(".")
