"""The command line: every command, its JSON, and its exit status."""

from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from commands import FALLING, Model, Run, printed
from matplotlib.image import imread

import dmoc
from dmoc.cli import main

pytestmark = pytest.mark.slow

FALL = "--start y=0.5 --goal y=0.5,y_dot=0 --sequence floor"
LIFT = "--start y=0.5 --goal y=0.2 --final-time 1 --steps 10 --method ipm --out o"
SHORT = "solve cart_pendulum --method ipm --final-time 1"
HASTY = "solve cart_pendulum --method ipm --steps 20 --starts 1"
HOSTILE = "x[/y]:warning:[bold]"


def test_solve_prints_the_json_alone(run: Run) -> None:
    code, out, _ = run(
        "solve cart_pendulum --steps 100 --final-time 1.0 --sequence lower --method slsqp --json -"
    )
    summary = json.loads(out)
    assert code == 0
    keys = (
        "model method status message cost final_time totals design active_bounds phases "
        "collisions largest_forces max_violation optimality iterations seconds verification "
        "certificate conflicts scale starts found first_start unseen_share others proposal"
    )
    assert " ".join(summary) == keys
    assert summary["cost"] == pytest.approx(129.6024, rel=1e-5)
    assert summary["starts"] > 5 and 1 <= summary["found"] <= summary["starts"]
    assert summary["message"].endswith(
        f"{summary['found']} of {summary['starts']} starts led to it, the first of them "
        f"{summary['first_start']}, none to another one, which leaves open that about "
        f"{summary['unseen_share']:.0%} of further ones lead to another minimum"
    )
    assert summary["first_start"].split()[0] in ("automatic", "random", "neighbour")
    assert summary["others"] == []
    assert set(summary["phases"][0]) == {"steps", "step_size", "duration", "mode"}
    keys = (
        "event surface time impulse position momentum_before momentum_after rate_before rate_after "
        "grazes lands leaves off friction impulses tractions course"
    )
    assert set(summary["collisions"][0]) == set(keys.split())
    assert {"build", "guess", "solve"} <= set(summary["seconds"])
    keys = "passed terminal_error max_defect energy_error missed_contacts"
    assert set(keys.split()) <= set(summary["verification"])


def test_laws_order_and_tolerance_are_options(run: Run, file: Model) -> None:
    """A block between start and wall (here a floor, 1 below the start), and the bouncer that is
    driven for ever."""
    model = file("s = make()")
    block = (
        f"solve {model} --start y=1 --goal y=1,y_dot=0 --sequence floor --final-time 1 --set g=0"
    )
    code, out, err = run(
        f"{block} --restitution 0.8 --order 4 --steps 8 --tolerance 1e-6 --sensitivities --certify "
        "--json -"
    )
    assert code == 0, err
    summary = json.loads(out)
    assert summary["cost"] == pytest.approx(24.58630915, rel=1e-6)
    assert summary["error_estimate"] <= 1e-6 and len(summary["meshes"]) >= 2
    assert summary["sensitivities"]["restitution"]["floor"] == pytest.approx(-6.45, rel=1e-3)
    low, high = summary["certificate"]["cost"]
    assert summary["certificate"]["proved"] and low < summary["cost"] + 1e-9 < high + 2e-9
    code, out, _ = run(
        f"{block} --restitution floor=0 --method ipm --order 4 --sensitivities --certify --out soft"
    )
    assert code == 0 and "50.95" in out and "restitution" in out and "certificate" in out
    kept = dmoc.Solution.load("soft/solution.npz").certificate
    assert kept is not None and kept.proved
    code, out, _ = run(f"verify soft/solution.npz --model {model}")
    assert code == 0 and "passed" in out
    assert run(f"{block} --restitution 0.1 --method ipm --guess soft/solution.npz")[0] == 0
    code, out, _ = run(
        f"solve {model} --start y=0.2 --periodic y,y_dot --sequence floor "
        "--final-time 0.5 --restitution 0.7 --method ipm --json -"
    )
    assert code == 0 and json.loads(out)["cost"] == pytest.approx(2.0557, rel=1e-2)


def test_a_final_time_is_fixed_and_a_range_bounds_it(run: Run, file: Model) -> None:
    """A ball that falls and comes back needs no input if it may take as long as it wants."""
    fall = f"solve {file('s = make()')} {FALL} --method ipm --steps 20"

    def final_time(option: str) -> float:
        code, out, err = run(f"{fall} --final-time {option} --json -")
        assert code == 0, err
        return float(json.loads(out)["final_time"])

    free = 2 * (2 * 0.5 / 9.81) ** 0.5
    assert final_time("1") == pytest.approx(1.0, abs=1e-9)
    assert final_time(":1") == pytest.approx(free, rel=1e-4) == final_time("0:1")
    assert final_time("0.8:1") == pytest.approx(0.8, abs=1e-6)


