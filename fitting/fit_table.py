"""The table of a fit."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from dmoc.base.table import Cell, Table, toned
from dmoc.fitting.statistics import UNLIKELY

if TYPE_CHECKING:
    from dmoc.fitting.result import Estimated, Fit, SensorFit

MOST_RUNS = 12  # whose words and sensors a table has


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
