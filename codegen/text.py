"""From kernel specifications to the text of every generated file; pure: same model, same bytes."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from functools import cache
from importlib import resources
from itertools import groupby
from typing import Any

import jinja2

from dmoc.codegen.printer import (
    ArgumentPrinter,
    CPrinter,
    Listing,
    NumPyPrinter,
    Printer,
    listing,
)
from dmoc.codegen.schedule import functions_of
from dmoc.symbolic.spec import FunctionSpec, Input, KernelSpec, ModelSpec, Output


def c_files(model: ModelSpec) -> dict[str, str]:
    """Return the C sources of a model and its manifest, as ``{file name: text}``."""
    functions = functions_of(model.kernels)
    inputs, entries = _entries(model.kernels)
    facts: dict[str, Any] = {
        "name": model.name,
        "functions": [_c_function(f) for f in functions],
        "kernels": [
            _c_kernel(k, functions)
            | {"arrays": arrays, "inputs": len(k.inputs), "outputs": len(k.outputs)}
            for k, arrays in zip(model.kernels, entries, strict=True)
        ],
        "inputs": inputs,
        "legend": _legend(model),
    }
    return _files(model, facts, _digest(_files(model, facts, "")))


def _files(model: ModelSpec, facts: dict[str, Any], code: str) -> dict[str, str]:
    """The files with the digest of their content, which manifest and table hold."""
    files = {name: _render(name, facts | {"code": code}) for name in ("kernels.h", "kernels.c")}
    files["__init__.py"] = f'"""Generated kernels of the model {model.name}."""\n'
    files["manifest.json"] = json.dumps({"code": code, **manifest(model)}, indent=1) + "\n"
    return files


def _digest(files: dict[str, str]) -> str:
    return hashlib.sha256(json.dumps(files, sort_keys=True).encode()).hexdigest()


def numpy_text(model: ModelSpec) -> str:
    """Return a NumPy module with the same functions as the compiled one."""
    functions = functions_of(model.kernels)
    facts = {
        "name": model.name,
        "functions": [_numpy_kernel(f.kernel, (), ArgumentPrinter) for f in functions],
        "kernels": [_numpy_kernel(k, functions) for k in model.kernels],
    }
    return _render("numpy.py", facts)


def manifest(model: ModelSpec) -> dict[str, Any]:
    """Return what the numerical layers need to know of a model, in JSON types."""
    return {
        "name": model.name,
        "fingerprint": model.fingerprint,
        **model.facts,
        "kernels": {
            k.name: {
                "inputs": [[a.name, a.size] for a in k.inputs],
                "outputs": [
                    {"name": o.name, "shape": list(o.shape)}
                    if len(o.shape) == 1
                    else {
                        "name": o.name,
                        "shape": list(o.shape),
                        "rows": [i for i, _ in o.entries],
                        "columns": [j for _, j in o.entries],
                    }
                    for o in k.outputs
                ],
            }
            for k in model.kernels
        },
    }


def _render(name: str, values: dict[str, Any]) -> str:
    return _template(name).render(values)


@cache
def _template(name: str) -> jinja2.Template:
    environment = jinja2.Environment(
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        undefined=jinja2.StrictUndefined,
        autoescape=False,
    )
    place = resources.files(__package__).joinpath("templates", f"{name}.jinja")
    return environment.from_string(place.read_text(encoding="utf-8"))


def _c_kernel(spec: KernelSpec, functions: Sequence[FunctionSpec]) -> dict[str, Any]:
    """Facts about a kernel for the template; of its arguments, those that it needs."""
    code = listing(spec, CPrinter, functions)
    inputs = [(i, a.name) for i, a in enumerate(spec.inputs) if a.name in code.read]
    outputs = [(i, o) for i, o in enumerate(spec.outputs) if o.size]
    rows = [f"ROW({i})" for i, _ in inputs] + [f"INTO({i}, {o.size})" for i, o in outputs]
    layouts = [f"  {o.name} {_layout(o)}" for _, o in outputs if len(o.shape) > 1]
    return {
        "name": spec.name,
        "comment": [spec.summary, *layouts],
        "signature": ", ".join(
            [f"IN {a}" for _, a in inputs] + [f"OUT {o.name}" for _, o in outputs]
        ),
        "arguments": ", ".join(rows),
        "lines": [*_declarations(code), *(f"{line};" for line in _assignments(code))],
    }


def _c_function(function: FunctionSpec) -> dict[str, Any]:
    """Facts about a function for the template, which has all arguments."""
    facts = _c_kernel(function.kernel, ())
    unused = [] if "IN par" in facts["signature"] else ["(void)par;"]
    return facts | {"lines": [*unused, *facts["lines"]]}


def _declarations(code: Listing) -> Iterator[str]:
    """The values of a listing, as many in one declaration as there are without a call between."""
    statements = (*code.constants, *code.statements)
    for named, group in groupby(statements, lambda statement: bool(statement[0])):
        lines = [f"{name} = {text}" if named else text for name, text in group]
        if not named:
            yield from lines
        else:
            yield "const double"
            yield from (f"{line}," for line in lines[:-1])
            yield f"{lines[-1]};"


def _assignments(code: Listing) -> list[str]:
    return [" = ".join([*places, text]) for places, text in code.results]


def _entries(kernels: Sequence[KernelSpec]) -> tuple[dict[str, str], list[str]]:
    """Words for inputs that several kernels begin with, and the arrays of all."""
    words: dict[tuple[Input, ...], str] = {}
    entries = []
    for k in kernels:
        shared = next((i for i in range(len(k.inputs), 0, -1) if k.inputs[:i] in words), 0)
        begins = [o for o in kernels if o.inputs[: len(k.inputs)] == k.inputs]
        if not shared and len(begins) > 1:
            words[k.inputs], shared = f"{k.name.upper()}_INPUTS", len(k.inputs)
        arrays = [words[k.inputs[:shared]]] if shared else []
        arrays += [*map(_array, k.inputs[shared:]), *map(_array, k.outputs)]
        entries.append(", ".join(arrays))
    return {word: ", ".join(map(_array, own)) for own, word in words.items()}, entries


def _array(a: Input | Output) -> str:
    return f'{{"{a.name}", {a.size}}}'


def _numpy_kernel(
    spec: KernelSpec, functions: Sequence[FunctionSpec], printer: type[Printer] = NumPyPrinter
) -> dict[str, Any]:
    code = listing(spec, printer, functions)
    return {
        "name": spec.name,
        "names": [*(a.name for a in spec.inputs), *(o.name for o in spec.outputs)],
        "sizes": [o.size for o in spec.outputs],
        "lines": [
            *(f"{name} = {text}" for name, text in code.constants),
            *(f"{name} = {text}" if name else text for name, text in code.statements),
            *_assignments(code),
        ],
    }


def _layout(output: Output) -> str:
    """The places of the stored entries of a matrix, by rows: those of a row, or of several that
    have the same, with their columns."""
    columns: dict[int, list[int]] = {}
    for i, j in output.entries:
        columns.setdefault(i, []).append(j)
    rows: dict[tuple[int, ...], list[int]] = {}
    for i, own in columns.items():
        rows.setdefault(tuple(own), []).append(i)
    listed = "; ".join(f"{_ranges(i)}: {_ranges(j)}" for j, i in rows.items())
    return f"[{output.shape[0]}, {output.shape[1]}] at {listed}"


def _ranges(numbers: Sequence[int]) -> str:
    """Ascending numbers, of which those in a row are a range."""
    runs: list[list[int]] = []
    for n in numbers:
        if runs and runs[-1][-1] == n - 1:
            runs[-1][1:] = [n]
        else:
            runs.append([n])
    return " ".join("-".join(map(str, run)) for run in runs)


def _legend(model: ModelSpec) -> list[str]:
    """Say which component of an argument is which quantity."""
    groups = {
        "q": "coordinates",
        "u": "inputs",
        "g": "surfaces",
        "tau": "tangents",
        "phi": "joints",
        "r_d": "path_constraints",
        "par": "parameters",
    }
    return [
        f"{letter} = ({', '.join(model.facts[key])})"
        for letter, key in groups.items()
        if model.facts[key]
    ]
