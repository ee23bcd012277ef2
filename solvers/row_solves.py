"""Minima of many programs of one form, each from its own point, perhaps with multipliers, in
compiled code (rows.pxi)."""

from __future__ import annotations

from math import inf

import numpy as np
from numpy.typing import NDArray

from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.program.assembly import Program
from dmoc.program.rows import RowNumbers, RowPrograms
from dmoc.program.transcription import Transcription
from dmoc.solvers import curvature
from dmoc.solvers.compiled import Rows
from dmoc.solvers.ipm import COLD, LEAST, WARM, demands, stretches
from dmoc.solvers.kkt import LEAST_COST, SCALE_FROM
from dmoc.solvers.kkt_layout import kkt_layout
from dmoc.solvers.outcome import Duals, Options


@record(frozen=True, eq=False)
class RowEnds:
    """Where solves of R rows have ended.

    Attributes
    ----------
    x, y, z : arrays, shape (R, n), (R, n_eq + n_in), (R, n)
        Scaled unknowns, multipliers of the rows (c | d) and of the bounds.
    strict : array of bool, shape (R,)
        Rows that have ended in a strict minimum with a cost; of all others nothing is said.
    iterations, status : arrays of int, shape (R,)
        Of :data:`dmoc.solvers.ipm.STATUSES`; -1 of rows whose turn did not come.
    optimality, violation : arrays, shape (R,)
    """

    x: Array
    y: Array
    z: Array
    strict: NDArray[np.bool_]
    iterations: NDArray[np.intc]
    status: NDArray[np.intc]
    optimality: Array
    violation: Array


def solve_rows(
    nlp: Transcription, numbers: RowNumbers, x: Array, duals: Duals | None, options: Options
) -> RowEnds:
    """Minimise rows of which one has the program ``nlp``, from scaled unknowns x, shape (R, n); of
    neighbouring solutions with multipliers of this leading axis."""
    count, lay, warm = len(x), nlp.layout, duals is not None
    if duals is None:
        duals = Duals.none(nlp.n_eq, nlp.n_in, nlp.n, count)
    programs = RowPrograms.of(nlp, numbers)
    program = Program(nlp.kernels, programs.data, nlp.program)
    point = (
        x.copy(), np.concatenate([duals.y, -duals.w], axis=1), np.maximum(duals.z, 0.0),
        np.maximum(-duals.z, 0.0),
    )  # fmt: skip
    left, strict = np.full((count, 2), inf), np.zeros(count, bool)
    iterations, status = np.zeros(count, np.intc), np.full(count, -1, np.intc)
    looking = curvature.of_program(nlp)
    of_form = stretches(nlp), *looking, len(lay.index_h)
    rows = Rows(
        program, kkt_layout(nlp), programs.elements, programs.rows, point,
        (left, iterations, status, strict.view(np.uint8)), of_form,
        _demands(options, WARM if warm else COLD),
        demands(options) | {"iterations": options.iterations, "warm": warm},
    )  # fmt: skip
    rows.solve(options.deadline.left)
    x, y, z_lower, z_upper = point
    return RowEnds(x, y, z_lower - z_upper, strict, iterations, status, *left.T)


def _demands(options: Options, barrier: float) -> dict[str, float]:
    """The first barrier of a cost, and what a strict minimum is."""
    return {
        "optimality": options.optimality, "violation": options.violation, "least_cost": LEAST_COST,
        "scale_from": SCALE_FROM, "barrier": barrier, "least": LEAST, **curvature.STRICT,
    }  # fmt: skip
