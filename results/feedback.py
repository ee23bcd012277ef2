"""Feedback along a solution, and what a simulation takes from both."""

from __future__ import annotations

from dmoc.base.arguments import shown
from dmoc.base.errors import SimulationError
from dmoc.base.signatures import public
from dmoc.codegen.kernels import Kernels
from dmoc.control.feedback import Feedback, Weight, feedback_along
from dmoc.results.solution import Solution
from dmoc.results.solution_model import linearised


@public(SimulationError)
def feedback(
    solution: Solution,
    *,
    Q: Weight | None = None,
    R: Weight | None = None,
    model: Kernels | None = None,
) -> Feedback:
    """Gains that hold a motion: time-varying linear-quadratic feedback through its events.

    Along each phase, deviations dy of y = (q | v) obey the linearised equations of its mode, and at
    each event its saltation matrix (:eq:`saltation`). The gains K = R^-1 B^T P minimise

        int (dy^T Q dy + du^T R du) dt + dy(T)^T P(T) dy(T)

    with the final time T and P(T) = T Q; those of a periodic motion repeat, the cost of all
    periods (:eq:`riccati`). Each phase is extended past both of its events, with the inputs there
    and the gains of its ends, so that an event that comes early or late does not make the
    reference jump: which phase holds is decided by the contacts, not by the time.

    Parameters
    ----------
    solution : Solution
        One that converged, of a model with inputs.
    Q, R : float, mapping by name, or arrays of shape (2 nq, 2 nq), (nu, nu), optional
        By default diagonal, 1 / s^2 of states and inputs of the size s: the ranges of coordinates,
        the largest velocities and inputs of the motion.  A number is a factor of that; a mapping
        gives the diagonal in units of the model, with 0 for states that it leaves out.
    model : Kernels, optional
        For a solution from a file whose model is not shipped.

    Returns
    -------
    Feedback
        For :func:`dmoc.simulate`, and as tables.

    Raises
    ------
    SimulationError
        If a weight does not fit, the model has no inputs, the solver did not converge, an event
        grazes, or the gains of a periodic motion do not converge.

    Examples
    --------
    >>> import dmoc
    >>> from dmoc.models.registry import find
    >>> reference = find("puck_table")
    >>> problem = dmoc.Problem(reference.kernels(), **reference.defaults)
    >>> solution = dmoc.solve(problem.but(sequence=["east"]), "ipm", starts=1)
    >>> hold = dmoc.feedback(solution, Q={"x": 100, "y": 100, "x_dot": 1, "y_dot": 1}, R=1)
    >>> hold.at(0, 0.1)[2].shape
    (2, 4)
    """
    if not isinstance(solution, Solution):
        raise SimulationError(
            f"solution = {shown(solution)}: expected a Solution, from dmoc.solve(problem)."
        )
    motion = linearised(solution, model, "a feedback")
    return feedback_along(motion, solution.periodic, Q, R)
