"""A fit on one page for somebody else, as HTML that needs no network."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dmoc.base.arguments import place
from dmoc.base.errors import OutputError
from dmoc.base.files import write_whole
from dmoc.base.html import page, paragraph, picture, section
from dmoc.base.table import Table, html_of

if TYPE_CHECKING:
    from dmoc.fitting.result import Fit

DOTS = 150  # of pictures, to the inch
MOST = 20  # unknowns whose correlations are shown


def report(fit: Fit, path: Path) -> Path:
    """Write the report of a fit."""
    if path.suffix.lower() != ".html":
        raise OutputError(f"{place(path)} has no known format: end it in .html.")
    pictures = []
    for style in ("light", "dark"):
        stream = io.BytesIO()
        fit.plot(style=style).savefig(stream, dpi=DOTS, format="png")
        pictures.append(stream.getvalue())
    parts = [section(table.title, html_of(Table(table.rows, table.head))) for table in _tables(fit)]
    told = "".join(map(paragraph, fit.message.split("; "))) if fit.message else ""
    caption = (
        "Measured values (points), the fitted motion (lines), its events (dotted), and residuals "
        "in standard deviations."
    )
    parts.insert(1, section("What to know", told) if told else "")
    parts.insert(2, section("Figure", picture(pictures[0], pictures[1], caption)))
    write_whole(path, page(f"Fit of {fit.model}: {fit.status}", "".join(parts)).encode())
    return path


def _tables(fit: Fit) -> Iterator[Table]:
    summary = fit.summary()
    yield Table(summary.rows, summary.head, title="Values")
    rows = tuple(
        (s.sensor, s.run, str(s.count), f"{s.sigma:.3g}", f"{s.rms:.3g}",
         _share(s.runs_test), _share(s.normality))
        for s in fit.sensors
    )  # fmt: skip
    head = "sensor", "run", "values", "noise", "rms", "runs test", "normality"
    yield Table(rows, head, title="Residuals")
    if fit.influence:
        moves = tuple((run, f"{x:.2g}") for run, x in fit.influence.items())
        yield Table(moves, ("without", "moves by standard errors"), title="Influence of runs")
    yield Table(tuple(_correlations(fit)), title="Correlations")


def _share(p: float) -> str:
    return f"p = {p:.2g}" if np.isfinite(p) else ""


def _correlations(fit: Fit) -> Iterator[tuple[str, ...]]:
    names = [u.name for u in fit.unknowns][:MOST]
    yield ("", *names)
    for name, row in zip(names, fit.correlation, strict=False):
        yield (name, *(f"{x:+.2f}" if np.isfinite(x) else "" for x in row[: len(names)]))
