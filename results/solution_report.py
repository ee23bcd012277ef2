"""A solution on one page for somebody else: the problem, the result, the minima found, the check,
and the figure; as HTML that needs no network, or as PDF."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Iterator
from contextlib import suppress
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dmoc.base.arguments import place
from dmoc.base.errors import ModelError, OutputError, SimulationError
from dmoc.base.html import page, picture, section
from dmoc.base.table import Cell, Table, html_of, plain
from dmoc.base.tolerances import ROUNDING
from dmoc.mechanics.model_values import parameter_in_words
from dmoc.motion.trajectory import Array, Trajectory, impulses_in_words
from dmoc.report.canvas import new_figure
from dmoc.report.rounding import without_rounding
from dmoc.results.exploration import exploration_in_words
from dmoc.results.solution_table import in_words, table_of_solution
from dmoc.solvers.outcome import UNREFINED

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from dmoc.results.solution import Solution

ENDINGS = (".html", ".pdf")
# A4 in inches, its margin, the size of text in points, the lines of a page and the characters of
# a line.
PAPER, MARGIN, TEXT = (8.27, 11.69), 0.8, 8.5
LINES, CHARACTERS = 78, 92
DOTS = 150  # of pictures, to the inch


def report(solution: Solution, path: Path) -> None:
    """Write the report of a solution in the format of the path's ending."""
    from dmoc.base.files import write_whole

    ending = path.suffix.lower()
    if ending not in ENDINGS:
        raise OutputError(f"{place(path)} has no known format: end it in .html or .pdf.")
    made = _html(solution) if ending == ".html" else _pdf(solution)
    write_whole(path, made)


def title_of(solution: Solution) -> str:
    """Title of the report."""
    return f"{solution.trajectory.model}: {solution.status}, cost {solution.cost:.7g}"


def tables(solution: Solution) -> Iterator[Table]:
    """The parts of a report in words, each with its title."""
    yield Table(tuple(_stated(solution.trajectory)), title="Problem")
    yield Table(table_of_solution(solution).rows, title="Result")
    if solution.starts:
        yield Table(
            tuple(_minima(solution)),
            ("cost", "starts", "status", "steps"),
            (_explored(solution),),
            "Minima found",
        )
    if solution.verification:
        yield Table(tuple(_verified(solution)), title="Check by an independent simulation")
    if solution.certificate:
        yield solution.certificate.summary()
    if solution.converged:
        with suppress(ModelError):  # from a file, of a model that is not shipped
            yield _stability(solution)


def _stability(solution: Solution) -> Table:
    """Table of the growth of small deviations, or of the reason why it is not known."""
    try:
        return solution.stability().summary()
    except SimulationError as error:
        return Table((("not known", str(error)),), title="Stability")


def _stated(motion: Trajectory) -> Iterator[tuple[Cell, ...]]:
    """Rows of the report about the problem, as far as the motion knows it."""
    motion = without_rounding(motion)
    sequence = ", ".join(c.word for c in motion.collisions)
    yield "model", motion.model
    yield "sequence", sequence or "no collision"
    q, v = (_clean(np.vstack([getattr(p, name) for p in motion.phases])) for name in "qv")
    yield "start", _state(motion, q[0], v[0])
    yield "end", _state(motion, q[-1], v[-1])
    values = (f"{n} = {parameter_in_words(x)}" for n, x in motion.parameters.items())
    yield "parameters", ", ".join(values)
    bounds = [
        *zip(motion.inputs, motion.input_bounds, strict=True),
        *zip(motion.coordinates, motion.coordinate_bounds, strict=True),
        *motion.limits.items(),
    ]
    limited = [f"{name}: {b[0]:g} to {b[1]:g}" for name, b in bounds if np.isfinite(b).any()]
    yield "bounds", ", ".join(limited) or "none"
    of_grips = {place for places in motion.grips.values() for place in places}
    restitution = ", ".join(
        f"{name} by the model" if e is None else f"{name} {e:g}"
        for name, e in motion.restitution.items()
        if name not in of_grips
    )
    yield "restitution", restitution or "no surfaces"
    for what in ("friction", "tangential restitution"):
        if values := getattr(motion, what.replace(" ", "_")):
            yield (
                what,
                ", ".join(
                    f"{name} varies" if x is None else f"{name} {x:g}" for name, x in values.items()
                ),
            )
    if motion.ignored:
        yield "ignored", ", ".join(motion.ignored)
    steps = " + ".join(str(phase.steps) for phase in motion.phases)
    yield "mesh", f"{steps} steps, order {motion.order}, {motion.controls} inputs"


