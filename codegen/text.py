"""From kernel specifications to the text of every generated file; pure: same model, same bytes."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from importlib import resources
from typing import Any

import jinja2

from dmoc.codegen.printer import ArgumentPrinter, CPrinter, Listing, NumPyPrinter, listing
from dmoc.codegen.schedule import functions_of
from dmoc.symbolic.spec import FunctionSpec, Input, KernelSpec, ModelSpec, Output


def c_files(model: ModelSpec) -> dict[str, str]:
    """Return the C sources of a model and its manifest, as ``{file name: text}``."""
    functions = functions_of(model.kernels)
    facts: dict[str, Any] = {
        "name": model.name,
        "functions": [_c_kernel(f.kernel, ()) for f in functions],
        "kernels": [_c_kernel(k, functions) for k in model.kernels],
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
        "functions": [_numpy_function(f) for f in functions],
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
    environment = jinja2.Environment(
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        undefined=jinja2.StrictUndefined,
        autoescape=False,
    )
    source = (
        resources.files(__package__)
        .joinpath("templates", f"{name}.jinja")
        .read_text(encoding="utf-8")
    )
    return environment.from_string(source).render(values)


def _arrays(spec: KernelSpec) -> list[Input | Output]:
    return [*spec.inputs, *spec.outputs]


def _common(spec: KernelSpec, code: Listing, place: str) -> dict[str, Any]:
    return {
        "name": spec.name,
        "summary": spec.summary,
        "names": [a.name for a in _arrays(spec)],
        "inputs": [{"name": a.name, "size": a.size} for a in spec.inputs],
        "outputs": [{"name": o.name, "size": o.size, "layout": _layout(o)} for o in spec.outputs],
        "statements": code.statements,
        "assignments": [
            (place.format(name=name, i=i), v)
            for name, values in code.outputs
            for i, v in enumerate(values)
        ],
    }


def _c_kernel(spec: KernelSpec, functions: Sequence[FunctionSpec]) -> dict[str, Any]:
    code = listing(spec, CPrinter, functions)
    unused = [a.name for a in spec.inputs if a.name not in code.read]
    unused += [name for name, values in code.outputs if not values]
    pointers = [f"const double *restrict {a.name}" for a in spec.inputs]
    pointers += [f"double *restrict {o.name}" for o in spec.outputs]
    arguments = [f"in[{i}] + i*stride[{i}]" for i in range(len(spec.inputs))]
    arguments += [f"out[{i}] + i*{o.size}" for i, o in enumerate(spec.outputs)]
    return _common(spec, code, "{name}[{i}]") | {
        "signature": ", ".join(pointers),
        "arguments": ", ".join(arguments),
        "arrays": ", ".join(f'{{"{a.name}", {a.size}}}' for a in _arrays(spec)),
        "unused": unused,
    }


def _numpy_kernel(spec: KernelSpec, functions: Sequence[FunctionSpec]) -> dict[str, Any]:
    return _common(spec, listing(spec, NumPyPrinter, functions), "{name}[..., {i}]")


def _numpy_function(function: FunctionSpec) -> dict[str, Any]:
    return _common(function.kernel, listing(function.kernel, ArgumentPrinter), "")


def _layout(output: Output) -> str:
    if len(output.shape) == 1 or not output.entries:
        return ""
    entries = " ".join(f"({i},{j})" for i, j in output.entries)
    return f", entries of a {output.shape[0]} x {output.shape[1]} matrix: {entries}"


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
