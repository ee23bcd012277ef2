"""A problem as its table: what was stated, in the words it was stated in."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from dmoc.base.table import Table

if TYPE_CHECKING:
    from dmoc.problem.problem import Problem


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
    yield "parameters", ", ".join(f"{name} = {value:g}" for name, value in p.parameters.items())
    yield "design", ", ".join(f"{name}: {_said(value)}" for name, value in p.design.items())
    if p.kernels.surfaces:
        restitution = zip(p.kernels.surfaces, p.restitution_values, strict=True)
        laws = p.kernels.manifest.restitution
        values = {name: laws[name] if np.isnan(e) else f"{e:g}" for name, e in restitution}
        same = len(set(values.values())) == 1
        each = ", ".join(f"{name} {e}" for name, e in values.items())
        yield "restitution", next(iter(values.values())) if same else each
    tangential = p.kernels.manifest.tangential_restitution
    yield "tangential restitution", ", ".join(f"{name} {e}" for name, e in tangential.items())
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
