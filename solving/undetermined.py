"""Durations and positions that a minimum does not determine: others of them cost the same."""

from __future__ import annotations

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.nlp.problem import Problem
from dmoc.nlp.readout import given_multipliers, stated_in_rates
from dmoc.nlp.scaling import scale_of
from dmoc.nlp.tables import Index
from dmoc.nlp.transcription import Transcription
from dmoc.solution import Solution
from dmoc.solvers.kkt import cost_size
from dmoc.solvers.outcome import Duals
from dmoc.solving.program import Programs

# What is not determined: changed by a tenth of the final time, or of the range of a coordinate, it
# changes the cost by less than a millionth, half of the square times this.
FLAT = 2e-4
# Diagonal of the linear system: a curvature of all unknowns, relative to the cost, and what keeps
# equations harmless that follow from others.
CURVED, RELAXED = 1e-10, 1e-11


def undetermined(problem: Problem, fine: Solution, coarse: Solution | None = None) -> str:
    """A sentence on what the problem leaves open of a minimum, among the durations and, where there
    is a coarser mesh, the position that has changed most since; empty if it determines all that."""
    if any(c.grazes for c in fine.collisions):  # they are part of another program
        return ""
    nlp, duals = _program(problem, fine)
    names = [f"the duration of phase {i}" for i in range(len(fine.phases))]
    at, reach = nlp.layout.index_h, fine.final_time / np.array(fine.steps)
    if coarse is not None:
        node, j = _most_changed(coarse, fine)
        places = nlp.layout.index_q[:, j]
        names.append(f"{fine.trajectory.coordinates[j]} on the way")
        at, reach = np.append(at, places[node]), np.append(reach, np.ptp(fine.unknowns[places]))
    x, units = nlp.scaled(fine.unknowns), nlp.physical(np.ones(nlp.n))[at]
    curvature = curvatures(nlp, x, duals, at) * (reach / units) ** 2 / cost_size(nlp, x)
    left_open = [name for name, c in zip(names, curvature, strict=True) if 0 <= c < FLAT]
    if not left_open:
        return ""
    return f"the problem does not determine {' and '.join(left_open)}: others cost the same"


def _program(problem: Problem, s: Solution) -> tuple[Transcription, Duals]:
    """The program of a solution, with its multipliers."""
    by_rates = stated_in_rates(problem, s.multipliers)
    scale = scale_of(problem, s.unknowns, minimum=True)
    nlp = Programs(problem, scale, by_rates).program()
    return nlp, Duals(*given_multipliers(nlp, s.multipliers))


def curvatures(nlp: Transcription, x: Array, duals: Duals, at: Index) -> Array:
    """Second derivatives of the least cost with respect to some of the scaled unknowns, each alone,
    while all others follow: 1/(K^-1)_ii with the matrix K of a Newton step at the minimum, in which
    bounds and inequalities count that hold it; infinite for unknowns that are fixed or held."""
    import scipy.sparse as sparse  # here, because the compiled method does without SciPy
    from scipy.sparse.linalg import splu

    size = cost_size(nlp, x)
    distance = np.minimum(x - nlp.lower, nlp.upper - x)
    free = (nlp.lower < nlp.upper) & ~(np.abs(duals.z) / size > distance)
    held = duals.w / size > nlp.inequality(x)
    upper = nlp.lagrangian_hessian(x, duals.y, duals.w)
    H = (upper + sparse.triu(upper, 1).T)[free][:, free]
    A = sparse.vstack([nlp.equality_jacobian(x), nlp.inequality_jacobian(x)[held]])[:, free]
    curved = CURVED * size * sparse.identity(H.shape[0])
    K = sparse.bmat([[H + curved, A.T], [A, -RELAXED * sparse.identity(A.shape[0])]]).tocsc()
    factors, place = splu(K), np.cumsum(free) - 1
    second = np.full(len(at), np.inf)
    for k, i in enumerate(at):
        if free[i]:
            right = np.zeros(K.shape[0])
            right[place[i]] = 1.0
            second[k] = 1 / factors.solve(right)[place[i]]
    return second


def _most_changed(coarse: Solution, fine: Solution) -> tuple[int, int]:
    """Node and coordinate whose position has changed most since a coarser mesh."""
    spread = np.ptp(np.vstack([p.q for p in fine.phases]), axis=0)
    spread = np.where(spread > 0, spread, np.inf)
    best, at, first = -1.0, (0, 0), 0
    for a, b in zip(coarse.phases, fine.phases, strict=True):
        ratio = b.steps // a.steps
        change = np.abs(b.q[::ratio] - a.q) / spread
        k, j = np.unravel_index(int(change.argmax()), change.shape)
        if change[k, j] > best:
            best, at = float(change[k, j]), (first + ratio * int(k), int(j))
        first += b.steps
    return at
