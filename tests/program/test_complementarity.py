"""Contacts that no word says: the rows of the relaxed program, and what they allow."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from contact_problems import against_wall, floor, pushed

import dmoc
from dmoc.mechanics.touch import Open
from dmoc.problem.derived import relaxed
from dmoc.program.laws.complementarity import OF_HITS, ComplementarityLaw
from dmoc.program.scale import Scale
from dmoc.program.transcription import Transcription
from dmoc.solvers.ipm import solve_ipm
from dmoc.solvers.judge import judged
from dmoc.solvers.outcome import Options, Status

EPS, STEPS = 0.25, 5


def on_floor() -> dmoc.Problem:
    """A block of mass 2 on a floor with friction 0.1."""
    return dmoc.Problem(
        dmoc.build(floor()), start={"x": 0, "y": None}, contacts=["floor"], steps=STEPS,
        final_time=1,
    )  # fmt: skip


@pytest.fixture
def block() -> Transcription:
    return Transcription(relaxed(on_floor(), Open((0,), (0,), (0,)), (), STEPS, EPS))


def values(nlp: Transcription, x: np.ndarray) -> tuple[ComplementarityLaw, np.ndarray]:
    """The law, and all rows at a point in units of the problem: its scale is of ones."""
    rows = np.concatenate([nlp.equality(x), nlp.inequality(x)])
    return nlp.laws.complementarity, rows * nlp.row_sizes


def test_rows_are_the_products_of_the_theory(block: Transcription) -> None:
    rng, lay = np.random.default_rng(3), block.layout
    x = rng.uniform(0.1, 1.0, block.n)
    law, d = values(block, x)
    x = block.physical(x)
    q, P, T = x[lay.index_q], x[lay.relaxed.P_r][:, 0], x[lay.relaxed.T_r][:, 0]
    later = np.append(q[1:, 1], q[-1, 1])  # the gap is y
    shares = law.pressing.sizes(block.scale)
    assert d[law.pressing.index[:, 0]] == pytest.approx(EPS * shares - P * later)
    assert d[law.cone.index[:, 0]] == pytest.approx(np.stack([0.1 * P + T, 0.1 * P - T], axis=1))
    slid = np.append(np.diff(q[:, 0]), q[-1, 0] - q[-2, 0])
    eps = EPS * law.dissipation.sizes(block.scale).reshape(-1, 2)
    opposed = np.stack([slid * (T + 0.1 * P), slid * (T - 0.1 * P)], axis=1)
    assert d[law.dissipation.index[:, 0]] == pytest.approx(eps - opposed)
    ends = EPS / STEPS + np.array([P[1] - P[0], P[-2] - P[-1]])
    assert d[law.ends.index[:, 0]] == pytest.approx(ends)
    assert d[law.closed.index[0]] == pytest.approx([EPS - q[0, 1]])


def test_a_hit_may_be_none_and_rebounds_by_its_coefficient() -> None:
    problem = against_wall(3, 0.5).but(sequence=(), contacts=())
    eps = OF_HITS / 4
    nlp = Transcription(relaxed(problem, Open((), (0,)), ["wall"], 3, eps))
    rng, lay = np.random.default_rng(4), nlp.layout
    x = rng.uniform(0.1, 1.0, nlp.n)
    law, d = values(nlp, x)
    x = nlp.physical(x)
    (lam,), (before,), (after,) = x[lay.impact.lam], x[lay.impact.v_a[0]], x[lay.impact.v_c[0]]
    place = x[lay.index_q[3, 0]]  # the wall is at 1
    assert d[law.hit.index] == pytest.approx([eps + lam * (place - 1)])
    miss = lam * (after + 0.5 * before)
    assert d[law.rebound.index[0]] == pytest.approx([eps + miss, eps - miss])
    # A rail bears its force for the time that a node stands for: half a step at both ends.
    h, T = np.repeat(x[lay.index_h], 3), x[lay.relaxed.T_r][:, 0]
    bears = (np.append(h, 0) + np.append(0, h)) / 2
    assert d[law.cone.index[:, 0, 0]] == pytest.approx(bears + T)
    assert not laws_rows(nlp, "contact") and not laws_rows(nlp, "energy")


def laws_rows(nlp: Transcription, name: str) -> int:
    return sum(b.count for b in (*nlp.equalities, *nlp.inequalities) if b.name == name)


def test_programs_of_another_eps_share_their_structure() -> None:
    problem, scale = pushed(4).but(sequence=()), Scale.none(pushed(4).but(sequence=()))
    coarse, fine = (
        Transcription(relaxed(problem, Open((), (0,)), (), 8, eps), scale) for eps in (1.0, 1e-3)
    )
    assert coarse.structure is fine.structure
    law, x = fine.laws.complementarity, np.zeros(fine.n)
    rows = law.dissipation.numbers - fine.n_eq
    assert coarse.inequality(x)[rows] == pytest.approx(1)
    assert fine.inequality(x)[rows] == pytest.approx(1e-3)
    again = coarse.relaxed_by(1e-3)
    assert (again.inequality(x) == fine.inequality(x)).all()
    assert again.structure is fine.structure and coarse.inequality(x)[rows] == pytest.approx(1)


def test_a_block_that_is_dropped_comes_to_rest_on_the_floor() -> None:
    """From 1 m at g = 5 it falls for sqrt(2/5) s, and takes the impulse m sqrt(2 g) there."""
    problem = on_floor().but(start={"x": 0, "y": 1}, contacts=())
    steps, scale = 40, Scale.none(problem)
    x, duals = np.zeros(0), None
    for eps in (1.0, 1e-2, 1e-4, 1e-6):
        nlp = Transcription(relaxed(problem, Open((0,), (0,)), (), steps, eps), scale)
        lay = nlp.layout
        if not len(x):
            x = np.zeros(nlp.n)
            x[lay.index_h], x[lay.index_q[:, 1]] = 1 / steps, np.linspace(1, 0, steps + 1)
        outcome = judged(nlp, solve_ipm(nlp, x, Options(), duals), Options())
        assert outcome.status is Status.SOLVED
        x, duals = outcome.x, outcome.duals
    x = nlp.physical(x)
    height, P = x[lay.index_q[:, 1]], x[lay.relaxed.P_r[:, 0]]
    lands = int(np.argmax(P))
    assert lands / steps == pytest.approx(np.sqrt(2 / 5), abs=1 / steps)
    weight = 2 * 5 / steps
    assert P[lands : lands + 2].sum() == pytest.approx(2 * np.sqrt(10) + 1.5 * weight, rel=0.05)
    assert P[:-1].sum() == pytest.approx(2 * 5 - weight / 2, rel=1e-3)  # its fall, and its weight
    assert height[lands + 1 :] == pytest.approx(0, abs=1e-3)
    assert P[lands + 2 : -1] == pytest.approx(weight, rel=0.02)


@pytest.mark.parametrize("surface", [0, 1, 2])
def test_a_tangent_is_pressed_by_its_surface_in_contacts_and_hits(surface: int) -> None:
    """Three surfaces, of which the first is hit at node 2, the last at nodes 3 and 5."""
    contacts = np.arange(100, 118).reshape(6, 3)
    touch = SimpleNamespace(
        contacts=SimpleNamespace(supports=[surface]), surfaces=np.array([0, 2, 2])
    )
    lay = SimpleNamespace(
        total=5, touch=touch, collision_nodes=np.array([2, 3, 5]),
        impact=SimpleNamespace(lam=np.array([7, 8, 9])), relaxed=SimpleNamespace(P_r=contacts),
    )  # fmt: skip
    law: Any = SimpleNamespace(lay=lay)
    (lasting, whole), (struck, one) = ComplementarityLaw._pressed(law, 0)
    hits = {0: [-1, -1, 7, -1, -1, -1], 1: [-1] * 6, 2: [-1, -1, -1, 8, -1, 9]}[surface]
    assert lasting.tolist() == contacts[:, surface].tolist() and struck.tolist() == hits
    assert (whole == 1).all() and (one == 1).all()
