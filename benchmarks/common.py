"""What the sections share: tables, timing, and the one door to what dmoc does not export."""

from __future__ import annotations

import multiprocessing
import os
import platform
import re
import sys
import textwrap
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from importlib import metadata
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

import dmoc
from dmoc.base.deadline import Deadline
from dmoc.check.check import verify
from dmoc.codegen.text import c_files
from dmoc.guess.automatic import initial_guesses
from dmoc.guess.transfer import pieces_of, unknowns_along
from dmoc.mechanics.contact_mode import FREE as FREE
from dmoc.mechanics.contact_mode import Mode as Mode
from dmoc.models.registry import find
from dmoc.problem.ranges import Boundary as Boundary
from dmoc.program.extraction import multiplier_vectors, named_multipliers, trajectory
from dmoc.program.minimal_times import WithMinimalTimes
from dmoc.program.scaling import scale_of
from dmoc.program.structure_cache import MEMORY as MEMORY
from dmoc.program.transcription import Transcription
from dmoc.simulation.contact_motion import node as node
from dmoc.simulation.contact_motion import through_step as through_step
from dmoc.simulation.mode_choice import Setting as Setting
from dmoc.simulation.motion_record import ContactState as ContactState
from dmoc.simulation.motion_record import MotionRecord as MotionRecord
from dmoc.simulation.tolerances import Magnitudes as Magnitudes
from dmoc.simulation.tolerances import magnitudes_at as magnitudes_at
from dmoc.solvers import ipm
from dmoc.solvers.kkt import residuals
from dmoc.solvers.kkt_layout import kkt_layout as kkt_layout
from dmoc.solvers.outcome import Duals, Options, Outcome, Status
from dmoc.solving.methods import DEFAULT as DEFAULT
from dmoc.solving.methods import METHODS
from dmoc.symbolic.families import model_spec

# Some problems are those of the tests and of the examples, folders of scripts.
sys.path += [str(Path(__file__).resolve().parent.parent / name) for name in ("tests", "examples")]
# Of processes that are measured: modules are compiled when they are installed.
AS_INSTALLED = {n: v for n, v in os.environ.items() if n != "PYTHONDONTWRITEBYTECODE"}
COLUMNS = 100  # of a line of a page
ITERATIONS = 1000  # of a solve, at most
SAME_COST = 1e-6  # relative difference of two costs that are of one minimum


# The report ---------------------------------------------------------------------------------------


@dataclass
class Section:
    """One topic of the report: a table with what is true of any numbers in it."""

    title: str
    text: str
    header: Sequence[str]
    rows: list[Sequence[Any]] = field(default_factory=list)
    after: str = ""

    def row(self, *cells: Any) -> None:
        self.rows.append(cells)

    def markdown(self) -> str:
        lines = [f"## {self.title}", "", filled(self.text), "", table(self.header, self.rows)]
        return "\n".join(lines + (["", filled(self.after)] if self.after else [])) + "\n"


def filled(text: str) -> str:
    """Paragraphs and lists in lines that an editor shows whole."""
    fill = partial(textwrap.fill, width=COLUMNS, break_long_words=False, break_on_hyphens=False)
    items = re.split(r"\n+(?=- )|\n\n", text)
    ends = re.findall(r"\n+(?=- )|\n\n", text)
    lines = (fill(i, subsequent_indent="  " if i.startswith("- ") else "") for i in items)
    return "".join(part + end for part, end in zip(lines, [*ends, ""], strict=True))


