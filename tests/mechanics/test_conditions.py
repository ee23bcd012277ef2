"""Whatever conditions there are, in whatever modes: slopes, rates, pushes, forces, cones and words,
beside finite differences of the functions and beside what forces do.  A new kind of condition is
tested where it is in :data:`~dmoc.mechanics.conditions.ALL` and a system here has it."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.mechanics.algebra import multipliers
from dmoc.mechanics.conditions import (
    ALL,
    GAPS,
    JOINTS,
    TANGENTS,
    Condition,
    Conditions,
    Forces,
    answers,
    conditions_of,
    in_order,
)
from dmoc.mechanics.contact_forces import accelerations_and_forces
from dmoc.mechanics.contact_mode import Mode
from dmoc.mechanics.contacts import RAIL
from dmoc.mechanics.model import Model
from dmoc.mechanics.model_values import parameter_row
from dmoc.mechanics.sequence_words import mode_of, parts_of
from dmoc.simulation.integrator import Integrator

X, Y, A, U = dynamicsymbols("x y a u")
T, MU = dynamicsymbols._t, sp.Symbol("mu")
STEP = 1e-6


def _tray() -> dmoc.MechanicalSystem:
    """A turning body beside a bent floor that rises, a wall, and a rail; a rod ties it to a moving
    point."""
    V, W, OMEGA = X.diff(), Y.diff(), A.diff()
    return dmoc.MechanicalSystem(
        "tray",
        [X, Y, A],
        V**2
        + 0.7 * W**2
        + (0.3 + 0.1 * sp.cos(A)) * OMEGA**2
        + 0.2 * sp.cos(A) * V * OMEGA
        - 9 * Y,
        {MU: 0.4},
        inputs=[U],
        forces={X: U, A: 0.5 * U},
        surfaces={
            "floor": Y + 0.3 * sp.sin(A) >= 0.1 * X**2 + 0.2 * T,
            "wall": X + 0.2 * sp.cos(A) <= 1 + 0.1 * sp.sin(T),
        },
        tangents={"floor": X + 0.3 * sp.cos(A) * Y - 0.1 * T, "wall": Y * sp.cos(A), "rail": X + A},
        friction={"floor": MU, "wall": 0.2 + 0.1 * sp.cos(Y), "rail": 1.5},
        constraints={
            "rod": sp.Eq(X * Y + sp.sin(A), 0.1 * T),
            "blade": V * sp.sin(A + T) - W * sp.cos(A) + 0.3 * OMEGA - 0.2 * T,
        },
    )


def _coin() -> dmoc.MechanicalSystem:
    """A disc between floor and ceiling with static friction of its own, without constraints."""
    return dmoc.MechanicalSystem(
        "coin",
        [X, Y, A],
        X.diff() ** 2 + Y.diff() ** 2 + A.diff() ** 2 / 4,
        inputs=[U],
        forces={A: U},
        surfaces={"floor": Y >= 0.1, "ceiling": Y <= 0.9},
        tangents={"floor": X + 0.1 * A, "ceiling": X - 0.1 * A},
        friction={"floor": (0.6, 0.3), "ceiling": 0.5},
    )


@pytest.fixture(scope="module", params=[_tray, _coin])
def model(request: Any) -> Model:
    kernels = dmoc.build(request.param())
    return Model(kernels, parameter_row(kernels, {}))


def _modes(model: Model) -> Iterator[Mode]:
    """All modes: each surface open or closed, each tangent that may rub in all ways."""
    supports = model.supports
    for closed in product((False, True), repeat=model.nc):
        on = [j for j in range(model.nc) if closed[j]]
        rubs = [k for k in range(model.nt) if supports[k] == RAIL or supports[k] in on]
        for ways in product((0, 1, -1), repeat=len(rubs)):
            yield Mode.of(on, dict(zip(rubs, ways, strict=True)))


def _states(model: Model) -> tuple[Any, ...]:
    rng = np.random.default_rng(1)
    q, v = rng.normal(size=(2, 4, model.nq))
    return q, v, rng.normal(size=(4, model.nu)), rng.uniform(size=4)


def _all(model: Model) -> Conditions:
    """Every function of the model as a condition."""
    return conditions_of(model, Mode(tuple(range(model.nc)), tuple(range(model.nt))))


def test_every_kind_has_a_system_here() -> None:
    systems = [dmoc.build(of()) for of in (_tray, _coin)]
    models = [Model(kernels, parameter_row(kernels, {})) for kernels in systems]
    assert {c.functions for model in models for c in _all(model).of} == set(ALL)


def test_slopes_rates_and_bends_are_derivatives(model: Model) -> None:
    every, (q, v, _, t) = _all(model), _states(model)
    slopes, placed = every.slopes(model, q, t), every.placed(model)
    assert {every.of[i].functions for i in np.flatnonzero(~placed)} <= {JOINTS}
    for i, way in enumerate(np.eye(model.nq + 1) * STEP):
        up, down = (every.values(model, q + s * way[:-1], t + s * way[-1]) for s in (1, -1))
        by_place = (up - down) / (2 * STEP)
        np.testing.assert_allclose(slopes[..., placed, i], by_place[:, placed], atol=1e-8)
        assert not every.values(model, q, t)[:, ~placed].any()
    for i, way in enumerate(np.eye(model.nq) * STEP):
        up, down = (every.rates(model, q, v + s * way, t) for s in (1, -1))
        np.testing.assert_allclose(slopes[..., i], (up - down) / (2 * STEP), atol=1e-8)
    rates = every.rates(model, q, v, t)
    np.testing.assert_allclose(rates, (slopes[..., :-1] @ v[..., None])[..., 0] + slopes[..., -1])
    up, down = (every.rates(model, q + s * STEP * v, v, t + s * STEP) for s in (1, -1))
    np.testing.assert_allclose(every.bends(model, q, v, t), (up - down) / (2 * STEP), atol=1e-7)
    one = every.slopes(model, q[1], t[1]), every.rates(model, q[1], v[1], t[1])
    np.testing.assert_array_equal(one[0], slopes[1])
    np.testing.assert_array_equal(one[1], rates[1])


def test_pushes_are_what_the_forces_do(model: Model) -> None:
    """Virtual power: -N gamma + T sigma + R phi_dot, with slopes by finite differences."""
    q, v, u, t = _states(model)
    there = model.with_friction_at(q, v, u, t)
    steps = np.eye(model.nq) * STEP
    for mode in _modes(model):
        held = conditions_of(model, mode)
        lam = np.random.default_rng(2).uniform(0.5, 2, size=(4, len(held)))
        forces = held.spread(there, lam)
        work = np.zeros(q.shape)
        for F, functions in zip(forces, ALL, strict=True):
            along = [
                functions.rates(model, q, v + d, t) - functions.rates(model, q, v - d, t)
                for d in steps
            ]
            work += functions.push * np.einsum("nk,ink->ni", F, along) / (2 * STEP)
        pushed = np.einsum("nm,nmi->ni", lam, held.pushes(there, q, t))
        np.testing.assert_allclose(pushed + held.dragged(there, q, t), work, atol=1e-7)
        np.testing.assert_array_equal(held.gathered(forces), lam)


def test_friction_takes_energy_and_is_what_it_can_hold(model: Model) -> None:
    """Of what slides the force is mu N against it, of a rail its own; an open contact has none."""
    q, v, u, t = _states(model)
    there, N = model.with_friction_at(q, v, u, t), 3.0
    for mode in _modes(model):
        held = conditions_of(model, mode)
        forces = held.spread(there, np.full((4, len(held)), N))
        sigma = np.arange(1.0, model.nt + 1)
        for k, s in mode.sliding:
            load = 1.0 if model.supports[k] == RAIL else N
            expected = -s * np.broadcast_to(there.friction, (4, model.nt))[:, k] * load
            np.testing.assert_allclose(forces.tangential[:, k], expected)
            assert held.forward(sigma)[k] == s * sigma[k]
        still = [k for k in range(model.nt) if k not in mode.rubbing]
        assert not forces.tangential[:, still].any()
        assert not np.delete(forces.normal, mode.closed, axis=1).any()
        # a change of all multipliers changes no force of a rail
        rails = [k for k, _ in mode.sliding if model.supports[k] == RAIL]
        assert not held.changes(there, np.ones((4, len(held)))).tangential[:, rails].any()


def test_cones_end_where_contacts_pull_and_friction_gives_way(model: Model) -> None:
    q, v, u, t = (rows[:1] for rows in _states(model))
    there = model.with_friction_at(q, v, u, t)
    for mode in _modes(model):
        held, n = conditions_of(model, mode), len(mode.closed)
        forces = held.spread(there, np.full((1, len(held)), 2.0))
        most = there.bearing(forces.normal)
        for share, kept in ((0.99, True), (1.01, False)):
            for side in (1, -1):
                rubs = forces.tangential.copy()
                rubs[:, mode.sticking] = side * share * most[:, mode.sticking]
                margins = held.margins(there, forces._replace(tangential=rubs))
                assert margins.shape == (1, n + 2 * len(mode.sticking))
                assert bool((margins[:, n:] > 0).all()) is (kept or not mode.sticking)
        for j in mode.closed:
            pulls = forces.normal.copy()
            pulls[:, j] = -1e-3
            margins = held.margins(there, forces._replace(normal=pulls))
            assert margins[0, mode.closed.index(j)] == -1e-3


def test_answers_change_rates_by_what_is_wanted(model: Model) -> None:
    """And by forces alone: M change = B^T lam."""
    q, _, _, t = _states(model)
    there, M = model.with_friction_at(q, t=t), model.mass(q, t)
    for mode in _modes(model):
        held = conditions_of(model, mode)
        C = held.slopes(model, q, t)[..., :-1]
        if np.linalg.matrix_rank(C).min() < len(held):
            continue
        wanted = np.random.default_rng(3).normal(size=(4, len(held)))
        change, lam = held.answers(there, q, t, wanted)
        np.testing.assert_allclose((C @ change[..., None])[..., 0], wanted, atol=1e-8)
        pushed = np.einsum("nm,nmi->ni", lam, held.pushes(there, q, t))
        np.testing.assert_allclose((M @ change[..., None])[..., 0], pushed, atol=1e-8)


def test_the_integrator_in_c_has_the_same_forces(model: Model) -> None:
    q, v, u, t = _states(model)
    integrator = Integrator(model.kernels, model.par, np.ones(2 * model.nq + 1), lambda: None)
    for mode in _modes(model):
        held = conditions_of(model, mode)
        if np.linalg.matrix_rank(held.slopes(model, q, t)[..., :-1]).min() < len(held):
            continue
        there = integrator.reaction(mode, np.hstack([q, v]), u, t)
        y = accelerations_and_forces(model, mode, (q, v, u, t))
        rows = np.hstack([there.acceleration, *there.forces])
        np.testing.assert_allclose(y, rows, rtol=1e-9, atol=1e-9)


def test_modes_are_what_their_words_say(model: Model) -> None:
    for mode in _modes(model):
        assert mode_of(parts_of(mode, model.contacts), model.contacts) == mode


def test_an_order_keeps_what_drags_at_its_contact(model: Model) -> None:
    mode = Mode((0, 1), (), ((0, 1), (1, -1)))
    turned = in_order(model.contacts, (Condition(GAPS, 1), Condition(GAPS, 0)), mode)
    usual = conditions_of(model, mode, joints=False)
    (q, v, u, t) = _states(model)
    there = model.with_friction_at(q, v, u, t)
    np.testing.assert_allclose(
        turned.pushes(there, q, t), usual.pushes(there, q, t)[:, ::-1], atol=1e-14
    )
    assert turned.places(GAPS) == ([0, 1], [1, 0])
    assert turned.places(TANGENTS) == ([], [])


@pytest.mark.parametrize(
    ("mode", "message"),
    [
        (Mode((2,)), "expected some of 2 surfaces"),
        (Mode((), (3,)), "expected some of 2 surfaces"),
        (Mode((1,), (), ((0, 1),)), "expected closed surfaces under what slides"),
    ],
)
def test_modes_that_the_model_does_not_have(model: Model, mode: Mode, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        conditions_of(model, mode)


def test_forces_are_in_the_order_of_the_kinds() -> None:
    assert Forces._fields == ("normal", "tangential", "joint")
    assert [functions.kind for functions in ALL] == ["normal", "tangential", "reaction"]


def test_what_says_the_same_in_other_units_shares_the_force() -> None:
    """Twice one condition, once in tenths: lam_1 + 10 lam_2 = 4 * 1.5, and both do the same."""
    C = np.array([[[0.0, 1.0], [0.0, 10.0]]])
    change, lam = answers(np.diag([1.0, 4.0])[None], C, C, np.array([[1.5, 15.0]]))
    np.testing.assert_allclose(change, [[0.0, 1.5]])
    np.testing.assert_allclose(lam, [[3.0, 0.3]])


def test_a_row_without_numbers_leaves_the_others() -> None:
    A = np.stack([np.eye(2), np.full((2, 2), np.nan), 2 * np.eye(2)])
    lam = multipliers(A, np.ones((3, 2)), np.array([[1.0, np.nan], [1.0, 1.0], [1.0, 3.0]]))
    np.testing.assert_allclose(lam, [[np.nan] * 2, [np.nan] * 2, [0.5, 1.5]])
