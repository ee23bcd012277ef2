"""`dmoc sweep`: what it reads, solves, writes and tells."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
from commands import Run

import dmoc
from dmoc.base.errors import ProblemError
from dmoc.cli.option_values import read_pairs, read_range
from dmoc.models.registry import find
from dmoc.solving import many

SEED = ("cart_pendulum", "--steps", "12")


@pytest.fixture
def run(run: Run, monkeypatch: pytest.MonkeyPatch) -> Run:
    """The command ``dmoc sweep``."""
    # Few steps are quickly solved, and rightly not confirmed.
    solved, rows = many.solved, many.solved_rows
    monkeypatch.setattr(many, "solved", lambda p, k, g, **_: solved(p, replace(k, verify=False), g))
    monkeypatch.setattr(
        many, "solved_rows", lambda p, k, g, d: rows(p, replace(k, verify=False), g, d)
    )
    return partial(run, "sweep")


def test_a_range_is_values_at_equal_distances() -> None:
    assert read_range("0.4:0.8:3", "l") == pytest.approx([0.4, 0.6, 0.8])
    assert read_range("1:-1:2", "l") == [1.0, -1.0] and read_range("2:5:1", "l") == [2.0]
    assert read_range("0:1", "l") is None and read_range("free", "l") is None


def test_parameters_have_a_value_for_each_phase() -> None:
    texts = ["k=10,50,m=2", "c=1"]
    assert read_pairs(texts, "--set", lists=2) == {"k": [10.0, 50.0], "m": 2.0, "c": 1.0}
    for text, message in (
        ("10,50", "--set 10,50: expected NAME=VALUE"),
        ("k=10,x", "--set k = 'x': expected numbers such as 10,50, one for each phase or part"),
        ("k=,10", "--set k = '': expected numbers"),
    ):
        with pytest.raises(ProblemError, match=message):
            read_pairs([text], "--set", lists=2)
    with pytest.raises(ProblemError, match="--via 2: expected NAME=VALUE"):
        read_pairs(["x=1,2"], "--via")
    assert read_pairs(["q=0,1,0,0,x=2"], "--goal", lists=4) == {"q": [0.0, 1.0, 0.0, 0.0], "x": 2.0}
    with pytest.raises(ProblemError, match="--start x has 2 values: expected one, a range LOW:H"):
        read_pairs(["x=1,2"], "--start", lists=4)


@pytest.mark.slow
def test_a_sweep_is_told_written_and_drawn(run: Run, tmp_path: Path) -> None:
    code, out, err = run(
        *SEED, *"--set l=0.4:0.6:3 --set g=10 --out table.csv --plot figure.png".split()
    )
    assert code == 0 and err == ""
    assert "3 solved" in out and "written: table.csv" in out and "written: figure.png" in out
    with open("table.csv", newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert [float(r["l"]) for r in rows] == pytest.approx([0.4, 0.5, 0.6])
    solved = dmoc.solve(_problem(l=0.6, g=10.0), "ipm", starts=1, verify=False)
    assert float(rows[2]["cost"]) == solved.cost
    assert Path("figure.png").read_bytes().startswith(b"\x89PNG")


def _problem(**parameters: float) -> dmoc.Problem:
    reference = find("cart_pendulum")
    fields = {**reference.defaults, "steps": 12, "parameters": parameters}
    return dmoc.Problem(reference.kernels(), **fields)


def test_limits_starts_and_goals_are_swept_too(run: Run) -> None:
    code, out, _ = run(
        *SEED, *(
"--bound F=15:80:2 --start x=0:0.1:2 --goal x_dot=0:0:1 --out "
"grid.npz --plot map.png --json -"
).split())  # fmt: skip
    assert code == 1  # some cannot be solved
    printed = json.loads(out)
    assert printed["columns"]["bounds F"] == [15.0, 80.0] * 2
    batch = dmoc.Batch.load("grid.npz")
    assert batch.status == tuple(printed["columns"]["status"])
    assert batch.status == ("infeasible", "solved") * 2
    assert not Path("map.png").exists()  # over three values


def test_the_solution_of_a_neighbour_is_the_start_of_all(run: Run) -> None:
    dmoc.solve(_problem(), "ipm", verify=False).save("nominal.npz")
    code, _, _ = run(*SEED, *"--set l=0.5:0.51:2 --guess nominal.npz --out t.npz".split())
    assert code == 0 and dmoc.Batch.load("t.npz").iterations.max() < 15
