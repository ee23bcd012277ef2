"""Every public function with wrong values for every one of its arguments: each is taken or refused
in one sentence of ours, some 17 000 inputs in all; none ends in an error of Python's own."""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any, ClassVar, NoReturn

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import LagrangesMethod, dynamicsymbols
from systems import block_system

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.models.registry import find

X, U = dynamicsymbols("x u")
T, M = dynamicsymbols._t, sp.Symbol("m")


class Foreign:
    """An object that fails whatever it is asked."""

    def _fails(self, *_: object) -> NoReturn:
        raise RuntimeError("foreign")

    __repr__ = __len__ = __iter__ = __float__ = __index__ = __bool__ = __fspath__ = _fails


ENDLESS: list[Any] = []
ENDLESS.append(ENDLESS)
WRONG: tuple[Any, ...] = (
    *(None, True, False, ..., "", "x", "y" * 5000, "a\0b", "a\nb", "\ud800", b"x"),
    *(-1, 0, 3, 1e200, -1e200, 1e308, 1e-320, 10**400, 10**5000, math.nan, math.inf, -math.inf),
    *(1j, Decimal(1), Decimal("sNaN"), Fraction(1, 3), sp.Symbol("x"), sp.I),
    *(np.int8(1), np.float32("nan"), np.longdouble("1e4000"), np.datetime64("2020-01-01")),
    *(
        np.array(1.0), np.array(None), np.array("x"), np.ma.masked, np.zeros(0),
        np.array([1.5, 2.5]),
    ),
    *(np.ones((2, 2), int), np.array([object(), None]), np.array(["x", "u"])),
    *([], (), {}, [None], [0], [math.nan], ["x"], ["y" * 5000], [[1]], {1.0}, {1: 1}, ENDLESS),
    *((0, 1e200), (0, math.inf), range(3), slice(3), (i for i in [1])),
    *({"x": []}, {"x": np.array(0.5)}, {"x": object()}, {"x": 1e200}),
    *(object(), Foreign(), int, type, np, lambda: 1, lambda _: object(), Path("a\0b")),
)  # fmt: skip
# Arguments whose entries are wrong in turn too.
LISTS = {
    *("durations", "periodic", "sequence", "problems", "via", "contacts", "ignored", "surfaces"),
    *("runs", "own", "sequences", "events", "guess", "inputs", "coordinates", "steps", "motions"),
}
MAPPINGS = {
    *("start", "goal", "bounds", "parameters", "restitution", "position", "velocity", "guess"),
    *("design", "sigma"),
}
NAMES = {"bounds": "u", "parameters": "m", "restitution": "wall", "design": "wall"}
PENDULUM = """<robot name="pendulum"><link name="stand"/><link name="rod"><inertial>
<mass value="2"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="hip" type="continuous"><parent link="stand"/><child link="rod"/></joint></robot>"""
PARTS = 4  # of all functions, for a processor each


class InThread(ThreadPoolExecutor):
    """Instead of worker processes, of which each would take a second to start."""

    _processes: ClassVar[dict[int, Any]] = {}

    def __init__(self, *_: object, **__: object) -> None:
        super().__init__(1)


# What Python and NumPy say.
FOREIGN = re.compile(
    r"Traceback|NoneType|ndarray|object is not|must be|could not|cannot convert|unsupported|"
    r"subscriptable|iterable|has no attribute|invalid literal|positional|embedded null|"
    r"truth value|inhomogeneous|unhashable|foreign| at 0x"
)


def is_one_sentence(text: str) -> bool:
    return text.endswith(".") and "\n" not in text and ". " not in text and len(text) < 400


def joining(module: Any, name: str) -> Callable[..., Any]:
    """A method of a world of its own, which bodies are added to."""

    def call(**arguments: Any) -> Any:
        return getattr(module.World(), name)(**arguments)

    call.__signature__ = inspect.signature(getattr(module.World(), name))  # type: ignore[attr-defined]
    return call


def disturbed(solution: dmoc.Solution, field: str) -> Callable[..., Any]:
    """A simulation with one field of its disturbance."""

    def call(value: Any = None) -> Any:
        return dmoc.simulate(solution, disturb={"sampling": 0.25, field: value})

    return call


