"""Kernels of the hidden unknowns s that stand in the place of kinks in the cost and in integrands
(:mod:`dmoc.symbolic.kinks`), one at every quadrature point of a step.

::

    C_s_d = h sum_i b_i C_s(q_i, v_i, u_i, s_i, t_i)      what they add to the cost
    l_d   = l(q_i, v_i, u_i, s_i, t_i) >= 0               their limits
    s     = the functions that they are at a minimum, of states
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import sympy as sp

from dmoc.base.names import name_of
from dmoc.symbolic.continuous import Continuous
from dmoc.symbolic.discrete import StepElement
from dmoc.symbolic.expressions import atoms_of
from dmoc.symbolic.kernel_family import family, parameters, state_inputs, with_more
from dmoc.symbolic.kinks import split
from dmoc.symbolic.spec import Input, KernelSpec

if TYPE_CHECKING:
    from dmoc.symbolic.system import MechanicalSystem


def with_hidden(
    name: str, text: str, step: tuple[Input, ...], outputs: Mapping[str, Sequence[Any]],
    e: StepElement, par: Input,
) -> list[KernelSpec]:  # fmt: skip
    """Kernels of functions of a step and of its hidden unknowns, if there are any."""
    inputs = (*step, Input("s", e.s)) if e.s else step
    chain, spread = (with_more(way, e.s) for way in (e.chain, e.spread))
    return family(name, text, inputs, outputs, par, chain, spread, e.definitions)


def hidden_kernels(
    system: MechanicalSystem, plain: Continuous, f: Continuous, e: StepElement,
    step: tuple[Input, ...],
) -> list[KernelSpec]:  # fmt: skip
    """Kernels of the hidden unknowns; ``e`` is the element of the split system f, ``plain`` the
    system."""
    if not f.s:
        return []
    kinks = plain.rewritten(system, [own.kink for own in split(system).unknowns])
    values = plain.as_nodes(kinks, f.L.graph)
    *state, par = state_inputs(f)
    text = "What hidden unknowns add to the cost of a step, and their limits."
    outputs = {"C_s_d": [e.integral(lambda f: f.C_s)], "l_d": e.l_d}
    return [
        *with_hidden("lifted", text, step, outputs, e, parameters(f)),
        *family("hidden", "What hidden unknowns are at a minimum.", tuple(state), {"s": values},
                par, second=False),
    ]  # fmt: skip


def hidden_facts(system: MechanicalSystem) -> dict[str, Any]:
    """What programs need to know of hidden unknowns: the numbers of their limits, the integrals
    that they belong to, empty for the cost, and in which sense these are split; nothing where there
    are none."""
    parts = split(system)
    if not parts.unknowns:
        return {}
    return {
        "hidden_limits": [len(own.limits) for own in parts.unknowns],
        "hidden_of": [own.of for own in parts.unknowns],
        "senses": dict(parts.senses),
    }


def hidden_names(system: MechanicalSystem) -> list[str]:
    """Names of the hidden unknowns."""
    return [f"the unknown for {sp.sstr(_named(own.kink))}" for own in split(system).unknowns]


def _named(e: Any) -> Any:
    """An expression with names instead of functions of time and their derivatives."""
    return e.xreplace({s: sp.Symbol(name_of(s)) for s in atoms_of(e)})
