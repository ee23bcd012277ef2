"""What is proved of all sequences of a search."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.deadline import Deadline
from dmoc.base.table import plain
from dmoc.models.registry import find
from dmoc.proving.prove import lower_bound
from dmoc.sequences import proofs
from dmoc.sequences.proofs import Bounded, Claim, TreeProof
from dmoc.sequences.settings import settings_of


def puck(**changes: Any) -> dmoc.Problem:
    reference = find("puck_table")
    return dmoc.Problem(reference.kernels(4), **{**reference.defaults, "steps": 2, **changes})


@pytest.fixture(scope="module")
def result() -> dmoc.SearchResult:
    return dmoc.search(puck(), 2, prove=True)


def test_all_words_of_two_hits_are_bounded(result: dmoc.SearchResult) -> None:
    """Unfolded, east and west cost 0.535: the least of all sequences of at most two hits."""
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


def test_the_table_the_tree_and_its_page_say_what_is_proved(
    result: dmoc.SearchResult, tmp_path: Path
) -> None:
    head, rows = result.summary().head, result.summary().rows
    assert head == ("sequence", "verdict", "cost", "proved")
    assert plain(rows[0][3]).startswith("optimal, >= 0.5349")
    assert all(plain(row[3]).startswith("pointless, >= ") for row in rows[1:])
    figure = result.plot()
    assert all(text.get_text().endswith(" \N{END OF PROOF}") for text in figure.axes[0].texts)
    assert figure.legends[0].get_texts()[-1].get_text() == "\N{END OF PROOF} proved (21)"
    statement = "proved: no sequence of at most 2 events has a motion that costs less than 0.53494"
    assert " ".join(figure.get_suptitle().split()).startswith(statement)
    page = result.animate(tmp_path / "tree.html").read_text()
    film = json.loads(page.partition('id="film">')[2].partition("</script>")[0])
    assert film["statement"].startswith(statement)
    proved = {tuple(node["sequence"]): node["proved"] for node in film["tree"]}
    assert proved["east", "west"].startswith("optimal (proved): it costs at least 0.5349")
    assert proved["north", "east"].startswith("pointless (proved): whatever begins with north")


def test_a_sequence_is_bounded_by_what_it_begins_with() -> None:
    bounded = (
        Bounded((), Claim.OPEN, -np.inf, why="time ran out"),
        Bounded(("east",), Claim.POINTLESS, 2.0),
        Bounded(("west",), Claim.IMPOSSIBLE, np.inf, below=True),
        Bounded(("north",), Claim.OPEN, 0.5),
    )
    proof = TreeProof(bounded, 1.0, 2, False)
    assert proof.of(("east",)) is bounded[1] and proof.of(("east", "west")) is None
    assert proof.of(("west", "east")) is proof.of(("west",)) is bounded[2]
    assert [str(b) for b in bounded] == [
        "open: time ran out",
        "pointless (proved): it costs at least 2",
        "impossible (proved): no motion begins with west",
        "open: it costs at least 0.5",
    ]
    assert str(Bounded((), Claim.IMPOSSIBLE, np.inf)) == "impossible (proved): it has no motion"
    assert proof.in_words == "not proved: no bound of 2 of 4 sequences is enough"


def test_what_is_open_has_no_mark(result: dmoc.SearchResult) -> None:
    assert result.proof is not None
    bounded = tuple(replace(b, claim=Claim.OPEN) for b in result.proof.bounded)
    opened = replace(result, proof=replace(result.proof, bounded=bounded, complete=False))
    figure = opened.plot()
    assert not any("\N{END OF PROOF}" in text.get_text() for text in figure.axes[0].texts)
    assert "\N{END OF PROOF}" not in figure.legends[0].get_texts()[-1].get_text()
    assert figure.get_suptitle().startswith("not proved: no bound of")


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
    problem = puck()
    settings = settings_of(problem, {"method": "ipm", "max_collisions": 2})
    proof = proofs.proof_of(problem, settings, (("east", "west"), 0.535), Deadline.after(0.0))
    assert not proof.complete and "time ran out" in proof.statement


def test_prefixes_of_periodic_motions_are_not_periodic() -> None:
    """A hit of the wall costs nothing; that it is not where the motion began says nothing of what
    follows."""
    problem = puck(goal={}, periodic=["x", "y"])
    settings = settings_of(problem, {"method": "ipm", "max_collisions": 1})
    until = Deadline.after(10.0)
    assert proofs._of_prefix(problem, settings, ("east",), 1.0, until) is None
    whole = proofs._of_sequence(problem, settings, ("east",), None, 1e-3, until)
    assert whole.claim is Claim.POINTLESS


def test_ctrl_c_keeps_what_was_bounded_until_then(monkeypatch: pytest.MonkeyPatch) -> None:
    bounds = iter(range(99))

    def interrupted(*arguments: Any, **options: Any) -> tuple[float, float, bool]:
        if next(bounds) == 4:
            raise KeyboardInterrupt
        return lower_bound(*arguments, **options)

    monkeypatch.setattr(proofs, "lower_bound", interrupted)
    problem = puck()
    settings = settings_of(problem, {"method": "ipm", "max_collisions": 1})
    proof = proofs.proof_of(problem, settings, (("east", "west"), 0.535), Deadline.after(60.0))
    assert not proof.complete and 1 < len(proof.bounded) < 5
    assert all(b.claim is Claim.POINTLESS for b in proof.bounded)
    assert proof.in_words == "not proved: time ran out before all sequences were looked at"


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


def test_workers_bound_boxes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those of prefixes and of whole sequences."""
    problem, seen = puck(), list[int]()

    def bound(*arguments: Any, workers: int = 1, **options: Any) -> tuple[float, float, bool]:
        seen.append(workers)
        return -np.inf, np.inf, False

    monkeypatch.setattr(proofs, "lower_bound", bound)
    settings = settings_of(problem, {"max_collisions": 1, "workers": 3, "method": "ipm"})
    proofs.proof_of(problem, settings, None, Deadline.after(60))
    assert seen == [3] * 9
