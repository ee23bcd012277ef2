"""The table that stands for a solution."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import isfinite
from typing import TYPE_CHECKING

from dmoc.base.names import unit_constraint
from dmoc.base.table import Cell, Table, passed
from dmoc.motion.largest_forces import largest_forces
from dmoc.motion.trajectory import impulses_in_words, noun_of
from dmoc.results.notes import Topic, message_of
from dmoc.solvers.outcome import UNREFINED

if TYPE_CHECKING:
    from dmoc.results.solution import Solution

MOST_OTHERS = 5  # minima that are listed


def table_of_solution(solution: Solution) -> Table:
    """Table of a solution: its outcome, motion, other minima and evidence."""
    rows = (
        *_outcome(solution),
        *_motion(solution),
        *_minima(solution),
        *_evidence(solution),
    )
    return Table(rows, title=f"{solution.trajectory.model}: {solution.status}")


def _outcome(s: Solution) -> Iterator[tuple[Cell, ...]]:
    message = message_of(s.cause, s.notes, (Topic.CONFLICT, Topic.PROPOSAL))
    yield "status", ((str(s.status), "good" if s.solved else "bad"), (f": {message}", ""))
    if s.proposal is not None:
        yield "proposal", str(s.proposal)
    for conflict in s.conflicts:
        yield "conflict", conflict
    yield "cost", f"{s.cost:.7g}"


def _motion(s: Solution) -> Iterator[tuple[Cell, ...]]:
    for i, phase in enumerate(s.phases):
        mode = f", {phase.mode}" if s.trajectory.lasting else ""
        took = f"{phase.duration:.6g} s in {phase.steps} steps"
        yield f"phase {i}", (took if phase.steps else "the state after the last event") + mode
    yield "final time", f"{s.final_time:.6g} s"
    if s.design:
        yield "design", in_words(s.design)
    for c in s.collisions:
        yield (
            f"{noun_of([c.word], [c.switch])} {c.word}",
            f"at {c.time:.6g} s{impulses_in_words(c)}",
        )
    attitudes = () if s.kernels is None else s.kernels.manifest.attitudes
    for force in largest_forces(s.trajectory):
        if force.contact in map(unit_constraint, attitudes):
            continue
        unit = "" if force.kind == "R" else " N"  # that of R follows from its constraint
        yield (
            f"largest {force.kind} of {force.contact}",
            f"{force.value:.6g}{unit} at {force.time:.6g} s",
        )
    for name, value in s.trajectory.totals.items():
        yield name, f"{value:.7g}"
    yield "active bounds", ", ".join(s.active_bounds) or "none"


def in_words(values: Mapping[str, float]) -> str:
    """Values by name."""
    return ", ".join(f"{name} = {value:.6g}" for name, value in values.items())


def _minima(s: Solution) -> Iterator[tuple[Cell, ...]]:
    for other in s.others[:MOST_OTHERS]:
        seen = "coarse mesh" if other.status == UNREFINED else other.status.replace("_", " ")
        # Costs of two meshes differ by the error of the mesh, to either side.
        if other.status != UNREFINED and other.steps != s.steps:
            seen += f" in {'+'.join(map(str, other.steps))} steps"
        starts = "1 start" if other.agreeing_starts == 1 else f"{other.agreeing_starts} starts"
        yield "other minimum", f"{other.cost:.7g} ({seen}), from {starts}"
    more = len(s.others) - MOST_OTHERS
    if more > 0:
        yield "", f"and {more} more"


def _evidence(s: Solution) -> Iterator[tuple[Cell, ...]]:
    yield "violation", f"{s.max_violation:.1e}"
    yield "optimality", f"{s.optimality:.1e}"
    for mesh in s.meshes:
        # The first mesh has none before it, and no estimate.
        far = f", estimated error {mesh.estimate:.1e}" if isfinite(mesh.estimate) else ""
        if mesh.difference is not None:
            far += f", difference to the finest {mesh.difference:.1e}"
        far += "" if mesh.simulated is None else f", simulated error {mesh.simulated:.1e}"
        yield (
            f"{'+'.join(map(str, mesh.steps))} steps",
            f"cost {mesh.cost:.8g}{far}",
        )
    if s.error_estimate is not None:
        yield "error estimate", f"{s.error_estimate:.1e}, relative"
    yield "iterations", str(s.iterations)
    yield "seconds", ", ".join(f"{name} {value:.2f}" for name, value in s.seconds.items())
    if s.verification:
        v = s.verification
        text = (
            f": terminal error {v.terminal_error:.1e}, segment error "
            f"{v.max_segment_defect:.1e}, energy error {v.energy_error:.1e}, "
        )
        if s.trajectory.lasting:
            text += f"force error {v.force_error:.1e}, "
        text += f"contacts missed {len(v.missed_contacts)}, extra {len(v.extra_contacts)}"
        yield "simulation", (passed(v.passed), (text, ""))
    if s.certificate:
        yield s.certificate.row
