"""A problem at other values of its design: nothing is left of the values before."""

from __future__ import annotations

from dataclasses import is_dataclass
from typing import Any

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.problem.design import designed
from dmoc.problem.problem import Problem

X, Y, A, U = dynamicsymbols("x y a u")
S, MASS, MU, REST = sp.symbols("s mass mu rest")
PROPERTIES = [
    name for name, of in vars(Problem).items() if hasattr(of, "func") or isinstance(of, property)
]
BEFORE = {"s": 0.0, "mass": 2.0, "mu": 0.4, "rest": 0.2}
AFTER = {"s": -0.4, "mass": 0.7, "mu": 0.8, "rest": 0.6}


def _slope(own: dict[str, float]) -> dmoc.MechanicalSystem:
    """A block on a floor of a slope, beside a wall, with a flywheel on a constraint: whatever a
    design may change."""
    V, W, OMEGA = X.diff(), Y.diff(), A.diff()
    return dmoc.MechanicalSystem(
        "chosen",
        [X, Y, A],
        MASS * (V**2 + W**2) / 2 + OMEGA**2 / 2 - MASS * Y - (A - S) ** 2 / 2,
        {name: own[str(name)] for name in (S, MASS, MU, REST)},
        inputs=[U],
        forces={X: MASS * U},
        cost=U**2,
        surfaces={"floor": Y >= S * X, "wall": X <= 2 + S, "ledge": Y >= 0},
        tangents={"floor": X},
        friction={"floor": MU},
        restitution={"wall": REST},
        constraints={"tie": A - MASS * X},
        quantities={"reach": X + S * A},
    )


def stated(own: dict[str, float], **fields: Any) -> dmoc.Problem:
    """The problem whose design begins with the model's own values."""
    ranges = dict.fromkeys(own, (0.1, 3.0)) | {"s": (-3.0, 3.0), "rest": (0.1, 0.9)}
    return dmoc.Problem(_slope(own), design=ranges, **fields)


FIELDS = [
    {"start": {"x": 0, "y": 3, "x_dot": 1}, "sequence": ["wall"], "goal": {"x": 0.5}},
    {
        "start": {"x": (0, 1), "y": (-1, 1), "p_x": 1.0}, "contacts": ["floor:slip+"],
        "goal": {"x": 1.0},
    },
    {
        "start": {"x": (-1, 1), "y": 4, "reach": 0.1}, "bounds": {"u": (-5, 5)},
        "goal": {"x_dot": 0.5, "reach": (0, 2)},
    },
    {"start": {"x": (-1, 1), "y": 4, "p_x": 1, "p_y": 2, "p_a": 3}, "goal": {"x": 1}},
    {"start": {"x": 0, "y": 0}, "contacts": ["floor:stick", "ledge"], "goal": {"y": 0}},
]  # fmt: skip


@pytest.mark.parametrize("fields", FIELDS)
def test_nothing_of_another_design_is_left(fields: dict[str, Any]) -> None:
    problem, fresh = (stated(own, **fields) for own in (BEFORE, AFTER))
    for name in PROPERTIES:
        getattr(problem, name)
    other = designed(problem, np.array(list(AFTER.values())))
    changed = [
        name for name in PROPERTIES if not _same(getattr(problem, name), getattr(other, name))
    ]
    assert {"model", "parameter_values", "design_values"} <= set(changed)
    for name in PROPERTIES:
        assert _same(getattr(other, name), getattr(fresh, name)), name


def _same(a: Any, b: Any) -> bool:
    """Whether two values are the same number by number; kernels are those of one model."""
    if isinstance(a, Kernels):
        return True
    if isinstance(a, np.ndarray):
        return np.array_equal(a, b, equal_nan=a.dtype.kind == "f")
    if is_dataclass(a) and not isinstance(a, type):
        return type(a) is type(b) and all(
            _same(getattr(a, name), getattr(b, name)) for name in a.__dataclass_fields__
        )
    if isinstance(a, dict):
        return list(a) == list(b) and all(_same(a[key], b[key]) for key in a)
    if isinstance(a, list | tuple):
        return len(a) == len(b) and all(map(_same, a, b))
    return bool(a == b)
