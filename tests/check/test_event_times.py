"""Events of lasting contacts are located whatever moment is planned for them: a motion whose events
come later or earlier than its own flow has them is contradicted, by surface and time."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import motions
import numpy as np
import pytest
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.check.planned_run import _sentence
from dmoc.codegen.kernels import Kernels
from dmoc.motion.trajectory import Trajectory


def message(motion: Trajectory, kernels: Kernels) -> str:
    check = dmoc.verify(motion, kernels)
    assert not check.passed
    return str(check.message)


def braked(kernels: Kernels, late: float) -> Trajectory:
    """A block that slides from 1 m/s to rest at 1 s, planned to slide on for a share of that."""
    end = 1.0 + late
    pieces = [
        motions.Piece(end, lambda t: (t - t**2 / 2, 1 - t), None, (), {"rail": 1}, None, -1.0),
        motions.Piece(1.5, lambda t: (end - end**2 / 2, 0), None, (), {"rail": 0}, None, 0.0),
    ]
    return motions.trajectory(kernels, pieces, [{"friction": {"rail": 0}}], 20)


def set_off(kernels: Kernels, end: float, push: motions.Values, held: motions.Values,
            slides: motions.Function) -> Trajectory:  # fmt: skip
    """A block that a rail holds against a push, up to some time, and that slides then until 2 s."""
    pieces = [
        motions.Piece(end, lambda t: (0, 0), held, (), {"rail": 0}, None,
                      lambda t: -motions.rows(held, t)),
        motions.Piece(2.0, slides, push, (), {"rail": 1}, None, -1.0),
    ]  # fmt: skip
    return motions.trajectory(kernels, pieces, [{"friction": {"rail": 1}}], 20)


def ramped(kernels: Kernels, end: float) -> Trajectory:
    """Held by 1 N against a push of 1 N/s."""

    def slides(t: np.ndarray) -> tuple[np.ndarray, ...]:
        s = t - end
        return (end - 1) * s**2 / 2 + s**3 / 6, (end - 1) * s + s**2 / 2

    def push(t: np.ndarray) -> tuple[np.ndarray, ...]:
        return (t,)

    return set_off(kernels, end, push, push, slides)


@pytest.mark.parametrize("late", [0.03, 0.1])
def test_a_late_lift_off_is_located(ball: Kernels, late: float) -> None:
    """The bead leaves where the cosine of its angle is 2/3 of that at the start."""
    right = motions.sliding_off(ball, 30).phases[0].duration
    low = 2 / 3 * np.cos(0.3)
    cosines = np.linspace(low, low - 0.3, 400)
    ends = [motions.sliding_off(ball, 30, c).phases[0].duration for c in cosines[::40]]
    leaves_at = np.interp((1 + late) * right, ends, cosines[::40])
    text = message(motions.sliding_off(ball, 30, leaves_at), ball)
    assert f"the simulation lifts 'ball' off at {right:.3g}" in text
    assert "as planned" in text and "ball would have to pull with" in text


@pytest.fixture(scope="module")
def fading() -> Kernels:
    """A unit mass on a floor whose weight falls to nothing in a second and turns."""
    y, t = dynamicsymbols("y"), dynamicsymbols._t
    return dmoc.build(
        dmoc.MechanicalSystem(
            "fading", [y], y.diff() ** 2 / 2 - 10 * (1 - t) * y, {}, surfaces={"floor": y >= 0}
        )
    )


def lifted(kernels: Kernels, end: float) -> Trajectory:
    """It lies on the floor until a time, pressed by 10 (1 - t), and rises then."""
    late = end - 1

    def rises(t: np.ndarray) -> tuple[np.ndarray, ...]:
        s = t - 1
        return 5 / 3 * (s**3 - late**3) - 5 * late**2 * (s - late), 5 * (s**2 - late**2)

    pieces = [
        motions.Piece(end, lambda t: (0, 0), None, ("floor",), {}, lambda t: (10 - 10 * t,)),
        motions.Piece(1.5, rises),
    ]
    return motions.trajectory(kernels, pieces, [{"leaves": ("floor",)}], 20)


@pytest.mark.parametrize("late", [0.03, 0.1])
def test_a_force_that_the_time_takes_away_is_followed_to_the_end_of_steps(
    fading: Kernels, late: float
) -> None:
    assert dmoc.verify(lifted(fading, 1.0), fading).passed
    text = message(lifted(fading, 1 + late), fading)
    assert f"lifts 'floor' off at 1 s, not at {1 + late:.4g} s as planned" in text


@pytest.mark.parametrize("late", [0.03, 0.1])
def test_sliding_on_though_the_rate_passed_zero_is_located(rail: Kernels, late: float) -> None:
    assert dmoc.verify(braked(rail, 0.0), rail).passed
    text = message(braked(rail, late), rail)
    assert f"ends the sliding of 'rail' at 1 s, not at {1 + late:.4g} s as planned" in text


@pytest.mark.parametrize("late", [0.03, 0.1])
def test_sticking_beyond_the_cone_is_located(rail: Kernels, late: float) -> None:
    assert dmoc.verify(ramped(rail, 1.0), rail).passed
    text = message(ramped(rail, 1 + late), rail)
    assert f"lets 'rail' slide at 1 s, not at {1 + late:.4g} s as planned" in text


def test_sliding_that_begins_while_friction_holds_is_sentence(rail: Kernels) -> None:
    text = message(ramped(rail, 0.8), rail)
    assert "rail begins to slide at 0.8 s, where friction holds it: it has 1 N and needs 0.8 N" in (
        text
    )


def test_sliding_that_a_jump_of_the_input_sets_off_is_right(rail: Kernels) -> None:
    """From 0.5 N to 2 N at 1 s: the friction is not used up before."""
    motion = set_off(rail, 1.0, 2.0, 0.5, lambda t: ((t - 1) ** 2 / 2, t - 1))
    assert dmoc.verify(motion, rail).passed


@pytest.mark.parametrize("late", [0.03, 0.1])
def test_a_landing_after_the_gap_has_closed_is_located(floor: Kernels, late: float) -> None:
    """The block falls on through the floor, which it meets at 0.4 s."""
    right = motions.thrown_block(floor, 20, 0.0)
    falls = right.phases[0]
    t = np.linspace(0, 0.4 * (1 + late), 21)
    q, v = motions.columns(2 * t, 0.8 - 5 * t**2), motions.columns(2, -10 * t)
    phases = (replace(falls, t=t, q=q, v=v, p=v), *right.phases[1:])
    text = message(replace(right, phases=phases), floor)
    assert f"meets 'floor' at 0.4 s, not at {0.4 * (1 + late):.4g} s as planned" in text


LIFTS, SLIDES, STOPS = "lifts 'floor' off", "lets 'way' slide", "ends the sliding of 'way'"


@pytest.mark.parametrize(
    ("j", "planned", "time", "text"),
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
    j: int, planned: dict[str, Any] | None, time: float, text: str
) -> None:
    """Of a phase from 0 to 2 s; two surfaces, one tangent."""
    kernels = SimpleNamespace(surfaces=("floor", "wall"), tangents=("way",))
    event = planned and SimpleNamespace(**({"leaves": (), "friction": {}} | planned))
    phase = SimpleNamespace(t=np.array([0.0, 2.0]), duration=2.0)
    trajectory = SimpleNamespace(collisions=[event] if event else [], phases=[phase])
    contacts = SimpleNamespace(pull=[False, False])
    model = SimpleNamespace(nc=2, nt=1, kernels=kernels, contacts=contacts)
    motion: Any = SimpleNamespace(model=model, trajectory=trajectory)
    assert _sentence(motion, 0, j, time) == (text and f"the simulation {text}")
