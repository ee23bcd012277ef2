"""Grips that no word says: the rows of the relaxed program."""

from __future__ import annotations

import numpy as np
import pytest
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.mechanics.touch import Open
from dmoc.problem.derived import relaxed
from dmoc.program.scale import Scale
from dmoc.program.transcription import Transcription

EPS, STEPS = 0.25, 5


@pytest.fixture(scope="module")
def program() -> Transcription:
    """A mass in the plane with a hand of two places, closed at the start, and a clutch."""
    x, y = dynamicsymbols("x y")
    system = dmoc.MechanicalSystem(
        "held", [x, y], x.diff() ** 2 + y.diff() ** 2 / 2,
        grips={"hand": (x - 1, y - 2 * x), "clutch": x.diff() + y.diff()},
    )  # fmt: skip
    problem = dmoc.Problem(
        system, start={x: (0, 2), y: (0, 2), "x_dot": 0, "y_dot": 0}, steps=STEPS, final_time=1
    )
    own = relaxed(problem, Open((0, 1, 2), (), (0, 1)), (), STEPS, EPS)
    return Transcription(own, Scale.none(own))


def test_forces_act_where_all_places_of_their_grip_vanish(program: Transcription) -> None:
    rng, lay, law = np.random.default_rng(3), program.layout, program.laws.open_grips
    z = rng.uniform(-1.0, 1.0, program.n)
    rows = np.concatenate([program.equality(z), program.inequality(z)]) * program.row_sizes
    x = program.physical(z)
    q, P = x[lay.index_q], x[lay.relaxed.P_r]
    phi = np.stack([q[:, 0] - 1, q[:, 1] - 2 * q[:, 0], q[:, 0] + q[:, 1]], axis=1)
    later = np.vstack([phi[1:], phi[-1:]])
    assert law.holding and law.held and law.last
    share = EPS / STEPS
    for j in (0, 1):  # against the gap -phi
        for i in (0, 1):
            for end, place in enumerate((phi, later)):
                work = P[:, i] * place[:, j]
                own = rows[law.holding.index[:, j, i, end]]
                assert own == pytest.approx(np.stack([share - work, share + work], axis=1))
    moved = P[:, 2] * (later - phi)[:, 2]
    own = rows[law.holding.index[:, 2, 0, 1]]
    assert own == pytest.approx(np.stack([share - moved, share + moved], axis=1))
    assert (law.holding.index[:, 2, 0, 0] < 0).all() and (law.holding.index[:, 2, 1] < 0).all()
    start = np.stack([EPS - phi[0, :2], EPS + phi[0, :2]], axis=1)
    assert rows[law.held.index[0, :2]] == pytest.approx(start)
    end = P[-1] - P[-2] / 2
    assert rows[law.last.index[0]] == pytest.approx(np.stack([EPS + end, EPS - end], axis=1))


def test_impulses_of_grips_have_both_signs(program: Transcription) -> None:
    lower = program.lower[program.layout.relaxed.P_r]
    assert np.isinf(lower).all()
    assert not program.laws.complementarity.pressing.count


def test_derivatives_agree_with_differences(program: Transcription) -> None:
    rng = np.random.default_rng(5)
    z, d = rng.uniform(-1.0, 1.0, (2, program.n))
    slope = (program.inequality(z + 1e-6 * d) - program.inequality(z - 1e-6 * d)) / 2e-6
    assert program.inequality_jacobian(z) @ d == pytest.approx(slope, abs=1e-8)
