"""Symbols that stand for expressions of places: the same kernels as without them, and what they
must not be."""

from __future__ import annotations

import pickle
from functools import cache
from typing import Any

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols
from systems import double_pendulum

import dmoc
from dmoc.base.errors import ModelError
from dmoc.codegen.kernels import Kernels
from dmoc.inspection.kernel_check import kernel_errors
from dmoc.symbolic.families import model_key, model_spec

T = dynamicsymbols._t
a, b, u = dynamicsymbols("a b u")
x, y, z, w = dynamicsymbols("x y z w")
m, l, g, d = sp.symbols("m l g d")


def values_of(kernels: Kernels, name: str, inputs: list[Any]) -> list[Any]:
    """Results of a kernel as full arrays."""
    full = []
    for output, values in zip(
        kernels.manifest.kernels[name]["outputs"], kernels.call(name, *inputs), strict=True
    ):
        if "rows" in output:
            dense = np.zeros((len(values), *output["shape"]))
            dense[:, *kernels.pattern(name, output["name"])] = values
            values = dense
        full.append(values)
    return full


@cache
def pendulum_kernels(named: bool, relative: bool, order: int = 2) -> Kernels:
    return dmoc.build(double_pendulum(named, relative), order=order, backend="numpy")


@pytest.mark.slow
@pytest.mark.parametrize(("relative", "order"), [(True, 2), (False, 4)])
@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")  # no time to a surface
def test_kernels_with_definitions_are_those_without(relative: bool, order: int) -> None:
    rng = np.random.default_rng(0)
    with_names, without = (pendulum_kernels(named, relative, order) for named in (True, False))
    assert set(with_names.manifest.kernels) == set(without.manifest.kernels)
    for name, facts in without.manifest.kernels.items():
        if name == "path_terms":  # as they were stated
            continue
        inputs = [rng.uniform(0.3, 1.2, (2, size)) for _, size in facts["inputs"]]
        pairs = zip(*(values_of(k, name, inputs) for k in (with_names, without)), strict=True)
        for ours, expected in pairs:
            np.testing.assert_allclose(ours, expected, rtol=1e-12, atol=1e-12, err_msg=name)


@pytest.mark.slow
def test_kernels_with_definitions_are_those_of_their_numbers() -> None:
    """Rates of definitions are differences in 90 digits there."""
    errors = kernel_errors(double_pendulum(True, relative=True), pendulum_kernels(True, True))
    assert len(errors) > 40 and max(c.error for c in errors) < 1e-12


def test_a_gap_whose_time_cancels_through_a_definition_does_not_move() -> None:
    system = dmoc.MechanicalSystem(
        "still", [a, b], a.diff() ** 2 + b.diff() ** 2, cost=1,
        definitions={x: sp.sin(T) + sp.cos(a) * sp.sin(b)}, surfaces={"wall": x <= sp.sin(T)},
    )  # fmt: skip
    assert max(c.error for c in kernel_errors(system, dmoc.build(system, backend="numpy"))) < 1e-12


def test_places_that_move_with_the_time_have_its_rate() -> None:
    """A pendulum below a support that is shaken."""
    support = sp.sin(3 * T) / 5
    named, plain = (
        dmoc.MechanicalSystem(
            "shaken", [a], m * sum(e.diff(T) ** 2 for e in (X, Y)) / 2 - m * g * Y,
            {m: 0.5, l: 0.4, g: 9.81}, definitions=definitions, cost=1,
        )
        for X, Y, definitions in (
            (y, z, {x: support, y: x + l * sp.sin(a), z: -l * sp.cos(a)}),
            (support + l * sp.sin(a), -l * sp.cos(a), {}),
        )
    )  # fmt: skip
    rng = np.random.default_rng(0)
    states = [*rng.normal(size=(2, 4, 1)), np.zeros((4, 0)), rng.uniform(size=(4, 1))]
    par = np.array([[0.5, 0.4, 9.81]])
    ours, expected = (
        dmoc.build(s, backend="numpy").call("dynamics", *states, par) for s in (named, plain)
    )
    for one, other in zip(ours, expected, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-13, atol=1e-14)


