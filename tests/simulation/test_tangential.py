"""Tangential restitution: superballs, discs with friction, rods."""

import numpy as np
import pytest
import sympy as sp
from superballs import (
    FALL,
    HEIGHT,
    LAWS,
    MASS,
    RADIUS,
    THROWS,
    a,
    bounced,
    disc,
    e_t,
    r,
    rough,
    x,
    z,
)
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import ModelError, ProblemError, SimulationError

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def ball():
    return dmoc.build(disc())


@pytest.fixture(scope="module")
def rough_ball():
    return dmoc.build(rough())


def test_the_point_of_a_superball_turns_round_and_its_energy_is_kept(ball):
    run = dmoc.simulate(ball, {"z": HEIGHT}, {"x": 1, "a": 3}, step_size=0.005, steps=1000)
    assert len(run.collisions) == 8 and "along it -0.466667" in str(run)
    for c in run.collisions:
        before, after = (np.linalg.solve(MASS, p) for p in (c.momentum_before, c.momentum_after))
        slides = [v[0] - RADIUS * v[2] for v in (before, after)]
        np.testing.assert_allclose(slides[1], -slides[0], rtol=1e-12)
    assert np.ptp(run.energy) < 1e-12 * run.energy[0]


def test_a_superball_bounces_by_garwins_matrix(ball):
    # k = 1/2: v' = (v + 2 r w)/3, r w' = (4 v - r w)/3; the square of the matrix is one
    garwin = np.array([[1, 2], [4, -1]]) / 3
    run = dmoc.simulate(ball, {"z": HEIGHT}, {"x": 1, "a": 3}, step_size=0.005, steps=250)
    state = np.array([1, RADIUS * 3])
    for c in run.collisions:
        state = garwin @ state
        after = np.linalg.solve(MASS, c.momentum_after)[[0, 2]] * [1, RADIUS]
        np.testing.assert_allclose(after, state, rtol=1e-12)
    np.testing.assert_allclose(state, [1, 0.3], rtol=1e-12)


@pytest.mark.parametrize("law", LAWS, ids=str)
@pytest.mark.parametrize("throw", THROWS, ids=str)
def test_a_disc_sticks_or_slides_by_waltons_law(rough_ball, throw, law):
    e, back, friction = law
    run = dmoc.simulate(
        rough_ball, {"z": HEIGHT}, {"x": throw[0], "a": throw[1]}, step_size=0.01, steps=33,
        restitution=e, parameters={"e_t": back, "mu": friction},
    )  # fmt: skip
    wanted = bounced((throw[0], -FALL, throw[1]), e, back, friction)
    np.testing.assert_allclose(run.collisions[0].momentum_after, MASS @ wanted, atol=1e-12)


def rod(**more):
    """A rod of length 1 whose end hits a floor: normal and tangent are coupled."""
    parts = {
        "coordinates": [x, z, a],
        "lagrangian": (x.diff() ** 2 + z.diff() ** 2 + a.diff() ** 2 / 12) / 2,
        "surfaces": {"floor": z - sp.sin(a) / 2 >= 0},
        "tangents": {"floor": x + sp.cos(a) / 2},
        "tangential_restitution": {"floor": e_t},
        "parameters": {e_t: 0.0},
    }
    return dmoc.MechanicalSystem("rod", **(parts | more))


def chatterjee_ruina(angle, v, e, back, friction):
    """(1 + e) P_I + (1 + e_t)(P_II - P_I), with a smaller e_t where that leaves the cone."""
    D = np.array([[0, 1, -np.cos(angle) / 2], [1, 0, -np.sin(angle) / 2]])
    M = np.diag([1, 1, 1 / 12])
    A, rates = D @ np.linalg.solve(M, D.T), D @ v
    first = np.array([-rates[0] / A[0, 0], 0])
    second = np.linalg.solve(A, -rates) - first
    low, high = -1.0, back
    for kappa in (back, *[None] * 60):
        kappa = (low + high) / 2 if kappa is None else kappa
        P = (1 + e) * first + (1 + kappa) * second
        inside = abs(P[1]) <= friction * P[0]
        if inside and kappa == back:
            break
        low, high = (kappa, high) if inside else (low, kappa)
    return M @ v + D.T @ P, M


