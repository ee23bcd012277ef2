"""What the check of a motion found, and what counts as confirmed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Any

from dmoc.base.errors import SimulationError
from dmoc.base.records import value_class
from dmoc.base.signatures import public
from dmoc.base.table import Shown, Table, passed
from dmoc.check.amplification import Carried
from dmoc.check.arcs import PENETRATION
from dmoc.check.checked_motion import Motion
from dmoc.check.findings import Findings
from dmoc.check.path_limits import Excess
from dmoc.check.runs import EXPLAINED, Departures, WholeRun, departures, on_the_way, predicted
from dmoc.check.segments import Segments
from dmoc.codegen.kernels import Array
from dmoc.simulation.flow import SurfaceContact

# What a motion may miss and still count as confirmed, relative to the sizes of the motion
# (:mod:`dmoc.simulation.sizes`).  A path constraint that holds at the nodes is exceeded by a share
# of h^2 between them.
PASSING = {
    "step error": 0.01,
    "segment error": 0.01,
    "energy error": 0.02,
    "error of the law of impact": 0.02,
    "error of the law of impact relative to its own rates": 0.05,
    "penetration": PENETRATION,
    "excess of a limit": 0.002,
    "excess of an input": 1e-6,
    "phase error": 0.03,
    "error of a contact force": 0.05,
    "error of a constraint force": 0.02,
    "excess of a path constraint": 0.005,
    "error of an integral": 0.02,
    "error of a peak": 0.02,
    "error of the cost": 0.02,
}
# Those of them that a verification has as they were measured, and its fields.
MEASURED = {
    "step error": "max_defect",
    "segment error": "max_segment_defect",
    "energy error": "energy_error",
    "error of the law of impact": "impact_error",
    "error of a contact force": "force_error",
    "error of a constraint force": "reaction_error",
    "penetration": "penetration",
    "phase error": "phase_error",
    "excess of a path constraint": "path_excess",
    "error of the cost": "cost_error",
}
# Those that are one field together.
COST_ERRORS = ("error of the cost", "error of an integral", "error of a peak")
# What the command line prints.
JSON_FIELDS = """
passed message terminal_error amplification max_defect max_segment_defect energy_error impact_error
missed_contacts extra_contacts penetration limit_excess force_error path_excess phase_error
cost_error reaction_error
""".split()
# The end of the open-loop run: its error as it is, or divided by the motion's amplification, where
# segments are right to the last share.
TERMINAL, WEIGHED, UNSTABLE_SEGMENT = 0.25, 0.01, 0.005


@public(SimulationError)
@value_class(frozen=True)
class Verification(Shown):
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
        Largest abs(E(end) - E(start) - work) of a phase, relative to the largest kinetic energy or
        to what the forces of the position exchange with one coordinate, whichever is larger; or
        jump of the energy at a collision, relative to the largest kinetic energy.
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
        Of the open-loop simulation; of a motion with lasting contact or friction, those that were
        not planned.
    path_excess : float
        Largest excess of a path constraint or a bound, at nodes and between them: the distance to
        where it is kept, as a share of the widths of the motion, or of 50 times the thickness of
        what the motion passes through; of a bound, and where velocities or inputs are in it, the
        share of the absolute values of its terms, where that is larger.  Not a number where it was
        not measured, in older files.
    force_error : float
        Largest error of a contact force or a friction force at a node, relative to the largest of
        its contact.
    phase_error : float
        Largest error at the end of a phase that is followed from its own first node, divided by a
        sixth of its amplification where that is above 6.  Not a number in older files.
    cost_error : float
        Largest error of the cost, of an integral or of a peak of the motion, beside those along its
        continuous path, relative to the integral of the magnitude or to the largest magnitude;
        infinite where an integrand is not a number or has a pole.  Not a number in older files.
    reaction_error : float
        Largest error of the force of a constraint at a node, relative to its largest.  Not a number
        in older files, whose ``force_error`` has it.
    advice : str
        What helps where the mesh is too coarse; empty otherwise.
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
    contacts: tuple[SurfaceContact, ...]
    force_error: float = 0.0
    path_excess: float = 0.0
    phase_error: float = 0.0
    cost_error: float = 0.0
    reaction_error: float = 0.0
    advice: str = ""

    @property
    def told(self) -> str:
        """The message, and what helps."""
        return ", ".join(filter(None, (self.message, self.advice)))

    @property
    def excess(self) -> float:
        """The largest error, divided by what passes.  The end of an open-loop run counts where
        nothing else exceeds its limit."""
        worst: float = max(getattr(self, field) / PASSING[name] for name, field in MEASURED.items())
        return worst if worst > 1 else max(worst, self.terminal_error / TERMINAL)

    def __repr__(self) -> str:
        return (
            f"<Verification: {passed(self.passed)[0]}, segment error {self.max_segment_defect:.2g}>"
        )

    @property
    def max_segment_defect(self) -> float:
        """The largest of ``segment_defects``."""
        return float(self.segment_defects.max(initial=0.0))

    def to_dict(self) -> dict[str, Any]:
        """Return what the command line prints as JSON."""
        values = {name: getattr(self, name) for name in JSON_FIELDS}
        return {k: list(v) if isinstance(v, tuple) else v for k, v in values.items()}

    def summary(self) -> Table:
        """What ``print`` and notebooks show."""
        contacts = ", ".join(f"{c.surface} at {c.time:.6g} s" for c in self.contacts)
        return Table(
            (
                (
                    "simulation",
                    (passed(self.passed), (f": {self.told}" if self.told else "", "")),
                ),
                ("terminal error", f"{self.terminal_error:.3e} of the motion's range (open loop)"),
                (
                    "amplification",
                    f"{self.amplification:.3g} times, of an error on the way to the end",
                ),
                (
                    "largest defect",
                    f"{self.max_defect:.3e} per step, {self.max_segment_defect:.3e} per segment, "
                    f"{self.phase_error:.3e} per phase",
                ),
                ("energy error", f"{self.energy_error:.3e}"),
                ("law of impact", f"{self.impact_error:.3e}"),
                (
                    "force error",
                    f"{self.force_error:.3e} of the largest of its contact, "
                    f"{self.reaction_error:.3e} of its constraint",
                ),
                ("contacts", contacts or "none"),
                ("missed, extra", f"{len(self.missed_contacts)}, {len(self.extra_contacts)}"),
                ("penetration", f"{self.penetration:.1e} between nodes"),
                ("limits", f"exceeded by {self.limit_excess:.1e} between nodes"),
                ("path constraints", f"exceeded by {self.path_excess:.1e} of their sizes"),
                ("cost", f"off by {self.cost_error:.1e} of its size"),
            )
        )


def lost_by(missed: tuple[str, ...], extra: tuple[str, ...], terminal: float) -> list[str]:
    """Sentences on how an open-loop run leaves a motion."""
    lost = [f"the simulation misses {', '.join(missed)}"] * bool(missed)
    lost += [f"the simulation meets {', '.join(extra)}"] * bool(extra)
    if not terminal <= TERMINAL:
        lost.append(f"terminal error {_above(terminal, TERMINAL)} exceeds {TERMINAL:g}")
    return lost


def _above(value: float, limit: float) -> str:
    """A number with as many digits as show that it is above a limit, three at least."""
    texts = (f"{value:.{digits}g}" for digits in range(3, 18))
    return next((text for text in texts if float(text) > limit), f"{value:.3g}")


def too_coarse(failures: list[str], amplified: float) -> str:
    unstable = (
        f" (the motion amplifies errors {amplified:.3g} times)" if amplified * WEIGHED > 1 else ""
    )
    return "; ".join(failures) + f": too coarse{unstable}"


def exceeded(measured: Mapping[str, float], origins: Mapping[str, str] | None = None) -> list[str]:
    """The measures that exceed what passes, with where their errors come from."""
    added = {name: f" ({origin})" for name, origin in (origins or {}).items()}
    return [
        f"{name} {_above(measured[name], PASSING[name])} exceeds {PASSING[name]:g}"
        f"{added.get(name, '')}"
        for name in sorted(measured, key=[*PASSING].index)
        if not measured[name] <= PASSING[name]
    ]


def broken(paths: Sequence[Excess]) -> list[str]:
    """The path constraints that are exceeded too far."""
    limit = PASSING["excess of a path constraint"]
    return [path.text for path in paths if not path.counts <= limit]


def is_unstable(worst: float, amplified: float, terminal: float, predicted: float) -> bool:
    """Whether the errors of the segments, which are right, explain the end of an open-loop run: the
    motion amplifies them, and what the linearised flow predicts of them is near that end or
    leaves the motion altogether."""
    unstable = isfinite(amplified) and amplified * WEIGHED >= min(terminal, 1.0)
    explained = EXPLAINED * predicted >= min(terminal, 1.0)
    return worst <= UNSTABLE_SEGMENT and unstable and explained


def unstable(amplified: float, lost: list[str], worst: float) -> str:
    """Why the end of an open-loop run does not count."""
    return (
        f"the motion is unstable: it amplifies errors {amplified:.3g} times, so that an open-loop "
        f"run leaves it ({'; '.join(lost)}), while every segment is right to {worst:.1g}"
    )


def judged(
    motion: Motion,
    findings: Findings,
    paths: Sequence[Excess],
    parts: Segments,
    flowed: Carried,
    whole: WholeRun,
) -> Verification:
    """Judge a motion by what was found, the excesses of its path constraints, its segments, what
    their errors become, and the run from its start to its end.

    No segment may meet what was not planned, wherever the run passes by.  Where the segments keep
    to the plan, their errors may explain where the run leaves it.
    """
    errors, note, run, terminal = findings.measured, "", whole.departures, whole.terminal
    failures = [*findings.contradictions, *exceeded(errors, findings.origins), *broken(paths)]
    worst, amplified = errors["segment error"], flowed.amplification
    # What is contradicted already needs no other look.
    way = whole.way
    if way is None:
        way = run if failures else departures(motion, on_the_way(motion, parts))
    if not run and terminal <= TERMINAL:
        run = Departures(extra=way.extra)
    lost = lost_by(run.missed_texts, run.extra_texts, terminal)
    if (
        lost
        and not (failures or way)
        and is_unstable(worst, amplified, terminal, flowed.end)
        and predicted(motion, run, parts, flowed.deviations)
    ):
        note, run = unstable(amplified, lost, worst), way
    else:
        failures = lost + failures
    coarse = failures and not findings.contradictions
    message = too_coarse(failures, amplified) if coarse else "; ".join(failures)
    return Verification(
        not failures,
        message or note,
        terminal,
        amplified,
        errors["step error"],
        parts.error,
        errors["energy error"],
        errors["error of the law of impact"],
        run.missed_texts,
        run.extra_texts,
        errors["penetration"],
        max(errors["excess of a limit"], errors["excess of an input"]),
        tuple(whole.contacts),
        errors.get("error of a contact force", 0.0),
        max((path.counts for path in paths), default=0.0),
        errors["phase error"],
        max(errors[name] for name in COST_ERRORS),
        errors["error of a constraint force"],
        "take more steps" if coarse else "",
    )
