"""Systems at the edges of what can be described: each becomes C without a warning, with the
values of its expressions."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy as sp
from commands import printed
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.codegen.build import numpy_kernels, write_files
from dmoc.codegen.compiler import HEADERS, compiler
from dmoc.codegen.manifest import Manifest
from dmoc.codegen.text import c_files, manifest, numpy_text
from dmoc.symbolic.families import model_spec
from dmoc.symbolic.spec import KernelSpec
from dmoc.symbolic.traversal import evaluated

pytestmark = pytest.mark.slow

T = dynamicsymbols._t
x, y, u, w = dynamicsymbols("x y u w")
m, n, c = sp.symbols("m n c")
vx, vy = x.diff(T), y.diff(T)
FREE = (vx**2 + vy**2) / 2


def system(**fields: Any) -> dmoc.MechanicalSystem:
    statement = {"lagrangian": FREE, "coordinates": [x, y], "parameters": {}, **fields}
    return dmoc.MechanicalSystem("awkward_system", **statement)


SYSTEMS: Mapping[str, Callable[[], dmoc.MechanicalSystem]] = {
    "gyroscopic": lambda: system(forces={x: -n * vy, y: n * vx}, parameters={n: 2.0}),
    "magnetic": lambda: system(lagrangian=FREE + n * (x * vy - y * vx) / 2, parameters={n: 2.0}),
    "normal": lambda: system(
        forces={x: n * vy * (x**2 + y**2), y: -n * vx * (x**2 + y**2)}, parameters={n: 2.0}
    ),
    "workless by sine": lambda: system(forces={x: sp.sin(x) * vy, y: -sp.sin(x) * vx}),
    "gyroscopic with input": lambda: system(forces={x: u * vy, y: -u * vx}, inputs=[u], cost=u**2),
    "opposite inputs": lambda: system(
        forces={x: u - w, y: w - u}, inputs=[u, w], cost=(u - w) ** 2
    ),
    "inputs that cancel": lambda: system(forces={x: u * y, y: -u * x}, inputs=[u], cost=u**2),
    "constant forces": lambda: system(forces={x: 3, y: c}, parameters={c: 1.0}),
    "zero force": lambda: system(forces={x: 0}),
    "no forces": lambda: system(),
    "no forces, one coordinate": lambda: system(coordinates=[x], lagrangian=vx**2 / 2),
    "force of time": lambda: system(forces={x: sp.sin(T)}),
    "impulse of time alone": lambda: system(forces={x: T, y: -T}),
    "zero cost": lambda: system(forces={x: u}, inputs=[u], cost=0),
    "constant cost": lambda: system(cost=1),
    "cost of time only": lambda: system(cost=T**2),
    "cost of parameters only": lambda: system(cost=c, parameters={c: 2.0}),
    "parameter in a terminal cost only": lambda: system(
        terminal_cost=c * (x - 1) ** 2, parameters={c: 2.0}
    ),
    "terminal cost of time": lambda: system(terminal_cost=T),
    "terminal cost of velocities": lambda: system(terminal_cost=vx * vy),
    "surface of time and coordinates": lambda: system(surfaces={"s": x * sp.sin(T) + y <= T}),
    "surfaces that oppose": lambda: system(
        surfaces={"a": x <= 1, "b": x >= -1, "c": x + y <= 2, "d": x + y >= -2}
    ),
    "surface with a parameter only there": lambda: system(
        surfaces={"s": x <= c}, parameters={c: 1.0}
    ),
    "surface with a kink": lambda: system(surfaces={"s": sp.Abs(x) <= 1 + sp.Max(y, 0)}),
    "path constraint without inputs": lambda: system(
        path_constraints={"speed": vx**2 + vy**2 <= 4}
    ),
    "path constraint of time": lambda: system(path_constraints={"late": T <= 9}),
    "path constraint of inputs": lambda: system(
        forces={x: u}, inputs=[u], path_constraints={"power": u * vx <= 1}
    ),
    "force of everything": lambda: system(
        forces={x: u * x * vy + sp.cos(T * y) * c, y: u**2 * vx - x * y * T},
        inputs=[u],
        parameters={c: 0.5},
        cost=u**2 + x * vy * T,
        dissipation=c * vx**2,
    ),
    "piecewise force": lambda: system(
        forces={x: sp.Piecewise((-c * x, x > 0), (0, True))}, parameters={c: 0.5}
    ),
    "stops with Min and Max": lambda: system(
        lagrangian=FREE - sp.Max(x - 1, 0) ** 2, forces={y: -sp.Min(y, vy)}
    ),
    "costs and limits with kinks": lambda: system(
        forces={x: u - sp.Abs(vx) * vx * c},
        inputs=[u],
        parameters={c: 0.1},
        cost=sp.Abs(u * vx) + sp.Max(x, vy, 0) ** 2 - sp.Min(x, u) * (1 + x**2),
        path_constraints={"fuel": sp.Abs(u) + sp.Abs(vx) <= 9, "most": sp.Max(u, y) <= 9},
    ),
    "Piecewise that shares conditions": lambda: system(
        lagrangian=FREE - sp.Piecewise((x**2, x < y), (y**2, True)),
        forces={x: sp.Piecewise((x, x < y), (y, True)) ** 2},
    ),
    "velocities that couple": lambda: system(
        lagrangian=FREE + vx * vy * sp.cos(x - y) / 2, parameters={}
    ),
    "mass of time": lambda: system(lagrangian=FREE * (2 + sp.sin(T)) - m * x, parameters={m: 1.0}),
    "total time derivative": lambda: system(lagrangian=FREE + x * vy + y * vx),
}
# What is printed knows no order; those of order 4 have nodes inside their steps, with rows that
# vanish, couple or hold kinks.
INSIDE = (
    "zero force", "no forces, one coordinate", "zero cost", "constant cost", "force of time",
    "gyroscopic with input", "force of everything", "velocities that couple", "mass of time",
    "path constraint of inputs", "costs and limits with kinks",
)  # fmt: skip
CASES = [*((name, 2) for name in SYSTEMS), *((name, 4) for name in INSIDE)]


@pytest.mark.parametrize(("name", "order"), CASES)
def test_it_becomes_c_without_a_warning_and_keeps_its_values(
    tmp_path: Path, name: str, order: int
) -> None:
    model = model_spec(SYSTEMS[name](), order)
    write_files(tmp_path, c_files(model))
    strict = ["-std=c11", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", f"-I{HEADERS}"]
    printed(*compiler(), *strict, "kernels.c", cwd=tmp_path)
    kernels = numpy_kernels(Manifest.read(manifest(model)), numpy_text(model))
    rng = np.random.default_rng(1)
    for kernel in model.kernels:
        inputs = [rng.uniform(0.5, 1.5, (1, argument.size)) for argument in kernel.inputs]
        # The shortest time to a surface is no number where there is none.
        with np.errstate(all="ignore"):
            results = kernels.call(kernel.name, *inputs)
        for output, values in zip(kernel.outputs, results, strict=True):
            expected = _values(kernel, output.expressions, inputs)
            # Without a root, products with zero are numbers or not, as the compiler orders them.
            if kernel.name == "min_time_jac":
                expected = np.where(np.isfinite(values[0]), expected, values[0])
            np.testing.assert_allclose(
                values[0], expected, rtol=1e-11, atol=1e-11, err_msg=f"{kernel.name} {output.name}"
            )


def _values(
    kernel: KernelSpec, expressions: tuple[Any, ...], inputs: list[np.ndarray]
) -> np.ndarray:
    """The expressions at a point, without common subexpressions and printers."""
    point = {
        s: v
        for a, row in zip(kernel.inputs, inputs, strict=True)
        for s, v in zip(a.symbols, row[0].tolist(), strict=True)
    }
    defined = {s: v for s, v in kernel.definitions if v.free_symbols <= set(point)}
    point |= dict(zip(defined, evaluated(list(defined.values()), point, mpmath), strict=True))
    numbers = [complex(z) for z in evaluated(expressions, point, mpmath)]
    return np.array([z.real if z.imag == 0 else np.nan for z in numbers])


def test_warnings_do_not_stop_a_users_build(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DMOC_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("CC", f"{' '.join(compiler())} -Wdeclaration-after-statement")
    one, none = np.ones((1, 1)), np.ones((1, 0))
    kernels = dmoc.build(SYSTEMS["no forces, one coordinate"](), backend="compiled")
    assert kernels.call("dynamics", one, one, none, one, none)[0][0, 0] == 1.0
