"""`dmoc export` and `dmoc report`: what they write."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest
from commands import Run

import dmoc


def test_tables_stand_beside_the_solution(run: Run, solution: dmoc.Solution) -> None:
    solution.save("s.npz")
    for target in ("x.csv", "x.json"):
        code, out, _ = run(f"export s.npz -o {target}")
        assert code == 0 and target in out
    rows = list(csv.reader(Path("x.csv").read_text().splitlines()))
    assert len(rows) == 1 + sum(len(phase.t) for phase in solution.phases)
    assert run("export s.npz")[0] == 0 and Path("s.csv").exists()


@pytest.mark.slow
def test_reports_are_pages_or_documents(run: Run, solution: dmoc.Solution) -> None:
    solution.save("s.npz")
    assert run("report s.npz")[0] == 0 and Path("s.html").exists()
    assert run("report s.npz -o s.pdf")[0] == 0
    assert Path("s.pdf").read_bytes().startswith(b"%PDF")
