"""What users pass by mistake: every case is refused in one sentence that names the argument, or
ends in a status; none in a traceback."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols
from systems import block_system

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.errors import (
    BuildError,
    ModelError,
    ProblemError,
    SearchError,
    SimulationError,
    SolutionFileError,
)
from dmoc.trajectory import Phase, Trajectory

X, U = dynamicsymbols("x u")
T = dynamicsymbols._t
HUGE = 10**400
BEYOND_TEXT = 10**5000  # Python refuses to print integers of more than 4300 digits
NAN, INF = math.nan, math.inf
# Values that are no number, and numbers that are not finite.
NO_NUMBERS: tuple[Any, ...] = (
    "1",
    b"1",
    True,
    np.True_,
    1 + 0j,
    np.complex128(1),
    [1.0],
    (1.0,),
    {"a": 1},
    {1.0},
    object(),
    sp.Symbol("a"),
    sp.I,
    np.array([1.0]),
    np.array([[1.0, 2.0]]),
    np.array("1"),
    np.array(1j),
    np.array(None),
    lambda: 1.0,
    Decimal("NaN"),
    NAN,
    INF,
    -INF,
    HUGE,
    -HUGE,
    BEYOND_TEXT,
    np.float32("nan"),
    np.datetime64("2020-01-01"),
)
NO_RANGES: tuple[Any, ...] = (
    "01",
    b"01",
    True,
    1j,
    (),
    (1,),
    (0, 1, 2),
    [[0, 1]],
    ((0, 1), (0, 1)),
    ("0", "1"),
    (True, 2),
    (NAN, 1),
    (0, NAN),
    (INF, None),
    (None, -INF),
    (0, 1j),
    (0, HUGE),
    (0, [1]),
    {0: 1},
    {0, 1},
    range(3),
    np.zeros((2, 2)),
    np.array([0, NAN]),
    np.array(["0", "1"]),
    (2, 1),
    [1, -1],
    (x for x in (0, 1)),
    object(),
    HUGE,
    NAN,
)
NO_LISTS: tuple[Any, ...] = (
    "wall",
    b"wall",
    None,
    5,
    1.5,
    True,
    {"wall"},
    {"wall": 1},
    frozenset(),
    object(),
    sp.Symbol("wall"),
    np.array("wall"),
)
NO_MAPPINGS: tuple[Any, ...] = (
    None,
    5,
    "x",
    b"x",
    ["x"],
    ("x", 1),
    {"x"},
    [("x", 1)],
    np.zeros(2),
    object(),
    dict,
)
NO_NAMES: tuple[Any, ...] = (
    "y",
    "",
    "X",
    "x ",
    "x\n",
    "x_ddot",
    None,
    0,
    1.5,
    (),
    b"x",
    "x" * 100_000,
    X.diff(T, 2),
    X + U,
    2 * X,
    X.diff(T) + X,
    sp.Symbol("z"),
    frozenset("x"),
)
NO_WHOLE: tuple[Any, ...] = (
    0,
    -1,
    1.0,
    2.5,
    "2",
    b"2",
    None,
    True,
    2j,
    NAN,
    INF,
    -HUGE,
    HUGE,
    BEYOND_TEXT,
    sp.Integer(5),
    [5],
    np.array([5]),
    {},
)
NO_FLAGS: tuple[Any, ...] = ("no", "", None, 0, 1, 0.0, [], np.array([True, False]))
NO_PROBLEMS: tuple[Any, ...] = (
    None,
    5,
    "block",
    b"block",
    [],
    {},
    (),
    object(),
    np.zeros(3),
    dmoc.Problem,
)

Call = Callable[[Kernels, dmoc.Problem], Any]


@dataclass(frozen=True)
class Case:
    """A call with one mistake, the error that it must end in, and what the sentence must name."""

    name: str
    call: Call
    error: type[dmoc.DmocError]
    names: str


def stated(**changes: Any) -> Call:
    return lambda kernels, _: dmoc.Problem(
        kernels, **{"start": {"x": 0.0}, "steps": 4, "final_time": 1.0, **changes}
    )


def problem_cases() -> Iterator[Case]:
    def case(field: str, value: Any, names: str = "") -> Case:
        return Case(field, stated(**{field: value}), ProblemError, names or field)

    for value in (*NO_PROBLEMS, "cart_pendulum", block_system):
        yield Case(
            "kernels",
            lambda _, __, value=value: dmoc.Problem(value, start={"x": 0}),
            ProblemError,
            "kernels",
        )
    for field in ("start", "goal", "bounds", "parameters"):
        for value in NO_MAPPINGS:
            yield case(field, value)
        for name in NO_NAMES:
            yield case(field, {"x": 0.0, name: 1.0} if field == "start" else {name: 1.0}, "unknown")
    for value in NO_NUMBERS:
        yield case("parameters", {"m": value}, "parameter m")
        yield case("restitution", value)
        yield case("restitution", {"wall": value}, "restitution of 'wall'")
        if np.ndim(value) == 0 and not isinstance(value, (dict, set)):
            yield case("start", {"x": value}, "start of x")
            yield case("final_time", value)
    for value in NO_RANGES:
        yield case("start", {"x": value}, "start of x")
        yield case("goal", {"x_dot": value}, "goal of x_dot")
        yield case("goal", {"p_x": value}, "goal of p_x")
        yield case("bounds", {"u": value}, "bounds of u")
        yield case("bounds", {"x": value}, "bounds of x")
        yield case("final_time", value)
        yield case("durations", [value], "durations of phase 0")
    for value in (5, 0, 5.0, np.float64(5), np.int64(5), Fraction(5), sp.Integer(5), np.array(5.0)):
        yield case("bounds", {"u": value}, "(lower, upper)")
    yield case("parameters", {"m": None}, "parameter m")
    yield case("restitution", None)
    for value in (-0.1, 1.1, -1, 2):
        yield case("restitution", value)
        yield case("restitution", {"wall": value}, "restitution of 'wall'")
    for name in ("wal", "", None, 0, "w" * 100_000):
        yield case("restitution", {name: 0.5})
    for value in (0, 0.0, -1, (None, 0), (-1, 1), (-2, -1), (None, -1)):
        yield case("final_time", value)
        yield case("durations", [value], "durations of phase 0")
    for value in (1e200, 1e308, 1e-300, 1e-320, (0, 1e200), (1e-200, None)):
        yield case("final_time", value)
        yield case("durations", [value], "durations of phase 0")
    for value in NO_LISTS:
        if value is not None:
            yield case("durations", value)
        yield case("periodic", value)
        yield case("sequence", value)
    for value in ([], [1, 1], [None] * 3, np.ones((2, 2))):
        yield case("durations", value)
    for value in (
        ["Wall"],
        [None],
        [0],
        [["wall"]],
        [("wall",)],
        [b"wall"],
        [{"wall"}],
        [sp.Symbol("wall")],
        ["w" * 100_000],
        [""],
        [object()],
    ):
        yield case("sequence", value)
    yield case("sequence", itertools.repeat("wall"))
    yield case("sequence", ["wall"] * 10**6)
    yield case("periodic", itertools.repeat("x"))
    for value in (
        ["z"],
        [None],
        [0],
        [["x"]],
        ["x", "x"],
        ["x", X],
        [b"x"],
        [X + U],
        [X.diff(T, 2)],
    ):
        yield case("periodic", value)
    yield case("periodic", {"x": "-x"}, "'-x'")
    for value in (
        *(v for v in NO_WHOLE[:-3] if v is not None),
        1,
        10**9,
        [10, 10],
        [],
        [1],
        [2.5],
        ["4"],
        [None],
        [[4]],
        [HUGE],
        {4},
        {4: 4},
        (n for n in [4]),
        np.array([4.0]),
    ):
        yield case("steps", value)
    for steps, collisions in ((100_000, 20), (100_000, 9_999), (10_000, 1_000)):
        many = stated(steps=steps, sequence=["wall"] * collisions)
        yield Case("steps x phases", many, ProblemError, "steps")
        lists = stated(steps=[steps] * (collisions + 1), sequence=["wall"] * collisions)
        yield Case("steps of each phase", lists, ProblemError, "steps")
    for value in (
        "stages",
        "",
        "Constant",
        1,
        True,
        b"constant",
        ["constant"],
        {},
        np.array(["constant", "linear"]),
        NAN,
    ):
        yield case("controls", value)
    for value in NO_FLAGS:
        yield case("minimal_times", value)
    for field in ("start", "goal", "bounds"):
        yield case(field, {"x": (0, 1), X: (0, 1)}, f"{field} gives 'x' twice")
    yield case("start", {"x": 0, "x_dot": 0, X.diff(T): 1}, "'x_dot' twice")
    yield case("parameters", {"m": 1.0, sp.Symbol("m"): 2.0}, "parameters gives 'm' twice")
    yield case("start", {}, "start of x")
    yield case("start", {"x": 2.0}, "start")
    yield case("goal", {"x": 2.0}, "goal")
    yield case("start", {"x": 0.0, "x_dot": 1.0, "p_x": 1.0}, "start of x")
    yield case("start", {"x": 1e308, "x_dot": 0.0}, "start")
    for value in (0.0, -1.0, 0):
        yield case("parameters", {"m": value}, "m=")
    bounded = stated(start={"x": 0.0}, bounds={"x": (0.5, 1.0)})
    yield Case("bounds", bounded, ProblemError, "start of x")


def solve_cases() -> Iterator[Case]:
    def case(option: str, value: Any, names: str = "") -> Case:
        return Case(
            option,
            lambda _, problem: dmoc.solve(problem, **{option: value}),
            ProblemError,
            names or option,
        )

    for value in NO_PROBLEMS:
        yield Case("problem", lambda _, __, value=value: dmoc.solve(value), ProblemError, "problem")
        yield Case(
            "problem",
            lambda _, __, value=value: dmoc.sensitivities(value, value),
            ProblemError,
            "problem",
        )
        yield Case(
            "solution",
            lambda _, problem, value=value: dmoc.sensitivities(problem, value),
            ProblemError,
            "solution",
        )
    yield Case("problem", lambda *_: dmoc.solve(block_system()), ProblemError, "problem")  # type: ignore[arg-type]
    yield Case("problem", lambda kernels, _: dmoc.solve(kernels), ProblemError, "problem")  # type: ignore[arg-type]
    for option in ("tolerance", "optimality", "violation", "seconds"):
        for value in (*NO_NUMBERS, 0, -1.0):
            yield case(option, value)
    for option in ("optimality", "violation"):
        yield case(option, None)
    for value in NO_WHOLE:
        yield case("iterations", value)
        if value is not None:
            yield case("starts", value)
    for value in NO_WHOLE[1:]:
        yield case("seed", value)
    for option in ("method", "form"):
        for value in (
            "newton",
            "",
            "IPM",
            5,
            True,
            b"ipm",
            ["ipm"],
            {},
            np.array(["ipm", "slsqp"]),
            object(),
        ):
            yield case(option, value)
    yield case("form", None)
    for value in (5, "print", [print], {}):
        yield case("progress", value)
    for value in NO_FLAGS:
        yield case("verify", value)
    for value in (None, 5, b"x", ["x"]):
        yield case("reference", value)
    for value in (
        b"x",
        {},
        {1.0},
        object(),
        True,
        [True],
        1j,
        [1j],
        ["1"],
        [None],
        [[1.0], [1.0, 2.0]],
        [[]],
        [],
        0.0,
        [0.0],
        [NAN] * 3,
        np.zeros(3),
        np.zeros((3, 3)),
        np.full(3, NAN),
        [HUGE],
        dmoc.Problem,
        (0.0 for _ in range(3)),
    ):
        yield case("guess", value)
    yield Case(
        "guess",
        lambda _, problem: dmoc.solve(problem, guess=np.full(20, INF)),
        ProblemError,
        "guess",
    )
    yield Case(
        "guess",
        lambda _, problem: dmoc.solve(problem, guess="missing.npz"),
        SolutionFileError,
        "missing.npz",
    )


def search_cases() -> Iterator[Case]:
    def case(option: str, value: Any, names: str = "") -> Case:
        return Case(
            option,
            lambda _, problem: dmoc.search(problem, **{"max_collisions": 0, option: value}),
            SearchError,
            names or option,
        )

    for value in NO_PROBLEMS:
        yield Case("problem", lambda _, __, value=value: dmoc.search(value), SearchError, "problem")
    for option in ("beam", "workers", "max_nodes"):
        for value in NO_WHOLE:
            if not (option == "max_nodes" and value is None):
                yield case(option, value)
    for option in ("max_collisions", "starts", "seed"):
        for value in NO_WHOLE[1:]:
            yield case(option, value)
    yield case("max_collisions", 13)
    yield case("workers", 10**6)
    for value in NO_NUMBERS:
        yield case("seconds", value)
        yield case("node_seconds", value)
        yield case("shortest_phase", value)
    for value in (0, -1.0):
        yield case("seconds", value)
        yield case("node_seconds", value)
    yield case("shortest_phase", -1e-9)
    for option in ("strategy", "method"):
        for value in ("deep", "", None, 5, True, b"ipm", ["ipm"], np.array(["ipm", "beam"])):
            if not (option == "method" and value is None):
                yield case(option, value)
    for value in (
        *(v for v in NO_LISTS if v is not None),
        ["up"],
        [None],
        [["wall"]],
        ["wall", "wall"],
        [],
        [5],
        [{}],
        itertools.repeat("wall"),
    ):
        yield case("surfaces", value)
    for value in (5, "pool", object(), [], True):
        yield case("executor", value)
    for value in (5, b"x", ["x"], True, "a\0b", object()):
        yield case("journal", value)
    for value in NO_FLAGS:
        yield case("resume", value)
    yield case("resume", True)
    for value in (5, "print", [print]):
        yield case("progress", value)

    def with_steps(steps: Any, **options: Any) -> Call:
        return lambda _, problem: dmoc.search(problem.but(steps=steps), **options)

    for shortest in (0.6, 1e9):  # of two phases in 1 s
        yield Case(
            "shortest_phase",
            lambda _, problem, s=shortest: dmoc.search(problem, 1, shortest_phase=s),
            SearchError,
            "shortest_phase",
        )
    yield Case("steps", with_steps([4]), SearchError, "steps")
    yield Case("steps", with_steps(100_000, max_collisions=12), ProblemError, "steps")
    yield Case("steps", with_steps(2000, method="slsqp"), SearchError, "steps")


def resting() -> Trajectory:
    """A motion of one step in which nothing moves."""
    still, one = np.zeros((2, 1)), np.zeros((1, 1))
    phase = Phase(np.array([0.0, 1.0]), still, still, still, one)
    free = np.array([[-INF, INF]])
    return Trajectory(
        "block",
        "",
        ("x",),
        ("u",),
        {"m": 1.0, "wall": 1.0},
        (phase,),
        (),
        "constant",
        free,
        free,
        {"wall": 1.0},
        2,
    )


def model_cases() -> Iterator[Case]:
    for value in NO_PROBLEMS:
        yield Case("system", lambda _, __, value=value: dmoc.build(value), ModelError, "system")
    for value in (
        None,
        5,
        True,
        b"cart_pendulum",
        ["cart_pendulum"],
        {},
        object(),
        "",
        "cart",
        "x" * 5000,
        "a\0b",
        "a\0b:c",
        "a" * 5000 + ":b",
        ":",
        ":x",
        "nowhere.py:x",
        "nowhere.py",
        "/:x",
    ):
        yield Case("reference", lambda _, __, value=value: dmoc.load(value), ModelError, "")
    for value in (None, 0, 3, 2.0, "2", True, [2], np.array([2, 4]), HUGE, NAN):
        yield Case(
            "order",
            lambda _, __, value=value: dmoc.build(block_system(), order=value),
            ModelError,
            "order",
        )
        if value is not None:
            yield Case(
                "order",
                lambda _, __, value=value: dmoc.load("cart_pendulum", order=value),
                ModelError,
                "order",
            )
    for value in (None, "c", 5, True, ["auto"], np.array(["auto", "numpy"])):
        yield Case(
            "backend",
            lambda _, __, value=value: dmoc.build(block_system(), backend=value),
            BuildError,
            "backend",
        )
    for value in NO_FLAGS:
        yield Case(
            "force",
            lambda _, __, value=value: dmoc.build(block_system(), force=value),
            BuildError,
            "force",
        )
    for value in (None, 5, "x", {}, np.zeros(3), object()):
        yield Case(
            "trajectory",
            lambda kernels, _, value=value: dmoc.verify(value, kernels),
            SimulationError,
            "trajectory",
        )
        yield Case(
            "kernels",
            lambda _, problem, value=value: dmoc.verify(resting(), value),
            SimulationError,
            "kernels",
        )


CASES = [*problem_cases(), *solve_cases(), *search_cases(), *model_cases()]


def is_one_sentence(text: str) -> bool:
    return text.endswith(".") and "\n" not in text and ". " not in text and len(text) < 300


@pytest.fixture(scope="module")
def problem(block: Kernels) -> dmoc.Problem:
    return dmoc.Problem(block, start={"x": 0.0}, goal={"x": 0.5}, steps=4, final_time=1.0)


@pytest.mark.parametrize("case", CASES, ids=[f"{i}-{c.name}" for i, c in enumerate(CASES)])
def test_what_does_not_fit_is_refused_in_one_sentence_that_names_it(
    case: Case, block: Kernels, problem: dmoc.Problem
) -> None:
    with pytest.raises(case.error) as error:
        case.call(block, problem)
    text = str(error.value)
    assert is_one_sentence(text), text
    assert case.names in text
    assert error.value.__cause__ is None


@pytest.mark.parametrize(
    ("fields", "same"),
    [
        ({"start": {X: 0}}, {"start": {"x": 0.0}}),
        ({"start": {"x": 0, X.diff(T): 1}}, {"start": {"x": 0.0, "x_dot": 1.0}}),
        ({"start": {"x": Fraction(1, 2)}}, {"start": {"x": 0.5}}),
        ({"start": {"x": sp.Rational(1, 2)}}, {"start": {"x": 0.5}}),
        ({"start": {"x": Decimal("0.5")}}, {"start": {"x": 0.5}}),
        ({"start": {"x": np.array(0.5)}}, {"start": {"x": 0.5}}),
        ({"start": {"x": np.float32(0.5)}}, {"start": {"x": 0.5}}),
        ({"start": {"x": np.array([0, 0.5])}}, {"start": {"x": (0.0, 0.5)}}),
        ({"goal": {"x": None}}, {}),
        ({"goal": {"x": [None, None]}}, {}),
        ({"bounds": {"u": (-INF, INF)}}, {}),
        ({"bounds": {"u": None}}, {}),
        ({"bounds": {"u": [None, 5]}}, {"bounds": {"u": (-INF, 5.0)}}),
        ({"bounds": {"u": (5, 5)}}, {"bounds": {"u": (5.0, 5.0)}}),
        ({"sequence": (name for name in ["wall"])}, {"sequence": ["wall"]}),
        ({"sequence": np.array(["wall"])}, {"sequence": ("wall",)}),
        ({"steps": np.int64(4)}, {"steps": 4}),
        ({"steps": np.array([4])}, {"steps": 4}),
        ({"steps": range(4, 5)}, {"steps": [4]}),
        ({"steps": None}, {"steps": 100}),  # of the first mesh
        ({"periodic": [X.diff(T)]}, {"periodic": ["x_dot"]}),
        ({"durations": np.array([[0.5, 1.0]])}, {"durations": [(0.5, 1)]}),
        ({"durations": (d for d in [1])}, {"durations": [(1.0, 1.0)]}),
        ({"final_time": (None, 2)}, {"final_time": (0.0, 2.0)}),
        ({"restitution": Fraction(1, 2)}, {"restitution": {"wall": 0.5}}),
        ({"minimal_times": np.True_}, {}),
        ({"parameters": {sp.Symbol("m"): 2}}, {"parameters": {"m": 2.0}}),
    ],
)
def test_what_has_one_meaning_is_taken(
    block: Kernels, fields: dict[str, Any], same: dict[str, Any]
) -> None:
    given, plain = (
        dmoc.Problem(block, **{"start": {"x": 0.0}, "steps": 4, "final_time": 1.0} | f)
        for f in (fields, same)
    )
    for name in ("start_bounds", "goal_bounds"):
        assert np.array_equal(getattr(given, name).position, getattr(plain, name).position)
        assert np.array_equal(getattr(given, name).velocity, getattr(plain, name).velocity)
        assert np.array_equal(getattr(given, name).momentum, getattr(plain, name).momentum)
    for name in (
        "input_bounds",
        "coordinate_bounds",
        "duration_bounds",
        "parameter_values",
        "restitution_values",
    ):
        assert np.array_equal(getattr(given, name), getattr(plain, name))
    for name in ("sequence", "phase_steps", "periodic", "final_time_bounds", "minimal_times"):
        assert getattr(given, name) == getattr(plain, name)


def test_a_system_serves_as_its_kernels_of_order_two_with_steps_and_four_without(
    block: Kernels,
) -> None:
    def of_system(**fields: Any) -> dmoc.Problem:
        return dmoc.Problem(block_system(), start={"x": 0.0}, **fields)  # type: ignore[arg-type]

    fourth = dmoc.build(block_system(), order=4)
    assert fourth.manifest["fingerprint"] != block.manifest["fingerprint"]
    for fields, kernels in (
        ({"steps": 4}, block),
        ({"controls": "linear"}, block),  # of order 2 alone
        ({"steps": 4, "controls": "constant"}, block),
        ({}, fourth),
        ({"controls": "constant"}, fourth),
        ({"controls": "stages"}, fourth),
    ):
        problem = of_system(**fields)
        assert problem.order == kernels.manifest["order"]
        assert problem.kernels.manifest["fingerprint"] == kernels.manifest["fingerprint"]
    assert of_system().steps is None and of_system().phase_steps == (50,)
    with pytest.raises(ProblemError, match="the start of x is not given"):
        dmoc.Problem(block_system())  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def losing() -> Kernels:
    """A mass that falls along the way, is nothing at x = 1 and negative behind it."""
    m = sp.Symbol("m")
    return dmoc.build(
        dmoc.MechanicalSystem(
            "losing",
            [X],
            m * (1 - X) * X.diff(T) ** 2 / 2,
            {m: 1.0},
            inputs=[U],
            forces={X: U},
            surfaces={"wall": X <= 3},
            cost=U**2 / 2,
        )
    )


@pytest.mark.parametrize("method", ["slsqp", "ipm"])
@pytest.mark.parametrize(
    "changes",
    [
        {"goal": {"x": 2.0}},
        {"goal": {"x": 1.0, "x_dot": 0.0}},
        {"goal": {"x": 2.0, "x_dot": 0.0}, "bounds": {"u": (-1.0, 1.0)}},
        {"start": {"x": 0.999999}, "goal": {"x": 1.5}},
        {"start": {"x": 0.0, "x_dot": 5.0}, "goal": {"x": 3.0}, "sequence": ["wall"]},
        {"start": {"x": 0.0, "x_dot": 5.0}, "sequence": ["wall"], "restitution": 0.0},
    ],
)
def test_a_mass_that_vanishes_on_the_way_is_no_solution_and_is_told(
    losing: Kernels, method: str, changes: dict[str, Any]
) -> None:
    problem = dmoc.Problem(losing, **{"start": {"x": 0.0}, "steps": 6, "final_time": 1.0} | changes)
    solution = dmoc.solve(problem, method, iterations=60)
    assert solution.status in {"not_verified", "infeasible", "iteration_limit"}
    assert "the mass matrix is singular or negative" in solution.message


def test_a_cost_that_is_no_number_is_told() -> None:
    system = dmoc.MechanicalSystem(
        "undefined",
        [X],
        X.diff(T) ** 2 / 2,
        {},
        inputs=[U],
        forces={X: U},
        cost=U**2 + sp.sqrt(-1 - X**2),
    )
    problem = dmoc.Problem(system, start={X: 0.0}, final_time=1.0, steps=5)
    solution = dmoc.solve(problem, "ipm", starts=1)
    assert not solution.solved and "the cost is not a finite number" in solution.message


@pytest.mark.parametrize("method", ["slsqp", "ipm"])
@pytest.mark.parametrize(("m", "status"), [(1e-300, "solved"), (1e300, "stalled")])
def test_masses_at_the_ends_of_the_numbers_end_in_a_status(
    losing: Kernels, method: str, m: float, status: str
) -> None:
    problem = dmoc.Problem(
        losing, start={"x": 0.0}, goal={"x": 0.5}, steps=6, final_time=1.0, parameters={"m": m}
    )
    assert dmoc.solve(problem, method, iterations=60).status == status


def test_a_mass_that_is_nothing_at_the_start_is_refused(losing: Kernels) -> None:
    for x in (1.0, 2.0):
        with pytest.raises(ProblemError, match="mass matrix is not positive definite at the start"):
            dmoc.Problem(losing, start={"x": x})
