"""Solvers in C of problems whose parameters change from phase to phase."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import ProblemError

X, U = dynamicsymbols("x u")
V = X.diff()


def test_a_solver_in_c_takes_a_value_for_each_phase(tmp_path: Path) -> None:
    """Through a hit, and to a velocity at the goal, whose momentum is that of the last mass."""
    m, k, c = sp.symbols("m k c")
    slung = dmoc.MechanicalSystem(
        "slung", [X], m * V**2 / 2 - k * X**2 / 2, {m: 1, k: 1, c: 0.1}, [U], {X: U - c * V},
        surfaces={"wall": X <= 1}, cost=U**2 / 2,
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(slung, order=4), {X: 0, V: 0.5}, {X: 0.2, V: -0.4}, ["wall"], steps=6,
        final_time=1.5, parameters={k: [1, 6], m: [1.5, 2]}, restitution=0.7,
    )  # fmt: skip
    nominal = dmoc.solve(problem, "ipm", starts=1)
    dmoc.generate_solver(problem, tmp_path / "slung", guess=nominal)
    solver = dmoc.load_solver(tmp_path / "slung")
    named = [name for name in solver.numbers if name.startswith("parameters")]
    assert named == [f"parameters.{name}" for name in ("m.0", "m.1", "k.0", "k.1", "c")]
    values = {"k": [2, 7], "m": [1.4, 2.2], "c": 0.2}
    solver.set(parameters=values)
    end, same = solver.solve(), dmoc.solve(problem.but(parameters=values), "ipm", guess=nominal)
    assert end.status == "solved" and end.cost == pytest.approx(same.cost, rel=1e-12)
    for table, rows in (("velocities", "v"), ("momenta", "p")):
        expected = np.concatenate([getattr(phase, rows) for phase in same.phases])
        np.testing.assert_allclose(end.tables[table], expected, atol=1e-10)
    for wrong in (3.0, [1], [1, 2, 3]):
        with pytest.raises(ProblemError, match="expected 2 values, one for each phase"):
            solver.set(parameters={"k": wrong})
    with pytest.raises(ProblemError, match=r"parameters\.m\.0 = -1: expected a positive def"):
        solver.set(parameters={"m": [-1, 2]})
        solver.solve()
    solver.set(parameters={"m": [1.5, -2]})
    assert solver.solve().status == "unphysical"
