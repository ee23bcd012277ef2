"""Two links that swing from hold to hold: a motion without cost beside that of SciPy."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve
from sympy.physics.mechanics import dynamicsymbols

import dmoc

pytestmark = pytest.mark.slow

GRAVITY, SHOULDER = 9.81, 3.0  # masses of rods and their lengths are 1


def brachiator() -> dmoc.MechanicalSystem:
    """Two rods with a mass between them; its left hand holds at 0, its right hand a hold on."""
    x, y, a, b, u = dynamicsymbols("x y a b u")
    hold = sp.Symbol("hold")
    along = {angle: sp.Matrix([sp.sin(angle), -sp.cos(angle)]) for angle in (a, b)}
    shoulder = sp.Matrix([x, y]) + along[a]
    tip, lagrangian = shoulder + along[b], (a.diff() ** 2 + b.diff() ** 2) / 24
    for m, place in (
        (1, shoulder - along[a] / 2),
        (SHOULDER, shoulder),
        (1, shoulder + along[b] / 2),
    ):
        v = place.diff(dynamicsymbols._t)
        lagrangian += m * (v.dot(v) / 2 - GRAVITY * place[1])
    return dmoc.MechanicalSystem(
        "brachiator",
        coordinates=[x, y, a, b],
        inputs=[u],
        lagrangian=lagrangian,
        forces={a: -u, b: u},
        grips={"left": (x, y), "right": (tip[0] - hold, tip[1])},
        quantities={"behind": tip[0] + hold, "height": tip[1]},
        parameters={hold: 1.0},
        cost=u**2 / 2,
    )


def swung(hold: float, time: float) -> np.ndarray:
    """Angles and rates of the links a time after the hand lets go of the hold behind."""
    inertia = 1 / 3 + SHOULDER + 1

    def slope(t: float, s: np.ndarray) -> np.ndarray:
        a, b, va, vb = s
        c, d = np.cos(a - b) / 2, np.sin(a - b) / 2
        pull = -GRAVITY * np.array([(1.5 + SHOULDER) * np.sin(a), np.sin(b) / 2])
        turn = np.array([-d * vb**2, d * va**2])
        return np.concatenate([s[2:], np.linalg.solve([[inertia, c], [c, 1 / 3]], pull + turn)])

    lean = np.arcsin(hold / 2)
    start = [-lean, lean - np.pi, 0, 0]
    return np.asarray(solve_ivp(slope, (0, time), start, "DOP853", rtol=1e-13, atol=1e-13).y[:, -1])


def test_a_swing_from_rest_to_rest_costs_nothing_at_the_right_distance() -> None:
    """It is its own mirror image, backwards in time: half way, both links hang down."""
    hold, time = fsolve(lambda p: swung(p[0], p[1] / 2)[:2], [1.05, 1.22], xtol=1e-13)
    lean, rates = np.arcsin(hold / 2), dict.fromkeys(("x_dot", "y_dot", "a_dot", "b_dot"), 0)
    assert swung(hold, time) == pytest.approx([lean, np.pi - lean, 0, 0], abs=1e-10)
    problem = dmoc.Problem(
        dmoc.build(brachiator(), order=6),
        start={"x": 0, "y": 0, "a": None, "b": None, "behind": 0, "height": 0} | rates,
        goal=rates,
        contacts=["left"],
        sequence=["+right -left"],
        durations=[None, 0],
        design={"hold": (1.0, 1.2)},
        final_time=(1.0, 1.4),
        steps=30,
    )
    guess = {"a": [-0.6, 0.6], "b": [-2.6, 2.6], "x": 0.0, "y": 0.0}
    solution = dmoc.solve(problem, "ipm", guess=guess, starts=1)
    (closes,) = solution.collisions
    assert solution.status == "solved" and solution.cost == pytest.approx(0, abs=1e-12)
    assert solution.design["hold"] == pytest.approx(hold, abs=1e-8)
    assert closes.time == pytest.approx(time, abs=1e-8)
    assert closes.impulses["right_1"] == pytest.approx(0, abs=1e-8)
