"""Gains of least quadratic cost along a motion: the Riccati equation, backwards through its phases
and events.

In sizes of the motion, with dy' = A dy + B du between events and dy+ = S dy- at them, the cost
int (dy^T Q dy + du^T R du) dt + dy(T)^T P(T) dy(T) is dy^T P dy from any time on (equations
:eq:`riccati` of the theory).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dmoc.base.errors import SimulationError
from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.control.linearisation import LinearPhase, exponentials, magnus
from dmoc.mechanics.algebra import solved

REPEATED = 1e-8  # change of P in a period, beside its largest entry, of one that repeats
MOST_PERIODS = 100  # of a motion whose deviations are reached; else five times as many
REACHED = 1e-2  # of the largest deviations that inputs lead to: smaller ones are errors of steps
GROWS = 1.001  # growth of a deviation in a period that rounding may make of none


@record(frozen=True, eq=False)
class Weights:
    """Q (n, n) and R (nu, nu) in sizes of the motion, and these sizes (n,) and (nu,)."""

    Q: Array
    R: Array
    sizes: Array
    input_sizes: Array


def hamiltonian(phase: LinearPhase, w: Weights) -> Array:
    """Matrices that carry (dy, P dy) through the intervals of a phase, shape (m, 2 n, 2 n)."""
    n = len(w.sizes)
    A = phase.A / w.sizes[:, None] * w.sizes
    B = phase.B / w.sizes[:, None] * w.input_sizes
    H = np.zeros((*A.shape[:2], 2 * n, 2 * n))
    H[..., :n, :n], H[..., n:, n:] = A, -np.swapaxes(A, -1, -2)
    H[..., :n, n:] = -B @ np.linalg.solve(w.R, np.swapaxes(B, -1, -2))
    H[..., n:, :n] = -w.Q
    return exponentials(magnus(H, phase.h))


def along_phase(E: Array, P: Array) -> Array:
    """P (m + 1, n, n) at the ends of the intervals of a phase, from the one at its end."""
    n, rows = len(P), [P]
    for e in E[::-1]:
        P = solved(e[n:, n:] - P @ e[:n, n:], P @ e[:n, :n] - e[n:, :n])
        P = (P + P.T) / 2
        rows.append(P)
    return np.array(rows[::-1])


def backward_sweep(hamiltonians: Sequence[Array], jumps: Sequence[Array], P: Array) -> list[Array]:
    """P along each phase, from the one after the last event; ``jumps`` are the saltation matrices
    in sizes, those of all events, of which the last may end the motion."""
    P_along = list[Array]()
    for i in reversed(range(len(hamiltonians))):
        if i < len(jumps):
            P = jumps[i].T @ P @ jumps[i]
        P_along.append(along_phase(hamiltonians[i], P))
        P = P_along[-1][0]
    return P_along[::-1]


def periodic_sweep(
    hamiltonians: Sequence[Array],
    jumps: Sequence[Array],
    again: Array,
    phases: Sequence[LinearPhase],
    w: Weights,
) -> list[Array]:
    """P along each phase of a motion that goes on for ever, swept backwards until it repeats;
    ``again`` is the deviation at the start of a period by that at the end of the one before, in
    sizes.  What the inputs do not reach and what does not die away, as a momentum that is kept,
    costs nothing after the period.

    Raises
    ------
    SimulationError
        If the motion with its feedback goes astray.
    """
    ways = (again, 1), (again @ reachable(phases, jumps, again, w), 5)
    for kept, times in ways:
        P = w.Q
        for _ in range(times * MOST_PERIODS):
            P_along = backward_sweep(hamiltonians, jumps, kept.T @ P @ kept)
            following, largest = P_along[0][0], np.abs(P_along[0][0]).max()
            if np.abs(following - P).max() <= REPEATED * largest:
                return _stable(P_along, again @ closed_loop(hamiltonians, jumps, P_along))
            P = following
    raise SimulationError(
        "the gains of the periodic motion do not converge: its inputs hardly reach a deviation "
        "that does not die away; give the model inputs that do."
    )


def _stable(P_along: list[Array], monodromy: Array) -> list[Array]:
    """The matrices P along the phases, if deviations do not grow in a period, by ``monodromy``,
    shape (n, n); raise SimulationError if they do."""
    grows = float(np.abs(np.linalg.eigvals(monodromy)).max())
    if grows < GROWS:
        return P_along
    raise SimulationError(
        f"the periodic motion cannot be held: a deviation grows {grows:.3g} times in each period, "
        "whatever the inputs do; give the model inputs that reach it."
    )


def reachable(
    phases: Sequence[LinearPhase], jumps: Sequence[Array], again: Array, w: Weights
) -> Array:
    """The projection (n, n) on the deviations that the inputs reach, in sizes."""
    n = len(w.sizes)
    monodromy, pushes = again, list[Array]()
    for i in reversed(range(len(phases))):
        if i < len(jumps):
            monodromy = monodromy @ jumps[i]
        s = phases[i]
        B = s.B[:, 0] / w.sizes[:, None] * w.input_sizes
        for transition, b in zip(s.transitions()[::-1], B[::-1], strict=True):
            pushes.append(monodromy @ b)
            monodromy = monodromy @ (transition / w.sizes[:, None] * w.sizes)
    powers = [np.hstack(pushes)]
    for _ in range(n - 1):
        following = monodromy @ powers[-1]
        powers.append(following / max(np.abs(following).max(), np.finfo(float).tiny))
    powers[0] = powers[0] / max(np.abs(powers[0]).max(), np.finfo(float).tiny)
    left, factors, _ = np.linalg.svd(np.hstack(powers), full_matrices=True)
    basis = left[:, : int((factors > REACHED * factors[0]).sum())]
    return np.asarray(basis @ basis.T)


def closed_loop(
    hamiltonians: Sequence[Array], jumps: Sequence[Array], P_along: Sequence[Array]
) -> Array:
    """The deviation after a motion with its feedback by that before it, in sizes."""
    n = P_along[0].shape[1]
    carried = np.eye(n)
    for i, (E, P) in enumerate(zip(hamiltonians, P_along, strict=True)):
        for e, p in zip(E, P, strict=False):
            carried = (e[:n, :n] + e[:n, n:] @ p) @ carried
        if i < len(jumps):
            carried = jumps[i] @ carried
    return carried


def gains(B: Array, P: Array, project: Array, w: Weights) -> Array:
    """K (m, nu, n) of du = -K dy where the derivatives by the inputs are B (m, n, nu); of
    deviations that the conditions of the mode do not allow, what remains of them, ``project``
    (m, n, n), counts."""
    B = B / w.sizes[:, None] * w.input_sizes
    K = np.linalg.solve(w.R, np.swapaxes(B, 1, 2)) @ P
    return np.asarray(w.input_sizes[:, None] * K / w.sizes @ project)