def test_solve_verify_and_plot_a_file(run: Run, tmp_path: Path) -> None:
    code, out, _ = run(
        "solve cart_pendulum --set m_c=1.5 --bound F=-60:60 --goal x=-1:1 --method ipm --out result"
    )
    assert code == 0 and "solved" in out
    assert {p.name for p in (tmp_path / "result").iterdir()} == {"solution.npz", "solution.png"}
    code, out, _ = run("verify result/solution.npz --json -")
    assert code == 0 and json.loads(out)["passed"]
    code, _, _ = run("plot result/solution.npz --out figure.pdf")
    assert code == 0 and (tmp_path / "figure.pdf").read_bytes()[:4] == b"%PDF"
    for name, options in (("taller", "--velocities"), ("dark", "--velocities --dark")):
        assert run(f"plot result/solution.npz --out {name}.png {options}")[0] == 0
    figures = ("result/solution.png", "taller.png", "dark.png")
    light, taller, dark = (imread(tmp_path / name) for name in figures)
    assert taller.shape[0] > 1.1 * light.shape[0] and taller.shape == dark.shape
    assert light[0, 0, :3].min() == 1.0 == taller[0, 0, :3].min() and dark[0, 0, :3].max() < 0.2


def test_infeasible_has_exit_status_1(run: Run) -> None:
    code, out, _ = run(f"{HASTY} --bound F=-1:1 --json -")
    assert code == 1 and json.loads(out)["status"] == "infeasible"


def test_a_system_file_outside_the_package_solves(run: Run, file: Model) -> None:
    model = file("s = make()")
    code, _, _ = run(f"solve {model} {FALL} --final-time :2 --out o --json o.json")
    summary = json.loads(Path("o.json").read_text())
    assert code == 0 and summary["cost"] < 1e-12
    assert summary["final_time"] == pytest.approx(2 * (2 * 0.5 / 9.81) ** 0.5)
    assert run(f"verify o/solution.npz --model {model}")[0] == 0


def test_a_problem_in_a_file_solves(run: Run, file: Model) -> None:
    model = file(
        "def s(): return dmoc.Problem(dmoc.build(make()), start={y: 0.5}, goal={y: 0.2}, "
        "final_time=1.0, steps=20)"
    )
    assert run(f"solve {model}")[0] == 0
    assert run(f"derive {model}")[0] == 2


def test_derive_generate_build_models_and_doctor(run: Run, tmp_path: Path, file: Model) -> None:
    code, out, _ = run("derive puck_table")
    assert code == 0 and "Collision conditions" in out
    assert run("derive puck_table --expanded") == (code, out, "")
    code, out, _ = run("derive puck_table --format latex")
    assert code == 0 and out.startswith(r"\documentclass")
    assert run("derive puck_table --format html -o p.html")[0] == 0
    assert (tmp_path / "p.html").read_text().startswith("<!DOCTYPE html>")
    code, _, _ = run("generate puck_table --out sources")
    assert code == 0 and (tmp_path / "sources" / "kernels.c").exists()
    model = file("s = make()")
    assert run(f"build {model}")[0] == 0
    code, out, _ = run(f"build {model}")
    assert code == 0 and "found in the cache" in out
    code, out, _ = run("models")
    assert code == 0 and "cart_pendulum_hanging" in out
    code, out, _ = run("doctor")
    assert code == 0 and "C compiler" in out


def test_module_runs_as_a_program() -> None:
    text = printed(sys.executable, "-m", "dmoc", "--help")
    for command in "models derive generate build solve verify plot doctor".split():
        assert command in text


def test_a_mass_matrix_that_is_singular_on_the_way_is_named(run: Run) -> None:
    code, out, _ = run(f"{HASTY} --set m_c=0 --json -")
    reason = "the mass matrix is singular or negative on the way"
    assert code == 1 and reason in json.loads(out)["message"]


def test_damaged_and_foreign_solutions_are_refused(
    run: Run, file: Model, solution: dmoc.Solution, tmp_path: Path
) -> None:
    solution.save("s.npz")
    Path("short.npz").write_bytes(Path("s.npz").read_bytes()[:2000])
    for command in ("verify", "plot"):
        code, _, err = run(f"{command} short.npz")
        assert code == 2 and "damaged or no solution file" in err and err.count("\n") == 1
    code, _, err = run(f"verify s.npz --model {file('s = make()')}")
    assert code == 2 and "was made for another version of model 'cart_pendulum'" in err


# Model files --------------------------------------------------------------------------------------


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
    (tmp_path / "json.py").write_text(head + FALLING + body)
    code, out, err = run("derive json.py:s")
    assert code == 0 and "mass" in out, err
    assert sys.modules["json"] is json
    del sys.modules["beside_the_model"]


def test_a_file_that_names_a_model_file_asks_for_it(run: Run, file: Model, tmp_path: Path) -> None:
    model = file(
        "import pathlib; p = pathlib.Path('ran'); p.write_text(p.read_text() + 'x' if p.exists() "
        "else 'x'); s = make()"
    )
    assert run(f"solve {model} {LIFT}")[0] == 0
    ran = (tmp_path / "ran").read_text()
    code, _, err = run("verify o/solution.npz")
    assert code == 2 and "a file may name shipped models only" in err and err.count("\n") == 1
    assert "--model file.py:name" in err
    assert run("plot o/solution.npz")[0] == 0
    assert (tmp_path / "ran").read_text() == ran
    assert run(f"verify o/solution.npz --model {model}")[0] == 0


