"""Every forward simulation ends, or says why not; what laws do not determine is told."""

from __future__ import annotations

import contact_problems
import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import SimulationError
from dmoc.codegen.kernels import Kernels
from dmoc.mechanics.contact_mode import Mode
from dmoc.simulation import contact_motion
from dmoc.simulation.contact_motion import through_step
from dmoc.simulation.impact_laws.course import Coefficients
from dmoc.simulation.impact_laws.poisson import impulses
from dmoc.simulation.mode_choice import Setting
from dmoc.simulation.motion_record import MotionRecord
from dmoc.simulation.tolerances import Magnitudes, magnitudes_at

T = dynamicsymbols._t
x, y, a, b, u = dynamicsymbols("x y a b u")
g, mu = sp.symbols("g mu")
PLANAR = (x.diff(T) ** 2 + y.diff(T) ** 2) / 2


def ladder() -> dmoc.MechanicalSystem:
    """A uniform ladder of 2 m and 1 kg on a floor and against a wall."""
    return dmoc.MechanicalSystem(
        "ladder", [x, y, a], PLANAR + a.diff(T) ** 2 / 6 - g * y, {g: 9.81, mu: 0.4},
        surfaces={"floor": y >= sp.sin(a), "wall": x >= sp.cos(a)},
        tangents={"floor": x + sp.cos(a), "wall": y + sp.sin(a)},
        friction={"floor": mu, "wall": mu},
    )  # fmt: skip


def boxed() -> dmoc.MechanicalSystem:
    """A block between two walls with friction, on a floor."""
    return dmoc.MechanicalSystem(
        "boxed", [x, y], PLANAR - g * y, {g: 9.81, mu: 0.3}, inputs=[u], forces={x: u},
        surfaces={"floor": y >= 0, "left": x >= -1, "right": x <= 1},
        tangents={"floor": x, "left": y, "right": y},
        friction={"floor": mu, "left": mu, "right": mu},
    )  # fmt: skip


def stacked() -> dmoc.MechanicalSystem:
    """A block on another one on a floor, both with friction."""
    return dmoc.MechanicalSystem(
        "stacked", [x, y, a, b], PLANAR + (a.diff(T) ** 2 + b.diff(T) ** 2) / 2 - g * (y + b),
        {g: 9.81, mu: 0.3}, inputs=[u], forces={x: u}, surfaces={"floor": y >= 0, "lid": b >= y},
        tangents={"floor": x, "lid": a - x}, friction={"floor": mu, "lid": mu},
    )  # fmt: skip


def spun() -> dmoc.MechanicalSystem:
    return dmoc.MechanicalSystem(
        "spun", [x, y, a], PLANAR + a.diff(T) ** 2 / 5 - g * y, {g: 9.81, mu: 0.3},
        surfaces={"floor": y >= 0, "wall": x <= 1}, tangents={"floor": x + a, "wall": y + a},
        friction={"floor": mu, "wall": mu},
    )  # fmt: skip


def carried() -> dmoc.MechanicalSystem:
    """A block on a spring, on a belt."""
    k, f, w = sp.symbols("k f w")
    return dmoc.MechanicalSystem(
        "carried", [x], x.diff(T) ** 2 / 2 - k * x**2 / 2, {k: 16.0, f: 2.0, w: 0.5},
        tangents={"belt": x - w * T}, friction={"belt": f},
    )  # fmt: skip


STARTS = {
    ladder: lambda r, n: [np.cos(n), np.sin(n) + r.choice([0, 0.1]), n],
    boxed: lambda r, n: [r.choice([-1.0, r.uniform(-1, 1), 1.0]), r.choice([0, n])],
    stacked: lambda r, n: [0, 0, 0.2, r.choice([0, n])],
    spun: lambda r, n: [r.uniform(-1, 1), r.choice([0, n]), 0],
    carried: lambda r, n: [n - 0.5],
}


@pytest.mark.slow
@pytest.mark.parametrize("system", STARTS, ids=lambda system: system.__name__)
def test_random_simulations_end(system) -> None:  # type: ignore[no-untyped-def]
    """To the last step, with a motion that is finite and energy that nothing adds to."""
    kernels = dmoc.build(system())
    for seed in range(6):
        r = np.random.default_rng(seed)
        at = STARTS[system](r, r.uniform(0.3, 1.0))
        v = r.normal(0, 1, len(at)) * r.choice([0.0, 1.0])
        run = dmoc.simulate(
            kernels, at, v, step_size=float(r.choice([0.01, 0.05])), steps=20, restitution=0.0
        )
        assert len(run.t) == 21 and np.isfinite(run.q).all()
        if system is not carried:
            assert (np.diff(run.energy) <= 1e-9 * max(1.0, np.abs(run.energy).max())).all()


def test_a_replay_of_a_short_last_phase_ends() -> None:
    """A block slides to rest from 4.5 m/s with 0.5 m/s^2, and sticks in a phase of 1 ms: equal
    steps that resolve it would be thousands."""
    problem = dmoc.Problem(
        contact_problems.floor(), start={"x": 0, "y": 0, "x_dot": 4.5}, goal={"x_dot": 0},
        contacts=["floor:slip+"], sequence=["floor:stick"], steps=9, final_time=9,
    )  # fmt: skip
    solution = dmoc.solve(problem, "ipm", starts=1)
    assert solution.trajectory.phases[1].duration < 0.1
    run = dmoc.simulate(solution)
    assert len(run.t) <= 1 + 8 * 4 * 18
    assert [s.friction for s in run.rubbing] == [1, 0]
    assert run.q[-1, 0] == pytest.approx(4.5**2 / 2 / 0.5, rel=1e-2)


