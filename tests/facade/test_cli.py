"""The command line: every command, its JSON, its exit status, and one clear sentence for every
bad input."""

from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from commands import Run
from matplotlib.image import imread

import dmoc
from dmoc.cli import main

SYSTEM = """
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols
import dmoc
y, u = dynamicsymbols("y u")
m, g = sp.symbols("m g")
t = dynamicsymbols._t
def make(name="mass", lagrangian=None, **changes):
    falling = m * y.diff(t)**2 / 2 - m * g * y
    given = dict(coordinates=[y], inputs=[u], lagrangian=lagrangian or falling, forces={y: u},
                 surfaces={"floor": y >= 0}, parameters={m: 1.0, g: 9.81}, cost=u**2 / 2)
    return dmoc.MechanicalSystem(name, **{**given, **changes})
"""


@pytest.fixture
def file(tmp_path: Path) -> Callable[[str], str]:
    def write(line: str) -> str:
        (tmp_path / "system.py").write_text(SYSTEM + line)
        return "system.py:s"

    return write


def test_help_is_shown_without_loading_numpy() -> None:
    code = (
        "import sys, dmoc.cli; sys.argv = ['dmoc', '--help']\n"
        "try: dmoc.cli.main()\n"
        "except SystemExit: print(sorted({'numpy', 'scipy', 'sympy', 'sqlite3', 'matplotlib', "
        "'multiprocessing'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "Usage: dmoc" in done.stdout and done.stdout.splitlines()[-1] == "[]"


def test_solve_prints_the_json_alone(run: Run) -> None:
    command = (
        "solve cart_pendulum --steps 100 --final-time 1.0 --sequence left --method slsqp --json -"
    ).split()
    code, out, _ = run(*command)
    found = json.loads(out)
    assert code == 0
    assert list(found) == [
        "model",
        "method",
        "status",
        "message",
        "cost",
        "final_time",
        "active_bounds",
        "phases",
        "collisions",
        "largest_forces",
        "max_violation",
        "optimality",
        "iterations",
        "seconds",
        "verification",
        "conflicts",
        "scale",
        "starts",
        "found",
        "others",
        "proposal",
    ]
    assert found["cost"] == pytest.approx(129.6024, rel=1e-5)
    assert found["starts"] >= 16 and 1 <= found["found"] <= found["starts"]
    assert found["message"].endswith(
        f"{found['found']} of {found['starts']} starts led to it, none to another one"
    )
    assert found["others"] == []
    assert set(found["phases"][0]) == {"steps", "step_size", "duration", "mode"}
    keys = {
        "event",
        "surface",
        "time",
        "impulse",
        "position",
        "momentum_before",
        "momentum_after",
        "rate_before",
        "rate_after",
        "grazes",
        "lands",
        "leaves",
        "friction",
        "impulses",
        "tractions",
        "course",
    }
    assert set(found["collisions"][0]) == keys
    assert {"build", "guess", "solve"} <= set(found["seconds"])
    assert {"passed", "terminal_error", "max_defect", "energy_error", "missed_contacts"} <= set(
        found["verification"]
    )


@pytest.mark.slow
def test_laws_order_and_tolerance_are_options(run: Run, file: Callable[[str], str]) -> None:
    """A block between start and wall (here a floor, 1 below the start), and the bouncer that is
    driven for ever."""
    model = file("s = make()")
    block = [
        "--start",
        "y=1",
        "--goal",
        "y=1",
        "--goal",
        "y_dot=0",
        "--sequence",
        "floor",
        "--final-time",
        "1",
        "--set",
        "g=0",
    ]
    code, out, err = run(
        "solve",
        model,
        *block,
        "--restitution",
        "0.8",
        "--order",
        "4",
        "--steps",
        "8",
        "--tolerance",
        "1e-6",
        "--sensitivities",
        "--json",
        "-",
    )
    assert code == 0, err
    found = json.loads(out)
    assert found["cost"] == pytest.approx(24.58630915, rel=1e-6)
    assert found["error_estimate"] <= 1e-6 and len(found["meshes"]) >= 2
    assert found["sensitivities"]["restitution"]["floor"] == pytest.approx(-6.45, rel=1e-3)
    code, out, _ = run(
        "solve",
        model,
        *block,
        "--restitution",
        "floor=0",
        "--method",
        "ipm",
        "--order",
        "4",
        "--sensitivities",
        "--out",
        "soft",
    )
    assert code == 0 and "50.95" in out and "restitution" in out
    code, out, _ = run("verify", "soft/solution.npz", "--model", model)
    assert code == 0 and "passed" in out
    code, out, _ = run(
        "solve",
        model,
        *block,
        "--restitution",
        "0.1",
        "--method",
        "ipm",
        "--guess",
        "soft/solution.npz",
    )
    assert code == 0
    code, out, _ = run(
        "solve",
        model,
        "--start",
        "y=0.2",
        "--periodic",
        "y,y_dot",
        "--sequence",
        "floor",
        "--final-time",
        "0.5",
        "--restitution",
        "0.7",
        "--method",
        "ipm",
        "--json",
        "-",
    )
    assert code == 0 and json.loads(out)["cost"] == pytest.approx(2.0557, rel=1e-2)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--restitution", "1.5"], "expected a number from 0 (plastic) to 1 (elastic)"),
        (["--restitution", "left=x"], "expected a number"),
        (["--restitution", "lef=0.5"], "unknown surface, expected one of left, right"),
        (["--order", "3"], "order = 3: expected one of 2, 4"),
        (
            ["--order", "4", "--controls", "linear"],
            "expected one of stages, constant with kernels of order 4",
        ),
        (["--periodic", "beta"], "unknown state 'beta' in periodic"),
        (["--tolerance", "-1"], "expected a positive number"),
    ],
)
def test_wrong_laws_are_one_sentence(run: Run, options: list[str], message: str) -> None:
    code, _, err = run("solve", "cart_pendulum", *options)
    assert code == 2 and message in err.replace("\n", " ")


