"""Names of a model never meet those that the program makes, in the kernels and in the
derivation."""

from __future__ import annotations

import re
from functools import cache
from typing import Any

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.discretisation import ORDERS
from dmoc.base.errors import ModelError
from dmoc.codegen.kernels import Kernels
from dmoc.symbolic.derivation.document import Derivation

pytestmark = pytest.mark.slow

T = dynamicsymbols._t
# Symbols, arguments, results, temporaries and display names of the derivation, the kernels and the
# generated code.
MADE = """x_m x_dot_m t_m x_k x_kp1 x_i x_1 x_2 x_dot_1 x_dot_2 t_1 t_2 t_k t_0 h u_k u_kp1
    u_free q_k q_kp1 q_i q_k_0 q_kp1_0 q_i_0 u_k_0 u_kp1_0 q_0 v_0 u_0 par_0 q_0_1
    v_0_1 q_0_2 q v par z lam lam_wall e_wall e_plus e_minus e_plus_D W_t W_gamma
    gamma gamma_D x_k w w0 w1 x0 x1 w_0 w_e w_e_0 w_W_gamma w_gamma w_gamma_0 w_plus
    w_minus mu mu_0 mu_minus mu_minus_0 mu_plus_0 mu_i_0 sigma sigma_0 lam_0 e_0 a_0
    q_c q_c_0 x_ddot x_ddot_bar x_bar delta_x r_plus_x r_minus_x r_i_x r_minus r_plus
    r_d r_i_0 L L_d C C_d M E Q F B Q_x H I N O S pi e i j n D1_Ld_x D3_Ld fd_minus_x
    g g_wall grad Phi T_min T_min_wall x_free x_dot_k x_k_dot step power2 in out
    stride kernel MOST np sin sqrt INFINITY M_PI NULL ptrdiff_t views names
    lagrangian lagrangian_1 lagrangian_w0 along_0 d0 z0""".split()
NAMES = sorted({*MADE, "short", "lambda", "double"})
INSIDE = ["x_1", "x_dot_2", "x_i", "t_1", "t_k", "h", "u_k", "mu_i_0", "r_i_x", "x_kp1"]
VALUES = [round(0.1 + 0.01 * i, 2) for i in range(len(NAMES))]
GROUPS = [NAMES[i : i + 40] for i in range(0, len(NAMES), 40)]


PLAIN = [f"plain{i}" for i in range(len(NAMES))]  # that nothing else has


def share(i: int, count: int) -> float:
    """What the number i of so many parameters is multiplied by in the sum that a model has."""
    return VALUES[::-1][i] / count


def model(parameters: list[Any]) -> dmoc.MechanicalSystem:
    """A system with all parameters in every function."""
    x, u = dynamicsymbols("x u")
    rate = x.diff(T)
    values = dict(zip(parameters, VALUES, strict=False))
    p = sum(share(i, len(parameters)) * s for i, s in enumerate(parameters))
    return dmoc.MechanicalSystem(
        "named", coordinates=[x], inputs=[u],
        lagrangian=(1 + p * x**2) * rate**2 / 2 - p * x**2 * (1 + T) / 2,
        forces={x: u * p - rate * T}, surfaces={"wall": x <= p}, parameters=values,
        cost=p * u**2 + x, terminal_cost=p * rate**2, path_constraints={"limit": u * rate <= p},
    )  # fmt: skip


def values(kernels: Kernels) -> dict[str, list[np.ndarray]]:
    rng = np.random.default_rng(3)
    results = {}
    for name, kernel in kernels.manifest.kernels.items():
        inputs = [rng.uniform(0.5, 1.5, (3, size)) for _, size in kernel["inputs"]]
        with np.errstate(all="ignore"):
            results[name] = [np.array(a) for a in kernels.call(name, *inputs)]
    return results


def assert_same(kernels: Kernels, reference: Kernels) -> None:
    pairs = zip(values(kernels).items(), values(reference).items(), strict=True)
    for (name, results), (other, expected) in pairs:
        assert name == other
        for a, b in zip(results, expected, strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-12, err_msg=name)


# How symbols are replaced depends on what they are assumed to be, and not on the order.
@pytest.mark.parametrize(
    ("assumptions", "order"), [({}, 2), *(({"real": True}, order) for order in ORDERS)]
)
def test_parameters_of_any_name_leave_the_kernels_as_they_are(
    assumptions: dict[str, bool], order: int
) -> None:
    kernels = dmoc.build(model(sp.symbols(NAMES, **assumptions)), order=order, backend="numpy")
    assert_same(kernels, reference(order))


@cache
def reference(order: int) -> Kernels:
    return dmoc.build(model(sp.symbols(PLAIN)), order=order, backend="numpy")


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("name", ["v_0", "q_0_1", "h"])
def test_parameters_and_coordinates_may_change_names(name: str, order: int) -> None:
    """Two parameters, each with a name of the other's place, and a coordinate called like an
    argument."""
    first, second = sp.symbols("par_1 par_0", real=True)
    x, u = dynamicsymbols(f"{name} u")
    rate = x.diff(T)
    system = dmoc.MechanicalSystem(
        "named", [x], first * rate**2 / 2 - second * x, {first: 2.0, second: 3.0}, [u], {x: u}
    )
    kernels = dmoc.build(system, order=order, backend="numpy")
    one = np.ones((1, 1))
    M, F = kernels.call("dynamics", one, one, 5 * one, one, np.array([[2.0, 3.0]]))
    assert M[0, 0] == 2.0 and F[0, 0] == 5.0 - 3.0


