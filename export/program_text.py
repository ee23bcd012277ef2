"""The constants of a carried problem as C (dmoc_carried.h)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dmoc.base.records import record
from dmoc.codegen.kernels import Array, Kernels
from dmoc.export.constants import Constants, initial, literal
from dmoc.export.motion_text import (
    derived_tables,
    momenta_of,
    motion_text,
    rest_text,
)
from dmoc.export.numbers import (
    ENDS,
    KINDS,
    NOT_ONE,
    SIDES,
    FixedState,
    Number,
    SolverNumbers,
    moved_arrays,
    passes_of,
)
from dmoc.mechanics.algebra import is_positive
from dmoc.mechanics.contact_mode import Mode
from dmoc.problem.reach import rate_sizes
from dmoc.program.arrays import ElementData, PassData, ProgramData
from dmoc.program.assembly import strided
from dmoc.program.blocks import NOWHERE, Block, Index
from dmoc.program.transcription import Transcription
from dmoc.solvers.kkt_layout import KKTLayout
from dmoc.solvers.outcome import Duals

# Kernels of coefficients that depend on the motion, and of what they depend on.
KERNELS = ("rebound", "bearing", "holding", "slide_rate")
OF_PARAMETERS = ("friction", "tangential")
ENDS_OF_SURFACES, SWITCHES = ("within", "within_rate"), ("crossing_jac", "crossing")
# Of the kernels that a solver calls beside those of its passes.
CHECKS = ("momentum", "surface", "gap_rate", "joint", "joint_rate", "tangent")
OTHERS = (
    "barrier",
    *ENDS_OF_SURFACES,
    *SWITCHES,
    "dynamics",
    "joint_jac",
    "surface_jac",
    "tangent_jac",
    *KERNELS,
    *OF_PARAMETERS,
)
KKT = ("place", "start", "row", "first", "from_hess", "from_jac", "diagonal")
LDL = ("first", "block", "row_start", "row", "part_start", "part", "target", "height")
SIZES = ("n", "entries", "pivots", "chain", "blocks")


@record(frozen=True, eq=False)
class CarriedProgram:
    """What a solver is made of: the program with its analysis, the numbers it takes, the scaled
    answer with its multipliers, the scaled first motion, and how far coordinates may move, in the
    whole motion where this is a rest of one."""

    name: str
    nlp: Transcription
    layout: KKTLayout
    numbers: SolverNumbers
    x: Array
    duals: Duals
    first: Array
    reach: Array


def program_text(carried: CarriedProgram) -> tuple[list[str], int]:
    """The lines of all constants, of which the last ones are the problem itself, and bytes."""
    c, nlp, data = Constants(), carried.nlp, carried.nlp.assembled.data
    kernels, numbers = nlp.kernels, carried.numbers
    used = {e.kernel for p in (data.values, data.slopes, data.curvatures) for e in p.elements}
    called = {k for k in (*CHECKS, *OTHERS) if kernels.has(k)}
    entries = _entries(c, kernels, sorted(used | called))
    passes = [
        _pass(c, entries, name, p)
        for name, p in (
            ("values", data.values), ("slopes", data.slopes), ("curvatures", data.curvatures),
        )
    ]  # fmt: skip
    program = initial(
        data.n, data.m, data.equalities, c.array("double", data.lower),
        c.array("double", data.upper), c.array("double", data.sizes), "NULL", *passes,
        *(c.array("int", a) for a in (*data.jacobian, *data.hessian)),
    )  # fmt: skip
    kkt = initial(
        carried.layout.size, len(carried.layout.first) - 1,
        *(c.array("int", getattr(carried.layout, name)) for name in KKT),
    )  # fmt: skip
    number_rows, change_rows = _number_rows(nlp, numbers)
    places = _places(c, carried, entries)
    tables = [initial(f'"{b.name}"', int(b.numbers[0]), *shape_of(b), 0) for b in tables_of(nlp)]
    tables += [initial(f'"{t.name}"', t.first, t.rows, t.columns, 1) for t in derived_tables(nlp)]
    momenta = _pass(c, entries, "momenta", momenta_of(nlp))
    fields = [
        f'"{carried.name}"', program, kkt, _ldl(c, carried.layout),
        c.array("double", data.pool), len(data.pool), len(data.values.coefficients),
        *_factors(c, data, numbers),
        len(numbers.taken), len(tables), nlp.layout.phases,
        c.structs("dmoc_number", "numbers", number_rows),
        c.structs("dmoc_change", "changes", change_rows),
        c.structs("dmoc_table_of", "tables", tables),
        initial(*(_state(c, s, numbers.taken) for s in numbers.states)), places,
        motion_text(c, nlp, entries, momenta), rest_text(c, nlp, numbers),
        together_text(c, nlp, entries), laws_text(c, nlp, entries),
        c.array("int", np.array(nlp.layout.steps)), literal(float(nlp.scale.cost)),
        c.array("double", carried.x), c.array("double", carried.duals.rows),
        c.array("double", carried.duals.z), c.array("double", carried.first),
    ]  # fmt: skip
    last = [f"const dmoc_carried {carried.name}_problem = {{", *(f"    {f}," for f in fields), "};"]
    return [*c.lines, "", *last], c.bytes


def tables_of(nlp: Transcription) -> list[Block]:
    """The blocks of unknowns that there are."""
    return [block for block in nlp.layout.unknowns if block.count]


def shape_of(block: Block) -> tuple[int, int]:
    """Rows and columns of a table; one column where places of its shape are empty."""
    if block.count < block.index.size:
        return block.count, 1
    return len(block.index), block.count // len(block.index)


def _entries(c: Constants, kernels: Kernels, names: Sequence[str]) -> Mapping[str, str]:
    """Addresses of the entries of kernels, by name."""
    rows = []
    for name in names:
        described = kernels.manifest.kernels[name]
        inputs = [(a, int(size)) for a, size in described["inputs"]]
        outputs = [(o["name"], count_of(o)) for o in described["outputs"]]
        arrays = [initial(f'"{a}"', size) for a, size in (*inputs, *outputs)]
        c.structs("dmoc_array", f"{name}_arrays", arrays)
        function = f"{kernels.name}_{name}"
        rows.append(initial(f'"{name}"', function, len(inputs), len(outputs), f"{name}_arrays"))
    c.structs("dmoc_entry", "kernels", rows)
    return {name: f"&kernels[{i}]" for i, name in enumerate(names)} | {"": "NULL"}


def _pass(c: Constants, entries: Mapping[str, str], name: str, data: PassData) -> str:
    rows = [_element(c, entries, e) for e in data.elements]
    at = c.structs("dmoc_element", f"{name}_elements", rows)
    return initial(
        len(data.constant), c.array("double", data.constant), len(data.coefficients),
        c.array("ptrdiff_t", data.rows), c.array("ptrdiff_t", data.columns),
        c.array("double", data.coefficients), len(rows),
        f"(dmoc_element *){at}" if rows else "NULL", "NULL",
    )  # fmt: skip


def _element(c: Constants, entries: Mapping[str, str], data: ElementData) -> str:
    base, stride, gather = list[int](), list[int](), list[str]()
    for at in data.arguments:
        evenly = strided(at)
        first, apart = evenly or (0, at.shape[1])
        base.append(first)
        stride.append(apart)
        gather.append("NULL" if evenly else c.array("ptrdiff_t", at))
    slots, factors = list[str](), list[str]()
    for slot, factor in zip(data.slots, data.factors, strict=True):
        used = bool(slot.size) and slot.max() >= 0
        slots.append(c.array("ptrdiff_t", slot) if used else "NULL")
        factors.append(c.array("double", factor.astype(float)) if used else "NULL")
    n = max(map(len, data.arguments))
    lists = (initial(*row) for row in (base, stride, gather, slots, factors))
    return initial(entries[data.kernel], n, *lists)


def count_of(output: Mapping[str, Any]) -> int:
    """Values of one row of a kernel's output."""
    return len(output["rows"]) if "rows" in output else int(np.prod(output["shape"]))


