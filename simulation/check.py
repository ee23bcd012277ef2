"""The independent check of a motion: continuous equations of motion, event detection and impact
law.

Nothing here is shared with the discrete equations of the optimiser (:mod:`dmoc.simulation.flow`).
A motion is compared with the flow in four ways: step by step and segment by segment, each from its
own states; at its collisions, with the law of impact; and from the start to the end in one
open-loop run.  An unstable motion amplifies every error on the way, so that the end of the
open-loop run says nothing about it: it is weighed with the amplification of the linearised flow.
Where the motion itself lies on a surface, held there by its inputs, a simulation may enter the
surface by a little.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dmoc.arguments import shown
from dmoc.codegen.kernels import Array, Kernels
from dmoc.errors import SimulationError
from dmoc.simulation.amplification import amplification
from dmoc.simulation.arcs import PENETRATION
from dmoc.simulation.flow import Contact
from dmoc.simulation.measures import (
    energy_error,
    impact_errors,
    input_excess,
    off_surface,
    segments,
    singular,
    step_errors,
)
from dmoc.simulation.motion import Motion
from dmoc.simulation.runs import compare, on_the_way, open_loop
from dmoc.trajectory import Trajectory

# What a motion may miss and still count as confirmed.  Errors of states are relative to the ranges
# of coordinates and momenta, energies to the kinetic energy, penetration and excess of soft limits
# to the ranges, the law of impact to the largest rate of the gap.
PASSING = {
    "segment error": 0.01,
    "energy error": 0.02,
    "penetration": PENETRATION,
    "excess of a limit": 0.002,
    "excess of an input": 1e-6,
    "error of the law of impact": 0.02,
    "error of the law of impact relative to its own rates": 0.05,
}
# The end of the open-loop run: its error as it is, or divided by the motion's amplification, where
# segments are right to the last share.
TERMINAL, WEIGHED, UNSTABLE_SEGMENT = 0.25, 0.01, 0.005


@dataclass(frozen=True)
class Verification:
    """What the check found.  Errors are relative to the range of the coordinate and to the largest
    momentum of the motion.

    Attributes
    ----------
    passed : bool
    message : str
        What contradicts the motion, or, where it passed, why its open-loop end does not count.
    terminal_error : float
        Error of the state at the end of an open-loop simulation with the motion's inputs.
    amplification : float
        Largest ratio by which the linearised flow, through the collisions, carries a small error
        from a segment's start to the end.
    max_defect : float
        Largest error over a single step, started at its first node.
    segment_defects : array
        Error over each of ten segments a phase, started at its first node.
    energy_error : float
        Largest |E(end) - E(start) - work| of a phase, or jump of the energy at a collision,
        relative to the largest kinetic energy.
    impact_error : float
        Largest error of the law of impact: of the rate of the gap after a collision, and of its
        impulse, both relative to the largest rate.
    missed_contacts, extra_contacts : tuples of str
        Planned collisions that the simulation does not meet, and contacts that were not planned and
        change a momentum by more than 1 %.
    penetration : float
        Largest gap g > 0 between nodes, relative to how far the motion's ranges move the gap.
    limit_excess : float
        Largest excess of an input or a coordinate over its bounds, between nodes too, relative to
        its range.
    contacts : tuple of Contact
        Of the open-loop simulation.
    """

    passed: bool
    message: str
    terminal_error: float
    amplification: float
    max_defect: float
    segment_defects: Array
    energy_error: float
    impact_error: float
    missed_contacts: tuple[str, ...]
    extra_contacts: tuple[str, ...]
    penetration: float
    limit_excess: float
    contacts: tuple[Contact, ...]


def verify(trajectory: Trajectory, kernels: Kernels, seconds: float | None = None) -> Verification:
    """Simulate a motion independently and compare.

    A motion passes if every tenth of a phase is right to 1 % of the motion's ranges, the energy to
    2 %, its collisions obey the law of impact, it keeps its limits and surfaces between nodes, the
    simulation meets the planned collisions and no others, and the end of an open-loop run is right
    to 25 %.  The last does not count for an unstable motion, whose amplification explains the end;
    its segments must be right to 0.5 %.

    Raises
    ------
    SimulationError
        If the kernels are not those of the motion's model, or the time of ``seconds`` is used up.
    """
    if not isinstance(trajectory, Trajectory):
        raise SimulationError(
            f"trajectory = {shown(trajectory)}: expected that of a solution, solution.trajectory."
        )
    if not isinstance(kernels, Kernels):
        raise SimulationError(
            f"kernels = {shown(kernels)}: expected the kernels of the motion's model."
        )
    if kernels.manifest["fingerprint"] != trajectory.fingerprint:
        raise SimulationError(
            f"the motion of model {trajectory.model!r} was made with another version or order of "
            f"it than the kernels of {kernels.name!r}: give those it was made with."
        )
    with np.errstate(all="ignore"):
        return _judged(Motion.of(trajectory, kernels, seconds))


def _judged(motion: Motion) -> Verification:
    """Measure a motion and judge it."""
    steps, parts = step_errors(motion), segments(motion)
    energy, (law, own) = energy_error(motion, steps.work), impact_errors(motion)
    amplified = amplification(motion, parts)
    terminal, contacts = open_loop(motion)
    missed, extra = compare(motion, contacts)
    defects, inputs = np.array([part.error for part in parts]), input_excess(motion)
    worst = float(defects.max(initial=0.0))
    measured = {
        "segment error": worst, "energy error": energy, "error of the law of impact": law,
        "error of the law of impact relative to its own rates": own,
        "penetration": steps.penetration, "excess of a limit": steps.excess,
        "excess of an input": inputs,
    }  # fmt: skip
    failures, note = _failures(motion, measured), ""
    # From the motion's own nodes no segment may meet what was not planned, wherever an open-loop
    # run passes by.
    missed_on_way, extra_on_way = (
        (missed, extra) if failures else compare(motion, on_the_way(motion))
    )
    if not (failures or missed or extra) and extra_on_way:
        failures, extra = _lost((), extra_on_way, 0.0), extra_on_way
    elif missed or extra or not terminal <= TERMINAL:
        lost = _lost(missed, extra, terminal)
        followed = not failures and worst <= UNSTABLE_SEGMENT
        explained = np.isfinite(amplified) and amplified * WEIGHED >= min(terminal, 1.0)
        if followed and not (missed_on_way or extra_on_way) and explained:
            note = (
                f"the motion is unstable: it amplifies errors {amplified:.3g} times, so that "
                "an open-loop run leaves it "
                f"({'; '.join(lost)}), while every segment is right to {worst:.1g}"
            )
            missed, extra = missed_on_way, extra_on_way
        else:
            failures = lost + failures
    return Verification(
        not failures,
        _too_coarse(failures, amplified) if failures else note,
        terminal,
        amplified,
        float(steps.defects.max(initial=0.0)),
        defects,
        energy,
        law,
        missed,
        extra,
        steps.penetration,
        max(steps.excess, inputs),
        tuple(contacts),
    )


def _failures(motion: Motion, measured: dict[str, float]) -> list[str]:
    """What contradicts a motion before its open-loop run is looked at."""
    failures = [
        f"the collision with {surface!r} is {gap:.3g} off it"
        for surface, gap in off_surface(motion)
    ]
    where = singular(motion)
    if where is not None:
        failures.append(
            f"the mass matrix is singular or negative on the way, first at {where:.4g} s"
        )
    return failures + [
        f"{name} {value:.3g} exceeds {PASSING[name]:g}"
        for name, value in measured.items()
        if not value <= PASSING[name]
    ]


def _lost(missed: tuple[str, ...], extra: tuple[str, ...], terminal: float) -> list[str]:
    """How an open-loop run leaves a motion."""
    lost = [f"the simulation misses {', '.join(missed)}"] * bool(missed)
    lost += [f"the simulation meets {', '.join(extra)}"] * bool(extra)
    return lost + [f"terminal error {terminal:.3g} exceeds {TERMINAL:g}"] * (
        not terminal <= TERMINAL
    )


def _too_coarse(failures: list[str], amplified: float) -> str:
    unstable = (
        f" (the motion amplifies errors {amplified:.3g} times)" if amplified * WEIGHED > 1 else ""
    )
    return "; ".join(failures) + f": too coarse{unstable}, take more steps"
