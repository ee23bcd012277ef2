"""dmoc.generate_page: a problem with its solver as a page that plans while one drags."""

from __future__ import annotations

import base64
import gzip
import os
import subprocess
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from dmoc.base.arguments import path as path_of
from dmoc.base.arguments import place
from dmoc.base.errors import BuildError, MissingExtraError, OutputError, ProblemError
from dmoc.base.files import check_file, scratch_folder, write_whole
from dmoc.base.names import velocity_name
from dmoc.base.signatures import public
from dmoc.codegen.compiler import packaged
from dmoc.export.numbers import Number
from dmoc.export.program_text import CarriedProgram
from dmoc.export.solver import solver_files
from dmoc.mechanics.phase_models import check_one_for_all
from dmoc.motion.scene import FINE, shapes_in
from dmoc.problem.problem import Problem
from dmoc.program.blocks import NOWHERE
from dmoc.program.layout import Layout
from dmoc.report.animation.page import page_of
from dmoc.report.film import Film, Take
from dmoc.report.labels import Label, label_of, rate_of
from dmoc.results.solution import Solution
from dmoc.solving.request import check_problem
from dmoc.solving.starts import InitialGuess

# What the scripts of a page call, in C, and the name that the solver has in it.
SOURCE, NAME = "page_solver.c", "planned"
# Where WebAssembly runs: in every browser since 2023.  The same operations as everywhere.
TARGET = (
    "-target", "wasm32-wasi", "-mexec-model=reactor", "-msimd128", "-std=c11", "-O2",
    "-ffp-contract=off", "-Wl,--strip-all",
)  # fmt: skip
SHOWN = ("normal", "tangential")  # kinds of impulses that are told
# How numbers are called on a page: their groups, in this order, and words for their sides.
GROUPS = {
    "start": "start", "goal": "goal", "bounds": "bounds", "final_time": "time",
    "durations": "time", "parameters": "parameters", "design": "design", "via": "places at events",
    "restitution": "restitution", "periodic": "differences of both ends",
}  # fmt: skip
SIDES = {None: "", 0: "least ", 1: "most "}
# How far sliders reach: from a share of a number to a multiple of it, of those of states by what
# the motion covers.
LEAST, MOST = 0.1, 2.0


@public(ProblemError)
def generate_page(
    problem: Problem, path: str | os.PathLike[str], *, guess: InitialGuess = None
) -> Path:
    """Write a problem with its solver as one page that plans its motion again while one drags.

    The page fetches nothing.  It carries the solver of :func:`dmoc.generate_solver` as WebAssembly,
    and has a slider for each number that this takes; what the start, the goal or a wall of the
    drawing shows can be dragged there, in space parallel to the screen.  Each motion begins with
    the last one, or else with several starts; where none is found, the page says so.

    Parameters
    ----------
    problem : Problem
        Of a model with a drawing.
    path : path
        A file that ends in .html.
    guess : optional
        As :func:`dmoc.generate_solver` takes it.

    Returns
    -------
    Path

    Raises
    ------
    ProblemError
        If the problem has no solution, its model no drawing, or its kernels are not compiled.
    OutputError
        If the file does not end in .html or cannot be written.
    MissingExtraError
        If the compiler of ``dmoc[cc]`` is not installed.

    Examples
    --------
    >>> import dmoc
    >>> from dmoc.models.registry import find
    >>> reference = find("cart_pendulum")
    >>> problem = dmoc.Problem(reference.kernels(), **reference.defaults).but(steps=40)
    >>> print(dmoc.generate_page(problem, "swing_up.html"))
    swing_up.html
    """
    check_problem(problem)
    check_one_for_all(problem.models, "a page has one set of parameters", ProblemError)
    target = path_of(path)
    if target.suffix.lower() != ".html":
        raise OutputError(f"{place(target)} is no page: end it in .html.")
    shapes = shapes_in(problem.kernels.manifest.drawing)
    if not shapes:
        raise ProblemError(
            f"model {problem.kernels.name!r} has no drawing, which a page shows: give it one, as "
            "drawing=[dmoc.Link((0, 0), (x, y))]."
        )
    command = packaged()
    if command is None:
        raise MissingExtraError(
            "ziglang is needed to compile the solver of a page: install it with `pip install "
            "'dmoc[cc]'`."
        )
    check_file(target)
    carried, solution, texts = solver_files(NAME, problem, guess, None)
    layout, kernels = carried.nlp.layout, carried.nlp.kernels
    phases = [_phase(layout, i) for i in range(layout.stepped)]
    columns = shapes[-1].start + shapes[-1].size
    sizes = {
        "PAGE_ROWS": sum((len(p["shares"]) - 1) * p["parts"] + 1 for p in phases),
        "PAGE_COORDINATES": layout.nq, "PAGE_COLUMNS": columns,
        "PAGE_PARAMETERS": len(kernels.parameters), "PAGE_DRAWING": f"{kernels.name}_drawing",
    }  # fmt: skip
    code = gzip.compress(_compiled(command, texts, sizes), mtime=0)
    plan = {
        "solver": base64.b64encode(code).decode(), "numbers": _numbers(carried, solution),
        "parameters": _parameters(carried), "coordinates": kernels.coordinates,
        "inputs": kernels.inputs, "columns": columns,
        "shapes": [list(range(s.start, s.start + s.size)) for s in shapes],
        "nodes": layout.ends.tolist(), "phases": phases, "events": _events(layout, solution),
        "groups": list(dict.fromkeys(GROUPS.values())),
        "turning": [
            kernels.coordinates[i] for own in kernels.manifest.attitudes.values() for i in own
        ],
    }  # fmt: skip
    name = ", ".join(carried.nlp.problem.words) or kernels.name
    take = Take(name, solution.trajectory, str(solution.status), "", float(solution.cost))
    return write_whole(target, page_of(Film(kernels.name, (take,)), plan).encode())


