"""The hand-written C under the address and undefined-behaviour sanitizers, without Python.

What Python hands to the interior-point method is written to a file, and a C program (sanitized.c)
repeats the call with arrays of exactly their sizes: an access beside one, or undefined behaviour,
ends it. Its results are those of the Python path.
"""

from __future__ import annotations

import os
import shutil
import struct
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse
from answers import answer_of
from c_objects import C11, SANITIZED, WARNINGS, object_of
from systems import bryson_denham, driven_system

import dmoc
from dmoc.codegen.build import sources
from dmoc.codegen.kernels import Kernels
from dmoc.models.registry import find
from dmoc.program.arrays import ElementData, PassData, ProgramData
from dmoc.program.assembly import strided
from dmoc.solvers import ipm
from dmoc.solvers.compiled import Factorisation

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
FLAGS = (*C11, *SANITIZED, *WARNINGS)
REALS = ("optimality", "demanded", "violation", "least_cost", "infeasible", "mu", "seconds")
Link = Callable[[Kernels], Path]  # to a program with the kernels of a model
LAYOUT = ("place", "start", "row", "first", "from_hess", "from_jac", "diagonal")


@dataclass(frozen=True)
class Call:
    """A call of the compiled method: its arguments as they were before, its results after."""

    arguments: tuple[Any, ...]
    options: dict[str, Any]
    result: dict[str, Any]
    x: np.ndarray


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[Call]:
    """The calls of the compiled method, as they come."""
    made: list[Call] = []
    original = ipm.interior_point

    def recorded(program: Any, layout: Any, *arrays: np.ndarray, **options: Any) -> dict[str, Any]:
        before = tuple(a.copy() for a in arrays)
        result = original(program, layout, *arrays, **options)
        made.append(Call((program, layout, *before), options, result, arrays[2].copy()))
        return result

    monkeypatch.setattr(ipm, "interior_point", recorded)
    return made


# Files --------------------------------------------------------------------------------------------


def whole(*values: int) -> bytes:
    return struct.pack(f"={len(values)}q", *map(int, values))


def numbers(values: Any) -> bytes:
    array = np.ascontiguousarray(values, dtype=np.float64).ravel()
    return whole(array.size) + array.tobytes()


def positions(values: Any) -> bytes:
    array = np.ascontiguousarray(values, dtype=np.int64).ravel()
    return whole(array.size) + array.tobytes()


def element(data: ElementData) -> bytes:
    n = max(map(len, data.arguments))
    parts = [whole(len(data.kernel)), data.kernel.encode(), whole(n)]
    for at in data.arguments:
        evenly = strided(at)
        parts += [whole(*(evenly or (0, at.shape[1]))), positions([] if evenly else at)]
    for slots, factors in zip(data.slots, data.factors, strict=True):
        parts += [positions(slots), numbers(factors)]
    return b"".join(parts)


def one_pass(data: PassData) -> bytes:
    parts = [whole(len(data.constant)), numbers(data.constant), whole(len(data.rows))]
    parts += [positions(data.rows), positions(data.columns), numbers(data.coefficients)]
    return b"".join([*parts, whole(len(data.elements)), *map(element, data.elements)])


def program(data: ProgramData) -> bytes:
    parts = [whole(data.n, data.m, data.equalities)]
    parts += [numbers(a) for a in (data.lower, data.upper, data.sizes, data.pool)]
    parts += [one_pass(p) for p in (data.values, data.slopes, data.curvatures)]
    return b"".join(parts + [positions(a) for a in (*data.jacobian, *data.hessian)])


def written(call: Call) -> bytes:
    compiled, layout, *arrays = call.arguments
    options, price = call.options, call.options["price"]
    kinds = (options["warm"], options["iterations"], options["least_violation"], price is not None)
    parts = [program(compiled.data), whole(layout.size, len(layout.first) - 1)]
    parts += [positions(getattr(layout, name)) for name in LAYOUT]
    parts += [numbers([options[name] for name in REALS]), positions(kinds)]
    parts += [numbers([] if price is None else price)]
    return b"".join(parts + [numbers(a) for a in arrays])


# Programs -----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def gcc(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A gcc that knows the sanitizers."""
    folder = tmp_path_factory.mktemp("gcc")
    (folder / "main.c").write_text("int main(void) { return 0; }\n")
    compiler = shutil.which("gcc")
    command = [compiler or "gcc", *FLAGS, "main.c", "-o", "main"]
    if compiler is None:
        pytest.fail("the sanitizers need gcc: install it, with libasan and libubsan.")
    done = _run(command, folder)
    if done.returncode:
        pytest.fail(f"the sanitizers need libasan and libubsan: install them.\n{done.stderr}")
    return compiler


