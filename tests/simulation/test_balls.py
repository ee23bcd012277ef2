"""Hits of balls in both tangential directions: simulated, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import sympy as sp
from balls import RADIUS, START, a, bounced, mu, r, returning, spun, x, y, z
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import ModelError, ProblemError, SimulationError
from dmoc.codegen.kernels import Kernels
from dmoc.mechanics.contact_mode import FREE
from dmoc.mechanics.possible_words import words_after
from dmoc.motion.friction import SLIP
from dmoc.simulation.impact_laws import ball, poisson, tangential
from dmoc.simulation.impact_laws.course import Coefficients
from dmoc.symbolic.continuous import coefficients_of_tangential_restitution

V, OMEGA = np.array([1.0, 0.5, -2.0]), np.array([0.0, 30.0, 10.0])
FALL = 0.05  # until the hit


@pytest.fixture(scope="module")
def kernels() -> Kernels:
    return dmoc.build(returning(), backend="numpy")


def fall(kernels: Kernels, steps: int = 2, **options: Any) -> dmoc.Simulation:
    """A ball that is thrown onto the floor without gravity."""
    parameters = {"g": 0.0, **options.pop("parameters", {})}
    rates = dict(zip(("x", "y", "z", "a", "b", "c"), [*V, *OMEGA], strict=True))
    return dmoc.simulate(
        kernels, {**START, "z": RADIUS + 2 * FALL}, rates, step_size=FALL, steps=steps,
        parameters=parameters, **options,
    )  # fmt: skip


@pytest.mark.parametrize(("friction", "back"), [(0.2, 0.0), (0.02, 0.0), (0.2, 0.6), (0.3, 1.0)])
def test_a_ball_with_spin_comes_back_as_in_the_closed_form(
    kernels: Kernels, friction: float, back: float
) -> None:
    v, omega, impulse = bounced(V, OMEGA, friction, 0.8, back)
    if (friction, back) == (0.2, 0.0):  # by hand
        assert [*v, *omega] == pytest.approx([11 / 7, 5 / 14, 1.6, -25 / 7, 110 / 7, 10])
    parameters = {"mu": friction, "e_t": back}
    run = fall(kernels, restitution=0.8, parameters=parameters)
    assert run.v[-1] == pytest.approx([*v, *omega])
    hit = run.collisions[0]
    assert [*hit.tractions.values(), hit.impulse] == pytest.approx(impulse)
    assert f"along it {impulse[0]:.6g} and {impulse[1]:.6g}" in str(run)


def test_a_turned_ball_is_one_too() -> None:
    """Its sliding velocity and what impulses change it by, for any quaternion p."""
    world = dmoc.spatial.World()
    body = world.free((x, y, z), attitude="q", mass=1, inertia=(0.4 * r**2,) * 3)
    system = world.system(
        "thrown_ball", surfaces={"floor": z >= r}, friction={"floor": mu}, cost=1,
        tangents={"floor": body.velocity_at(x, y, z - r)[:2]}, parameters={r: RADIUS, mu: 0.2},
    )  # fmt: skip
    named, slides = system.definitions, [system.tangents[n] for n in ("floor", "floor_2")]
    for _ in range(3):
        slides = [e.subs(named).subs(r, RADIUS) for e in slides]
    attitude = dmoc.attitude(axis=(1, 2, 2), angle=1.0)
    p, q = np.array(attitude.quaternion), system.coordinates[3:]
    at = dict(zip(q, p, strict=True))
    slopes = np.array([[e.diff(s).subs(at) for s in system.velocities] for e in slides], float)
    half = np.array(  # p' of an angular velocity in the world
        [[-p[1], -p[2], -p[3]], [p[0], p[3], -p[2]], [-p[3], p[0], p[1]], [p[2], -p[1], p[0]]]
    )
    rates = [*V, *(half @ OMEGA / 2)]
    assert slopes @ rates == pytest.approx([V[0] - RADIUS * OMEGA[1], V[1] + RADIUS * OMEGA[0]])
    inverse = np.diag([1, 1, 1, *[1 / (4 * 0.4 * RADIUS**2)] * 4])
    assert slopes @ inverse @ slopes.T == pytest.approx(3.5 * np.eye(2))


def test_velocities_of_points_of_a_body() -> None:
    """That of what is at the tip is that of the tip; a place may be anywhere."""
    angle = dynamicsymbols("angle")
    arm = dmoc.spatial.World().hinge(angle, "y", tip=(0.4, 0, 0), mass=1)
    omega, (t_x, _, t_z) = angle.diff(), arm.tip
    assert arm.velocity_at(*arm.tip) == (omega * t_z, 0, -omega * t_x)
    assert arm.velocity_at(0, 1, 2) == (2 * omega, 0, 0)
    with pytest.raises(ModelError, match="place on body angle"):
        arm.velocity_at("here", 0, 0)


def test_in_the_plane_of_the_slide_all_laws_are_one() -> None:
    rng, words = np.random.default_rng(3), set[str]()
    for _ in range(200):
        rates, response = (-rng.uniform(0.1, 2), rng.uniform(0, 3)), np.diag(rng.uniform(0.3, 3, 2))
        of = Coefficients(rng.uniform(0, 1), rng.uniform(0, 1), rng.uniform(-1, 1))
        own, other = (
            law(np.array(rates), response, of) for law in (ball.impulses, tangential.impulses)
        )
        whole = poisson.impulses(np.array(rates), response, of)
        pair = own.normal, own.tangential
        assert pair == pytest.approx((other.normal, other.tangential))
        if of.e_t <= 0 and own.compression == (SLIP,):
            assert pair == pytest.approx((whole.normal, whole.tangential))
        words.add(own.course)
    assert words == {"slip", "stick"}
    assert not ball.impulses(np.array([0.1, 1.0]), np.eye(2), Coefficients(1, 1, 1)).normal


def test_no_energy_grows_in_random_hits() -> None:
    rng = np.random.default_rng(4)
    n = 10_000
    e, coefficient, back = rng.uniform(0, 1, (3, n)) * [[1], [2], [2]] - [[0], [0], [1]]
    v, omega = rng.normal(size=(2, n, 3)) * [[[1]], [[1 / RADIUS]]]
    v[:, 2] = -np.abs(v[:, 2])
    inertia, slow = 0.4 * RADIUS**2, 0
    for k in range(n):
        s = float(np.hypot(v[k, 0] - RADIUS * omega[k, 1], v[k, 1] + RADIUS * omega[k, 0]))
        rates, response = np.array([v[k, 2], s]), np.diag([1.0, 3.5])
        hit = ball.impulses(rates, response, Coefficients(coefficient[k], e[k], back[k]))
        lam = np.array([hit.normal, hit.tangential])
        assert lam @ (2 * rates + response @ lam) <= 1e-12
        assert -hit.tangential <= coefficient[k] * hit.normal * (1 + 1e-12)
        slow += hit.compression == (SLIP,)
    assert inertia > 0 and 0.1 * n < slow < 0.9 * n


def test_a_ball_without_a_slide_has_no_tangential_impulse(kernels: Kernels) -> None:
    run = dmoc.simulate(kernels, {**START, "z": 0.2}, {"z": -1}, step_size=0.1, steps=2)
    assert run.collisions[0].tractions == {"floor": 0.0, "floor_2": 0.0}


def test_what_slides_on_the_floor_is_refused(kernels: Kernels) -> None:
    slides = r"'floor' stays closed from t = 0 s on and slides, and sliding that lasts may turn"
    with pytest.raises(SimulationError, match=slides):
        dmoc.simulate(kernels, {**START, "z": RADIUS}, {"x_dot": 1}, step_size=0.01, steps=5)
    with pytest.raises(SimulationError, match=r"stays closed from t = 0\.045"):
        fall(kernels, restitution=0.0, parameters={"g": 9.81})


def test_hits_of_other_bodies_are_refused() -> None:
    """A rod turns by its normal impulse, or, upright, slides in one direction like a pendulum."""
    speeds = sum(q.diff() ** 2 for q in (x, y, z)) + a.diff() ** 2 / 12
    rod = dmoc.MechanicalSystem(
        "rod_in_space", [x, y, z, a], speeds / 2, {mu: 0.3}, friction={"floor": mu}, cost=1,
        surfaces={"floor": z >= sp.sin(a) / 2}, tangents={"floor": (x - sp.cos(a) / 2, y)},
    )  # fmt: skip
    rods = dmoc.build(rod, backend="numpy")
    turns, skids = "the normal impulse of 'floor' changes", "changes one sliding velocity more"
    for angle, reason in ((1.0, turns), (np.pi / 2, skids)):
        with pytest.raises(SimulationError, match=f"{reason}.* known in space: expected a ball"):
            dmoc.simulate(rods, {"z": 0.6, "a": angle}, {"z": -1}, step_size=0.1, steps=9)
    start = {"x": 0, "y": 0, "z": 0.6, "a": 1.0, "x_dot": 0, "y_dot": 0, "z_dot": -1, "a_dot": 0}
    thrown = dmoc.Problem(rods, start=start, sequence=["floor:stick"], steps=2, final_time=0.5)
    solution = dmoc.solve(thrown, starts=1, verify=False)
    assert turns in dmoc.verify(solution.trajectory, rods).message


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"tangents": {"floor": (x, y, z)}}, "given as 3 expressions: expected one, or two"),
        ({"impact_laws": {"floor": "stronge"}}, "two directions and the impact law 'stronge'"),
        ({"tangents": {"floor": x}, "impact_laws": {"floor": "ball"}}, "but not two tangential"),
        ({"friction": {}}, "two tangential directions and no friction: expected one coefficient"),
        ({"friction": {"floor": (0.3, mu)}}, "two tangential directions and the friction"),
        ({"friction": {"floor": mu * x}}, "a number or an expression in parameters"),
        ({"friction": {"floor": -mu / mu}}, "friction of 'floor' is -1: expected 0 or a positive"),
        ({"tangents": {"floor": (x.diff() ** 2, y)}}, "not linear in the velocity x_dot"),
        ({"tangents": {"floor": (r, y)}}, "contains no coordinate and no velocity"),
        ({"tangents": {"floor": (x, y), "floor_2": x}}, "'floor_2', which another tangent has"),
        ({"tangents": {"floor": x, "floor_2": y}}, "the rail 'floor_2' has the name of a second"),
        ({"tangents": {"wall": (x, y)}}, "'wall' has two directions but is at no surface"),
        ({"tangential_restitution": {"floor": 2}}, "expected a number from -1"),
    ],
)
def test_what_is_no_ball_is_refused(fields: dict[str, Any], words: str) -> None:
    with pytest.raises(ModelError, match=words):
        spun(**fields)


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["+floor:slip+"], "has two directions, and sliding that lasts may turn in them; let it"),
        (["+floor:slip"], "'\\+floor:slip' in the sequence: the tangent of 'floor' has two"),
        (["floor:slip+"], "say 'floor:slip' or 'floor:stick'"),
        (["floor:stick:late"], "the one in which it slides is part of the motion"),
        (["floor_2:stick"], "unknown tangent 'floor_2:stick' in the sequence: expected one of f"),
    ],
)
def test_words_of_the_plane_are_refused(kernels: Kernels, words: list[str], reason: str) -> None:
    with pytest.raises(ProblemError, match=reason):
        dmoc.Problem(kernels, start=START, sequence=words, steps=2, final_time=1)


def test_what_slides_on_or_has_no_friction_is_refused_in_words(kernels: Kernels) -> None:
    with pytest.raises(ProblemError, match="'floor:slip' in contacts: the tangent of 'floor' has"):
        dmoc.Problem(kernels, start=START, contacts=["floor:slip"], steps=2, final_time=1)
    smooth = {"parameters": {"mu": 0.0}, "start": START, "steps": 2, "final_time": 1}
    with pytest.raises(ProblemError, match="friction of 'floor' is 0, so that there is no way"):
        dmoc.Problem(kernels, sequence=["floor:slip"], **smooth)
    assert not dmoc.Problem(kernels, sequence=["floor"], **smooth).touch.passes.any()


def test_a_search_tries_both_ways_and_the_landing_that_sticks(kernels: Kernels) -> None:
    problem = dmoc.Problem(kernels, start=START, sequence=["floor"], steps=2, final_time=1)
    words = [*words_after(FREE, problem.touch.contacts, ["floor"])]
    assert words == ["floor:slip", "floor:stick", "+floor"]
    assert replace(returning(), title="again").impact_laws == {"floor": "ball"}


def test_what_is_not_stated_of_a_ball() -> None:
    """It does not slide back, and its sliding velocities are shown as such."""
    assert coefficients_of_tangential_restitution(spun()) == (0, -1)
    assert "sigma_floor_2 = " in str(dmoc.derive(spun())) and "sigma_floor_2 " in str(spun())