@pytest.mark.parametrize("friction", [0.1, 0.4, None])
def test_hits_of_a_rod_obey_the_law_and_lose_energy(friction):
    limit = {} if friction is None else {"friction": {"floor": friction}}
    kernels = dmoc.build(rod(**limit))
    for seed in range(12):
        rng = np.random.default_rng(seed)
        angle, e, back = rng.uniform(0.2, 1.3), rng.uniform(0, 1), rng.uniform(-1, 1)
        v = np.array([rng.normal(), -2 - rng.uniform(), rng.normal()])
        q = np.array([0.3, np.sin(angle) / 2, angle]) - 0.02 * v
        p, M = chatterjee_ruina(angle, v, e, back, friction or np.inf)
        run = dmoc.simulate(
            kernels, q, v, step_size=0.005, steps=5, restitution=e, parameters={"e_t": back}
        )
        np.testing.assert_allclose(run.collisions[0].momentum_after, p, atol=1e-10)
        before, after = (w @ np.linalg.solve(M, w) for w in (M @ v, p))
        assert after <= before


def test_minus_one_is_smooth_whatever_the_inertia():
    smooth = rod(tangents={}, tangential_restitution={}, parameters={})
    start = [0.0, 0.45, 0.7], [1.0, -2.0, 0.4]
    runs = [
        dmoc.simulate(system, *start, step_size=0.01, steps=20, restitution=0.6, parameters=values)
        for system, values in ((rod(), {"e_t": -1}), (smooth, {}))
    ]
    assert runs[0].collisions
    np.testing.assert_allclose(runs[0].v, runs[1].v, atol=1e-12)


def test_a_hit_that_would_have_to_pull_is_refused_and_has_no_motion():
    kernels, start = dmoc.build(rod()), ([0, np.sin(0.3) / 2 + 0.01, 0.3], [-8, -0.5, 0])
    with pytest.raises(SimulationError, match=r"'floor' would have to pull .* give it friction"):
        dmoc.simulate(kernels, *start, step_size=0.005, steps=8, parameters={"e_t": 1})
    names = ("x", "z", "a", "x_dot", "z_dot", "a_dot")
    problem = dmoc.Problem(
        kernels, start=dict(zip(names, np.ravel(start), strict=True)), sequence=["floor"], steps=4,
        final_time=0.04, parameters={"e_t": 1},
    )  # fmt: skip
    assert dmoc.solve(problem, "ipm").status == "infeasible"


def test_on_a_moving_belt_the_law_holds_beside_the_belt():
    t = dynamicsymbols._t
    system = disc(
        surfaces={"floor": z >= r + sp.sin(t) / 10}, tangents={"floor": x - r * a - 2 * t}
    )
    run = dmoc.simulate(system, {"z": HEIGHT}, step_size=0.01, steps=40, restitution=0.8)
    hit = run.collisions[0]
    lift = np.cos(hit.time) / 10
    v = np.linalg.solve(MASS, hit.momentum_before)
    belt = np.array([2, lift, 0])
    wanted = belt + bounced(v - belt, 0.8, 1)
    np.testing.assert_allclose(np.linalg.solve(MASS, hit.momentum_after), wanted, rtol=1e-9)


def test_constraints_hold_in_the_hit():
    x1, y1, x2, y2 = dynamicsymbols("x1 y1 x2 y2")
    masses = dmoc.MechanicalSystem(
        "dumbbell",
        coordinates=[x1, y1, x2, y2],
        lagrangian=sum(c.diff() ** 2 for c in (x1, y1, x2, y2)) / 2,
        constraints={"rod": sp.Eq((x2 - x1) ** 2 + (y2 - y1) ** 2, 1)},
        surfaces={"floor": y1 >= 0},
        tangents={"floor": x1},
        tangential_restitution={"floor": e_t},
        parameters={e_t: 0.5},
    )
    # the same masses by their middle and the angle of the rod, from the right end
    body = rod(lagrangian=x.diff() ** 2 + z.diff() ** 2 + a.diff() ** 2 / 4)
    angle, v, w = 0.7, np.array([1.0, -2.0]), 0.6
    arm, turn = np.array([-np.cos(angle), np.sin(angle)]), np.array([np.sin(angle), np.cos(angle)])
    low = np.array([0.0, 0.05])
    q = np.concatenate([low, low + arm])
    rates = np.concatenate([v - w * turn / 2, v + w * turn / 2])
    run = dmoc.simulate(masses, q, rates, step_size=0.005, steps=20, restitution=0.6)
    middle = [*(low + arm / 2), angle], [*v, w]
    same = dmoc.simulate(
        body, *middle, step_size=0.005, steps=20, restitution=0.6, parameters={"e_t": 0.5}
    )
    assert run.collisions and same.collisions
    centre = (run.q[-1, :2] + run.q[-1, 2:]) / 2
    np.testing.assert_allclose(centre, same.q[-1, :2], atol=1e-9)


