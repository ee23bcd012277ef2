"""The check of motions with lasting contact and friction: it confirms closed forms and
independent integrations, and contradicts what is wrong in a sentence."""

from __future__ import annotations

from dataclasses import replace

import gaits
import motions
import numpy as np
import pytest
import sympy as sp
from flights import Change, event_changed, phase_changed, valued
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import SimulationError
from dmoc.codegen.kernels import Kernels
from dmoc.motion.trajectory import Trajectory

pytestmark = pytest.mark.slow


def confirmed(motion: Trajectory, kernels: Kernels) -> dmoc.check.verdict.Verification:
    check = dmoc.verify(motion, kernels)
    assert check.passed and not check.message, check.message
    return check


@pytest.mark.slow
def test_a_block_that_sticks_slides_and_sticks_on_a_rail(rail: Kernels) -> None:
    """The motion of least effort: its cost is (2/3) sqrt(6)."""
    check = confirmed(motions.pushed_block(rail, 20, on_floor=False), rail)
    for error in (check.terminal_error, check.max_defect, check.energy_error, check.force_error):
        assert error < 1e-13


@pytest.mark.slow
def test_a_block_pushed_over_a_floor(floor: Kernels) -> None:
    check = confirmed(motions.pushed_block(floor, 20, on_floor=True), floor)
    assert max(check.terminal_error, check.segment_defects.max(), check.force_error) < 1e-13


@pytest.mark.slow
def test_a_bead_in_a_bowl() -> None:
    kernels = dmoc.build(motions.bowl_system())
    check = confirmed(motions.swinging_bead(kernels, 30), kernels)
    assert max(check.terminal_error, check.energy_error, check.force_error) < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("e", [0.7, 1.0])
def test_a_hit_through_which_a_contact_stays_closed(e: float) -> None:
    kernels = dmoc.build(motions.bowl_system(-0.5))
    motion = motions.thrown_back(kernels, 30, e)
    check = confirmed(motion, kernels)
    assert max(check.terminal_error, check.impact_error, check.force_error) < 1e-8
    weaker = {"wall": 0.9 * motion.collisions[0].impulses["wall"], "bowl": 0.0}
    for wrong in (event_changed(0, impulses=weaker), event_changed(0, impulses={})):
        assert "law of impact" in dmoc.verify(wrong(motion), kernels).message


def discrete(kernels: Kernels, motion: Trajectory, steps: int) -> Trajectory:
    """The first phase of a motion by the midpoint rule with the conditions of its mode at the
    nodes, r_plus + r_minus + h C^T lam = 0, and a velocity at the end that keeps them."""
    from scipy.optimize import root

    from dmoc.mechanics.model import Model
    from dmoc.mechanics.model_values import parameter_row

    phase, model = motion.phases[0], Model(kernels, parameter_row(kernels, {}))
    h, nq, none = phase.duration / steps, model.nq, np.zeros((1, 0))
    on = [kernels.surfaces.index(name) for name in phase.closed]
    held = [kernels.tangents.index(name) for name in phase.rubbing]
    place = model.tangents(phase.q[0])

    def gradients(q: np.ndarray) -> np.ndarray:
        return np.vstack([-model.gap_slopes(q)[on, :-1], model.tangent_slopes(q)[held, :-1]])

    def off(q: np.ndarray) -> np.ndarray:
        return np.concatenate([model.gaps(q)[on], (model.tangents(q) - place)[held]])

    def step(q: np.ndarray, after: np.ndarray) -> np.ndarray:
        rows = [q[None], after[None], none, none, np.array([[h]]), np.zeros((1, 1)), none]
        return np.concatenate(model.step_momenta(rows))

    q, p, forces = [phase.q[0]], [phase.p[0]], []
    come, share = phase.p[0], 0.5
    for _ in range(steps):

        def balance(z: np.ndarray, q=q, come=come, share=share) -> np.ndarray:  # type: ignore[no-untyped-def]
            pushed = come + share * h * gradients(q[-1]).T @ z[nq:]
            return np.concatenate([pushed - step(q[-1], z[:nq])[0], off(z[:nq]) / h])

        start = np.concatenate([q[-1] + h * model.velocity(q[-1], p[-1]), np.zeros(len(on + held))])
        root_of_step = root(balance, start, tol=1e-12).x
        forces.append(root_of_step[nq:])
        if share == 1:
            p[-1] = come + h / 2 * gradients(q[-1]).T @ forces[-1]
        come, share = step(q[-1], root_of_step[:nq])[1], 1.0
        q.append(root_of_step[:nq])
        p.append(come)
    C, M = gradients(q[-1]), model.mass(q[-1])
    response = np.linalg.solve(M, C.T)
    free = model.velocity(q[-1], come)
    forces.append(-2 / h * np.linalg.solve(C @ response, C @ free))
    p[-1] = come + h / 2 * C.T @ forces[-1]
    nodes, momenta, lam = np.array(q), np.array(p), np.array(forces)
    made = replace(
        phase, t=h * np.arange(steps + 1), q=nodes, p=momenta, v=model.velocity(nodes, momenta),
        u=np.zeros((steps + 1, 0)), normal=lam[:, : len(on)], tangential=lam[:, len(on) :],
    )  # fmt: skip
    return replace(motion, phases=(made,), collisions=())