@pytest.fixture(scope="module")
def objects(gcc: str) -> dict[str, str]:
    """The hand-written C, compiled."""
    parts = [ROOT / "program" / "passes.c", *sorted((ROOT / "solvers").glob("*.c"))]
    return {
        part.stem: object_of(part, *WARNINGS, *SANITIZED, *_include(), gcc=gcc) for part in parts
    }


@pytest.fixture(scope="module")
def linked(gcc: str, objects: dict[str, str], tmp_path_factory: pytest.TempPathFactory) -> Link:
    """Links the C with the kernels of a model, once for each model."""
    made: dict[str, Path] = {}

    def link(kernels: Kernels) -> Path:
        code = kernels.manifest.code
        if code not in made:
            folder = tmp_path_factory.mktemp("linked")
            for name, text in sources(kernels).items():
                (folder / name).write_text(text)
            driver = str(Path(__file__).with_name("sanitized.c"))
            own = [f"-DTABLE={kernels.name}_kernels", driver, "kernels.c", *objects.values()]
            command = [gcc, *FLAGS, "-O0", *_include(), *own, "-lm", "-o", "run"]
            done = _run(command, folder)
            assert done.returncode == 0, done.stderr
            made[code] = folder / "run"
        return made[code]

    return link


def _run(command: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "ASAN_OPTIONS": "detect_leaks=0"}
    kept: dict[str, Any] = {"capture_output": True, "text": True}
    return subprocess.run(command, cwd=folder, env=environment, check=False, **kept)


def _include() -> list[str]:
    return [f"-I{ROOT / folder}" for folder in ("codegen", "program", "solvers")]


def ran(run: Path, what: str, file: Path, content: bytes) -> list[float]:
    """Run the program on a file and return the numbers that it prints."""
    file.write_bytes(content)
    done = _run([str(run), what, str(file)], file.parent)
    assert done.returncode == 0, done.stderr
    return [float(line) for line in done.stdout.split()]


def repeated(call: Call, kernels: Kernels, linked: Link, file: Path) -> None:
    """Repeat a call in C and compare status, counts, cost and unknowns."""
    status, iterations, restorations, cost, *x = ran(linked(kernels), "solve", file, written(call))
    expected = [call.result[name] for name in ("status", "iterations", "restorations")]
    assert [status, iterations, restorations] == expected
    assert cost == pytest.approx(call.arguments[0].values(call.x)[0], rel=1e-12)
    np.testing.assert_allclose(x, call.x, rtol=1e-10, atol=1e-12)


# Tests --------------------------------------------------------------------------------------------


def test_the_seed_problem(
    seed: dmoc.Problem, calls: list[Call], linked: Link, tmp_path: Path
) -> None:
    answer_of(seed.but(steps=30), "ipm", verify=False)
    for call in calls:
        repeated(call, seed.kernels, linked, tmp_path / "program")


def test_a_warm_start(seed: dmoc.Problem, calls: list[Call], linked: Link, tmp_path: Path) -> None:
    problem = seed.but(steps=20)
    solution = dmoc.solve(problem, "ipm", starts=1, verify=False)
    del calls[:]
    dmoc.solve(problem.but(parameters={"m_c": 1.05}), "ipm", guess=solution, verify=False)
    assert calls[0].options["warm"]
    repeated(calls[0], seed.kernels, linked, tmp_path / "program")


def test_an_infeasible_problem(
    seed: dmoc.Problem, calls: list[Call], linked: Link, tmp_path: Path
) -> None:
    """Restorations that find nothing, and the least violation with prices."""
    problem = seed.but(steps=20, bounds={"F": (-1, 1)})
    solution = dmoc.solve(problem, "ipm", starts=1, verify=False)
    assert solution.status == "infeasible"
    assert any(call.result["restorations"] for call in calls)
    assert any(call.options["least_violation"] for call in calls)
    for call in calls:
        repeated(call, seed.kernels, linked, tmp_path / "program")


def test_order_4(calls: list[Call], linked: Link, tmp_path: Path) -> None:
    kernels = dmoc.load("cart_pendulum", order=4)
    problem = dmoc.Problem(kernels, **find("cart_pendulum").defaults).but(steps=10)
    dmoc.solve(problem, "ipm", starts=1, verify=False)
    repeated(calls[0], kernels, linked, tmp_path / "program")