def _state(motion: Trajectory, q: Array, v: Array) -> str:
    pairs = chain.from_iterable(
        (f"{name} = {a + 0.0:.5g}", f"{name}_dot = {b + 0.0:.5g}")
        for name, a, b in zip(motion.coordinates, q, v, strict=True)
    )
    return ", ".join(pairs)


def _clean(values: Array) -> Array:
    """Rows of values without what rounding errors leave of zeros, beside the largest of each."""
    sizes = np.abs(values)
    return np.where(sizes < ROUNDING * sizes.max(axis=0), 0.0, values)


def _minima(s: Solution) -> Iterator[tuple[Cell, ...]]:
    steps = "+".join(str(phase.steps) for phase in s.phases)
    yield f"{s.cost:.7g}", str(s.agreeing_starts), f"{s.status}, this one", steps
    for other in s.others:
        status = "coarse mesh only" if other.status == UNREFINED else other.status
        steps = "+".join(map(str, other.steps))
        yield f"{other.cost:.7g}", str(other.agreeing_starts), status, steps


def _explored(s: Solution) -> str:
    words = exploration_in_words(s)
    estimate = "" if s.unseen_share is None else " Shares are estimates of Good and Turing."
    return (
        f"On a coarse mesh {words}. Minima are local: none of these starts led to a better one."
        f"{estimate}"
    )


def _verified(s: Solution) -> Iterator[tuple[Cell, ...]]:
    for name, value in s.verification.to_dict().items() if s.verification else ():
        text = ", ".join(map(str, value)) or "none" if isinstance(value, (list, tuple)) else value
        if isinstance(value, bool):
            text = "yes" if value else "no"
        elif isinstance(value, float):
            text = f"{value:.3g}"
        if text != "":
            yield name.replace("_", " "), str(text)


def _caption(s: Solution) -> str:
    events = "; ".join(f"{c.word} at {c.time:.4g} s{impulses_in_words(c)}" for c in s.collisions)
    parts = [part for part in (in_words(s.design), events) if part]
    return " ".join(["The motion over time.", *(f"{part}." for part in parts[:-1]), *parts[-1:]])


def _html(solution: Solution) -> bytes:
    pictures = []
    for style in ("light", "dark"):
        stream = io.BytesIO()
        solution.plot(style=style).savefig(stream, dpi=DOTS, format="png")
        pictures.append(stream.getvalue())
    parts = [
        section(part.title, html_of(Table(part.rows, part.head, part.notes)))
        for part in tables(solution)
    ]
    parts.insert(2, section("Figure", picture(pictures[0], pictures[1], _caption(solution))))
    return page(title_of(solution), "".join(parts)).encode()


def _pdf(solution: Solution) -> bytes:
    """Pages of text, and the figure on a page of its own."""
    figure = solution.plot()
    # Before the figures: where Matplotlib is missing, they say so.
    from matplotlib.backends.backend_pdf import PdfPages

    stream = io.BytesIO()
    lines = list(_lines(solution))
    with PdfPages(stream, metadata={"Title": title_of(solution), "CreationDate": None}) as pages:
        for first in range(0, len(lines), LINES):
            pages.savefig(_printed(lines[first : first + LINES]))
        pages.savefig(figure)
    return stream.getvalue()


def _lines(solution: Solution) -> Iterator[tuple[str, bool]]:
    """Lines of text, and whether they are headings."""
    yield title_of(solution), True
    for part in tables(solution):
        yield "", False
        yield part.title, True
        rows = [part.head, *part.rows] if part.head else list(part.rows)
        widths = [max(len(plain(row[k])) for row in rows) + 2 for k in range(len(rows[0]) - 1)]
        for row in rows:
            first = "".join(plain(c).ljust(w) for c, w in zip(row, widths, strict=False))
            room = max(CHARACTERS - len(first), 20)
            for k, piece in enumerate(textwrap.wrap(plain(row[-1]), room) or [""]):
                yield (first if not k else " " * len(first)) + piece, False
        for note in part.notes:
            for piece in textwrap.wrap(note, CHARACTERS):
                yield piece, False


def _printed(lines: list[tuple[str, bool]]) -> Figure:
    """A page of text."""
    figure = new_figure(*PAPER)
    width, height = PAPER
    for k, (line, heading) in enumerate(lines):
        figure.text(
            MARGIN / width,
            1 - (MARGIN + k * (height - 2 * MARGIN) / LINES) / height,
            line,
            size=TEXT + 2 * heading,
            family="sans-serif" if heading else "monospace",
            weight="bold" if heading else "normal",
            va="top",
            parse_math=False,
        )
    return figure
