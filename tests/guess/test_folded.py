"""Motions that are folded at surfaces."""

from __future__ import annotations

import numpy as np
import pytest

import dmoc
from dmoc.guess.folded import folded_motions
from dmoc.mechanics.touch import Open
from dmoc.models.registry import find
from dmoc.problem.derived import relaxed


@pytest.fixture(scope="module")
def plain() -> dmoc.Problem:
    reference = find("puck_table")
    problem = dmoc.Problem(reference.kernels(), **reference.defaults)
    return relaxed(problem, Open(), (), 40, 1.0)


def test_folded_motions_stay_on_the_table_and_hit_where_they_were_folded(
    plain: dmoc.Problem,
) -> None:
    """The mass matrix is that of a point: a mirror image is that of a billiard."""
    places = {"west": (0, 0.0), "east": (0, 1.0), "south": (1, 0.0), "north": (1, 1.0)}
    motions = list(folded_motions(plain, range(4), range(64), 0))
    assert sum(bool(m.hits) for m in motions) >= 8
    assert {name for m in motions for name in m.hits} == {*places}
    for m in motions:
        assert len(m.pieces) == len(m.hits) + 1 == len(m.impulses) + 1
        q = np.vstack([piece.q for piece in m.pieces])
        assert (q > -1e-9).all() and (q < 1 + 1e-9).all()
        assert m.pieces[0].q[0] == pytest.approx([0.3, 0.2])
        assert m.pieces[-1].q[-1] == pytest.approx([0.4, 0.7])
        for name, before, after in zip(m.hits, m.pieces[:-1], m.pieces[1:], strict=True):
            axis, place = places[name]
            assert before.q[-1][axis] == pytest.approx(place, abs=1e-9)
            assert after.t[0] == before.t[-1] and (np.diff(before.t) > 0).all()


def test_without_mirrors_there_are_no_hits(plain: dmoc.Problem) -> None:
    motions = list(folded_motions(plain, (), range(8), 0))
    assert motions and not any(m.hits for m in motions)


def test_motions_follow_from_their_numbers(plain: dmoc.Problem) -> None:
    one, two = (list(folded_motions(plain, range(4), n, 5)) for n in (range(6), range(3, 6)))
    assert [m.hits for m in one[-len(two) :]] == [m.hits for m in two]
    assert one[-1].pieces[0].q == pytest.approx(two[-1].pieces[0].q)


def test_inputs_are_those_that_the_folded_motion_needs(plain: dmoc.Problem) -> None:
    """A free puck: the mass times the acceleration, in second differences, between hits."""
    mass = plain.model.mass(plain.start_position)
    pieces = [p for m in folded_motions(plain, range(4), range(16), 0) for p in m.pieces]
    some = [p for p in pieces if len(p.t) > 6]
    assert len(some) > 8
    for p in some:
        u = (p.q[2:] - 2 * p.q[1:-1] + p.q[:-2])[2:-2] / (p.t[3] - p.t[2]) ** 2 @ mass
        mean = (p.u[1:] + p.u[:-1])[2:-2] / 2
        assert mean == pytest.approx(u, rel=0.05, abs=0.05 * np.abs(u).max())