def test_a_final_time_is_fixed_and_a_range_bounds_it(run: Run, file: Callable[[str], str]) -> None:
    """A ball that falls and comes back needs no input if it may take as long as it wants."""
    fall = [
        "solve",
        file("s = make()"),
        *"--start y=0.5 --goal y=0.5 --goal y_dot=0 --sequence floor".split(),
        *"--method ipm --steps 20".split(),
    ]

    def final_time(option: str) -> float:
        code, out, err = run(*fall, "--final-time", option, "--json", "-")
        assert code == 0, err
        return float(json.loads(out)["final_time"])

    free = 2 * (2 * 0.5 / 9.81) ** 0.5
    assert final_time("1") == pytest.approx(1.0, abs=1e-9)
    assert final_time(":1") == pytest.approx(free, rel=1e-4) == final_time("0:1")
    assert final_time("0.8:1") == pytest.approx(0.8, abs=1e-6)


def test_solve_verify_and_plot_a_file(run: Run, tmp_path: Path) -> None:
    code, out, _ = run(
        "solve",
        "cart_pendulum",
        "--set",
        "m_c=1.5",
        "--bound",
        "F=-60:60",
        "--goal",
        "x=-1:1",
        "--out",
        "result",
    )
    assert code == 0 and "solved" in out
    assert sorted(p.name for p in (tmp_path / "result").iterdir()) == [
        "solution.npz",
        "solution.png",
    ]
    code, out, _ = run("verify", "result/solution.npz", "--json", "-")
    assert code == 0 and json.loads(out)["passed"]
    code, _, _ = run("plot", "result/solution.npz", "--out", "figure.pdf")
    assert code == 0 and (tmp_path / "figure.pdf").read_bytes()[:4] == b"%PDF"
    options = ("--velocities", "--dark")
    for number in range(3):
        name = f"{number}.png"
        assert run("plot", "result/solution.npz", "--out", name, *options[:number])[0] == 0
    light, taller, dark = (imread(tmp_path / f"{number}.png") for number in range(3))
    assert taller.shape[0] > 1.1 * light.shape[0] and taller.shape == dark.shape
    assert light[0, 0, :3].min() == 1.0 == taller[0, 0, :3].min() and dark[0, 0, :3].max() < 0.2


