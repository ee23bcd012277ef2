"""The solution of a problem: motion, status, cost, multipliers, timings; saved as one .npz file
without pickle."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dmoc.base.arguments import path as path_of
from dmoc.base.errors import ModelError, ProblemError
from dmoc.base.records import value_class
from dmoc.base.signatures import public
from dmoc.base.table import Shown, Table
from dmoc.codegen.kernels import Kernels
from dmoc.motion.trajectory import Array, Collision, Phase, Trajectory
from dmoc.program.active_constraints import ActiveBound
from dmoc.results.certificate import Certificate, checked
from dmoc.results.motion_result import MotionResult
from dmoc.results.notes import Note, Topic, message_of
from dmoc.results.proposal import Proposal
from dmoc.results.result_file import Saved
from dmoc.results.solution_data import data_of_solution
from dmoc.results.solution_table import table_of_solution
from dmoc.solvers.outcome import CONVERGED, MINIMA, Status

if TYPE_CHECKING:
    from dmoc.check.check import Verification
    from dmoc.control.stability import Stability


@value_class(frozen=True)
class Mesh:
    """One mesh of a refinement.

    Attributes
    ----------
    steps : tuple of int
        Steps of each phase.
    cost : float
    iterations : int
        Up to here.
    estimate : float
        Estimated error: the largest relative change of cost, durations and positions against the
        mesh before, extrapolated; infinite for the first mesh.
    simulated : float or None
        Largest relative error over a tenth of a phase, by the independent simulation; None where it
        was not asked for.
    difference : float or None
        Difference to the finest mesh, measured like the change; None for the finest.  An honest
        estimate is of its size.
    """

    steps: tuple[int, ...]
    cost: float
    iterations: int
    estimate: float
    simulated: float | None
    difference: float | None = None


@value_class(frozen=True)
class Minimum:
    """A local minimum that was found beside the answer.

    Attributes
    ----------
    cost : float
    agreeing_starts : int
        How many starts have led to it.
    status : Status, or "coarse"
        Of its solution on the mesh of ``steps``, "solved" where the check confirmed it; "coarse"
        where it is known from the coarse mesh only: there was a cheaper one, or no time, or it led
        to none on a finer mesh.
    steps : tuple of int
        Steps of each phase.
    """

    cost: float
    agreeing_starts: int
    status: str
    steps: tuple[int, ...]


@public(ProblemError)
@value_class(frozen=True)
class Solution(Shown, MotionResult, Saved):
    """Result of :func:`dmoc.solve`.

    Attributes
    ----------
    status : Status
        "solved", "grazes" (solved, but a collision has no effect), "not_verified", "stationary",
        "infeasible", "iteration_limit", "time_limit", "stalled" or "interrupted": a text and a
        :class:`~dmoc.solvers.outcome.Status`.
    cause : str
        What happened.
    method : str
    trajectory : Trajectory
        Phases (t, q, p, v, u) and collisions (surface, time, impulse, momenta before and after).
    multipliers : mapping of str to array
        By kind of constraint, in L = J + y . c - w . d - z . x; those of the unknowns' bounds, z,
        as "bounds".
    active_bounds : tuple of ActiveBound
        Bounds and inequalities that hold with equality and carry a multiplier: texts that know what
        they say, see :class:`~dmoc.program.active_constraints.ActiveBound`.
    max_violation : float
        Largest violation of any constraint or bound, relative to its size.
    optimality : float
        Residual of the optimality conditions, relative to the cost.
    iterations : int
    seconds : mapping of str to float
        Times of build, guess, solve and verification.
    unknowns : array
        The vector of unknowns, from which another solve can start.
    notes : tuple of Note
        What else is said, and what helps: topics with their sentences.
    conflicts : tuple of str
        Where no feasible point was found: what is missed and by how much, and what stands against
        it.
    verification : Verification or None
        Result of the independent check.
    reference : str
        How the model was named: a shipped model or ``file.py:name``.
    error_estimate : float or None
        Where a tolerance was given: the larger of the estimated relative error of the mesh and of
        the simulated error.
    meshes : tuple of Mesh
        The meshes of the refinement.
    duality_gap : float
        Sum of the products of the inequalities and bounds that hold the motion with their
        multipliers: what the cost may still lose to the solver's tolerance.
    starts : int
        How many starts were tried on a coarse mesh; 0 where the solve began from a guess alone.
    agreeing_starts : int
        How many of them have led to this minimum.
    first_start : str
        The first of these: "automatic 1" of those that the statement and its equations of motion
        give, "random 7", "neighbour 12" of those beside minima that were met before, or "given".
    unseen_share : float or None
        Estimated share of further starts, of those that lead to a minimum, that lead to one not met
        so far: (f + 1) / (n + 2) where n starts have led to minima, f of them to one each that no
        other has met (Good, "The population frequencies of species and the estimation of population
        parameters", 1953).  None where no start has led to one, or none was tried.
    others : tuple of Minimum
        The other minima that they have led to, the cheapest first.
    proposal : Proposal or None
        A sequence that may cost less, where contacts stay at the edges of their modes: at rest
        where they should slide, at the limit of their friction, or closed without a force.
    design : mapping of str to float
        Parameters of the model that were chosen, which those of the trajectory hold, too.
    periodic : mapping of str to mapping of str to float
        What ``periodic`` of the problem says: states at the end by the factors of states at the
        start.
    scale : mapping of str to float
        Sizes of the time, the cost, states, inputs and gaps that the solver worked with, read off
        the start.
    certificate : Certificate or None
        What :func:`dmoc.certify` proves of it, where :meth:`with_certificate` has put it.

    Examples
    --------
    >>> import dmoc
    >>> from dmoc.models.registry import find
    >>> reference = find("puck_table")
    >>> problem = dmoc.Problem(reference.kernels(), **reference.defaults)
    >>> solution = dmoc.solve(problem.but(sequence=["east"]), "ipm", starts=1)
    >>> solution.status, round(solution.cost, 3), solution.collisions[0].word
    (<Status.SOLVED: 'solved'>, 2.815, 'east')
    >>> solution.phases[0].q.shape, solution.phases[1].u.shape
    ((41, 2), (40, 2))
    >>> solution.verification.passed
    True
    >>> path = solution.save("puck.npz")
    >>> dmoc.Solution.load(path).cost == solution.cost
    True
    """

    file_module = "dmoc.results.solution_file"

    status: Status
    cause: str
    method: str
    trajectory: Trajectory
    multipliers: Mapping[str, Array]
    active_bounds: tuple[ActiveBound, ...]
    max_violation: float
    optimality: float
    iterations: int
    seconds: Mapping[str, float]
    unknowns: Array
    notes: tuple[Note, ...] = ()
    conflicts: tuple[str, ...] = ()
    verification: Verification | None = None
    reference: str = ""
    error_estimate: float | None = None
    meshes: tuple[Mesh, ...] = ()
    duality_gap: float = 0.0
    scale: Mapping[str, float] = field(default_factory=dict)
    starts: int = 0
    agreeing_starts: int = 0
    first_start: str = ""
    unseen_share: float | None = None
    others: tuple[Minimum, ...] = ()
    proposal: Proposal | None = None
    design: Mapping[str, float] = field(default_factory=dict)
    periodic: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    certificate: Certificate | None = None
    kernels: Kernels | None = field(default=None, repr=False, compare=False)

    def __repr__(self) -> str:
        head = f"{self.status}, cost {self.cost:.7g}, final time {self.final_time:.6g} s"
        events = "".join(f"; {collision}" for collision in self.collisions)
        return f"<Solution of {self.trajectory.model}: {head}{events}>"

    def summary(self) -> Table:
        """What ``print`` and notebooks show."""
        return table_of_solution(self)

    @property
    def message(self) -> str:
        """What happened, and what helps: the cause with the notes."""
        return message_of(self.cause, self.notes)

    @property
    def solved(self) -> bool:
        """Whether the solver converged and the check confirmed it."""
        return self.status == Status.SOLVED

    @property
    def minimum(self) -> bool:
        """Whether a local minimum was found, in which a collision may have no effect, and the
        check confirmed it."""
        return self.status in MINIMA

    @property
    def converged(self) -> bool:
        """Whether the solver came to a local minimum, whatever the check made of it."""
        return self.status in CONVERGED

    @property
    def cost(self) -> float:
        """J, the sum of the discrete costs C_d, with what the end and the objective add."""
        return self.trajectory.cost

    @property
    def phases(self) -> tuple[Phase, ...]:
        return self.trajectory.phases

    @property
    def steps(self) -> tuple[int, ...]:
        """Steps of each phase."""
        return tuple(p.steps for p in self.phases)

    @property
    def collisions(self) -> tuple[Collision, ...]:
        return self.trajectory.collisions

    def verify(self, kernels: Kernels | None = None, seconds: float | None = None) -> Verification:
        """Check the motion by an independent simulation, within a time limit if one is given; see
        :func:`dmoc.verify`.

        Raises
        ------
        ModelError
            If the solution comes from a file, names a model that is not shipped, and no kernels are
            given.
        SolutionFileError
            If the solution names other states, parameters or surfaces than its model.
        """
        from dmoc.check.check import verify
        from dmoc.results.solution_model import check_names, kernels_for

        kernels = kernels_for(self, kernels, ModelError)
        check_names(self.trajectory, kernels)
        return verify(self.trajectory, kernels, seconds)

    def stability(self, kernels: Kernels | None = None) -> Stability:
        """What the motion makes of small deviations with its inputs as they are: of a periodic
        motion the Floquet multipliers, of every motion how much deviations grow in each phase and
        through each event, with their directions, by the linearised flow and saltation matrices
        (:eq:`saltation`); see :class:`~dmoc.control.stability.Stability`.

        Raises
        ------
        ModelError
            If the solution comes from a file, names a model that is not shipped, and no kernels are
            given.
        SimulationError
            If the solver did not converge, or an event grazes.

        Examples
        --------
        A ball that is dropped from a metre and keeps half of its speed, from its release until
        after the bounce:

        >>> import dmoc, sympy as sp
        >>> from sympy.physics.mechanics import dynamicsymbols
        >>> y = dynamicsymbols("y")
        >>> ball = dmoc.MechanicalSystem(
        ...     "ball", [y], y.diff() ** 2 / 2 - 9.81 * y, surfaces={"floor": y >= 0}, cost=1
        ... )
        >>> drop = dmoc.Problem(
        ...     ball, start={"y": 1.0}, sequence=["floor"], durations=[None, 0], restitution=0.5
        ... )
        >>> dmoc.solve(drop).stability().transition.round(4)
        array([[-0.5   , -0.2258],
               [ 3.3221,  1.    ]])
        """
        from dmoc.control.stability import stability
        from dmoc.results.solution_model import linearised

        return stability(linearised(self, kernels, "its stability"), self.periodic)

    def with_certificate(self, certificate: Certificate) -> Solution:
        """The same with what :func:`dmoc.certify` proves of it, which ``print``, report, JSON and
        file show then.

        Raises
        ------
        ProblemError
            If it is no certificate, or one of a motion of another cost.
        """
        certificate = checked(certificate, self.cost, self.scale)
        return replace(self, certificate=certificate)

    def report(self, path: str | os.PathLike[str]) -> Path:
        """Write problem, result, minima, check and figure on one page for somebody else: .html,
        which needs no network and is light or dark, or .pdf.

        Raises
        ------
        OutputError
            If the ending is another one, or the file cannot be written.
        MissingExtraError
            If Matplotlib is not installed.
        """
        from dmoc.results.solution_report import report

        target = path_of(path)
        report(self, target)
        return target

    def to_dict(self) -> dict[str, Any]:
        """Return the summary that the command line prints as JSON."""
        return data_of_solution(self)


def saying(solution: Solution, more: str, topic: Topic = Topic.OTHER) -> Solution:
    """The solution with one note more."""
    return replace(solution, notes=(*solution.notes, Note(topic, more)))


def ending(solution: Solution, status: Status, cause: str) -> Solution:
    """The solution with another end, of which nothing else is said."""
    return replace(solution, status=status, cause=cause, notes=())


def broken_off(solution: Solution) -> Solution:
    """The solution, where Ctrl-C has come before it was complete."""
    status = Status.INTERRUPTED
    return ending(solution, status, status.sentence)
