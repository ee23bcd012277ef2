"""Equations of motion with some coordinates prescribed, and where they lose control of the others.

The accelerations of the coordinates that are not prescribed follow from the rows of the equations
of motion that no input enters.  The matrix that gives them can become singular (cart-pendulum: at
alpha = k pi, where cart accelerations exert no torque on the pendulum): the window around such a
point is where nothing should be prescribed.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.algebra import least_squares
from dmoc.nlp.problem import Problem

# Smallest singular value, relative to the rows and with inertia scaled to one, below which
# controllability counts as lost.
WINDOW = 0.15


class Dynamics:
    """Equations of motion M q'' = F + B u at one state and time, with the rows that no input
    enters."""

    def __init__(self, problem: Problem, q: Array, v: Array, t: float) -> None:
        self.mass, self.force = problem.model.equations(q, v, t=t)
        self.inputs = problem.model.input_matrix(q, v, t=t)
        self.rest, self.inverse = _rows_of_inputs(
            self.inputs.tobytes(), problem.inertia.tobytes(), *self.inputs.shape
        )

    def reach(self, prescribed: tuple[int, ...]) -> float:
        """Smallest singular value of the matrix that gives the other accelerations, relative to
        its rows; 1 if there are no others."""
        _, others = _shares(len(self.force), prescribed, False)
        if not others:
            return 1.0
        scale = 1 / np.sqrt(self.mass.diagonal())
        rows = self.rest @ (self.mass * scale)
        rows /= np.sqrt((rows * rows).sum(axis=1, keepdims=True))
        if len(others) == len(rows) == 1:
            return abs(float(rows[0, others[0]]))
        return (
            float(np.linalg.svd(rows[:, others], compute_uv=False)[-1])
            if np.isfinite(rows).all()
            else 0.0
        )

    def accelerations(self, prescribed: tuple[int, ...], wanted: Array, free: bool) -> Array:
        """Return q'': the prescribed ones as wanted and the others from the rows without inputs,
        or the reverse in free motion."""
        given, found = _shares(len(self.force), prescribed, free)
        a = np.zeros(len(self.force))
        if not free:
            a[given] = wanted[given]
        if found:
            right = self.rest @ (self.force - self.mass[:, given] @ a[given])
            a[found] = _least_squares(self.rest @ self.mass[:, found], right)
        return a

    def drive(self, a: Array) -> Array:
        """Return the inputs that come closest to the accelerations a."""
        return np.asarray(self.inverse @ (self.mass @ a - self.force))


@lru_cache(maxsize=64)
def _shares(nq: int, prescribed: tuple[int, ...], free: bool) -> tuple[list[int], list[int]]:
    """Coordinates whose accelerations are given, the prescribed ones or, in free motion, the
    others, and those found from them."""
    sides = (
        [i for i in range(nq) if i in prescribed],
        [i for i in range(nq) if i not in prescribed],
    )
    return sides[::-1] if free else sides


@lru_cache(maxsize=64)
def _rows_of_inputs(inputs: bytes, inertia: bytes, nq: int, nu: int) -> tuple[Array, Array]:
    """A basis of the rows that no input enters, orthonormal where forces count by the roots of
    the inertias, and the inverse of B by least squares in the same measure; B is the same in
    most states."""
    root = np.sqrt(np.frombuffer(inertia))
    B = np.frombuffer(inputs).reshape(nq, nu) / root[:, None]
    if not (nu and np.isfinite(B).all()):
        return np.diag(1 / root), np.zeros((nu, nq))
    size = np.linalg.norm(B, axis=0)
    size = np.where(size > 0, size, 1.0)
    rest = np.linalg.svd(B / size, full_matrices=True)[0][:, nu:].T
    return rest / root, np.asarray(np.linalg.pinv(B / size) / size[:, None] / root)


def _least_squares(A: Array, b: Array) -> Array:
    if A.shape == (1, 1) and A[0, 0] != 0:
        return np.asarray(b / A[0, 0])
    return least_squares(A, b)
