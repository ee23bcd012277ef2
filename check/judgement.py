"""How a motion is judged by what was measured of it: one with lasting contacts like one in
flight."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dmoc.check.amplification import Carried
from dmoc.check.checked_motion import Motion
from dmoc.check.events import EventErrors
from dmoc.check.measures import input_excess
from dmoc.check.path_limits import Excess
from dmoc.check.runs import Departures, Run, departures, on_the_way, predicted
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

FORCE = "error of a contact force"


def measured(
    motion: Motion, steps: StepErrors, parts: Sequence[Segment], flowed: Carried,
    events: EventErrors,
) -> dict[str, float]:  # fmt: skip
    """The errors of a motion, but for forces, by the names of what passes."""
    return {
        "step error": steps.worst,
        "segment error": max(part.error for part in parts),
        "energy error": events.energy,
        "error of the law of impact": events.law,
        "error of the law of impact relative to its own rates": events.own,
        "penetration": steps.penetration,
        "excess of a limit": steps.excess,
        "excess of an input": input_excess(motion),
        "phase error": flowed.phase_error,
    }


@dataclass(frozen=True)
class Evidence:
    """What was measured of a motion: what contradicts it, in sentences; errors by the names of what
    passes, and excesses of path constraints; its segments and what their errors become; and the
    run from its start to its end."""

    contradictions: Sequence[str]
    measured: dict[str, float]
    paths: tuple[Excess, ...]
    parts: Sequence[Segment]
    flowed: Carried
    run: Run

    @cached_property
    def failures(self) -> list[str]:
        """What contradicts the motion wherever an open-loop run goes."""
        return [*self.contradictions, *exceeded(self.measured), *broken(self.paths)]


def judged(motion: Motion, evidence: Evidence) -> Verification:
    """Judge a motion.

    No segment may meet what was not planned, wherever the run passes by.  Where the segments keep
    to the plan, their errors may explain where the run leaves it.
    """
    errors, failures, note = evidence.measured, evidence.failures, ""
    flowed, terminal, run = evidence.flowed, evidence.run.terminal, evidence.run.departures
    worst, amplified = errors["segment error"], flowed.amplification
    # What is contradicted already needs no other look.
    way = evidence.run.way
    if way is None:
        way = run if failures else departures(motion, on_the_way(motion))
    if not run and terminal <= TERMINAL:
        run = Departures(extra=way.extra)
    lost = lost_by(run.missed_texts, run.extra_texts, terminal)
    if (
        lost
        and not (failures or way)
        and is_unstable(worst, amplified, terminal, flowed.end)
        and predicted(motion, run, evidence.parts, flowed.deviations)
    ):
        note, run = unstable(amplified, lost, worst), way
    else:
        failures = lost + failures
    coarse = failures and not evidence.contradictions
    message = too_coarse(failures, amplified) if coarse else "; ".join(failures)
    return Verification(
        not failures,
        message or note,
        terminal,
        amplified,
        errors["step error"],
        np.array([part.error for part in evidence.parts]),
        errors["energy error"],
        errors["error of the law of impact"],
        run.missed_texts,
        run.extra_texts,
        errors["penetration"],
        max(errors["excess of a limit"], errors["excess of an input"]),
        tuple(evidence.run.contacts),
        errors.get(FORCE, 0.0),
        largest_excess(evidence.paths),
        errors["phase error"],
    )