def test_infeasible_has_exit_status_1(run: Run) -> None:
    code, out, _ = run(
        "solve",
        "cart_pendulum",
        "--bound",
        "F=-1:1",
        "--method",
        "ipm",
        "--steps",
        "40",
        "--json",
        "-",
    )
    assert code == 1 and json.loads(out)["status"] == "infeasible"


def test_a_system_file_outside_the_package_solves(run: Run, file: Callable[[str], str]) -> None:
    model = file("s = make()")
    command = "--start y=0.5 --goal y=0.5 --goal y_dot=0 --sequence floor --final-time :2".split()
    code, _, _ = run("solve", model, *command, "--out", "o", "--json", "o.json")
    found = json.loads(Path("o.json").read_text())
    assert code == 0 and found["cost"] < 1e-12
    assert found["final_time"] == pytest.approx(2 * (2 * 0.5 / 9.81) ** 0.5)
    assert run("verify", "o/solution.npz", "--model", model)[0] == 0


def test_a_problem_in_a_file_solves(run: Run, file: Callable[[str], str]) -> None:
    model = file(
        "def s(): return dmoc.Problem(dmoc.build(make()), start={y: 0.5}, goal={y: 0.2}, "
        "final_time=1.0, steps=20)"
    )
    assert run("solve", model)[0] == 0
    assert run("derive", model)[0] == 2


def test_derive_generate_build_models_and_doctor(
    run: Run, tmp_path: Path, file: Callable[[str], str]
) -> None:
    code, out, _ = run("derive", "cart_pendulum")
    assert code == 0 and "Collision conditions" in out
    code, out, _ = run("derive", "cart_pendulum", "--format", "latex")
    assert code == 0 and out.startswith(r"\documentclass")
    code, _, _ = run("generate", "cart_pendulum", "--out", "sources")
    assert code == 0 and (tmp_path / "sources" / "kernels.c").exists()
    model = file("s = make()")
    assert run("build", model)[0] == 0
    code, out, _ = run("build", model)
    assert code == 0 and "found in the cache" in out
    code, out, _ = run("models")
    assert code == 0 and "cart_pendulum_hanging" in out
    code, out, _ = run("doctor")
    assert code == 0 and "C compiler" in out


def test_module_runs_as_a_program() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "dmoc", "--help"], capture_output=True, text=True, check=True
    )
    for command in "models derive generate build solve verify plot doctor".split():
        assert command in done.stdout


