"""Verdicts do not depend on units nor on where the origin is, and a motion at rest is confirmed
where the model keeps it there, and refused where it does not."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import invariance
import motions
import numpy as np
import pytest
from systems import landing_system

import dmoc
from dmoc.mechanics.model_values import parameter_row
from dmoc.mechanics.phase_models import PhaseModels
from dmoc.motion.trajectory import Trajectory
from dmoc.simulation.sizes import nodes_of, sizes_of

TELLINGS = [
    invariance.Frame(), invariance.Frame(shift=3.0), invariance.Frame(shift=-0.7),
    invariance.Frame(metre=1e-6), invariance.Frame(kilogram=1e6), invariance.Frame(second=1e-6),
    invariance.Frame(second=1e6), invariance.Frame(1e3, 1e-6, 1e4),
    invariance.Frame(1e-3, 1e6, 1e-2, 3.0),
]  # fmt: skip


@cache
def answers(name: str) -> list[tuple[invariance.Frame, dmoc.Solution]]:
    return invariance.solutions(invariance.KINDS[name], TELLINGS)


@pytest.mark.slow
@pytest.mark.parametrize("name", invariance.KINDS)
def test_a_verdict_is_the_same_in_all_units_and_at_all_places(name: str) -> None:
    for frame, solution in answers(name):
        assert solution.status == "solved", f"{frame}: {solution.message}"


@pytest.mark.slow
def test_measures_are_the_same_in_all_units() -> None:
    """Those of the ladder and of the finger, whose contacts carry 0.024 N and 9.81 N."""
    for name in ("ladder", "finger that pushes"):
        (_, plain), *others = answers(name)
        first = plain.verify()
        for frame, other in others:
            check = other.verify()
            for measure in ("max_defect", "energy_error", "force_error", "terminal_error"):
                value = getattr(first, measure)
                assert getattr(check, measure) == pytest.approx(value, rel=1e-2, abs=1e-6), frame


def rests(mu_pull: float, drift: float = 0.0) -> tuple[Trajectory, dmoc.codegen.kernels.Kernels]:
    """A block at rest on a floor for a second, pulled along it with a force; mu m g = 1 N, and it
    sinks with a constant rate."""
    kernels = dmoc.build(landing_system())
    piece = motions.Piece(
        1.0, lambda t: (0, -drift * t, 0, -drift), mu_pull, ("floor",), {"floor": 0}, 10.0,
        -mu_pull,
    )  # fmt: skip
    return motions.trajectory(kernels, [piece], [], 10), kernels


def test_a_block_at_rest_is_confirmed_and_one_that_would_slide_is_not() -> None:
    for pull, passed in ((0.0, True), (0.99, True), (1.03, False)):
        check = dmoc.verify(*rests(pull))
        assert check.passed is passed, check.message
    assert "would have to stick with 1.03 N" in check.message


def test_a_block_at_rest_that_sinks_is_refused() -> None:
    """By 1e-9 m/s it is solver's noise beside g T = 10 m/s, by 1e-5 m/s it is not."""
    assert dmoc.verify(*rests(0.0, 1e-9)).passed
    assert not dmoc.verify(*rests(0.0, 1e-5)).passed


def hovering(share: float) -> tuple[Trajectory, dmoc.codegen.kernels.Kernels]:
    """A mass that stands still in the air under a share of its weight, without a floor beneath."""
    kernels = dmoc.build(motions.hoist_system())
    piece = motions.Piece(1.0, lambda t: (0, 2, 0, 0), lambda t: (0, 10 * share))
    motion = motions.trajectory(kernels, [piece], [], 10)
    return replace(motion, parameters={"m": 1.0, "g": 10.0, "mu": 0.0}), kernels


@pytest.mark.parametrize(("share", "passed"), [(1.0, True), (1 + 1e-6, False), (0.9, False)])
def test_what_stands_still_where_the_model_moves_it_is_refused(share: float, passed: bool) -> None:
    assert dmoc.verify(*hovering(share)).passed is passed


@pytest.mark.parametrize("far", [1.0, 1e6, 1e9])
def test_errors_do_not_hide_in_what_is_far_away(far: float) -> None:
    """A wall, limits and inputs far beyond the motion change none of its sizes."""
    problem = invariance.KINDS["block and wall"].problem(invariance.Frame())
    kernels = dmoc.build(invariance.free_system())
    solution = dmoc.solve(dmoc.Problem(kernels, **problem), "ipm", starts=1)
    phases = solution.phases[:1]
    motion = replace(solution.trajectory, phases=phases, collisions=(), cost=np.nan)
    par = {"m": 1.0, "c": 1.0 + far}
    motion = replace(
        motion, parameters=par, coordinate_bounds=np.array([[-far, 2 + far]]),
        input_bounds=np.array([[-1e3 * far, 1e3 * far]]),
    )  # fmt: skip
    sizes = sizes_of(motion, nodes_of(motion, PhaseModels(kernels, parameter_row(kernels, par))))
    (phase,) = motion.phases
    assert sizes.q[0] == np.ptp(phase.q) and sizes.p[0] == np.abs(phase.p).max()
    assert dmoc.verify(motion, kernels).passed
    wrong = replace(phase, q=phase.q * np.linspace(1, 1.2, len(phase.t))[:, None])
    assert not dmoc.verify(replace(motion, phases=(wrong,)), kernels).passed


@pytest.mark.parametrize(("bounds", "input_", "passed"), [
    ((0.0, np.inf), -1e-3, False), ((0.0, np.inf), -1e-9, True), ((0.0, 1e20), -1e-3, False),
    ((-np.inf, 0.0), 1e-3, False), ((-1.0, 1.0), 1 + 1e-3, False), ((-1.0, 1.0), 1.0, True),
])  # fmt: skip
def test_an_input_beyond_one_of_its_limits_is_seen(
    bounds: tuple[float, float], input_: float, passed: bool
) -> None:
    """A unit mass under a constant force, whose limits may be open at one side."""
    kernels = dmoc.build(invariance.free_system())
    push = 2.0 if bounds[1] > 1 else -2.0 if bounds[1] == 0 else 0.0

    def state(t: np.ndarray) -> tuple[np.ndarray, ...]:
        half = np.minimum(t, 0.5)
        rest = t - half
        v = push * half + input_ * rest
        return push * half**2 / 2 + (push * half) * rest + input_ * rest**2 / 2, v

    pieces = [motions.Piece(0.5, state, push), motions.Piece(1.0, state, input_)]
    motion = motions.trajectory(kernels, pieces[:1], [], 10)
    end = motions.trajectory(kernels, [pieces[0], pieces[1]], [{}], 10).phases[1]
    joined = replace(
        motion.phases[0], t=np.append(motion.phases[0].t, end.t[1:]),
        u=np.repeat([[push], [input_]], 10, axis=0),
        **{n: np.vstack([getattr(motion.phases[0], n), getattr(end, n)[1:]]) for n in "qvp"},
    )  # fmt: skip
    motion = replace(
        motion, phases=(joined,), controls="constant", input_bounds=np.array([bounds]),
        parameters={"m": 1.0, "c": 10.0},
    )  # fmt: skip
    check = dmoc.verify(motion, kernels)
    assert check.passed is passed and (passed or "excess of an input" in check.message)
