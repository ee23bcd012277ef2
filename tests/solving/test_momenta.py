"""Bounds of momenta: known answers, both sides of a hit, and names."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy as sp
from answers import answer_of
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import ModelError, ProblemError

pytestmark = pytest.mark.slow

x, u, w = dynamicsymbols("x u w")
m = sp.Symbol("m")


def mass(**fields: Any) -> dmoc.MechanicalSystem:
    """1 kg on a line."""
    return dmoc.MechanicalSystem(
        "mass", [x], m * x.diff() ** 2 / 2, {m: 1.0}, [u], {x: u}, cost=u**2 / 2, **fields
    )


@pytest.mark.parametrize("backend", ["auto", "numpy"])
def test_a_momentum_keeps_its_bounds(backend):
    """m = 2 kg, 1 m in 1 s, int u^2/2, v <= 1.2 m/s: 4 * 7.68, by a ramp, a glide and a ramp."""
    heavy = dmoc.MechanicalSystem(
        "heavy", [x], m * x.diff() ** 2 / 2, {m: 2.0}, [u], {x: u}, cost=u**2 / 2, units={x: "m"}
    )
    kernels = dmoc.build(heavy, order=4, backend=backend)
    limited = dmoc.Problem(
        kernels, {x: 0}, {x: 1, "x_dot": 0}, final_time=1, steps=30, bounds={"p_x": (None, 2.4)}
    )
    method = "slsqp" if backend == "numpy" else "ipm"
    solution = answer_of(limited, method)
    assert solution.cost == pytest.approx(30.72, rel=1e-3)
    assert solution.trajectory.limits == {"momentum_x": (-np.inf, 2.4)}
    assert any("momentum_x" in bound for bound in solution.active_bounds)
    wider = limited.but(bounds={"p_x": (None, 3.5)})  # the free motion has 3 kg m/s at most
    assert wider.kernels is limited.kernels and wider.kernels.backend == limited.kernels.backend
    assert answer_of(wider, method).cost == pytest.approx(24, rel=1e-6)


def test_bounds_of_momenta_hold_on_both_sides_of_a_hit():
    """Of a double pendulum, whose momenta contain both rates."""
    a, b = dynamicsymbols("a b")
    rates = 2 * a.diff() ** 2 + b.diff() ** 2 + 2 * sp.cos(a - b) * a.diff() * b.diff()
    pair = dmoc.MechanicalSystem(
        "pair", [a, b], rates / 2 + 9.81 * (2 * sp.cos(a) + sp.cos(b)), inputs=[u, w],
        forces={a: u, b: w}, surfaces={"wall": a <= 0.5}, cost=u**2 + w**2,
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(pair, order=4), {a: 0, b: 0}, {a: 0, b: 0, "a_dot": 0, "b_dot": 0}, ["wall"],
        steps=30, final_time=1.5, restitution=0.8, bounds={"p_a": (-1.0, 1.4), "p_b": (-1, 1)},
    )  # fmt: skip
    solution = answer_of(problem, "ipm")
    p = np.vstack([phase.p for phase in solution.phases])
    assert (p.min(axis=0) > (-1.001, -1.001)).all() and (p.max(axis=0) < (1.401, 1.001)).all()
    assert p[:, 0].max() == pytest.approx(1.4, abs=1e-3)


def test_momenta_are_bounded_by_one_name():
    named = {"quantities": {"momentum_x": m * x.diff()}}
    limited = dmoc.Problem(mass(**named), {"x": 0}, {"x": 1}, final_time=1, bounds={"p_x": (0, 2)})
    assert limited.bounds == {"momentum_x": (0, 2)}
    other = limited.but(kernels=dmoc.build(mass(), order=4))
    assert "momentum_x" in other.kernels.quantities
    with pytest.raises(ProblemError, match="bounds give p_x and momentum_x, the same momentum"):
        limited.but(bounds={"p_x": (0, 1), "momentum_x": (0, 2)})
    with pytest.raises(ModelError, match="has the name of the momentum of x along the way"):
        mass(quantities={"momentum_x": x})
