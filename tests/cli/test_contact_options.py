"""Contacts that last on the command line: the options that state them, and what is told of them."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import pytest
from commands import CONTACT_MODELS, Run

import dmoc
from dmoc.base.errors import ProblemError
from dmoc.cli.option_values import read_events, read_names, read_periodic, read_via

HELD = "--start x=0 --final-time 4 --steps 12"
PUSHED = f"{HELD} --goal x=1,x_dot=0"
FALLS = "--start x=0 --start y=0.2 --start x_dot=1"
SLIDES = "--sequence 'rail:slip+, rail:stick'"


@pytest.fixture
def run(run: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Run:
    """The command line beside a file of models, with room for its tables."""
    monkeypatch.setenv("COLUMNS", "160")
    (tmp_path / "models.py").write_text(CONTACT_MODELS)
    return run


def table(out: str) -> dict[str, str]:
    """Rows of the summary of a solve by their first column."""
    rows = [line.strip().partition("  ") for line in out.splitlines()]
    return {name: value.strip() for name, _, value in rows}


def test_events_are_apart_by_commas() -> None:
    for read in (read_names, read_events):
        assert read("+right -left, +left -right,") == ("+right -left", "+left -right")
        assert read("left") == read(" left ,") == ("left",)
        assert read("") == read(" ") == ()


@pytest.mark.parametrize(
    ("text", "periodic"),
    [
        ("y, p_y", ("y", "p_y")),
        ("", ()),
        ("a=b,b=a", {"a": "b", "b": "a"}),
        ("x=x+0.5,y", {"x": ("x", 0.5), "y": "y"}),
        ("x = x - 5e-1", {"x": ("x", -0.5)}),
        ("x=x+?,a_dot=b_dot", {"x": ("x", None), "a_dot": "b_dot"}),
        ("x=-x,y = - y + 0.5", {"x": "-x", "y": ("-y", 0.5)}),
    ],
)
def test_states_return_as_others_and_further(text: str, periodic: Any) -> None:
    assert read_periodic(text) == periodic


def test_places_at_events_are_apart_by_semicolons() -> None:
    assert read_via("x=1,y=0.2;;x=-1:2") == [{"x": 1.0, "y": 0.2}, None, {"x": (-1.0, 2.0)}]
    with pytest.raises(ProblemError, match="--via x: expected NAME=VALUE"):
        read_via("y=1;x")


@pytest.mark.slow
def test_a_block_on_a_rail_is_told_by_words_modes_and_forces(run: Run, tmp_path: Path) -> None:
    """J = 1.63 m^2/s^3 for 1 N of friction, 1 m and 4 s, as h falls."""
    code, out, err = run(f"solve models.py:railed {PUSHED} --starts 1 {SLIDES} --out o")
    assert code == 0, err
    rows = table(out)
    assert float(rows["cost"]) == pytest.approx(1.63299316, rel=1e-2)
    assert rows["event rail:slip+"].startswith("at ") and "impulse" not in rows["event rail:stick"]
    modes = [rows[f"phase {i}"].partition("steps, ")[2] for i in range(3)]
    assert modes == ["rail:stick", "rail:slip+", "rail:stick"]
    slip = rows["event rail:slip+"].split()[1]
    assert rows["largest T of rail"] == f"-1 N at {slip} s"
    assert "collision" not in out
    kept = dmoc.Solution.load("o/solution.npz").verification
    assert kept is not None and 0 <= kept.force_error < 0.05
    assert f"force error {kept.force_error:.1e}, contacts missed 0" in " ".join(out.split())
    code, out, err = run("verify o/solution.npz --model models.py:railed")
    assert code == 0 and "passed" in out, err
    assert f"{kept.force_error:.3e} of the largest of its contact" in out
    assert run("plot o/solution.npz --out o.pdf")[0] == 0
    assert (tmp_path / "o.pdf").read_bytes()[:4] == b"%PDF"


@pytest.mark.slow
def test_a_landing_is_told_with_its_impulses(run: Run) -> None:
    """2 N s and 0.2 N s after a fall of 0.2 m under 10 m/s^2; then 10 N and 1 N."""
    command = f"solve models.py:landing {FALLS} --goal x=0.5,x_dot=0 --steps 8 --final-time 1.5 "
    command += "--sequence +floor:slip+,floor:stick --starts 1"
    code, out, err = run(command)
    assert code == 0, err
    rows = table(out)
    assert rows["event +floor:slip+"] == "at 0.2 s, impulse 2 of floor, friction -0.2 of floor"
    assert rows["phase 0"].endswith("steps, free")
    assert rows["largest N of floor"].startswith("10 N at ")
    code, out, _ = run(f"{command} --json -")
    summary = json.loads(out)
    first, second = summary["collisions"]
    event = first["event"], first["surface"], first["lands"]
    assert event == ("+floor:slip+", "floor", ["floor"]) and first["friction"] == {"floor": "slip+"}
    assert first["impulses"]["floor"] == pytest.approx(2.0)
    assert first["tractions"]["floor"] == pytest.approx(-0.2)
    assert (second["event"], second["surface"], second["impulses"]) == ("floor:stick", None, {})
    assert [p["mode"] for p in summary["phases"]] == ["free", "floor:slip+", "floor:stick"]
    forces = {(f["contact"], f["kind"]) for f in summary["largest_forces"]}
    assert forces == {("floor", "N"), ("floor", "T")}


@pytest.mark.slow
@pytest.mark.parametrize("word", ["floor:slip+", "floor"])
def test_a_hit_with_friction_is_told_with_its_impulses(run: Run, word: str) -> None:
    """After a fall of 0.2 m under 10 m/s^2 and with e = 0.5: 3 N s, and 0.3 N s of friction, whose
    0.7 m/s reach 0.34 m 0.2 s later."""
    options = f"{FALLS} --goal x=0.34 --final-time 0.4 --bound u=-1:1 --restitution 0.5"
    code, out, err = run(f"solve models.py:landing {options} --sequence {word}")
    assert code == 0, err + out
    rows = table(out)
    words = rows["event floor:slip+"].replace(",", "").split()
    assert float(words[words.index("impulse") + 1]) == pytest.approx(3, rel=1e-6)
    assert float(words[words.index("friction") + 1]) == pytest.approx(-0.3, rel=1e-6)
    assert float(rows["cost"].split()[0]) == pytest.approx(0, abs=1e-6)


@pytest.mark.slow
def test_contacts_places_and_ignored_surfaces_are_options(run: Run) -> None:
    options = f"{PUSHED} --start y=0 --starts 1 --contacts floor --ignored side --json - "
    options += "--sequence floor:slip+,floor:stick --via 'x=0;x=0.999:1.001'"
    code, out, err = run(f"solve models.py:landing {options}")
    assert code == 0, err
    summary = json.loads(out)
    assert [c["position"][0] for c in summary["collisions"]] == pytest.approx([0, 1], abs=2e-3)
    assert summary["phases"][0]["mode"] == "floor:stick"


def test_a_motion_that_ends_with_its_event_is_an_option(run: Run) -> None:
    """Thrown along the floor, the mass lands after the fall of sqrt(2/10) s."""
    options = "--start x=0 --start y=1 --start x_dot=3 --sequence +floor:slip+ --durations free,0"
    code, out, err = run(f"solve models.py:landing {options} --bound u=0:0 --starts 1 --json -")
    assert code == 0, err
    summary = json.loads(out)
    assert summary["final_time"] == pytest.approx(0.2**0.5)
    assert [phase["steps"] for phase in summary["phases"]][1:] == [0]
    assert summary["phases"][1]["mode"] == "floor:slip+"


@pytest.mark.slow
def test_a_problem_in_a_file_holds_contacts(run: Run) -> None:
    code, out, err = run("solve models.py:problem --starts 1")
    assert code == 0, err
    assert table(out)["phase 1"].endswith("floor:slip+")
    code, out, err = run("solve models.py:problem --contacts '' --starts 1")
    assert code == 1 and "floor:slip+" in out  # what is open can only be hit


@pytest.mark.slow
def test_a_block_that_comes_back_a_step_further(run: Run) -> None:
    """Periodic but for its way: at rest at both ends, 1 m further."""
    options = f"{HELD} --starts 1 --periodic x=x+1,x_dot {SLIDES}"
    code, out, err = run(f"solve models.py:railed {options} --json -")
    assert code == 0, err
    assert json.loads(out)["cost"] == pytest.approx(1.63299316, rel=1e-2)


@pytest.mark.slow
def test_a_sweep_names_the_events_of_each(run: Run) -> None:
    options = f"{HELD} --starts 1 --goal x=0.5:1:2 --goal x_dot=0 {SLIDES}"
    code, out, err = run(f"sweep models.py:railed {options} --out table.csv")
    assert code == 0, err
    rows = csv.DictReader(Path("table.csv").read_text().splitlines())
    assert [row["collisions"] for row in rows] == ["rail:slip+,rail:stick"] * 2
    assert "event 1 [s]" in out and "collision" not in out


@pytest.mark.slow
def test_a_search_begins_in_contact_and_is_resumed(run: Run) -> None:
    options = f"{PUSHED} --start y=0 --start x_dot=0.1:1 --contacts floor:slip+ --ignored side"
    for more in ("", "--resume"):
        code, out, err = run(
            f"search models.py:landing {options} --max-collisions 0 --journal j --json - {more}"
        )
        assert code == 0, err
        assert json.loads(out)["best"] is not None


@pytest.mark.slow
def test_a_search_takes_the_events_that_may_happen(run: Run) -> None:
    options = f"search models.py:railed {PUSHED} --max-collisions 2"
    code, out, err = run(f"{options} --events 'rail:slip+, rail:stick' --json -")
    assert code == 0, err
    sequences = [n["sequence"] for n in json.loads(out)["nodes"]]
    assert sequences == [[], ["rail:slip+"], ["rail:slip+", "rail:stick"]]
    code, _, err = run(f"{options} --events rail:slide")
    assert code == 2 and "events: " in err and "Traceback" not in err


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "status"),
    [
        ("rodded --start x=0,y=-1 --goal x=0.6,x_dot=0", "solved: "),
        ("railed --start x=0 --goal x=1", "infeasible: "),  # it sticks
    ],
)
def test_what_holds_in_every_phase_is_solved_with_its_order(
    run: Run, options: str, status: str
) -> None:
    """Nothing in the words says so, and no number of steps is told."""
    _, out, err = run(f"solve models.py:{options} --final-time 2 --starts 4")
    assert table(out)["status"].startswith(status), err
