"""Swing up the pendulum of Kern & Gross (2018) through one collision, and the same from hanging at rest.

Run:  python examples/swing_up.py [FOLDER]
Writes a solution file and a figure of each problem into FOLDER (default: demo) and prints a table.
"""

import sys
from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

import dmoc
from dmoc.registry import find


def main(folder: Path) -> int:
    """Solve, check and draw both problems; return the exit status."""
    folder.mkdir(parents=True, exist_ok=True)
    console = Console()
    table = Table("", "cart_pendulum", "cart_pendulum_hanging", box=None, header_style="bold")
    columns, files = [], []
    for name in ("cart_pendulum", "cart_pendulum_hanging"):
        reference = find(name)
        problem = dmoc.Problem(reference.kernels(), **reference.defaults)
        with console.status(f"solving {name}") as status:
            solution = dmoc.solve(
                problem,
                progress=lambda i, s=status, n=name: s.update(
                    f"{n}: iteration {i.number}, cost {i.cost:.6g}, violation {i.violation:.1e}"
                ),
                reference=name,
            )
        files.append(solution.save(folder / f"{name}.npz"))
        solution.plot(folder / f"{name}.png")
        files.append(folder / f"{name}.png")
        columns.append(solution)
    rows = {
        "status": [s.status for s in columns],
        "cost [N2 s]": [f"{s.cost:.6f}" for s in columns],
        "durations [s]": [", ".join(f"{p.duration:.6f}" for p in s.phases) for s in columns],
        "impulse [kg m2/s]": [f"{s.collisions[0].impulse:.6f}" for s in columns],
        "active bounds": [", ".join(s.active_bounds) for s in columns],
        "violation": [f"{s.max_violation:.1e}" for s in columns],
        "solve time [s]": [f"{s.seconds['solve']:.2f}" for s in columns],
        "simulation": ["passed" if s.solved else s.message for s in columns],
        "  terminal error": [f"{s.verification['terminal_error']:.1e}" if s.verification else "" for s in columns],
        "  segment error": [f"{s.verification['max_segment_defect']:.1e}" if s.verification else "" for s in columns],
        "  energy error": [f"{s.verification['energy_error']:.1e}" if s.verification else "" for s in columns],
    }
    for label, cells in rows.items():
        table.add_row(Text(label), *cells)
    console.print(table, highlight=False)
    console.print("Errors are relative to the range of the motion.", style="dim")
    for path in files:
        console.print(f"written: {path}", highlight=False)
    return 0 if all(s.solved for s in columns) else 1


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1] if len(sys.argv) > 1 else "demo")))
