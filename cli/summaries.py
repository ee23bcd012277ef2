"""What the commands that solve print beside the tables of results."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.table import Table

from dmoc.cli.console import (
    out,
)

if TYPE_CHECKING:
    from dmoc.program.cost_derivatives import Sensitivities


def print_sensitivities(derivatives: Sensitivities) -> None:
    """Derivatives of the cost by kind and name."""
    table = Table("dJ/d ...", "", "", box=None, header_style="bold")
    for kind, slopes in derivatives.items():
        named = slopes.items() if isinstance(slopes, dict) else [("", slopes)]
        for name, value in named:
            table.add_row(kind.replace("_", " "), name, f"{value:.6g}")
    out.print(table)
