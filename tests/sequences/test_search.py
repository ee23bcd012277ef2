"""The search over sequences: the best against a closed form, evidence, strategies, budgets."""

from __future__ import annotations

import itertools
import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import sympy as sp
from searches import outline
from sympy.physics.mechanics import dynamicsymbols
from systems import unit_mass

import dmoc
from dmoc.base.errors import SearchError
from dmoc.codegen.kernels import Kernels
from dmoc.program.layout import Layout
from dmoc.sequences.node_solve import extended
from dmoc.sequences.nodes import Node, Verdict
from dmoc.sequences.search import Progress, SearchResult
from dmoc.solvers.outcome import Options, Status
from dmoc.solving.attempts import Attempt
from dmoc.solving.mesh.one_mesh import solved_on_mesh
from dmoc.solving.methods import METHODS
from dmoc.solving.multistart import rounds
from dmoc.solving.multistart.parallel import attempts_from
from dmoc.solving.request import Request

pytestmark = pytest.mark.slow


def unfolded_cost(sequence: tuple[str, ...]) -> float:
    """Cost of the free motion to the goal's mirror image.

    For each axis, with velocities v0 and v1 at the ends, distance D and time T: 2 (v0^2 + v0 v1 +
    v1^2)/T - 6 (v0 + v1) D/T^2 + 6 D^2/T^3.
    """
    total, T = 0.0, 2.0
    for low, high, (q0, v0), (q1, v1) in (
        ("west", "east", (0.3, 1.5), (0.4, 1.2)),
        ("south", "north", (0.2, 0.4), (0.7, -0.3)),
    ):
        sign = 1.0
        for wall in reversed([w for w in sequence if w in (low, high)]):
            q1 = -q1 if wall == low else 2.0 - q1
            sign = -sign
        D = q1 - q0
        v1 *= sign
        total += 2 * (v0**2 + v0 * v1 + v1**2) / T - 6 * (v0 + v1) * D / T**2 + 6 * D**2 / T**3
    return total


# The answer ---------------------------------------------------------------------------------------


def test_the_best_sequence_is_that_of_the_closed_form(
    table: dmoc.Problem, whole: SearchResult
) -> None:
    assert whole.complete and len(whole.nodes) == 1 + 4 + 16 + 64
    assert whole.best is not None and whole.best.sequence == ("east", "north", "west")
    assert whole.best.verdict is Verdict.OPTIMAL
    assert unfolded_cost(whole.best.sequence) == pytest.approx(0.415, rel=1e-12)
    assert whole.best.cost == pytest.approx(0.415, rel=1e-3)
    # No unfolded motion of at most three collisions costs less, whether its order of hits is
    # possible or not.
    walls = ("west", "east", "south", "north")
    every = [s for d in range(4) for s in itertools.product(walls, repeat=d)]
    assert min(unfolded_cost(s) for s in every) == pytest.approx(0.415, rel=1e-12)
    # The sequence that the problem comes with, solved alone, ends in a far worse motion.
    assert dmoc.solve(table, method="ipm", verify=False).cost > 2 * whole.best.cost


def test_nodes_cost_what_a_separate_solve_costs(table: dmoc.Problem, whole: SearchResult) -> None:
    """Its mesh is that of the exploration: the automatic guess costs what it costs alone, with the
    law of impact in the rates.  On a fine mesh it costs the same in the energies."""
    alone = Request(METHODS["ipm"], Options(), verify=False)
    for node in whole.nodes[:21:3]:
        durations = [(0.02, None)] * (len(node.sequence) + 1) if node.sequence else None
        problem = table.but(sequence=node.sequence, durations=durations)
        guessed = solved_on_mesh(problem.in_rates(), None, alone)
        automatic = next(s for s in node.starts if s.name == "automatic 1")
        assert guessed.status == automatic.status == "solved"
        assert automatic.cost == pytest.approx(guessed.cost, rel=1e-9)
        assert node.cost is not None and node.cost <= guessed.cost * (1 + 1e-9)
        fine = problem.but(steps=256)
        dear, cheap = (
            solved_on_mesh(stated, node.solution, alone).cost for stated in (fine.in_rates(), fine)
        )
        assert dear == pytest.approx(cheap, rel=1e-3)


def test_every_sequence_of_the_table_is_confirmed(whole: SearchResult) -> None:
    """In the energies of 16 steps a phase, 36 of them would not be."""
    assert len(whole.nodes) == 85
    assert all(node.solution is not None and node.solution.minimum for node in whole.nodes)


