"""The law of impact that a proof is of, and the one that a solve states."""

from __future__ import annotations

import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.proving.global_proof import IN_RATES, Claim

x, u = dynamicsymbols("x u")
LIFTED = dmoc.MechanicalSystem(
    "lifted", [x], x.diff() ** 2 - sp.Rational(4) * x, inputs=[u], forces={x: u},
    surfaces={"ceiling": x <= 1}, cost=u**2 / 2,
)  # fmt: skip


def test_steps_on_which_energies_differ_from_rates_are_named() -> None:
    """A weight that bounces off a ceiling: energies of long steps are not those of the nodes, so
    that a solve finds a motion below the bound of those that bounce in the rates."""
    problem = dmoc.Problem(
        dmoc.build(LIFTED, order=2), start={"x": 0, "x_dot": 0.5}, goal={"x": 0.6},
        sequence=["ceiling"], restitution=0.8, final_time=1, steps=4,
    )  # fmt: skip
    proof, answer = dmoc.prove(problem), dmoc.solve(problem, "ipm", starts=1, verify=False)
    assert proof.claim is Claim.OPTIMAL and answer.cost < (1 - 1e-4) * proof.bound
    assert f"of order 2, {IN_RATES}, " in proof.statement
    before, after = answer.phases
    assert after.v[0, 0] != pytest.approx(-0.8 * before.v[-1, 0], rel=1e-4)
    before, after = proof.solution.phases
    assert after.v[0, 0] == pytest.approx(-0.8 * before.v[-1, 0], rel=1e-9)
    # What lands is stated in the rates always.
    assert IN_RATES not in dmoc.prove(problem.but(restitution=0)).statement
