"""What becomes of proposed sequences: which are solved, what is tried beside them, and the tree
that goes on around them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from searches import unnamed

import dmoc
from dmoc.base.deadline import ENDLESS
from dmoc.guess.folded import Folded
from dmoc.guess.transfer import pieces_of
from dmoc.sequences import relaxation
from dmoc.sequences.candidates import Candidates
from dmoc.sequences.nodes import Node, Verdict
from dmoc.sequences.notes import notes_of_proposals
from dmoc.sequences.proposals import Proposals, Proposed
from dmoc.sequences.relaxation import Relaxation
from dmoc.sequences.search import Progress, SearchResult
from dmoc.sequences.settings import settings_of
from dmoc.sequences.tree import FINER

pytestmark = pytest.mark.slow

UNCONFIRMED = (Verdict.FAILED, Verdict.UNVERIFIED)


@pytest.fixture
def proposals() -> Proposals:
    """Those of the cart-pendulum, of which there are none yet."""
    problem = unnamed("cart_pendulum")
    settings = settings_of(problem, {"strategy": "propose", "method": "ipm"})
    return Proposals(problem, Relaxation.of(problem, settings), settings)


def test_both_goes_on_with_the_tree_around_the_proposals() -> None:
    problem = unnamed("puck_table", steps=16)
    both = dmoc.search(problem, 1, strategy="both")
    tree = dmoc.search(problem, 1)
    assert {n.sequence for n in tree.nodes} <= {n.sequence for n in both.nodes}
    assert both.best is not None and tree.best is not None
    assert both.best.cost == pytest.approx(tree.best.cost, rel=1e-3)
    assert both.proposals and not tree.proposals


def test_the_tree_solves_proposals_too_and_the_better_one_counts(
    proposals: Proposals, swung: SearchResult
) -> None:
    """The relaxed motion of a sequence may be nearer to a dearer minimum than its parent's, or to
    none that is confirmed."""
    candidates, best = Candidates(proposals, ENDLESS), swung.best
    assert best is not None and best.cost is not None
    words, cost = best.sequence, best.cost
    dear, doubted = replace(best, cost=2 * cost), replace(best, verdict=Verdict.UNVERIFIED)
    failed = Node(words, Verdict.FAILED)
    for before, own, kept in (
        (dear, best, best), (best, dear, best), (doubted, dear, dear), (dear, doubted, dear),
        (failed, doubted, doubted), (doubted, failed, doubted),
    ):  # fmt: skip
        candidates.nodes = {words: before}
        tree = candidates.surrounded()
        assert not tree.recorded and (tree.best() is None) == (before.verdict in UNCONFIRMED)
        tree.nodes = {words: own}
        assert tree.joined() == {words: kept}


def test_where_none_is_confirmed_the_cheapest_has_neighbours_once(
    proposals: Proposals, swung: SearchResult
) -> None:
    """As a box that tips over, whose one proposal the simulation contradicts on every mesh."""
    candidates, best = Candidates(proposals, ENDLESS), swung.best
    assert best is not None
    candidates.frontier = []
    candidates.nodes = {best.sequence: replace(best, verdict=Verdict.UNVERIFIED)}
    assert next(candidates.rounds(), None) is None  # finer meshes come first
    candidates.refined = {(best.sequence, FINER)}
    assert next(candidates.rounds())
    assert {("lower",), ("lower", "lower", "lower")} <= set(candidates.frontier)
    candidates.frontier = []
    assert next(candidates.rounds(), None) is None


def test_where_no_proposal_leads_to_a_motion_the_cheapest_has_neighbours(
    proposals: Proposals, swung: SearchResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a walker, whose relaxed foot trembles as it lands; first with one event less."""
    best = swung.best
    monkeypatch.setattr(Proposals, "in_detail", lambda _: {})
    assert best is not None and best.solution is not None
    words, impulses = best.sequence, tuple(c.impulse for c in best.solution.collisions)
    motion = Folded(words, tuple(pieces_of(best.solution.trajectory)), impulses)
    proposals.proposed, proposals.motions = {words: Proposed(words, 1.0)}, {words: motion}
    candidates = Candidates(proposals, ENDLESS)
    candidates.frontier = []
    candidates.nodes = {words: Node(words, Verdict.FAILED)}
    rounds = candidates.rounds()
    assert next(rounds) == [("lower",)]
    candidates.frontier, candidates.nodes["lower",] = [], Node(("lower",), Verdict.FAILED)
    assert next(rounds)
    assert ("lower", "lower", "lower") in candidates.frontier


