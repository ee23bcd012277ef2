"""Searches over contacts that last and friction."""

from __future__ import annotations

from math import sqrt

import compass_gait
import pytest
import sympy as sp
from contact_problems import pushed
from several_contacts import HALF_HEIGHT, MASS, STANDING, box
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import SearchError
from dmoc.sequences.comparison import best_of, with_optimum
from dmoc.sequences.nodes import Node, Verdict


@pytest.mark.slow
def test_the_search_finds_when_to_stick_and_when_to_slide() -> None:
    problem = pushed(20).but(sequence=())
    result = dmoc.search(problem, 2)
    assert result.best is not None
    assert result.best.cost == pytest.approx(2 / 3 * sqrt(6), rel=2e-3)
    sliding = {node.sequence for node in result.ranked()}
    assert ("rail:slip+", "rail:stick") in sliding
    counts = result.counts
    assert not counts.get("failed") and counts["infeasible"] >= 1


@pytest.mark.slow
def test_the_tree_tries_what_two_contacts_can_only_do_together() -> None:
    """Both lower corners of a box that is pushed begin to slide at once: int u^2 / 2 with the
    friction F = mu m g and the least acceleration from rest to rest is F^2 T / 2 + 6 m^2 d^2 / T^3,
    in the time after a shortest phase of 0.001 s.  No corner slides alone."""
    problem = dmoc.Problem(
        box(), start=STANDING, goal={"x": 1, "y": HALF_HEIGHT, "a": 0, "x_dot": 0, "y_dot": 0},
        contacts=["left", "right"], parameters={"mu": 0.2}, steps=20, final_time=1,
    )  # fmt: skip
    result = dmoc.search(problem, 1)
    assert result.best is not None
    assert result.best.sequence == ("left:slip+ right:slip+",)
    friction = 0.2 * MASS * 9.81
    least = 0.999 * friction**2 / 2 + 6 * MASS**2 / 0.999**3
    assert result.best.cost == pytest.approx(least, rel=5e-3)
    assert [n.sequence for n in result.ranked()] == [result.best.sequence]
    assert ("-left -right",) in [n.sequence for n in result.nodes]


@pytest.mark.slow
def test_a_gait_that_few_starts_lead_to_is_met_by_more_as_the_note_says() -> None:
    """The long gait of Goswami et al. (1998) has the period 0.734346391 s by an event-driven
    simulation."""
    problem = compass_gait.problem(10, order=2).but(
        start={"x": 0.0, "a": 0.0}, sequence=(), via=None, durations=None
    )
    few = dmoc.search(problem, 1, events=["+right -left"])
    assert few.best is None
    assert any("starts=64 may find one" in note for note in few.notes)
    more = dmoc.search(problem, 1, events=["+right -left"], starts=64)
    assert more.best is not None and more.best.sequence == ("+right -left",)
    # With n steps of order 2 the period is longer by a share of 0.186 / n^2.
    assert more.best.cost == pytest.approx(compass_gait.PERIOD * 1.00186, rel=1e-4)
    assert not any("starts=" in note for note in more.notes)


def test_a_search_takes_the_words_it_is_given() -> None:
    result = dmoc.search(pushed(20).but(sequence=()), 2, events=["rail:slip+"])
    assert [node.sequence for node in result.nodes] == [(), ("rail:slip+",)]


def test_a_phase_of_no_use_collapses_and_the_shorter_sequence_is_named() -> None:
    """In one second there is no time to wait: sliding all the way is the best there is."""
    problem = pushed(40).but(sequence=(), final_time=1)
    result = dmoc.search(problem, 2, events=["rail:slip+", "rail:stick"])
    assert result.best is not None and result.best.sequence == ("rail:slip+",)
    # Closed form: m^2 6 d^2/T^3 + F^2 T/2 with the shortest phase of 0.001 s before it.
    assert result.best.cost == pytest.approx(6 / 0.999**3 + 0.999 / 2, rel=2e-3)
    nodes = {node.sequence: node for node in result.nodes}
    waits = nodes["rail:slip+", "rail:stick"]
    assert waits.verdict is Verdict.COLLAPSES
    assert waits.evidence[0].startswith("a shorter sequence does better: rail:slip+ costs 6.5")
    assert "duration of phase 2 >= 0.001 s holds its motion" in waits.evidence[0]
    assert waits not in result.ranked() and not result.counts.get("unverified")
    assert any("their events would rather merge" in note for note in result.notes)


def test_events_and_surfaces_exclude_each_other() -> None:
    problem = pushed(20).but(sequence=())
    with pytest.raises(SearchError, match="surfaces and events are both given: give events alone"):
        dmoc.search(problem, 2, events=["rail:slip+"], surfaces=["rail"])