def _ldl(c: Constants, layout: KKTLayout) -> str:
    """The analysis of the factorisation, as it is without memory."""
    a = layout.factorisation.analysis()
    parts = [initial(*row) for row in a["part"].reshape(-1, 3).tolist()]
    part = c.structs("dmoc_part", "parts", parts)
    arrays = [part if name == "part" else c.array("int", a[name]) for name in LDL]
    arrays += [c.array("int", a[name]) for name in ("panel_start", "place")]
    written = ["NULL"] * 5 + [a["panel_size"], a["work_size"], a["product_at"], 0, 0, 0, 0]
    return initial(*(a[name] for name in SIZES), *arrays, *written)


def _number_rows(nlp: Transcription, numbers: SolverNumbers) -> tuple[list[str], list[str]]:
    """The numbers, and what they move."""
    arrays = moved_arrays(nlp.assembled.data, numbers.results)
    ends = np.cumsum([0, *map(len, arrays)])
    places = {n.name: i for i, n in enumerate(numbers.taken)}
    rows, changes = list[str](), list[str]()
    for n in numbers.taken:
        limits = [places.get(f"bounds.{n.path[-1]}.{side}", -1) for side in SIDES]
        limits = limits if n.path[0] in (*ENDS, "via") else [-1, -1]
        first = len(changes)
        for entry, slope in zip(n.entries.tolist(), n.slopes.tolist(), strict=True):
            array = int(np.searchsorted(ends, entry, side="right")) - 1
            changes.append(initial(array, entry - int(ends[array]), literal(slope)))
        count = len(changes) - first
        fit = *limits, KINDS.index(n.kind)
        pool = n.pool if n.pool == NOT_ONE else n.pool + nlp.assembled.data.first_parameter
        place = pool, n.phases
        rows.append(initial(f'"{n.name}"', literal(n.value), *place, first, count, *fit))
    return rows, changes