SOLVE_ERRORS = {
    "--set m_c=-1": "mass matrix is not positive definite at the start (m_c=-1)",
    "--set m_p=-1": "m_p=-1",
    "--set m_c=nan": "parameter m_c = nan: expected a finite number",
    "--set m=1": "unknown parameter 'm'",
    "--set m_c": "expected NAME=VALUE",
    "--start alpha=0.1": "the start (alpha=0.1) lies behind surface 'left'",
    "--goal alpha=3": "the goal (alpha=3) lies behind surface 'right'",
    "--start beta=0": "unknown state 'beta' at the start",
    "--goal x_dott=0": "did you mean 'x_dot'",
    "--bound F=10:-10": "the lower bound 10 exceeds the upper bound -10",
    "--bound F=60": "bounds of F = 60.0: expected a pair (lower, upper)",
    "--bound G=0:1": "unknown input or coordinate 'G'",
    "--bound F=a:1": "expected a number",
    "--start alpha_dot=1 --start p_alpha=1": "has a fixed velocity (alpha_dot) and a fixed "
    "momentum (p_alpha)",
    "--seconds nan": "expected a positive time limit",
    "--sequence up": "unknown surface 'up' in the sequence: expected one of left, right",
    "--sequence left,lef": "did you mean 'left'",
    "--steps 0": "expected a whole number of at least 2 steps",
    "--steps -5": "expected a whole number of at least 2 steps",
    "--steps 10,10,10": "one for each of the 2 phases",
    "--steps 1000000000": "expected at most 100000 steps",
    "--steps 50000": "takes at most 2000 inputs in all steps",
    "--steps many": "expected a whole number",
    "--final-time -1": "expected a positive time",
    "--final-time 2:1": "exceeds the upper bound",
    "--method newton": "expected one of slsqp, ipm, ipopt, uno",
    "--out /proc/nowhere": "cannot be written",
    "--json /proc/nowhere/x.json": "cannot be written",
}


@pytest.mark.parametrize(("options", "message"), SOLVE_ERRORS.items())
def test_bad_options_are_one_sentence_and_write_nothing(
    run: Run, tmp_path: Path, options: str, message: str
) -> None:
    code, out, err = run("solve", "cart_pendulum", *options.split())
    assert code == 2
    assert message in err.replace("\n", " ")
    assert err.count("\n") == 1 and "Traceback" not in err
    assert not out and not list(tmp_path.iterdir())


def test_a_mass_matrix_that_is_singular_on_the_way_is_named(run: Run) -> None:
    code, out, _ = run(
        "solve",
        "cart_pendulum",
        "--set",
        "m_c=0",
        "--steps",
        "20",
        "--method",
        "ipm",
        "--json",
        "-",
    )
    assert (
        code == 1
        and "the mass matrix is singular or negative on the way" in json.loads(out)["message"]
    )


MODEL_ERRORS = {
    "s = make(lagrangian=m*g*y + m*sp.cos(y))": "does not contain the velocity of coordinate y",
    "x = dynamicsymbols('x'); s = make(coordinates=[y, x], lagrangian=m*(y.diff(t) + "
    "x.diff(t))**2/2 - m*g*y)": "is singular",
    "x = dynamicsymbols('x'); s = make(coordinates=[y, x])": "does not contain the velocity of "
    "coordinate x",
    "s = make(lagrangian=m*y.diff(t)**2/2 - m*g*y*sp.Symbol('k'))": "contains the symbol k, which "
    "is unknown",
    "s = make(parameters={m: 1.0, g: 9.81, sp.Symbol('k'): 1.0})": "parameter k is used nowhere",
    "s = make(parameters={m: 1.0})": "contains the symbol g, which is unknown",
    "s = make(parameters={m: None, g: 9.81})": "parameter m of model 'mass' has no value",
    "s = make(parameters={m: float('nan'), g: 9.81})": "parameter m = nan: a finite number was "
    "expected",
    "s = make(parameters={m: -1.0, g: 9.81})": "mass matrix is not positive definite at the start "
    "(m=-1)",
    "s = make(inputs=[u, dynamicsymbols('w')])": "input w appears in no force",
    "s = make(name='int')": "is a keyword of C or Python",
    "s = make(name='../../x')": "is not a C identifier",
    "s = make(name='x;system(\"rm\")')": "is not a C identifier",
    "s = make(surfaces={'a b': y >= 0})": "is not a C identifier",
    "s = make(parameters={m: 1.0, g: 9.81, sp.Symbol('*/ int main(){'): 1.0})": "is not a C "
    "identifier",
    "s = make(forces={y: u + sp.gamma(y)})": "cannot be turned into C",
    "s = make(surfaces={'floor': y})": "is not an inequality",
    "d = sp.Function('durations')(t); s = make(coordinates=[y, d], lagrangian="
    "m * (y.diff(t)**2 + d.diff(t)**2))": "the coordinate 'durations' has the name of the times",
    "s = make(parameters={m: 1.0, g: 9.81, t: 1.0})": "the parameter 't' has the name of the time",
    "s = make(lagrangian=m*y.diff(t)**4/2 - m*g*y)": "not quadratic in the velocities",
    "s = make(lagrangian=m*y.diff(t, 2)**2/2 - m*g*y)": "not the first derivative of a coordinate",
    "s = 3": "expected a MechanicalSystem or a Problem",
    "r = make()": "defines no 's'",
    "s = make(": "cannot be read",
    "s = 1 / 0": "cannot be loaded: ZeroDivisionError in line",
}


