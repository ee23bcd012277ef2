"""Motions beside known ones: what every one of them keeps, and how far they are."""

from __future__ import annotations

import numpy as np
import pytest

import dmoc
from dmoc.codegen.kernels import Array
from dmoc.guess.automatic import initial_guesses
from dmoc.guess.neighbours import KINDS, neighbours
from dmoc.problem.problem import Problem
from dmoc.program.layout import Layout


def beside(
    problem: Problem, count: int = 60, amplitude: float = 1.0
) -> tuple[Layout, Array, Array]:
    known = initial_guesses(problem)[0].x
    x = neighbours(problem, [known], range(count), amplitude=amplitude)
    return Layout.of(problem), known, x


def test_they_keep_ends_times_and_inputs(seed: dmoc.Problem) -> None:
    lay, known, x = beside(seed.but(steps=(6, 9), final_time=(0.9, 1.1)))
    for node, bounds in ((0, seed.start_bounds), (-1, seed.goal_bounds)):
        fixed = bounds.position[:, 0] == bounds.position[:, 1]
        q = x[:, lay.index_q[node]]
        assert q[:, fixed] == pytest.approx(np.tile(known[lay.index_q[node, fixed]], (60, 1)))
        assert (np.ptp(q[:, ~fixed], axis=0) > 0.1 * seed.reach[~fixed]).all()
    times = x[:, lay.index_h] @ np.array(lay.steps)
    assert times.min() >= 0.9 - 1e-12 and times.max() <= 1.1 + 1e-12 and np.ptp(times) > 0.05
    assert (x[:, lay.index_u] == known[lay.index_u]).all()
    assert np.isfinite(x).all()


def test_a_number_is_a_motion_however_many_there_are(seed: dmoc.Problem) -> None:
    known = [g.x for g in initial_guesses(seed)]
    few = neighbours(seed, known, range(3, 5), 7)
    assert (few == neighbours(seed, known, range(8), 7)[3:5]).all()
    assert not np.allclose(few, neighbours(seed, known, range(3, 5), 8))


def test_their_kinds_differ_in_waves_and_in_durations(seed: dmoc.Problem) -> None:
    """Each has the spread of the logarithm of the ratio of durations that it says, times sqrt 2,
    and waves of its size; an amplitude is a factor of these."""
    lay, known, x = beside(seed.but(final_time=(0.01, 100.0), durations=None), 900)
    kind = np.arange(900) % len(KINDS)
    durations = x[:, lay.index_h] * np.array(lay.steps)
    ratios = np.log(durations[:, 0] / durations[:, 1])
    spreads = [float(ratios[kind == k].std()) for k in range(len(KINDS))]
    assert spreads == pytest.approx([spread * 2**0.5 for *_, spread in KINDS], rel=0.2)
    far = np.abs(x - known)[:, lay.index_q].max(axis=(1, 2))
    sizes = [float(np.median(far[kind == k])) for k in range(len(KINDS))]
    assert sizes[0] > 2 * sizes[1] < sizes[2]
    _, _, smaller = beside(seed.but(final_time=(0.01, 100.0), durations=None), 900, 0.5)
    nearer = np.abs(smaller - known)[:, lay.index_q].max(axis=(1, 2))
    assert nearer == pytest.approx(far / 2)


def test_most_are_beside_the_best_ones(seed: dmoc.Problem) -> None:
    """Of four motions that differ in their inputs, which neighbours keep: ranks fall off as
    exp(-rank / 4)."""
    lay = Layout.of(seed)
    known = [np.zeros(lay.size) + initial_guesses(seed)[0].x for _ in range(4)]
    for rank, x in enumerate(known):
        x[lay.index_u] = rank
    of = neighbours(seed, known, range(400))[:, lay.index_u].max(axis=(1, 2))
    shares = [float(np.mean(of == rank)) for rank in range(4)]
    p = np.exp(-0.25)
    assert shares == pytest.approx([1 - p, p - p**2, p**2 - p**3, p**3], abs=0.06)
