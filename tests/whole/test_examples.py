"""Every example runs, ends confirmed, and draws its motion."""

from __future__ import annotations

import re
import runpy
import sys
from functools import partial
from pathlib import Path

import pytest
from kernels import EXAMPLES, examples

import dmoc

pytestmark = pytest.mark.slow

NAMES = list(examples())
# What searches find: numbers of hops as their tree says, of which no relaxed motion has seven (the
# best one's neighbour), hits of a block as relaxed motions say, and the free motion to the puck's
# mirror image.
COSTS = {
    "hops": {"5 hops": 27.076, "6 hops": 25.898, "7 hops": 26.135},
    "push_or_flick": {"pad rail:slip+, then pad rail:slip+": 3.342, "pad rail:slip+": 3.454},
    "puck": {"cost, order 2": 0.415, "cost, order 4": 0.415},
}


@pytest.mark.parametrize("name", NAMES)
def test_example(
    name: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    as_users: bool,
) -> None:
    """What says no number of starts begins with its guess alone, unless it runs as users run it:
    the best of many takes three times as long."""
    if not as_users:
        monkeypatch.setattr(dmoc, "solve", partial(dmoc.solve, starts=1))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setattr(sys, "argv", [f"{name}.py", str(tmp_path)])
    runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
    text = capsys.readouterr().out
    assert "solved" in text and "known" in text
    for row, cost in COSTS.get(name, {}).items():
        (printed,) = re.findall(rf"^ {re.escape(row)} +(\S+)", text, re.MULTILINE)
        assert float(printed) == pytest.approx(cost, rel=1e-3), row
    assert sorted(p.name for p in tmp_path.iterdir()) == [f"{name}.npz", f"{name}.png"]


def test_examples_are_short() -> None:
    lines = {path.stem: _lines_of_code(path.read_text()) for path in EXAMPLES.glob("*.py")}
    assert len(lines) > 16 and max(lines.values()) <= 90, lines


def _lines_of_code(text: str) -> int:
    """How many lines a script has beside what it says of itself."""
    *_, code = text.split('"""\n', 2)
    return len([line for line in code.splitlines() if line and not line.startswith("#")])


@pytest.mark.parametrize("name", NAMES)
def test_an_example_asks_states_and_reads(name: str) -> None:
    text = (EXAMPLES / f"{name}.py").read_text()
    begin, *_ = text.split('"""\n', 2)
    question, *_ = begin.split("\n\n")[1:]
    assert question.endswith("?") and ".. math::" in begin
    assert ":doc:" in begin or re.search(r"\((?:19|20)\d\d\)|(?:19|20)\d\d\b", begin)  # a source
    assert text.rstrip().rpartition("\n# %%\n")[2].startswith("# How to read it\n")