def node(
    *sequence: str, cost: float, verdict: Verdict = Verdict.FEASIBLE, limited: bool = False
) -> Node:
    return Node(sequence, verdict, cost, shortest=("duration of phase 0 >= 0.1 s",) * limited)


def test_of_sequences_that_cost_the_same_the_shortest_is_the_best() -> None:
    nodes = [node("a", "b", cost=1.0), node("a", cost=1.000001), node(cost=1.1)]
    best = best_of(nodes)
    assert best is not None and best.sequence == ("a",)


@pytest.mark.parametrize(
    ("longer", "shorter", "collapses"),
    [
        *(("abc", s, True) for s in ("a", "b", "c", "ab", "ac", "bc")),
        *(("abcd", s, True) for s in ("ab", "ac", "ad", "bc", "bd", "cd", "abc", "acd", "bcd")),
        *(("abcd", s, False) for s in ("", "a", "d", "ba", "cb", "abdc", "e", "ae", "aa")),
    ],
)
def test_a_sequence_is_shorter_by_one_event_or_two(
    longer: str, shorter: str, collapses: bool
) -> None:
    limited = node(*longer, cost=1.0, limited=True, verdict=Verdict.UNVERIFIED)
    nodes = {n.sequence: n for n in (limited, node(*shorter, cost=1.0))}
    verdicts = {n.sequence: n.verdict for n in with_optimum(nodes)}
    assert (verdicts[tuple(longer)] is Verdict.COLLAPSES) is collapses


def test_only_what_a_shorter_sequence_does_as_well_collapses() -> None:
    nodes = {
        n.sequence: n
        for n in (
            node("a", cost=2.0, limited=True),
            node("a", "b", cost=1.0, limited=True),
            node("a", "c", cost=3.0, limited=True, verdict=Verdict.UNVERIFIED),
            node("b", "c", cost=0.5, limited=True, verdict=Verdict.UNVERIFIED),
            node("a", "d", cost=4.0),
        )
    }
    assert {n.sequence: n.verdict for n in with_optimum(nodes)} == {
        ("a",): Verdict.FEASIBLE,
        ("a", "b"): Verdict.OPTIMAL,
        ("a", "c"): Verdict.COLLAPSES,
        ("b", "c"): Verdict.UNVERIFIED,
        ("a", "d"): Verdict.FEASIBLE,
    }


@pytest.mark.parametrize(("more", "collapses"), [(0.0, True), (0.9e-5, True), (1.1e-5, False)])
def test_a_shorter_sequence_of_the_same_cost_does_as_well(more: float, collapses: bool) -> None:
    """To 1e-5 of the cost; here the best is another one."""
    limited = node("a", "c", cost=3.0, limited=True, verdict=Verdict.UNVERIFIED)
    nodes = [node("b", cost=1.0), node("a", cost=3 * (1 + more)), limited]
    verdicts = {n.sequence: n.verdict for n in with_optimum({n.sequence: n for n in nodes})}
    assert verdicts["a", "c"] is (Verdict.COLLAPSES if collapses else Verdict.UNVERIFIED)


@pytest.mark.slow
def test_contacts_that_cannot_be_closed_together_are_left_out_and_told() -> None:
    """A ball in a corner cannot stick both to a wall and to a belt that moves."""
    x, y, a = dynamicsymbols("x y a")
    mu = sp.Symbol("mu")
    ball = dmoc.MechanicalSystem(
        "ball_in_a_corner", [x, y, a], (x.diff() ** 2 + y.diff() ** 2 + 0.4 * a.diff() ** 2) / 2,
        {mu: 0.5}, surfaces={"floor": y >= 1, "wall": x <= 3},
        tangents={"floor": x + a - dynamicsymbols._t, "wall": y - a},
        friction={"floor": mu, "wall": mu}, cost=1,
    )  # fmt: skip
    start = {"x": 0, "y": 2, "a": 0, "x_dot": 1, "y_dot": -1}
    problem = dmoc.Problem(ball, start=start, goal={"x": 2}, steps=4, final_time=(0.1, 4))
    result = dmoc.search(problem, 2, events=["+floor", "+wall", "+wall:slip+"])
    looked_at = {node.sequence for node in result.nodes}
    assert ("+floor",) in looked_at and ("+floor", "+wall") not in looked_at
    assert ("+floor", "+wall:slip+") in looked_at and not result.counts.get("failed")
    assert any(
        "no problem can have, such as +floor, +wall: the contacts" in n for n in result.notes
    )
