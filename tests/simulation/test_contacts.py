"""Impacts on several surfaces at once, lasting contact, bounces that die away, and units: known
answers of the simulation."""

from __future__ import annotations

import itertools
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import SimulationError
from dmoc.codegen.kernels import Kernels
from dmoc.mechanics.model import Model
from dmoc.mechanics.model_values import parameter_row
from dmoc.results.simulation import Simulation
from dmoc.simulation.impact_course import blow_on
from dmoc.simulation.mode_choice import Place
from dmoc.simulation.simultaneous_impacts import simultaneous

T = dynamicsymbols._t
x, y, z, a, b = dynamicsymbols("x y z a b")
m, M, g, l, room, stop = sp.symbols("m M g l room stop")


def free(*coordinates: sp.Expr) -> sp.Expr:
    return sum(m * c.diff(T) ** 2 / 2 for c in coordinates)


@pytest.fixture(scope="module")
def corner() -> Kernels:
    return dmoc.build(
        dmoc.MechanicalSystem(
            "corner", [x, y], free(x, y), {m: 1.0}, surfaces={"right": x <= 1, "top": y <= 1}
        )
    )


@pytest.fixture(scope="module")
def rod() -> Kernels:
    """A uniform rod of unit length and mass over a floor: the ends and the middle, so that a
    flat landing is on three points."""
    lagrangian = free(x, y) + m * a.diff(T) ** 2 / 24 - m * g * y
    ends = {"left": y - sp.sin(a) / 2 >= 0, "right": y + sp.sin(a) / 2 >= 0}
    return dmoc.build(
        dmoc.MechanicalSystem("rod", [x, y, a], lagrangian, {m: 1.0, g: 9.81}, surfaces=ends)
    )


@pytest.fixture(scope="module")
def cradle() -> Kernels:
    touching = {"xy": x + 1 <= y, "yz": y + 1 <= z}
    return dmoc.build(
        dmoc.MechanicalSystem("cradle", [x, y, z], free(x, y, z), {m: 1.0}, surfaces=touching)
    )


@pytest.fixture(scope="module")
def ball() -> Kernels:
    falling = free(x) - m * g * x
    return dmoc.build(
        dmoc.MechanicalSystem(
            "ball", [x], falling, {m: 1.0, g: 9.81, room: 0.0}, surfaces={"floor": x >= room}
        ),
        order=4,
    )


def jumps(run: Simulation) -> list[tuple[str, float]]:
    return [(c.surface, pytest.approx(c.impulse, abs=1e-9)) for c in run.collisions]


@pytest.mark.parametrize("h", [0.01, 0.1, 0.3])
@pytest.mark.parametrize("e", [1.0, 0.5, 0.0])
def test_a_corner_throws_both_components_back(corner: Kernels, e: float, h: float) -> None:
    run = dmoc.simulate(
        corner, [0, 0.5], [1, 0.5], step_size=h, steps=round(1.8 / h), restitution=e
    )
    assert jumps(run) == [("right", 1 + e), ("top", (1 + e) / 2)]
    assert [c.time for c in run.collisions] == pytest.approx([1, 1], abs=1e-12)
    assert run.p[-1] == pytest.approx([-e, -e / 2], abs=1e-12)
    after = run.t[-1] - 1
    assert run.q[-1] == pytest.approx([1 - e * after, 1 - e * after / 2], abs=1e-9)


def test_the_coefficients_of_a_corner_may_differ(corner: Kernels) -> None:
    run = dmoc.simulate(
        corner, [0, 0], [1, 1], step_size=0.1, steps=15, restitution={"right": 0.0, "top": 0.5}
    )
    assert run.p[-1] == pytest.approx([0, -0.5], abs=1e-12)


