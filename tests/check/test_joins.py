"""What holds a motion together at its nodes and events: a motion with one part moved is refused
in a sentence that names it."""

from __future__ import annotations

from dataclasses import replace

import motions
import numpy as np
import pytest
from answers import answer_of
from flights import Change, event_changed, flight, one, phase_changed
from systems import block_system, landing_system, there_and_back

import dmoc
from dmoc.base.errors import SimulationError
from dmoc.codegen.kernels import Kernels
from dmoc.motion.trajectory import Trajectory

HERE = "at the event 'wall' at 1 s"


def both(*changes: Change) -> Change:
    def change(motion: Trajectory) -> Trajectory:
        for change_one in changes:
            motion = change_one(motion)
        return motion

    return change


def test_a_hit_keeps_position_and_tangential_momentum(cube: Kernels) -> None:
    """Energy and law of impact hold in all of them: (-1, 0.55, sqrt(0.5 - 0.55^2)) is turned
    about the normal."""
    assert dmoc.verify(flight(cube), cube).passed
    turned = dmoc.verify(flight(cube, (-1, 0.55, np.sqrt(0.5 - 0.55**2))), cube)
    assert turned.impact_error < 1e-12 and turned.energy_error < 1e-12 and not turned.passed
    assert (
        "the momentum of z jumps by -0.05559 at the event 'wall' at 1 s, beside its impulse"
        in turned.message
    )
    shifted = dmoc.verify(flight(cube, jump=0.1), cube)
    assert shifted.impact_error < 1e-12 and not shifted.passed
    assert shifted.message == "y jumps by 0.1 at the event 'wall' at 1 s"


@pytest.mark.parametrize("share", [0.5, 2.0])
def test_jumps_are_measured_by_the_sizes_of_the_motion(cube: Kernels, share: float) -> None:
    """1e-6 of a range of 1 m, 1e-4 of a momentum of 0.5 kg m/s."""
    jump = dmoc.verify(flight(cube, jump=share * 1e-6), cube)
    turned = dmoc.verify(flight(cube, (-1, 0.5, 0.5 * (1 + share * 1e-4))), cube)
    assert jump.passed is turned.passed is (share < 1)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (one(0, 3, 0.05), "step error 0.05 exceeds 0.01"),
        (both(one(1, 7, 0.05, "p", 1), one(1, 7, 0.05, "v", 1)), "step error"),
        (one(1, 7, 0.05, "v", 1), "the momentum of y at 1.35 s, 0.5, is not that of its velocity"),
        (one(1, 0, 0.05, "p", 2), "the momentum of z at 1 s, 0.55, is not that of its velocity"),
        (
            phase_changed(1, t=lambda p: p.t + 0.05),
            "a phase ends at 1 s and the next begins at 1.05 s",
        ),
        (phase_changed(1, t=lambda p: np.full(21, 1.0)), "the time does not go on after 1 s"),
        (event_changed(0, time=0.98), "the event 'wall' at 0.98 s is not at 1 s, where its phase"),
        (event_changed(0, position=np.array([1, 0.6, 0.5])), "y jumps by 0.1 at the event 'wall'"),
        (
            event_changed(0, momentum_before=np.array([1, 0.5, 0.6])),
            f"the momentum of z jumps by -0.1 {HERE}",
        ),
        (
            event_changed(0, momentum_after=np.array([-1, 0.6, 0.5])),
            f"the momentum of y jumps by -0.1 {HERE}",
        ),
        (
            event_changed(0, impulse=2.1),
            f"the momentum of x jumps by 0.1 {HERE}",
        ),
        (one(1, 4, np.nan), "step error"),
        (one(1, 0, np.nan), f"x jumps by nan {HERE}"),
        (event_changed(0, time=np.nan), "the event 'wall' at nan s is not at 1 s"),
    ],
)
def test_one_part_moved_is_named(cube: Kernels, change: Change, reason: str) -> None:
    check = dmoc.verify(change(flight(cube)), cube)
    assert not check.passed and reason in check.message


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (one(1, 3, 0.05), "step error"),
        (one(2, 0, 0.05), "x jumps by 0.05 at the event 'floor:stick' at"),
        (one(1, 0, 0.05), "x jumps by 0.05 at the event '+floor:slip+' at 0.4 s"),
        (phase_changed(1, t=lambda p: p.t + 0.01), "the next begins at 0.41 s"),
        (event_changed(0, time=0.39), "the event '+floor:slip+' at 0.39 s is not at 0.4 s"),
        (one(1, 4, 0.1, "v"), "the momentum of x at"),
        (
            event_changed(0, momentum_after=np.array([1.7, 0.0])),
            "the momentum of x jumps by -0.1 at the event '+floor:slip+' at 0.4 s",
        ),
        (
            both(
                one(2, 0, 0.1, "p"), one(2, 0, 0.1, "v"),
                lambda m: event_changed(1, momentum_after=m.phases[2].p[0])(m),
            ),
            "law of impact",
        ),
    ],
)  # fmt: skip
def test_one_part_of_a_landing_moved_is_named(change: Change, reason: str) -> None:
    """A landing, and an event at which nothing is hit."""
    kernels = dmoc.build(landing_system())
    motion = motions.thrown_block(kernels, 20, 0.0)
    assert dmoc.verify(motion, kernels).passed
    check = dmoc.verify(change(motion), kernels)
    assert not check.passed and reason in check.message


@pytest.mark.slow
@pytest.mark.parametrize("order", [4, 6])
def test_a_node_inside_a_step_is_looked_at(order: int) -> None:
    kernels = dmoc.build(block_system(), order=order)
    solution = answer_of(there_and_back(kernels, steps=20), "ipm")
    check = dmoc.verify(one(0, 7, 0.02, "q_inside")(solution.trajectory), kernels)
    assert not check.passed and "step error 0.02 exceeds 0.01" in check.message


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda m: replace(m, collisions=()), "the motion has 2 phases and 0 events: expected an"),
        (phase_changed(1, q=np.zeros((20, 3))), r"q of the phase from 1 s on has the shape \(20,"),
        (phase_changed(0, p=np.zeros((21, 2))), r"p of the phase from 0 s on has the shape \(21,"),
        (phase_changed(0, u=np.zeros((5, 0))), r"u of the phase from 0 s on has the shape \(5,"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(cube: Kernels, change: Change, reason: str) -> None:
    with pytest.raises(SimulationError, match=reason):
        dmoc.verify(change(flight(cube)), cube)
