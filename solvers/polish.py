"""Newton's method on the optimality conditions with a known active set: the last digits of a
solution and of its multipliers.

A driver that compares costs cannot place unknowns better than the square root of the rounding error
of the cost.  From such a point one or two Newton steps on the full sparse system reach rounding
error, and give exact multipliers of every constraint.
"""

from __future__ import annotations

import warnings

import numpy as np
import scipy.sparse
import scipy.sparse.linalg

from dmoc.codegen.kernels import Array
from dmoc.program.blocks import Index
from dmoc.program.transcription import Transcription
from dmoc.solvers.kkt import ACTIVE, residuals, with_bounds
from dmoc.solvers.outcome import Residuals

STEPS = 6


def polish(
    nlp: Transcription, x: Array, y: Array, w: Array, rows: Index, bounds: Index
) -> tuple[Array, Array, Array, Residuals]:
    """Improve a solution while its residuals fall; return it with its multipliers and residuals.

    ``rows`` are the inequalities that hold with equality, ``bounds`` the unknowns at a bound.
    Solves, for the steps of x, y and of the active part of w, with H the Hessian of
    L = f + y . c - w . d, A = dc/dx, G = dd/dx of the active rows::

        [ H   A'  -G' ] [dx]     [ grad L ]
        [ A   0    0  ] [dy] = - [ c      ]
        [ G   0    0  ] [dw]     [ d      ]
    """
    best = (x, y, w, residuals(nlp, x, with_bounds(nlp, x, y, w)))
    fixed = np.isin(np.arange(nlp.n), bounds) | (nlp.lower == nlp.upper)
    free = np.flatnonzero(~fixed)
    rows = _independent(nlp, x, rows)
    idle = np.ones(nlp.n_in, dtype=bool)
    idle[rows] = False
    y, w = y.copy(), np.where(idle, 0.0, w)
    x = _onto_bounds(nlp, x, bounds)
    for _ in range(STEPS):
        step = _newton_step(nlp, x, y, w, rows, free)
        if step is None:
            break
        x = x.copy()
        x[free] += step[: len(free)]
        y = y + step[len(free) : len(free) + nlp.n_eq]
        w = w.copy()
        w[rows] += step[len(free) + nlp.n_eq :]
        if (
            not np.isfinite(x).all()
            or (w[rows] < -ACTIVE * max(1.0, np.abs(w).max(initial=0.0))).any()
        ):
            break
        now = residuals(nlp, x, with_bounds(nlp, x, y, np.maximum(w, 0.0)))
        if max(now.optimality, now.violation) >= max(best[3].optimality, best[3].violation):
            break
        best = (x, y, np.maximum(w, 0.0), now)
    return best


def _onto_bounds(nlp: Transcription, x: Array, bounds: Index) -> Array:
    x = x.copy()
    lower = x[bounds] - nlp.lower[bounds] <= nlp.upper[bounds] - x[bounds]
    x[bounds] = np.where(lower, nlp.lower[bounds], nlp.upper[bounds])
    return x


def _independent(nlp: Transcription, x: Array, rows: Index) -> Index:
    """Leave out active rows without a slope in the free unknowns: a gap at a fixed start, say."""
    slope = abs(nlp.inequality_jacobian(x)[rows][:, np.flatnonzero(nlp.lower != nlp.upper)]).sum(
        axis=1
    )
    return rows[np.asarray(slope).ravel() > 0]


def _newton_step(
    nlp: Transcription, x: Array, y: Array, w: Array, rows: Index, free: Index
) -> Array | None:
    A, G = nlp.equality_jacobian(x), nlp.inequality_jacobian(x)[rows]
    upper = nlp.lagrangian_hessian(x, y, w)
    H = (upper + scipy.sparse.triu(upper, 1).T).tocsr()
    slope = nlp.lagrangian_gradient(x, y, w)
    A, G, H = A[:, free], G[:, free], H[free][:, free]
    system = scipy.sparse.bmat([[H, A.T, -G.T], [A, None, None], [G, None, None]], format="coo")
    right = -np.concatenate([slope[free], nlp.equality(x), nlp.inequality(x)[rows]])
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            return np.asarray(scipy.sparse.linalg.splu(_with_diagonal(system)).solve(right))
    except (RuntimeError, Warning):
        return None


def _with_diagonal(matrix: scipy.sparse.coo_matrix) -> scipy.sparse.csc_matrix:
    """The same matrix with its whole diagonal stored, zeros as well: SuperLU can end the process
    where the pattern alone makes a matrix singular, and with this pattern only numbers can."""
    n = matrix.shape[0]
    diagonal = np.arange(n)
    entries = np.concatenate([matrix.data, np.zeros(n)])
    places = np.concatenate([matrix.row, diagonal]), np.concatenate([matrix.col, diagonal])
    return scipy.sparse.coo_matrix((entries, places), shape=matrix.shape).tocsc()