def _factors(c: Constants, data: ProgramData, numbers: SolverNumbers) -> list[str | int]:
    """The factors that numbers move, and the results of elements that they are those of."""
    (*_, factors), at, rows = moved_arrays(data, numbers.results), 0, list[str]()
    for r in numbers.results:
        rows.append(initial(r.of_pass, r.element, r.output, at))
        at += r.factors(data).size
    return [
        len(factors), len(rows), c.array("double", factors), c.structs("dmoc_moved", "moved", rows),
    ]  # fmt: skip


def elements_moved(data: ProgramData, numbers: SolverNumbers) -> int:
    """The elements that a solver has copies of: all where numbers move factors."""
    return sum(map(len, passes_of(data))) if numbers.results else 0


def _state(c: Constants, state: FixedState | None, taken: Sequence[Number]) -> str:
    if state is None:
        return initial(0, "NULL", "NULL", "NULL")
    places = {n.name: i for i, n in enumerate(taken)}
    at = np.array([places.get(name, -1) for name in state.names])
    arrays = c.array("int", at), c.array("int", state.momenta), c.array("double", state.values)
    return initial(1, *arrays)


def _places(c: Constants, carried: CarriedProgram, entries: Mapping[str, str]) -> str:
    """Text of the conditions that positions must keep."""
    nlp = carried.nlp
    kernels, lay, scale, problem = nlp.kernels, nlp.layout, nlp.scale, nlp.problem
    model, q = problem.model, problem.start_position
    touching, joined = bool(kernels.surfaces), bool(kernels.joints)
    there = zip(CHECKS, (True, touching, touching, joined, joined, model.nt > 0), strict=True)
    called = [entries[name] if is_there else "NULL" for name, is_there in there]
    called.append(entries[model.barrier_kernel] if touching else "NULL")
    called += [entries.get(name, "NULL") for name in ENDS_OF_SURFACES]
    called.append(_switches(c, kernels, entries))
    unknowns = dict(zip(problem.design, lay.index_design.tolist(), strict=True))
    chosen = np.array([unknowns.get(name, NOWHERE) for name in kernels.parameters])
    tangent, joint = (
        np.abs(slopes(q))[:, :-1] @ scale.q for slopes in (model.tangent_slopes, model.joint_slopes)
    )
    slide = rate_sizes(problem, model.tangent_slopes(q), np.zeros(lay.nq))
    sizes = scale.gap, scale.rate, joint, scale.joint_rate, tangent, slide, carried.reach
    held = np.array([_held(nlp, mode) for mode in lay.touch.modes])
    return initial(
        *called, lay.nq, model.nc, model.nj, model.nt, len(chosen), int(problem.models.change),
        c.array("int", chosen),
        *(c.array("double", np.asarray(s, dtype=float)) for s in sizes), c.array("int", held),
        c.array("int", lay.touch.sticks * 1), c.array("int", lay.touch.signs.astype(np.intp)),
        int(lay.index_q[0, 0]),
        int(lay.index_t[0]) if lay.timed else -1,
    )  # fmt: skip


