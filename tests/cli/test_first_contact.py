"""What a new user meets first: versions, what the doctor says, completion, and a system file."""

from __future__ import annotations

import errno
import json
import os
import pickle
import platform
import re
import runpy
import tomllib
from pathlib import Path
from typing import Any

import pytest
import sympy as sp
from commands import Run
from matplotlib.image import imread
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base import errors
from dmoc.cli.new import TemplateKind
from dmoc.solvers.outcome import Status

ROOT = Path(__file__).resolve().parents[2]
TIME = dynamicsymbols._t


@pytest.fixture
def no_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "no-such-compiler")


def test_the_version_is_that_of_the_project_file() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert dmoc.__version__ == project["version"]
    assert "__version__" in dir(dmoc)
    assert [name for name in dir(dmoc) if not name.startswith("_")] == sorted(dmoc.__all__)


@pytest.mark.parametrize("option", ["--version", "-V"])
def test_versions_and_backend_are_a_line(run: Run, option: str) -> None:
    code, out, err = run(option)
    line = f"dmoc {dmoc.__version__}, Python {platform.python_version()}; kernels are compiled by "
    assert code == 0 and not err and out.startswith(line) and out.count("\n") == 1


@pytest.mark.usefixtures("no_compiler")
def test_the_version_says_that_there_is_no_compiler(run: Run) -> None:
    code, out, _ = run("-V")
    assert code == 0 and out.endswith("kernels run on NumPy, because there is no C compiler\n")


def findings(run: Run) -> tuple[int, bool, dict[str, dict[str, str]]]:
    code, out, err = run("doctor --json")
    printed = json.loads(out)
    assert not err
    return code, printed["well"], {part["part"]: part for part in printed["parts"]}


def test_the_doctor_says_that_all_is_well(run: Run) -> None:
    code, out, err = run("doctor")
    assert code == 0 and not err and out.splitlines()[-1].startswith("All is well")
    code, well, parts = findings(run)
    assert code == 0 and well
    assert parts["dmoc"]["found"] == dmoc.__version__
    assert parts["model cart_pendulum"]["found"] == "compiled"
    assert {part["state"] for part in parts.values()} <= {"ok", "absent"}


@pytest.mark.usefixtures("no_compiler")
def test_the_doctor_names_a_missing_compiler_and_what_cures_it(run: Run) -> None:
    code, out, _ = run("doctor")
    assert code == 2 and out.splitlines()[-1] == "Not well: C compiler."
    code, well, parts = findings(run)
    assert code == 2 and not well and parts["C compiler"]["state"] == "wrong"
    assert "apt install gcc" in parts["C compiler"]["cure"]


def test_the_doctor_tries_the_compiler(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "false")
    code, _, parts = findings(run)
    assert code == 2 and "the compiler failed" in parts["C compiler"]["cure"]