@pytest.fixture(scope="module")
def calls(
    block: Kernels, tmp_path_factory: pytest.TempPathFactory
) -> dict[str, tuple[Callable[..., Any], dict[str, Any]]]:
    """Every public function and method, and arguments that it takes."""
    system = block_system()
    problem = dmoc.Problem(block, start={"x": 0.0}, goal={"x": 0.5}, steps=3, final_time=1.0)
    solution = dmoc.solve(problem, "ipm", starts=1)
    moved = dmoc.simulate(block, {"x": 0.0}, {"x": 1.0}, step_size=0.1, steps=4)
    method = LagrangesMethod(X.diff(T) ** 2 / 2, [X])
    carried = tmp_path_factory.mktemp("calls") / "carried"
    dmoc.generate_solver(problem, carried, guess=solution)
    quick: dict[str, Any] = {"seconds": 2.0}
    t = np.linspace(0, 1, 12)
    runs = {"t": t, "x": 0.01 * np.sin(90 * t) - 0.4 * t**2, "u": -np.ones(12)}
    fitted = {"problem": problem, "runs": runs, "parameters": {"m": (0.5, 2)}}
    urdf = tmp_path_factory.mktemp("robots") / "pendulum.urdf"
    urdf.write_text(PENDULUM)
    functions: dict[str, dict[str, Any]] = {
        "read_robot": {"path": urdf},
        "solve": {"problem": problem, "method": "ipm", "starts": 1, "iterations": 20} | quick,
        "solve_many": {"problems": [problem]} | quick,
        "sweep": {"problem": problem, "parameters": {"m": [1.0]}} | quick,
        "search": {"problem": problem, "max_collisions": 0, "starts": 0} | quick,
        "simulate": {"kernels": block, "position": {"x": 0.0}, "step_size": 0.1, "steps": 3},
        "feedback": {"solution": solution},
        "fit": fitted,
        "identifiable": fitted,
        "Disturbance": {},
        "Planner": {"problem": problem, "solution": solution},
        "sensitivities": {"problem": problem, "solution": solution},
        "certify": {"problem": problem, "solution": solution},
        "prove": {"problem": problem},
        "generate_solver": {"problem": problem, "folder": "carried", "guess": solution},
        "load_solver": {"folder": "nowhere"},
        "generate_page": {"problem": problem, "path": "page.html", "guess": solution},
        "verify": {"trajectory": solution.trajectory, "kernels": block},
        "build": {"system": system, "backend": "numpy"},
        "load": {"reference": "puck_table"},
        "derive": {"system": system},
        "animate": {"motions": moved, "path": "a.html"},
        "Problem": {"kernels": block, "start": {"x": 0.0}, "steps": 3, "final_time": 1.0},
        "MechanicalSystem": {
            "name": "a", "coordinates": [X], "lagrangian": X.diff(T) ** 2, "parameters": {M: 1.0}
        },
        **{name: {"name": "effort"} for name in ("total", "peak", "largest")},
        **{name: {"surface": "wall"} for name in ("impulse", "approach", "departure", "loss")},
        **{name: {"expression": X} for name in ("at_start", "at_end")},
        "normal": {"surface": "wall"},
        "traction": {"tangent": "floor"},
        "reaction": {"constraint": "rod"},
        "attitude": {"quaternion": (1, 0, 0, 0)},
        "Box": {"centre": (0, 0), "width": 1, "height": 1},
        "Disc": {"centre": (0, 0), "radius": 1},
        "Link": {},
        "Point": {"at": (0, 0)},
        "Spring": {"a": (0, 0), "b": (1, 1)},
        "Wall": {"a": (0, 0), "b": (1, 1)},
        "Contact": {"surface": "wall", "at": (0, 0)},
    }  # fmt: skip
    # Made by functions alone; an error is given its text.
    results = {"Attitude", "Batch", "Fit", "Simulation", "Solution", "DmocError"}
    builders = {"planar", "spatial", "approach_speed", "sliding_speed", "final_time"}
    assert set(functions) | results | builders == set(dmoc.__all__)
    made = {name: (getattr(dmoc, name), accepted) for name, accepted in functions.items()}
    for module in (dmoc.planar, dmoc.spatial):
        axis = {"axis": "z"} if module is dmoc.spatial else {}
        made[f"{module.__name__}.World"] = module.World, {}
        made[f"{module.__name__}.hinge"] = joining(module, "hinge"), {"angle": X} | axis
        made[f"{module.__name__}.slide"] = joining(module, "slide"), {"distance": X} | axis
        made[f"{module.__name__}.point"] = (
            joining(module, "point"),
            dict.fromkeys(("along",) if module is dmoc.planar else "abc", 1.0),
        )
    made["dmoc.symbolic.spatial.ball"] = joining(dmoc.spatial, "ball"), {"attitude": "q"}
    made["simulate a solution"] = dmoc.simulate, {"kernels": solution, "steps": 3}
    for name in ("start", "noise", "pushes", "delay", "sampling", "seed"):
        made[f"simulate disturbed {name}"] = disturbed(solution, name), {}
    needed = {
        "save": "a.npz", "load": "a.npz", "to_csv": "a.csv", "to_json": "a.json",
        "report": "a.html", "animate": "a.html", "t": 0.1, "phase": 0, "content": b"",
        "method": method, "model": method, "name": "a", "parameters": {M: 1.0},
        "starts": 2, "elapsed": 0.1, "instances": [{}], "run": runs,
        "other": dmoc.attitude((1, 0, 0, 0)), "link": "rod",
    }  # fmt: skip
    objects = {
        "Solution": solution, "Simulation": moved, "Problem": problem, "system": system,
        "feedback": dmoc.feedback(solution),
        "Batch": dmoc.sweep(problem, {"m": [1.0, 2.0]}), "result": dmoc.search(problem, 0),
        "derivation": dmoc.derive(system), "state": solution.at(0.1),
        "attitude": dmoc.attitude((1, 0, 0, 0)),
        "loaded": dmoc.load_solver(carried), "fit": dmoc.fit(**fitted),
        "robot": dmoc.read_robot(urdf),
    }  # fmt: skip
    # Of a mapping, whose keys are Python's business, and what a simulation asks of a feedback.
    inherited = {"get", "fits", "span", "steer"}
    for label, thing in objects.items():
        for name, call in inspect.getmembers(thing, callable):
            if name.startswith("_") or name in inherited or inspect.isclass(call):
                continue
            keywords = {
                p.name: needed.get(name if p.name == "path" else p.name)
                for p in inspect.signature(call).parameters.values()
                if p.default is p.empty and p.kind not in (p.VAR_KEYWORD, p.VAR_POSITIONAL)
            }
            if name == "name_of":
                keywords = {"node": objects["result"].nodes[0]}
            made[f"{label}.{name}"] = call, keywords
    return made


