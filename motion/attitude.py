"""Attitudes: how a frame is turned, as unit quaternions p = (p0, p1, p2, p3), of which p and -p are
the same; p0 is the cosine of half the angle, the others are the axis times its sine."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dmoc.base.arguments import array, number, shown
from dmoc.base.errors import ProblemError
from dmoc.base.signatures import public

Array: TypeAlias = NDArray[np.float64]

# How far a matrix may be from a rotation, and a quaternion from length 1: numbers of five digits
# are within.
ROUNDED = 1e-4
WAYS = (
    "expected one of quaternion=(p0, p1, p2, p3), matrix=R, euler=(yaw, pitch, roll), or axis=(x, "
    "y, z) with angle=..."
)


def rotation(p: Any) -> tuple[tuple[Any, ...], ...]:
    """Rows of R(p), which takes a vector of the turned frame into the frame before."""
    a, b, c, d = p
    return (
        (1 - 2 * (c * c + d * d), 2 * (b * c - a * d), 2 * (b * d + a * c)),
        (2 * (b * c + a * d), 1 - 2 * (b * b + d * d), 2 * (c * d - a * b)),
        (2 * (b * d - a * c), 2 * (c * d + a * b), 1 - 2 * (b * b + c * c)),
    )


def rates(p: Any) -> tuple[tuple[Any, ...], ...]:
    """Rows of G(p), with which the angular velocity in the turned frame is 2 G p'; its transpose
    takes torques to generalised forces, and p' = G^T omega / 2."""
    a, b, c, d = p
    return (-b, a, d, -c), (-c, -d, a, b), (-d, c, -b, a)


@public(ProblemError)
@dataclass(frozen=True)
class Attitude:
    """How a body is turned; made by :func:`dmoc.attitude`.

    Attributes
    ----------
    quaternion : tuple of float
        (p0, p1, p2, p3) of length 1, without a unit; -p is the same attitude.

    Examples
    --------
    >>> import dmoc
    >>> upright = dmoc.attitude(axis=(0, 0, 1), angle=0.0)
    >>> upright.quaternion, upright.matrix.tolist()[0]
    ((1.0, 0.0, 0.0, 0.0), [1.0, 0.0, 0.0])
    """

    quaternion: tuple[float, float, float, float]

    @property
    def matrix(self) -> Array:
        """R of shape (3, 3), which takes a vector of the body into the frame before it."""
        return np.array(rotation(self.quaternion))

    def angle_to(self, other: Attitude) -> float:
        """The angle in rad, from 0 to pi, by which a body turns from here to there the short
        way."""
        if not isinstance(other, Attitude):
            raise ProblemError(f"other = {shown(other)}: expected an attitude, of dmoc.attitude.")
        p, q = np.array(self.quaternion), np.array(other.quaternion)
        return 2 * float(np.linalg.norm(logarithm(p, nearer(p, q))))


@public(ProblemError)
def attitude(
    quaternion: ArrayLike | None = None,
    *,
    matrix: ArrayLike | None = None,
    axis: ArrayLike | None = None,
    angle: float | None = None,
    euler: ArrayLike | None = None,
) -> Attitude:
    """Return an attitude, stated in one of four ways.

    Parameters
    ----------
    quaternion : array of shape (4,), optional
        (p0, p1, p2, p3), p0 the cosine of half the angle; its length is 1 to four digits.
    matrix : array of shape (3, 3), optional
        R, which takes a vector of the body into the frame before it.
    axis : array of shape (3,), optional
        That the body is turned about, of any length but 0.
    angle : float, optional
        In rad, about the axis.
    euler : array of shape (3,), optional
        Yaw, pitch and roll in rad: turned about z, then about the new y, then about the new x.

    Returns
    -------
    Attitude
        The goal of a problem is reached with either sign of its quaternion.

    Raises
    ------
    ProblemError
        If it is stated in no way or in several, a quaternion or an axis has no length, or a matrix
        is no rotation.

    Examples
    --------
    >>> import numpy as np
    >>> import dmoc
    >>> half = dmoc.attitude(axis=(0, 0, 1), angle=np.pi)
    >>> half == dmoc.attitude(quaternion=half.quaternion)
    True
    >>> round(half.angle_to(dmoc.attitude(euler=(np.pi / 2, 0, 0))), 6)
    1.570796
    """
    about = axis is not None or angle is not None
    stated = [quaternion is not None, matrix is not None, euler is not None, about]
    if sum(stated) != 1:
        raise ProblemError(f"an attitude is stated in {sum(stated)} ways: {WAYS}.")
    if quaternion is not None:
        p = _numbers(quaternion, (4,), "quaternion")
        length = math.hypot(*p)
        if abs(length - 1) > ROUNDED:
            remedy = "; divide it by its length" if length > 0 else ", as no turn is (1, 0, 0, 0)"
            raise ProblemError(
                f"quaternion = {shown(quaternion)} has the length {length:g}: expected 1{remedy}."
            )
    elif matrix is not None:
        p = _of_matrix(_numbers(matrix, (3, 3), "matrix"))
    elif euler is not None:
        yaw, pitch, roll = _numbers(euler, (3,), "euler")
        turns = zip(np.eye(3)[::-1], (yaw, pitch, roll), strict=True)
        z, y, x = (_about(n, float(a)) for n, a in turns)
        p = product(product(z, y), x)
    else:
        n = _numbers(axis, (3,), "axis")
        if not n.any():
            raise ProblemError(f"axis = {shown(axis)}: expected three numbers, not all 0.")
        p = _about(n / np.linalg.norm(n), number(angle, "angle"))
    a, b, c, d = (p / np.linalg.norm(p)).tolist()
    return Attitude((a, b, c, d))