def read(derivation: Derivation, name: str, point: dict[str, float]) -> float:
    """The value of an equation for a reader who knows symbols by their names alone."""
    (right,) = (
        e.right for s in derivation.sections for e in s.equations if e.name.rstrip("~") == name
    )
    return valued(right, point)


def valued(expression: Any, point: dict[str, float]) -> float:
    symbols = sorted(expression.free_symbols, key=str)
    function = sp.lambdify(symbols, expression, "math")
    return float(function(*(point[s.name] for s in symbols)))


def step_of(derivation: Derivation, parameters: dict[str, float]) -> dict[str, float]:
    """The numbers of a step under the names that the derivation prints, the points inside the
    step as it defines them."""
    (text,) = (s.text for s in derivation.sections if s.title == "First derivatives")
    unknowns = re.search(r"x_k = \((.*?)\)", text)[1].split(", ")  # type: ignore[index]
    assert not set(parameters) & set(unknowns)
    point = parameters | dict(zip(unknowns, (0.3, 0.7, 1.1, -0.4, 0.2, 0.9, 0.55), strict=False))
    (section,) = (s for s in derivation.sections if s.title.endswith(" of a step"))
    for equation in section.equations:
        assert equation.name not in point
        point[equation.name] = valued(equation.right, point)
    return point


@cache
def derived(names: tuple[str, ...], order: int) -> Derivation:
    return dmoc.derive(model(list(sp.symbols(names))), order)


@pytest.mark.parametrize(("names", "order"), [*((names, 2) for names in GROUPS), (INSIDE, 4)])
def test_the_derivation_prints_what_is_true_for_parameters_of_any_name(
    names: list[str], order: int
) -> None:
    """They print what they print for one parameter of their sum's value."""
    derivation, other = derived(tuple(names), order), derived(("plain0",), order)
    mine = dict(zip(names, VALUES, strict=False))
    sum_of_all = sum(share(i, len(names)) * value for i, value in enumerate(mine.values()))
    others = {"plain0": sum_of_all / share(0, 1)}
    state = {"x": 0.3, "x_dot": 0.6, "t": 0.8}
    for left in ("L", "E", "Phi"):
        assert read(derivation, left, mine | state) == pytest.approx(
            read(other, left, others | state), rel=1e-13
        ), left
    mine, others = step_of(derivation, mine), step_of(other, others)
    for left in ("L_d", "D3_Ld", "r_minus_x", "e_plus", "C_d"):
        assert read(derivation, left, mine) == pytest.approx(
            read(other, left, others), rel=1e-12
        ), left
    assert not set(names) & {e.name for s in derivation.sections for e in s.equations}


def test_a_marked_name_is_explained_and_has_its_own_latex() -> None:
    derivation = dmoc.derive(model([sp.Symbol("x_m")]))
    assert "x_m~ with ~" in derivation.sections[0].text and "x_m~ = " in str(derivation)
    assert r"\tilde{x}_{m}" in derivation.latex()
    assert "~" not in str(dmoc.derive(model([sp.Symbol("mass")])))


# Nodes inside a step have names of their own at each order.
INSIDE_PAIRS = [("x", "x_1"), ("x", "x_k")]
PAIRS = [("x", "x_ddot"), ("r_plus", "k"), ("mu", "delta"), ("delta", "ddot")]


@pytest.mark.parametrize(
    ("pair", "order"),
    [*((p, 2) for p in PAIRS), *((p, order) for p in INSIDE_PAIRS for order in ORDERS)],
)
def test_no_two_symbols_of_a_derivation_look_the_same(pair: tuple[str, str], order: int) -> None:
    a, b = (dynamicsymbols(name) for name in pair)
    system = dmoc.MechanicalSystem(
        "pair", [a, b], a.diff(T) ** 2 + b.diff(T) ** 2 - a * b**2, {},
        surfaces={"plus": a + b <= 1, "x": a <= 1},
    )  # fmt: skip
    derivation = dmoc.derive(system, order)
    symbols = {
        s
        for section in derivation.sections
        for e in section.equations
        for s in e.right.free_symbols
    }  # fmt: skip
    assert len({s.name for s in symbols}) == len(symbols)


@pytest.mark.parametrize(
    "name", ["x_dot", "p_x", "t", "x", "u", "a-b", "1a", "", "é", "_x", "a" * 65, "x_m~"],
)  # fmt: skip
def test_a_parameter_name_that_cannot_be_used_is_refused(name: str) -> None:
    with pytest.raises(ModelError, match="name") as error:
        model([sp.Symbol(name)])
    assert name in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize("assumptions", [{"positive": True}, {"real": True}])
def test_a_symbol_with_other_assumptions_is_another_symbol(assumptions: dict[str, bool]) -> None:
    x, m = dynamicsymbols("x"), sp.Symbol("m")
    with pytest.raises(ModelError, match="of the same name with other assumptions"):
        dmoc.MechanicalSystem(
            "two", [x], m * x.diff(T) ** 2 / 2, {sp.Symbol("m", **assumptions): 1.0}
        )
    with pytest.raises(ModelError, match="used twice"):
        dmoc.MechanicalSystem(
            "two", [x], m * x.diff(T) ** 2 / 2, {m: 1.0, sp.Symbol("m", **assumptions): 1.0}
        )
    with pytest.raises(ModelError, match=r"the time is dynamicsymbols\._t"):
        dmoc.MechanicalSystem(
            "two", [x], x.diff(T) ** 2 / 2 - x * sp.Symbol("t", **assumptions), {}
        )
