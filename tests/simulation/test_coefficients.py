"""Friction that no law has, as parameters make it in a simulation."""

from __future__ import annotations

from typing import Any

import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import SimulationError

x, y = dynamicsymbols("x y")
mu, mu_s, k = sp.symbols("mu mu_s k")
NEGATIVE, PAIR = "expected 0 or a positive number", "expected the larger one first"


VALUES = {mu: 0.3, mu_s: 0.5, k: 0.1}


def block(friction: Any) -> dmoc.MechanicalSystem:
    used = sp.Tuple(friction).free_symbols
    return dmoc.MechanicalSystem(
        "rubbing_block", [x, y], (x.diff() ** 2 + y.diff() ** 2) / 2 - 9.81 * y,
        {s: value for s, value in VALUES.items() if s in used}, surfaces={"floor": y >= 0},
        tangents={"floor": x}, friction={"floor": friction},
    )  # fmt: skip


@pytest.mark.parametrize(
    ("friction", "changes", "says"),
    [
        (mu, {"mu": -0.3}, f"the friction of 'floor' is -0.3: {NEGATIVE}"),
        (mu - k, {"k": 1}, f"the friction of 'floor' is -0.7: {NEGATIVE}"),
        (sp.sqrt(mu), {"mu": -1}, f"the friction of 'floor' is nan: {NEGATIVE}"),
        ((mu, -mu_s), {}, f"the friction of 'floor' is -0.5: {NEGATIVE}"),
        ((mu_s, mu), {"mu": 0.8}, f"is 0.5, below the kinetic one, 0.8: {PAIR}"),
        ((mu, mu * k), {"k": 1.5}, f"is 0.3, below the kinetic one, 0.45: {PAIR}"),
        ((mu_s * (1 + x**2), mu), {"mu": 0.8}, "is 0.5 at t = 0 s, x = 0, y = 0, below the kin"),
        (
            (mu_s, mu * sp.exp(-dmoc.sliding_speed)),
            {"mu": 0.8},
            "is 0.5 at t = 0 s, x = 0, y = 0, below the kinetic one, 0.8",
        ),
    ],
)
def test_parameters_that_make_no_friction_are_refused(
    friction: Any, changes: dict[str, float], says: str
) -> None:
    with pytest.raises(SimulationError) as refused:
        dmoc.simulate(block(friction), {}, {"x": 1}, step_size=0.01, steps=9, parameters=changes)
    assert says in str(refused.value)


def test_a_hit_where_friction_is_negative_is_refused() -> None:
    """It would push: the energy would grow fourfold."""
    with pytest.raises(SimulationError, match=r"the friction of 'floor' is -0\.\d+ at t = 0\.2332"):
        dmoc.simulate(
            block(mu * (1 - k * x)), {x: 1, y: 0.5}, {"x": 1, "y": -1}, step_size=0.01, steps=30,
            parameters={"k": 3},
        )  # fmt: skip