@pytest.mark.slow
@pytest.mark.parametrize("which", ["bowl", "compass"])
def test_errors_of_discrete_motions_fall_as_the_square_of_the_step(
    compass: Kernels, which: str
) -> None:
    """Segments and the end of order 2, a step of order 3; the force at an end is that of half a
    step: of order 1."""
    kernels = compass if which == "compass" else dmoc.build(motions.bowl_system())
    exact = (gaits.gait if which == "compass" else motions.swinging_bead)(kernels, 2)
    checks = [confirmed(discrete(kernels, exact, n), kernels) for n in (40, 80)]
    for value, order in (
        (lambda c: c.segment_defects.max(), 2), (lambda c: c.terminal_error, 2),
        (lambda c: c.energy_error, 2), (lambda c: c.max_defect, 3), (lambda c: c.force_error, 1),
    ):  # fmt: skip
        assert np.log2(value(checks[0]) / value(checks[1])) == pytest.approx(order, abs=0.1)


@pytest.mark.slow
def test_a_bead_that_leaves_a_ball(ball: Kernels) -> None:
    check = confirmed(motions.sliding_off(ball, 30), ball)
    assert max(check.terminal_error, check.energy_error, check.force_error) < 1e-10


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_a_block_thrown_on_a_floor(floor: Kernels, e: float) -> None:
    """It lands sliding and comes to rest, or bounces with friction after Poisson."""
    check = confirmed(motions.thrown_block(floor, 20, e), floor)
    assert max(check.terminal_error, check.energy_error, check.impact_error) < 1e-12


def test_a_landing_is_plastic_whatever_the_restitution_of_its_surface(floor: Kernels) -> None:
    """It arrives with 0.3 m/s along the floor and stops there: friction could take 0.4."""
    pieces = [
        motions.Piece(0.4, lambda t: (0.3 * t, 0.8 - 5 * t**2, 0.3, -10 * t)),
        motions.Piece(1.0, lambda t: (0.12, 0, 0, 0), None, ("floor",), {"floor": 0}, 10.0, 0.0),
    ]
    lands = {"surface": "floor", "impulse": 4.0, "tractions": {"floor": -0.3}, "lands": ("floor",)}
    lands |= {"friction": {"floor": 0}, "course": "slip+:stick"}
    motion = motions.trajectory(floor, pieces, [lands], 20, {"floor": 0.8})
    assert confirmed(motion, floor).impact_error < 1e-12


@pytest.mark.slow
def test_a_soft_landing() -> None:
    """A mass that is let down arrives without a rate, and slides on."""
    kernels = dmoc.build(motions.hoist_system())
    for steps in (10, 21):
        check = confirmed(motions.lowered_block(kernels, steps), kernels)
        assert max(check.terminal_error, check.impact_error, check.energy_error) < 1e-10


@pytest.mark.slow
def test_the_passive_compass_gait(compass: Kernels) -> None:
    """Two steps down a slope of 3 degrees, on one foot and on the other: a step takes
    0.734346391 s, and the state after the landing is that at the start with the legs exchanged."""
    motion = gaits.gait(compass, 40)
    assert motion.phases[0].duration == pytest.approx(0.734346391, abs=3e-8)
    check = confirmed(motion, compass)
    assert check.impact_error < 1e-6 and check.segment_defects.max() < 1e-10


