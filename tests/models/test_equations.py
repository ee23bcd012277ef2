"""The equations of the shipped models, as they are derived by hand."""

from __future__ import annotations

from typing import Any

import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from dmoc.models.registry import find

TIME = dynamicsymbols._t
m, l, g, m_p, m_c = sp.symbols("m l g m_p m_c")
theta, alpha, x, y, F, f_x, f_y = dynamicsymbols("theta alpha x y F f_x f_y")
# Of each coordinate what its inertia needs beyond its forces, which is zero along a motion.
EQUATIONS: dict[str, dict[Any, Any]] = {
    "bouncing_pendulum": {theta: m * l**2 * theta.diff(TIME, 2) + m * g * l * sp.sin(theta)},
    "puck_table": {x: m * x.diff(TIME, 2) - f_x, y: m * y.diff(TIME, 2) - f_y},
    "cart_pendulum": {
        alpha: m_p * l**2 * alpha.diff(TIME, 2)
        - m_p * l * sp.sin(alpha) * x.diff(TIME, 2)
        + m_p * g * l * sp.cos(alpha),
        x: (m_c + m_p) * x.diff(TIME, 2)
        - m_p * l * (sp.sin(alpha) * alpha.diff(TIME, 2) + sp.cos(alpha) * alpha.diff() ** 2)
        - F,
    },
}


@pytest.mark.parametrize("model", sorted(EQUATIONS))
def test_a_shipped_model_moves_as_its_equations_say(model: str) -> None:
    system = find(model).system()
    lagrangian = system.lagrangian.subs({s: sp.Symbol(s.name) for s in system.parameters})
    assert set(system.coordinates) == set(EQUATIONS[model])
    for c, equation in EQUATIONS[model].items():
        inertia = lagrangian.diff(c.diff()).diff(TIME) - lagrangian.diff(c)
        assert sp.simplify(inertia - system.forces.get(c, 0) - equation) == 0, c
