"""What runs once a night: its commands are there, and what they say is kept."""

from __future__ import annotations

from pathlib import Path

import night
import pytest
from night import PARTS, Part, kept
from pages import ROOT


def test_every_part_has_its_command() -> None:
    for part in PARTS.values():
        files = [word for word in part.command if word.endswith(".py")]
        assert files and all((ROOT / file).is_file() for file in files)


def test_lines_that_tell_something_are_kept_with_the_last() -> None:
    lines = ["! a", "  b", "! c", "3 changes"]
    assert kept(lines, ("!",)) == ["! a", "! c", "3 changes"]
    assert kept(lines, ()) == lines
    assert kept([], ("!",)) == []


def test_what_parts_say_is_written_and_one_that_fails_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(night, "RESULTS", tmp_path)
    monkeypatch.setattr(night, "_commit", lambda: "abc")
    good, bad = (
        Part(("-c", "print('right')")),
        Part(("-c", "print('a'); print('b'); exit(3)"), ("a",)),
    )
    monkeypatch.setattr(night, "PARTS", {"good": good, "bad": bad})
    assert night.main(["good"]) == 0
    head, _, said = (tmp_path / "good.txt").read_text().splitlines()
    assert head.endswith(", commit abc, 0 min: passed") and said == "right"
    assert night.main([]) == 1
    head, _, *said = (tmp_path / "bad.txt").read_text().splitlines()
    assert head.endswith("failed with 3") and said == ["a", "b"]
    with pytest.raises(SystemExit):
        night.main(["other"])
