"""The exact solution of the optimality conditions, found with 40 digits, lies in its balls."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import mpmath as mp
import numpy as np

import dmoc
from dmoc.codegen.build import numpy_kernels
from dmoc.codegen.kernels import Array
from dmoc.codegen.manifest import Manifest
from dmoc.codegen.text import manifest, numpy_text
from dmoc.program.arrays import PassData
from dmoc.program.transcription import Transcription
from dmoc.proving.active_set import Point, sharpened
from dmoc.proving.proof import Near, Trial, proof
from dmoc.solving.programs import at_solution
from dmoc.symbolic.families import model_spec

DIGITS = 40
# NumPy's functions, of arrays of numbers of mpmath.
FUNCTIONS = SimpleNamespace(
    **{n: np.frompyfunc(getattr(mp, n), 1, 1) for n in ("sin", "cos", "tan", "sqrt", "exp", "log")}
)


class ManyDigits:
    """The optimality conditions of a program, with numbers of mpmath."""

    def __init__(self, nlp: Transcription, point: Point) -> None:
        self.nlp, self.point, self.data = nlp, point, nlp.assembled.data
        kernels = nlp.kernels
        assert kernels.system is not None
        model = model_spec(kernels.system(), kernels.manifest.order, kernels.design)
        made = numpy_kernels(Manifest.read(manifest(model)), numpy_text(model))
        self.functions = made.module
        self.functions.__dict__["np"] = FUNCTIONS

    def total(self, data: PassData, pool: Any) -> Any:
        target = numbers(data.constant)
        np.add.at(target, data.rows, numbers(data.coefficients) * pool[data.columns])
        for element in data.elements:
            results = [np.zeros(at.shape, dtype=object) for at in element.slots]
            arguments = [pool[at] for at in element.arguments]
            getattr(self.functions, element.kernel)(*arguments, *results)
            for result, at, factor in zip(results, element.slots, element.factors, strict=True):
                kept = at >= 0
                np.add.at(target, at[kept], result[kept] * numbers(factor[kept]))
        return target

    def conditions(self, x: Any, y: Any) -> tuple[Any, Any]:
        """F at a point, and the cost there."""
        nlp, system = self.nlp, self.point.system
        pool = numbers(self.data.pool)
        pool[: nlp.n + len(y) + 1] = np.concatenate([x, y, [mp.mpf(1)]]) * numbers(self.data.sizes)
        held = ~np.isnan(system.held)
        pool[: nlp.n][held] = numbers(system.held[held])
        values, slopes = (self.total(d, pool) for d in (self.data.values, self.data.slopes))
        slope = slopes[: nlp.n].copy()
        np.add.at(slope, system.entry_columns, slopes[nlp.n :] * y[system.entry_rows])
        return np.concatenate([slope, values[1:]])[system.order], values[0]

    def solved(self) -> tuple[Any, Any, Any]:
        """The exact unknowns and multipliers, and their cost."""
        system = self.point.system
        x, y = numbers(self.point.x), numbers(self.point.y)
        _, upper = system.at(self.point.x, self.point.y)
        K = upper.toarray()
        K += np.triu(K, 1).T
        F, cost = self.conditions(x, y)
        while max(abs(F)) > mp.mpf(10) ** -22:
            of_x, of_y = system.parts(np.linalg.solve(K, F.astype(float)))
            x, y = x - numbers(of_x), y - numbers(of_y)
            F, cost = self.conditions(x, y)
        return x, y, cost


def numbers(values: Array) -> Any:
    """Numbers of mpmath."""
    made = np.empty(np.shape(values), dtype=object)
    made.ravel()[:] = [mp.mpf(float(v)) for v in np.ravel(values)]
    return made


def test_the_exact_solution_lies_in_its_balls(seed: dmoc.Problem) -> None:
    """The cart-pendulum with one hit, on a mesh of few steps."""
    problem = seed.but(steps=3)
    solution = dmoc.solve(problem, starts=1, verify=False)
    nlp, duals = at_solution(problem, solution)
    answer = nlp.scaled(solution.unknowns)
    point = sharpened(nlp, answer, duals)
    trial, certificate = Trial(point), proof(nlp, answer, point)
    assert trial.radii is not None and certificate.proved and certificate.cost is not None
    near = Near(nlp, point, trial.exact, trial.radii)
    with mp.workdps(DIGITS):
        x, y, cost = ManyDigits(nlp, point).solved()
        of_x, of_y = point.system.parts(trial.radii)
        for exact, middle, radius in ((x, point.x, of_x), (y, point.y, of_y)):
            apart = abs(exact - numbers(middle))
            assert (apart <= numbers(radius)).all()
            moved = radius > 0
            # And not by far: the radii are those of rounding errors.
            assert max(apart[moved] / numbers(radius[moved])) > mp.mpf(10) ** -5
        low, high = (mp.mpf(bound) for bound in certificate.cost)
        assert low <= cost * mp.mpf(nlp.scale.cost) <= high < low * (1 + mp.mpf(10) ** -9)
        assert max(abs(x - numbers(answer))) <= certificate.radius
    assert near.cost == certificate.cost