@pytest.mark.parametrize("leaves_at", [0.6, 0.5])
def test_a_late_release_pulls(ball: Kernels, leaves_at: float) -> None:
    check = dmoc.verify(motions.sliding_off(ball, 30, leaves_at), ball)
    assert not check.passed
    assert "ball would have to pull with " in check.message


@pytest.mark.slow
def test_an_early_release_is_still_pressed(ball: Kernels) -> None:
    slightly = dmoc.verify(motions.sliding_off(ball, 30, 0.66), ball)
    assert not slightly.passed
    assert "ball leaves at 0.551 s, pressed with 0.34 N" in slightly.message
    early = dmoc.verify(motions.sliding_off(ball, 30, 0.8), ball)
    assert "a contact with 'ball'" in early.extra_contacts[0] and not early.passed


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (phase_changed(1, rubbing={"rail": -1}), "against its planned direction -1"),
        (phase_changed(1, rubbing={"rail": 0}), "'rail' has slipped by"),
        (phase_changed(0, rubbing={"rail": 1}), "segment error"),
        (phase_changed(1, tangential=lambda p: 0.9 * p.tangential), "error of a contact force"),
        (phase_changed(1, u=lambda p: 1.1 * p.u), "segment error"),
        (phase_changed(0, u=lambda p: p.u + 1.1), "rail would have to stick with 1.1 N at 0 s"),
        (phase_changed(1, rubbing={}, tangential=np.zeros((0, 0))), "friction of 'rail' is left"),
        (phase_changed(1, v=lambda p: p.v + 0.1, p=lambda p: p.p + 0.1), "segment error"),
        (valued(f=0.9), "segment error"),
    ],
)
def test_wrong_motions_on_a_rail_are_contradicted(rail: Kernels, change: Change, text: str) -> None:
    check = dmoc.verify(change(motions.pushed_block(rail, 20, on_floor=False)), rail)
    assert not check.passed and text in check.message


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (phase_changed(1, normal=lambda p: 0.9 * p.normal), "error of a contact force 0.1"),
        (phase_changed(1, normal=lambda p: -p.normal), "floor would have to pull with 10 N at"),
        (phase_changed(1, rubbing={"floor": -1}), "against its planned direction -1"),
        (phase_changed(1, closed=(), normal=np.zeros((0, 0))), "'floor' rubs from 0.775"),
        (valued(mu=0.09), "segment error"),
        (
            valued(g=-10.0),
            "floor would have to pull",
        ),
    ],
)
def test_wrong_motions_on_a_floor_are_contradicted(
    floor: Kernels, change: Change, text: str
) -> None:
    check = dmoc.verify(change(motions.pushed_block(floor, 20, on_floor=True)), floor)
    assert not check.passed and text in check.message


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (event_changed(0, impulse=3.0), "law of impact"),
        (event_changed(0, tractions={"floor": -0.5}), "law of impact"),
        (event_changed(0, tractions={}), "law of impact"),
        (event_changed(0, lands=()), "the contacts closed after what happens at 0.4 s are none"),
        (phase_changed(1, rubbing={"floor": -1}), "does not slide with the sign -1 after 0.4 s"),
        (phase_changed(2, rubbing={"floor": -1}), "segment error"),
        (valued(mu=0.2), "law of impact"),
    ],
)
def test_wrong_landings_are_contradicted(floor: Kernels, change: Change, text: str) -> None:
    check = dmoc.verify(change(motions.thrown_block(floor, 20, 0.0)), floor)
    assert not check.passed and text in check.message


def test_a_bounce_without_its_friction_is_contradicted(floor: Kernels) -> None:
    good = motions.thrown_block(floor, 20, 0.5)
    for wrong in (
        event_changed(0, tractions={})(good),
        replace(good, restitution={"floor": 0.6}),
        valued(mu=0.2)(good),
    ):
        assert not dmoc.verify(wrong, floor).passed


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (valued(mu=0.1), "left would have to stick with "),
        (event_changed(0, impulse=1.0, impulses={}), "law of impact"),
        (
            event_changed(0, leaves=()),
            "the contacts closed after what happens at 0.7343 s are left",
        ),
        (phase_changed(1, closed=("left",), rubbing={"left": 0}), "the contacts closed after"),
    ],
)
def test_wrong_gaits_are_contradicted(compass: Kernels, change: Change, text: str) -> None:
    check = dmoc.verify(change(gaits.gait(compass, 20)), compass)
    assert not check.passed and text in check.message


