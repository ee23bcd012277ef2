"""Gains of least quadratic cost along a motion: the Riccati equation, backwards through its phases
and events.

In sizes of the motion, with dy' = A dy + B du between events and dy+ = S dy- at them, the cost
int (dy^T Q dy + du^T R du) dt + dy(T)^T P(T) dy(T) is dy^T P dy from any time on (equations
:eq:`riccati` of the theory).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dmoc.base.errors import SimulationError
from dmoc.codegen.kernels import Array
from dmoc.control.linearisation import Stage, exponentials, magnus

REPEATED = 1e-8  # change of P in a period, beside its largest entry, of one that repeats
MOST_PERIODS = 2000
LARGEST = 1e14  # of P beside Q: no input holds the motion


@dataclass(frozen=True, eq=False)
class Weights:
    """Q (n, n) and R (nu, nu) in sizes of the motion, and these sizes (n,) and (nu,)."""

    Q: Array
    R: Array
    unit: Array
    input_unit: Array


def hamiltonian(stage: Stage, w: Weights) -> Array:
    """What the intervals of a phase make of (dy, P dy), shape (m, 2 n, 2 n)."""
    n = len(w.unit)
    A = stage.A / w.unit[:, None] * w.unit
    B = stage.B / w.unit[:, None] * w.input_unit
    H = np.zeros((*A.shape[:2], 2 * n, 2 * n))
    H[..., :n, :n], H[..., n:, n:] = A, -np.swapaxes(A, -1, -2)
    H[..., :n, n:] = -B @ np.linalg.solve(w.R, np.swapaxes(B, -1, -2))
    H[..., n:, :n] = -w.Q
    return exponentials(magnus(H, stage.h))


def along(E: Array, P: Array) -> Array:
    """P (m + 1, n, n) at the ends of the intervals of a phase, from the one at its end."""
    n, rows = len(P), [P]
    for e in E[::-1]:
        P = np.linalg.solve(e[n:, n:] - P @ e[:n, n:], P @ e[:n, :n] - e[n:, :n])
        P = (P + P.T) / 2
        rows.append(P)
    return np.array(rows[::-1])


def sweep(hamiltonians: Sequence[Array], jumps: Sequence[Array], P: Array) -> list[Array]:
    """P along each phase, from the one after the last event; ``jumps`` are the saltation matrices
    in sizes, those of all events, of which the last may end the motion."""
    found = list[Array]()
    for i in reversed(range(len(hamiltonians))):
        if i < len(jumps):
            P = jumps[i].T @ P @ jumps[i]
        found.append(along(hamiltonians[i], P))
        P = found[-1][0]
    return found[::-1]


def repeated(
    hamiltonians: Sequence[Array], jumps: Sequence[Array], again: Array, P: Array
) -> list[Array]:
    """P along each phase of a motion that goes on for ever; ``again`` is the deviation at the start
    of a period by that at the end of the one before, in sizes.

    Raises
    ------
    SimulationError
        If P grows without end.
    """
    for _ in range(MOST_PERIODS):
        found = sweep(hamiltonians, jumps, again.T @ P @ again)
        following, largest = found[0][0], np.abs(found[0][0]).max()
        if not largest < LARGEST:
            break
        if np.abs(following - P).max() <= REPEATED * largest:
            return found
        P = following
    raise SimulationError(
        "the gains of the periodic motion do not settle from period to period: a deviation that "
        "does not die away is out of reach of the inputs, or costs nothing; weigh every state in "
        "Q, or leave `periodic` out of the problem, for gains over one period."
    )


def gains(B: Array, P: Array, project: Array, w: Weights) -> Array:
    """K (m, nu, n) of du = -K dy where the derivatives by the inputs are B (m, n, nu); of
    deviations that the conditions of the mode do not allow, what remains of them, ``project``
    (m, n, n), counts."""
    B = B / w.unit[:, None] * w.input_unit
    K = np.linalg.solve(w.R, np.swapaxes(B, 1, 2)) @ P
    return np.asarray(w.input_unit[:, None] * K / w.unit @ project)