@pytest.mark.parametrize(("line", "message"), MODEL_ERRORS.items())
def test_bad_models_are_one_sentence(
    run: Run, file: Callable[[str], str], line: str, message: str
) -> None:
    code, out, err = run(
        "solve",
        file(line),
        "--start",
        "y=1",
        "--start",
        "x=0" if "'x'" in line else "y=1",
        "--final-time",
        "1",
    )
    assert code == 2
    assert message in err.replace("\n", " ")
    assert err.count("\n") == 1 and "Traceback" not in err
    assert not out


@pytest.mark.parametrize(
    ("reference", "message"),
    [
        ("pendulum_cart", "unknown model 'pendulum_cart'"),
        ("nothing.py:s", "does not exist"),
        ("a.txt:s", "does not exist"),
    ],
)
def test_unknown_models_are_named(run: Run, reference: str, message: str) -> None:
    for command in ("derive", "generate", "build", "solve"):
        code, _, err = run(command, reference)
        assert code == 2 and message in err


def test_damaged_and_foreign_solutions_are_refused(
    run: Run, file: Callable[[str], str], solution: dmoc.Solution, tmp_path: Path
) -> None:
    solution.save("s.npz")
    Path("short.npz").write_bytes(Path("s.npz").read_bytes()[:2000])
    for command in ("verify", "plot"):
        code, _, err = run(command, "short.npz")
        assert code == 2 and "damaged or no solution file" in err and err.count("\n") == 1
    code, _, err = run("verify", "s.npz", "--model", file("s = make()"))
    assert code == 2 and "was made for another version of model 'cart_pendulum'" in err


# Model files --------------------------------------------------------------------------------------

FAILURES = {
    "import sys; sys.exit(0)": "ends the program: a model file must not call sys.exit",
    "def s(): raise SystemExit": "ends the program",
    "def s(): return 1 / 0": "cannot be loaded: ZeroDivisionError in line",
    "def s(): raise ValueError('[red]two\\nlines[/x]')": "[red]two lines[/x]; correct the file",
    "class Own(BaseException): pass\ndef s(): raise Own": "cannot be loaded: Own in line",
    "def s(name, more=1): return make()": "s in {folder}/system.py needs the arguments name",
    "def s(): return s()": "cannot be loaded: RecursionError in line",
    "def s(): return None": "is None: expected a MechanicalSystem or a Problem",
    "import sys; sys.path = []; del sys.path[:]; raise KeyError": "cannot be loaded: KeyError in "
    "line",
    "import sys; sys.path.clear(); s = 3": "is 3: expected a MechanicalSystem or a Problem",
}


@pytest.mark.parametrize(("line", "message"), FAILURES.items())
def test_what_a_model_file_does_wrong_is_one_sentence(
    run: Run, file: Callable[[str], str], tmp_path: Path, line: str, message: str
) -> None:
    paths, places = sys.path, list(sys.path)
    code, out, err = run("derive", file(line))
    assert code == 2 and message.format(folder=tmp_path) in err
    assert err.count("\n") == 1 and "Traceback" not in err and not out
    assert sys.path is paths and sys.path == places