@pytest.mark.slow
def test_sliding_that_jams_is_no_motion() -> None:
    """A rod that is pushed ahead of its contact: the force of the floor would press the contact
    together (Painleve's paradox)."""
    x, y, a = dynamicsymbols("x y a")
    t = dynamicsymbols._t
    system = dmoc.MechanicalSystem(
        "painleve", [x, y, a],
        (x.diff(t) ** 2 + y.diff(t) ** 2) / 2 + a.diff(t) ** 2 / 24 - sp.Symbol("g") * y,
        {sp.Symbol("g"): 10.0}, surfaces={"floor": y >= sp.sin(a) / 2},
        tangents={"floor": x - sp.cos(a) / 2}, friction={"floor": 3.0},
    )  # fmt: skip
    kernels = dmoc.build(system)

    piece = motions.Piece(
        0.1, lambda t: (-t, 0.5 * np.sin(1.0), 1.0, -1, 0, 0), None, ("floor",), {"floor": -1},
        1.0, 1.0,
    )  # fmt: skip
    check = dmoc.verify(motions.trajectory(kernels, [piece], [], 4), kernels)
    assert not check.passed and "Painleve's paradox" in check.message


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (phase_changed(1, closed=("ceiling",)), "unknown closed surface 'ceiling'"),
        (phase_changed(1, rubbing={"wall": 1}), "unknown rubbing tangent 'wall'"),
        (phase_changed(1, normal=np.zeros((0, 0))), r"normal forces of the phase from 0.7753 s on"),
    ],
)
def test_forces_that_do_not_fit_are_refused(floor: Kernels, change: Change, text: str) -> None:
    with pytest.raises(SimulationError, match=text):
        dmoc.verify(change(motions.pushed_block(floor, 20, on_floor=True)), floor)


def test_between_two_inputs_every_force_between_theirs_is_right(rail: Kernels) -> None:
    """A block held by a rail under a push that jumps from step to step."""
    u = np.array([[0.2], [0.8], [0.2], [0.8]])
    still = motions.Piece(
        1.0, lambda t: (0.3, 0), None, (), {"rail": 0}, None,
        lambda t: np.array([[-0.2], [-0.5], [-0.5], [-0.5], [-0.8]]),
    )  # fmt: skip
    motion = replace(motions.trajectory(rail, [still], [], 4), controls="constant")
    motion = phase_changed(0, u=u)(motion)
    assert confirmed(motion, rail).force_error == 0
    wrong = phase_changed(0, tangential=lambda p: p.tangential - 0.4)(motion)
    check = dmoc.verify(wrong, rail)
    assert not check.passed and "error of a contact force" in check.message
    beyond = dmoc.verify(phase_changed(0, u=1.5 * u)(motion), rail)
    assert "rail would have to stick with 1.2 N at 0.25 s, where it holds 1 N" in beyond.message


@pytest.mark.parametrize("mu", [0.4, 0.6, 1.0])
def test_friction_that_both_ends_of_a_rod_could_bear_is_borne_where_it_lands(mu: float) -> None:
    """One end stands, the other falls and lands: only that is pressed, so that it alone has
    friction, though as far as the rod is concerned either end could hold it back."""
    x, y, a = dynamicsymbols("x y a")
    ends = (x, y), (x + sp.sin(a), y + sp.cos(a))
    speeds = sum(s.diff(dynamicsymbols._t) ** 2 for s in (*ends[0], *ends[1]))
    system = dmoc.MechanicalSystem(
        "falling_rod", [x, y, a], speeds / 2 - 9.81 * (ends[0][1] + ends[1][1]), {},
        surfaces={"foot": y >= 0, "end": ends[1][1] >= 0}, tangents={"foot": x, "end": ends[1][0]},
        friction={"foot": mu, "end": mu},
    )  # fmt: skip
    kernels = dmoc.build(system, backend="numpy")
    run = dmoc.simulate(kernels, [0, 0, 0.4], None, step_size=0.01, steps=80, restitution=0.0)
    (landing,) = run.collisions
    assert landing.tractions["end"] < -0.1 * mu and not landing.tractions.get("foot")
    check = dmoc.verify(run.trajectory, kernels)
    assert check.passed, check.message
