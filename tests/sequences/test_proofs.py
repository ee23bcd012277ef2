"""What is proved of all sequences of a search."""

from __future__ import annotations

from typing import Any

import pytest
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.models.registry import find
from dmoc.sequences.proofs import Claim


def puck(**changes: Any) -> dmoc.Problem:
    reference = find("puck_table")
    return dmoc.Problem(reference.kernels(4), **{**reference.defaults, "steps": 2, **changes})


def test_all_words_of_two_hits_are_bounded() -> None:
    """Unfolded, east and west cost 0.535: the least of all sequences of at most two hits."""
    result = dmoc.search(puck(), 2, prove=True)
    proof = result.proof
    assert proof is not None and proof.complete and proof.longest == 2
    assert result.best is not None and result.best.sequence == ("east", "west")
    assert result.best.cost == pytest.approx(0.535, rel=1e-6)
    claims = {b.sequence: b for b in proof.bounded}
    assert claims["east", "west"].claim is Claim.OPTIMAL
    assert all(b.claim is Claim.POINTLESS for s, b in claims.items() if s != ("east", "west"))
    # Prefixes whose bound is enough stand for all that begins with them.
    covered = sum(4 ** (2 - len(s)) if b.below else 1 for s, b in claims.items())
    assert covered + sum(b.below for s, b in claims.items() if len(s) == 1) == 21
    nodes = {node.sequence: node.cost for node in result.nodes}
    assert all(b.bound <= (nodes[s] or 1e9) * (1 + 1e-9) for s, b in claims.items() if not b.below)
    assert "no sequence of at most 2 events has a motion that costs less" in proof.statement
    assert proof.statement in " ".join(str(result).split())
    assert "pointless (proved)" in str(proof)
    assert result.to_dict()["proof"]["complete"] is True


def test_inputs_that_are_too_weak_make_all_sequences_impossible() -> None:
    """A force of at most 0.1 N moves 1 kg by 0.2 m in the two seconds beside its free motion, and
    changes its speed by 0.2 m/s at most: free motions that unfold to the goal are farther off."""
    weak = puck(bounds={"f_x": (-0.1, 0.1), "f_y": (-0.1, 0.1)})
    proof = dmoc.search(weak, 1, starts=0, prove=True).proof
    assert proof is not None and proof.complete and proof.cost is None
    assert {b.claim for b in proof.bounded} == {Claim.IMPOSSIBLE}
    assert proof.statement == "no sequence of at most 1 events has a motion"


def test_a_best_motion_that_costs_nothing() -> None:
    """At rest where it is to be at rest: all that a hit could bring is cost."""
    rest = {"x": 0.3, "y": 0.2, "x_dot": 0.0, "y_dot": 0.0}
    proof = dmoc.search(puck(start=rest, goal=rest), 1, prove=True).proof
    assert proof is not None and proof.complete and proof.cost == pytest.approx(0.0, abs=1e-12)
    assert proof.bounded[0].claim is Claim.OPTIMAL
    # Nothing bounds the inputs, so that no hit is impossible, however dear.
    assert {b.claim for b in proof.bounded[1:]} == {Claim.POINTLESS}


def test_what_is_not_linear_is_refused_before_the_search() -> None:
    reference = find("cart_pendulum")
    problem = dmoc.Problem(reference.kernels(), **reference.defaults)
    with pytest.raises(dmoc.DmocError, match="prove: the mass matrix depends on alpha"):
        dmoc.search(problem, prove=True)


def test_what_is_left_when_time_runs_out() -> None:
    from dmoc.base.deadline import Deadline
    from dmoc.sequences.proofs import proof_of
    from dmoc.sequences.settings import settings_of

    problem = puck()
    settings = settings_of(problem, {"method": "ipm", "max_collisions": 2})
    proof = proof_of(problem, settings, (("east", "west"), 0.535), Deadline.after(0.0))
    assert not proof.complete and "time ran out" in proof.statement


def test_a_model_that_is_driven_alone_by_time_has_proofs_too() -> None:
    """The time is the cost: 1 N moves 1 kg by 2 m in 2 s, rest to rest over 1 m in 2 s."""
    x, u = dynamicsymbols("x u")
    cart = dmoc.MechanicalSystem(
        "timed", [x], x.diff() ** 2 / 2, inputs=[u], forces={x: u}, surfaces={"wall": x <= 3},
        cost=1 + 0 * u,
    )  # fmt: skip
    problem = dmoc.Problem(
        cart, start={"x": 0.0}, goal={"x": 1.0, "x_dot": 0.0}, final_time=(0.1, 5.0), steps=4,
        bounds={"u": (-1, 1)},
    )  # fmt: skip
    proof = dmoc.prove(problem, gap=1e-3)
    assert proof.proved and proof.bound == pytest.approx(2.0, rel=1e-3)
