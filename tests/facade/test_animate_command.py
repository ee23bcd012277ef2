"""``dmoc animate``: what it writes and tells."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from films import motion

import dmoc
from dmoc.cli import main


def run(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> int:
    monkeypatch.setattr(sys, "argv", ["dmoc", "animate", *arguments])
    with pytest.raises(SystemExit) as end:
        main()
    return int(end.value.code or 0)


def test_the_command_writes_a_page_beside_the_solution(
    solution: dmoc.Solution,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    file = solution.save(tmp_path / "swing_up.npz")
    assert run(monkeypatch, str(file)) == 0
    page = tmp_path / "swing_up.html"
    assert capsys.readouterr().out.replace("\n", "") == f"written: {page}"
    assert page.read_bytes() == solution.animate(tmp_path / "same.html").read_bytes()


def test_several_solutions_play_side_by_side(
    solution: dmoc.Solution, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = str(solution.save(tmp_path / "one.npz"))
    target = tmp_path / "both.html"
    assert run(monkeypatch, file, file, "-o", str(target)) == 0
    assert '"1. cart_pendulum: left"' in target.read_text("utf-8")
    gif = tmp_path / "both.gif"
    arguments = ("--speed", "1", "--fps", "3", "--dark")
    assert run(monkeypatch, file, file, "-o", str(gif), *arguments) == 0
    assert gif.read_bytes().startswith(b"GIF89a")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("nothing.npz",), "nothing.npz does not exist"),
        (("one.npz", "-o", "film.avi"), "end it in .html, .gif or .mp4"),
        (("one.npz", "-o", "film.gif", "--fps", "1000"), "fps = 1000"),
        (("one.npz", "-o", "film.gif", "--speed", "-1"), "speed = -1.0"),
    ],
)
def test_wrong_use_is_one_sentence(
    solution: dmoc.Solution,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: tuple[str, ...],
    message: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    solution.save("one.npz")
    assert run(monkeypatch, *arguments) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: ") and message in error and "Traceback" not in error


def test_a_trajectory_alone_can_be_shown(tmp_path: Path) -> None:
    assert dmoc.animate(motion(), tmp_path / "alone.html").is_file()
