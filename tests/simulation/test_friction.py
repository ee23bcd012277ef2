"""Forward simulation through lasting contact and friction: closed forms."""

from __future__ import annotations

import motions
import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols
from systems import block_on_floor, landing_system

import dmoc
from dmoc.base.errors import SimulationError
from dmoc.codegen.kernels import Kernels
from dmoc.mechanics.contact_mode import Mode
from dmoc.mechanics.model import Model
from dmoc.mechanics.model_values import parameter_row
from dmoc.simulation.mode_choice import is_borne

T = dynamicsymbols._t
x, y, a = dynamicsymbols("x y a")
g, mu, k, f, w, l = sp.symbols("g mu k f w l")


def test_a_block_on_a_rail_slides_to_rest(rail: Kernels) -> None:
    """From 1.3 m/s with 1 m/s^2: 1.3 s, 0.845 m."""
    run = dmoc.simulate(rail, [0.0], [1.3], step_size=0.07, steps=30)
    assert run.q[-1, 0] == pytest.approx(1.3**2 / 2, rel=1e-12) and abs(run.p[-1, 0]) < 1e-15
    slides, sticks = run.rubbing
    assert (slides.name, slides.friction, sticks.friction) == ("rail", 1, 0)
    assert slides.end == sticks.begin == pytest.approx(1.3, rel=1e-12)
    assert run.tangential[5, 0] == pytest.approx(-1) and run.tangential[-1, 0] == 0


def test_a_push_below_the_friction_moves_nothing(rail: Kernels) -> None:
    held = dmoc.simulate(rail, [0.0], step_size=0.1, steps=10, inputs=[-0.99])
    assert not held.q.any() and held.tangential[-1, 0] == pytest.approx(0.99)
    pushed = dmoc.simulate(rail, [0.0], step_size=0.1, steps=10, inputs=[-1.5])
    assert pushed.q[-1, 0] == pytest.approx(-0.25, rel=1e-12)


@pytest.mark.parametrize(
    ("pushes", "holds", "borne"),
    [
        (10.0, 0.99, True),
        (10.0, 1.01, False),
        (10.0, -0.99, True),
        (10.0, -1.01, False),
        (-1e-3, 0.0, False),
    ],
)
def test_a_contact_bears_what_its_cone_does(
    floor: Kernels, pushes: float, holds: float, borne: bool
) -> None:
    """mu = 0.1."""
    model = Model(floor, parameter_row(floor, {}))
    forces, least = (np.array([pushes]), np.array([holds])), np.full(1, 1e-6)
    assert is_borne(model, Mode((0,), (0,)), forces, least, least) is borne


def test_a_block_on_a_floor_slides_to_rest(floor: Kernels) -> None:
    run = dmoc.simulate(floor, [0.0, 0.0], [-1.3, 0.0], step_size=0.07, steps=30)
    assert run.q[-1] == pytest.approx([-(1.3**2) / 2, 0], rel=1e-12)
    assert run.normal == pytest.approx(np.full((31, 1), 10.0))
    assert [s.friction for s in run.rubbing] == [-1, 0]
    assert run.rubbing[0].end == pytest.approx(1.3, rel=1e-12)
    assert not run.collisions and [s.name for s in run.contacts] == ["floor"]


@pytest.mark.parametrize("e", [0.0, 0.5])
def test_a_thrown_block_comes_to_rest(floor: Kernels, e: float) -> None:
    """It loses mu (1 + e) times the speed of each landing, then mu g: on the whole the momentum
    that friction takes is mu times that of the floor, as if it lay there all along."""
    run = dmoc.simulate(floor, [0.0, 0.8], [2.0, 0.0], step_size=0.04, steps=60, restitution=e)
    assert run.contacts[0].begin == pytest.approx(0.4 * (1 + e) / (1 - e), abs=1e-5)
    assert run.rubbing[0].end == pytest.approx(2.0, rel=1e-9)
    first = run.collisions[0]
    assert first.tractions == {"floor": pytest.approx(-0.1 * 4 * (1 + e))}
    assert (first.rate_before, first.rate_after) == pytest.approx((4, -4 * e), abs=1e-9)
    assert (run.p[-1] == pytest.approx([0, 0], abs=1e-14)) and run.q[-1, 1] == pytest.approx(0)
    assert (np.diff(run.energy) <= 1e-12).all()


