"""The answer of a search is that of a solve, and what a coarse mesh alone speaks against is not
lost."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import sympy as sp
from answers import answer_of
from searches import shipped, unnamed
from sympy.physics.mechanics import dynamicsymbols
from systems import block_on_floor

import dmoc
from dmoc.base.deadline import ENDLESS, Deadline
from dmoc.results.exploration import exploration_in_words
from dmoc.sequences import final_solve
from dmoc.sequences.final_solve import FEWEST
from dmoc.sequences.nodes import Node, Verdict
from dmoc.sequences.traversal import _looked_at
from dmoc.sequences.tree import FINER, FINEST, Tree
from dmoc.solvers.outcome import Status
from dmoc.solving.answer import best_answer
from dmoc.solving.request import Request


@pytest.mark.slow
@pytest.mark.parametrize(
    ("problem", "options"),
    [
        (shipped("cart_pendulum", steps=40), {"max_collisions": 2, "surfaces": ["lower"]}),
        (shipped("cart_pendulum", steps=None), {"max_collisions": 1, "surfaces": ["lower"]}),
        (shipped("puck_table", steps=12), {"max_collisions": 2, "surfaces": ["east", "west"]}),
        (
            shipped("puck_table", steps=10, restitution=0.8),
            {"max_collisions": 1, "surfaces": ["east"]},
        ),
        (shipped("puck_table", steps=10, final_time=(0.5, 3.0)), {"max_collisions": 1}),
        (
            shipped("puck_table", steps=10, restitution=0),
            {"max_collisions": 1, "surfaces": ["east"]},
        ),
    ],
)
def test_the_best_costs_what_a_solve_from_its_motion_costs(
    problem: dmoc.Problem, options: dict[str, Any]
) -> None:
    result = dmoc.search(problem, **options)
    best = result.best
    assert best is not None and best.solution is not None and best.solution.solved
    # On the mesh on which it is confirmed, which may be finer than the one that was asked for.
    steps = None if problem.steps is None else best.solution.steps
    stated = problem.but(sequence=best.sequence, steps=steps)
    again = answer_of(stated, "ipm", guess=best.solution)
    # A refinement begins on another mesh, and ends within its tolerance.
    exact = 1e-8 if problem.steps is not None else 1e-3
    assert best.cost == pytest.approx(again.cost, rel=exact)
    assert best.cost == best.solution.cost and best.cost in best.minima
    assert all(n.cost >= best.cost * (1 - 1e-4) for n in result.ranked() if n.cost is not None)


def test_where_both_statements_differ_the_other_number_is_a_note() -> None:
    result = dmoc.search(shipped("cart_pendulum", steps=40), 2, surfaces=["lower"])
    assert result.best is not None and result.best.cost == pytest.approx(66.0201, abs=1e-3)
    note = result.notes[-1]
    assert note.startswith("lower, lower: on the mesh of the search") and note.endswith("66.303")
    assert any(evidence in note for evidence in result.best.evidence)


def test_what_is_confirmed_in_the_rates_alone_is_kept_and_told() -> None:
    """Eight steps a phase tell little of the energies beside two hits."""
    problem = shipped("cart_pendulum", steps=8)
    result = dmoc.search(problem, 2, surfaces=["lower"])
    best = result.best
    assert best is not None and best.sequence == ("lower", "lower") and best.solution is not None
    assert best.solution.solved and best.solution.steps == (8, 8, 8)
    again = dmoc.solve(problem.but(sequence=best.sequence), "ipm", guess=best.solution)
    assert again.status == "not_verified"
    assert "is not confirmed, so that its cost is the one in the rates" in result.notes[-1]


@pytest.mark.parametrize("steps", [None, 40])
def test_a_better_motion_that_few_starts_miss_is_found_and_told(
    steps: int | None, tmp_path: Path
) -> None:
    """The automatic guess leads to the dearer of two minima of one hit, and is the only start."""
    problem = unnamed("cart_pendulum_hanging", steps=steps)
    result = dmoc.search(problem, 1, surfaces=["lower"])
    best = result.best
    assert best is not None and best.solution is not None and best.cost is not None
    explored = answer_of(problem.but(sequence=["lower"]), "ipm")
    assert best.cost == best.solution.cost == pytest.approx(explored.cost, rel=1e-3)
    first, words, before, *_ = best.evidence
    assert first == f"cost {best.cost:.6g}, confirmed by simulation"
    assert words == exploration_in_words(best.solution) and best.solution.message.endswith(words)
    dearer = max(best.minima)
    assert before == f"the few starts of the search led to one that costs {dearer:.6g}"
    assert dearer > 1.1 * best.cost and len(best.minima) == 2
    assert result.notes[-2:] == (f"lower: {words}", f"lower: {before}")
    facts = result.to_dict()["exploration"]
    assert facts["unseen_share"] == best.solution.unseen_share is not None
    assert facts["starts"] == best.solution.starts > FEWEST and facts["first_start"] != "given"
    saved = dmoc.Solution.load(best.solution.save(tmp_path / "best.npz"))
    assert saved.unseen_share == facts["unseen_share"]


def test_a_motion_that_no_start_finds_again_is_kept_beside_what_they_lead_to(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    problem = unnamed("cart_pendulum", steps=40)
    dear = dmoc.solve(problem.but(sequence=["lower"]), "ipm", starts=1)
    met = {"starts": 9, "agreeing_starts": 4, "unseen_share": 0.2, "first_start": "random 2"}
    far = replace(dear, trajectory=replace(dear.trajectory, cost=1e3), **met)
    monkeypatch.setattr(final_solve, "best_answer", lambda *_: far)
    result = dmoc.search(problem, 1, surfaces=["lower"])
    assert result.best is not None and result.best.solution is not None
    best = result.best.solution
    assert result.best.cost == pytest.approx(dear.cost, rel=1e-6)
    assert (best.starts, best.agreeing_starts, best.first_start) == (9, 1, "given")
    assert [(m.cost, m.agreeing_starts) for m in best.others] == [(1e3, 4)]
    assert best.message.endswith(exploration_in_words(best)) and best.unseen_share == 0.2


def test_an_exploration_that_ctrl_c_ends_leaves_the_motion_of_the_node(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    problem = unnamed("cart_pendulum_hanging", steps=40)
    ended = dmoc.solve(problem.but(sequence=["lower"]), "ipm", starts=1)
    ended = replace(ended, status=Status.INTERRUPTED)
    monkeypatch.setattr(final_solve, "best_answer", lambda *_: ended)
    result = dmoc.search(problem, 1, surfaces=["lower"])
    assert not result.complete and "interrupted" in result.notes[0]
    assert result.best is not None and result.best.solution is not None
    assert result.best.solution.solved and result.best.solution.starts == 0


def test_the_best_is_explored_from_a_share_of_the_starts_of_all_nodes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    limits = list[int | None]()

    def explored(problem: dmoc.Problem, guess: Any, request: Request) -> dmoc.Solution:
        limits.append(request.most)
        return best_answer(problem, guess, request)

    monkeypatch.setattr(final_solve, "best_answer", explored)
    dmoc.search(unnamed("cart_pendulum_hanging", steps=40), 1, surfaces=["lower"])
    whole = dmoc.search(shipped("puck_table", steps=10), 3, seed=3)
    tried = sum(len(n.starts) for n in whole.nodes)
    assert limits == [FEWEST, tried // 2] and tried > 2 * FEWEST


@pytest.mark.slow
@pytest.mark.parametrize("steps", [6, 8, 10, 12])
def test_a_sequence_that_coarse_meshes_speak_against_is_solved_on_finer_ones(steps: int) -> None:
    problem = shipped("cart_pendulum", steps=steps)
    result = dmoc.search(problem, 0)
    (node,) = result.nodes
    assert node.verdict is Verdict.OPTIMAL and node.solution is not None and node.solution.solved
    times = node.solution.steps[0] // steps
    assert node.solution.steps == (times * steps,) and times in (2, 4, 8, 16)
    assert node.evidence[0].endswith(f"confirmed by simulation, with {times} times the steps")
    assert "starts led to it" in node.evidence[1]
    assert f"with {steps} steps a phase it costs" in node.evidence[2]
    fine = dmoc.solve(problem.but(sequence=[], steps=400), "ipm", guess=node.solution)
    assert node.cost == pytest.approx(fine.cost, rel=2e-3)


@pytest.mark.slow
def test_nothing_is_refined_that_costs_more_than_the_best() -> None:
    result = dmoc.search(shipped("cart_pendulum", steps=10), 1)
    nodes = {n.sequence: n for n in result.nodes}
    assert result.best is not None and result.best.sequence == ("lower",)
    upper = nodes["upper",]
    assert upper.verdict is Verdict.UNVERIFIED and len(upper.evidence) == 1
    assert upper.cost is not None and result.best.cost is not None
    assert upper.cost > result.best.cost


@pytest.mark.parametrize(
    ("best", "doubtful", "meshes"),
    [(None, [0.8, 0.9, 1.1], [FINER, FINEST]), (1.0, [0.8, 0.9], [FINER]), (0.7, [], [FINER])],
)
def test_what_may_be_the_best_is_looked_at_again_and_on_the_finest_meshes_where_there_is_none(
    monkeypatch: pytest.MonkeyPatch, best: float | None, doubtful: list[float], meshes: list[Any]
) -> None:
    none: Any = SimpleNamespace(surfaces=())
    tree, refined = Tree(none, none), list[Any]()
    for name, cost in (("a", 1.1), ("b", 0.9), ("c", 0.8), ("d", None)):
        tree.nodes[name,] = Node((name,), Verdict.UNVERIFIED, cost)
    if best is not None:
        tree.nodes["e",] = Node(("e",), Verdict.FEASIBLE, best)
    monkeypatch.setattr(Tree, "_refined", lambda self, finer, *_: refined.append(finer) or ())
    assert list(tree.refine(lambda *_: (), 0.0)) == [] and refined == meshes
    assert [n.cost for n in tree.doubtful()] == doubtful


@pytest.mark.parametrize(
    ("seconds", "most", "waiting", "reason"),
    [
        (None, 2, 1, "the limit of 2 nodes was reached"),
        (None, 2, 0, ""),
        (None, 3, 1, ""),
        (9.0, None, 1, "the time of 9 s was used up"),
        (9.0, None, 0, ""),
    ],
)
def test_a_budget_that_is_used_up_by_the_last_node_has_stopped_nothing(
    seconds: float | None, most: int | None, waiting: int, reason: str
) -> None:
    settings = SimpleNamespace(seconds=seconds, max_nodes=most)
    tree: Any = SimpleNamespace(
        settings=settings, count=2, waiting=waiting, rounds=lambda: [[]],
        solve=lambda *_: [],
    )  # fmt: skip
    until = Deadline(0.0) if seconds else ENDLESS  # in the past
    assert _looked_at(tree, lambda *_: (), until, until, lambda: None) == reason


def swing_up(steps: int) -> dmoc.Problem:
    """A cart with 2 N of friction swings a pole up in three seconds."""
    x, a, u = dynamicsymbols("x a u")
    M, m, length, g, friction = sp.symbols("M m l g friction")
    t = dynamicsymbols._t
    place = x + length * sp.sin(a), -length * sp.cos(a)
    speed = place[0].diff(t) ** 2 + place[1].diff(t) ** 2
    system = dmoc.MechanicalSystem(
        "swing_up_on_a_rail", [x, a], (M * x.diff(t) ** 2 + m * speed) / 2 - m * g * place[1],
        {M: 1.0, m: 0.1, length: 1.0, g: 9.81, friction: 2.0}, inputs=[u], forces={x: u},
        tangents={"rail": x}, friction={"rail": friction}, cost=u**2,
    )  # fmt: skip
    end = {"x": 0.0, "a": float(sp.pi), "x_dot": 0.0, "a_dot": 0.0}
    return dmoc.Problem(system, start={"x": 0.0, "a": 0.0}, goal=end, steps=steps, final_time=3.0)


@pytest.mark.slow
def test_a_tree_does_not_end_empty_where_a_word_has_an_answer() -> None:
    """With 20 steps a phase the check confirms no word."""
    words = ("rail:slip+", "rail:slip-", "rail:slip+")
    problem = swing_up(20)
    result = dmoc.search(problem, 3, events=words[:2])
    assert result.best is not None and result.best.sequence == words
    assert result.best.solution is not None and result.best.solution.steps == (40,) * 4
    coarse = dmoc.solve(problem.but(sequence=words), guess=result.best.solution)
    assert coarse.status == "not_verified"
    fine = answer_of(problem.but(sequence=words, steps=100), guess=result.best.solution)
    assert result.best.cost == pytest.approx(fine.cost, rel=5e-3)


@pytest.mark.slow
def test_time_is_kept_for_doubtful_nodes_and_the_answer() -> None:
    """Wherever the time ends, what was found by then is the answer, and the limit is kept."""
    problem = shipped("puck_table", steps=16)
    for seconds in (0.5, 1.0):
        result = dmoc.search(problem, 6, seconds=seconds)
        assert not result.complete and "was used up" in " ".join(result.notes)
        assert result.seconds < 2 * seconds + 1


@pytest.mark.slow
def test_a_search_around_doing_nothing_confirms_that() -> None:
    """A block that rests on a rough floor, and shall be where it is."""
    system = block_on_floor("resting_block", 1.0, 9.81, 0.3)
    for place in (0.0, 3.0):
        problem = dmoc.Problem(
            system, start={"x": place, "y": 0}, goal={"x": place, "x_dot": 0}, contacts=["floor"],
            steps=10, final_time=2.0,
        )  # fmt: skip
        result = dmoc.search(problem, 1, events=["-floor"])
        assert result.best is not None and result.best.sequence == ()
        assert result.best.cost == pytest.approx(0.0, abs=1e-12)
        assert {n.verdict for n in result.nodes[1:]} <= {Verdict.UNREACHABLE, Verdict.INFEASIBLE}
