"""From kernel specifications to the text of every generated file; pure: same model, same bytes."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from importlib import resources
from itertools import groupby
from typing import Any

import jinja2

from dmoc.base.collection import uncollected
from dmoc.codegen.chunks import ARRAY, CHUNK, LONG, cut, operations, words_of
from dmoc.codegen.printer import (
    ArgumentPrinter,
    CPrinter,
    Listing,
    NumPyPrinter,
    Printer,
    listing,
)
from dmoc.codegen.schedule import called_of, functions_of
from dmoc.symbolic.called import Function, Least
from dmoc.symbolic.spec import FunctionSpec, Input, KernelSpec, ModelSpec, Output

_CODE = "@@"  # stands for the digest of the text around it


@uncollected()
def c_files(model: ModelSpec) -> dict[str, str]:
    """Return the C sources of a model and its manifest, as ``{file name: text}``."""
    functions = functions_of(model.kernels)
    inputs, entries = _entries(model.kernels)
    called = [_c_called(f) for f in called_of(_all(model, functions))]
    own_functions = [*called, *(_c_function(f) for f in functions)]
    kernels = [
        _c_kernel(k, functions)
        | {"arrays": arrays, "inputs": len(k.inputs), "outputs": len(k.outputs)}
        for k, arrays in zip(model.kernels, entries, strict=True)
    ]
    most = max((f["places"] for f in called), default=0)
    facts: dict[str, Any] = {
        "name": model.name,
        "angles": _render("angles.c", {"angles": most}) if most else "",
        "functions": own_functions,
        "kernels": kernels,
        "units": _numbered([*own_functions, *kernels]),
        "inputs": inputs,
        "legend": _legend(model),
    }
    files = _files(model, facts | {"code": _CODE})
    digest = _digest({name: text.replace(_CODE, "") for name, text in files.items()})
    return {name: text.replace(_CODE, digest) for name, text in files.items()}


def _numbered(functions: Sequence[dict[str, Any]]) -> int:
    """Number functions and their parts, those of most text first, where any has parts; return how
    many there are."""
    units = [unit for f in functions for unit in (*f["parts"], f)]
    if len(units) == len(functions):
        return 0
    units.sort(key=lambda unit: -sum(map(len, unit["lines"])))
    for i, unit in enumerate(units):
        unit["unit"] = i
    return len(units)


def _files(model: ModelSpec, facts: dict[str, Any]) -> dict[str, str]:
    """The files with what stands for the digest of their content in manifest and table."""
    files = {name: _render(name, facts) for name in ("kernels.h", "kernels.c")}
    files["__init__.py"] = f'"""Generated kernels of the model {model.name}."""\n'
    described = {"code": facts["code"], **manifest(model)}
    files["manifest.json"] = json.dumps(described, indent=1) + "\n"
    return files


def _digest(files: dict[str, str]) -> str:
    return hashlib.sha256(json.dumps(files, sort_keys=True).encode()).hexdigest()


def numpy_text(model: ModelSpec) -> str:
    """Return a NumPy module with the same functions as the compiled one."""
    functions = functions_of(model.kernels)
    called = called_of(_all(model, functions))
    facts = {
        "name": model.name,
        "called": [_numpy_kernel(f.kernel, (), ArgumentPrinter) | _wrapper(f) for f in called],
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
    signature = {a: f"IN {a}" for _, a in inputs} | {o.name: f"OUT {o.name}" for _, o in outputs}
    parts, lines = _parts(spec.name, code, signature)
    return {
        "name": spec.name,
        "comment": [spec.summary, *layouts],
        "signature": ", ".join(signature.values()),
        "arguments": ", ".join(rows),
        "parts": parts,
        "lines": lines,
    }


def _c_function(function: FunctionSpec) -> dict[str, Any]:
    """Facts about a function for the template, which has all arguments."""
    facts = _c_kernel(function.kernel, ())
    unused = [] if "IN par" in facts["signature"] else ["(void)par;"]
    return facts | {"signature": "IN z, IN par, OUT d", "lines": [*unused, *facts["lines"]]}


def _c_called(function: Function) -> dict[str, Any]:
    """Facts about a function that is called by its name."""
    return _c_kernel(function.kernel, ()) | {"signature": "IN z, OUT d"} | _wrapper(function)


def _wrapper(function: Function) -> dict[str, Any]:
    """How it is called: of how many numbers, and from how many places it finds an angle."""
    places = function.places if isinstance(function, Least) else 0
    return {"call": function.name, "count": len(function.symbols), "places": places}


def _all(model: ModelSpec, functions: Sequence[FunctionSpec]) -> list[KernelSpec]:
    return [*(f.kernel for f in functions), *model.kernels]


def _parts(
    name: str, code: Listing, signature: Mapping[str, str]
) -> tuple[list[dict[str, Any]], list[str]]:
    """The functions that a long listing is cut into, with the arguments that each needs, and the
    lines of the whole one, which calls them."""
    if operations(code) <= LONG:
        return [], _lines(code)
    chunks, size = cut(code, CHUNK)
    words = {**signature, ARRAY: f"OUT {ARRAY}"}
    parts, calls = [], [f"double {ARRAY}[{size}];"] if size else []
    for i, chunk in enumerate(chunks):
        if not isinstance(chunk, Listing):
            calls += chunk
            continue
        used = words_of(chunk)
        needed = [word for word in words if word in used]
        part = f"{name}_part{i}"
        own = ", ".join(words[word] for word in needed)
        parts.append({"name": part, "signature": own, "lines": _lines(chunk)})
        calls.append(f"{part}({', '.join(needed)});")
    return parts, calls


def _lines(code: Listing) -> list[str]:
    return [*_declarations(code), *(f"{line};" for line in _assignments(code))]


def _declarations(code: Listing) -> Iterator[str]:
    """The values of a listing, as many in one declaration as there are without a call between."""
    statements = (*code.constants, *code.statements)
    for named, group in groupby(statements, lambda statement: bool(statement[0])):
        lines = [f"{name} = {text}" if named else text for name, text in group]
        if not named:
            yield from (line for text in lines for line in text.split("\n"))
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
