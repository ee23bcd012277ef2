"""Derivatives of the optimal cost at a solution."""

from __future__ import annotations

from dmoc.base.arguments import shown
from dmoc.base.errors import ProblemError
from dmoc.base.signatures import public
from dmoc.problem.attitudes import by_coordinates
from dmoc.problem.problem import Problem
from dmoc.program import cost_derivatives
from dmoc.program.cost_derivatives import Sensitivities
from dmoc.program.layout import Layout
from dmoc.results.solution import Solution
from dmoc.results.solution_model import check_same_model
from dmoc.solvers.kkt import residuals
from dmoc.solving.programs import at_solution
from dmoc.solving.request import check_problem

# Residuals above this are those of another problem.
OTHER_PROBLEM = 1e-4


@public(ProblemError)
def sensitivities(problem: Problem, solution: Solution) -> Sensitivities:
    """Derivatives of the optimal cost with respect to parameters, coefficients of restitution,
    positions of surfaces, final time, boundary values and bounds, from the multipliers of a
    solution; see :class:`~dmoc.program.cost_derivatives.Sensitivities`.

    Raises
    ------
    ProblemError
        If the solution belongs to another problem, or is none.

    Parameters
    ----------
    problem : Problem
        The one that was solved; where the solve has chosen or refined its mesh, that of the
        solution is taken.
    solution : Solution

    Returns
    -------
    Sensitivities

    Notes
    -----
    Equation :eq:`sensitivity` of the theory.

    Examples
    --------
    >>> import dmoc
    >>> from dmoc.models.registry import find
    >>> reference = find("puck_table")
    >>> problem = dmoc.Problem(reference.kernels(), **reference.defaults)
    >>> problem = problem.but(sequence=["east"])
    >>> change = dmoc.sensitivities(problem, dmoc.solve(problem, "ipm"))
    >>> round(change["final_time"], 2)
    -2.53
    >>> sorted(change["parameters"])
    ['a', 'b', 'm']
    """
    check_problem(problem)
    if not isinstance(solution, Solution):
        raise ProblemError(f"solution = {shown(solution)}: expected the Solution of the problem.")
    problem = as_solved(problem, solution)
    if not solution.converged:
        raise ProblemError(
            f"the solution has the status '{solution.status}': sensitivities need a minimum."
        )
    check_minimum(problem, solution)
    return cost_derivatives.sensitivities(problem, solution.unknowns, solution.multipliers)


def check_minimum(problem: Problem, solution: Solution) -> None:
    """Refuse a solution that is no minimum of a problem as it has it."""
    nlp, duals = at_solution(problem, solution)
    left = residuals(nlp, nlp.scaled(solution.unknowns), duals)
    if left.violation > OTHER_PROBLEM or left.optimality > OTHER_PROBLEM:
        raise ProblemError(
            f"the solution is no minimum of this problem (violation {left.violation:.1e}, "
            f"optimality {left.optimality:.1e}): give the problem that was solved."
        )


def as_solved(problem: Problem, solution: Solution) -> Problem:
    """The problem on the mesh of its solution, with the courses of its hits; a solution of another
    problem is refused."""
    steps = solution.steps
    sequence = tuple(c.word for c in solution.collisions)
    if problem.open_hits and len(sequence) == len(problem.sequence):
        problem = problem.but(sequence=sequence)  # the solution tells how its hits go
    if (problem.steps is None or solution.meshes) and len(steps) == problem.phases:
        problem = problem.meshed(steps)
    size = Layout.of(problem).size
    if (steps, sequence, len(solution.unknowns)) != (problem.phase_steps, problem.words, size):
        raise ProblemError(
            f"the solution has the sequence {list(sequence)} with {list(steps)} steps and "
            f"{len(solution.unknowns)} unknowns, the problem {list(problem.words)} with "
            f"{list(problem.phase_steps)} and {size}: give the problem that was solved."
        )
    check_same_model(solution, problem.kernels)
    return by_coordinates(problem, solution.phases[-1].q[-1])
