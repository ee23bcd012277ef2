"""Relaxed motions close grips and let them go: beside motions of cubics."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.mechanics.contacts import Contacts
from dmoc.mechanics.touch import Open, Touch
from dmoc.sequences.relaxed_motion import _close_grips

X, Y, U = dynamicsymbols("x y u")
STILL = {"x_dot": 0, "y_dot": 0}


def effort(m: float, d: float, v: float, T: float) -> float:
    """Least int u^2/2 dt of a mass from rest over d in T, with the velocity v at the end, or from
    that to rest."""
    return 2 * m**2 * (3 * d**2 - 3 * d * v * T + v**2 * T**2) / T**3


def two_carts(name: str, grip: Any) -> dmoc.MechanicalSystem:
    """A cart of 1 kg that is driven, and one of 3 kg that a grip moves."""
    return dmoc.MechanicalSystem(
        name, [X, Y], X.diff() ** 2 / 2 + 3 * Y.diff() ** 2 / 2, inputs=[U], forces={X: U},
        cost=U**2 / 2, grips={"hand": grip},
    )  # fmt: skip


def best_of(problem: dmoc.Problem, depth: int = 1) -> dmoc.Node:
    found = dmoc.search(problem, strategy="propose", max_collisions=depth)
    assert found.best is not None
    assert found.best.sequence in [p.sequence for p in found.proposals]
    return found.best


def test_a_truck_couples_and_a_stage_is_let_go() -> None:
    def coupled(p: np.ndarray) -> float:
        v, T = p
        return effort(1, 1, v, T) + effort(4, 1, v / 4, 2 - T)

    system = two_carts("coupling", X - Y)
    ends: dict[str, Any] = {"start": {"x": 0, "y": 1, **STILL}, "goal": {"x": 2, "y": 2, **STILL}}
    best = best_of(dmoc.Problem(system, **ends, final_time=2), 2)
    assert best.sequence[0] == "+hand" and len(best.sequence) in (1, 3)
    assert best.cost == pytest.approx(minimize(coupled, [2.0, 0.6]).fun, rel=1e-3)

    def pushed(p: np.ndarray) -> float:
        """To the velocity v of both over d, from where the driven one comes back alone."""
        d, T = p
        left, v = 2 - T, 0.5
        back = 2 * (3 * d**2 + 3 * d * v * left + v**2 * left**2) / left**3
        return effort(4, d, v, T) + back + 1e3 * (d + v * left - 1) ** 2

    back = {"start": {"x": 0, "y": 0, **STILL}, "goal": {"x": 0, "y": 1, "x_dot": 0, "y_dot": 0.5}}
    best = best_of(dmoc.Problem(system, **back, contacts=["hand"], final_time=2))
    least = min(pushed(np.array([1 - 0.5 * (2 - T), T])) for T in np.linspace(0.2, 1.8, 3201))
    assert best.sequence == ("-hand",) and best.cost == pytest.approx(least, rel=1e-3)


def test_a_clutch_closes_on_the_way() -> None:
    system = two_carts("clutching", X.diff() - Y.diff())
    problem = dmoc.Problem(
        system, start={"x": 0, "y": 0, **STILL}, goal={"y": 2, "y_dot": 1}, final_time=3
    )
    assert best_of(problem).sequence == ("+hand",)


def test_a_hand_catches_a_ball_and_carries_it() -> None:
    """The hand of 1 kg is moved with u = a + g; with the ball of 0.5 kg with 1.5 (a + g)."""
    hx, hy, bx, by, fx, fy = dynamicsymbols("hx hy bx by fx fy")
    g = 9.81
    hand = (hx.diff() ** 2 + hy.diff() ** 2) / 2 - g * hy
    ball = (bx.diff() ** 2 + by.diff() ** 2) / 4 - g * by / 2
    system = dmoc.MechanicalSystem(
        "catching", [hx, hy, bx, by], hand + ball, inputs=[fx, fy], forces={hx: fx, hy: fy},
        grips={"hand": (hx - bx, hy - by)}, cost=(fx**2 + fy**2) / 2,
    )  # fmt: skip
    still = dict.fromkeys(("hx_dot", "hy_dot", "bx_dot", "by_dot"), 0)
    problem = dmoc.Problem(
        system, start={"hx": 0, "hy": 0, "bx": 1, "by": 2, **still, "bx_dot": -0.5},
        goal={"hx": 1, "hy": 1, "bx": 1, "by": 1, **still}, final_time=1.5,
    )  # fmt: skip

    def cost(p: np.ndarray) -> float:
        T, *v = p
        place, own = (1 - 0.5 * T, 2 - g * T**2 / 2), (-0.5, -g * T)
        total, left = 0.0, 1.5 - T
        for i, weight in enumerate((0.0, g)):
            w = (v[i] + 0.5 * own[i]) / 1.5
            before = effort(1, place[i], v[i], T) + weight * v[i] + weight**2 * T / 2
            after = effort(1, 1 - place[i], w, left) - weight * w + weight**2 * left / 2
            total += before + 1.5**2 * after
        return total

    least = minimize(cost, [0.5, 1.0, 1.0], method="Nelder-Mead", options={"fatol": 1e-10})
    best = best_of(problem)
    assert best.sequence == ("+hand",)
    assert best.cost == pytest.approx(least.fun, rel=1e-3)


def test_a_grip_that_closes_wherever_it_is_counts_by_how_it_moves() -> None:
    """Three steps with a force: its places stand, or move by more than the force is."""
    for by_rate, closes in (((), [False] * 3), (("hand",), [True, False, True])):
        contacts = Contacts(("hand",), (), grips=(("hand", ("hand",)),), by_rate=by_rate)
        closed = np.zeros((3, 1), dtype=bool)
        places = np.array([[0.7], [0.7], [0.9], [0.9]])
        _close_grips(closed, Touch(contacts, (), (), Open()), np.full((3, 1), 0.5), places)
        assert closed[:, 0].tolist() == closes