def _switches(c: Constants, kernels: Kernels, entries: Mapping[str, str]) -> str:
    """Text of the functions whose zeros are events of switches."""
    count = len(kernels.manifest.switches)
    rows, columns = kernels.pattern(SWITCHES[0], "w_D") if count else ((), ())
    arrays = (c.array("int", np.asarray(part, dtype=np.intp)) for part in (rows, columns))
    called = (entries[name] if count else "NULL" for name in SWITCHES)
    return initial(*called, len(kernels.manifest.crossings) if count else 0, len(rows), *arrays)


def _held(nlp: Transcription, mode: Mode) -> Index:
    """2 for closed surfaces, 1 for others, 0 for those that hold nothing back."""
    held = np.ones(nlp.problem.model.nc, dtype=np.intp)
    numbers = nlp.problem.touch.contacts.surface_numbers
    held[[numbers[name] for name in nlp.problem.ignored]] = 0
    held[nlp.problem.touch.contacts.pull] = 0
    held[list(mode.closed)] = 2
    return held


def together_text(c: Constants, nlp: Transcription, entries: Mapping[str, str]) -> str:
    """What parameters must be together."""
    model, varies = nlp.problem.model, _varies(nlp)
    kinds = np.where(varies, 0, 1 + model.paired)
    mass = is_positive(model.mass(nlp.problem.start_position))
    friction, tangential = (entries.get(name, "NULL") for name in OF_PARAMETERS)
    return initial(int(mass), len(kinds), friction, c.array("int", kinds), tangential)


def laws_text(c: Constants, nlp: Transcription, entries: Mapping[str, str]) -> str:
    """Which coefficients of the laws of the model depend on the motion."""
    touch, model, varies = nlp.problem.touch, nlp.problem.model, _varies(nlp)
    hit = np.full(nlp.layout.phases, NOWHERE)
    for i, event in enumerate(touch.events):
        if event.hit != NOWHERE and np.isnan(nlp.problem.restitution_values[event.hit]):
            hit[i] = event.hit
    rubs = np.where(touch.rubs & varies, 1 + model.paired, 0)
    struck = np.zeros_like(rubs)
    struck[: len(touch.events)] = (touch.rubs_in_impact | touch.passes) & varies
    arrays = (c.array("int", a) for a in (hit, rubs, struck))
    return initial(*(entries.get(name, "NULL") for name in KERNELS), *arrays)


def _varies(nlp: Transcription) -> NDArray[np.bool_]:
    """The tangents whose friction depends on the motion, shape (nt,)."""
    rows = nlp.kernels.manifest.varying_friction
    return np.isin(nlp.kernels.tangents, [row["name"] for row in rows])
