"""What a carried solver knows of motions, as C (dmoc_carried.h): how momenta, velocities and forces
follow from the unknowns, and what is left of a motion later."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.export.constants import Constants, initial, literal
from dmoc.export.numbers import SolverNumbers
from dmoc.motion.trajectory import FORCES
from dmoc.program.arrays import ElementPlaces, PassData
from dmoc.program.blocks import NOWHERE, Index
from dmoc.program.reactions import PhaseReaction
from dmoc.program.transcription import Transcription

# The kernel of the slopes of switches, and their matrix.
CROSSING = "crossing_jac", "w_D"
# Kinds of forces: the kernels of slopes and of rates, and the matrix of the slopes.
KINDS = {
    "normal": ("surface_jac", "gap_rate", "g_D"),
    "tangential": ("tangent_jac", "slide_rate", "tau_D"),
    "reaction": ("joint_jac", "joint_rate", "phi_D"),
}
# Of what follows a track: a coordinate, a value, an amount in proportion to the step.
COORDINATE, VALUE, AMOUNT = range(3)


class ResultTable(NamedTuple):
    """A table of what follows from the unknowns: its place among the results, what it has."""

    name: str
    first: int
    rows: int
    columns: int
    what: str


class Track(NamedTuple):
    """Unknowns or rows of the first phase that follow each other, by number, and their places from
    0 to 1."""

    kind: int
    numbers: Index
    at: Array
    coordinate: int = 0


def derived_tables(nlp: Transcription) -> list[ResultTable]:
    """Momenta, velocities and forces at the nodes of all phases."""
    lay, names = nlp.layout, nlp.kernels.coordinates
    rows, first, tables = lay.total + lay.phases, 0, list[ResultTable]()
    of = {"momenta": names, "velocities": names, **_functions(nlp)}
    for name, columns in of.items():
        if columns:
            tables.append(ResultTable(name, first, rows, len(columns), ", ".join(columns)))
            first += rows * len(columns)
    return tables


def _functions(nlp: Transcription) -> dict[str, list[str]]:
    """Names of the functions of each kind that pushes somewhere, or none."""
    kernels = nlp.kernels
    every = kernels.surfaces, kernels.tangents, kernels.joints
    kinds = {r.kind for _, r in _reactions(nlp)}
    return {kind: list(n) if kind in kinds else [] for kind, n in zip(KINDS, every, strict=True)}


def _reactions(nlp: Transcription) -> Iterator[tuple[int, PhaseReaction]]:
    for i in range(nlp.layout.stepped):
        for reaction in nlp.layout.reactions(i):
            yield i, reaction


def momenta_of(nlp: Transcription) -> PassData:
    """The pass that finds the momenta of steps at the nodes of all phases: of the first node of a
    phase at the start of its first step, of others at the end of the step before."""
    lay, data, kernels = nlp.layout, nlp.assembled.data, nlp.kernels
    first = data.first_parameter
    parts = [np.where(at == NOWHERE, first - 1, at) for at in lay.split(lay.index_step)]
    phases = lay.phase_of_step if nlp.problem.models.change else np.zeros_like(lay.phase_of_step)
    own = first + phases[:, None] * nlp.par.shape[1] + np.arange(nlp.par.shape[1])
    parameters = np.where(_chosen(nlp) == NOWHERE, own, _chosen(nlp))
    outputs = [int(np.prod(o["shape"])) for o in kernels.manifest.kernels["step"]["outputs"]]
    slots = [np.full((lay.total, size), NOWHERE) for size in outputs]
    begins, k, own = lay.ends[: lay.stepped], np.arange(lay.total), np.arange(lay.nq)
    rows = np.arange(lay.stepped)
    slots[0][begins] = (begins + rows)[:, None] * lay.nq + own
    slots[1][:] = (k + 1 + lay.phase_of_step)[:, None] * lay.nq + own
    factors = [np.full(slot.shape, -1.0 if b == 0 else 1.0) for b, slot in enumerate(slots)]
    arguments = (*parts, parameters)
    none = np.zeros(0, dtype=np.intp)
    element = ElementPlaces("step", arguments, tuple(slots))
    flat = np.concatenate([factor.ravel() for factor in factors])
    return PassData(np.zeros(0), none, none, np.zeros(0), (element,), flat)


def _chosen(nlp: Transcription) -> Index:
    """The unknowns that parameters are."""
    unknowns = dict(zip(nlp.problem.design, nlp.layout.index_design.tolist(), strict=True))
    return np.array([unknowns.get(name, NOWHERE) for name in nlp.kernels.parameters], np.intp)


def motion_text(c: Constants, nlp: Transcription, entries: Mapping[str, str], momenta: str) -> str:
    lay, problem, names = nlp.layout, nlp.problem, _functions(nlp)
    functions, rows = list[str](), list[str]()
    for kind, (slopes, rates, matrix) in KINDS.items():
        count = len(names[kind])
        pattern = nlp.kernels.pattern(slopes, matrix) if count else ((), ())
        called = (entries[slopes], entries[rates]) if count else ("NULL", "NULL")
        arrays = (c.array("int", np.asarray(part, dtype=np.intp)) for part in pattern)
        functions.append(initial(*called, count, len(pattern[0]), *arrays))
    for i, r in _reactions(nlp):
        follows = problem.redundant[i]
        others = dict(zip(FORCES, (follows.closed, follows.sticking, follows.joints), strict=True))
        holds = r.holds & ~np.isin(np.array(r.columns), others[r.kind])
        arrays = (c.array("int", np.asarray(a)) for a in (r.columns, holds * 1, r.unknowns))
        place = [*KINDS].index(r.kind)
        rows.append(initial(i, place, len(r.columns), literal(r.functions.push), *arrays))
    inputs = (c.array("int", lay.index_u[at]) for at in (lay.row_u_k, lay.row_u_kp1))
    return initial(
        momenta, entries["dynamics"], initial(*functions), lay.nu, len(rows), lay.scheme.degree,
        int(lay.index_p_E[0]), c.structs("dmoc_reaction", "reactions", rows),
        c.array("double", lay.scheme.weights), initial(*inputs),
    )  # fmt: skip


def work_of(nlp: Transcription) -> int:
    """Doubles that dmoc_motion.c works with, carried_work_size."""
    model, names = nlp.problem.model, _functions(nlp)
    n, k = model.nq, sum(map(len, names.values())) + model.nc
    entries = sum(
        len(nlp.kernels.pattern(slopes, matrix)[0])
        for kind, (slopes, _, matrix) in KINDS.items() if names[kind]
    )  # fmt: skip
    doubles = 2 * n * n + 4 * n + 3 * k * n + k * k + 3 * k + entries
    if nlp.kernels.manifest.switches:
        slopes = nlp.kernels.pattern(*CROSSING)[0]
        doubles += len(nlp.kernels.manifest.crossings) + len(slopes)
    return doubles + int(nlp.par.shape[1]) + model.nu + 3 * model.nc + model.nj + 8 * model.nt


def has_rest(nlp: Transcription, numbers: SolverNumbers) -> bool:
    """Whether the rest of the motion is the same program with other numbers."""
    lay, problem, taken = nlp.layout, nlp.problem, {n.name for n in numbers.taken}
    start = numbers.states[0]
    stated = {f"start.{name}" for name in problem.start} | {*(start.names if start else ())}
    possible = start is not None and stated <= taken & {*start.names}
    possible &= not any(n.startswith(("final_time", "durations.0")) for n in numbers.kept)
    possible &= not (problem.explicit_time or problem.relations or problem.model.has_objective)
    return possible and not (lay.index_totals.size or lay.index_peaks.size)


def rest_text(c: Constants, nlp: Transcription, numbers: SolverNumbers) -> str:
    """Text of the tables for a shift to the rest of the motion, and for random courses."""
    lay, possible = nlp.layout, has_rest(nlp, numbers)
    times = [
        i for i, n in enumerate(numbers.taken)
        if n.path[0] == "final_time" or n.path[:2] == ("durations", 0)
    ]  # fmt: skip
    unknowns, rows = (list(_tracks(nlp)), list(_row_tracks(nlp))) if possible else ([], [])
    written = [
        c.structs("dmoc_track", name, [_track(c, t) for t in tracks])
        for name, tracks in (("unknown_tracks", unknowns), ("row_tracks", rows))
    ]
    return initial(
        int(possible), len(times), len(unknowns), len(rows),
        int(lay.index_q_i.ravel()[0]) if lay.inside else 0, c.array("int", np.array(times)),
        *written, c.array("double", lay.scheme.course), c.array("double", lay.scheme.nodes[2:]),
    )  # fmt: skip


def _track(c: Constants, t: Track) -> str:
    arrays = c.array("int", t.numbers), c.array("double", t.at)
    return initial(len(t.numbers), t.kind, t.coordinate, *arrays)


def _tracks(nlp: Transcription) -> Iterator[Track]:
    """The unknowns along the first phase."""
    lay = nlp.layout
    steps, stations = lay.steps[0], lay.stations
    nodes, step = np.linspace(0, 1, steps + 1), np.arange(steps)
    within = ((step[:, None] + lay.scheme.nodes[2:]) / steps).ravel()
    inside = lay.index_q_i[:steps].reshape(-1, lay.nq)
    for i in range(lay.nq):
        yield Track(COORDINATE, lay.index_q[: steps + 1, i], nodes, i)
        yield Track(COORDINATE, inside[:, i], within, i)
    times = lay.form.times(nodes)
    yield from _columns(VALUE, lay.index_u[: len(times)], times)
    first = stations.rows(0)
    places = stations.place[first] / (lay.scheme.degree * steps)
    if stations.own:
        places = (stations.step[first] + stations.within[first]) / steps
    for r in lay.reactions(0):
        yield from _columns(AMOUNT, r.unknowns, places)
    yield from _columns(VALUE, lay.index_s[:steps], (step + 0.5) / steps)
    yield from _columns(VALUE, lay.index_w[: steps + 1], nodes)


def _row_tracks(nlp: Transcription) -> Iterator[Track]:
    """The rows along the first phase: of the laws of motion, whose multipliers are costates, and of
    others that say at which nodes they stand, whose multipliers are amounts for each step."""
    law, steps = nlp.laws.step, nlp.layout.steps[0]
    for block in (law.momentum, law.inside, law.passing):
        if block.count:
            yield from _columns(VALUE, block.index, np.arange(len(block.index)) / steps)
    for block in (*nlp.equalities, *nlp.inequalities):
        if block.count and block.nodes is not None:
            yield from _columns(AMOUNT, block.index, block.nodes / steps)


def _columns(kind: int, index: Index, at: Array) -> Iterator[Track]:
    """Each column of rows at some places, without those beyond the phase and those that there are
    not."""
    rows = index.reshape(len(index), -1)[: len(at)]
    for column in rows.T:
        there = (column != NOWHERE) & (at[: len(column)] <= 1)
        if there.any():
            yield Track(kind, column[there], at[: len(column)][there])
