"""dmoc.certify: that an exact minimum of the discrete program lies near an answer."""

from __future__ import annotations

import time
from dataclasses import replace

from dmoc.base.arguments import shown
from dmoc.base.errors import ProblemError
from dmoc.base.signatures import public
from dmoc.codegen.kernels import Array
from dmoc.problem.problem import Problem
from dmoc.program.transcription import Transcription
from dmoc.proving.active_set import (
    ELSEWHERE,
    Point,
    doubtful,
    first_set,
    followed,
    independent,
    sharpened,
)
from dmoc.proving.names import listed
from dmoc.proving.proof import Trial, proof
from dmoc.results.certificate import Certificate
from dmoc.results.solution import Solution
from dmoc.solvers.blas import ONE_THREAD
from dmoc.solvers.outcome import Duals
from dmoc.solving.programs import at_solution
from dmoc.solving.request import check_problem
from dmoc.solving.sensitivity import as_solved, check_minimum

# Unknowns and equations: a certificate keeps two matrices of so many rows and columns, a gigabyte.
MOST = 9000


@public(ProblemError)
def certify(problem: Problem, solution: Solution) -> Certificate:
    """Prove that a strict local minimum of the discrete program lies near a solution, with all
    rounding errors counted; see :class:`~dmoc.results.certificate.Certificate`.

    Raises
    ------
    ProblemError
        If the solution belongs to another problem, or is none, or the problem's kernels do not know
        their system.

    Parameters
    ----------
    problem : Problem
        The one that was solved; where the solve has chosen or refined its mesh, that of the
        solution is taken.
    solution : Solution

    Returns
    -------
    Certificate

    Notes
    -----
    Krawczyk's theorem for the optimality conditions, and Sylvester's law of inertia: the page on
    proofs.

    Examples
    --------
    >>> import dmoc
    >>> from dmoc.models.registry import find
    >>> reference = find("puck_table")
    >>> problem = dmoc.Problem(reference.kernels(), **reference.defaults)
    >>> problem = problem.but(sequence=["east"])
    >>> certificate = dmoc.certify(problem, dmoc.solve(problem, "ipm"))
    >>> certificate.proved, certificate.radius < 1e-6, [round(x, 6) for x in certificate.cost]
    (True, True, [2.815249, 2.815249])
    """
    begin = time.perf_counter()
    check_problem(problem)
    if not isinstance(solution, Solution):
        raise ProblemError(f"solution = {shown(solution)}: expected the Solution of the problem.")
    problem = as_solved(problem, solution)
    if not solution.converged:
        sentence = f"the solver did not converge: its status is '{solution.status}'."
        return Certificate((sentence,), seconds=time.perf_counter() - begin)
    check_minimum(problem, solution)
    nlp, duals = at_solution(problem, solution)
    with ONE_THREAD:
        certificate = _certificate(nlp, nlp.scaled(solution.unknowns), duals)
    return replace(certificate, seconds=time.perf_counter() - begin)


def _certificate(nlp: Transcription, x: Array, duals: Duals) -> Certificate:
    """What is proved of scaled unknowns, shape (n,)."""
    size = nlp.n + nlp.n_eq
    if size > MOST:
        return Certificate((f"the program has {size} unknowns and equations, more than {MOST}.",))
    certificate = _near(nlp, x, sharpened(nlp, x, duals))
    if certificate is None or not certificate.proved:
        again = _near(nlp, x, sharpened(nlp, *followed(nlp, x, duals)))
        if again is not None and (certificate is None or again.proved):
            return again
    return certificate or Certificate((_elsewhere(nlp, x, duals),))


def _near(nlp: Transcription, x: Array, point: Point) -> Certificate | None:
    """What is proved at a point; None where that is far from the answer x, shape (n,)."""
    return proof(nlp, x, point) if point.away(x) <= ELSEWHERE else None


def _elsewhere(nlp: Transcription, x: Array, duals: Duals) -> str:
    """Why Newton's method leaves an answer: what the constraints that hold it leave open, or
    constraints that may hold it or not."""
    point = independent(nlp, first_set(nlp, x, duals), x, duals.rows)
    names = doubtful(nlp, x, duals)
    doubt = f" It may be open whether {listed(names)} holds." if names else ""
    return Trial(point).singular or (
        "with the constraints that hold this answer, Newton's method leads to no solution of the "
        f"optimality conditions near it.{doubt}"
    )
