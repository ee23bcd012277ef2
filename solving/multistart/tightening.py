"""Motions within limits of the inputs, by way of wider ones, where no start leads to one."""

from __future__ import annotations

import numpy as np

from dmoc.guess.automatic import initial_guesses
from dmoc.guess.random_motions import random_motions
from dmoc.problem.problem import Problem
from dmoc.program.scaling import scale_of
from dmoc.solvers.outcome import Options
from dmoc.solving.multistart.minima import Basin, gathered
from dmoc.solving.multistart.parallel import attempts_from
from dmoc.solving.programs import Programs

# Limits of inputs are widened by the first factor and tightened by the others, with so many starts,
# of which so many minima are followed.
WIDER = (4.0, 2.8, 2.0, 1.6, 1.3, 1.12, 1.0)
WIDE_STARTS, FOLLOWED = 32, 8


def tightened(coarse: Problem, natural: float, seed: int, options: Options) -> list[Basin]:
    """Minima that are left when wide limits of the inputs are tightened step by step."""
    if not np.isfinite(coarse.input_bounds).any():
        return []
    wide = _widened(coarse, WIDER[0])
    points = [g.x for g in initial_guesses(wide, options.deadline)]
    scale = scale_of(wide, points[0])
    points += list(random_motions(wide, points, natural, range(WIDE_STARTS), seed))
    minima = list[Basin]()
    for factor in WIDER:
        narrower = _widened(coarse, factor)
        minima = gathered([], attempts_from(Programs(narrower, scale), points, options))
        points = [b.motion for b in minima[:FOLLOWED]]
        if not points:
            break
    return minima


def _widened(problem: Problem, factor: float) -> Problem:
    """The problem with wider limits of its inputs."""
    low, high = problem.input_bounds.T
    sizes = [np.where(np.isfinite(limit), np.abs(limit), 0.0) for limit in (low, high)]
    width = np.where(np.isfinite(high - low), (high - low) / 2, np.maximum(*sizes))
    more = (factor - 1) * width
    names = problem.kernels.inputs
    boxes = dict(zip(names, zip(low - more, high + more, strict=True), strict=True))
    return problem.but(bounds={**problem.bounds, **boxes})