def test_deep_sequences_cost_what_they_cost_on_a_fine_mesh(seed: dmoc.Problem) -> None:
    """Four hits on the limiter `upper`, of which three follow each other within 0.15 s."""
    result = dmoc.search(seed, 4, surfaces=["upper"])
    deep = result.nodes[-1]
    assert len(deep.sequence) == 4 and deep.solution is not None and deep.solution.minimum
    problem = seed.but(sequence=deep.sequence)
    fine = dmoc.solve(problem.but(steps=800), "ipm", guess=deep.solution, verify=False)
    assert deep.cost == pytest.approx(fine.cost, rel=3e-4)
    energies = dmoc.solve(problem, "ipm", guess=deep.solution)
    assert energies.status == "not_verified" and energies.cost < 0.99 * fine.cost


def test_motions_have_the_steps_of_the_problem(seed: dmoc.Problem) -> None:
    result = dmoc.search(seed.but(steps=120), 1)
    for node in result.nodes:
        assert node.solution is not None and node.verdict is not Verdict.UNVERIFIED
        assert [p.steps for p in node.solution.phases] == [120] * (len(node.sequence) + 1)


def test_sensitivities_of_a_node_equal_differences_of_searches(seed: dmoc.Problem) -> None:
    lossy = seed.but(steps=40, restitution=0.7)

    def left(problem: dmoc.Problem) -> Node:
        return dmoc.search(problem, 1, surfaces=["lower"]).nodes[1]

    def slope(low: dict[str, Any], high: dict[str, Any], change: float) -> float:
        first, last = (left(lossy.but(**fields)).cost or 0.0 for fields in (low, high))
        return (last - first) / change

    node = left(lossy)
    assert node.solution is not None
    problem = lossy.but(sequence=["lower"], durations=[(0.01, None)] * 2)
    slopes = dmoc.sensitivities(problem, node.solution)
    for name in ("m_c", "l"):
        value = seed.kernels.parameters[name]
        assert value is not None
        low, high = ({"parameters": {name: value + d}} for d in (-1e-4, 1e-4))
        assert slopes["parameters"][name] == pytest.approx(slope(low, high, 2e-4), rel=1e-5)
    low, high = ({"restitution": 0.7 + d} for d in (-1e-4, 1e-4))
    assert slopes["restitution"]["lower"] == pytest.approx(slope(low, high, 2e-4), rel=1e-5)


def test_every_node_has_evidence(whole: SearchResult) -> None:
    for node in whole.nodes:
        assert node.evidence and node.starts and node.seconds > 0 and node.attempts == 1
        assert node.cost in node.minima and len(node.phases) == len(node.sequence) + 1
    assert sum(whole.counts.values()) == len(whole.nodes)
    assert any("shortest duration of a phase" in note for note in whole.notes)
    text = json.dumps(whole.to_dict())
    assert json.loads(text)["best"] == ["east", "north", "west"]


def test_unreachable_prunes_and_says_why(weak: dmoc.Problem) -> None:
    result = dmoc.search(weak, 4)
    assert [(n.sequence, n.verdict) for n in result.nodes] == [
        ((), Verdict.OPTIMAL),
        (("wall",), Verdict.UNREACHABLE),
    ]
    pruned = result.nodes[1]
    assert (
        pruned.cost is None
        and pruned.minima == () == tuple(pruned.phases)
        and pruned.solution is None
    )
    evidence = " | ".join(pruned.evidence)
    # Sqrt(2) to the wall, and the shortest phase after it.
    assert "final time <= 1 s is violated by 0.424 s" in evidence
    assert (
        "the shortest time at full input is estimated at 1.41 s, the bounds allow 0.99 s"
        in evidence
    )


def test_infeasible_is_not_unreachable(block: Kernels) -> None:
    """The wall can be hit, and the goal cannot be reached after it: the children are looked at."""
    problem = dmoc.Problem(
        block, start={"x": 0.0}, goal={"x": -5.0}, steps=20, bounds={"u": (-3, 3)},
        final_time=(None, 1.0),
    )  # fmt: skip
    result = dmoc.search(problem, 2)
    # 2 * 0.82 s and more.
    assert [n.verdict for n in result.nodes] == [
        Verdict.INFEASIBLE,
        Verdict.INFEASIBLE,
        Verdict.UNREACHABLE,
    ]
    assert result.best is None
    for n in result.nodes[:2]:
        count = len(n.starts)
        assert n.evidence[0] == f"no motion was found from {count} starts ({count} infeasible)"
        assert "the goal of x is missed" in n.evidence[1]


