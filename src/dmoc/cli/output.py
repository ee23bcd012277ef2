"""What the commands that solve print beside the tables of results."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from rich.table import Table
from rich.text import Text

from dmoc.cli.writing import (
    err,
    out,
)

if TYPE_CHECKING:
    from dmoc.nlp.sensitivity import Sensitivities
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


def print_sensitivities(derivatives: Sensitivities) -> None:
    """Derivatives of the cost by kind and name."""
    table = Table("dJ/d ...", "", "", box=None, header_style="bold")
    for kind, found in derivatives.items():
        named = found.items() if isinstance(found, dict) else [("", found)]
        for name, value in named:
            table.add_row(kind.replace("_", " "), name, f"{value:.6g}")
    out.print(table)