@pytest.mark.slow
def test_velocities_may_be_defined() -> None:
    """A double pendulum by the velocities in the frames of its links."""
    along, across = dynamicsymbols("along across")
    rate = a.diff() + b.diff()
    lagrangian = m * (l * a.diff()) ** 2 / 2 + m * (along**2 + across**2) / 2
    potential = -m * g * l * (2 * sp.cos(a) + sp.cos(a + b))
    moving = dmoc.MechanicalSystem(
        "moving", [a, b], lagrangian - potential, {m: 0.5, l: 0.4, g: 9.81},
        definitions={along: l * a.diff() * sp.sin(b), across: l * (a.diff() * sp.cos(b) + rate)},
        cost=along**2, path_constraints={"speed": across <= 3},
    )  # fmt: skip
    places = double_pendulum(False, relative=True, dissipation=0, forces={b: u}, parameters={
        m: 0.5, l: 0.4, g: 9.81}, constraints={})  # fmt: skip
    assert sp.simplify(moving.mass_matrix - places.mass_matrix) == sp.zeros(2)
    kernels = [dmoc.build(s, backend="numpy") for s in (moving, places)]
    rng = np.random.default_rng(0)
    q, v, input_, time = (rng.normal(size=(3, size)) for size in (2, 2, 1, 1))
    par = np.array([list(kernels[0].parameters.values())])
    M, F = kernels[0].call("dynamics", q, v, input_[:, :0], time, par)
    M_2, F_2 = kernels[1].call("dynamics", q, v, 0 * input_, time, par)
    np.testing.assert_allclose(M, M_2, atol=1e-13)
    np.testing.assert_allclose(F, F_2, atol=1e-13)


def test_properties_are_in_coordinates_where_they_say_so() -> None:
    system = double_pendulum(True)
    expected = double_pendulum(False)
    assert sp.simplify(system.mass_matrix - expected.mass_matrix) == sp.zeros(2)
    for force, other in zip(system.force_vector, expected.force_vector, strict=True):
        places = {dynamicsymbols("x2"): l * sp.sin(a) + l * sp.sin(b)}
        assert sp.simplify(force.xreplace(places) - other) == 0
    assert system.shapes[1].normal == (0, 1)


@pytest.mark.slow
def test_the_order_of_normals_does_not_need_places_to_be_named() -> None:
    """A normal that turns is that of the places written out."""
    named, plain = (
        double_pendulum(
            named,
            surfaces={"floor": l**2 <= X**2 + Y**2},
            drawing=[dmoc.Contact("floor", (X, Y))],
        ).shapes[0].normal
        for named, X, Y in (
            (True, *dynamicsymbols("x2 y2")),
            (False, l * sp.sin(a) + l * sp.sin(b), -l * sp.cos(a) - l * sp.cos(b)),
        )
    )  # fmt: skip
    x, y = dynamicsymbols("x2 y2")
    end = {x: l * sp.sin(a) + l * sp.sin(b), y: -l * sp.cos(a) - l * sp.cos(b)}
    at = {a: 0.3, b: 0.9, l: 0.4}
    ways = [np.array([float(n.subs(end).subs(at)) for n in way]) for way in (named, plain)]
    np.testing.assert_allclose(*[way / np.linalg.norm(way) for way in ways], rtol=1e-12)


@pytest.mark.slow
def test_a_solve_with_definitions_is_one_without() -> None:
    """A pendulum swings up over a post."""
    solutions = []
    for named in (True, False):
        place = {x: l * sp.sin(a), y: -l * sp.cos(a)}
        X, Y = (x, y) if named else place.values()
        system = dmoc.MechanicalSystem(
            "swing", [a], m * (X.diff(T) ** 2 + Y.diff(T) ** 2) / 2 - m * g * Y,
            {m: 0.5, l: 0.4, g: 9.81}, inputs=[u], forces={a: u}, cost=u**2,
            surfaces={"post": -l / 2 <= X}, definitions=place if named else {},
        )  # fmt: skip
        problem = dmoc.Problem(
            system, start={"a": 0.0, "a_dot": 0.0}, goal={"a": 1.0, "a_dot": 0.0},
            sequence=["post"], steps=10, final_time=2.0,
        )  # fmt: skip
        solutions.append(dmoc.solve(problem, "ipm", starts=1, verify=False))
    assert {s.status for s in solutions} == {"solved"}
    assert solutions[0].cost == pytest.approx(solutions[1].cost, rel=1e-9)


def test_definitions_belong_to_what_a_model_is() -> None:
    system = double_pendulum(True)
    assert pickle.loads(pickle.dumps(system)).fingerprint() == system.fingerprint()
    moved = double_pendulum(True, definitions=system.definitions | {dynamicsymbols("x1"): 2 * a})
    assert moved.fingerprint() != system.fingerprint()
    assert model_key(moved) != model_key(system)
    assert ("x2", "l*sin(b) + x1") in system.summary().rows
    assert r"x_{2} &= l \sin{\left(b \right)} + x_{1}" in system._repr_latex_()
    assert model_spec(system).facts["surface_coordinates"] == {"floor": [0, 1], "wall": [0, 1]}