def parameters_of(call: Callable[..., Any]) -> list[inspect.Parameter]:
    parameters = inspect.signature(call).parameters.values()
    return [p for p in parameters if p.kind is not p.VAR_KEYWORD]


def values_for(parameter: inspect.Parameter) -> Iterator[Any]:
    """Wrong values, alone and as entries of what is taken as a list or a mapping."""
    name, names = parameter.name, "Sequence[str]" in str(parameter.annotation)
    yield from WRONG
    if name in LISTS:
        yield from ([value] for value in WRONG)
    if name in MAPPINGS and not names:
        yield from ({NAMES.get(name, "x"): value} for value in WRONG)


@pytest.mark.slow
@pytest.mark.parametrize("part", range(PARTS))
def test_every_wrong_value_is_taken_or_refused_in_one_sentence(
    calls: dict[str, tuple[Callable[..., Any], dict[str, Any]]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    part: int,
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("dmoc.solving.processes.ProcessPoolExecutor", InThread)
    tried, wrong = 0, []
    for what, (call, keywords) in [*calls.items()][part::PARTS]:
        for parameter in parameters_of(call):
            several = parameter.kind is parameter.VAR_POSITIONAL
            for value in values_for(parameter):
                tried += 1
                place = f"{what}({parameter.name}=#{tried})"
                try:
                    if several:
                        call(value, (0, 0), **keywords)
                    else:
                        call(**(keywords | {parameter.name: value}))
                except dmoc.DmocError as error:
                    text = str(error)
                    if not is_one_sentence(text) or FOREIGN.search(text):
                        wrong.append(f"{place}: {text[:300]}")
                except Exception as error:
                    wrong.append(f"{place}: {type(error).__name__}: {error}")
    assert tried and not wrong, "\n".join(wrong)


@pytest.mark.slow
def test_some_17_000_values_are_tried(
    calls: dict[str, tuple[Callable[..., Any], dict[str, Any]]],
) -> None:
    parameters = [p for call, _ in calls.values() for p in parameters_of(call)]
    assert sum(len([*values_for(p)]) for p in parameters) > 16_000


def test_an_unknown_keyword_is_refused_in_one_sentence_by_every_one_of_them(
    calls: dict[str, tuple[Callable[..., Any], dict[str, Any]]],
) -> None:
    """But those of a mapping, which are Python's."""
    others = {"state.keys", "state.values", "state.items", "system.from_joints"}
    found = find("cart_pendulum")
    more = {"a reference": (found.kernels, {}), "find": (find, {"reference": "cart_pendulum"})}
    for what in calls.keys() - others | more.keys():
        call, keywords = (calls | more)[what]
        if "disturbed" in what:  # a call of these tests
            continue
        with pytest.raises(dmoc.DmocError) as refused:
            call(**keywords, surprise=1)
        text = str(refused.value)
        assert is_one_sentence(text) and "'surprise'" in text, (what, text)


@pytest.mark.parametrize("what", ["solve", "search", "simulate", "Problem", "Box", "Solution.at"])
def test_a_call_that_does_not_fit_is_no_error_of_python(
    calls: dict[str, tuple[Callable[..., Any], dict[str, Any]]], what: str
) -> None:
    """Too many arguments without a name, and none at all."""
    call = calls[what][0]
    for arguments in ((1,) * 40, ()):
        with pytest.raises(dmoc.DmocError) as refused:
            call(*arguments)
        text = str(refused.value)
        assert is_one_sentence(text) and "does not fit it" in text and ": expected " in text


def test_an_error_of_a_function_of_the_user_stays_what_it_is(block: Kernels) -> None:
    problem = dmoc.Problem(block, start={"x": 0.0}, goal={"x": 0.5}, steps=3, final_time=1.0)
    with pytest.raises(TypeError, match="takes no keyword arguments"):
        dmoc.solve(problem, guess={"x": lambda t: len(obj=t)})
