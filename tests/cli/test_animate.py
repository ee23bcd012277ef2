"""``dmoc animate``: what it writes and tells."""

from __future__ import annotations

from pathlib import Path

import pytest
from commands import Run
from films import motion

import dmoc


def test_the_command_writes_a_page_beside_the_solution(
    run: Run, solution: dmoc.Solution, tmp_path: Path
) -> None:
    file = solution.save(tmp_path / "swing_up.npz")
    code, out, _ = run(f"animate {file}")
    page = tmp_path / "swing_up.html"
    assert code == 0 and out.replace("\n", "") == f"written: {page}"
    assert page.read_bytes() == solution.animate(tmp_path / "same.html").read_bytes()


@pytest.mark.slow
def test_several_solutions_play_side_by_side(
    run: Run, solution: dmoc.Solution, tmp_path: Path
) -> None:
    solution.save(tmp_path / "one.npz")
    assert run("animate one.npz one.npz -o both.html")[0] == 0
    assert '"1. cart_pendulum: lower"' in (tmp_path / "both.html").read_text("utf-8")
    assert run("animate one.npz one.npz -o both.gif --speed 1 --fps 3 --dark")[0] == 0
    assert (tmp_path / "both.gif").read_bytes().startswith(b"GIF89a")


def test_a_trajectory_alone_can_be_shown(tmp_path: Path) -> None:
    assert dmoc.animate(motion(), tmp_path / "alone.html").is_file()
