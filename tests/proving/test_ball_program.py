"""Programs in balls contain programs in numbers, and kernels those in many digits."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from contact_problems import against_wall

import dmoc
from dmoc.base.errors import ProblemError
from dmoc.codegen.kernels import Kernels
from dmoc.inspection.reference_values import ReferenceValues
from dmoc.program.scaling import scale_of
from dmoc.program.transcription import Transcription
from dmoc.proving.ball_program import BallProgram, Sum
from dmoc.proving.balls import Ball, BallFunctions
from dmoc.proving.kernel_text import kernels_over
from dmoc.symbolic.continuous import readable


def test_kernels_contain_their_functions(pendulum: Kernels) -> None:
    """A step and an impact of the cart-pendulum, beside differences of its functions in 90
    digits."""
    assert pendulum.system is not None
    functions, rng = kernels_over(pendulum, BallFunctions), np.random.default_rng(4)
    parameters = np.array([float(v or 0) for v in pendulum.parameters.values()])
    with mp.workdps(90):
        reference = ReferenceValues(readable(pendulum.system()), pendulum, parameters)
        for name in ("step", "impact", "energy"):
            sizes = [size for _, size in pendulum.manifest.kernels[name]["inputs"]][:-1]
            point = rng.uniform(0.2, 0.9, sum(sizes))
            exact = reference.families[name]([mp.mpf(x) for x in point])
            parts = [part[None] for part in np.split(point, np.cumsum(sizes)[:-1])]
            counts = [len(exact[o]) if o in exact else 0 for o in pendulum.outputs(name)]
            results = [Ball(np.zeros((1, k)), np.zeros((1, k))) for k in counts]
            arguments = [Ball(p, np.zeros_like(p)) for p in (*parts, parameters[None])]
            getattr(functions, name)(*arguments, *results)
            for output, result in zip(pendulum.outputs(name), results, strict=True):
                for m, r, value in zip(
                    result.m[0], result.r[0], exact.get(output, ()), strict=True
                ):
                    assert abs(value - mp.mpf(float(m))) <= float(r) < 1e-13 * (1 + abs(m))


def test_a_program_contains_its_values_and_derivatives() -> None:
    """Friction, a wall and a hit with restitution, at random points of balls."""
    problem = against_wall(3, 0.8)
    guess = dmoc.solve(problem, starts=1, verify=False).unknowns
    nlp = Transcription(problem, scale_of(problem, guess))
    balls, x, rng = BallProgram(nlp), nlp.scaled(guess), np.random.default_rng(5)
    y = rng.normal(size=nlp.n_eq + nlp.n_in)
    off = 1e-6
    fixed = nlp.lower >= nlp.upper
    held = np.where(fixed, nlp.limits[0], np.nan)
    pool = balls.pool(Ball(x, np.full(len(x), off)), Ball(y, np.full(len(y), off)), held)
    enclosures = balls.values(pool), balls.slopes(pool), balls.curvatures(pool)
    for _ in range(5):
        z = np.where(fixed, nlp.lower, x + off * rng.uniform(-1, 1, len(x)))
        w = y + off * rng.uniform(-1, 1, len(y))
        for ball, value in zip(
            enclosures,
            (nlp.values(z), nlp.slopes(z), nlp.program.curvatures(z, w, 1.0)),
            strict=True,
        ):
            assert (np.abs(value - ball.m) <= ball.r).all()
    assert all((ball.r <= 1e-2 * (1 + np.abs(ball.m))).all() for ball in enclosures)
    # What is fixed is what the problem says, whatever its size.
    at = np.flatnonzero(fixed)
    assert pool.m[at].tolist() == nlp.limits[0][at].tolist() and not pool.r[at].any()


def test_sums_count_their_rounding_errors() -> None:
    total = Sum(1)
    for value in (1.0, *[2.0**-54] * 64, -1.0):  # 2^-48, of which nothing is left
        total.add(np.array([0]), Ball(np.array([value]), np.array([0.0])))
    assert abs(2.0**-48 - total.result.m[0]) <= total.result.r[0] < 1e-13


def test_kernels_that_do_not_know_their_system_are_refused(pendulum: Kernels) -> None:
    with pytest.raises(ProblemError, match="do not know their system"):
        kernels_over(replace(pendulum, system=None), BallFunctions)


def test_text_is_derived_once(pendulum: Kernels) -> None:
    derived = list[bool]()

    def system() -> Any:
        assert pendulum.system is not None
        derived.append(True)
        return pendulum.system()

    kernels = replace(pendulum, system=system)
    one, other = (kernels_over(kernels, BallFunctions, ("surface",)) for _ in range(2))
    assert len(derived) == 1 and one is not other
