"""What every example prints and writes: found against known values; a solution file and a figure
in the folder given on the command line (default: figures)."""

import sys
from pathlib import Path

from rich.console import Console
from rich.table import Table

import dmoc


def show(name: str, rows: list[tuple[str, float, float | None]], solution: dmoc.Solution) -> None:
    """Print a table of (what, found, known), save and draw the motion, and exit with 1 if it is
    not solved and confirmed by the simulation."""
    console = Console()
    table = Table(name, "found", "known", "difference", box=None, header_style="bold")
    for what, value, reference in rows:
        difference = "" if reference is None else f"{value - reference:+.1e}"
        table.add_row(
            what, f"{value:.9g}", "" if reference is None else f"{reference:.9g}", difference
        )
    console.print(table, highlight=False)
    check = solution.verification
    errors = (
        f"terminal error {check.terminal_error:.1e}, energy error {check.energy_error:.1e}"
        if check
        else "none"
    )
    console.print(
        f"{solution.status}: {solution.message}; {solution.iterations} iterations; simulation: "
        f"{errors}",
        highlight=False,
    )
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "figures")
    folder.mkdir(parents=True, exist_ok=True)
    solution.save(folder / f"{name}.npz")
    solution.plot(folder / f"{name}.png")
    console.print(f"written: {folder / name}.npz, {folder / name}.png", highlight=False)
    if not solution.solved:
        sys.exit(1)