def _numbers(value: Any, shape: tuple[int, ...], name: str) -> Array:
    numbers = array(value)
    if numbers is None or numbers.shape != shape or not np.isfinite(numbers).all():
        size = " x ".join(map(str, shape))
        raise ProblemError(f"{name} = {shown(value)}: expected {size} finite numbers; {WAYS}.")
    return numbers


def _about(axis: Array, angle: float) -> Array:
    return np.append(np.cos(angle / 2), np.sin(angle / 2) * axis)


def _of_matrix(R: Array) -> Array:
    """The quaternion of a rotation: of 4 p p^T, which its entries make, the largest column."""
    if np.abs(R @ R.T - np.eye(3)).max() > ROUNDED or np.linalg.det(R) < 0:
        raise ProblemError(
            f"matrix = {shown(R.tolist())} is no rotation: expected orthogonal columns of length "
            "1 and the determinant 1."
        )
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = R
    squares = np.array(
        [
            [1 + xx + yy + zz, zy - yz, xz - zx, yx - xy],
            [zy - yz, 1 + xx - yy - zz, xy + yx, xz + zx],
            [xz - zx, xy + yx, 1 - xx + yy - zz, yz + zy],
            [yx - xy, xz + zx, yz + zy, 1 - xx - yy + zz],
        ]
    )
    return np.asarray(squares[int(np.argmax(np.diagonal(squares)))])


# Quaternions in rows, shape (..., 4) --------------------------------------------------------------


def product(p: Array, q: Array) -> Array:
    """The turn q in the frame that p has turned, and so p after q."""
    a, v, b, w = p[..., :1], p[..., 1:], q[..., :1], q[..., 1:]
    real = a * b - (v * w).sum(axis=-1, keepdims=True)
    return np.concatenate([real, a * w + b * v + np.cross(v, w)], axis=-1)


def nearer(p: Array, q: Array) -> Array:
    """q or -q, whichever is nearer to p."""
    return np.where((p * q).sum(axis=-1, keepdims=True) < 0, -q, q)


def logarithm(p: Array, q: Array) -> Array:
    """Half the turn vector, shape (..., 3), that takes p to q along the sphere, in the frame of p;
    at most pi long."""
    turn = product(p * (1.0, -1.0, -1.0, -1.0), q)
    sine = np.linalg.norm(turn[..., 1:], axis=-1, keepdims=True)
    angle = np.arctan2(sine, turn[..., :1])
    # At the opposite point every direction is as good.
    some = np.where(turn[..., :1] < 0, (np.pi, 0.0, 0.0), turn[..., 1:])
    return np.where(sine > 0, angle / np.where(sine > 0, sine, 1.0) * turn[..., 1:], some)


def turned(p: Array, half: Array) -> Array:
    """p turned by half a turn vector of its frame, shape (..., 3): the inverse of logarithm."""
    angle = np.linalg.norm(half, axis=-1, keepdims=True)
    return product(p, np.concatenate([np.cos(angle), np.sinc(angle / np.pi) * half], axis=-1))
