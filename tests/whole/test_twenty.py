"""Twenty problems without their sequence: they are stated, run and told."""

from __future__ import annotations

from pathlib import Path

import nosnoc_stated
import pytest
import twenty
from twenty_problems import CASES

CASE = {case.name: case for case in CASES}


def test_there_are_twenty_with_a_best_motion_each() -> None:
    assert len(CASES) == len(CASE) == 20
    assert all(case.cost > 0 and case.source for case in CASES)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_words_name_what_the_system_may_touch(case: twenty.Case) -> None:
    system = case.system()
    touching = {*system.surfaces, *system.tangents}
    parts = [part for word in (*case.word, *case.contacts) for part in word.split()]
    assert {part.lstrip("+-").partition(":")[0] for part in parts} <= touching


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_every_problem_is_stated(case: twenty.Case) -> None:
    assert case.problem().sequence == () and case.named.sequence == case.word


def test_a_run_goes_on_where_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Proposals find the closed form of the puck; what is written is not solved again."""
    (record,) = twenty.every(["puck"], ["propose"], 30.0, tmp_path)
    assert record["agrees"] and record["cost"] == pytest.approx(CASE["puck"].cost, rel=1e-3)
    monkeypatch.setattr(twenty, "run", None)
    assert twenty.every(["puck"], ["propose"], 30.0, tmp_path) == [record]


def test_nosnoc_that_is_missing_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(nosnoc_stated, "version", lambda: None)
    (record,) = twenty.unit("puck", "nosnoc", 1.0, tmp_path)
    told = twenty.section([{"problem": "puck", "tool": "nosnoc", **record}], 1.0).markdown()
    assert "pip install nosnoc==0.2.0" in told and "not installed" in told


def test_the_table_tells_what_is_best_and_what_is_refused() -> None:
    records = [
        {"problem": "discs", "tool": "propose", "cost": 59.1, "agrees": True, "word": ["discs"],
         "often": [7, 26], "seconds": 1.0, "cpu": 0.5, "status": "complete"},
        {"problem": "discs", "tool": "tree", "cost": 70.0, "agrees": False, "word": [],
         "refused": "impact at 1 s", "status": "complete"},
        {"problem": "discs", "tool": "nosnoc", "status": "more than 60 s"},
        {"problem": "puck", "tool": "tree", "status": "stopped", "seconds": 60.0, "cpu": 60.0},
    ]  # fmt: skip
    told = twenty.section(records, 60.0).markdown()
    texts = [
        "| 59.1*", "7 of 26", "(70)", "more than 60 s", "none", "2038.85", "counts frozen time",
        "discs, tree: impact at 1 s", "CRISP, push box",
    ]  # fmt: skip
    assert not [text for text in texts if text not in told]