def test_bounces_that_die_away_land_without_friction(ball):
    run = dmoc.simulate(
        ball, {"z": 0.2}, {"x": 1, "a": -3}, step_size=0.01, steps=100, restitution=0.5,
        parameters={"e_t": 0.5},
    )  # fmt: skip
    assert run.collisions[-1].lands == ("floor",) and run.contacts
    # each bounce halves the velocity of the point: it rolls in the end, with its momentum about it
    v, w = run.v[-1, 0], run.v[-1, 2]
    np.testing.assert_allclose(v, RADIUS * w, atol=1e-4)
    np.testing.assert_allclose(v + 0.5 * RADIUS * w, 1 - 0.5 * RADIUS * 3, rtol=1e-9)
    assert dmoc.verify(run.trajectory, ball).passed


# What is refused ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"tangential_restitution": {"floor": 1.5}}, "is 1.5.*more creates energy"),
        ({"tangential_restitution": {"floor": -1.1}}, "expected a number from -1"),
        ({"tangential_restitution": {"wall": 1}}, "'wall' has a tangential restitution but is no"),
        ({"tangents": {}}, "no tangent: give the tangential position"),
        ({"tangential_restitution": {"floor": x}}, "expected parameters alone"),
    ],
)
def test_statements_that_are_none_are_refused(fields, words):
    with pytest.raises(ModelError, match=words):
        disc(**fields)


@pytest.mark.parametrize("value", [1.5, -2.0])
def test_parameters_that_create_energy_are_refused(ball, value):
    with pytest.raises(SimulationError, match="more creates energy"):
        dmoc.simulate(ball, {"z": 1}, step_size=0.1, steps=2, parameters={"e_t": value})
    with pytest.raises(ProblemError, match="more creates energy"):
        dmoc.Problem(ball, start={"x": 0, "z": 1, "a": 0}, final_time=1, parameters={"e_t": value})


@pytest.mark.parametrize(
    ("system", "word", "words"),
    [
        (disc, "floor:stick", "no friction, so that there is no way to say; say 'floor'"),
        (disc, "+floor:slip+", "say '\\+floor'"),
        (rough, "floor:slip+:stick", "sticks or slides as a whole"),
        (rough, "floor:slip+:slip-:late", "sticks or slides as a whole"),
    ],
)
def test_words_that_such_hits_do_not_have_are_refused(system, word, words):
    with pytest.raises(ProblemError, match=words):
        dmoc.Problem(system(), start={"x": 0, "z": 1, "a": 0}, sequence=[word], final_time=1)


def corner():
    return disc(
        surfaces={"floor": z >= r, "wall": x <= 1},
        tangents={"wall": z + r * a},
        tangential_restitution={"wall": e_t},
    )


def test_hits_beside_other_contacts_are_refused():
    kernels = dmoc.build(corner())
    with pytest.raises(
        ProblemError, match=r"obey tangential restitution, a law of one .* floor stays"
    ):
        dmoc.Problem(
            kernels, start={"z": RADIUS, "x": 0, "a": 0}, contacts=["floor"], sequence=["wall"],
            final_time=1,
        )  # fmt: skip
    with pytest.raises(SimulationError, match=r"'wall', whose hits obey tang.* 'floor' touches"):
        dmoc.simulate(kernels, {"z": RADIUS, "x": 0.9}, {"x": 1, "a": 2}, step_size=0.01, steps=50)
