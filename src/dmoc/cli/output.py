"""What the commands that solve and verify print."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from rich.table import Table
from rich.text import Text

from dmoc.cli.writing import (
    err,
    out,
)

MOST_OTHERS = 5  # minima that a summary lists

if TYPE_CHECKING:
    from dmoc.nlp.sensitivity import Sensitivities
    from dmoc.simulation.check import Verification
    from dmoc.solution import Solution
    from dmoc.solvers.outcome import Iteration


class Live:
    """Iterations on standard error while a solve runs; nothing if standard error is no terminal."""

    def __init__(self) -> None:
        self._status = err.status("first guess") if err.is_terminal else None

    def __enter__(self) -> Live:
        if self._status is not None:
            self._status.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._status is not None:
            self._status.stop()

    @property
    def show(self) -> Callable[[Iteration], None] | None:
        if self._status is None:
            return None
        status = self._status

        def update(i: Iteration) -> None:
            status.update(f"iteration {i.number}  cost {i.cost:.6g}  violation {i.violation:.1e}")

        return update


def coloured(good: bool, word: str) -> Text:
    """A word, green where it is good news."""
    return Text(word, style="green" if good else "red")


def print_summary(solution: Solution) -> None:
    """What was found, and how."""
    from dmoc.trajectory import impulses_told, largest_forces, noun_of

    table = Table(show_header=False, box=None)
    message = (
        solution.message.replace(": " + "; ".join(solution.conflicts), "")
        if solution.conflicts
        else solution.message
    )
    table.add_row(
        "status", Text.assemble(coloured(solution.solved, solution.status), f": {message}")
    )
    for conflict in solution.conflicts:
        table.add_row("conflict", conflict)
    table.add_row("cost", f"{solution.cost:.7g}")
    for i, phase in enumerate(solution.phases):
        mode = f", {phase.mode}" if solution.trajectory.lasting else ""
        table.add_row(f"phase {i}", f"{phase.duration:.6g} s in {phase.steps} steps{mode}")
    table.add_row("final time", f"{solution.final_time:.6g} s")
    for c in solution.collisions:
        table.add_row(f"{noun_of([c.word])} {c.word}", f"at {c.time:.6g} s{impulses_told(c)}")
    for force in largest_forces(solution.trajectory):
        table.add_row(
            f"largest {force.kind} of {force.contact}", f"{force.value:.6g} N at {force.time:.6g} s"
        )
    table.add_row("active bounds", ", ".join(solution.active_bounds) or "none")
    for other in solution.others[:MOST_OTHERS]:
        known = "coarse mesh" if other.status is None else str(other.status).replace("_", " ")
        table.add_row("other minimum", f"{other.cost:.7g} ({known}), from {other.found} starts")
    more = len(solution.others) - MOST_OTHERS
    if more > 0:
        table.add_row("", f"and {more} more")
    table.add_row("violation", f"{solution.max_violation:.1e}")
    table.add_row("optimality", f"{solution.optimality:.1e}")
    for mesh in solution.meshes:
        far = "" if mesh.difference is None else f", difference to the finest {mesh.difference:.1e}"
        far += "" if mesh.simulated is None else f", simulated error {mesh.simulated:.1e}"
        table.add_row(
            f"{'+'.join(map(str, mesh.steps))} steps",
            f"cost {mesh.cost:.8g}, estimated error {mesh.estimate:.1e}{far}",
        )
    if solution.error_estimate is not None:
        table.add_row("error estimate", f"{solution.error_estimate:.1e}, relative")
    table.add_row("iterations", str(solution.iterations))
    table.add_row(
        "seconds", ", ".join(f"{name} {value:.2f}" for name, value in solution.seconds.items())
    )
    if solution.verification:
        v = solution.verification
        state = coloured(v["passed"], "passed" if v["passed"] else "failed")
        text = (
            f": terminal error {v['terminal_error']:.1e}, segment error "
            f"{v['max_segment_defect']:.1e}, energy error {v['energy_error']:.1e}, "
        )
        text += f"contacts missed {len(v['missed_contacts'])}, extra {len(v['extra_contacts'])}"
        table.add_row("simulation", Text.assemble(state, text))
    out.print(table)


def print_sensitivities(derivatives: Sensitivities) -> None:
    """Derivatives of the cost by kind and name."""
    table = Table("dJ/d ...", "", "", box=None, header_style="bold")
    for kind, found in derivatives.items():
        named = found.items() if isinstance(found, dict) else [("", found)]
        for name, value in named:
            table.add_row(kind.replace("_", " "), name, f"{value:.6g}")
    out.print(table)


def print_verification(check: Verification) -> None:
    """What the independent simulation says."""
    table = Table(show_header=False, box=None)
    reason = f": {check.message}" if check.message else ""
    table.add_row(
        "simulation",
        Text.assemble(coloured(check.passed, "passed" if check.passed else "failed"), reason),
    )
    table.add_row("terminal error", f"{check.terminal_error:.3e} of the motion's range (open loop)")
    table.add_row(
        "amplification", f"{check.amplification:.3g} times, of an error on the way to the end"
    )
    table.add_row(
        "largest defect",
        f"{check.max_defect:.3e} per step, {check.segment_defects.max(initial=0.0):.3e} per "
        "segment",
    )
    table.add_row("energy error", f"{check.energy_error:.3e}")
    table.add_row("law of impact", f"{check.impact_error:.3e}")
    contacts = ", ".join(f"{c.surface} at {c.time:.6g} s" for c in check.contacts)
    table.add_row("contacts", contacts or "none")
    table.add_row("missed, extra", f"{len(check.missed_contacts)}, {len(check.extra_contacts)}")
    table.add_row("penetration", f"{check.penetration:.1e} between nodes")
    table.add_row("limits", f"exceeded by {check.limit_excess:.1e} between nodes")
    out.print(table)
