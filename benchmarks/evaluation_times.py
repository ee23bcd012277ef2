"""Nanoseconds a step of residual, first and second derivatives: dmoc's C and NumPy, CasADi."""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from casadi_pendulum import PendulumCase, step_function
from common import Section, ratio, timed

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.models import catalogue
from dmoc.models.registry import build

STEPS = 1000
FLAGS = "-O2"

# Calls a function of CasADi's C interface for each row, in the way that a solver written in C
# would.
LOOP = """
typedef int function(const double **, double **, long long *, double *, int);
void loop(function *f, long long n, int inputs, const double **in, const long long *in_size,
          int outputs, double **out,
          const long long *out_size, const double **arg, double **res, long long *iw, double *w)
{
    for (long long k = 0; k < n; ++k) {
        for (int i = 0; i < inputs; ++i)
            arg[i] = in[i] + k*in_size[i];
        for (int i = 0; i < outputs; ++i)
            res[i] = out[i] + k*out_size[i];
        f(arg, res, iw, w, 0);
    }
}
"""


def functions() -> dict[str, ca.Function]:
    """Residual, Jacobian and Hessian of a step in (q_k, q_kp1, u, h)."""
    step = step_function(PendulumCase())
    a, b, u, h = (ca.SX.sym(n, k) for n, k in (("a", 2), ("b", 2), ("u", 1), ("h", 1)))
    sigma, mu_minus, mu_plus = ca.SX.sym("sigma"), ca.SX.sym("mm", 2), ca.SX.sym("mp", 2)
    r_minus, r_plus, _, _, cost = step(a, b, u, h)
    z = ca.vertcat(a, b, u, h)
    values = [r_minus, r_plus, cost]
    weighted = sigma * cost + ca.dot(mu_minus, r_minus) + ca.dot(mu_plus, r_plus)
    hessian = ca.triu(ca.hessian(weighted, z)[0])
    return {
        "residual": ca.Function("residual", [a, b, u, h], values, {"cse": True}),
        "Jacobian": ca.Function(
            "jacobian", [a, b, u, h], [ca.jacobian(v, z) for v in values], {"cse": True}
        ),
        "Hessian": ca.Function(
            "hessian", [a, b, u, h, sigma, mu_minus, mu_plus], [hessian], {"cse": True}
        ),
    }


def compare(quick: bool) -> Section:
    section = Section(
        "Kernels: nanoseconds a step",
        f"Cart-pendulum, {STEPS} steps a call, random states. CasADi's functions are those of its "
        f"own model, with common subexpressions eliminated; its C is compiled with {FLAGS} and "
        "called from a loop in C. Entries are the numbers that a call stores for a step.",
        [
            "function", "entries: dmoc", "CasADi", "dmoc C", "CasADi C",
            "CasADi VM", "dmoc NumPy", "CasADi C takes",
        ],
    )  # fmt: skip
    compiled = dmoc.load("cart_pendulum")
    numpy = build(catalogue.system("cart_pendulum"), backend="numpy")
    rng = np.random.default_rng(0)
    states = {
        name: rng.uniform(0.1, 1.0, (STEPS, k))
        for name, k in (("a", 2), ("b", 2), ("u", 1), ("h", 1), ("s", 1), ("mm", 2), ("mp", 2))
    }
    repeats = 50 if quick else 500
    for name, kernel in (("residual", "step"), ("Jacobian", "step_jac"), ("Hessian", "step_hess")):
        own = _own(compiled, kernel, states, repeats)
        slow = _own(numpy, kernel, states, max(repeats // 20, 3))
        function = functions()[name]
        inputs = [states[k] for k in ("a", "b", "u", "h", "s", "mm", "mp")][: function.n_in()]
        c = generated(function, inputs, repeats)
        machine = function.map(STEPS)
        arguments = [ca.DM(i.T) for i in inputs]
        vm, _ = timed(lambda m=machine, a=arguments: m(*a), max(repeats // 20, 3))
        entries = (
            sum(sizes_of(compiled, kernel)),
            sum(function.nnz_out(i) for i in range(function.n_out())),
        )
        section.row(
            name, *entries, *(f"{1e9 * t / STEPS:.0f}" for t in (own, c, vm, slow)), ratio(c, own)
        )
    return section


def _own(kernels: Kernels, kernel: str, s: dict[str, np.ndarray], repeats: int) -> float:
    par = np.array([[1.0, 1.0, 0.5, 10.0, np.pi / 10, 9 * np.pi / 10]])
    # The model does not depend on the time, and its steps have no node inside.
    time, nothing = np.zeros((1, 1)), np.zeros((1, 0))
    arguments = [s["a"], s["b"], s["u"], s["u"], s["h"], time, nothing, par]
    arguments += [s["mm"], s["mp"], s["s"], nothing] if kernel == "step_hess" else []
    results = [np.empty((STEPS, size)) for size in sizes_of(kernels, kernel)]
    function = kernels.functions[kernel]
    return timed(lambda: function(*arguments, *results), repeats)[0]


def sizes_of(kernels: Kernels, kernel: str) -> list[int]:
    """Numbers that each output of a kernel stores for a row."""
    outputs = kernels.manifest.kernels[kernel]["outputs"]
    return [len(o["rows"]) if "rows" in o else o["shape"][0] for o in outputs]


def generated(function: ca.Function, inputs: list[np.ndarray], repeats: int) -> float:
    """Seconds of a loop over the function's generated C."""
    with tempfile.TemporaryDirectory() as folder:
        text = Path(folder) / "f.c"
        generator = ca.CodeGenerator("f.c")
        generator.add(function)
        text.write_text(generator.dump() + LOOP)
        library = Path(folder) / "f.so"
        subprocess.run(
            ["gcc", FLAGS, "-fPIC", "-shared", "-w", str(text), "-o", str(library), "-lm"],
            check=True,
        )
        c: Any = ctypes.CDLL(str(library))
        sizes = [function.nnz_out(i) for i in range(function.n_out())]
        outputs = [np.empty((STEPS, n)) for n in sizes]
        args = [np.ascontiguousarray(i) for i in inputs]

        def pointers(arrays: list[np.ndarray]) -> Any:
            return (ctypes.c_void_p * max(len(arrays), 1))(*(a.ctypes.data for a in arrays))

        def lengths(arrays: list[np.ndarray]) -> Any:
            return (ctypes.c_longlong * len(arrays))(*(a.shape[1] for a in arrays))

        scratch = [
            np.zeros(function.sz_arg() + 1),
            np.zeros(function.sz_res() + 1),
            np.zeros(function.sz_iw() + 1),
            np.zeros(function.sz_w() + 1),
        ]
        entry = ctypes.cast(getattr(c, function.name()), ctypes.c_void_p)
        call = (
            entry, ctypes.c_longlong(STEPS), len(args), pointers(args), lengths(args), len(outputs),
            pointers(outputs), lengths(outputs), *(ctypes.c_void_p(s.ctypes.data) for s in scratch),
        )  # fmt: skip
        return timed(lambda: c.loop(*call), repeats)[0]
