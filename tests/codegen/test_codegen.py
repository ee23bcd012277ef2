"""Generated code: awkward expressions, determinism, agreement of the backends, warnings and
sanitizers."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path

import mpmath
import numpy as np
import pytest
import sympy as sp
from commands import printed
from sympy.physics.mechanics import dynamicsymbols
from systems import block_system, driven_system, puck_system

import dmoc
from dmoc.codegen.build import write_files
from dmoc.codegen.compiler import HEADERS, compiler
from dmoc.codegen.kernels import Kernels
from dmoc.codegen.printer import CPrinter, NumPyPrinter
from dmoc.codegen.text import c_files, numpy_text
from dmoc.mechanics.model import Model
from dmoc.models import catalogue
from dmoc.symbolic.continuous import readable
from dmoc.symbolic.conversion import FUNCTIONS
from dmoc.symbolic.families import model_spec

T = dynamicsymbols._t
AWKWARD = [
    "q**2", "q**3", "q**4", "q**7", "1/q", "1/q**2", "q**-3", "sqrt(q)", "1/sqrt(q)", "q**(3/2)",
    "q**(-5/2)", "q**p", "p**q", "2**q", "exp(q)", "exp(-q**2)", "log(q)", "-q", "-(q - p)",
    "q - (p - q)", "q/(p/q)", "(q/p)/q", "-q**2", "(-q)**2", "q*(p + 1)*(p - 1)", "1/(q*p)",
    "q/(p + q)**2", "Rational(1, 3)*q", "-Rational(1, 3)*q + 1e-30", "-2*(-q**2 - p)",
    "-(-q - p)/3", "1 - (-(q - p))", "1e22*q", "pi*q", "E*q", "sin(q)/q", "sin(cos(tan(q)))",
    "asin(q/9) + acos(q/9) + atan(q)", "atan2(q, p)", "sinh(q) + cosh(q) + tanh(q)",
    "asinh(q) + acosh(q + 1) + atanh(q/9)", "Abs(q - p)", "Max(q, p)", "Min(q, p, 1)",
    "Piecewise((q, q < p), (p**2, q < 2*p), (1, True))",
    "Piecewise((q, (q < p) & (q > 0)), (1, True))", "Piecewise((q, (q > p) | (q < 0)), (1, True))",
]  # fmt: skip


@pytest.fixture(scope="module")
def awkward() -> tuple[Kernels, Kernels, list[sp.Expr]]:
    """A model on both backends whose force is the sum of the awkward expressions, each times a
    parameter."""
    q, p = dynamicsymbols("q"), sp.Symbol("p")
    weights = sp.symbols(f"weight0:{len(AWKWARD)}")
    expressions = [sp.sympify(text, locals={"q": q, "p": p}) for text in AWKWARD]
    system = dmoc.MechanicalSystem(
        "awkward", [q], q.diff(T) ** 2 / 2, {p: 1.3} | dict.fromkeys(weights, 0.0),
        forces={q: sum(w * e for w, e in zip(weights, expressions, strict=True))},
    )  # fmt: skip
    return dmoc.build(system), dmoc.build(system, backend="numpy"), expressions


def values(kernels: Kernels, at: float) -> np.ndarray:
    """The expressions in the first row, their derivatives by q in the second."""
    q, still, none = np.full((1, 1), at), np.zeros((1, 1)), np.zeros((1, 0))
    columns = []
    for weights in np.eye(len(AWKWARD)):
        model = Model(kernels, np.array([[1.3, *weights]]))
        value = model.equations(q, still, none)[1][0, 0]
        columns.append((value, model.equations_slopes(q, still, none, a=still)[0, 0, 0]))
    return np.array(columns).T


@pytest.mark.slow
def test_awkward_expressions_equal_mpmath(awkward: tuple[Kernels, Kernels, list[sp.Expr]]) -> None:
    *backends, expressions = awkward
    q, p = dynamicsymbols("q"), sp.Symbol("p")
    for value in (0.7, 1.9):
        point = {q: sp.Float(value, 40), p: sp.Float(1.3, 40)}
        exact = [mpmath.mpf(sp.N(e.subs(point), 40)) for e in expressions]
        for kernels in backends:
            for text, a, b in zip(AWKWARD, values(kernels, value)[0], exact, strict=True):
                assert abs(a - b) <= 2e-14 * max(1, abs(b)), text


@pytest.mark.slow
def test_derivatives_of_awkward_expressions_equal_differences(
    awkward: tuple[Kernels, Kernels, list[sp.Expr]],
) -> None:
    at, step, compiled = 0.7, 1e-6, awkward[0]
    slope = values(compiled, at)[1]
    difference = (values(compiled, at + step)[0] - values(compiled, at - step)[0]) / (2 * step)
    assert (np.abs(slope - difference) <= 1e-7 * np.maximum(1, np.abs(difference))).all()


def test_printers_know_every_function() -> None:
    for printer in (CPrinter, NumPyPrinter):
        assert FUNCTIONS | {"exp", "sqrt", "pow"} <= set(printer.functions)


@pytest.mark.slow
def test_c_hostile_parameter_names_work() -> None:
    q, u = dynamicsymbols("i j")
    names = sp.symbols("I h q_k par w0 sin M_PI n")
    system = dmoc.MechanicalSystem(
        "hostile", coordinates=[q], inputs=[u], lagrangian=sum(names) * q.diff(T) ** 2 / 2,
        forces={q: u}, parameters=dict.fromkeys(names, 1.0),
    )  # fmt: skip
    one = np.ones((1, 1))
    mass = dmoc.build(system).call("dynamics", one, one, one, one, np.ones((1, 8)))[0]
    assert mass[0, 0] == 8.0


def test_a_model_may_be_called_as_a_word_of_the_header() -> None:
    q = dynamicsymbols("q")
    for name in ("OUT", "ROW", "NAN"):
        made = dmoc.MechanicalSystem(name, [q], q.diff(T) ** 2 / 2)
        one = np.ones((1, 1))
        kernels = dmoc.build(made, backend="compiled")
        assert kernels.call("energy", one, one, one, np.ones((1, 0)))[0] == 0.5


@pytest.mark.slow
def test_text_does_not_depend_on_the_hash_seed() -> None:
    """This process draws one of its own, unless it is told one."""
    program = (
        "from dmoc.codegen.text import c_files, numpy_text; from dmoc.models import catalogue; "
        "from dmoc.symbolic.families import model_spec; "
        "m = model_spec(catalogue.system('puck_table')); "
        "print(sorted(c_files(m).items()), numpy_text(m))"
    )
    model = model_spec(catalogue.system("puck_table"))
    here = f"{sorted(c_files(model).items())} {numpy_text(model)}\n"
    seed = "4711" if os.environ.get("PYTHONHASHSEED") != "4711" else "0"
    assert printed(sys.executable, "-c", program, env={"PYTHONHASHSEED": seed}) == here


@pytest.mark.slow
@pytest.mark.parametrize(
    ("make", "order"), [(block_system, 2), (puck_system, 2), (driven_system, 4)]
)
def test_backends_agree_on_every_kernel(
    make: Callable[[], dmoc.MechanicalSystem],
    order: int,
    flags: tuple[str, ...],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Compiled as users do it."""
    system = make()
    monkeypatch.setattr("dmoc.codegen.compiler.FLAGS", flags)
    monkeypatch.setenv("DMOC_CACHE", str(tmp_path))
    _compare(dmoc.build(system, order=order), dmoc.build(system, order=order, backend="numpy"))