def _compiled(command: list[str], texts: Mapping[str, str], sizes: Mapping[str, Any]) -> bytes:
    """The solver of a page as WebAssembly, from the texts of its files."""
    own = resources.files("dmoc.export").joinpath(SOURCE).read_text(encoding="utf-8")
    with scratch_folder() as folder:
        for name, text in {**texts, SOURCE: own}.items():
            (folder / name).write_text(text, encoding="utf-8")
        sources = sorted(n for n in texts if n.endswith(".c") and n not in ("main.c", "test.c"))
        defines = [f"-D{name}={value}" for name, value in sizes.items()]
        words = [*command, *TARGET, *defines, SOURCE, *sources, "-o", "page.wasm"]
        done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise BuildError(f"the compiler of the page failed: {done.stderr.strip()}")
        return (folder / "page.wasm").read_bytes()


def _phase(layout: Layout, i: int) -> dict[str, Any]:
    """Where the unknowns of a phase are, and the shares of its duration that they stand for:
    positions at all places, inputs with both ends of steps in which they are constant."""
    steps, first, last = layout.steps[i], int(layout.ends[i]), int(layout.ends[i + 1])
    within = np.sort(layout.scheme.nodes)[:-1]
    shares = np.append((np.arange(steps)[:, None] + within).ravel() / steps, 1.0)
    nodes = np.linspace(0.0, 1.0, steps + 1)
    rows = layout.index_u[layout.row_u_k[first] : layout.row_u_kp1[last - 1] + 1]
    if layout.form.width:
        times = layout.form.times(nodes)
    else:
        times, rows = np.repeat(nodes, 2)[1:-1], np.repeat(rows, 2, axis=0)
    places = layout.index_places[layout.places_of_phase(i)]
    return {
        "shares": shares.tolist(), "places": places.tolist(),
        "parts": -(-FINE // (len(shares) - 1)),
        "inputs": {"shares": times.tolist(), "rows": rows.tolist()},
    }  # fmt: skip


def _events(layout: Layout, solution: Solution) -> list[dict[str, Any]]:
    """The contacts of each event with the unknowns that are their impulses, normal and tangential,
    -1 for none, and whether these are named."""
    events = []
    for i, collision in enumerate(solution.trajectory.collisions):
        contacts = dict[str, list[int]]()
        for pushes in layout.impulses(i):
            for name, unknown in zip(pushes.names, pushes.unknowns.tolist(), strict=True):
                if pushes.kind in SHOWN:
                    own = contacts.setdefault(name, [NOWHERE, NOWHERE])
                    own[SHOWN.index(pushes.kind)] = unknown
        several = collision.word != collision.surface
        events.append({"named": several, "contacts": [[n, *at] for n, at in contacts.items()]})
    return events


def _parameters(carried: CarriedProgram) -> list[dict[str, Any]]:
    """The value of each parameter of the drawing, and the number or the unknown that it is."""
    nlp = carried.nlp
    unknowns = dict(zip(nlp.problem.design, nlp.layout.index_design.tolist(), strict=True))
    numbers = {n.name: i for i, n in enumerate(carried.numbers.taken)}
    values = zip(nlp.kernels.parameters, nlp.problem.parameter_values[0].tolist(), strict=True)
    return [
        {"value": v, "number": numbers.get(f"parameters.{n}", -1), "unknown": unknowns.get(n, -1)}
        for n, v in values
    ]


def _numbers(carried: CarriedProgram, solution: Solution) -> list[dict[str, Any]]:
    """The numbers as sliders show them, in the order in which the solver has them."""
    kernels, motion = carried.nlp.kernels, solution.trajectory
    units = {**kernels.manifest.units}
    spans = dict[str, float]()
    labels = dict[str, Label]()
    for j, name in enumerate(kernels.coordinates):
        rate, unit = velocity_name(name), units.get(name, "")
        units[rate] = f"{unit}/s" if unit else ""
        labels[rate] = rate_of(label_of(name))
        for what, key in (("q", name), ("v", rate)):
            spans[key] = max(float(np.ptp(getattr(p, what)[:, j])) for p in motion.phases)
    return [_slider(number, labels, units, spans) for number in carried.numbers.taken]


def _slider(
    number: Number,
    labels: Mapping[str, Label],
    units: Mapping[str, str],
    spans: Mapping[str, float],
) -> dict[str, Any]:
    """A number with its group, its label and how far its slider goes."""
    field, *rest = map(str, number.path)
    what = rest[-1] if rest else ""
    timed = field in ("final_time", "durations")
    words = {"final_time": "final time", "durations": f"phase {what}"}.get(field, "")
    if field == "via":
        words = f"event {int(rest[0]) + 1}: "
    value = number.value
    if what in spans and field in ("start", "goal", "via"):
        around = max(spans[what] / 2, abs(value) / 2) or 1.0
        ends = value - around, value + around
    else:
        ends = (LEAST * value, MOST * value) if value else (-1.0, 1.0)
        ends = (ends[0], 1.0) if number.kind == "share" else ends
    label = None if timed else labels.get(what, label_of(what))
    return {
        "name": number.name, "group": GROUPS[field], "words": SIDES[number.side] + words,
        "label": label and {"head": label.head, "tail": label.tail},
        "unit": "s" if timed else units.get(what, ""), "value": value,
        "low": min(ends), "high": max(ends),
    }  # fmt: skip