def test_driessens_problem(rail: Kernels) -> None:
    """q'' = u - sgn q', |u| <= 2, from (0, 1) to (-1, 0) in 1/3 + 2 sqrt(7)/3 s: first backwards
    for sqrt(7)/2 s after the stop, then forwards."""
    brake, late = 1 / 3 + np.sqrt(7) / 2, np.sqrt(7) / 6
    first = dmoc.simulate(rail, [0.0], [1.0], step_size=brake / 10, steps=10, inputs=[-2.0])
    assert first.rubbing[0].end == pytest.approx(1 / 3, rel=1e-12)
    last = dmoc.simulate(
        rail, first.q[-1], first.p[-1], step_size=late / 10, steps=10, inputs=[2.0]
    )
    assert last.q[-1, 0] == pytest.approx(-1, abs=1e-12)
    assert last.p[-1, 0] == pytest.approx(0, abs=1e-12)
    assert brake + late == pytest.approx(2.0971675407, abs=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize(("inertia", "share"), [(2 / 5, 5 / 7), (1 / 2, 2 / 3)])
def test_a_ball_thrown_on_a_floor_rolls_in_the_end(inertia: float, share: float) -> None:
    """A ball keeps 5/7 of its speed, a disc 2/3."""
    kinetic = (x.diff(T) ** 2 + y.diff(T) ** 2) / 2 + k * a.diff(T) ** 2 / 2
    system = dmoc.MechanicalSystem(
        "rolling", [x, y, a], kinetic - g * y, {g: 9.81, k: 0.4, mu: 0.3},
        surfaces={"floor": y >= 1}, tangents={"floor": x + a}, friction={"floor": mu},
    )  # fmt: skip
    run = dmoc.simulate(
        dmoc.build(system), [0, 1.05, 0], [1.0, 0, 0], step_size=0.02, steps=60,
        restitution=0.3, parameters={"k": inertia},
    )  # fmt: skip
    assert run.p[-1, 0] == pytest.approx(share, rel=1e-9)
    assert run.p[-1] == pytest.approx([share, 0, -share * inertia], abs=1e-9)
    assert run.rubbing[-1].friction == 0 and run.contacts[-1].end == pytest.approx(1.2)


@pytest.mark.slow
def test_a_block_on_a_belt_sticks_and_slips() -> None:
    """A block on a spring is carried by a belt until the spring pulls with F; it then swings about
    F / k with the amplitude v / omega."""
    F, v, stiff = 2.0, 0.5, 16.0
    t = dynamicsymbols._t
    system = dmoc.MechanicalSystem(
        "belt", [x], x.diff(t) ** 2 / 2 - k * x**2 / 2, {k: stiff, f: F, w: v},
        tangents={"belt": x - w * t}, friction={"belt": f},
    )  # fmt: skip
    run = dmoc.simulate(dmoc.build(system), [0.0], [v], step_size=0.05, steps=30)
    slips = F / (stiff * v)
    omega = np.sqrt(stiff)
    exact = np.where(
        run.t < slips, v * run.t, F / stiff + v / omega * np.sin(omega * (run.t - slips))
    )
    assert [s.friction for s in run.rubbing] == [0, -1]
    assert run.rubbing[0].end == pytest.approx(slips, rel=1e-8)
    assert run.q[:, 0] == pytest.approx(exact, abs=1e-10)


@pytest.mark.slow
def test_a_rimless_wheel_takes_a_step() -> None:
    """Spokes 2 alpha apart with a mass m = 1 and an inertia I = 1/2 at the hub: the foot behind
    takes no impulse, and w+ = (I + m l^2 cos 2 alpha) / (I + m l^2) w-."""
    alpha, slope, inertia = 0.3, 0.1, 0.5
    feet = {
        name: (x + sp.sin(a + side), y - sp.cos(a + side))
        for name, side in (("back", -alpha), ("front", alpha))
    }
    system = dmoc.MechanicalSystem(
        "rimless", [x, y, a],
        (x.diff(T) ** 2 + y.diff(T) ** 2 + inertia * a.diff(T) ** 2) / 2
        - g * (y * sp.cos(slope) - x * sp.sin(slope)),
        {g: 9.81, mu: 5.0},
        surfaces={name: place[1] >= 0 for name, place in feet.items()},
        tangents={name: place[0] for name, place in feet.items()},
        friction={"back": mu, "front": mu},
    )  # fmt: skip
    begin, rate = alpha - 0.05, -1.0
    lean = begin - alpha
    run = dmoc.simulate(
        dmoc.build(system), [-np.sin(lean), np.cos(lean), begin],
        [-rate * np.cos(lean), -rate * np.sin(lean), rate], step_size=0.02, steps=25,
        restitution=0.0,
    )  # fmt: skip
    (landing,) = run.collisions
    assert landing.surface == "front" and landing.lands == ("front",)
    before, after = (m[2] / inertia for m in (landing.momentum_before, landing.momentum_after))
    # The energy above the foot: (I + 1) w^2 / 2 + g cos(angle of the leg from the vertical).
    gained = 9.81 * (np.cos(lean - slope) - np.cos(-alpha - slope))
    assert before == pytest.approx(-np.sqrt(rate**2 + 2 * gained / (1 + inertia)), rel=1e-9)
    share = (inertia + np.cos(2 * alpha)) / (inertia + 1)
    assert after == pytest.approx(share * before, rel=1e-9)
    back = next(s for s in run.contacts if s.name == "back")
    assert back.end == landing.time


def test_a_bead_leaves_a_ball() -> None:
    """Where the cosine of its angle is 2/3 of that where it started from rest."""
    run = dmoc.simulate(
        dmoc.build(motions.ball_system()), [np.sin(0.3), np.cos(0.3)], step_size=0.02, steps=35
    )
    (contact,) = run.contacts
    motion = motions.sliding_off(dmoc.build(motions.ball_system()), 10)
    assert contact.end == pytest.approx(motion.phases[0].t[-1], rel=1e-8)
    assert np.ptp(run.energy) < 1e-9


@pytest.mark.slow
def test_a_landing_between_friction_and_a_smooth_wall(floor: Kernels) -> None:
    """A block slides along a floor against a wall without friction, which throws it back."""
    walls = {"floor": y >= 0, "wall": x <= 0.48}
    system = block_on_floor("cornered", 1.0, 10.0, 0.1, surfaces=walls)
    run = dmoc.simulate(dmoc.build(system), [0, 0], [1.0, 0], step_size=0.1, steps=15)
    (hit,) = run.collisions
    assert hit.surface == "wall" and hit.impulse == pytest.approx(2 * np.sqrt(1 - 0.96))
    assert run.q[-1] == pytest.approx([0.48 - 0.02, 0], abs=1e-12)


@pytest.mark.slow
def test_a_rough_rod_falls_flat() -> None:
    """It loses mu times the impulse of the floor."""
    ends = {"left": y - sp.sin(a) / 2, "right": y + sp.sin(a) / 2}
    system = dmoc.MechanicalSystem(
        "rough_rod", [x, y, a],
        (x.diff(T) ** 2 + y.diff(T) ** 2) / 2 + a.diff(T) ** 2 / 24 - g * y, {g: 9.81, mu: 0.2},
        surfaces={name: height >= 0 for name, height in ends.items()},
        tangents={"left": x - sp.cos(a) / 2, "right": x + sp.cos(a) / 2},
        friction={"left": mu, "right": mu},
    )  # fmt: skip
    kernels = dmoc.build(system)
    fallen = np.sqrt(0.2 * 9.81)
    run = dmoc.simulate(kernels, [0, 0.1, 0], [0.8, 0, 0], step_size=0.01, steps=20)
    assert run.p[-1] == pytest.approx(
        [0.8 - 0.2 * 2 * fallen, fallen - 9.81 * (0.2 - fallen / 9.81), 0], abs=1e-9
    )
    run = dmoc.simulate(
        kernels, [0, 0.1, 0], [0.8, 0, 0], step_size=0.01, steps=60, restitution=0.0
    )
    assert run.q[-1, 1:] == pytest.approx([0, 0], abs=1e-12)
    lost = 0.2 * (fallen + 9.81 * (0.6 - fallen / 9.81))
    assert run.p[-1, 0] == pytest.approx(max(0.8 - lost, 0), abs=1e-9)


@pytest.mark.slow
def test_a_contact_that_jams_is_told() -> None:
    """Painleve's rod, sliding ahead of its contact with much friction."""
    system = dmoc.MechanicalSystem(
        "jamming", [x, y, a],
        (x.diff(T) ** 2 + y.diff(T) ** 2) / 2 + a.diff(T) ** 2 / 24 - g * y, {g: 10.0, mu: 3.0},
        surfaces={"floor": y >= sp.sin(a) / 2}, tangents={"floor": x - sp.cos(a) / 2},
        friction={"floor": mu},
    )  # fmt: skip
    with pytest.raises(SimulationError, match="Painleve's paradox"):
        dmoc.simulate(
            dmoc.build(system), [0, np.sin(1.0) / 2, 1.0], [-1, 0, 0], step_size=0.01, steps=3
        )


def test_a_start_behind_a_surface_is_refused(floor: Kernels) -> None:
    with pytest.raises(SimulationError, match="lies behind surface 'floor'"):
        dmoc.simulate(floor, [0.0, -0.1], step_size=0.1, steps=1)


@pytest.mark.parametrize("e", [0.5, 1.0])
def test_a_contact_under_load_stays_closed_when_another_is_hit(e: float) -> None:
    """A bead that comes down in a bowl against a wall goes back up along the bowl."""
    kernels = dmoc.build(motions.bowl_system(-0.5))
    motion = motions.thrown_back(kernels, 10, e)
    run = dmoc.simulate(
        kernels, [-1.0, 0.5], step_size=0.05, steps=14, restitution={"wall": e, "bowl": 1.0}
    )
    assert {c.surface: c.impulse for c in run.collisions} == pytest.approx(
        dict(motion.collisions[0].impulses), rel=1e-9
    )
    assert [s.name for s in run.contacts] == ["bowl"]
    assert run.q[:, 1] == pytest.approx(run.q[:, 0] ** 2 / 2, abs=1e-12)


@pytest.mark.slow
def test_a_mass_that_vanishes_under_friction_is_told() -> None:
    system = dmoc.MechanicalSystem(
        "vanishing", [x], x * x.diff(T) ** 2 / 2, {f: 0.1}, tangents={"rail": x},
        friction={"rail": f},
    )  # fmt: skip
    with pytest.raises(SimulationError, match="mass matrix"):
        dmoc.simulate(dmoc.build(system), [0.5], [-1.0], step_size=0.1, steps=20)


def test_numpy_kernels_go_the_same_way() -> None:
    runs = [
        dmoc.simulate(
            dmoc.build(landing_system(), backend=backend), [0.0, 0.8], [2.0, 0.0],
            step_size=0.1, steps=15, restitution=0.5,
        )
        for backend in ("compiled", "numpy")
    ]  # fmt: skip
    assert runs[0].q == pytest.approx(runs[1].q, abs=1e-12)
    assert len(runs[0].collisions) == len(runs[1].collisions)
