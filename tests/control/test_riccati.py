"""Costs that are swept backwards through phases and events of linear motions without inputs, of
which those at the end alone are counted: products of matrices."""

from __future__ import annotations

import numpy as np
import pytest

from dmoc.control.linearisation import LinearPhase
from dmoc.control.riccati import Weights, backward_sweep, closed_loop, gains, hamiltonian

R = np.random.default_rng(5)
# Transitions of the intervals of three phases, what two events make of a deviation, and the last.
PHASES = [np.eye(2) + 0.3 * R.normal(size=(m, 2, 2)) for m in (1, 3, 2)]
JUMPS = [np.diag([1.0, -0.5]), np.array([[1.0, 0.0], [2.0, 0.5]]), np.array([[0.0, 1.0], [3.0, 0]])]
LAST = np.array([[2.0, 0.5], [0.5, 1.0]])


def hamiltonians() -> list[np.ndarray]:
    """Each (dy, P dy) by its own, as no input acts."""
    zero = np.zeros((2, 2))
    return [
        np.array([np.block([[F, zero], [zero, np.linalg.inv(F).T]]) for F in phase])
        for phase in PHASES
    ]


@pytest.mark.parametrize("events", [2, 3])
def test_costs_of_the_end_are_carried_through_all_events(events: int) -> None:
    """The last event may end the motion."""
    jumps = JUMPS[:events]
    along, carried = backward_sweep(hamiltonians(), jumps, LAST), np.eye(2)
    assert [len(P) for P in along] == [2, 4, 3]
    if events == 3:
        carried = JUMPS[2]
    for i in (2, 1, 0):
        np.testing.assert_allclose(along[i][-1], carried.T @ LAST @ carried, rtol=1e-9)
        for k in reversed(range(len(PHASES[i]))):
            carried = carried @ PHASES[i][k]
            np.testing.assert_allclose(along[i][k], carried.T @ LAST @ carried, rtol=1e-9)
        if i:
            carried = carried @ jumps[i - 1]
    np.testing.assert_allclose(closed_loop(hamiltonians(), jumps, along), carried, rtol=1e-9)


def test_costs_of_a_long_time_are_those_of_the_closed_form() -> None:
    """y'' = u with the cost y^2 + u^2: P = (sqrt 2, 1; 1, sqrt 2), in any sizes; backwards for 20 s
    from a cost at the end, and from none."""
    unit, of_input = np.array([2.0, 5.0]), np.array([3.0])
    count, t = 80, np.linspace(0.0, 20.0, 81)
    A, B = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]])
    phase = LinearPhase(
        t, np.zeros((count + 1, 2)), np.zeros((count, 1)), np.tile(A, (count, 2, 1, 1)),
        np.tile(B, (count, 2, 1, 1)),
    )  # fmt: skip
    weights = Weights(np.diag([1.0, 0.0]) * unit[:, None] * unit, np.array([[9.0]]), unit, of_input)
    exact = np.array([[np.sqrt(2), 1.0], [1.0, np.sqrt(2)]])
    for last in (np.zeros((2, 2)), LAST):
        (P,) = backward_sweep([hamiltonian(phase, weights)], [], last)
        np.testing.assert_allclose(P[0] / unit[:, None] / unit, exact, rtol=1e-6)
    # The best feedback u = -(1, sqrt 2) y, whatever the sizes.
    K = gains(np.tile(B, (count + 1, 1, 1)), P, np.tile(np.eye(2), (count + 1, 1, 1)), weights)
    np.testing.assert_allclose(K[0], [[1.0, np.sqrt(2)]], rtol=1e-6)
