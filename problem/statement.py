"""The statement of a problem: its fields as they are passed, read and put in their forms, and its
table, in the words that it was stated in."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from dmoc.base.arguments import check_known, flag, listed, names, shown
from dmoc.base.discretisation import DISCRETISATIONS
from dmoc.base.errors import ProblemError
from dmoc.base.table import Table
from dmoc.codegen.system_kernels import kernels_of, with_momenta
from dmoc.mechanics.model_values import by_name, parameter_in_words
from dmoc.motion.attitude import Attitude
from dmoc.problem.attitudes import read_attitudes
from dmoc.problem.design import check_design, design_of
from dmoc.problem.ranges import check_size, steps_of
from dmoc.problem.relations import periodic_of

if TYPE_CHECKING:
    from dmoc.problem.problem import Problem

# Order of the kernels of a system, with steps that are given and without.
DEFAULT_ORDER, AUTOMATIC_ORDER = 2, 4


def statement_in_short(problem: Problem) -> str:
    """Sequence, steps and order in one line."""
    return f"{_sequence(problem)}; {_steps(problem)}, order {problem.order}"


def table_of_problem(problem: Problem) -> Table:
    """The statement, one line for each part that was given."""
    rows = tuple((name, text) for name, text in _rows(problem) if text)
    return Table(rows, title=f"problem of {problem.kernels.name}")


def _rows(p: Problem) -> Iterator[tuple[str, str]]:
    yield "model", p.kernels.manifest.title
    yield "sequence", _sequence(p)
    yield "start", _states(p.start)
    yield "closed at the start", ", ".join(p.contacts)
    yield "goal", _states(p.goal) or "free"
    yield "periodic", ", ".join(_relation(r) for r in p.relations)
    for i, places in enumerate(p.via or ()):
        yield f"via at event {i + 1}", _states(places or {})
    low, high = p.final_time_bounds
    yield "final time", _range(low, high, " s") or "free"
    for i, (low, high) in enumerate(p.duration_bounds if p.durations is not None else ()):
        yield (
            f"phase {i}",
            "ends with its event" if high == 0 else _range(low, high, " s") or "free",
        )
    yield "bounds", ", ".join(f"{name}: {_said(value)}" for name, value in p.bounds.items())
    stated = (f"{n} = {parameter_in_words(value)}" for n, value in p.parameters.items())
    yield "parameters", ", ".join(stated)
    yield "design", ", ".join(f"{name}: {_said(value)}" for name, value in p.design.items())
    if p.kernels.surfaces:
        restitution = zip(p.kernels.surfaces, p.restitution_values, strict=True)
        laws = p.kernels.manifest.restitution
        closing = {place for places in p.kernels.manifest.grips.values() for place in places}
        values = {
            name: laws[name] if np.isnan(e) else f"{e:g}"
            for name, e in restitution
            if name not in closing
        }
        same = len(set(values.values())) == 1
        each = ", ".join(f"{name} {e}" for name, e in values.items())
        yield "restitution", next(iter(values.values())) if same else each
    tangential = p.kernels.manifest.tangential_restitution
    yield "tangential restitution", ", ".join(f"{name} {e}" for name, e in tangential.items())
    laws = p.kernels.manifest.impact_laws
    yield "impact law", ", ".join(f"{name} {law}" for name, law in laws.items())
    yield "ignored", ", ".join(p.ignored)
    yield "mesh", f"{_steps(p)}, order {p.order}, {p.control_form} inputs"


def _sequence(p: Problem) -> str:
    return ", ".join(p.sequence) or "no collision"


def _steps(p: Problem) -> str:
    if p.steps is None:
        return "chosen and refined"
    return f"{' + '.join(map(str, p.phase_steps))} steps"


def _states(states: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} {_said(value, '= ')}" for name, value in states.items())


def _said(value: Any, equal: str = "") -> str:
    """A value, a range or nothing, as it was given."""
    if value is None:
        return "free"
    if isinstance(value, (tuple, list, np.ndarray)) and len(value) == 2:
        low, high = (
            limit if bound is None else float(bound)
            for bound, limit in zip(value, (-np.inf, np.inf), strict=True)
        )
        return _range(low, high) or "free"
    if isinstance(value, Attitude):
        return f"{equal}({', '.join(f'{x:g}' for x in value.quaternion)})"
    return f"{equal}{float(value):g}"


def _range(low: float, high: float, unit: str = "") -> str:
    """A range of numbers; nothing where it has no end."""
    if low == high:
        return f"{low:g}{unit}"
    if low in (0.0, -np.inf) and high == np.inf and unit:
        return ""
    if not np.isfinite(low) and not np.isfinite(high):
        return ""
    if not np.isfinite(low) or (unit and low == 0.0):
        return f"at most {high:g}{unit}"
    if not np.isfinite(high):
        return f"at least {low:g}{unit}"
    return f"{low:g} to {high:g}{unit}"


def _relation(relation: Any) -> str:
    further = (
        ""
        if relation.low == relation.high == 0
        else (f" + {_range(relation.low, relation.high) or 'any'}")
    )
    return f"{relation.end} ends as {relation.source}{further}"


def read(problem: Problem) -> None:
    """Put the fields of a problem into their forms; the kernels of a system are built."""

    def put(**values: Any) -> None:
        for name, value in values.items():
            object.__setattr__(problem, name, value)

    p = problem
    put(
        sequence=tuple(names(p.sequence, "sequence", "surfaces")),
        contacts=tuple(names(p.contacts, "contacts", "surfaces")),
    )
    put(design=design_of(p.design))
    model, bounds = with_momenta(p.kernels, by_name(p.bounds, "bounds"))
    put(kernels=kernels_of(model, _order(p), list(p.design)), bounds=bounds)
    put(design={name: p.design[name] for name in p.kernels.parameters if name in p.design})
    put(parameters=by_name(p.parameters, "parameters"))
    for name in ("start", "goal"):
        put(**{name: read_attitudes(p.kernels, by_name(getattr(p, name), name), name)})
    if not isinstance(p.control_form, str) or p.control_form not in p.scheme.controls:
        raise ProblemError(
            f"controls = {shown(p.controls)}: expected one of {', '.join(p.scheme.controls)} with "
            f"kernels of order {p.order}."
        )
    put(ignored=tuple(names(p.ignored, "ignored", "surfaces")))
    for name in p.ignored:
        check_known(name, p.kernels.surfaces, "surface", "in ignored")
    put(minimal_times=flag(p.minimal_times, "minimal_times"))
    check_design(p)
    if p.durations is not None:
        put(durations=tuple(listed(p.durations, "durations", "ranges, one for each phase")))
    put(steps=steps_of(p))
    check_size(p)
    put(periodic=periodic_of(p))
    if p.via is not None:
        put(via=tuple(listed(p.via, "via", "mappings, one for each event")))


def _order(problem: Problem) -> int:
    """The order of the kernels of a system: the lower one where the inputs have one of its forms
    alone."""
    order = AUTOMATIC_ORDER if problem.steps is None else DEFAULT_ORDER
    other_form = isinstance(problem.controls, str) and (
        problem.controls not in DISCRETISATIONS[order].controls
    )
    return DEFAULT_ORDER if other_form else order
