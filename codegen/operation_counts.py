"""How much work generated kernels are."""

from __future__ import annotations

import re
from dataclasses import dataclass

from dmoc.codegen.printer import CPrinter, listing
from dmoc.codegen.schedule import functions_of
from dmoc.symbolic.spec import KernelSpec

# Signs of operations; those of exponents, as in 1e-05, are none.
_SIGNS = re.compile(r"(?<![0-9.]e)[-+*/]")
_CALLS = re.compile(r"\b([a-z]\w*)\(")


@dataclass(frozen=True)
class Count:
    """What a kernel computes in one call: stored results, shared values, sums, products,
    quotients and signs, and calls of functions; small powers are functions too."""

    kernel: str
    results: int
    shared: int
    operations: int
    calls: int


def count_of(spec: KernelSpec) -> Count:
    """Count the operations in the C code of a kernel, after shared values are found."""
    code = listing(spec, CPrinter, functions_of([spec]))
    texts = [text for _, text in (*code.statements, *code.results)]
    plain = [re.sub(r"\[[^]]*\]", "", text) for text in texts]
    return Count(
        spec.name,
        sum(o.size for o in spec.outputs),
        len(code.statements),
        sum(len(_SIGNS.findall(text)) for text in plain),
        sum(len(_CALLS.findall(text)) for text in plain),
    )