def test_a_blow_releases_what_is_approached(corner: Kernels) -> None:
    """With e = 0.5 on the right, plastic at the top: m e v beyond what stops; what is left already
    gets nothing."""
    model, small = Model(corner, parameter_row(corner, {})), np.full(2, 1e-9)
    tolerances: Any = SimpleNamespace(rate=small, slide=np.zeros(0))
    for right, impulse in ((2.0, 3.0), (-2.0, 0.0)):
        at = Place(0.0, np.array([1.0, 1.0, right, 0.4]), np.zeros(0), tolerances)
        blow = blow_on(model, at, [0, 1], np.array([0.5, 0.0]))
        assert blow is not None and blow.normal == pytest.approx([impulse, 0.4], abs=1e-12)
        assert blow.velocity == pytest.approx([right - impulse, 0.0], abs=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("e", [1.0, 0.8, 0.1, 0.0])
def test_an_acute_corner_with_coupled_masses_is_left(e: float) -> None:
    """Elastic impacts keep the energy, others never add to it, and no surface is approached at
    the end."""
    coupled = free(x, y) + m * x.diff(T) * y.diff(T) / 3
    walls = {"up": y <= x / 4, "down": y >= -x / 4}
    kernels = dmoc.build(dmoc.MechanicalSystem("acute", [x, y], coupled, {m: 1.0}, surfaces=walls))
    run = dmoc.simulate(kernels, [1, 0], [-1, 0], step_size=0.03, steps=60, restitution=e)
    energies = energies_of(run.collisions, np.array([[1, 1 / 3], [1 / 3, 1]]))
    assert len(run.collisions) > 1 and energies[0] == pytest.approx(0.5)
    # Both act together: in between, the energy has no meaning.
    assert energies[-1] <= energies[0] * (1 + 1e-12)
    assert bool(energies[-1] > energies[0] * (1 - 1e-12)) is (e == 1)
    assert run.energy[-1] <= 0.5 * (1 + 1e-12)
    assert (np.abs(run.q[:, 1]) <= run.q[:, 0] / 4 + 1e-12).all()
    assert all(c.impulse > 0 for c in run.collisions)


def energies_of(
    collisions: tuple[dmoc.motion.trajectory.Collision, ...], mass: np.ndarray
) -> list[float]:
    """Kinetic energy before the first and after every collision."""
    momenta = [collisions[0].momentum_before, *(c.momentum_after for c in collisions)]
    return [float(p @ np.linalg.solve(mass, p)) / 2 for p in momenta]


@pytest.mark.slow
def test_a_rod_that_lands_flat_bounces_flat(rod: Kernels) -> None:
    """The ends are struck in turn, left, right, left, with m w / 2, m w, m w / 2: together they
    turn the speed w round."""
    run = dmoc.simulate(rod, [0, 1, 0], [0.3, 0, 0], step_size=0.01, steps=90)
    w = np.sqrt(2 * 9.81)
    assert jumps(run) == [("left", w / 2), ("right", w), ("left", w / 2)]
    assert run.energy[-1] == pytest.approx(run.energy[0], rel=1e-12)
    assert run.q[-1, 2] == pytest.approx(0, abs=1e-9) and run.q[-1, 0] == pytest.approx(0.27)


@pytest.mark.slow
def test_a_rod_that_lands_flat_and_plastically_stays(rod: Kernels) -> None:
    w = np.sqrt(2 * 9.81)
    until = dmoc.simulate(
        rod, [0, 1, 0], [0.3, 0, 0], step_size=np.sqrt(2 / 9.81) / 10, steps=10, restitution=0.0
    )
    assert until.p[-1] == pytest.approx([0.3, -w, 0])
    run = dmoc.simulate(rod, [0, 1, 0], [0.3, 0, 0], step_size=0.01, steps=90, restitution=0.0)
    assert run.q[-1] == pytest.approx([0.27, 0, 0], abs=1e-12)
    assert run.p[-1] == pytest.approx([0.3, 0, 0], abs=1e-12)
    assert run.normal[-1] == pytest.approx([9.81 / 2] * 2)
    assert {s.name for s in run.contacts} == {"left", "right"}


@pytest.mark.slow
def test_the_last_ball_of_a_cradle_flies_off(cradle: Kernels) -> None:
    run = dmoc.simulate(cradle, [0, 2, 3], [1, 0, 0], step_size=0.03, steps=60)
    assert jumps(run) == [("xy", 1.0), ("yz", 1.0)]
    assert run.p[-1] == pytest.approx([0, 0, 1], abs=1e-12) and run.q[-1] == pytest.approx(
        [1, 2, 3.8]
    )


@pytest.mark.slow
def test_bodies_that_collide_plastically_go_on_together(cradle: Kernels) -> None:
    run = dmoc.simulate(cradle, [0, 2, 3], [1, 0, 0], step_size=0.03, steps=60, restitution=0.0)
    assert jumps(run) == [("xy", 2 / 3), ("yz", 1 / 3)]
    assert run.p[-1] == pytest.approx([1 / 3] * 3)


@pytest.mark.slow
def test_a_cradle_of_pendulums_passes_the_swing_on_and_back() -> None:
    swinging = sum(m * l**2 * c.diff(T) ** 2 / 2 + m * g * l * sp.cos(c) for c in (x, y, z))
    system = dmoc.MechanicalSystem(
        "swinging", [x, y, z], swinging, {m: 1.0, l: 1.0, g: 9.81},
        surfaces={"xy": x <= y, "yz": y <= z},
    )  # fmt: skip
    run = dmoc.simulate(dmoc.build(system), [-0.5, 0, 0], step_size=0.01, steps=1000)
    assert [c.surface for c in run.collisions] == ["xy", "yz", "yz", "xy"] * 5
    assert [c.impulse for c in run.collisions] == pytest.approx(
        [np.sqrt(2 * 9.81 * (1 - np.cos(0.5)))] * 20, rel=1e-4
    )
    assert np.abs(run.q[:, 1]).max() < 1e-9


@pytest.mark.parametrize("e", [0.01, 0.3, 0.7])
@pytest.mark.parametrize(("h", "floor"), [(0.01, 0.0), (0.01, 100.0), (0.1, 1.0)])
def test_bounces_die_away_in_lasting_contact(
    ball: Kernels, floor: float, e: float, h: float
) -> None:
    """They end at t_1 (1 + e) / (1 - e)."""
    end = np.sqrt(1.6 / 9.81) * (1 + e) / (1 - e)
    run = dmoc.simulate(
        ball, [floor + 0.8], step_size=h, steps=round((end + 0.2) / h), restitution=e,
        parameters={"room": floor},
    )  # fmt: skip
    (contact,) = run.contacts
    assert contact.begin == pytest.approx(end, rel=2e-4)
    assert run.q[-1, 0] == pytest.approx(floor, abs=1e-12) and run.p[-1, 0] == 0
    assert run.normal[-1] == pytest.approx([9.81])


@pytest.mark.parametrize("h", [0.001, 0.01, 0.1])
def test_one_plastic_impact_under_a_steady_push_is_lasting_contact(ball: Kernels, h: float) -> None:
    run = dmoc.simulate(ball, [0.8], step_size=h, steps=round(0.6 / h), restitution=0.0)
    (contact,), (landing,) = run.contacts, run.collisions
    assert contact.begin == landing.time == pytest.approx(np.sqrt(1.6 / 9.81), rel=1e-12)
    assert landing.lands == ("floor",)
    assert landing.impulse == pytest.approx(np.sqrt(1.6 * 9.81), rel=1e-9)


@pytest.mark.slow
def test_elastic_impacts_that_come_to_no_end_are_told() -> None:
    """A wedge of a millionth: three million impacts would turn the motion round."""
    slim = {"up": y <= x / 1_000_000, "down": y >= -x / 1_000_000}
    kernels = dmoc.build(dmoc.MechanicalSystem("slim", [x, y], free(x, y), {m: 1.0}, surfaces=slim))
    with pytest.raises(
        SimulationError, match=r"impacts on surfaces 'up', 'down' at t = 1 s come to no end"
    ):
        dmoc.simulate(kernels, [1, 0], [-1, 0], step_size=0.03, steps=60)


def test_plastic_impacts_do_not_pull() -> None:
    """Of three points of a plate only the outer ones carry, where the middle one would have to
    pull."""
    response = np.array([[4.0, 1.0, -2.0], [1.0, 1.0, 1.0], [-2.0, 1.0, 4.0]])
    rates = np.array([1.0, 1.0, 1.0])
    hits = simultaneous(np.zeros(3), np.full(3, 1e-13), rates, rates, response, np.zeros(3), 0.0)
    assert hits is not None and all(impulse > 0 for _, impulse in hits.impulses)
    surfaces, impulses = zip(*hits.impulses, strict=True)
    after = rates - response @ np.bincount(surfaces, impulses, 3)
    assert after == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("order", [[0, 1], [1, 0]])
def test_impacts_of_which_the_order_decides_are_one(order: list[int]) -> None:
    """1 m/s and 1.5 m/s against A = ((1, 1/2), (1/2, 4)): 2 A^-1 n at once; the first one first
    takes 2 and leaves 0.5 m/s of the other, which takes 0.75 first and leaves 0.625 m/s."""
    response, width = np.array([[1.0, 0.5], [0.5, 4.0]]), np.full(2, 1e-13)
    rates, blows = np.array([1.0, 1.5])[order], response[np.ix_(order, order)]
    hits = simultaneous(np.zeros(2), width, rates, rates, blows, np.ones(2), 0.0)
    assert hits is not None
    assert {order[j]: impulse for j, impulse in hits.impulses} == {
        0: pytest.approx(26 / 15), 1: pytest.approx(8 / 15)
    }  # fmt: skip
    first = {order[j]: sums[order].tolist() for j, sums in hits.orders}
    assert first == {0: pytest.approx([2.0, 0.25]), 1: pytest.approx([1.25, 0.75])}


def test_the_hardest_impact_comes_first_though_another_is_faster() -> None:
    """1 m/s against an inertia of 1 is harder than 1.5 m/s against one of 4, and neither changes
    the other."""
    response, rates, width = np.diag([4.0, 1.0]), np.array([1.5, 1.0]), np.full(2, 1e-13)
    hits = simultaneous(np.zeros(2), width, rates, rates, response, np.ones(2), 0.0)
    assert hits is not None and not hits.orders
    assert hits.impulses == [(1, pytest.approx(2.0)), (0, pytest.approx(0.75))]


@pytest.mark.parametrize("v", [1.0, -1.0])
def test_a_hit_within_a_step_that_leaves_the_surface_again(v: float) -> None:
    """x = t, and a wall that it is ahead of for 9 ms of a step of 0.1 s, while none of its quarters
    sees it: from t = 0.0125 - sqrt(2e-5) s on."""
    t = dynamicsymbols._t
    bulge = t - sp.Rational(1, 10**5) + (t - sp.Rational(1, 80)) ** 2 / 2
    wall = x <= bulge if v > 0 else x >= -bulge
    kernels = dmoc.build(
        dmoc.MechanicalSystem(
            f"bulge_{v > 0}", [x], x.diff(T) ** 2 / 2, {}, surfaces={"wall": wall}
        )
    )
    run = dmoc.simulate(kernels, [0.0], [v], step_size=0.1, steps=1, restitution=1.0)
    assert run.collisions[0].time == pytest.approx(0.0125 - np.sqrt(2e-5), abs=1e-9)


# Units --------------------------------------------------------------------------------------------


def pendulum_on_a_cart() -> dmoc.MechanicalSystem:
    speed = x.diff(T) ** 2 + 2 * l * sp.cos(a) * x.diff(T) * a.diff(T) + l**2 * a.diff(T) ** 2
    return dmoc.MechanicalSystem(
        "units_cart", [x, a], M * x.diff(T) ** 2 / 2 + m * speed / 2 - m * g * l * sp.cos(a),
        {m: 0.5, M: 1.0, g: 9.81, l: 0.5, room: 0.4, stop: 0.7},
        surfaces={"left": x >= -room, "right": x <= room, "up": a <= stop, "down": a >= -stop},
    )  # fmt: skip


def arm_with_a_stop() -> dmoc.MechanicalSystem:
    elbow = (l * sp.sin(a), -l * sp.cos(a))
    hand = (elbow[0] + l * sp.sin(a + b), elbow[1] - l * sp.cos(a + b))
    kinetic = sum(m * c.diff(T) ** 2 / 2 for c in (*elbow, *hand))
    return dmoc.MechanicalSystem(
        "units_arm", [a, b], kinetic - m * g * (elbow[1] + hand[1]),
        {m: 1.0, g: 9.81, l: 0.5, room: 0.8, stop: 1.0},
        surfaces={"stop": b <= stop, "back": b >= -stop, "wall": hand[0] <= room},
    )  # fmt: skip


def bouncing_ball() -> dmoc.MechanicalSystem:
    return dmoc.MechanicalSystem(
        "units_ball", [x], free(x) - m * g * x, {m: 1.0, g: 9.81, room: 1.0},
        surfaces={"floor": x >= 0, "lid": x <= room},
    )  # fmt: skip


# Exponents of length, mass and time.
DIMENSIONS = {
    "m": (0, 1, 0), "M": (0, 1, 0), "g": (1, 0, -2), "l": (1, 0, 0), "room": (1, 0, 0),
    "x": (1, 0, 0),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(
    ("system", "position", "velocity", "restitution", "hits"),
    [
        (bouncing_ball(), [0.8], [5.0], 0.8, 4),
        (pendulum_on_a_cart(), [0.0, 0.1], [1.0, 0.0], 1.0, 4),
        (arm_with_a_stop(), [0.6, 0.3], [6.0, -3.0], 0.9, 6),
    ],
    ids=["ball", "cart", "arm"],
)
@pytest.mark.parametrize("order", [2, 4])
def test_units_do_not_matter(
    system: dmoc.MechanicalSystem,
    position: list[float],
    velocity: list[float],
    restitution: float,
    hits: int,
    order: int,
) -> None:
    """Lengths, masses and times in units from a millionth to a million, every two of them in all
    sizes of both."""
    kernels = dmoc.build(system, order=order)

    def run(*units: float) -> tuple[np.ndarray, list[tuple[str, float]]]:
        def size(name: str) -> float:
            return float(np.prod(np.array(units) ** DIMENSIONS.get(name, (0, 0, 0))))

        parameters = {
            name: value * size(name)
            for name, value in kernels.parameters.items()
            if value is not None
        }
        q = np.array([size(name) for name in kernels.coordinates])
        ball = dmoc.simulate(
            kernels, position * q, velocity * q / units[2], step_size=0.01 * units[2], steps=120,
            parameters=parameters, restitution=restitution,
        )  # fmt: skip
        return ball.q / q, [
            (c.surface, pytest.approx(c.time / units[2], rel=1e-9)) for c in ball.collisions
        ]

    wanted, contacts = run(1.0, 1.0, 1.0)
    assert len(contacts) == hits
    for i, j in itertools.product(range(3), repeat=2):
        motion, met = run(*np.power(10.0, [6 * i - 6, 6 * j - 6, 6 * ((i + j) % 3) - 6]))
        assert motion == pytest.approx(wanted, rel=1e-9, abs=1e-9)
        assert met == contacts


def test_a_run_whose_steps_resolve_no_flight_ends_in_words() -> None:
    """To and fro between walls 1 m apart: 800 hits a step go on for ever, 5 do not."""
    x = dynamicsymbols("x")
    shuttle = dmoc.build(
        dmoc.MechanicalSystem(
            "shuttle", [x], x.diff() ** 2 / 2, surfaces={"left": x >= 0, "right": x <= 1},
            tangents={"rail": x}, friction={"rail": sp.Rational(1, 10**9)},
        )
    )  # fmt: skip
    run = dmoc.simulate(shuttle, {x: 0.5}, {x: 50}, step_size=0.1, steps=20)
    assert len(run.collisions) == 100
    with pytest.raises(SimulationError, match=r"come to no end at t = 0\.1\d* s"):
        dmoc.simulate(shuttle, {x: 0.5}, {x: 8000}, step_size=0.1, steps=10**6)