def table(header: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """A table in Markdown, or several below each other where it is too wide: each begins with the
    columns that tell its rows apart."""
    keys = next(k for k in range(1, len(header) + 1) if _apart(rows, k) or k == len(header))
    tables = [[*range(keys)]]
    for group in _groups(header, keys):
        wider = [*tables[-1], *group]
        if len(tables[-1]) > keys and _width(header, rows, wider) > COLUMNS:
            wider = [*range(keys), *group]
            tables.append(wider)
        tables[-1] = wider
    return "\n\n".join(_table(header, rows, columns) for columns in tables)


def _apart(rows: Sequence[Sequence[Any]], columns: int) -> bool:
    return len({tuple(map(str, row[:columns])) for row in rows}) == len(rows)


def _groups(header: Sequence[str], keys: int) -> list[list[int]]:
    """Columns that stay together: those after one whose title says with a colon whose they are,
    or each alone."""
    named, groups = any(": " in title for title in header), list[list[int]]()
    for column in range(keys, len(header)):
        if groups and named and ": " not in header[column]:
            groups[-1].append(column)
        else:
            groups.append([column])
    return groups


def _width(header: Sequence[str], rows: Sequence[Sequence[Any]], columns: list[int]) -> int:
    return max(map(len, _table(header, rows, columns).splitlines()))


def _table(header: Sequence[str], rows: Sequence[Sequence[Any]], columns: list[int]) -> str:
    lines = ["| " + " | ".join(str(row[c]) for c in columns) + " |" for row in (header, *rows)]
    return "\n".join([lines[0], "|" + "---|" * len(columns), *lines[1:]])


def ms(seconds: float) -> str:
    """Milliseconds, or a dash where nothing succeeded."""
    value = 1e3 * seconds
    if np.isnan(value):
        return "-"
    return f"{value:.2f}" if value < 10 else f"{value:.1f}" if value < 100 else f"{value:,.0f}"


def ratio(seconds: float, reference: float) -> str:
    """How many times the reference a time is, to two digits."""
    quotient = seconds / reference
    if np.isnan(quotient):
        return "-"
    return f"{quotient:.0f} x" if quotient >= 10 else f"{quotient:.2g} x"


def machine() -> str:
    info = Path("/proc/cpuinfo")
    lines = info.read_text(encoding="utf-8").splitlines() if info.exists() else []
    named = (line.split(":")[1].strip() for line in lines if line.startswith("model name"))
    cpu = next(named, platform.machine())
    packages = ("dmoc", "numpy", "scipy", "casadi", "ipyopt", "unopy", "opty", "nosnoc")
    versions = []
    for name in packages:
        try:
            versions.append(f"{name} {metadata.version(name)}")
        except metadata.PackageNotFoundError:
            versions.append(f"{name} not installed")
    python = f"Python {platform.python_version()}"
    return f"{cpu}, {os.cpu_count()} cores; {python}; {', '.join(versions)}"


# Timing -------------------------------------------------------------------------------------------


def clocked(run: Callable[[], Any]) -> tuple[float, Any]:
    """Seconds of one run, and its result."""
    begin = time.perf_counter()
    result = run()
    return time.perf_counter() - begin, result


def timed(run: Callable[[], Any], repeats: int) -> tuple[float, Any]:
    """Median seconds of several runs, after one that does not count, and the last result."""
    run()
    runs = [clocked(run) for _ in range(repeats)]
    return median(seconds for seconds, _ in runs), runs[-1][1]


@dataclass(frozen=True)
class Solves:
    """The same solve several times: median seconds and number of those that succeeded."""

    seconds: float
    solved: int
    runs: int
    outcome: Outcome

    @property
    def share(self) -> str:
        return f"{self.solved}/{self.runs}"


def solves(nlp: Transcription, x: np.ndarray, method: str, repeats: int, *more: Any) -> Solves:
    options = Options(iterations=ITERATIONS, deadline=Deadline.after(600.0))
    runs = [solve(nlp, x, method, options, *more) for _ in range(repeats)]
    good = [seconds for seconds, outcome in runs if outcome.status is Status.SOLVED]
    return Solves(median(good) if good else np.nan, len(good), repeats, runs[-1][1])


def on_cores(run: Callable[[str], Any], names: Sequence[str], processes: int) -> Iterator[Any]:
    """What a function says of each name, as it comes, in several processes with a core each, whose
    CPU seconds are those of one thread."""
    cores: Any = multiprocessing.SimpleQueue()
    for core in sorted(os.sched_getaffinity(0))[:processes]:
        cores.put(core)
    with multiprocessing.Pool(processes, _on_core, (cores,)) as pool:
        yield from pool.imap_unordered(run, names)


def _on_core(cores: Any) -> None:
    if not cores.empty():  # where there are fewer cores, the others have all of them
        os.sched_setaffinity(0, {cores.get()})


# Below the public names of dmoc: programs, drivers and motions by hand ----------------------------


def seed(**changes: Any) -> dmoc.Problem:
    """The reference problem: cart-pendulum, one collision on the limiter of the smallest angle."""
    return dmoc.Problem(dmoc.load("cart_pendulum"), **{**find("cart_pendulum").defaults, **changes})


def program(
    problem: dmoc.Problem,
    x: np.ndarray,
    method: str = "ipm",
    minimum: bool = False,
) -> Transcription:
    """The program of a problem, scaled by a start x or by a minimum, as dmoc.solve makes it."""
    make = WithMinimalTimes if METHODS[method].guided else Transcription
    nlp = make(problem, scale_of(problem, x, minimum))
    _ = nlp.program
    return nlp


def analysed(problem: dmoc.Problem, x: np.ndarray, method: str = "ipm") -> Transcription:
    """The program of a problem with its patterns and, for the compiled method, the order and the
    symbolic factorisation of its linear system, where nothing is kept from others."""
    MEMORY.clear()
    nlp = program(problem, x, method)
    if method == "ipm":
        kkt_layout(nlp)
    return nlp


def guess(problem: dmoc.Problem) -> np.ndarray:
    return np.asarray(initial_guesses(problem)[0].x)


def solve(
    nlp: Transcription,
    x: np.ndarray,
    method: str,
    options: Options,
    *more: Any,
) -> tuple[float, Outcome]:
    """Seconds and outcome of a solve; x is in units of the problem, the outcome in scaled ones."""
    with threadpool_limits(1):  # as dmoc.solve does
        return clocked(
            lambda: METHODS[method].minimise()(nlp, nlp.scaled(x), options, *(more or (None,)))
        )


def cost(nlp: Transcription, outcome: Outcome) -> float:
    return nlp.cost(outcome.x) * nlp.scale.cost


def violation(nlp: Transcription, outcome: Outcome) -> float:
    return residuals(nlp, outcome.x, outcome.duals).violation


def profile(nlp: Transcription, x: np.ndarray) -> dict[str, float]:
    """Seconds of the parts of a solve by ipm."""
    return ipm.profile(nlp, nlp.scaled(x), Options(iterations=ITERATIONS), kkt_layout(nlp))


def neighbour(
    nlp: Transcription,
    problem: dmoc.Problem,
    outcome: Outcome,
) -> tuple[Transcription, np.ndarray, Duals]:
    """The program of a neighbouring problem with a minimum and its multipliers to start from."""
    x = nlp.physical(outcome.x)
    near = program(problem, x, minimum=True)
    named = named_multipliers(nlp, outcome.duals.y, outcome.duals.w, outcome.duals.z)
    return near, x, Duals(*multiplier_vectors(near, named))


def simulated(nlp: Transcription, x: np.ndarray) -> bool:
    """Whether the independent simulation confirms unknowns x in units of the problem."""
    return bool(verify(trajectory(nlp, nlp.scaled(x)), nlp.problem.kernels).passed)


def refined(nlp: Transcription, x: np.ndarray, factor: int) -> tuple[Transcription, np.ndarray]:
    """The program with more steps, and the same motion in its unknowns."""
    finer = nlp.problem.but(steps=[n * factor for n in nlp.problem.phase_steps])
    pieces = pieces_of(trajectory(nlp, nlp.scaled(x)))
    start = unknowns_along(finer, pieces, x[nlp.layout.impact.lam])
    return program(finer, start), start


def casadi_start(nlp: Transcription, x: np.ndarray) -> tuple[np.ndarray, ...]:
    """Durations, coordinates, inputs and impulses of a guess."""
    lay = nlp.layout
    return x[lay.index_h] * np.array(lay.steps), x[lay.index_q], x[lay.index_u], x[lay.impact.lam]


def casadi_sizes(nlp: Transcription) -> tuple[np.ndarray, np.ndarray, float]:
    """What dmoc divides these unknowns by, the rows of their program (momenta at the start,
    energies and momenta between, momenta at the end, final time) and the cost."""
    lay, scale = nlp.layout, nlp.scale
    parts = casadi_start(nlp, nlp.sizes)
    x = np.concatenate([part.ravel() for part in parts])
    hits = len(lay.collision_nodes)
    g = [scale.p, np.full(hits, scale.energy), np.tile(scale.p, lay.total - 1), scale.p]
    return x, np.concatenate([*g, [scale.time]]), scale.cost


def from_casadi(nlp: Transcription, x: np.ndarray, casadi_x: np.ndarray) -> np.ndarray:
    """Unknowns with what CasADi found, the others as in x."""
    lay, y = nlp.layout, x.copy()
    phases, coordinates = lay.phases, (lay.total + 1) * 2
    inputs = phases + coordinates
    y[lay.index_h] = casadi_x[:phases] / np.array(lay.steps)
    y[lay.index_q] = casadi_x[phases:inputs].reshape(-1, 2)
    y[lay.index_u] = casadi_x[inputs : inputs + lay.total].reshape(-1, 1)
    y[lay.impact.lam] = casadi_x[inputs + lay.total :]
    return y


def bytes_of_c(model: dmoc.MechanicalSystem) -> int:
    return len(c_files(model_spec(model))["kernels.c"])
