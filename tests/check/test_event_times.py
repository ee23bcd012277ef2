"""Events of lasting contacts are located whatever moment is planned for them: a motion whose events
come later or earlier than its own flow has them is contradicted, by surface and time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import motions
import numpy as np
import pytest

import dmoc
from dmoc.check.planned_run import _sentence
from dmoc.codegen.kernels import Kernels
from dmoc.motion.trajectory import Trajectory


def message(motion: Trajectory, kernels: Kernels) -> str:
    check = dmoc.verify(motion, kernels)
    assert not check.passed
    return str(check.message)


def none(t: np.ndarray) -> np.ndarray:
    return np.zeros((len(t), 1))


def still(end: float, push: motions.Function, sign: int) -> motions.Piece:
    """A block on a rail that does not move under a push."""
    force: Callable[[np.ndarray], np.ndarray] = (
        (lambda t: -push(t)) if sign == 0 else (lambda t: np.full((len(t), 1), -float(sign)))
    )
    return motions.Piece(
        end, lambda t: motions.columns(0 * t, 0), push, (), {"rail": sign}, None, force
    )


def braked(kernels: Kernels, late: float) -> Trajectory:
    """A block that slides from 1 m/s to rest at 1 s, planned to slide on for a share of that."""
    end = 1.0 + late

    def slides(t: np.ndarray) -> np.ndarray:
        return motions.columns(t - t**2 / 2, 1 - t)

    last = slides(np.array([end]))[0]
    pieces = [
        motions.Piece(end, slides, none, (), {"rail": 1}, None, lambda t: none(t) - 1),
        motions.Piece(
            1.5, lambda t: motions.columns(last[0] + 0 * t, 0), none, (), {"rail": 0}, None, none
        ),
    ]
    return motions.trajectory(kernels, pieces, [{"friction": {"rail": 0}}], 20)


def ramped(kernels: Kernels, end: float) -> Trajectory:
    """A block that is held by 1 N against a push of 1 N/s, up to some time, and then slides."""

    def slides(t: np.ndarray) -> np.ndarray:
        s = t - end
        v = (end - 1) * s + s**2 / 2
        return motions.columns((end - 1) * s**2 / 2 + s**3 / 6, v)

    pieces = [
        still(end, lambda t: motions.columns(t), 0),
        motions.Piece(
            2.0, slides, lambda t: motions.columns(t), (), {"rail": 1}, None, lambda t: none(t) - 1
        ),
    ]
    return motions.trajectory(kernels, pieces, [{"friction": {"rail": 1}}], 20)


@pytest.mark.parametrize("late", [0.03, 0.1])
def test_a_late_lift_off_is_located(ball: Kernels, late: float) -> None:
    """The bead leaves where the cosine of its angle is 2/3 of that at the start."""
    right = motions.sliding_off(ball, 30).phases[0].duration
    low = 2 / 3 * np.cos(0.3)
    cosines = np.linspace(low, low - 0.3, 400)
    ends = [motions.sliding_off(ball, 30, c).phases[0].duration for c in cosines[::40]]
    leaves_at = np.interp((1 + late) * right, ends, cosines[::40])
    told = message(motions.sliding_off(ball, 30, leaves_at), ball)
    assert f"the simulation lifts 'ball' off at {right:.3g}" in told
    assert "as planned" in told and "ball would have to pull with" in told


@pytest.mark.parametrize("late", [0.03, 0.1])
def test_sliding_on_though_the_rate_passed_zero_is_located(rail: Kernels, late: float) -> None:
    assert dmoc.verify(braked(rail, 0.0), rail).passed
    told = message(braked(rail, late), rail)
    assert f"ends the sliding of 'rail' at 1 s, not at {1 + late:.4g} s as planned" in told


@pytest.mark.parametrize("late", [0.03, 0.1])
def test_sticking_beyond_the_cone_is_located(rail: Kernels, late: float) -> None:
    assert dmoc.verify(ramped(rail, 1.0), rail).passed
    told = message(ramped(rail, 1 + late), rail)
    assert f"lets 'rail' slide at 1 s, not at {1 + late:.4g} s as planned" in told


def test_sliding_that_begins_while_friction_holds_is_sentence(rail: Kernels) -> None:
    told = message(ramped(rail, 0.8), rail)
    assert "rail begins to slide at 0.8 s, where friction holds it: it has 1 N and needs 0.8 N" in (
        told
    )


def test_sliding_that_a_jump_of_the_input_sets_off_is_right(rail: Kernels) -> None:
    """From 0.5 N to 2 N at 1 s: the friction is not used up before."""

    def slides(t: np.ndarray) -> np.ndarray:
        return motions.columns((t - 1) ** 2 / 2, t - 1)

    pieces = [
        still(1.0, lambda t: none(t) + 0.5, 0),
        motions.Piece(
            2.0, slides, lambda t: none(t) + 2, (), {"rail": 1}, None, lambda t: none(t) - 1
        ),
    ]
    motion = motions.trajectory(rail, pieces, [{"friction": {"rail": 1}}], 20)
    assert dmoc.verify(motion, rail).passed


@pytest.mark.parametrize("late", [0.03, 0.1])
def test_a_landing_after_the_gap_has_closed_is_located(floor: Kernels, late: float) -> None:
    """The block falls on through the floor, which it meets at 0.4 s."""
    right = motions.thrown_block(floor, 20, 0.0)
    falls = right.phases[0]
    t = np.linspace(0, 0.4 * (1 + late), 21)
    q, v = motions.columns(2 * t, 0.8 - 5 * t**2), motions.columns(2, -10 * t)
    phases = (replace(falls, t=t, q=q, v=v, p=v), *right.phases[1:])
    told = message(replace(right, phases=phases), floor)
    assert f"meets 'floor' at 0.4 s, not at {0.4 * (1 + late):.4g} s as planned" in told


LIFTS, SLIDES, STOPS = "lifts 'floor' off", "lets 'way' slide", "ends the sliding of 'way'"


@pytest.mark.parametrize(
    ("j", "planned", "time", "told"),
    [
        (0, {"leaves": ("floor",)}, 1.979, f"{LIFTS} at 1.979 s, not at 2 s as planned"),
        (0, {"leaves": ("floor",)}, 1.981, ""),
        (0, {"leaves": ("wall",)}, 2.0, f"{LIFTS} at 2 s, which is not planned"),
        (0, {"friction": {"way": 0}}, 2.0, f"{LIFTS} at 2 s, which is not planned"),
        (2, {"friction": {"way": 1}}, 2.019, ""),
        (2, {"friction": {"way": 1}}, 2.021, f"{SLIDES} at 2.021 s, not at 2 s as planned"),
        (2, {"leaves": ("way",)}, 2.0, ""),
        (3, {"friction": {"way": 0}}, 2.0, ""),
        (3, {"leaves": ("floor",)}, 2.0, f"{STOPS} at 2 s, which is not planned"),
        (3, None, 2.0, f"{STOPS} at 2 s, which is not planned"),
    ],
)
def test_an_event_is_planned_that_its_phase_ends_with_to_a_hundredth_of_it(
    j: int, planned: dict[str, Any] | None, time: float, told: str
) -> None:
    """Of a phase from 0 to 2 s; two surfaces, one tangent."""
    kernels = SimpleNamespace(surfaces=("floor", "wall"), tangents=("way",))
    event = planned and SimpleNamespace(**({"leaves": (), "friction": {}} | planned))
    phase = SimpleNamespace(t=np.array([0.0, 2.0]), duration=2.0)
    trajectory = SimpleNamespace(collisions=[event] if event else [], phases=[phase])
    model = SimpleNamespace(nc=2, nt=1, kernels=kernels)
    motion: Any = SimpleNamespace(model=model, trajectory=trajectory)
    assert _sentence(motion, 0, j, time) == (told and f"the simulation {told}")
