"""Integrals of a model, and an objective of totals, ends of the motion, final time and peaks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import sympy as sp
from sympy.core.function import AppliedUndef

from dmoc.base.errors import ModelError
from dmoc.base.signatures import public
from dmoc.symbolic.continuous import Continuous
from dmoc.symbolic.conversion import to_nodes
from dmoc.symbolic.discrete import StepElement
from dmoc.symbolic.event_sums import hit_quantities, references_in
from dmoc.symbolic.expressions import OF_HITS, atoms_of, expression_in, final_time, reference
from dmoc.symbolic.hidden_unknowns import with_hidden
from dmoc.symbolic.kernel_family import family, parameters, state_inputs
from dmoc.symbolic.kinks import check_smooth, split
from dmoc.symbolic.spec import Input, KernelSpec, Output

if TYPE_CHECKING:
    from dmoc.symbolic.system import MechanicalSystem

TOTAL, PEAK, LARGEST, START, END = "total", "peak", "largest", "at_start", "at_end"


@public(ModelError)
def total(name: str) -> Any:
    """The value of an integral of the model, in an objective.

    Parameters
    ----------
    name : str
        One of the ``integrals`` of the model.

    Returns
    -------
    Expr

    Raises
    ------
    ModelError
        If it is no name.

    Examples
    --------
    >>> import dmoc
    >>> dmoc.total("effort") / dmoc.final_time
    total(effort)/final_time
    """
    return reference(TOTAL, name, "an integral", "effort")


@public(ModelError)
def peak(name: str) -> Any:
    """The largest value of a quantity along the motion, in an objective that does not fall
    with it; of one of hits, such as :func:`dmoc.impulse`, the largest of them, and at least 0.

    Parameters
    ----------
    name : str
        One of the ``quantities`` of the model.

    Returns
    -------
    Expr

    Raises
    ------
    ModelError
        If it is no name.

    Examples
    --------
    >>> import dmoc
    >>> 2 * dmoc.peak("push")
    2*peak(push)
    """
    return reference(PEAK, name, "a quantity", "effort")


@public(ModelError)
def largest(name: str) -> Any:
    """The largest magnitude of a quantity along the motion, in an objective that does not fall
    with it; of one of hits that of all of them.

    Parameters
    ----------
    name : str
        One of the ``quantities`` of the model.

    Returns
    -------
    Expr

    Raises
    ------
    ModelError
        If it is no name.

    Examples
    --------
    >>> import dmoc
    >>> dmoc.largest("push") ** 2
    largest(push)**2
    """
    return reference(LARGEST, name, "a quantity", "effort")


@public(ModelError)
def at_start(expression: Any) -> Any:
    """What an expression is at the start of the motion, in an objective.

    Parameters
    ----------
    expression : Expr
        In coordinates, velocities and parameters.

    Returns
    -------
    Expr

    Raises
    ------
    ModelError
        If it is no scalar expression.

    Examples
    --------
    >>> import dmoc
    >>> from sympy.physics.mechanics import dynamicsymbols
    >>> x = dynamicsymbols("x")
    >>> dmoc.at_start(x.diff()) ** 2
    at_start(Derivative(x(t), t))**2
    """
    return sp.Function(START)(expression_in(expression, "at_start"))


@public(ModelError)
def at_end(expression: Any) -> Any:
    """What an expression is at the end of the motion, in an objective.

    Parameters
    ----------
    expression : Expr
        In coordinates, velocities and parameters.

    Returns
    -------
    Expr

    Raises
    ------
    ModelError
        If it is no scalar expression.

    Examples
    --------
    >>> import dmoc
    >>> from sympy.physics.mechanics import dynamicsymbols
    >>> x = dynamicsymbols("x")
    >>> 1 / dmoc.at_end(x)
    1/at_end(x(t))
    """
    return sp.Function(END)(expression_in(expression, "at_end"))


@dataclass(frozen=True)
class Objective:
    """What an objective is made of: names of its integrals, with "final_time" for the final time;
    its peaks, quantities and whether of both signs, those of hits last; expressions at the start
    and at the end."""

    value: Any
    totals: tuple[str, ...]
    peaks: tuple[tuple[str, bool], ...]
    starts: tuple[Any, ...]
    ends: tuple[Any, ...]


def objective_of(system: MechanicalSystem) -> Objective:
    """The parts of the objective of a system."""
    value = system.objective
    by_kind: dict[str, list[Any]] = {}
    for part in sorted(value.atoms(AppliedUndef), key=str):
        by_kind.setdefault(part.func.__name__, []).append(part)
    timed = [final_time.name] * value.has(final_time)
    of_hits = {t.name for t in hit_quantities(system)}
    peaks = [
        (part.args[0].name, kind == LARGEST)
        for kind in (PEAK, LARGEST)
        for part in by_kind.get(kind, ())
    ]
    return Objective(
        value,
        (*system.integrals, *timed),
        tuple(sorted(peaks, key=lambda peak: peak[0] in of_hits)),
        tuple(by_kind.get(START, ())),
        tuple(by_kind.get(END, ())),
    )


def check_objective(system: MechanicalSystem) -> None:
    """Refuse an objective of what it cannot be made of."""
    for name, value in system.integrands.items():
        check_smooth(value, f"integral {name!r}")
    parts = objective_of(system)
    check_smooth(parts.value, "the objective", kinks=True)
    quantities = {**system.quantities, **system.quantities_along}
    names_by_kind = {TOTAL: system.integrals, PEAK: quantities, LARGEST: quantities}
    for part in sorted(parts.value.atoms(AppliedUndef), key=str):
        names = names_by_kind.get(part.func.__name__)
        if names is not None and part.args[0].name not in names:
            what = "an integral" if part.func.__name__ == TOTAL else "a quantity"
            raise ModelError(
                f"the objective contains {part}: expected the name of {what} of the model, one of "
                f"{', '.join(names) or 'none'}."
            )
    for end, own in (("start", parts.starts), ("end", parts.ends)):
        allowed = {*system.coordinates, *system.velocities, *system.parameters}
        for part in own:
            for atom in sorted(atoms_of(part.args[0]) - allowed, key=str):
                raise ModelError(
                    f"the objective contains {atom} at the {end}: expected coordinates, "
                    "velocities and parameters."
                )
    kinds = (*names_by_kind, START, END)
    references = {p for p in parts.value.atoms(AppliedUndef) if p.func.__name__ in kinds}
    if hits := references_in(parts.value):
        raise ModelError(
            f"the objective contains dmoc.{hits[0]}, {OF_HITS}; price dmoc.total of such an "
            "integral, or dmoc.peak of such a quantity."
        )
    rest = parts.value.xreplace({p: sp.Dummy() for p in references})
    for atom in sorted(atoms_of(rest) - {*system.parameters, final_time}, key=str):
        if not isinstance(atom, sp.Dummy):
            raise ModelError(
                f"the objective contains {atom}, whose time is not said: expected parameters, "
                "dmoc.total, dmoc.peak, dmoc.largest, dmoc.at_start, dmoc.at_end and "
                "dmoc.final_time."
            )
    for name, both in parts.peaks:
        of = (largest if both else peak)(name)
        slope = parts.value.diff(of)
        if slope.is_number and slope < 0:
            raise ModelError(
                f"the objective falls with {of}: it has no minimum, since nothing bounds a peak "
                "from above; give it a positive factor."
            )
    for name, sense in split(system).senses.items():
        slope = parts.value.diff(total(name))
        if slope.is_number and sense * slope < 0:
            ways = ("falls", "above", "positive") if sense > 0 else ("rises", "below", "negative")
            raise ModelError(
                f"the objective {ways[0]} with {total(name)}, whose integrand has kinks: the "
                f"unknowns in their place are not held from {ways[1]}; give it a {ways[2]} factor."
            )


def objective_facts(system: MechanicalSystem) -> dict[str, Any]:
    """What programs need to know of integrals and objective; nothing where there are none."""
    parts = objective_of(system)
    if not parts.totals and parts.value == 0:
        return {}

    def rates(own: Sequence[Any]) -> bool:
        return any(part.has(v) for part in own for v in system.velocities)

    priced = [name for name in system.integrals if parts.value.has(total(name))]
    of_hits = _numbered(parts.peaks, [t.name for t in hit_quantities(system)])
    return {
        "totals": list(parts.totals),
        "priced": priced,
        "peaks": _numbered(parts.peaks, system.quantities_along),
        "objective": parts.value != 0,
        "objective_velocities": [rates(parts.starts), rates(parts.ends)],
    } | ({"hit_peaks": of_hits} if of_hits else {})


def _numbered(peaks: Sequence[tuple[str, bool]], names: Iterable[str]) -> list[list[Any]]:
    """Those of some peaks whose quantities are among names, by the numbers of these."""
    numbers = {name: i for i, name in enumerate(names)}
    return [[numbers[name], both] for name, both in peaks if name in numbers]


def objective_kernels(
    system: MechanicalSystem, plain: Continuous, f: Continuous, e: StepElement,
    step: tuple[Input, ...],
) -> list[KernelSpec]:  # fmt: skip
    """Kernels of the integrals over a step, and of the objective."""
    parts, par, graph = objective_of(system), parameters(f), f.L.graph
    kernels = []
    if parts.totals:
        # The final time is the integral of one.
        values = [e.integral(partial(_integrand, n)) for n in range(len(parts.totals))]
        text = "Integrals of the model over a step."
        kernels += with_hidden("integral", text, step, {"I_d": values}, e, par)
    if parts.value == 0:
        return kernels
    n = len(f.q)
    sizes = len(parts.totals), len(parts.peaks), n, n, n, n
    names = dict(zip(("I", "peaks", "q_B", "v_B", "q_E", "v_E"), sizes, strict=True))
    inputs = {name: Input.vector(graph, name, count) for name, count in names.items()}
    symbols = {
        name: sp.symbols([f"{name}_{i}" for i in range(count)], real=True)
        for name, count in names.items()
    }
    table: dict[Any, Any] = {}
    totals = [*map(total, system.integrals), final_time]  # the last one where it is a total
    table |= dict(zip(totals, symbols["I"], strict=False))
    for i, (name, both) in enumerate(parts.peaks):
        table[(largest if both else peak)(name)] = symbols["peaks"][i]
    for end, own in (("B", parts.starts), ("E", parts.ends)):
        there = *symbols[f"q_{end}"], *symbols[f"v_{end}"]
        places = dict(zip((*plain.q, *plain.v), there, strict=True))
        written = plain.rewritten(system, [part.args[0] for part in own])
        table |= {part: value.xreplace(places) for part, value in zip(own, written, strict=True)}
    table_of_par = dict(zip(system.parameters, plain.par, strict=True))
    value = parts.value.xreplace(table).xreplace(table_of_par)
    nodes = {s: graph.symbol(s.name) for s in plain.par}
    for name, own_symbols in symbols.items():
        nodes |= dict(zip(own_symbols, inputs[name].symbols, strict=True))
    text = "The objective of totals, peaks and the states at both ends."
    kernels += family(
        "objective", text, tuple(inputs.values()), {"J": to_nodes(graph, [value], nodes)}, par
    )
    return kernels


def integrand_kernels(f: Continuous) -> list[KernelSpec]:
    """Integrands as they were stated, for the check."""
    if not f.c:
        return []
    text = "Integrands c as they were stated."
    return [KernelSpec("integrand", text, state_inputs(f), (Output.vector("c", f.c),))]


def _integrand(number: int, f: Continuous) -> Any:
    """An integrand of the system; one behind the last."""
    return f.c[number] if number < len(f.c) else f.L.graph.one