MISTAKES = [
    ({x: 2 * x}, "definition x contains itself: expected what is defined before it"),
    ({x: a + y, y: 2 * a}, "definition x contains y, which is defined after it: put y before x"),
    ({x: x.diff()}, "definition x contains itself"),
    ({y: a.diff(), x: y.diff(T)}, r"contains Derivative\(y\(t\), t\), an acceleration: y\(t\) is"),
    ({x: a.diff(T, 2)}, "which is not the first derivative of a coordinate"),
    ({x: a + u}, r"definition x contains u\(t\), one of the inputs: expected coordinates, vel"),
    ({x: a * sp.Symbol("k")}, "definition x contains the symbol k, which is unknown"),
    (
        {x: a + dynamicsymbols("other")},
        r"contains other\(t\), which is no coordinate, no input and no definition",
    ),
    ({a: 2 * b}, "the name 'a' is used twice, as coordinate and as definition: rename one"),
    ({u: 2 * b}, "the name 'u' is used twice, as input and as definition"),
    ({dynamicsymbols("m"): 2 * b}, "the name 'm' is used twice, as parameter and as definition"),
    ({dynamicsymbols("a_dot"): 2 * b}, "'a_dot' is used twice"),
    ({dynamicsymbols("p_a"): 2 * b}, "'p_a' is used twice"),
    ({sp.Symbol("x"): a}, "definition x is not a function of time: make it with"),
    ({"x": a}, "definition 'x' is not a function of time"),
    ({x: sp.sign(a)}, r"definition x contains sign\(a\(t\)\), whose jump"),
    ({x: "a"}, "definition x is not a scalar SymPy expression"),
    ([x], r"definitions = .*: expected a mapping such as \{x1: l \* sp.sin\(a\)\}"),
]


@pytest.mark.parametrize(("definitions", "message"), MISTAKES)
def test_a_wrong_definition_is_one_sentence(definitions: Any, message: str) -> None:
    with pytest.raises(ModelError, match=message) as error:
        dmoc.MechanicalSystem(
            "wrong", [a, b], m * (a.diff() ** 2 + b.diff() ** 2) / 2, {m: 1.0}, inputs=[u],
            forces={a: u}, definitions=definitions,
        )  # fmt: skip
    assert "\n" not in str(error.value) and str(error.value).endswith(".")


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"surfaces": {"s": x.diff() <= 1}}, r"one of the velocities of definitions: expected"),
        ({"surfaces": {"s": w <= 1}}, r"w\(t\), one of the definitions of vel.*limit of a vel"),
        ({"drawing": [dmoc.Point((w, 0))]}, r"w\(t\), one of the definitions of velocities"),
        ({"surfaces": {"s": z <= 1}}, r"z\(t\), one of the definitions of velocities"),
        ({"cost": w.diff() ** 2}, r"Derivative\(w\(t\), t\), an acceleration"),
        ({"friction": {"floor": w}, "tangents": {"floor": a}, "surfaces": {"floor": a <= 1}},
         r"contains w\(t\), one of the definitions of velocities: expected coordinates, the time"),
        ({"cost": x.diff(T, 2)}, "which is not the first derivative of a coordinate"),
        ({"surfaces": {"s": y <= 1}}, "surface 's' contains no coordinate"),
        ({"lagrangian": x.diff() ** 2}, "the velocity of coordinate b"),
        ({"lagrangian": (x.diff() + b.diff()) ** 2}, "is singular"),
        ({"lagrangian": (x.diff() ** 2 + b.diff() ** 2) ** 2}, "is not quadratic"),
    ],
)  # fmt: skip
def test_definitions_belong_where_their_coordinates_do(fields: Any, message: str) -> None:
    stated = {"lagrangian": m * (a.diff() ** 2 + b.diff() ** 2) / 2} | fields
    used = {m: 1.0} if "lagrangian" not in fields else {}
    with pytest.raises(ModelError, match=message):
        dmoc.MechanicalSystem(
            "wrong", [a, b], parameters=used, inputs=[u], forces={a: u},
            definitions={x: sp.sin(a), y: 1 + T, w: x.diff() * y, z: 2 * w}, **stated,
        )  # fmt: skip