def test_a_model_file_may_hold_dataclasses_and_import_its_neighbours(
    run: Run, tmp_path: Path
) -> None:
    """A dataclass with postponed annotations looks its module up; both modules are called like
    ones that are loaded already."""
    (tmp_path / "beside_the_model.py").write_text("mass = 2.0\n")
    head = "from __future__ import annotations\nimport dataclasses, beside_the_model\n"
    body = (
        "@dataclasses.dataclass\nclass Arm:\n    length: float = 1.0\ndef s(): return "
        "make(parameters={m: beside_the_model.mass, g: Arm().length})\n"
    )
    (tmp_path / "json.py").write_text(head + SYSTEM + body)
    code, out, err = run("derive", "json.py:s")
    assert code == 0 and "mass" in out, err
    assert sys.modules["json"] is json
    del sys.modules["beside_the_model"]


def test_a_file_that_names_a_model_file_asks_for_it(
    run: Run, file: Callable[[str], str], tmp_path: Path
) -> None:
    model = file(
        "import pathlib; p = pathlib.Path('ran'); p.write_text(p.read_text() + 'x' if p.exists() "
        "else 'x'); s = make()"
    )
    command = "--start y=0.5 --goal y=0.2 --final-time 1 --steps 10 --method ipm --out o".split()
    assert run("solve", model, *command)[0] == 0
    ran = (tmp_path / "ran").read_text()
    code, _, err = run("verify", "o/solution.npz")
    assert (
        code == 2
        and "a file may name shipped models only" in err
        and "--model file.py:name" in err
        and err.count("\n") == 1
    )
    assert run("plot", "o/solution.npz")[0] == 0
    assert (tmp_path / "ran").read_text() == ran
    assert run("verify", "o/solution.npz", "--model", model)[0] == 0


def test_a_model_that_is_called_like_a_shipped_one_is_drawn_as_itself(
    run: Run, file: Callable[[str], str]
) -> None:
    model = file("s = make(name='cart_pendulum')")
    code, _, err = run(
        "solve",
        model,
        *"--start y=0.5 --goal y=0.2 --final-time 1 --steps 10 --method ipm --out o".split(),
    )
    assert code == 0 and not err
    solution = dmoc.Solution.load("o/solution.npz")
    assert solution.trajectory.scene is None
    snapshots, *panels = solution.plot().axes
    assert [text.get_text() for text in snapshots.texts] == ["$y$"] and len(panels) == 3


# What is printed ----------------------------------------------------------------------------------

HOSTILE = "x[/y]:warning:[bold]"


@pytest.mark.slow
def test_names_are_printed_as_they_are(run: Run, file: Callable[[str], str]) -> None:
    code, out, _ = run(
        "solve",
        "cart_pendulum",
        "--method",
        "ipm",
        "--steps",
        "20",
        "--final-time",
        "1",
        "--out",
        HOSTILE,
    )
    assert (
        code == 1
        and f"written: {HOSTILE}/solution.npz\n" in out
        and f"written: {HOSTILE}/solution.png\n" in out
    )
    code, out, _ = run("plot", f"{HOSTILE}/solution.npz", "--out", f"{HOSTILE}/[red].png")
    assert code == 0 and out == f"written: {HOSTILE}/[red].png\n"
    code, out, _ = run("generate", "cart_pendulum", "--out", HOSTILE)
    assert code == 0 and f"{HOSTILE}/kernels.c\n" in out
    code, out, _ = run(
        "solve",
        file("s = make(units={'y': '[/m]'})"),
        *"--start y=1 --goal y=3 --final-time 1".split(),
        "--bound",
        "u=-1:1",
        "--method",
        "ipm",
        "--steps",
        "10",
    )
    assert code == 1 and "[/m]" in out


