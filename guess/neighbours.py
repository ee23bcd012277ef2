"""Motions beside known ones, to start from: the same with waves on top and other durations.

Where one start in a hundred leads to the best minimum, minima lie in funnels: from motions beside a
good one most solves end, in few iterations, and some of them at a better one (basin hopping: Leary,
"Global optimization on funneling landscapes", 2000).  Motion k of a seed is the same whichever
others are asked for.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.guess.contacts import all_in_contact
from dmoc.problem.problem import Problem
from dmoc.program.layout import Layout

# Waves of the coordinates, so many at most; amplitudes are in reaches, each motion has its own.
WAVES = 6
# Kinds of neighbours in turn: least and largest amplitude, evenly by its logarithm, and the spread
# of the logarithm of durations: motions whose events come at other times are in other funnels.
KINDS = ((0.05, 0.5, 0.3), (0.02, 0.1, 2.0), (0.05, 0.5, 1.0))
# Mean rank of the motions that neighbours are made of, the best one being 0.
RANK = 4.0
# What a seed has behind the number of a neighbour.
BESIDE = 2


def neighbours(
    problem: Problem,
    motions: Sequence[Array],
    numbers: range,
    seed: int = 0,
    amplitude: float = 1.0,
) -> Array:
    """Unknowns beside those of some motions, the best first, shape (n,) each, for given numbers:
    shape (len(numbers), n); half of them at least are beside the first three. ``amplitude`` is a
    factor of the usual ones."""
    lay = Layout.of(problem)
    rngs = [np.random.default_rng([seed, k, BESIDE]) for k in numbers]
    ranks = [min(int(rng.exponential(RANK)), len(motions) - 1) for rng in rngs]
    least, largest, spreads = np.array([KINDS[k % len(KINDS)] for k in numbers]).reshape(-1, 3).T
    share = np.array([rng.random() for rng in rngs])
    sizes = amplitude * least * (largest / least) ** share
    x = np.array([motions[rank] for rank in ranks]).reshape(-1, lay.size)
    with np.errstate(all="ignore"):
        return all_in_contact(problem, shaken(problem, lay, x, rngs, sizes, spreads))


def shaken(
    problem: Problem,
    lay: Layout,
    x: Array,
    rngs: Sequence[np.random.Generator],
    sizes: Array,
    spreads: Array,
) -> Array:
    """Unknowns of motions, shape (count, n), with waves of sizes in reaches, ends that are open
    moved as far, and durations whose logarithms have spreads, within the bounds of times."""
    x, m = x.copy(), np.arange(1, WAVES + 1)
    reach = sizes[:, None, None] * problem.reach
    waves = np.array([rng.standard_normal((WAVES, lay.nq)) for rng in rngs]) * reach / m[:, None]
    ends = np.array([rng.standard_normal((2, lay.nq)) for rng in rngs]) * reach
    longer = np.array([rng.standard_normal(lay.phases) for rng in rngs])
    for k, bounds in enumerate((problem.start_bounds, problem.goal_bounds)):
        ends[:, k, bounds.position[:, 0] == bounds.position[:, 1]] = 0.0
    s = np.arange(lay.total + 1)[:, None] / lay.total
    inside = lay.scheme.within(s[:-1], s[1:]).reshape(-1, 1)

    def away(s: Array) -> Array:
        return np.asarray(np.sin(np.pi * s * m) @ waves + np.hstack([1 - s, s]) @ ends)

    x[:, lay.index_q] += away(s)
    x[:, lay.index_q_i] += away(inside).reshape(len(x), lay.total, -1)
    before = lay.durations(x)
    durations = before * np.exp(spreads[:, None] * longer)
    low, high = problem.final_time_bounds
    total = durations.sum(axis=1, keepdims=True)
    # Where nothing limits the time, the cheaper motions are sometimes the longer ones, without end.
    most = high if np.isfinite(high) else before.sum(axis=1, keepdims=True)
    durations *= np.minimum(np.maximum(total, low), most) / total
    x[:, lay.index_h] = lay.step_sizes(np.clip(durations, *problem.duration_bounds.T))
    for row in x if lay.timed or lay.index_t_i.size else ():
        lay.put_times(row)
    return x
