"""Contacts that stay at the edge of their mode, and what is proposed instead."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from contact_problems import pushed
from sympy.physics.mechanics import dynamicsymbols

import dmoc

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
    back = dmoc.solve(crane.but(sequence=stands.proposal.sequence), "ipm", guess=stands)
    assert back.solved and back.cost < 0.95 * stands.cost and back.proposal is None


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
    flies = dmoc.solve(problem.but(contacts=[]), "ipm", starts=1)
    assert flies.solved and flies.cost == pytest.approx(0.0, abs=1e-9)
    assert held.cost > 1


@pytest.mark.parametrize("sequence", [["rail:slip+", "rail:stick"], []])
def test_sliding_that_goes_on_and_sticking_that_holds_are_not_told(sequence: list[str]) -> None:
    contacts = [] if sequence else ["rail:slip+"]
    block = pushed(40).but(sequence=sequence, contacts=contacts)
    assert dmoc.solve(block, "ipm", verify=False).proposal is None