def test_other_ways_are_looked_for_where_there_is_no_motion(
    proposals: Proposals, swung: SearchResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a box that tips over, whose corner lands while the other one lifts."""
    asked, best = list[Verdict](), swung.best
    assert best is not None
    candidates = Candidates(proposals, ENDLESS)
    for verdict in Verdict:
        monkeypatch.setattr(candidates, "_other_ways", lambda _, v=verdict: asked.append(v))
        candidates.nodes, candidates.frontier = {}, [best.sequence]
        candidates._add(replace(best, verdict=verdict))
    assert set(Verdict) - set(asked) == {Verdict.OPTIMAL, Verdict.FEASIBLE}


def test_an_unconfirmed_motion_that_promises_little_is_not_doubtful(proposals: Proposals) -> None:
    """On the mesh of both; the best costs more on the finer one that confirms it."""
    candidates = Candidates(proposals, ENDLESS)
    best, little, much = ("lower",), ("upper",), ("lower", "lower")
    candidates.nodes = {
        best: Node(best, Verdict.FEASIBLE, 1.2), little: Node(little, Verdict.UNVERIFIED, 0.995),
        much: Node(much, Verdict.UNVERIFIED, 0.985),
    }  # fmt: skip
    candidates.first = {best: 1.0, little: 0.995, much: 0.985}
    assert [n.sequence for n in candidates.doubtful()] == [much]


def test_proposals_that_cost_over_a_third_more_than_the_best_are_not_solved(
    proposals: Proposals,
) -> None:
    costs = {("lower",): 1.0, ("upper",): 1.34, ("lower", "upper"): 1.36}
    proposals.proposed = {words: Proposed(words, cost) for words, cost in costs.items()}
    candidates = Candidates(proposals, ENDLESS)
    rounds = candidates.rounds()
    assert next(rounds) == [("lower",), ("upper",)]
    candidates.frontier = [("lower", "upper")]
    candidates.nodes = {("lower",): Node(("lower",), Verdict.FEASIBLE, 1.0)}
    assert next(rounds, None) is None and candidates.left == [("lower", "upper")]
    candidates.left *= 2  # a proposal that comes again, and one that was solved in the meantime
    candidates.left.append(("lower",))
    (note,) = [n for n in notes_of_proposals(candidates) if "not solved" in n]
    assert note.startswith("1 proposal was not solved") and note.endswith(": lower, upper")


def test_two_workers_find_what_one_finds(swung: SearchResult) -> None:
    two = dmoc.search(unnamed("cart_pendulum"), strategy="propose", workers=2)
    assert two.proposals == swung.proposals
    assert [(n.sequence, n.cost) for n in two.nodes] == [(n.sequence, n.cost) for n in swung.nodes]


def test_a_journal_keeps_what_was_proposed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    problem, journal = unnamed("cart_pendulum", steps=20), tmp_path / "journal.sqlite"
    first = dmoc.search(problem, strategy="propose", journal=journal)
    monkeypatch.setattr("dmoc.sequences.pool.solve_node", lambda task: pytest.fail("solved again"))
    again = dmoc.search(problem, strategy="propose", journal=journal, resume=True)
    assert [n.sequence for n in again.nodes] == [n.sequence for n in first.nodes]
    assert again.best is not None and first.best is not None
    assert again.best.sequence == first.best.sequence


def test_budgets_and_interruptions_end_it_with_an_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = unnamed("puck_table", steps=16)

    def interrupt(_: Progress) -> None:
        raise KeyboardInterrupt

    result = dmoc.search(problem, strategy="propose", progress=interrupt)
    assert len(result.nodes) == 1 and "interrupted" in result.notes[0]
    few = dmoc.search(problem, 1, strategy="both", max_nodes=2)
    assert len(few.nodes) == 2 and any("limit of 2 nodes" in note for note in few.notes)

    def early(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(relaxation.Relaxation, "_followed", early)
    none = dmoc.search(problem, strategy="propose")
    assert not none.nodes and none.best is None and "interrupted" in none.notes[0]


def test_words_that_may_not_happen_are_not_proposed() -> None:
    result = dmoc.search(unnamed("cart_pendulum"), strategy="propose", surfaces=["upper"])
    assert {word for n in result.nodes for word in n.sequence} <= {"upper"}
    assert {word for p in result.proposals for word in p.sequence} <= {"upper"}


def test_what_has_failed_is_solved_from_starts_of_its_own_once(proposals: Proposals) -> None:
    candidates, failed = Candidates(proposals, ENDLESS), ("lower",)
    candidates.nodes = {failed: Node(failed, Verdict.FAILED)}
    assert candidates._once_more() and candidates.frontier == [failed]
    candidates.frontier, candidates.nodes = [], {failed: Node(failed, Verdict.FAILED)}
    assert not candidates._once_more() and candidates.frontier == []
