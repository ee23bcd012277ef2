"""Which numbers of a problem a solver of its own takes at run time, and which entries of the
program each moves.

A problem that differs in one number has the same structure and other
:class:`~dmoc.program.elements.Numbers`, by which some entries of its program differ.  A number is
taken where it moves these in proportion, or its place among the parameters; others stay those of
the day of export.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from dmoc.base.arguments import interval
from dmoc.base.errors import ProblemError
from dmoc.base.names import velocity_name
from dmoc.base.records import record
from dmoc.base.tolerances import SAME
from dmoc.codegen.kernels import Array
from dmoc.mechanics.phase_models import ENDS as PHASES
from dmoc.problem.problem import Problem
from dmoc.problem.ranges import Boundary
from dmoc.program.arrays import ElementData, ProgramData
from dmoc.program.blocks import Index
from dmoc.program.bounds import limits
from dmoc.program.elements import Numbers, assembled
from dmoc.program.layout import Layout
from dmoc.program.transcription import Transcription

# Relative change of a number, a power of two: differences have no rounding errors of their own.
CHANGE = 2.0**-6
# How far from in proportion the change of an entry may be, and that of all numbers together.
PROPORTIONAL, TOGETHER = 1e-9, 1e-8
NOT_ONE = -1
SIDES, ENDS = ("low", "high"), ("start", "goal")
# What a number may be, in the order of dmoc_carried.h.
KINDS = ("bound", "share", "time", "earliest time", "state", "parameter")


@record(frozen=True, eq=False)
class Number:
    """A number of a problem: where it is stated, as the field and what leads on from there, its
    side (0 lower, 1 upper) where that is a range, and its value.

    ``pool`` is its place among the parameters, of the first of the ``phases`` that have its value,
    ``entries`` and ``slopes`` say what it moves in the arrays of :func:`moved_arrays`, one after
    the other; ``way`` is the direction in which it was tried.
    """

    path: tuple[str | int, ...]
    value: float
    side: int | None = None
    kind: str = "bound"  # of KINDS: what it may be
    pool: int = NOT_ONE
    phases: int = 1
    entries: Index = field(default_factory=lambda: np.zeros(0, np.intp))
    slopes: Array = field(default_factory=lambda: np.zeros(0))
    way: float = 1.0

    @property
    def name(self) -> str:
        return ".".join(map(str, (*self.path, *(() if self.side is None else (SIDES[self.side],)))))

    @property
    def change(self) -> float:
        """The change of the number with which its effects are found."""
        return self.way * CHANGE * float(2.0 ** np.ceil(np.log2(max(abs(self.value), 1e-3))))

    def changed(self, problem: Problem, steps: float) -> Problem:
        """A problem with the number changed by some steps."""
        first, *rest = self.path
        value: Any = self.value + steps * self.change
        if self.side is not None:
            stated = _field(problem, str(first))
            for key in rest:
                stated = stated[key]
            ends = list(interval(stated, self.name))
            ends[self.side] = value
            value = _range(*ends)
        for k in range(len(rest), 0, -1):
            value = _with(_field(problem, str(first)), rest[: k - 1], rest[k - 1], value)
        return _with_field(problem, str(first), value)


def _field(problem: Problem, name: str) -> Any:
    """A field of a problem; of restitution the coefficients by surface, of periodic the differences
    by state."""
    if name == "restitution":
        values = problem.restitution_values.tolist()
        return dict(zip(problem.kernels.surfaces, values, strict=True))
    if name == "periodic":
        return {r.end: _range(r.low, r.high) for r in problem.relations}
    return getattr(problem, name)


def _with_field(problem: Problem, name: str, value: Any) -> Problem:
    """A problem with what :func:`_field` has replaced."""
    if name == "restitution":
        value = {surface: e for surface, e in value.items() if not np.isnan(e)}
    if name == "periodic":
        value = {r.end: (dict(r.terms), value[r.end]) for r in problem.relations}
    return problem.unchecked(**{name: value})


def _range(low: float, high: float) -> Any:
    """Bounds as they are stated."""
    if low == high:
        return low
    return tuple(None if np.isinf(end) else end for end in (low, high))


def _with(whole: Any, way: Sequence[str | int], key: Any, value: Any) -> Any:
    """A field at some place, with one member replaced."""
    for step in way:
        whole = whole[step]
    if isinstance(whole, Mapping):
        return {**whole, key: value}
    return [value if i == key else other for i, other in enumerate(whole)]


@record(frozen=True, eq=False)
class FixedState:
    """A fixed state at one end: names of the numbers of q and v, "" where there is none; values;
    the unknowns that are its momenta."""

    names: tuple[str, ...]
    values: Array
    momenta: Index


States = tuple[FixedState | None, FixedState | None]  # at the start and at the goal


@dataclass(frozen=True)
class PassResult:
    """A result of an element of a pass, by their numbers."""

    of_pass: int
    element: int
    output: int

    def factors(self, data: ProgramData) -> Array:
        """The factors of a result in a program, shape (entries,)."""
        return passes_of(data)[self.of_pass][self.element].factors[self.output].ravel()


@dataclass(frozen=True)
class SolverNumbers:
    """What a solver takes, what it does not, the states at both ends that are fixed, and the
    results of elements whose factors numbers move."""

    taken: tuple[Number, ...]
    kept: tuple[str, ...]
    states: States
    results: tuple[PassResult, ...]


def moved_arrays(data: ProgramData, results: Sequence[PassResult]) -> list[Array]:
    """The arrays that numbers move: lower and upper bounds, constants, coefficients, constants of
    the slopes, and the factors of some results, one after the other."""
    return [
        data.lower, data.upper, data.values.constant, data.values.coefficients,
        data.slopes.constant, np.concatenate([np.zeros(0), *(r.factors(data) for r in results)]),
    ]  # fmt: skip


def _results(data: ProgramData) -> list[PassResult]:
    """The results of all elements."""
    return [
        PassResult(i, j, k)
        for i, elements in enumerate(passes_of(data))
        for j, element in enumerate(elements)
        for k in range(len(element.factors))
    ]


def passes_of(data: ProgramData) -> list[tuple[ElementData, ...]]:
    return [p.elements for p in (data.values, data.slopes, data.curvatures)]


def numbers_of(nlp: Transcription) -> SolverNumbers:
    """Try all numbers of the problem of a program."""
    problem, base = nlp.problem, nlp.numbers
    states = _states(problem, nlp.layout)
    none = np.zeros(0, dtype=np.intp)
    fixed = np.concatenate([none, *(s.momenta for s in states if s is not None)])
    taken, kept = list[Number](), list[str]()
    for number in _stated(problem, states):
        tried = _tried(nlp, base, number, fixed, states)
        idle = tried is not None and tried.pool == NOT_ONE and not len(tried.entries)
        if tried is None or (idle and not any(s and tried.name in s.names for s in states)):
            kept.append(number.name)
        else:
            taken.append(tried)
    if not _add_up(nlp, base, taken, fixed):
        kept += [n.name for n in taken if n.pool != NOT_ONE and len(n.entries)]
        taken = [n for n in taken if n.pool == NOT_ONE or not len(n.entries)]
    data = nlp.assembled.data
    return _in_short(data, SolverNumbers(tuple(taken), tuple(kept), states, tuple(_results(data))))


def _in_short(data: ProgramData, numbers: SolverNumbers) -> SolverNumbers:
    """The same numbers with only those factors that are moved, which come last."""
    others = sum(map(len, moved_arrays(data, ())))
    counts = np.array([r.factors(data).size for r in numbers.results])
    ends, moved = others + np.cumsum(counts), np.zeros(len(counts), dtype=bool)
    for n in numbers.taken:
        moved[np.searchsorted(ends, n.entries[n.entries >= others], side="right")] = True
    gone = np.concatenate([np.zeros(others, np.intp), np.repeat(~moved, counts).cumsum()])
    taken = tuple(replace(n, entries=n.entries - gone[n.entries]) for n in numbers.taken)
    results = tuple(r for r, is_moved in zip(numbers.results, moved, strict=True) if is_moved)
    return replace(numbers, taken=taken, results=results)


def _stated(problem: Problem, states: Sequence[FixedState | None]) -> Iterator[Number]:
    """All numbers of a problem."""
    yield from _parameters(problem)
    for end, state in zip(ENDS, states, strict=True):
        still = [n.removeprefix(f"{end}.") for n in state.names if n] if state else []
        for name, stated in (dict.fromkeys(still, 0.0) | dict(getattr(problem, end))).items():
            yield from _ends((end, name), stated, "state")
    yield from _ends(("final_time",), problem.final_time, "time")
    for i, value in enumerate(problem.durations or ()):
        if problem.phase_steps[i]:  # the phase after the last event has no duration
            yield from _ends(("durations", i), value, "time")
    for part in ("bounds", "design"):
        for name, value in getattr(problem, part).items():
            yield from _ends((part, name), value)
    for i, places in enumerate(problem.via or ()):
        for name, value in (places or {}).items():
            yield from _ends(("via", i, name), value, "state")
    hits = {problem.kernels.surfaces[event.hit] for event in problem.touch.events if event.hit >= 0}
    for name, e in _field(problem, "restitution").items():
        if name in hits and not np.isnan(e):
            yield Number(("restitution", name), e, kind="share")
    for name, value in _field(problem, "periodic").items():
        if value:
            yield from _ends(("periodic", name), value)


def _parameters(problem: Problem) -> Iterator[Number]:
    """The parameters, of those that change a value for each phase."""
    rows, changing = problem.parameter_values, problem.models.changing
    for j, name in enumerate(problem.kernels.parameters):
        if name in problem.design:
            continue
        if name not in changing:
            only = float(rows[0, j])
            yield Number(("parameters", name), only, kind="parameter", pool=j, phases=len(rows))
            continue
        for i, value in enumerate(map(float, rows[:, j])):
            pool = i * rows.shape[1] + j
            yield Number(("parameters", name, i), value, kind="parameter", pool=pool)


def _ends(path: tuple[str | int, ...], value: Any, kind: str = "bound") -> Iterator[Number]:
    """The number of a value, or those of a range."""
    low, high = interval(value, ".".join(map(str, path)))
    if low == high:
        yield Number(path, low, kind=kind)
        return
    for side, end in enumerate((low, high)):
        if np.isfinite(end):
            earliest = kind == "time" and not side
            yield Number(path, end, side, kind="earliest time" if earliest else kind)


def _states(problem: Problem, lay: Layout) -> States:
    """The states at both ends."""
    start, goal = (_state(problem, lay, end) for end in ENDS)
    return start, goal


def _state(problem: Problem, lay: Layout, end: str) -> FixedState | None:
    """The state at an end, where position and velocity are fixed and momenta stand for them."""
    boundary: Boundary = problem.start_bounds if end == "start" else problem.goal_bounds
    place = boundary.position
    if not boundary.by_velocity or problem.design or (place[:, 0] != place[:, 1]).any():
        return None
    stated, names = getattr(problem, end), problem.kernels.coordinates
    p = lay.index_p_B if end == "start" else lay.index_p_E
    velocities = [velocity_name(q) for q in names]
    model = problem.models[PHASES[end]]
    v = model.velocity(place[:, 0], boundary.momentum[:, 0])
    stated_v = [stated.get(name) for name in velocities]
    values = [x if isinstance(x, (int, float)) else y for x, y in zip(stated_v, v, strict=True)]
    if problem.kernels.joints:  # what is not said is what the constraints make of it
        velocities = [n if x is not None else "" for n, x in zip(velocities, stated_v, strict=True)]
    q_names = [f"{end}.{q}" if stated.get(q) is not None else "" for q in names]
    v_names = [f"{end}.{name}" if name else "" for name in velocities]
    return FixedState((*q_names, *v_names), np.array([*place[:, 0], *values], dtype=float), p)


def _tried(
    nlp: Transcription, base: Numbers, number: Number, fixed: Index, states: States
) -> Number | None:
    """A number with what it moves; None where it moves something else, or not in proportion."""
    for way in (1.0, -1.0):
        tried = replace(number, way=way)
        try:
            moved = [other for k in (1.0, 2.0) if (other := _moved(nlp, base, tried, k))]
        except (ProblemError, ValueError, FloatingPointError):
            continue
        if len(moved) < 2:
            continue
        if _moves_unsaid(states, _states(tried.changed(nlp.problem, 1.0), nlp.layout)):
            continue
        before, *after = (_flat(nlp, other, fixed) for other in (base, *moved))
        if any((np.isfinite(a) != np.isfinite(before)).any() for a in after):
            continue
        with np.errstate(invalid="ignore"):
            one, two = (np.where(np.isfinite(before), a - before, 0.0) for a in after)
        error = PROPORTIONAL * np.abs(one) + 1e-13 * np.abs(np.nan_to_num(before, posinf=0.0))
        if not (np.abs(two - 2 * one) <= error + 1e-300).all():
            continue
        at = np.flatnonzero(one)
        return replace(tried, entries=at, slopes=one[at] / tried.change)
    return None


def _moves_unsaid(states: States, moved: States) -> bool:
    """Whether velocities of fixed states move that have no number, since constraints decide them:
    a solver keeps what they were."""
    for before, after in zip(states, moved, strict=True):
        if before is None or after is None:
            continue
        off = np.abs(after.values - before.values)[[not name for name in before.names]]
        if (off > SAME * np.abs(before.values).max(initial=0.0)).any():
            return True
    return False


def _moved(nlp: Transcription, base: Numbers, number: Number, steps: float) -> Numbers | None:
    """The numbers of the program with one changed by some steps; None where more differs.

    A state at an end is bounds alone.  Where constraints hold it, one number of it fits them with
    others only: until these are changed, too, the program has rows for what does not fit.  The rows
    are those of states that fit; a solver sees whether they do.
    """
    problem = number.changed(nlp.problem, steps)
    other = _stating(nlp, problem)
    at_end = number.path[0] in ENDS and number.path[-1] in problem.states
    if at_end and other.n == nlp.n and (other.n_eq + other.n_in) != (nlp.n_eq + nlp.n_in):
        bounds = limits(problem, nlp.layout, nlp.laws, nlp.scale, ())
        lower, upper = (bound / nlp.sizes for bound in bounds)
        return replace(base, lower=lower, upper=upper)
    return _numbers(nlp, other)


def _stating(nlp: Transcription, problem: Problem) -> Transcription:
    """The program of another problem in the same sizes."""
    with np.errstate(all="ignore"):
        return Transcription(problem, nlp.scale)


def _numbers(nlp: Transcription, other: Transcription) -> Numbers | None:
    """What a program differs in from that of a solver; None where its form is another one."""
    with np.errstate(all="ignore"):
        same = other.structure.form.digest == nlp.structure.form.digest
        same = same and np.array_equal(other.row_sizes, nlp.row_sizes)
        return other.numbers if same else None


def _flat(nlp: Transcription, numbers: Numbers, fixed: Index) -> Array:
    """The arrays that numbers move, without the momenta that follow from states."""
    data = assembled(nlp.structure, numbers).data
    arrays = [a.copy() for a in moved_arrays(data, _results(data))]
    arrays[0][fixed] = arrays[1][fixed] = 0.0
    return np.concatenate(arrays)


def _add_up(nlp: Transcription, base: Numbers, numbers: Sequence[Number], fixed: Index) -> bool:
    """Whether what the numbers move adds up where all are changed together."""
    problem, expected = nlp.problem, _flat(nlp, base, fixed)
    held = bool(problem.held)  # then states fit together or not at all
    for number in numbers:
        if held and number.path[0] in ENDS:
            continue
        problem = number.changed(problem, 1.0)
        expected[number.entries] += number.slopes * number.change
    try:
        combined = _numbers(nlp, _stating(nlp, problem))
    except (ProblemError, ValueError):
        return False
    if combined is None:
        return False
    moved = _flat(nlp, combined, fixed)
    return bool(np.isclose(moved, expected, rtol=TOGETHER, atol=TOGETHER).all())