@pytest.mark.parametrize(
    "arguments",
    [
        ["solve", HOSTILE],
        ["solve", f"{HOSTILE}.py:s"],
        ["solve", "cart_pendulum", "--sequence", HOSTILE],
        ["solve", "cart_pendulum", "--set", f"{HOSTILE}=1"],
        ["solve", "cart_pendulum", "--steps", HOSTILE],
        ["solve", "cart_pendulum", f"--{HOSTILE}"],
        ["solve", "cart_pendulum", "--out", f"/proc/{HOSTILE}"],
        ["solve", "cart_pendulum", "--json", f"/proc/{HOSTILE}"],
        ["verify", HOSTILE],
        ["plot", HOSTILE],
        [HOSTILE],
    ],
)
def test_errors_say_names_as_they_are(run: Run, arguments: list[str]) -> None:
    code, _, err = run(*arguments)
    said = "".join(err.replace("│", " ").split())  # the frame of a wrong option breaks lines
    assert code == 2 and "x[/y]:warning" in said and "Traceback" not in err


def test_the_remedy_for_a_missing_extra_is_whole(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("matplotlib.figure", "matplotlib.backends.backend_agg"):
        monkeypatch.setitem(sys.modules, name, None)
    code, out, err = run("solve", "cart_pendulum", *SHORT, "--out", "o")
    assert code == 0 and "status" in out and "o/solution.npz" in out and "png" not in out
    assert (
        err
        == "note: o/solution.png was not drawn: Matplotlib is needed to plot: install it with `pip "
        "install 'dmoc[plot]'`.\n"
    )


# Nothing is lost ----------------------------------------------------------------------------------

SHORT = "--method ipm --final-time 1".split()


def full(*_: object) -> None:
    raise OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.parametrize(
    "drawing", ["dmoc.report.figure.new_figure", "dmoc.report.canvas.write_whole"]
)
def test_a_figure_that_fails_loses_nothing(
    run: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, drawing: str
) -> None:
    monkeypatch.setattr(drawing, full)
    code, out, err = run("solve", "cart_pendulum", *SHORT, "--out", "o", "--json", "o/j.json")
    assert code == 0 and "cost" in out and "written: o/solution.npz" in out
    assert (
        err.startswith("note: o/solution.png was not drawn: ")
        and "No space left on device" in err
        and err.count("\n") == 1
    )
    assert sorted(p.name for p in (tmp_path / "o").iterdir()) == ["j.json", "solution.npz"]


def test_a_full_disk_keeps_the_summary(
    run: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(os, "fsync", full)
    code, out, err = run("solve", "cart_pendulum", *SHORT, "--out", "o", "--json", "j.json")
    assert code == 2 and "cost" in out and "written" not in out
    assert (
        "error: o/solution.npz cannot be written (No space left on device)" in err
        and "Traceback" not in err
    )
    assert not list((tmp_path / "o").iterdir()) and not (tmp_path / "j.json").exists()


@pytest.mark.slow
def test_standard_output_without_room_is_one_sentence() -> None:
    for command in (
        ["models"],
        ["derive", "puck_table"],
        ["solve", "cart_pendulum", *SHORT, "--json", "-"],
    ):
        with open("/dev/full", "w") as nowhere:
            done = subprocess.run(
                [sys.executable, "-m", "dmoc", *command],
                stdout=nowhere,
                stderr=subprocess.PIPE,
                text=True,
                check=False,
            )
        assert done.returncode == 2
        assert done.stderr.startswith(
            "error: standard output cannot be written (No space left on device)"
        )
        assert done.stderr.count("\n") == 1


def test_no_compiler_is_one_sentence(
    run: Run, file: Callable[[str], str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("CC", "no-such-compiler")
    monkeypatch.setenv("DMOC_CACHE", str(tmp_path / "cache"))
    code, _, err = run("build", file("s = make()"))
    assert code == 2 and "install gcc or clang" in err and err.count("\n") == 1


def test_debug_shows_the_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", ["dmoc", "solve", "cart_pendulum", "--steps", "0", "--debug"])
    with pytest.raises(dmoc.DmocError):
        main()