def _compare(compiled: Kernels, numpy: Kernels) -> None:
    rng = np.random.default_rng(1)
    for name, kernel in compiled.manifest.kernels.items():
        inputs = [rng.uniform(0.5, 1.5, (7, size)) for _, size in kernel["inputs"]]
        with np.errstate(all="ignore"):
            pairs = zip(compiled.call(name, *inputs), numpy.call(name, *inputs), strict=True)
            for a, b in pairs:
                np.testing.assert_allclose(a, b, rtol=1e-13, atol=1e-13, err_msg=name)


def test_one_row_of_an_argument_serves_all(block: Kernels) -> None:
    q = np.linspace(0, 1, 5)[:, None].copy()
    one, par = np.ones((1, 1)), np.array([[2.0, 1.0]])
    none = np.ones((1, 0))
    rows = [np.repeat(a, 4, axis=0) for a in (one, one, one, one, none, par)]
    a = block.call("step", q[:-1], q[1:], one, one, one, one, none, par)
    b = block.call("step", q[:-1], q[1:], *rows)
    assert [len(x) for x in a] == [4] * len(a) and len(a) > 2
    for x, y in zip(a, b, strict=True):
        np.testing.assert_array_equal(x, y)


@pytest.mark.parametrize("backend", ["compiled", "numpy"])
def test_vectors_and_numbers_are_rows(backend: str) -> None:
    kernels = dmoc.build(puck_system(), backend=backend)
    par = np.array([[value or 1.0 for value in kernels.parameters.values()]])
    q, t = np.linspace(0, 1, 6).reshape(3, 2), np.linspace(1, 2, 3)
    u = np.ones((1, len(kernels.inputs)))
    rows = kernels.call("dynamics", q, q[:1], u, t[:, None], par)
    for alike in (
        kernels.call("dynamics", q, q[0], u[0], t, par[0]),
        kernels.call("dynamics", np.asfortranarray(q), q[0], u, t.tolist(), par),
    ):
        for a, b in zip(alike, rows, strict=True):
            np.testing.assert_array_equal(a, b)
    for a, b in zip(kernels.call("dynamics", q[2], q[0], u, 2.0, par), rows, strict=True):
        np.testing.assert_array_equal(a, b[2:])
    with pytest.raises((TypeError, ValueError)):
        kernels.call("dynamics", q, q, u, par)