def test_the_doctor_names_a_cache_that_cannot_be_used(
    run: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("DMOC_CACHE", str(tmp_path / "file"))
    code, _, parts = findings(run)
    assert code == 2 and "set DMOC_CACHE" in parts["kernel cache"]["cure"]
    (tmp_path / "open").mkdir(mode=0o777)
    (tmp_path / "open").chmod(0o777)
    monkeypatch.setenv("DMOC_CACHE", str(tmp_path / "open"))
    code, _, parts = findings(run)
    assert code == 2 and "other users may write to" in parts["kernel cache"]["cure"]


def test_an_extra_that_is_not_installed_is_no_trouble(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    from importlib import metadata

    installed = metadata.version

    def version(name: str) -> str:
        if name == "ipyopt":
            raise metadata.PackageNotFoundError(name)
        return installed(name)

    monkeypatch.setattr(metadata, "version", version)
    code, out, _ = run("doctor")
    sentence = r"All is well; \d optional parts? (is|are) not there\."
    assert code == 0 and re.fullmatch(sentence, out.splitlines()[-1])
    _, _, parts = findings(run)
    assert parts["ipyopt"]["state"] == "absent" and "dmoc[ipopt]" in parts["ipyopt"]["cure"]


def test_a_new_file_is_there_with_its_name_and_what_to_do_next(run: Run, tmp_path: Path) -> None:
    code, out, err = run("new begun --out models")
    text = (tmp_path / "models" / "begun.py").read_text(encoding="utf-8")
    assert code == 0 and not err and "my_system" not in text and '"begun"' in text
    assert out.splitlines() == [
        "written: models/begun.py",
        "It is complete and runs as it is. Next:",
        "    python models/begun.py",
        "    dmoc solve models/begun.py:problem --out begun",
        "    dmoc derive models/begun.py:system",
    ]


def test_a_new_file_replaces_none(run: Run, tmp_path: Path) -> None:
    (tmp_path / "begun.py").write_text("mine")
    code, out, err = run("new begun")
    assert code == 2 and not out and err.startswith("error: begun.py exists, and is left as it is")
    assert (tmp_path / "begun.py").read_text() == "mine"


COSTS = {
    "collision": 24.0,  # twice 3/2 (2 d/T)^2 over T/2, d = 1 m, T = 1 s
    "contact": 2 / 3 * (6 * (0.3 * 9.81) ** 3) ** 0.5,  # slides for sqrt(6 d/(mu g))
    "mechanism": 2.58013,  # of the same hammer by its angle, without a constraint
    "smooth": None,
    "fit": None,
    "robot": None,
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", [kind.value for kind in TemplateKind])
def test_what_a_new_file_says_comes_next_works(
    run: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str], kind: str
) -> None:
    _, out, _ = run("new begun --kind", kind)
    commands = [line.strip() for line in out.splitlines() if line.startswith("    ")]
    assert len(commands) == 3
    assert commands[0] == "python begun.py"
    runpy.run_path("begun.py", run_name="__main__")
    texts = [capsys.readouterr().out]
    for command in commands[1:]:
        code, out, err = run(command.removeprefix("dmoc "))
        assert code == 0 and not err and command.startswith("dmoc ")
        texts.append(out)
    rows = dict(re.findall(r"^ (\w+) +(\S+)", texts[0], re.MULTILINE))
    assert rows["status"] == "solved:"
    cost = float(rows["cost"])
    assert COSTS[kind] is None or cost == pytest.approx(COSTS[kind], rel=1e-3)
    assert "passed" in texts[1] and "Lagrangian" in texts[2]
    for made in ("begun.npz", "begun.png", "begun/solution.npz", "begun/solution.png"):
        assert (tmp_path / made).stat().st_size > 1000


def machine(run: Run, kind: str) -> tuple[dmoc.MechanicalSystem, dict[str, Any]]:
    """The system of a new file, and the names of its coordinates, inputs and parameters."""
    assert run("new begun --kind", kind)[0] == 0
    made = runpy.run_path("begun.py")
    return made["system"], {n: s for n, s in made.items() if isinstance(s, sp.Expr)}


def equation(system: dmoc.MechanicalSystem, c: Any, motion: dict[Any, Any]) -> Any:
    """Lagrange's equation of a coordinate along a motion: its inertia less its forces."""
    v = c.diff()
    inertia = system.lagrangian.diff(v).diff(TIME) - system.lagrangian.diff(c)
    drag = sp.sympify(system.dissipation).diff(v)
    return sp.expand((inertia + drag - system.forces.get(c, 0)).subs(motion).doit())


def test_blocks_of_new_files_are_moved_by_their_inputs(run: Run, tmp_path: Path) -> None:
    system, n = machine(run, "collision")
    assert equation(system, n["x"], {}) == n["m"] * n["x"].diff(TIME, 2) - n["u"]
    (tmp_path / "begun.py").unlink()
    system, n = machine(run, "contact")
    assert equation(system, n["x"], {}) == n["m"] * n["x"].diff(TIME, 2) - n["u"]
    assert equation(system, n["y"], {}) == n["m"] * n["y"].diff(TIME, 2) + n["m"] * n["g"]


def test_the_pendulum_of_a_new_file_hangs_down_and_is_damped(run: Run) -> None:
    system, n = machine(run, "smooth")
    phi, m, g, length = n["phi"], n["m"], n["g"], n["length"]
    turned = m * length**2 * phi.diff(TIME, 2) + m * g * length * sp.sin(phi)
    forces = n["torque"] - n["damping"] * phi.diff()
    assert sp.expand(equation(system, phi, {}) - turned + forces) == 0


def test_the_mechanism_of_a_new_file_is_a_hammer_with_a_spring(run: Run) -> None:
    """By its angle from hanging down, along which its forces do their work."""
    system, n = machine(run, "mechanism")
    x, y, u, m, l, g, k = (n[name] for name in ("x", "y", "u", "m", "l", "g", "k"))
    phi = dynamicsymbols("phi")
    swung = {x: l * sp.sin(phi), y: -l * sp.cos(phi)}
    left = sum(equation(system, c, swung) * swung[c].diff(phi) for c in (x, y))
    spring, weight = k * l**2 * sp.sin(phi) * sp.cos(phi), m * g * l * sp.sin(phi)
    assert sp.simplify(left - (m * l**2 * phi.diff(TIME, 2) + weight + spring - u)) == 0
    assert sp.simplify(system.constraints["rod"].subs(swung)) == 0
    power = sp.sympify(system.quantities["power"]).subs(swung).doit()
    assert sp.simplify(power - u * phi.diff()) == 0
    assert system.integrals == {"effort": u**2}
    assert sp.expand(system.objective - dmoc.total("effort")) == 0.01 * k


@pytest.mark.parametrize("kind", [kind.value for kind in TemplateKind if kind != "robot"])
def test_a_new_file_draws_what_moves_where_it_is(run: Run, kind: str) -> None:
    """The mass at the end of its rod, as high as its weight has it; contacts push as gaps open."""
    system, n = machine(run, kind)
    ends = {tuple(s.points[-1]) for s in system.drawing if isinstance(s, dmoc.Link)}
    masses = [tuple(s.at) for s in system.drawing if isinstance(s, dmoc.Point)]
    assert set(masses) == ends and bool(masses) == (kind in ("mechanism", "smooth"))
    for _, height in masses:
        weight = system.lagrangian.diff(n["g"])
        assert sp.simplify(weight + n["m"] * height) == 0
    for contact in (s for s in system.drawing if isinstance(s, dmoc.Contact)):
        surface = system.surfaces[contact.surface]
        opening = surface.gts - surface.lts
        normal = contact.normal or (0, 1)
        for c in system.coordinates:
            work = sum(d * sp.sympify(at).diff(c) for d, at in zip(normal, contact.at, strict=True))
            assert work == opening.diff(c), contact.surface


@pytest.mark.parametrize(
    ("words", "proposed"),
    [
        ("dmoc swe", ["sweep"]),
        ("dmoc solve cart_pendulum_", ["cart_pendulum_hanging"]),
        ("dmoc solve cart_pendulum --method ip", ["ipm", "ipopt"]),
        ("dmoc search cart_pendulum --method u", ["uno"]),
        ("dmoc solve cart_pendulum --sequence lower,u", ["lower,upper"]),
        ("dmoc sweep cart_pendulum --set m_", ["m_p=", "m_c="]),
        ("dmoc solve cart_pendulum_hanging --bound F", ["F="]),
        ("dmoc solve cart_pendulum --start alpha", ["alpha=", "alpha_dot="]),
        ("dmoc solve file.py:system --set m", []),
        ("dmoc new begun --kind s", ["smooth"]),
        ("dmoc simulate bounc", ["bouncing_pendulum"]),
        ("dmoc simulate cart_pendulum --set m_", ["m_p=", "m_c="]),
    ],
)
def test_the_shell_completes_models_methods_and_names(
    run: Run, monkeypatch: pytest.MonkeyPatch, words: str, proposed: list[str]
) -> None:
    monkeypatch.setenv("_DMOC_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", words)
    monkeypatch.setenv("COMP_CWORD", str(len(words.split()) - 1))
    code, out, err = run()
    assert code == 0 and not err and out.split() == proposed


KINDS = sorted(e.__name__ for e in vars(errors).values() if isinstance(e, type))


@pytest.mark.parametrize("entry", [*(k for k in KINDS if k != "DmocError"), *map(str, Status)])
def test_kinds_of_errors_and_statuses_are_explained(run: Run, entry: str) -> None:
    code, out, err = run("explain", entry)
    title, _, entry = out.partition("\n")
    assert code == 0 and not err and title and len(entry.split()) > 15
    assert "](" not in out and "{class}" not in out and "{func}" not in out


@pytest.mark.parametrize("words", ["is not given", "ModelError", "MotionError", "cannot be turned"])
def test_calls_of_an_entry_are_those_of_a_reader(run: Run, words: str) -> None:
    """Nothing stands around them that only the page has."""
    _, out, _ = run("explain", *words.split())
    assert "refused(" not in out and "lambda" not in out and "Error: " in out


def test_what_no_collision_does_is_explained_without_another_page(run: Run) -> None:
    _, out, _ = run("explain grazes")
    assert "Leave the collision out of the sequence" in " ".join(out.split()) and "See" not in out


@pytest.mark.parametrize(
    "message, entry",
    [
        ("the start (x=2) lies behind surface 'wall', 1 outside", "ProblemError"),
        ("more than 100 collisions or changes of contact within the step", "SimulationError"),
        ("NO C COMPILER", "BuildError"),
        ("too coarse", "The simulation contradicts the motion"),
    ],
)
def test_words_of_a_message_find_its_entry(run: Run, message: str, entry: str) -> None:
    code, out, _ = run("explain", *message.split())
    assert code == 0 and out.startswith(entry)


def test_what_nothing_explains_is_told(run: Run) -> None:
    code, out, err = run("explain nonsense")
    assert code == 2 and not out and "no entry has 'nonsense'" in err
    code, out, _ = run("explain")
    assert code == 0 and "not_verified" in out and "GenerationError" in out and "](" not in out


def test_an_error_names_its_entry(run: Run) -> None:
    code, _, err = run("solve pendulum")
    assert code == 2 and err.endswith(" (dmoc explain ModelError)\n")
    code, out, _ = run("solve cart_pendulum --bound F=-1:1 --starts 1 --method ipm --steps 20")
    assert code == 1 and "Help: dmoc explain infeasible" in out.splitlines()
    with pytest.raises(dmoc.DmocError) as error:
        dmoc.load("pendulum")
    again = pickle.loads(pickle.dumps(error.value))
    assert again.__notes__ == error.value.__notes__ == ["Help: dmoc explain ModelError"]


@pytest.mark.slow
def test_figures_of_every_command_are_dark_where_asked(run: Run, tmp_path: Path) -> None:
    run("solve cart_pendulum --method ipm --starts 1 -o d --dark")
    run("search puck_table --max-collisions 1 --out d --dark")
    simulated = ("cart_pendulum", "--start", "alpha=0.4", "--final-time", "1")
    run("simulate", *simulated, *"-o d --dark".split())
    run("sweep cart_pendulum --set l=0.4:0.6:2 --plot d/sweep.png --dark")
    run("plot d/solution.npz -o d/plot.png --dark")
    figures = sorted((tmp_path / "d").glob("*.png"))
    assert [f.stem for f in figures] == ["best", "plot", "simulation", "solution", "sweep", "tree"]
    assert all(imread(f)[2, 2, :3].max() < 0.2 for f in figures)


@pytest.mark.parametrize("kind", [kind.value for kind in TemplateKind])
def test_a_full_disk_leaves_no_half_of_a_new_file(
    run: Run, tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same command works when there is room again."""

    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as disk:
        disk.setattr(os, "fsync", full)
        code, _, err = run("new begun --kind", kind)
    assert code != 0 and "begun.py cannot be written (No space left on device)" in err
    assert not [*tmp_path.iterdir()]
    assert run("new begun --kind", kind)[0] == 0


def test_models_shows_the_robot_of_a_file(run: Run, tmp_path: Path) -> None:
    assert run("new begun --kind robot")[0] == 0
    runpy.run_path("begun.py")
    code, out, _ = run("models begun.urdf")
    links = [line.split()[0] for line in out.splitlines()]
    assert code == 0 and links == ["link", "stand", "upper", "lower", "hand"]
    assert "0 to 2.5 rad" in out and "±40 N m" in out
    code, _, err = run("models begun.py")
    assert code == 2 and "begun.py is no description of a robot" in err
