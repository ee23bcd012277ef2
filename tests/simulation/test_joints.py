"""Joints phi(q, t) = 0, which hold in every phase: simulated and checked beside the same motions in
coordinates that need none."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import motions
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import SimulationError
from dmoc.codegen.kernels import Kernels
from dmoc.mechanics.contact_mode import Mode
from dmoc.mechanics.model import Model
from dmoc.mechanics.model_values import parameter_row
from dmoc.motion.trajectory import Trajectory
from dmoc.simulation.impact_laws.course import Coefficients
from dmoc.simulation.impact_laws.poisson import impulses
from dmoc.simulation.integrator import Integrator

T, G = dynamicsymbols._t, 9.81
X, Y, A, B = dynamicsymbols("x y a b")


def bob(backend: str = "compiled", **fields: object) -> Kernels:
    """A unit mass on a rod of one metre."""
    lagrangian = (X.diff(T) ** 2 + Y.diff(T) ** 2) / 2 - G * Y
    rod = {"rod": (X**2 + Y**2 - 1) / 2}
    return dmoc.build(
        dmoc.MechanicalSystem("bob", [X, Y], lagrangian, {}, constraints=rod, **fields),  # type: ignore[arg-type]
        backend=backend,
    )


def dumbbell(**fields: object) -> Kernels:
    """Two unit masses at (x, y) and (a, b), one metre apart."""
    speeds = sum(s.diff(T) ** 2 for s in (X, Y, A, B)) / 2
    return dmoc.build(
        dmoc.MechanicalSystem(
            "dumbbell", [X, Y, A, B], speeds - G * (Y + B), {}, surfaces={"floor": Y >= 0},
            constraints={"rod": (X - A) ** 2 + (Y - B) ** 2 - 1}, **fields,
        )  # type: ignore[arg-type]
    )  # fmt: skip


def integrator(kernels: Kernels) -> tuple[Model, Integrator]:
    model = Model(kernels, parameter_row(kernels, {}))
    return model, Integrator(kernels, model.par, np.ones(2 * model.nq + 1), lambda: None)


def swing(
    kernels: Kernels, angle: float, rate: float, steps: int, **more: object
) -> dmoc.Simulation:
    s, c = np.sin(angle), np.cos(angle)
    return dmoc.simulate(
        kernels, [s, -c], [rate * c, rate * s], step_size=0.01, steps=steps, **more
    )  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.parametrize("backend", ["compiled", "numpy"])
def test_a_mass_on_a_rod_is_a_pendulum(backend: str) -> None:
    kernels = bob(backend)
    run = swing(kernels, 1.2, 0.5, 300)
    angle = solve_ivp(
        lambda t, z: [z[1], -G * np.sin(z[0])], (0, 3), [1.2, 0.5], "DOP853", run.t,
        rtol=1e-12, atol=1e-12,
    ).y  # fmt: skip
    expected = motions.columns(np.sin(angle[0]), -np.cos(angle[0]))
    np.testing.assert_allclose(run.q, expected, atol=1e-9)
    check = dmoc.verify(run.trajectory, kernels)
    assert check.passed and check.max_defect < 1e-12
    pull = -(angle[1] ** 2 + G * np.cos(angle[0]))
    np.testing.assert_allclose(run.trajectory.phases[0].reaction[:, 0], pull, rtol=1e-8)
    _, flow = integrator(kernels)
    y = np.ascontiguousarray(np.hstack([run.q, run.v]))
    rod = flow.reaction(Mode(), y, np.zeros((len(y), 0)), run.t).joint[:, 0]
    np.testing.assert_allclose(rod, pull, rtol=1e-8)


@pytest.mark.slow
def test_hundreds_of_bounces_of_a_linkage_without_drift() -> None:
    """Between two walls, so fast that in the end the clock knows a moment less well than the
    gap."""
    model = bob(surfaces={"right": X <= 0.5, "left": X >= -0.5})
    run = dmoc.simulate(model, [0, -1], [300, 0], step_size=0.002, steps=1050, every=20)
    assert len(run.collisions) >= 600
    assert np.abs((run.q**2).sum(axis=1) - 1).max() < 1e-15
    assert np.abs(run.energy / run.energy[0] - 1).max() < 1e-10


def test_forces_of_joints_are_saved_with_a_simulation(tmp_path: Path) -> None:
    run = swing(bob(surfaces={"wall": X <= 0.5}), -1.2, 0.0, 150, restitution=0.5)
    run.save(tmp_path / "run.json")
    loaded = dmoc.Simulation.load(tmp_path / "run.json").trajectory
    for phase, saved in zip(run.trajectory.phases, loaded.phases, strict=True):
        assert saved.joints == ("rod",)
        np.testing.assert_array_equal(saved.reaction, phase.reaction)
    assert loaded.collisions[0].reactions == run.trajectory.collisions[0].reactions


@pytest.mark.slow
def test_a_pendulum_hits_a_wall_with_its_rate() -> None:
    kernels = bob(surfaces={"wall": X <= 0.5})
    run = swing(kernels, -1.2, 0.0, 150, restitution=0.5)
    (hit,) = run.collisions
    rate = np.sqrt(2 * G * (np.cos(np.pi / 6) - np.cos(1.2)))  # energy of the swing
    c, s = np.cos(np.pi / 6), 0.5
    np.testing.assert_allclose(hit.momentum_before, rate * np.array([c, s]), rtol=1e-9)
    np.testing.assert_allclose(hit.momentum_after, -rate / 2 * np.array([c, s]), rtol=1e-9)
    assert hit.impulse == pytest.approx(1.5 * rate / c, rel=1e-9)  # its moment turns the rate
    (event,) = run.trajectory.collisions
    assert event.reactions["rod"] == pytest.approx(hit.impulse * s, rel=1e-9)  # none along the rod
    check = dmoc.verify(run.trajectory, kernels)
    assert check.passed and check.impact_error < 1e-12


def rests_and_falls(kernels: Kernels) -> dmoc.Simulation:
    """A dumbbell with its lower end on a smooth floor, let go at 30 degrees from upright."""
    s, c = np.sin(np.pi / 6), np.cos(np.pi / 6)
    return dmoc.simulate(kernels, [0, 0, s, c], None, step_size=0.005, steps=60, restitution=0.0)


@pytest.mark.slow
def test_a_dumbbell_slides_on_a_smooth_floor_as_it_falls() -> None:
    kernels = dumbbell()
    run = rests_and_falls(kernels)

    # The centre falls by cos(angle)/2; m = 2, and 1/2 about the centre.
    def fall(t: float, z: np.ndarray) -> list[float]:
        s, c = np.sin(z[0]), np.cos(z[0])
        return [z[1], (G * s - s * c * z[1] ** 2 / 2) / (0.5 + s**2 / 2)]

    z = solve_ivp(fall, (0, 0.3), [np.pi / 6, 0], "DOP853", run.t, rtol=1e-12, atol=1e-12).y
    np.testing.assert_allclose(run.q[:, 3], np.cos(z[0]), atol=1e-9)
    np.testing.assert_allclose(run.q[:, 0] + run.q[:, 2], 0.5, atol=1e-9)  # nothing pushes sideways
    bend = np.array([fall(0, row)[1] for row in z.T])
    centre = -(np.sin(z[0]) * bend + np.cos(z[0]) * z[1] ** 2) / 2
    np.testing.assert_allclose(run.normal[:, 0], 2 * (centre + G), rtol=1e-7)
    check = dmoc.verify(run.trajectory, kernels)
    assert check.passed and check.force_error < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("mu", [0.1, 0.9])
def test_a_dumbbell_lands_with_friction_as_a_rigid_rod(mu: float) -> None:
    kernels = dumbbell(tangents={"floor": X}, friction={"floor": mu})
    s, c = np.sin(0.4), np.cos(0.4)
    start = [0, 0, s, c], [1.0, -2.0, 1.0, -2.0]
    run = dmoc.simulate(kernels, *start, step_size=0.002, steps=2, restitution=0.5)
    (hit,) = run.collisions
    # A rod of mass 2 and 1/2 about its centre, which is (s, c)/2 beside the end that hits.
    A = np.array([[0.5 + s**2 / 2, -s * c / 2], [-s * c / 2, 0.5 + c**2 / 2]])
    law = impulses(np.array([-2.0, 1.0]), A, Coefficients(mu, 0.5))
    assert hit.impulse == pytest.approx(law.normal, rel=1e-9)
    assert hit.tractions["floor"] == pytest.approx(law.tangential, rel=1e-9)
    change = hit.momentum_after - hit.momentum_before
    np.testing.assert_allclose(change[:2] + change[2:], [law.tangential, law.normal], rtol=1e-9)
    spin = (change[2] - change[0]) * c / 2 - (change[3] - change[1]) * s / 2
    np.testing.assert_allclose(spin, (-law.tangential * c + law.normal * s) / 2, rtol=1e-9)
    assert dmoc.verify(run.trajectory, kernels).passed


@pytest.mark.slow
def test_a_dumbbell_that_lands_flat_keeps_its_rod() -> None:
    kernels = dmoc.build(
        dmoc.MechanicalSystem(
            "flat", [X, Y, A, B], sum(s.diff(T) ** 2 for s in (X, Y, A, B)) / 2 - G * (Y + B), {},
            surfaces={"left": Y >= 0, "right": B >= 0},
            constraints={"rod": (X - A) ** 2 + (Y - B) ** 2 - 1},
        )
    )  # fmt: skip
    run = dmoc.simulate(
        kernels, [0, 0.05, 1, 0.05], [0.3, -1, 0.3, -1], step_size=0.01, steps=20, restitution=0.0
    )
    np.testing.assert_allclose(run.q[-1], [0.06, 0, 1.06, 0], atol=1e-9)
    np.testing.assert_allclose(run.normal[-1], [G, G], rtol=1e-9)
    assert dmoc.verify(run.trajectory, kernels).passed


def changed(motion: Trajectory, **changes: object) -> Trajectory:
    first, *rest = motion.phases
    return replace(motion, phases=(replace(first, **changes), *rest))  # type: ignore[arg-type]


def test_a_joint_that_is_not_kept_contradicts_a_motion() -> None:
    kernels = bob()
    motion = swing(kernels, 1.2, 0.5, 100).trajectory
    assert dmoc.verify(motion, kernels).passed
    q = motion.phases[0].q.copy()
    q[40] *= 1.001
    check = dmoc.verify(changed(motion, q=q), kernels)
    assert not check.passed
    assert "the joint 'rod' is off by 0.001 at 0.4 s" in check.message
    v = motion.phases[0].v.copy()
    v[40] += 0.2 * motion.phases[0].q[40]
    check = dmoc.verify(changed(motion, v=v, p=v), kernels)
    assert not check.passed
    assert "the joint 'rod' comes apart with 0.2 at 0.4 s" in check.message


@pytest.mark.parametrize(
    ("position", "velocity", "message"),
    [
        ([0.1, -1.0], None, "position does not fit joint 'rod', which is off by 0.005"),
        ([0.0, -1.0], [1.0, 0.1], "velocity does not fit joint 'rod', which is off by -0.1"),
    ],
)
def test_a_start_that_does_not_fit_a_joint_is_refused(
    position: list[float], velocity: list[float] | None, message: str
) -> None:
    with pytest.raises(SimulationError, match=message):
        dmoc.simulate(bob(), position, velocity, step_size=0.01, steps=1)


def test_responses_and_accelerations_are_those_of_a_body_with_joints() -> None:
    model, flow = integrator(dumbbell())
    r = np.random.default_rng(1)
    q, v = r.uniform(-1, 1, (2, 5, 4))
    end = q[:, :2] - q[:, 2:]
    q[:, 2:] = q[:, :2] - end / np.linalg.norm(end, axis=1)[:, None]
    y = np.ascontiguousarray(np.hstack([q, v]))
    a = model.acceleration(q, v)
    np.testing.assert_allclose(
        a, flow.reaction(Mode(), y, np.zeros((5, 0)), np.zeros(5)).acceleration, rtol=1e-12
    )
    bend = 2 * ((q[:, :2] - q[:, 2:]) * (a[:, :2] - a[:, 2:])).sum(axis=1)
    np.testing.assert_allclose(bend, -2 * ((v[:, :2] - v[:, 2:]) ** 2).sum(axis=1), rtol=1e-12)
    responses = model.responses(q, np.tile(np.eye(4), (5, 1, 1)))
    direction = q[:, :2] - q[:, 2:]
    along = np.hstack([direction, -direction]) / np.sqrt(2)
    np.testing.assert_allclose(
        responses, np.eye(4) - along[:, :, None] * along[:, None], atol=1e-12
    )


@pytest.mark.parametrize(
    ("share", "passes"), [(1.0, True), (1.019, True), (0.981, True), (1.021, False), (0.979, False)]
)
def test_the_planned_force_of_a_joint_is_compared_with_that_of_the_flow(
    share: float, passes: bool
) -> None:
    """Along the rod of one metre g y - R - v^2 is zero."""
    kernels = bob()
    motion = swing(kernels, 1.2, 0.5, 100).trajectory
    (phase,) = motion.phases
    pull = (G * phase.q[:, 1] - (phase.v**2).sum(axis=1))[:, None]
    check = dmoc.verify(changed(motion, joints=("rod",), reaction=share * pull), kernels)
    assert check.passed is passes, check.message
    assert check.reaction_error == pytest.approx(abs(share - 1), abs=1e-9)
    assert check.force_error == 0
    with pytest.raises(SimulationError, match="reaction forces of the phase from 0 s on"):
        dmoc.verify(changed(motion, joints=("rod",), reaction=pull[1:]), kernels)