def test_wrong_arrays_are_refused_by_name(block: Kernels) -> None:
    one = np.ones((3, 1))
    none, out = np.ones((3, 0)), [*(np.empty((3, 1)) for _ in range(3)), np.empty((3, 0))]
    with pytest.raises(ValueError, match="par: expected rows of 2"):
        block.functions["step"](one, one, one, one, one, one, none, np.ones((1, 3)), *out)
    with pytest.raises(ValueError, match="q_k: expected 3 rows or 1, got 2"):
        block.functions["step"](one[:2], one, one, one, one, one, none, np.ones((1, 2)), *out)
    with pytest.raises(ValueError, match="q_k: expected float64"):
        block.functions["step"](
            one.astype(np.float32), one, one, one, one, one, none, np.ones((1, 2)), *out
        )
    with pytest.raises(TypeError, match="step: expected 12 arrays, got 4"):
        block.functions["step"](*out)


@pytest.mark.slow
@pytest.mark.parametrize("order", [2, 4])
def test_every_kernel_runs_under_sanitizers(tmp_path: Path, order: int) -> None:
    """Each kernel is called on arrays of exactly its sizes; reading or writing beside them
    aborts the program."""
    model = model_spec(driven_system(), order)
    write_files(tmp_path, c_files(model))
    lines = [
        '#include "kernels.h"',
        "#include <stdlib.h>",
        "static double *make(size_t n) {",
        "    double *a = malloc((n ? n : 1) * sizeof *a); for (size_t i = 0; i < n; ++i) a[i] = "
        "0.5 + 0.1 * (double)i; return a; }",
        "int main(void) {",
    ]
    for k in model.kernels:
        ins = ", ".join(f"make({3 * a.size})" for a in k.inputs)
        outs = ", ".join(f"make({3 * o.size})" for o in k.outputs)
        strides = ", ".join(str(a.size) for a in k.inputs)
        lines.append(
            f"    {{ const double *in[] = {{{ins}}}; double *out[] = {{{outs}}}; ptrdiff_t s[] = "
            f"{{{strides}}};"
        )
        lines.append(f"      driven_{k.name}(3, in, s, out); }}")
    (tmp_path / "main.c").write_text("\n".join([*lines, "    return 0; }"]))
    flags = [
        "-std=c11", "-g", "-O0", "-Wall", "-Wextra", "-Werror", "-fsanitize=address,undefined",
        "-fno-sanitize-recover=all",
    ]  # fmt: skip
    sources = (f"-I{HEADERS}", "kernels.c", "main.c", "-lm", "-o", "run")
    printed(*compiler(), *flags, *sources, cwd=tmp_path)
    printed("./run", cwd=tmp_path, env={"ASAN_OPTIONS": "detect_leaks=0"})


def test_readable_symbols_carry_the_users_names() -> None:
    assert [str(s) for s in readable(block_system()).q] == ["x"]
