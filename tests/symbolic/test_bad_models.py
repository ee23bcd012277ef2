"""Bad descriptions of a model: each is refused in one sentence, and no text is evaluated."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import pytest
import sympy as sp
from answers import answer_of
from sympy.physics.mechanics import LagrangesMethod, dynamicsymbols
from systems import block_system

import dmoc
from dmoc.base.discretisation import ORDERS
from dmoc.base.errors import DmocError, ModelError
from dmoc.codegen.text import c_files
from dmoc.symbolic.families import model_key, model_spec

T = dynamicsymbols._t
x, y, u = dynamicsymbols("x y u")
m, k = sp.symbols("m k")
HUGE = 10**400
ENDLESS = 10**5000  # Python refuses to write it
CODE = '__import__("builtins").evaluated.append(1)'


class Hostile:
    """An object that SymPy would ask what it is."""

    def _sympy_(self) -> Any:
        raise AssertionError("an object of another kind was asked for an expression")

    def __repr__(self) -> str:
        return "several\nlines " + "and so on " * 100


def make(**fields: Any) -> dmoc.MechanicalSystem:
    statement = {
        "name": "bad", "coordinates": [x], "inputs": [u], "lagrangian": m * x.diff(T) ** 2 / 2,
        "forces": {x: u}, "parameters": {m: 1.0}, "cost": u**2, **fields,
    }  # fmt: skip
    return dmoc.MechanicalSystem(**statement)


WRONG = [
    CODE, "", b"x", None, True, HUGE, ENDLESS, -HUGE, 1j, complex("nan"), float("nan"),
    float("inf"), [], {}, object(), Hostile(), Hostile, np.ones(2), sp.I, sp.oo, sp.nan, sp.zoo,
    sp.Matrix([x]), sp.true, x <= 1, sp.Float("1e-400"), sp.Rational(1, HUGE),
    sp.Symbol("A", commutative=False) * sp.Symbol("B", commutative=False),
]  # fmt: skip
SCALARS = ("lagrangian", "cost", "dissipation", "terminal_cost")
CASES: list[dict[str, Any]] = [{field: value} for field in SCALARS for value in WRONG]
CASES += [{"forces": {x: value}} for value in WRONG]
CASES += [
    {field: {"s": value}}
    for field in ("surfaces", "path_constraints")
    for value in WRONG
    if not isinstance(value, sp.Rel)
]
CASES += [{"parameters": {m: value}} for value in WRONG if value is not None]
CASES += [
    {"parameters": {m: value}}
    for value in ("1.0", 1e-300, 1e300, sp.Symbol("a"), np.array([1.0]), np.bool_(True))
]
CASES += [
    {"lagrangian": value * x.diff(T) ** 2 / 2, "parameters": {}}
    for value in (1e-300, sp.Float("1e300"), HUGE, 0, -sp.I)
]
NO_PARTS = (
    CODE, None, 1, ENDLESS, x, Hostile(), [CODE], [None], [ENDLESS], [1], {CODE: 1}, {None: 1},
    {ENDLESS: 1}, {u: CODE}, {1.5: x},
)  # fmt: skip
PARTS = "coordinates inputs parameters forces surfaces path_constraints units".split()
CASES += [
    {field: value}
    for field in PARTS
    for value in NO_PARTS
    if not (field in ("parameters", "units") and value == {u: CODE})
]
CASES += [{"coordinates": {x}}, {"inputs": {u}}]
CASES += [
    {"name": value}
    for value in (None, 1, ENDLESS, b"m", "", "a b", "../m", "x" * 65, "while", ["m"])
]
CASES += [{"title": value} for value in (None, 1, b"t", "two\nlines", ["t"])]
CASES += [{"units": {x: value}} for value in (None, 1, "", "x" * 17, "a\nb", ENDLESS)]
CASES += [
    {"coordinates": [value], "forces": {}, "inputs": [], "cost": 0}
    for value in (sp.Function("f")(m), sp.Symbol("x"), x.diff(T))
]
CASES += [
    {
        "parameters": {sp.Symbol("m", **facts): value},
        "lagrangian": sp.Symbol("m", **facts) * x.diff(T) ** 2,
    }
    for facts, value in (
        ({"positive": True}, -1.0),
        ({"negative": True}, 1.0),
        ({"nonzero": True}, 0.0),
        ({"imaginary": True}, 1.0),
        ({"commutative": False}, 1.0),
    )
]


@pytest.fixture
def evaluated(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """What text that is run as Python would change."""
    import builtins

    marks: list[int] = []
    monkeypatch.setattr(builtins, "evaluated", marks, raising=False)
    return marks


def sentence(error: DmocError) -> str:
    text = str(error)
    assert "\n" not in text and len(text) < 500 and text.endswith(".")
    return text


def label(case: dict[str, Any]) -> str:
    (field, value), *_ = case.items()
    inner = next(iter(value.values())) if isinstance(value, dict) and value else value
    return f"{field} {type(inner).__name__}"


@pytest.mark.parametrize("case", CASES, ids=label)
def test_a_bad_description_is_refused_in_one_sentence(
    case: dict[str, Any], evaluated: list[int]
) -> None:
    with pytest.raises(ModelError) as error:
        make(**case)
    sentence(error.value)
    assert evaluated == []


@pytest.mark.parametrize("field", ["cost", "terminal_cost", "dissipation"])
@pytest.mark.parametrize("zero", [0.0, sp.Float(0), np.float64(0)])
def test_zero_may_be_a_float(field: str, zero: Any) -> None:
    assert getattr(make(**{field: zero}), field) == 0


@pytest.mark.parametrize("field", SCALARS)
def test_text_is_no_expression(field: str) -> None:
    with pytest.raises(ModelError, match="write it with SymPy's symbols"):
        make(**{field: "x**2"})


def test_imported_models_take_no_text_either(evaluated: list[int]) -> None:
    method = LagrangesMethod(m * x.diff(T) ** 2 / 2, [x])
    values = {m: 1.0}
    for fields in (
        {"forces": {x: CODE}},
        {"cost": CODE},
        {"surfaces": {"s": CODE}},
        {"forces": {CODE: u}},
        {"forces": CODE},
        {"title": 1},
    ):
        with pytest.raises(ModelError) as error:
            dmoc.MechanicalSystem.from_lagranges_method("m", method, values, **fields)
        sentence(error.value)
    for other in (CODE, None, 1, Hostile(), block_system()):
        for take in (
            dmoc.MechanicalSystem.from_lagranges_method,
            dmoc.MechanicalSystem.from_joints,
        ):
            with pytest.raises(ModelError) as error:
                take("m", other, values)
            sentence(error.value)
    assert evaluated == []


@pytest.mark.parametrize(
    "other",
    [None, CODE, 1, ENDLESS, block_system, Hostile(), dmoc.MechanicalSystem],
    ids=lambda o: type(o).__name__,
)
def test_only_a_system_is_derived(other: Any) -> None:
    for use in (dmoc.derive, model_spec, model_key):
        with pytest.raises(ModelError, match="expected a MechanicalSystem") as error:
            use(other)
        sentence(error.value)


@pytest.mark.parametrize(
    "order",
    [None, "2", 3, 0, -2, 2.0, True, ENDLESS, [2], np.array([2, 4]), Hostile()],
    ids=lambda o: type(o).__name__,
)
def test_only_the_orders_that_exist_are_derived(order: Any) -> None:
    for use in (dmoc.derive, model_spec):
        with pytest.raises(ModelError, match=r"order = .*: expected one of 2, 4") as error:
            use(block_system(), order)
        sentence(error.value)


@pytest.mark.slow
def test_orders_may_be_numbers_of_numpy() -> None:
    for order in ORDERS:
        spec = model_spec(block_system(), np.int64(order))
        assert c_files(spec) == c_files(model_spec(block_system(), order))
        assert type(spec.facts["order"]) is int


@pytest.mark.parametrize(
    "value",
    [
        2, 2.0, np.float64(2), np.float32(2), np.int64(2), Fraction(4, 2), sp.Integer(2),
        sp.Float(2), sp.sqrt(4),
    ],
)  # fmt: skip
def test_numbers_of_any_kind_are_numbers(value: Any) -> None:
    system = make(
        cost=value, terminal_cost=value, forces={x: u * 1 + sp.S.Zero}, parameters={m: value}
    )
    assert float(system.cost) == float(system.terminal_cost) == 2.0
    assert system.parameters == {m: 2.0} and type(system.parameters[m]) is float


V, W = x.diff(T), y.diff(T)
ALONE = "coordinates, the time and parameters alone"


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        (
            {"surfaces": {"w": x + V <= 1}},
            "surface 'w' contains Derivative(x(t), t), one of the velocities: expected "
            f"{ALONE}; a limit of a velocity is a path constraint.",
        ),
        (
            {"surfaces": {"w": x + u <= 1}},
            f"surface 'w' contains u(t), one of the inputs: expected {ALONE}; a limit of an input "
            "is a bound or a path constraint.",
        ),
        (
            {"tangents": {"r": x}, "friction": {"r": 1 + sp.exp(-(V**2))}},
            "the friction of 'r' contains Derivative(x(t), t), one of the velocities: expected "
            "coordinates, the time, parameters, inputs and the sliding speed alone; the magnitude "
            "of the rate of its tangent is dmoc.sliding_speed.",
        ),
        (
            {"lagrangian": m * V**2 / 2 + x * u},
            "the Lagrangian contains u(t), one of the inputs: expected coordinates, velocities, "
            "the time and parameters alone; inputs enter through `forces`.",
        ),
        (
            {"cost": u.diff(T) ** 2},
            "the cost contains Derivative(u(t), t), which is not the first derivative of a "
            "coordinate: expected coordinates, velocities, inputs, the time and parameters alone.",
        ),
        ({"forces": {"x": u, x: u}}, "the force on x is given twice: add both."),
        (
            {"forces": {"y": u}},
            "the force on 'y' belongs to no coordinate: expected one of x.",
        ),
        (
            {"surfaces": {"s": (x <= 1) & (x >= -1)}},
            "surface 's' joins 2 relations: give each one a name of its own.",
        ),
        (
            {"path_constraints": {"s": (V <= 1) & (V >= -1), "s_1": u <= 1}},
            "two path constraints have the name 's_1': rename one.",
        ),
        (
            {"name": "short"},
            "model name 'short' is a keyword of C or Python: choose another name, such as short_1.",
        ),
    ],
)
def test_a_refusal_says_what_was_expected(fields: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ModelError) as error:
        make(**fields)
    assert str(error.value) == sentence


def test_a_force_belongs_to_a_coordinate_or_to_its_name() -> None:
    assert make(forces={"x": u}).fingerprint() == make(forces={x: u}).fingerprint()


@pytest.mark.slow
def test_names_of_parts_may_be_words_of_c_or_python() -> None:
    """They are data: nothing in the generated code is called so."""
    system = make(
        name="words",
        surfaces={"double": x <= 5},
        path_constraints={"short": u <= 3, "lambda": V <= 0.7},
    )
    problem = dmoc.Problem(system, {x: 0}, {x: 0.5, "x_dot": 0}, steps=20, final_time=1.0)
    solution = answer_of(problem, "ipm", starts=1)
    assert "path constraint lambda in" in " ".join(solution.active_bounds)


def test_relations_that_are_joined_are_constraints_of_their_own() -> None:
    """abs(v) <= 3/4 as one condition and as two."""
    joined = make(path_constraints={"v": (V <= 0.75) & (V >= -0.75)})
    assert set(joined.path_functions.values()) == {V + 0.75, 0.75 - V}
    assert list(joined.path_functions) == ["v_1", "v_2"]


@pytest.mark.parametrize(
    "kinetic",
    [
        (V / 3 + W / 7) ** 2 / 2,
        (sp.pi * V + sp.sqrt(2) * W) ** 2,
        (sp.Float("0.1") * V + sp.Float("0.3") * W) ** 2,
        V**2 / 9 + 2 * V * W / 21 + W**2 / 49,
        (sp.cos(x) * V / 3 + W / 7) ** 2,
    ],
)
def test_masses_are_singular_whatever_a_float_makes_of_their_constants(kinetic: Any) -> None:
    with pytest.raises(ModelError, match="its determinant is zero everywhere"):
        make(coordinates=[x, y], lagrangian=kinetic, parameters={})
    make(coordinates=[x, y], lagrangian=kinetic + sp.Float("1e-12") * W**2, parameters={})