def test_more_collisions_may_still_pay(seed: dmoc.Problem) -> None:
    result = dmoc.search(seed.but(steps=40), 1)
    assert result.best is not None and result.best.sequence == ("lower",)
    deeper = dmoc.search(seed.but(steps=60), 2)
    assert deeper.best is not None and deeper.best.sequence == ("lower", "lower")
    assert any("more may cost less" in note for note in deeper.notes)


def test_starts_have_names_and_random_ones_come_where_others_lead_nowhere(
    table: dmoc.Problem, weak: dmoc.Problem
) -> None:
    easy = dmoc.search(table, 1, starts=2, surfaces=["east"])
    for node in easy.nodes:
        names = [s.name for s in node.starts]
        assert names[: len(node.sequence)] == ["parent"] * len(node.sequence)
        assert names[len(node.sequence) :] in (["automatic 1"], ["automatic 1", "automatic 2"])
    unreachable = dmoc.search(weak, 1, starts=2).nodes[1]
    assert [s.name for s in unreachable.starts][-2:] == ["random 1", "random 2"]
    assert all(s.status == "infeasible" and s.cost is None for s in unreachable.starts)
    without = dmoc.search(weak, 1, starts=0).nodes[1]
    assert without.starts == unreachable.starts[:-2] and without.verdict is Verdict.UNREACHABLE


def test_the_parents_motion_is_bent_to_the_surface(table: dmoc.Problem) -> None:
    parent = dmoc.solve(table.but(sequence=[]), method="ipm", verify=False)
    child = table.but(sequence=["east"])
    x = extended(parent, child)
    lay = Layout.of(child)
    assert np.isfinite(x).all()
    assert x[lay.index_q[table.phase_steps[0], 0]] == pytest.approx(1.0)
    assert x[lay.index_h] * lay.steps == pytest.approx([1.0, 1.0])  # of 2 s in all


def test_a_surface_that_moves_is_met_where_it_is_at_that_time() -> None:
    """A wall at 1 - 0.3 t, and a block that comes closest to it at the end of its motion."""
    (x, u), t = dynamicsymbols("x u"), dynamicsymbols._t
    system = unit_mass(
        "moving_wall", surfaces={"wall": x <= 1 - sp.Rational(3, 10) * t}, cost=u**2 / 2
    )
    child = dmoc.Problem(
        dmoc.build(system), start={"x": 0}, goal={"x": 0.5, "x_dot": 0}, sequence=["wall"],
        steps=20, final_time=1.0,
    )  # fmt: skip
    parent = dmoc.solve(child.but(sequence=[]), "ipm", verify=False)
    start, lay = extended(parent, child), Layout.of(child)
    met = lay.times(start)[20]
    assert 0.85 < met < 0.95
    assert start[lay.index_q[20, 0]] == pytest.approx(1 - 0.3 * met)


def test_the_coarse_mesh_promises_no_collisions_that_a_finer_one_cannot_keep(
    seed: dmoc.Problem,
) -> None:
    """Energies of steps of 25 ms beside steps of 0.4 ms would let the pendulum come with 3 rad/s
    and leave with 0.2 rad/s: three hits would cost 1212 on the coarse mesh and 1691 on the fine
    one, which is a long way from there."""
    result = dmoc.search(seed, 3, surfaces=["upper"])
    assert [len(n.sequence) for n in result.nodes] == [0, 1, 2, 3]
    for node in result.nodes:
        assert node.solution is not None and node.solution.iterations < 60
        for start in node.starts:
            assert start.cost == pytest.approx(node.cost, rel=0.02)


def test_a_collision_that_must_be_followed_by_another_is_reachable(table: dmoc.Problem) -> None:
    """A fast puck under weak forces hits the west wall after the east wall, like it or not."""
    fast = table.but(
        start={"x": 0.3, "y": 0.5, "x_dot": 3.0, "y_dot": 0.0},
        goal={},
        final_time=0.8,
        steps=10,
        bounds={"f_x": (-0.2, 0.2), "f_y": (-0.2, 0.2)},
    )
    result = dmoc.search(fast, 2, surfaces=["east", "west"])
    verdicts = {n.sequence: n.verdict for n in result.nodes}
    assert verdicts["east",] is Verdict.INFEASIBLE
    assert verdicts["east", "west"] is Verdict.OPTIMAL


def test_solutions_can_be_checked_again(whole: SearchResult) -> None:
    assert whole.best is not None and whole.best.solution is not None
    assert whole.best.solution.verify().passed


