"""What the suites share: problems, guesses, timing, tables."""

from __future__ import annotations

import platform
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

import dmoc
from dmoc.nlp.guess import initial_guesses
from dmoc.nlp.scaling import scale_of
from dmoc.nlp.transcription import Transcription
from dmoc.registry import find
from dmoc.solvers.kkt import residuals
from dmoc.solvers.outcome import Options, Outcome
from dmoc.solving.methods import METHODS


@dataclass
class Section:
    """One table of the report."""

    title: str
    text: str
    header: Sequence[str]
    rows: list[Sequence[Any]] = field(default_factory=list)
    after: str = ""

    def markdown(self) -> str:
        lines = [f"## {self.title}", "", self.text, "", "| " + " | ".join(self.header) + " |", "|" + "---|" * len(self.header)]
        lines += ["| " + " | ".join(str(c) for c in row) + " |" for row in self.rows]
        return "\n".join(lines + (["", self.after] if self.after else [])) + "\n"


def seed(**changes: Any) -> dmoc.Problem:
    """The seed's problem: cart-pendulum, one collision on the left limiter."""
    return dmoc.Problem(dmoc.load("cart_pendulum"), **{**find("cart_pendulum").defaults, **changes})


def program(problem: dmoc.Problem, x: np.ndarray, method: str = "ipm", minimum: bool = False) -> Transcription:
    """The program of a problem, scaled by a start x or by a minimum, as dmoc.solve makes it."""
    nlp = Transcription(problem, scale_of(problem, x, minimum), None if METHODS[method].guided else False)
    _ = nlp.program
    return nlp


def guess(problem: dmoc.Problem) -> np.ndarray:
    return np.asarray(initial_guesses(problem)[0].x)


def timed(run: Callable[[], Any], repeats: int) -> tuple[float, Any]:
    """Median seconds of several runs, after one that does not count, and the last result."""
    result = run() if repeats > 1 else None
    seconds = []
    for _ in range(repeats):
        begin = time.perf_counter()
        result = run()
        seconds.append(time.perf_counter() - begin)
    return median(seconds), result


def cost(nlp: Transcription, outcome: Outcome) -> float:
    return nlp.cost(outcome.x) * nlp.scale.cost


def solve(nlp: Transcription, x: np.ndarray, method: str, options: Options, *more: Any) -> tuple[float, Outcome]:
    """Seconds and outcome of a solve from unknowns x in units of the problem; the outcome is in scaled ones."""
    with threadpool_limits(1):  # as dmoc.solve does
        begin = time.perf_counter()
        outcome = METHODS[method].minimise()(nlp, nlp.scaled(x), options, *more)
        return time.perf_counter() - begin, outcome


def violation(nlp: Transcription, outcome: Outcome) -> float:
    return residuals(nlp, outcome.x, outcome.duals).violation


def ms(seconds: float) -> str:
    value = 1e3 * seconds
    return f"{value:.2f}" if value < 10 else f"{value:.1f}" if value < 100 else f"{value:,.0f}"


def casadi_start(nlp: Transcription, x: np.ndarray) -> tuple[np.ndarray, ...]:
    """Durations, coordinates, inputs and impulses of a guess."""
    lay = nlp.layout
    return x[lay.index_h] * np.array(lay.steps), x[lay.index_q], x[lay.index_u], x[lay.index_lam]


def machine() -> str:
    lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines() if Path("/proc/cpuinfo").exists() else []
    cpu = next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), platform.machine())
    packages = ("dmoc", "numpy", "scipy", "casadi", "ipyopt", "unopy", "opty")
    versions = []
    for name in packages:
        try:
            versions.append(f"{name} {metadata.version(name)}")
        except metadata.PackageNotFoundError:
            versions.append(f"{name} not installed")
    return f"{cpu}; Python {platform.python_version()}; " + ", ".join(versions)
