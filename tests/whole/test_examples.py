"""Every example runs cold, ends confirmed, and draws its motion."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
NAMES = (
    "seed", "block_and_wall", "two_bounces", "two_discs", "cart_pole", "hanging", "cart_links",
    "hopper", "puck", "pushed_block", "compass_gait", "stance_hopper", "finger_puck", "walker",
    "push_or_flick",
)  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_example(name: str, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / f"{name}.py"), str(tmp_path)],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env={**os.environ, "COLUMNS": "200"},
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "solved" in done.stdout and "known" in done.stdout
    assert sorted(p.name for p in tmp_path.iterdir()) == [f"{name}.npz", f"{name}.png"]


def test_examples_are_short() -> None:
    lines = {path.stem: len(path.read_text().splitlines()) for path in EXAMPLES.glob("*.py")}
    assert set(NAMES) <= set(lines) and max(lines.values()) <= 100, lines
