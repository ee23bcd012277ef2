"""The table of a fit, and a fit on one page for somebody else, as HTML that needs no network."""

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
from dmoc.base.table import Cell, Table, html_of, toned
from dmoc.fitting.statistics import UNLIKELY

if TYPE_CHECKING:
    from dmoc.fitting.result import Estimated, Fit, SensorFit

DOTS = 150  # of pictures, to the inch
MOST = 20  # unknowns whose correlations are shown
MOST_RUNS = 12  # whose words and sensors a table has


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


def table_of_fit(fit: Fit) -> Table:
    """What ``print`` and notebooks show."""
    head = "", "value", "standard error", "95 %"
    notes = tuple(sentence for sentence in (fit.message,) if sentence)
    return Table(tuple(_rows(fit)), head, notes, f"fit of {fit.model}")


def _rows(fit: Fit) -> Iterator[tuple[Cell, ...]]:
    tone = "good" if fit.status == "converged" else "bad"
    yield "status", toned(fit.status, tone), "", ""
    for u in fit.unknowns:
        yield (u.name, f"{u.value:.6g}", *_known(u))
    for run, words in list(fit.words.items())[:MOST_RUNS]:
        times = ", ".join(f"{t:.4g} s" for t in fit.event_times[run])
        if words:
            yield f"events of {run}", ", ".join(words), times, ""
    for s in fit.sensors[:MOST_RUNS]:
        yield f"{s.sensor} in {s.run}", f"{s.count} values", f"noise {s.sigma:.3g}", _left(s)
    if len(fit.sensors) > MOST_RUNS:
        yield "", f"and {len(fit.sensors) - MOST_RUNS} more sensors", "", ""
    moving = {run: x for run, x in fit.influence.items() if x > 1}
    for run, x in moving.items():
        yield f"without {run}", f"{x:.2g} standard errors away", "", ""


def _known(u: Estimated) -> tuple[str, str]:
    if not np.isfinite(u.error):
        return "not determined", ""
    return f"{u.error:.2g}", f"{u.low:.6g} to {u.high:.6g}"


def _left(s: SensorFit) -> str:
    """What is left of a sensor, in words."""
    told = [f"rms {s.rms:.3g}"]
    told += ["correlated"] * (s.runs_test < UNLIKELY)
    told += ["not normal"] * (s.normality < UNLIKELY)
    return ", ".join(told)
