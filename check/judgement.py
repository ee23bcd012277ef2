"""How a motion is judged by what was measured of it: one with lasting contacts like one in
flight."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dmoc.check.amplification import Carried
from dmoc.check.checked_motion import Motion
from dmoc.check.measures import input_excess
from dmoc.check.path_limits import Excess
from dmoc.check.runs import Departures, predicted
from dmoc.check.segments import Segment, StepErrors
from dmoc.check.verdict import (
    TERMINAL,
    Verification,
    broken,
    exceeded,
    is_unstable,
    largest_excess,
    lost_by,
    too_coarse,
    unstable,
)
from dmoc.simulation.flow import SurfaceContact


def measured(
    motion: Motion, steps: StepErrors, parts: Sequence[Segment], flowed: Carried,
    events: tuple[float, float, float],
) -> dict[str, float]:  # fmt: skip
    """The errors of a motion by the names of what passes; those of its events are of the energy, of
    the law of impact, and of that relative to its own rates."""
    energy, law, own = events
    return {
        "step error": steps.worst,
        "segment error": max(part.error for part in parts),
        "energy error": energy,
        "error of the law of impact": law,
        "error of the law of impact relative to its own rates": own,
        "penetration": steps.penetration,
        "excess of a limit": steps.excess,
        "excess of an input": input_excess(motion),
        "phase error": flowed.phase_error,
    }


@dataclass(frozen=True)
class Evidence:
    """What was measured of a motion: what contradicts it, in sentences; errors by the names of what
    passes, and excesses of path constraints; its segments and what their errors become; the error
    at the end of an open-loop run, and the contacts that are reported."""

    told: Sequence[str]
    measured: dict[str, float]
    paths: tuple[Excess, ...]
    parts: Sequence[Segment]
    flowed: Carried
    terminal: float
    contacts: Sequence[SurfaceContact]

    @cached_property
    def failures(self) -> list[str]:
        """What contradicts the motion wherever an open-loop run goes."""
        return [*self.told, *exceeded(self.measured), *broken(self.paths)]


def judged(motion: Motion, found: Evidence, run: Departures, way: Departures) -> Verification:
    """Judge a motion by the contacts of an open-loop run, and by those of segments that begin at
    the motion's own states.

    No segment may meet what was not planned, wherever the run passes by.  Where the segments keep
    to the plan, their errors may explain where the run leaves it.
    """
    errors, failures, note = found.measured, found.failures, ""
    worst, amplified = errors["segment error"], found.flowed.amplification
    if not run and found.terminal <= TERMINAL:
        run = Departures(extra=way.extra)
    lost = lost_by(run.missed_texts, run.extra_texts, found.terminal)
    if (
        lost
        and not (failures or way)
        and is_unstable(worst, amplified, found.terminal, found.flowed.end)
        and predicted(motion, run, found.parts, found.flowed.deviations)
    ):
        note, run = unstable(amplified, lost, worst), way
    else:
        failures = lost + failures
    coarse = failures and not found.told
    message = too_coarse(failures, amplified) if coarse else "; ".join(failures)
    return Verification(
        not failures,
        message or note,
        found.terminal,
        amplified,
        errors["step error"],
        np.array([part.error for part in found.parts]),
        errors["energy error"],
        errors["error of the law of impact"],
        run.missed_texts,
        run.extra_texts,
        errors["penetration"],
        max(errors["excess of a limit"], errors["excess of an input"]),
        tuple(found.contacts),
        errors.get("error of a contact force", 0.0),
        largest_excess(found.paths),
        errors["phase error"],
    )
