"""A kernel with its derivatives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from dmoc.symbolic.continuous import dot
from dmoc.symbolic.spec import Input, KernelSpec, Output


def family(
    name: str,
    summary: str,
    inputs: tuple[Input, ...],
    outputs: dict[str, Sequence[Any]],
    par: Input,
    derive: Callable[[Any, int], Any] | None = None,
    definitions: tuple[tuple[Any, Any], ...] = (),
    second: bool = True,
) -> list[KernelSpec]:
    """A kernel with its derivatives with respect to all components of ``inputs``, in this order.

    ``name`` has the values; ``name_jac`` the matrices ``a_D`` of their first derivatives, one for
    each output a; ``name_hess``, where second ones are wanted, the upper triangle of the second
    derivatives of sum_a w_a . a, with the weights w_a of every output as further inputs, in the
    order of the outputs.  ``derive(e, i)`` is the derivative of an expression with respect to
    component i, where that is not a partial one.
    """
    symbols = [s for i in inputs for s in i.symbols]
    size, derivative = len(symbols), derive or (lambda e, i: e.diff(symbols[i]))

    def gradient_of(expression: Any) -> list[Any]:
        return [derivative(expression, i) for i in range(size)]

    arguments, listed = (*inputs, par), ", ".join(i.name for i in inputs)
    values = tuple(Output.vector(a, v) for a, v in outputs.items())
    slopes = tuple(
        Output.matrix(f"{a}_D", [gradient_of(e) for e in v], size) for a, v in outputs.items()
    )
    text = f"First derivatives of `{name}` with respect to ({listed})."
    specs = [
        KernelSpec(name, summary, arguments, values, definitions),
        KernelSpec(f"{name}_jac", text, arguments, slopes, definitions),
    ]
    if second:
        weights = tuple(Input.vector(f"w_{a}", len(v)) for a, v in outputs.items())
        total = dot(
            [s for w in weights for s in w.symbols], [e for v in outputs.values() for e in v]
        )
        first = gradient_of(total)
        rows = [
            [derivative(first[i], j) if j >= i else 0 for j in range(size)] for i in range(size)
        ]
        curvatures = (Output.matrix("hess", rows, size, upper=True),)
        text = f"Second derivatives of the weighted sum of all results of `{name}`."
        specs.append(
            KernelSpec(f"{name}_hess", text, (*arguments, *weights), curvatures, definitions)
        )
    return specs
