"""The fields of a problem as they are passed: read, checked, and put in their forms."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dmoc.base.arguments import check_known, flag, listed, names, shown
from dmoc.base.discretisation import DISCRETISATIONS
from dmoc.base.errors import ProblemError
from dmoc.codegen.system_kernels import kernels_of, with_momenta
from dmoc.mechanics.model_values import by_name
from dmoc.problem.design import check_design, design_of
from dmoc.problem.ranges import check_size, steps_of
from dmoc.problem.relations import periodic_of

if TYPE_CHECKING:
    from dmoc.problem.problem import Problem

# Order of the kernels of a system, with steps that are given and without.
DEFAULT_ORDER, AUTOMATIC_ORDER = 2, 4


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
    for name in ("start", "goal", "parameters"):
        put(**{name: by_name(getattr(p, name), name)})
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