def test_random_starts_find_what_the_others_miss_and_belong_to_a_seed(
    table: dmoc.Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first starts of a node lead nowhere, as at some deep ones of the pendulum."""

    def astray(*arguments: Any) -> list[Attempt]:
        calls.append(1)
        attempts = attempts_from(*arguments)
        if len(calls) > 1:
            return attempts
        failed = Status.INFEASIBLE
        return [replace(a, outcome=replace(a.outcome, status=failed)) for a in attempts]

    without = dmoc.search(table, 0).nodes[0]
    monkeypatch.setattr(rounds, "attempts_from", astray)
    results: list[SearchResult] = []
    for number in (3, 3, 4):
        calls: list[int] = []
        results.append(dmoc.search(table, 0, starts=2, seed=number))
    a, b, other = (outline(r) for r in results)
    assert a == b != other
    for (node,) in (r.nodes for r in results):
        assert node.verdict is Verdict.OPTIMAL
        assert node.cost == pytest.approx(without.cost, rel=1e-9)
        *first, one, two = node.starts
        assert first and all((s.status, s.cost) == ("infeasible", None) for s in first)
        assert (one.name, two.name) == ("random 1", "random 2")
        assert "solved" in (one.status, two.status)


# Strategies and budgets ---------------------------------------------------------------------------


@pytest.mark.parametrize("strategy", ["best-first", "beam"])
def test_strategies_find_the_same_best_with_fewer_nodes(
    table: dmoc.Problem, whole: SearchResult, strategy: str
) -> None:
    result = dmoc.search(
        table, 3, strategy=strategy, beam=2, max_nodes=40 if strategy == "best-first" else None
    )
    assert result.best is not None and whole.best is not None
    assert result.best.sequence == whole.best.sequence
    assert len(result.nodes) < len(whole.nodes) and not result.complete and result.notes


def test_best_first_finds_the_best_of_the_seed_without_looking_at_all(seed: dmoc.Problem) -> None:
    every = dmoc.search(seed, 3)
    assert every.complete and len(every.nodes) == 1 + 2 + 4 + 8
    few = dmoc.search(seed, 3, strategy="best-first", max_nodes=8)
    assert len(few.nodes) == 8 and not few.complete and "limit of 8 nodes" in few.notes[0]
    assert few.best is not None and every.best is not None
    assert few.best.sequence == every.best.sequence == ("lower", "lower")
    assert few.best.cost == every.best.cost == min(n.cost for n in every.nodes if n.cost)
    costs = {n.sequence: n.cost for n in every.nodes}
    assert all(costs[n.sequence] == n.cost for n in few.nodes)


def test_a_tree_as_large_as_its_budget_is_complete(table: dmoc.Problem) -> None:
    """One sequence without a collision, and one for each of the four walls."""
    result = dmoc.search(table, 1, max_nodes=5)
    assert result.complete and len(result.nodes) == 5
    assert not any("limit of" in note for note in result.notes)


def test_budgets_end_the_search_and_keep_the_best(table: dmoc.Problem) -> None:
    few = dmoc.search(table, 3, max_nodes=5)
    assert len(few.nodes) == 5 and not few.complete and "limit of 5 nodes" in few.notes[0]
    short = dmoc.search(table, 6, seconds=0.5)
    assert "time of 0.5 s" in short.notes[0] and not short.complete and 0 < len(short.nodes) < 1000


def test_an_interruption_returns_what_was_found(table: dmoc.Problem) -> None:
    seen: list[Progress] = []

    def interrupt(p: Progress) -> None:
        seen.append(p)
        if len(seen) == 4:
            raise KeyboardInterrupt

    result = dmoc.search(table, 3, progress=interrupt)
    assert len(result.nodes) == 4 and result.best is not None and "interrupted" in result.notes[0]
    assert seen[-1].best is not None and sum(seen[-1].counts.values()) == 4


def test_problems_that_cannot_be_searched_are_refused(table: dmoc.Problem) -> None:
    with pytest.raises(SearchError, match="one number for every phase"):
        dmoc.search(table.but(steps=[20, 20, 20, 20]))
    with pytest.raises(SearchError, match="fewer steps or collisions"):
        dmoc.search(table.but(steps=300), 3, method="slsqp")
    with pytest.raises(SearchError, match="shortest_phase"):
        dmoc.search(table.but(durations=[(0.1, None)] * 4))


def test_what_is_one_is_told_as_one(block: Kernels) -> None:
    """Two elastic hits of a mass that is to come back would merge; no other motion is held."""
    task = {"start": {"x": 0.0}, "goal": {"x": 0.0, "x_dot": 0.0}, "final_time": 1.0, "steps": 20}
    result = dmoc.search(dmoc.Problem(block, **task), max_collisions=2)
    assert sum(bool(n.shortest) for n in result.nodes) == 1
    held, led = result.notes
    assert "1 motion is held by the shortest duration of a phase: its collisions" in held
    assert led.startswith("no collision: all")
