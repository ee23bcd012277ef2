"""What the file of a fit holds, field by field."""

from __future__ import annotations

from dmoc.fitting.result import CONVERGED, MISFIT, Estimated, Fit, SensorFit
from dmoc.results.result_file import ResultFile
from dmoc.results.schema import (
    Choice,
    Flag,
    Listed,
    Mapped,
    Name,
    Number,
    Record,
    Stored,
    Text,
    Whole,
)

FORMAT = 1

ESTIMATED = Record(
    Estimated,
    {
        "name": Text(),
        "value": Number(),
        "error": Number(special=True),
        "low": Number(special=True),
        "high": Number(special=True),
        "at_bound": Flag(),
    },
)
SENSOR = Record(
    SensorFit,
    {
        "run": Text(),
        "sensor": Text(),
        "count": Whole(),
        "sigma": Number(),
        "rms": Number(),
        "runs_test": Number(special=True),
        "normality": Number(special=True),
    },
)


def _wrong(fit: Fit) -> str | None:
    """A sentence about fields of a fit that do not fit together."""
    if sum(s.count for s in fit.sensors) != len(fit.t):
        return "its sensors have another number of values than its table"
    if {s.run for s in fit.sensors} - set(fit.words) or set(fit.words) != set(fit.event_times):
        return "its runs have different names"
    return None


# One line for each field; n values and p unknowns.
FIT = Record(
    Fit,
    {
        "status": Choice((CONVERGED, MISFIT)),
        "message": Text(),
        "model": Name(),
        "unknowns": Listed(ESTIMATED, "p"),
        "covariance": Stored("p", "p", special=True),
        "undetermined": Listed(Text()),
        "words": Mapped(Listed(Text())),
        "event_times": Mapped(Listed(Number())),
        "sensors": Listed(SENSOR),
        "influence": Mapped(Number(special=True)),
        "t": Stored("n"),
        "measured": Stored("n"),
        "predicted": Stored("n"),
        "residual": Stored("n"),
        "degrees_of_freedom": Whole(),
    },
    _wrong,
)


FILE = ResultFile(
    "fit",
    FIT,
    "fit_format",
    FORMAT,
    "file of a fit",
    "fit the runs again",
    "Fit.save",
    foreign={
        "solution": "the file of a solution: read it with dmoc.Solution.load, or give one that "
        "Fit.save has written"
    },
)