def test_a_model_that_is_called_like_a_shipped_one_is_drawn_as_itself(
    run: Run, file: Model
) -> None:
    model = file("s = make(name='cart_pendulum')")
    code, _, err = run(f"solve {model} {LIFT}")
    assert code == 0 and not err
    solution = dmoc.Solution.load("o/solution.npz")
    assert solution.trajectory.scene is None
    snapshots, *panels = solution.plot().axes
    assert [text.get_text() for text in snapshots.texts] == ["$y$"] and len(panels) == 3


# What is printed ----------------------------------------------------------------------------------


def test_names_are_printed_as_they_are(run: Run, file: Model) -> None:
    code, out, _ = run(f"{HASTY} --final-time 1 --out {HOSTILE}")
    assert code == 1
    for end in ("npz", "png"):
        assert f"written: {HOSTILE}/solution.{end}\n" in out
    code, out, _ = run(f"plot {HOSTILE}/solution.npz --out {HOSTILE}/[red].png")
    assert code == 0 and out == f"written: {HOSTILE}/[red].png\n"
    code, out, _ = run("generate cart_pendulum --out", HOSTILE)
    assert code == 0 and f"{HOSTILE}/kernels.c\n" in out
    model = file("s = make(units={'y': '[/m]'})")
    code, out, _ = run(
        f"solve {model} {LIFT} --starts 1 --goal y=3 --bound u=-1:1".replace("--goal y=0.2", "")
    )
    assert code == 1 and "[/m]" in out


COMMANDS = "solve *, solve *.py:s, verify *, plot *, *".split(", ")
OPTIONS = "--sequence *, --set *=1, --steps *, --*, --out /proc/*, --json /proc/*".split(", ")


@pytest.mark.parametrize("command", [*COMMANDS, *(f"solve cart_pendulum {o}" for o in OPTIONS)])
def test_errors_say_names_as_they_are(run: Run, command: str) -> None:
    code, _, err = run(command.replace("*", HOSTILE))
    words = "".join(err.replace("│", " ").split())  # the frame of a wrong option breaks lines
    assert code == 2 and "x[/y]:warning" in words and "Traceback" not in err


def test_the_remedy_for_a_missing_extra_is_whole(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("matplotlib.figure", "matplotlib.backends.backend_agg"):
        monkeypatch.setitem(sys.modules, name, None)
    code, out, err = run(f"{SHORT} --out o")
    assert code == 0 and "status" in out and "o/solution.npz" in out and "png" not in out
    remedy = "Matplotlib is needed to plot: install it with `pip install 'dmoc[plot]'`."
    assert err == f"note: o/solution.png was not drawn: {remedy}\n"


# Nothing is lost ----------------------------------------------------------------------------------


def full(*_: object) -> None:
    raise OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.parametrize(
    "drawing", ["dmoc.report.figure.new_figure", "dmoc.report.canvas.write_whole"]
)
def test_a_figure_that_fails_loses_nothing(
    run: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, drawing: str
) -> None:
    monkeypatch.setattr(drawing, full)
    code, out, err = run(f"{SHORT} --out o --json o/j.json")
    assert code == 0 and "cost" in out and "written: o/solution.npz" in out
    assert err.startswith("note: o/solution.png was not drawn: ") and err.count("\n") == 1
    assert "No space left on device" in err
    assert sorted(p.name for p in (tmp_path / "o").iterdir()) == ["j.json", "solution.npz"]


def test_a_full_disk_keeps_the_summary(
    run: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(os, "fsync", full)
    code, out, err = run(f"{SHORT} --out o --json j.json")
    assert code == 2 and "cost" in out and "written" not in out
    assert "error: o/solution.npz cannot be written (No space left on device)" in err
    assert "Traceback" not in err
    assert not list((tmp_path / "o").iterdir()) and not (tmp_path / "j.json").exists()


def test_standard_output_without_room_is_one_sentence() -> None:
    sentence = "error: standard output cannot be written (No space left on device)"
    for words in ("models", "derive puck_table", f"{SHORT} --json -"):
        command = [sys.executable, "-m", "dmoc", *words.split()]
        with open("/dev/full", "w") as nowhere:
            done = subprocess.run(command, stdout=nowhere, stderr=subprocess.PIPE, text=True)
        assert done.returncode == 2 and done.stderr.startswith(sentence)
        assert done.stderr.count("\n") == 1


def test_no_compiler_is_one_sentence(
    run: Run, file: Model, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("CC", "no-such-compiler")
    monkeypatch.setenv("DMOC_CACHE", str(tmp_path / "cache"))
    code, _, err = run(f"build {file('s = make()')}")
    assert code == 2 and "install gcc or clang" in err and err.count("\n") == 1


def test_debug_shows_the_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", ["dmoc", "solve", "cart_pendulum", "--steps", "0", "--debug"])
    with pytest.raises(dmoc.DmocError):
        main()