@pytest.mark.parametrize("order", [2, 4])
def test_no_collision(order: int, calls: list[Call], linked: Link, tmp_path: Path) -> None:
    problem = bryson_denham(20, order)
    assert dmoc.solve(problem, "ipm", starts=1, verify=False).status == "solved"
    repeated(calls[0], problem.kernels, linked, tmp_path / "program")


@pytest.mark.parametrize("order", [2, 4])
def test_everything_at_once(order: int, calls: list[Call], linked: Link, tmp_path: Path) -> None:
    """Explicit time, moving surfaces, path constraints, periodic states; it need not be solved."""
    problem = dmoc.Problem(
        dmoc.build(driven_system(), order=order), start={"a": 0.2, "z_dot": (-1, 1)},
        sequence=["floor", "side"], steps=[3, 70, 3], final_time=(None, 2.0),
        bounds={"u": (-20, 20)}, restitution={"floor": 0.6, "side": 0.0}, periodic=["a_dot", "z"],
    )  # fmt: skip
    dmoc.solve(problem, "ipm", starts=1, verify=False, iterations=30)
    repeated(calls[0], problem.kernels, linked, tmp_path / "program")


def test_factorisation_of_random_matrices(seed: dmoc.Problem, linked: Link, tmp_path: Path) -> None:
    run = linked(seed.kernels)
    for number in range(25):
        rng = np.random.default_rng(number)
        first = np.concatenate([[0], np.cumsum(rng.integers(1, 3, number % 9))]).astype(np.int32)
        n = int(first[-1]) + number % 7 + 1
        K = np.triu(rng.normal(size=(n, n)) * (rng.random((n, n)) < 0.4))
        np.fill_diagonal(K, rng.normal(size=n) + np.sign(rng.normal(size=n)) * 3)
        upper, right = scipy.sparse.csc_matrix(K), rng.normal(size=n)
        arrays = [a.astype(np.int32) for a in (first, upper.indptr, upper.indices)]
        content = whole(n, len(first) - 1) + b"".join(map(positions, arrays))
        content += numbers(upper.data) + numbers(right)
        printed = ran(run, "factor", tmp_path / "matrix", content)
        factorised = Factorisation(*arrays)
        signs, x = factorised.factor(upper.data), factorised.solve(right)
        assert tuple(printed[:3]) == signs
        np.testing.assert_allclose(printed[3:], x, rtol=1e-10, atol=1e-12)


@pytest.fixture(scope="module")
def parts(
    gcc: str, objects: dict[str, str], tmp_path_factory: pytest.TempPathFactory
) -> list[float]:
    """What parts.c prints."""
    folder, driver = tmp_path_factory.mktemp("parts"), Path(__file__).with_name("parts.c")
    inside = ("interior_search", "interior_system")
    own = [str(driver), *(o for name, o in objects.items() if name not in inside)]
    done = _run([gcc, *FLAGS, *_include(), *own, "-lm", "-o", "parts"], folder)
    assert done.returncode == 0, done.stderr
    done = _run([str(folder / "parts")], folder)
    assert done.returncode == 0, done.stderr
    return [float(line) for line in done.stdout.split()]


def test_a_filter_takes_what_is_better_and_nothing_too_far_off(parts: list[float]) -> None:
    """Whatever the objective, no violation above the largest one (Waechter & Biegler 2006, 2.3);
    then what has less of either than every entry."""
    assert parts[:7] == [1, 1, 0, 0, 0, 1, 1]


def test_steps_keep_a_share_of_the_distance_from_bounds(parts: list[float]) -> None:
    """A quarter of 1: unknowns by -3 and a slack by -6; the same steps of the multipliers of lower
    bounds, and that of an upper bound (Waechter & Biegler 2006, (15))."""
    assert parts[7:10] == [0.75 / 6, 0.75 / 6, 0.75 / 3]
    assert parts[10:13] == [0.75 / 3, 1, 1]


def test_a_newton_step_solves_the_equations_of_slacks_too(parts: list[float]) -> None:
    assert parts[13:16] == pytest.approx([0, 0, 0], abs=1e-14)


def test_a_refinement_that_makes_a_solution_worse_is_taken_back(parts: list[float]) -> None:
    assert parts[16:] == [1, 1]
