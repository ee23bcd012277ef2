"""Contacts that stay at the edge of their mode, and what is proposed instead."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import sympy as sp
from answers import answer_of
from contact_problems import pushed
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.guess.transfer import Piece
from dmoc.program.layout import Layout
from dmoc.solving import starts
from dmoc.solving.mode_edges import _lifts, _runs
from dmoc.solving.starts import restated

X, Y, A, U, V = dynamicsymbols("x y a u v")
T = dynamicsymbols._t


@pytest.fixture(scope="module")
def crane() -> dmoc.Problem:
    """A cart of 1 kg on a rail that holds 1 N, with a load of 1 kg at 1 m, moved by 0.5 m in 1.5 s:
    the load swings forward while the cart would rather stand, or roll back."""
    tip, f = X + sp.sin(A), sp.Symbol("f")
    kinetic = (X.diff(T) ** 2 + tip.diff(T) ** 2 + sp.cos(A).diff(T) ** 2) / 2
    system = dmoc.MechanicalSystem(
        "rubbing_crane", [X, A], kinetic + 9.81 * sp.cos(A), {f: 1.0}, inputs=[U], forces={X: U},
        cost=U**2, tangents={"rail": X}, friction={"rail": f},
    )  # fmt: skip
    return dmoc.Problem(
        system, start={"x": 0, "a": 0}, goal={"x": 0.5, "a": 0, "x_dot": 0, "a_dot": 0},
        contacts=["rail:slip+"], steps=80, final_time=1.5,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("held", "runs"),
    [
        ("1101", [(0, 2)]), ("0111", [(1, 4)]), ("0100", []), ("1110110", [(0, 3), (4, 6)]),
        ("1001", []), ("1", []), ("11", [(0, 2)]), ("", []),
    ],
)  # fmt: skip
def test_a_stay_has_two_steps_wherever_it_is(held: str, runs: list[tuple[int, int]]) -> None:
    assert _runs(np.array([c == "1" for c in held], dtype=bool)) == [range(*run) for run in runs]


@pytest.mark.slow
def test_sliding_at_rest_is_told_with_its_place_and_the_words_to_try(crane: dmoc.Problem) -> None:
    slides = dmoc.solve(crane, "ipm")
    proposal = slides.proposal
    assert slides.solved and proposal is not None and str(proposal) in slides.message
    (stay,) = proposal.stays
    rests = np.flatnonzero(np.diff(slides.phases[0].q[:, 0]) < 1e-7)  # its steps, of 0.5 m in all
    t = slides.phases[0].t
    assert (stay.contact, stay.mode, stay.cheaper) == ("rail", "slip+", "stick")
    assert stay.begin == pytest.approx(t[rests[0]]) and stay.end == pytest.approx(t[rests[-1] + 1])
    assert proposal.sequence == ("rail:stick", "rail:slip+") and proposal.contacts is None
    printed = " ".join(str(slides).split())
    assert printed.count("where sticking would cost less") == 1
    assert slides.to_dict()["proposal"]["sequence"] == proposal.sequence
    assert dmoc.Solution.from_bytes(slides.to_bytes()).proposal == proposal
    problem = crane.but(sequence=proposal.sequence)
    stands = dmoc.solve(problem, "ipm", guess=slides, verify=False)
    assert stands.cost < 0.95 * slides.cost
    # At rest it holds all that it can, and would rather roll back.
    assert stands.proposal is not None and stands.proposal.stays[0].cheaper == "slip-"
    assert any(b.startswith("friction cone of rail at") for b in stands.active_bounds)
    back = answer_of(crane.but(sequence=stands.proposal.sequence), "ipm", guess=stands)
    assert back.cost < 0.95 * stands.cost and back.proposal is None


@pytest.mark.slow
def test_a_search_tries_what_a_motion_proposes(crane: dmoc.Problem) -> None:
    result = dmoc.search(crane.but(steps=40), 0)
    assert result.best is not None
    assert result.best.sequence == ("rail:slip-", "rail:stick", "rail:slip+")
    root = result.nodes[0]
    assert root.sequence == () and "where sticking would cost less" in root.evidence[-1]


def test_what_is_proposed_for_the_start_are_other_contacts() -> None:
    # To where it is: sliding at rest costs f^2 T / 2 = 2, sticking nothing.
    there = pushed(20).but(goal={"x": 0, "x_dot": 0}, contacts=["rail:slip+"], sequence=[])
    slides = dmoc.solve(there, "ipm", verify=False)
    assert slides.cost == pytest.approx(2.0, rel=1e-6) and slides.proposal is not None
    assert slides.proposal.contacts == ("rail:stick",) and slides.proposal.sequence == ()
    sticks = dmoc.solve(there.but(contacts=slides.proposal.contacts), "ipm", verify=False)
    assert sticks.cost == pytest.approx(0.0, abs=1e-9) and sticks.proposal is None
    result = dmoc.search(there, 0)  # which begins as the problem does
    assert ("rail:stick",) in [n.sequence for n in result.nodes]
    # With the start as it is stated, one of its steps comes first.
    later = there.but(sequence=["rail:stick"])
    lay, x = Layout.of(later), restated(later, slides)
    assert x[lay.index_h] * lay.steps == pytest.approx([0.2, 3.8])
    assert np.all(np.diff(lay.times(x)) > 0) and lay.times(x)[-1] == pytest.approx(4)


@pytest.mark.parametrize("nodes", [(3, 5), (5, 3), (4, 2)])
def test_a_motion_with_a_phase_more_begins_with_a_step_of_the_first(
    nodes: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two phases of so many nodes, with a hit of 3 N s between them, and nothing that is new."""
    times = [np.linspace(i, i + 1, n) for i, n in enumerate(nodes)]
    pieces = [Piece(t, t[:, None], t[:, None], t, t[:, None]) for t in times]
    solution: Any = SimpleNamespace(
        proposal=SimpleNamespace(times=(1.0,)), final_time=2.0, trajectory=None,
        collisions=[SimpleNamespace(impulse=3.0)],
    )  # fmt: skip
    monkeypatch.setattr(starts, "pieces_of", lambda _: pieces)
    monkeypatch.setattr(starts, "unknowns_along", lambda _, *stated: stated)
    problem: Any = SimpleNamespace(phases=3)
    stated: Any = restated(problem, solution)
    first, second = times
    ends = [first[:2], first[1:], second]
    assert [p.t.tolist() for p in stated[0]] == [t.tolist() for t in ends]
    assert [p.q[:, 0].tolist() for p in stated[0]] == [t.tolist() for t in ends]
    assert stated[1] == [0.0, 3.0]
    problem.phases = 2
    assert [p.t.tolist() for p in restated(problem, solution)[0]] == [t.tolist() for t in times]


