"""Whether the motion of a model is linear: M constant, forces affine in positions, velocities and
inputs, flat surfaces; what is not is refused by name."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from dmoc.base.errors import ProblemError
from dmoc.base.names import velocity_name
from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.problem.problem import Problem

# Relative differences that are rounding errors of the kernels.
SAME_VALUE = 1e-9
# Random states at which functions are compared with the affine ones that they should be.
TRIALS = 8
# What is asked of a model.
NEEDED = (
    "proofs need free motion that is linear, so that for given durations the best motion is that "
    "of a convex program; solve and search have no such limit."
)


@record(frozen=True, eq=False)
class Affine:
    """A function A x + b of x, shape (n,)."""

    A: Array  # (m, n)
    b: Array  # (m,)


def affine(
    function: Callable[[Array], Array], names: Sequence[str], what: str, sizes: Array,
    needed: str = NEEDED,
) -> Affine:  # fmt: skip
    """The affine function that a function of rows x, shape (k, n), is; raise ProblemError where it
    is none, and say what is ``needed``. ``sizes`` are typical of x, shape (n,)."""
    n = len(names)
    values = function(np.vstack([np.zeros(n), np.diag(sizes)]))
    b = values[0]
    A = ((values[1:] - b) / sizes[:, None]).T
    x = np.random.default_rng(0).uniform(-1, 1, (TRIALS, n)) * sizes
    error = np.abs(function(x) - (x @ A.T + b))
    most = np.abs(x) @ np.abs(A).T + np.abs(b)
    if not (error <= SAME_VALUE * np.maximum(most, most.max(initial=0.0))).all():
        culprit = _culprit(function, names, sizes)
        raise ProblemError(f"the {what} is no affine function of {culprit}: {needed}")
    return Affine(A, b)


def constant(
    function: Callable[[Array], Array], names: Sequence[str], what: str, sizes: Array
) -> Array:
    """The value that a function of rows x has everywhere; raise ProblemError where it varies."""
    rng, n = np.random.default_rng(0), len(names)
    x = rng.uniform(-1, 1, (TRIALS, n)) * sizes
    values = function(x)
    size = np.abs(values).max(initial=0.0)
    for j, name in enumerate(names):
        other = x.copy()
        other[:, j] = rng.uniform(-1, 1, TRIALS) * sizes[j]
        if (np.abs(function(other) - values) > SAME_VALUE * size).any():
            raise ProblemError(f"the {what} depends on {name}: {NEEDED}")
    return np.asarray(values[0])


def _culprit(function: Callable[[Array], Array], names: Sequence[str], sizes: Array) -> str:
    """The first of some variables whose slope varies, and along with which."""
    n = len(names)
    rng, unit = np.random.default_rng(1), np.diag(sizes)
    x = rng.uniform(-1, 1, n) * sizes
    at = function(x[None])[0]
    for i in range(n):
        for j in range(i, n):
            rows = np.vstack(
                [x + unit[i] * 0.3, x + unit[j] * 0.4, x + unit[i] * 0.3 + unit[j] * 0.4]
            )
            a, b, both = function(rows)
            bent = np.abs(both - a - b + at)
            if (bent > SAME_VALUE * (np.abs(both) + np.abs(a) + np.abs(b) + np.abs(at))).any():
                return names[i] if i == j else f"{names[i]} and {names[j]} together"
    return "the state"


def check_linear(problem: Problem, sizes: Array) -> None:
    """Refuse a model whose equations of motion are not linear, by the first reason there is;
    ``sizes`` are typical of positions, shape (nq,)."""
    model, names = problem.model, list(problem.kernels.coordinates)
    constant(lambda q: model.mass(q).reshape(len(q), -1), names, "mass matrix", sizes)
    force_of(problem, sizes)


def force_of(problem: Problem, sizes: Array) -> Affine:
    """The forces F of M a = F as function of (q, v, u)."""
    n, kernels = problem.nq, problem.kernels
    names = [*kernels.coordinates, *map(velocity_name, kernels.coordinates), *kernels.inputs]

    def forces(x: Array) -> Array:
        return problem.model.equations(x[:, :n], x[:, n : 2 * n], x[:, 2 * n :])[1]

    return affine(forces, names, "force", np.concatenate([sizes, sizes, np.ones(problem.nu)]))
