"""What users pass by mistake: every case is refused in one sentence that names the argument, or
ends in a status; none in a traceback."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols
from systems import block_system

import dmoc
from dmoc.base.errors import (
    BuildError,
    ModelError,
    ProblemError,
    SearchError,
    SimulationError,
    SolutionFileError,
)
from dmoc.codegen.kernels import Kernels
from dmoc.motion.trajectory import Phase, Trajectory

X, U = dynamicsymbols("x u")
T = dynamicsymbols._t
HUGE = 10**400
BEYOND_TEXT = 10**5000  # Python refuses to print integers of more than 4300 digits
NAN, INF = math.nan, math.inf
Values = tuple[Any, ...]
# Values that are no number, and numbers that are not finite.
NO_NUMBERS: Values = (
    "1", b"1", True, np.True_, 1 + 0j, np.complex128(1), [1.0], (1.0,), {"a": 1}, {1.0}, object(),
    sp.Symbol("a"), sp.I, np.array([1.0]), np.array([[1.0, 2.0]]), np.array("1"), np.array(1j),
    np.array(None), lambda: 1.0, Decimal("NaN"), NAN, INF, -INF, HUGE, -HUGE, BEYOND_TEXT,
    np.float32("nan"), np.datetime64("2020-01-01"),
)  # fmt: skip
NO_RANGES: Values = (
    "01", b"01", True, 1j, (), (1,), (0, 1, 2), [[0, 1]], ((0, 1), (0, 1)), ("0", "1"), (True, 2),
    (NAN, 1), (0, NAN), (INF, None), (None, -INF), (0, 1j), (0, HUGE), (0, [1]), {0: 1}, {0, 1},
    range(3), np.zeros((2, 2)), np.array([0, NAN]), np.array(["0", "1"]), (2, 1), [1, -1],
    (x for x in (0, 1)), object(), HUGE, NAN,
)  # fmt: skip
NO_LISTS: Values = (
    "wall", b"wall", 5, 1.5, True, {"wall"}, {"wall": 1}, frozenset(), object(), sp.Symbol("wall"),
    np.array("wall"),
)  # fmt: skip
NO_MAPPINGS: Values = (
    None, 5, "x", b"x", ["x"], ("x", 1), {"x"}, [("x", 1)], np.zeros(2), object(), dict,
)  # fmt: skip
NO_NAMES: Values = (
    "y", "", "X", "x ", "x\n", "x_ddot", None, 0, 1.5, (), b"x", "x" * 100_000, X.diff(T, 2), X + U,
    2 * X, X.diff(T) + X, sp.Symbol("z"), frozenset("x"),
)  # fmt: skip
NO_COUNTS: Values = (
    -1, 1.0, 2.5, "2", b"2", True, 2j, NAN, INF, -HUGE, HUGE, BEYOND_TEXT, sp.Integer(5), [5],
    np.array([5]), {},
)  # fmt: skip
NO_FLAGS: Values = ("no", "", None, 0, 1, 0.0, [], np.array([True, False]))
NO_PROBLEMS: Values = (
    None, 5, "block", b"block", [], {}, (), object(), np.zeros(3), dmoc.Problem,
)  # fmt: skip
NO_GUESSES: Values = (
    b"x", {}, {1.0}, object(), True, [True], 1j, [1j], ["1"], [None], [[1.0], [1.0, 2.0]], [[]], [],
    0.0, [0.0], [NAN] * 3, np.zeros(3), np.zeros((3, 3)), np.full(3, NAN), [HUGE], dmoc.Problem,
    (0.0 for _ in range(3)), np.full(20, INF),
)  # fmt: skip
NO_STEPS: Values = (
    0, *NO_COUNTS[:-3], 1, 10**9, [10, 10], [], [1], [2.5], ["4"], [None], [[4]], [HUGE], {4},
    {4: 4}, (n for n in [4]), np.array([4.0]),
)  # fmt: skip
NO_SEQUENCES: Values = (
    ["Wall"], [None], [0], [["wall"]], [("wall",)], [b"wall"], [{"wall"}], [sp.Symbol("wall")],
    ["w" * 100_000], [""], [object()], itertools.repeat("wall"), ["wall"] * 10**6,
)  # fmt: skip
NO_STATES: Values = (
    itertools.repeat("x"), ["z"], [None], [0], [["x"]], ["x", "x"], ["x", X], [b"x"], [X + U],
    [X.diff(T, 2)],
)  # fmt: skip
NO_SURFACES: Values = (
    ["up"], [None], [["wall"]], ["wall", "wall"], [], [5], [{}], itertools.repeat("wall"),
)  # fmt: skip
NO_CONTROLS: Values = (
    "stages", "", "Constant", 1, True, b"constant", ["constant"], {},
    np.array(["constant", "linear"]), NAN,
)  # fmt: skip
NO_TIMES: Values = (
    0, 0.0, -1, (None, 0), (-1, 1), (-2, -1), (None, -1), 1e200, 1e308, 1e-300, 1e-320, (0, 1e200),
    (1e-200, None),
)  # fmt: skip
NO_PAIRS: Values = (
    5, 0, 5.0, np.float64(5), np.int64(5), Fraction(5), sp.Integer(5), np.array(5.0),
)  # fmt: skip
NO_METHODS: Values = (
    "newton", "", "IPM", 5, True, b"ipm", ["ipm"], {}, np.array(["ipm", "slsqp"]), object(),
)  # fmt: skip
NO_STRATEGIES: Values = ("deep", "", 5, True, b"ipm", ["ipm"], np.array(["ipm", "beam"]))
NO_MODELS: Values = (
    None, 5, True, b"cart_pendulum", ["cart_pendulum"], {}, object(), "", "cart", "x" * 5000,
    "a\0b", "a\0b:c", "a" * 5000 + ":b", ":", ":x", "nowhere.py:x", "nowhere.py", "/:x",
)  # fmt: skip
NO_ORDERS: Values = (0, 3, 2.0, "2", True, [2], np.array([2, 4]), HUGE, NAN)

Call = Callable[[Kernels, dmoc.Problem], Any]


@dataclass(frozen=True)
class Case:
    """A call with one mistake, the error that it must end in, and what the sentence must name."""

    name: str
    call: Call
    error: type[dmoc.DmocError]
    names: str


def stated(**changes: Any) -> Call:
    plain = {"start": {"x": 0.0}, "steps": 4, "final_time": 1.0}
    return lambda kernels, _: dmoc.Problem(**{"kernels": kernels, **plain, **changes})


def solved(**options: Any) -> Call:
    return lambda _, problem: dmoc.solve(**{"problem": problem, **options})


def searched(**options: Any) -> Call:
    return lambda _, problem: dmoc.search(**{"problem": problem, "max_collisions": 0, **options})


def cases(
    make: Callable[..., Call],
    error: type[dmoc.DmocError],
    fields: str,
    *values: Any,
    names: str = "",
    put: Callable[[Any], Any] = lambda value: value,
) -> Iterator[Case]:
    """Each value, put into what the fields take, is refused by a sentence with these names."""
    for field, value in itertools.product(fields.split(), values):
        yield Case(field, make(**{field: put(value)}), error, names or field)


def problem_cases() -> Iterator[Case]:
    of = partial(cases, stated, ProblemError)

    def entries(field: str, name: str, values: Iterable[Any], names: str = "") -> Iterator[Case]:
        """Values of one name of a mapping."""
        names = names or f"{field} of {name}"
        return of(field, *values, names=names, put=lambda value: {name: value})

    yield from of("kernels", *NO_PROBLEMS, "cart_pendulum", block_system)
    mappings = "start goal bounds parameters design"
    yield from of(mappings, *NO_MAPPINGS)
    yield from of("start", *NO_NAMES, names="unknown", put=lambda name: {"x": 0.0, name: 1.0})
    yield from of(mappings[6:], *NO_NAMES, names="unknown", put=lambda name: {name: 1.0})
    alone = [v for v in NO_NUMBERS if not isinstance(v, (list, tuple)) and np.ndim(v) != 1]
    rows = (), [1.0, 2.0], (NAN,), np.array([[1.0]]), np.array([INF])  # the problem has one phase
    yield from entries("parameters", "m", (*alone, *rows, None), "parameter m")
    no_shares = (-0.1, 1.1, -1, 2)
    yield from of("restitution", *NO_NUMBERS, *no_shares)
    yield from entries("restitution", "wall", (*NO_NUMBERS, *no_shares), "restitution of 'wall'")
    single = [v for v in NO_NUMBERS if np.ndim(v) == 0 and not isinstance(v, (dict, set))]
    yield from entries("start", "x", (*single, *NO_RANGES))
    yield from of("final_time", *single, *NO_RANGES, *NO_TIMES)
    yield from of(
        "durations", *NO_RANGES, *NO_TIMES, names="durations of phase 0", put=lambda value: [value]
    )
    yield from entries("goal", "x_dot", NO_RANGES)
    yield from entries("goal", "p_x", NO_RANGES)
    yield from entries("design", "wall", (*single, *NO_RANGES))
    yield from entries("bounds", "u", NO_RANGES)
    yield from entries("bounds", "x", NO_RANGES)
    yield from entries("bounds", "u", NO_PAIRS, "(lower, upper)")
    for name in ("wal", "", None, 0, "w" * 100_000):
        yield from of("restitution", {name: 0.5})
    yield from of("durations", *NO_LISTS, [], [1, 1], [None] * 3, np.ones((2, 2)))
    yield from of("periodic sequence", *NO_LISTS, None)
    yield from of("sequence", *NO_SEQUENCES)
    yield from of("periodic", *NO_STATES)
    yield from of("periodic", {"x": "--x"}, {"x": "x + 1"}, {"x": X**2}, {"x": {"x": "a"}})
    yield from of("steps", *NO_STEPS)
    for steps, collisions in ((100_000, 20), (100_000, 9_999), (10_000, 1_000)):
        for of_phases in (steps, [steps] * (collisions + 1)):
            many = stated(steps=of_phases, sequence=["wall"] * collisions)
            yield Case("steps of all phases", many, ProblemError, "steps")
    yield from of("controls", *NO_CONTROLS)
    yield from of("minimal_times", *NO_FLAGS)
    for field in ("start", "goal", "bounds"):
        yield from of(field, {"x": (0, 1), X: (0, 1)}, names=f"{field} gives 'x' twice")
    yield from of("start", {"x": 0, "x_dot": 0, X.diff(T): 1}, names="'x_dot' twice")
    yield from of("parameters", {"m": 1.0, sp.Symbol("m"): 2.0}, names="parameters gives 'm' twice")
    yield from of("start", {}, {"x": 0.0, "x_dot": 1.0, "p_x": 1.0}, names="start of x")
    yield from of("start", {"x": 2.0}, {"x": 1e308, "x_dot": 0.0})
    yield from of("goal", {"x": 2.0})
    yield from entries("parameters", "m", (0.0, -1.0, 0), "m=")
    yield from entries("bounds", "x", [(0.5, 1.0)], "start of x")


def solve_cases() -> Iterator[Case]:
    of = partial(cases, solved, ProblemError)

    def derived(solution: Any, **problem: Any) -> Call:
        return lambda _, plain: dmoc.sensitivities(problem.get("problem", plain), solution)

    def certified(solution: Any) -> Call:
        return lambda _, plain: dmoc.certify(plain, solution)

    yield from of("problem", *NO_PROBLEMS, block_system())
    yield Case("problem", lambda kernels, _: dmoc.solve(kernels), ProblemError, "problem")  # type: ignore[arg-type]
    for value in NO_PROBLEMS:
        yield Case("problem", derived(value, problem=value), ProblemError, "problem")
        yield Case("solution", derived(value), ProblemError, "solution")
        yield Case("solution", certified(value), ProblemError, "solution")
    yield from of("tolerance optimality violation seconds", *NO_NUMBERS, 0, -1.0)
    yield from of("optimality violation form", None)
    yield from of("iterations", 0, None)
    yield from of("starts", 0)
    yield from of("seed", None)
    yield from of("iterations starts seed", *NO_COUNTS)
    yield from of("method form", *NO_METHODS)
    yield from of("progress", 5, "print", [print], {})
    yield from of("verify", *NO_FLAGS)
    yield from of("reference", None, 5, b"x", ["x"])
    yield from of("guess", *NO_GUESSES)
    yield from cases(solved, SolutionFileError, "guess", "missing.npz", names="missing.npz")


def search_cases() -> Iterator[Case]:
    of = partial(cases, searched, SearchError)
    yield from of("problem", *NO_PROBLEMS)
    yield from of("beam workers", None)
    yield from of("beam workers max_nodes", 0, *NO_COUNTS)
    yield from of("max_collisions starts seed", None, *NO_COUNTS)
    yield from of("max_collisions", 13)
    yield from of("workers", 10**6)
    yield from of("seconds node_seconds", 0, -1.0)
    yield from of("seconds node_seconds shortest_phase", *NO_NUMBERS)
    yield from of("shortest_phase", -1e-9)
    yield from of("strategy method", *NO_STRATEGIES)
    yield from of("strategy", None)
    yield from of("surfaces", *NO_LISTS, *NO_SURFACES)
    yield from of("executor", 5, "pool", object(), [], True)
    yield from of("journal", 5, b"x", ["x"], True, "a\0b", object())
    yield from of("resume", *NO_FLAGS, True)
    yield from of("progress", 5, "print", [print])
    for shortest in (0.6, 1e9):  # of two phases in 1 s
        two = searched(max_collisions=1, shortest_phase=shortest)
        yield Case("shortest_phase", two, SearchError, "shortest_phase")

    def with_steps(steps: Any, **options: Any) -> Call:
        return lambda _, problem: dmoc.search(problem.but(steps=steps), **options)

    yield Case("steps", with_steps([4]), SearchError, "steps")
    yield Case("steps", with_steps(100_000, max_collisions=12), ProblemError, "steps")
    yield Case("steps", with_steps(2000, method="slsqp"), SearchError, "steps")


def resting() -> Trajectory:
    """A motion of one step in which nothing moves."""
    still, one = np.zeros((2, 1)), np.zeros((1, 1))
    phase = Phase(np.array([0.0, 1.0]), still, still, still, one)
    free = np.array([[-INF, INF]])
    parameters = {"m": 1.0, "wall": 1.0}
    return Trajectory(
        "block", "", ("x",), ("u",), parameters, (phase,), (), "constant", free, free,
        {"wall": 1.0}, 2,
    )  # fmt: skip


def model_cases() -> Iterator[Case]:
    def build(**options: Any) -> Call:
        return lambda *_: dmoc.build(**{"system": block_system(), **options})

    def load(**options: Any) -> Call:
        return lambda *_: dmoc.load(**{"reference": "cart_pendulum", **options})

    def verify(**arguments: Any) -> Call:
        return lambda kernels, _: dmoc.verify(
            **{"trajectory": resting(), "kernels": kernels, **arguments}
        )

    yield from cases(build, ModelError, "system", *NO_PROBLEMS)
    yield from cases(load, ModelError, "reference", *NO_MODELS, names=" ")
    yield from cases(build, ModelError, "order", None, *NO_ORDERS)
    yield from cases(load, ModelError, "order", *NO_ORDERS)
    not_backends = (None, "c", 5, True, ["auto"], np.array(["auto", "numpy"]))
    yield from cases(build, BuildError, "backend", *not_backends)
    yield from cases(build, BuildError, "force", *NO_FLAGS)
    no_motions = (None, 5, "x", {}, np.zeros(3), object())
    yield from cases(verify, SimulationError, "trajectory kernels", *no_motions)


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
        ({"minimal_times": np.False_}, {}),
        ({"parameters": {sp.Symbol("m"): 2}}, {"parameters": {"m": 2.0}}),
    ],
)
def test_what_has_one_meaning_is_taken(
    block: Kernels, fields: dict[str, Any], same: dict[str, Any]
) -> None:
    stated, plain = (
        dmoc.Problem(block, **{"start": {"x": 0.0}, "steps": 4, "final_time": 1.0} | f)
        for f in (fields, same)
    )
    for end, part in itertools.product(
        ("start_bounds", "goal_bounds"), ("position", "velocity", "momentum")
    ):
        a, b = (getattr(getattr(p, end), part) for p in (stated, plain))
        assert np.array_equal(a, b)
    arrays = "input_bounds coordinate_bounds duration_bounds parameter_values restitution_values"
    for name in arrays.split():
        assert np.array_equal(getattr(stated, name), getattr(plain, name))
    for name in ("sequence", "phase_steps", "periodic", "final_time_bounds", "minimal_times"):
        assert getattr(stated, name) == getattr(plain, name)


def test_a_system_serves_as_its_kernels_of_order_two_with_steps_and_four_without(
    block: Kernels,
) -> None:
    def of_system(**fields: Any) -> dmoc.Problem:
        return dmoc.Problem(block_system(), start={"x": 0.0}, **fields)  # type: ignore[arg-type]

    fourth = dmoc.build(block_system(), order=4)
    assert fourth.manifest.fingerprint != block.manifest.fingerprint
    for fields, kernels in (
        ({"steps": 4}, block),
        ({"controls": "linear"}, block),  # of order 2 alone
        ({"steps": 4, "controls": "constant"}, block),
        ({}, fourth),
        ({"controls": "constant"}, fourth),
        ({"controls": "stages"}, fourth),
    ):
        problem = of_system(**fields)
        assert problem.order == kernels.manifest.order
        assert problem.kernels.manifest.fingerprint == kernels.manifest.fingerprint
    assert of_system().steps is None and of_system().phase_steps == (50,)
    with pytest.raises(ProblemError, match="the start of x is not given"):
        dmoc.Problem(block_system())  # type: ignore[arg-type]