def test_changes_at_one_moment_that_come_to_no_end_are_told(
    floor: Kernels, monkeypatch: pytest.MonkeyPatch
) -> None:
    modes = [Mode((0,), (), ((0, s),)) for s in (1, -1)]  # friction pushes, it does not brake

    def alternating(*_: object) -> Mode:
        modes.reverse()
        return modes[0]

    monkeypatch.setattr(contact_motion, "mode_at", alternating)
    text = r"come to no end at t = .*, 50 in .*'floor' slip[+-], 'floor' closed and 'floor' slip"
    with pytest.raises(SimulationError, match=text):
        dmoc.simulate(floor, [0.0, 0.0], [0.0, 0.0], step_size=0.1, steps=3, inputs=[0.0])


@pytest.mark.parametrize("rate", [-5e-10, -9e-10])
@pytest.mark.parametrize("h", [0.05, 0.2])
def test_what_is_pulled_off_a_floor_that_it_hardly_approaches_leaves_it(
    rate: float, h: float
) -> None:
    """By 1e-8 m/s^2, in a motion of 1 m/s along the floor, of which 1e-9 counts as no rate:
    y = a h^2 / 2 after a rest, and less the way of the approach, which a rest leaves out."""
    system = dmoc.MechanicalSystem(
        "pulled_off", [x, y], PLANAR + x + 1e-8 * y, {}, surfaces={"floor": y >= 0}
    )
    stated = dmoc.Problem(system, start={x: 1, y: 0}, steps=2, final_time=1)
    model, state = stated.model, [1, 0, 1, rate]
    setting, at, none = Setting(model, np.zeros(1), h), np.array(state, dtype=float), np.zeros(0)
    largest = magnitudes_at(model, at, none, 0.0, h, Magnitudes())
    _, after, mode = through_step(setting, at, none, (0.0, h), (largest, MotionRecord()))
    assert mode.free
    assert after[1] == pytest.approx(1e-8 * h**2 / 2, rel=1e-2)


def test_an_impact_without_a_mass_ends() -> None:
    nothing = np.full((2, 2), np.nan)
    assert not np.isfinite(
        impulses(np.array([-1.0, 0.5]), nothing, Coefficients(0.3, 0.5)).tangential
    )


@pytest.mark.slow
def test_a_step_that_is_too_long_is_refused() -> None:
    """A block on a spring of 1e4 rad/s, in steps of 1 s."""
    kernels = dmoc.build(carried())
    with pytest.raises(SimulationError, match="over the step of 1 s at t = 0 s"):
        dmoc.simulate(
            kernels, [0.1], [0.0], step_size=1.0, steps=2, parameters={"k": 1e8, "f": 0.01}
        )


@pytest.fixture(scope="module")
def leaning() -> Kernels:
    return dmoc.build(ladder())


@pytest.mark.slow
@pytest.mark.parametrize(("angle", "friction"), [(1.2, 0.4), (0.9, 0.4), (1.2, 0.2), (0.3, 2.0)])
def test_a_ladder_that_rests_sticks_and_its_forces_are_told_to_be_indeterminate(
    leaning: Kernels, angle: float, friction: float
) -> None:
    """It rests where tan(angle) >= (1 - mu^2) / (2 mu); its four forces obey three balances."""
    assert np.tan(angle) > (1 - friction**2) / (2 * friction)
    run = dmoc.simulate(
        leaning, [np.cos(angle), np.sin(angle), angle], step_size=0.05, steps=4,
        parameters={"mu": friction},
    )  # fmt: skip
    assert run.q == pytest.approx(np.tile(run.q[0], (5, 1)), abs=1e-14)
    assert {(s.name, s.friction) for s in run.rubbing} == {("floor", 0), ("wall", 0)}
    (N, W), (F, V) = run.normal[-1], run.tangential[-1]
    balance = [N + V, W + F]
    assert balance == pytest.approx([9.81, 0], abs=1e-12)
    moment = np.cos(angle) * (N - V) + np.sin(angle) * (F - W)
    assert moment == pytest.approx(0, abs=1e-12)
    assert N >= 0 and W >= 0 and abs(F) <= friction * N and abs(V) <= friction * W
    (note,) = run.notes
    assert "statically indeterminate" in note and "'floor' and 'wall'" in note
    assert note.split(":")[0] in str(run).replace("\n", " ")


def test_a_ladder_that_is_too_flat_slides(leaning: Kernels) -> None:
    run = dmoc.simulate(
        leaning, [np.cos(0.8), np.sin(0.8), 0.8], step_size=0.05, steps=4, parameters={"mu": 0.35}
    )
    assert {(s.name, s.friction) for s in run.rubbing} == {("floor", 1), ("wall", -1)}
    assert not run.notes


def test_what_is_not_determined_is_in_the_file(leaning: Kernels, tmp_path) -> None:  # type: ignore[no-untyped-def]
    run = dmoc.simulate(leaning, [np.cos(1.2), np.sin(1.2), 1.2], step_size=0.1, steps=2)
    assert run.notes == dmoc.Simulation.load(run.save(tmp_path / "ladder.npz")).notes != ()


def test_a_ladder_that_falls_against_a_wall_is_confirmed(leaning: Kernels) -> None:
    """Its foot, on the floor already, takes an impulse too and stays: it is not hit."""
    run = dmoc.simulate(
        leaning, [np.cos(0.85) + 0.1, np.sin(0.85), 0.85], step_size=0.03, steps=14,
        restitution=0.0, parameters={"mu": 2.0},
    )  # fmt: skip
    (event,) = run.trajectory.collisions
    assert event.surface == "wall" and event.lands == ("wall",)
    assert event.impulse == event.impulses["wall"] and event.impulses["floor"] > 0
    check = dmoc.verify(run.trajectory, leaning)
    assert check.passed, check.message
