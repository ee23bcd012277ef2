"""The independent check of a motion: continuous equations of motion, event detection and impact
law.

Nothing here is shared with the discrete equations of the optimiser (:mod:`dmoc.simulation.flow`).
A motion is compared with the flow in five ways: step by step, segment by segment and phase by
phase, each from its own states; at its collisions, with the law of impact; and from the start to
the end in one open-loop run.  An unstable motion amplifies every error on the way, so that the end
of the open-loop run says nothing about it: it is weighed with the errors of the segments, carried
there by the linearised flow.
Where the motion itself lies on a surface, held there by its inputs, a simulation may enter the
surface by a little.

With lasting contacts or friction the flow is that of the planned modes
(:mod:`dmoc.check.planned_run`), and contact forces and what contacts can bear are compared too
(:mod:`dmoc.check.contact_forces`).

Most motions are free between hits without friction, and pass: compiled code measures these by the
same rules (:mod:`dmoc.check.compiled`), and leaves all others to what is here.
"""

from __future__ import annotations

import numpy as np

from dmoc.base.arguments import positive, shown
from dmoc.base.deadline import Deadline
from dmoc.base.errors import SimulationError
from dmoc.base.signatures import public
from dmoc.check.amplification import carried
from dmoc.check.checked_motion import Motion
from dmoc.check.compiled import passing
from dmoc.check.consistency import plan_errors
from dmoc.check.contact_forces import force_errors
from dmoc.check.events import event_errors
from dmoc.check.findings import Findings, together
from dmoc.check.planned_run import planned_run
from dmoc.check.runs import open_run
from dmoc.check.segments import segments, step_errors
from dmoc.check.verdict import Verification, judged
from dmoc.codegen.kernels import Kernels
from dmoc.motion.trajectory import Trajectory

__all__ = ["Verification", "verify"]


@public(SimulationError)
def verify(trajectory: Trajectory, kernels: Kernels, seconds: float | None = None) -> Verification:
    """Simulate a motion independently and compare.

    A motion passes if every step and every tenth of a phase is right to 1 % of the motion's ranges,
    the end of every phase that is followed from its first node to 3 %, the energy to 2 %, time and
    positions go on at its events, where momenta change by the impulses alone and obey the law of
    impact, it keeps its limits and surfaces at nodes and between them, its cost, integrals and
    peaks are right to 2 % along its own path, the simulation meets the planned collisions and no
    others, and the end of an open-loop run is right to 25 %.  The last does not
    count for an unstable motion, whose amplification explains the end; its segments
    must be right to 0.5 %.

    Raises
    ------
    SimulationError
        If the kernels are not those of the motion's model, or the time of ``seconds`` is used up.

    Parameters
    ----------
    trajectory : Trajectory
        That of a solution.
    kernels : Kernels
        Those of its model.
    seconds : float, optional
        Time limit.

    Returns
    -------
    Verification

    Notes
    -----
    What is compared is equation :eq:`measures` of the theory; the flow with contacts is :eq:`dae`.

    Examples
    --------
    >>> import dmoc
    >>> from dmoc.models.registry import find
    >>> reference = find("puck_table")
    >>> problem = dmoc.Problem(reference.kernels(), **reference.defaults)
    >>> solution = dmoc.solve(problem.but(sequence=["east"]), "ipm", starts=1, verify=False)
    >>> check = dmoc.verify(solution.trajectory, problem.kernels)
    >>> check.passed, check.missed_contacts, check.extra_contacts
    (True, (), ())
    """
    if not isinstance(trajectory, Trajectory):
        raise SimulationError(
            f"trajectory = {shown(trajectory)}: expected that of a solution, solution.trajectory."
        )
    if not isinstance(kernels, Kernels):
        raise SimulationError(
            f"kernels = {shown(kernels)}: expected the kernels of the motion's model."
        )
    if kernels.manifest.fingerprint != trajectory.fingerprint:
        raise SimulationError(
            f"the motion of model {trajectory.model!r} was made with another version or order of "
            f"it than the kernels of {kernels.name!r}: give those it was made with."
        )
    if seconds is not None:
        expected = "expected a positive time limit, or None"
        seconds = positive(seconds, "seconds", expected, SimulationError)
    deadline = Deadline.after(seconds)
    with np.errstate(all="ignore"):
        found = passing(trajectory, kernels, deadline)
        return judged_by_steps(trajectory, kernels, deadline) if found is None else found


def judged_by_steps(trajectory: Trajectory, kernels: Kernels, deadline: Deadline) -> Verification:
    """Measure any motion and judge it."""
    motion = Motion.of(trajectory, kernels, deadline)
    plan, steps, parts = plan_errors(motion), step_errors(motion), segments(motion)
    (forces, sizes), events = force_errors(motion), event_errors(motion, steps.work)
    run = planned_run(motion, parts, sizes) if motion.has_modes else open_run(motion)
    flowed = carried(motion, parts)
    of_segments = {"segment error": float(parts.error.max()), "phase error": flowed.phase_error}
    beside = Findings(of_segments, tuple(run.contradictions))
    found = together(plan, steps.findings, forces, events, beside)
    return judged(motion, found, steps.path, parts, flowed, run)