@pytest.mark.slow
def test_a_contact_that_does_not_press_may_leave() -> None:
    """A bead thrown over a parabola at a speed at which it flies: held down it costs the weight
    that is missing, in the air nothing."""
    system = dmoc.MechanicalSystem(
        "thrown_over", [X, Y], (X.diff(T) ** 2 + Y.diff(T) ** 2) / 2 - 9.81 * Y, {},
        inputs=[U, V], forces={X: U, Y: V}, cost=U**2 + V**2, surfaces={"ground": Y >= -(X**2) / 2},
    )  # fmt: skip
    start = {"x": -1, "y": -0.5, "x_dot": 4, "y_dot": 4}
    problem = dmoc.Problem(
        system, start=start, goal={"x": 1}, contacts=["ground"], steps=40, final_time=0.5
    )
    held = dmoc.solve(problem, "ipm", starts=1, verify=False)
    assert held.proposal is not None and held.proposal.contacts == ()
    assert {s.cheaper for s in held.proposal.stays} == {"open"}
    flies = answer_of(problem.but(contacts=[]), "ipm", starts=1)
    assert flies.cost == pytest.approx(0.0, abs=1e-9)
    assert held.cost > 1


@pytest.fixture(scope="module")
def hill() -> Kernels:
    """A bead of 1 kg over y = -x^2 / 2 + b x^4, whose input along x costs much."""
    b = sp.Symbol("b")
    system = dmoc.MechanicalSystem(
        "over_a_hill", [X, Y], (X.diff(T) ** 2 + Y.diff(T) ** 2) / 2 - 9.81 * Y, {b: 0.0},
        inputs=[U, V], forces={X: U, Y: V}, cost=100 * U**2 + V**2,
        surfaces={"ground": b * X**4 - X**2 / 2 <= Y},
    )  # fmt: skip
    return dmoc.build(system)


@pytest.mark.parametrize("steps", [10, 20])
@pytest.mark.parametrize("b", [-0.03, -0.005, 0.005, 0.03])
def test_leaving_saves_where_the_flight_is_above_the_ground(
    hill: Kernels, b: float, steps: int
) -> None:
    """At 5 m/s the bead has to be held down, at least by the constant force of a parabola that
    begins and ends on the hill along it: at x = 0 it is b below the top."""
    slope = 1 - 4 * b
    ends = [{"x": x, "y": b - 0.5, "x_dot": 5, "y_dot": -5 * x * slope} for x in (-1, 1)]
    problem = dmoc.Problem(
        hill, start=ends[0], goal=ends[1], contacts=["ground"], steps=steps, final_time=0.4,
        parameters={"b": b},
    )  # fmt: skip
    held = dmoc.solve(problem, "ipm", starts=1, verify=False)
    flies = dmoc.solve(problem.but(contacts=[]), "ipm", starts=1, verify=False)
    assert held.solved and flies.solved and (flies.cost < held.cost) == (b < 0)
    if b < 0:
        assert flies.cost == pytest.approx(0.4 * (9.81 - 25 * slope) ** 2, rel=1e-6)
        assert held.proposal is not None and held.proposal.contacts == ()
    else:
        assert held.proposal is None


@pytest.mark.parametrize("n", [4, 20, 200])
def test_a_gap_that_grows_and_vanishes_has_no_jump_in_its_rate(n: int) -> None:
    rates = np.diff(_lifts(n, True), axis=1, prepend=0.0)
    back, away = rates[:-1], rates[-1]
    assert np.abs(rates).max() < 1.05 and np.abs(back.sum(axis=1)).max() < 1e-12
    # Parabolas touch zero at both ends, within a step of one twice as long as its half.
    assert np.all(back[:, 0] <= 16 * 2 / 3 / n) and np.all(-back[:, -1] <= 16 * 2 / 3 / n)
    assert np.diff(away) == pytest.approx(1 / n)
    assert len(_lifts(n, False)) == len(back)


@pytest.mark.parametrize("sequence", [["rail:slip+", "rail:stick"], []])
def test_sliding_that_goes_on_and_sticking_that_holds_are_not_told(sequence: list[str]) -> None:
    contacts = [] if sequence else ["rail:slip+"]
    block = pushed(40).but(sequence=sequence, contacts=contacts)
    assert dmoc.solve(block, "ipm", verify=False).proposal is None
